//! `host-sim compare`: the drive beside its rivals.

use crate::compare::{Outcome, Row, Tuning, compare, duration};
use crate::design::Design;
use crate::drive::{DEFAULT_NAME, Drive, Units};
use crate::error::Result;
use crate::metrics::controlled_mass;
use crate::output::print;
use clap::Args;
use comfy_table::{Table, presets};
use serde_json::json;
use std::path::PathBuf;

/// Set the drive beside its rivals, on plants that differ.
///
/// The rivals are tuned in the same run for the least worst settling time over the plants whose springs,
/// last load and force constant differ: collocated PD alone and with ZV, ZVD and EI shapers, and a Kalman
/// filter on the encoder, which is tuned on the plant with friction as well. Only that one has Coulomb
/// friction. Feedback of the true state is the bound of the drive's gain without friction.
#[derive(Debug, Args)]
pub(super) struct CompareCommand {
    /// Description of the drive; the paper's rig when not given.
    drive: Option<PathBuf>,
    /// Print the figures as JSON, SI units.
    #[arg(long)]
    json: bool,
}

impl CompareCommand {
    pub(super) fn run(self) -> Result<()> {
        let drive = Drive::load(self.drive.as_deref())?;
        let design = Design::new(&drive)?;
        let rows = compare(&design)?;
        if self.json {
            return print(&format!(
                "{:#}\n",
                json!({ "kind": drive.kind, "laws": rows })
            ));
        }
        let name = self.drive.as_ref().map(|path| path.display().to_string());
        let units = drive.kind.units();
        print(&format!(
            "drive: {}\n\
             Step of 30 {}, runs of {:.2} s. Each cell: settling time of mass {} to 2 % [ms] / \
             overshoot [%] / residual vibration [{} p-p].\n\n{}\n\n{}",
            name.unwrap_or(DEFAULT_NAME.into()),
            units.milli_position,
            duration(&design),
            controlled_mass(design.loads()),
            units.micro_position,
            table(&rows, controlled_mass(design.loads())),
            tunings(&rows, units),
        ))
    }
}

fn table(rows: &[Row], mass: usize) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let cases = rows.first().into_iter().flat_map(|row| &row.outcomes);
    table.set_header(
        std::iter::once("law".to_owned()).chain(cases.map(|outcome| outcome.case.clone())),
    );
    for row in rows {
        let cells = row.outcomes.iter().map(|outcome| cell(outcome, mass));
        table.add_row(std::iter::once(row.law.to_owned()).chain(cells));
    }
    table
}

fn cell(outcome: &Outcome, mass: usize) -> String {
    let Some(metrics) = &outcome.metrics else {
        return "failed".into();
    };
    if let Some(fault) = metrics.fault {
        return format!("fault {fault}");
    }
    let Some(settled) = metrics.settling_time else {
        return format!("not settled / {:.1}", metrics.overshoot);
    };
    let residual = metrics.residual_vibration.as_ref();
    let residual = residual.and_then(|masses| masses.get(mass));
    format!(
        "{:.0} / {:.1} / {}",
        1e3 * settled,
        metrics.overshoot,
        residual.map_or("-".into(), |x| format!("{:.0}", 1e6 * x))
    )
}

/// What the rivals were tuned to, a line each, and why a law failed.
fn tunings(rows: &[Row], units: &Units) -> String {
    let mut text = String::new();
    for row in rows {
        match &row.tuning {
            Tuning::Design => {}
            Tuning::Pd(pd) => {
                text += &format!(
                    "{}: {:.2} {}, {:.3} {}",
                    row.law,
                    pd.position_gain,
                    units.position_gain,
                    pd.velocity_gain,
                    units.velocity_gain
                );
                if row.law != "PD" {
                    text += &format!(
                        ", ramps of {:.1} ms, shaper for {:.2} Hz and damping ratio {:.2}",
                        1e3 * pd.ramp,
                        pd.frequency / std::f64::consts::TAU,
                        pd.damping
                    );
                }
                text += "\n";
            }
            Tuning::Encoder(filter) => {
                let force = units.force;
                text += &format!(
                    "{}: {:.2e} {force}/sqrt(Hz) on each load, disturbance {:.2e} {force}/sqrt(s)\n",
                    row.law, filter.load_force, filter.disturbance
                );
            }
        }
        for outcome in &row.outcomes {
            if let Some(failure) = &outcome.failure {
                text += &format!("{}, {}: {failure}\n", row.law, outcome.case);
            }
        }
    }
    text
}
