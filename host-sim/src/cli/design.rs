//! `host-sim design`: gains from a drive file.

use crate::corridor::gains_source;
use crate::design::Design;
use crate::design::checks::Verdict;
use crate::design::judgement::Judgement;
use crate::drive::{DEFAULT_NAME, Drive};
use crate::error::{Error, Result};
use crate::output::{print, write_file};
use crate::report::{horizon, table};
use clap::Args;
use nalgebra::{Complex, DMatrix};
use serde_json::json;
use std::path::PathBuf;

/// Design regulator and observer of a drive.
#[derive(Debug, Args)]
pub(super) struct DesignCommand {
    /// Description of the drive; the paper's rig when not given.
    drive: Option<PathBuf>,
    /// Print the design as JSON, SI units.
    #[arg(long)]
    json: bool,
    /// Write the gains as Rust source for the firmware.
    #[arg(long, value_name = "PATH")]
    rust: Option<PathBuf>,
    /// Plot how the finite-horizon gain of eq. (14) tends to the constant one, as SVG.
    #[arg(long, value_name = "PATH")]
    plot: Option<PathBuf>,
}

impl DesignCommand {
    pub(super) fn run(self) -> Result<()> {
        let drive = Drive::load(self.drive.as_deref())?;
        let design = Design::new(&drive)?;
        let judged = Judgement::new(&design)?;
        let name = self.drive.as_ref().and_then(|path| path.file_name());
        let origin = name.map_or(DEFAULT_NAME.into(), |name| name.to_string_lossy());
        let refused = judged
            .checks
            .iter()
            .find(|check| check.verdict == Verdict::Refuse);
        if let (Some(path), None) = (&self.rust, refused) {
            write_file(path, gains_source(&design, &origin).as_bytes())?;
        }
        if let Some(path) = &self.plot {
            write_file(path, horizon::plot(&design)?.as_bytes())?;
        }
        if self.json {
            print(&format!("{:#}\n", as_json(&design, &judged)?))?;
        } else {
            let mut text = format!("design for {origin}\n{}", table::design(&design)?);
            text += &table::judgement(&judged);
            if let (Some(path), None) = (&self.rust, refused) {
                text += &format!("gains written to {}\n", path.display());
            }
            if let Some(path) = &self.plot {
                text += &format!("plot written to {}\n", path.display());
            }
            print(&text)?;
        }
        match refused {
            None => Ok(()),
            Some(check) => Err(Error::Design(format!(
                "the check {} refuses it ({:.4e}, limit {:.4e}): {}",
                check.name, check.value, check.limit, check.advice
            ))),
        }
    }
}

fn as_json(design: &Design, judged: &Judgement) -> Result<serde_json::Value> {
    let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    let poles = |poles: Vec<Complex<f64>>| -> Vec<[f64; 2]> {
        poles.iter().map(|pole| [pole.re, pole.im]).collect()
    };
    let observer = &design.observer;
    Ok(json!({
        "kind": design.drive.kind,
        "a": rows(&design.chain.a()),
        "b": design.chain.b().as_slice(),
        "ad": rows(&design.ad),
        "bd": design.bd.as_slice(),
        "k": design.regulator.as_slice(),
        "regulator_poles": poles(design.regulator_poles()?),
        "observer": table::observer_name(design.form()),
        "observer_transition": rows(&observer.transition),
        "observer_input": observer.input.as_slice(),
        "observer_output": observer.output.as_slice(),
        "observer_gain": observer.correction.as_slice(),
        "observer_poles": poles(design.observer_poles()?),
        "modes": design.modes(),
        "distinct_eigenvalues": judged.distinct_eigenvalues,
        "checks": judged.checks,
        "margins": judged.margins,
        "margins_full_state": judged.margins_full_state,
        "finite_horizon": judged.finite_horizon,
    }))
}
