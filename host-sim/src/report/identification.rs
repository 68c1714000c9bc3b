//! What was identified: a table, JSON, and how well the model explains the log as a plot.

use super::plot::{Panel, Series, panels};
use crate::drive::Drive;
use crate::error::Result;
use crate::identify::{Experiment, Identification, Unit, model_response};
use crate::machine::Units;
use crate::output::significant;
use comfy_table::{Cell, CellAlignment, Table, presets};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;

/// A quantity in JSON.
#[derive(Clone, Debug, Serialize)]
struct Entry {
    /// SI; nothing where the record does not determine it.
    value: Option<f64>,
    /// Standard deviation.
    std: Option<f64>,
    /// Unit.
    unit: &'static str,
    /// Whether it was taken from the drive file.
    held: bool,
}

/// Each quantity for JSON, by its key in the drive file, and the fit.
#[must_use]
pub fn json(drive: &Drive, identification: &Identification) -> serde_json::Value {
    let units = drive.kind.units();
    let entries = identification.quantities.iter().map(|identified| {
        let entry = Entry {
            value: identified.known.then_some(identified.value),
            std: identified.known.then_some(identified.std),
            unit: identified.quantity.unit(units),
            held: identified.held,
        };
        (identified.quantity.name(), entry)
    });
    let entries: BTreeMap<String, Entry> = entries.collect();
    let figures: Vec<_> = identification
        .figures
        .iter()
        .map(|figure| {
            json!({
                "name": figure.name,
                "value": figure.known().then_some(figure.value),
                "std": figure.known().then_some(figure.std),
                "unit": unit(figure.unit, units),
            })
        })
        .collect();
    json!({
        "parameters": entries,
        "figures": figures,
        "remarks": identification.remarks,
        "error_rms_counts": identification.error_rms,
        "fit_percent": identification.fit_percent,
    })
}

/// Unit of a figure.
fn unit(unit: Unit, units: &Units) -> String {
    match unit {
        Unit::AccelerationPerAmpere => format!("({})/A", units.acceleration),
        Unit::Hertz => "Hz".into(),
        Unit::One => "1".into(),
    }
}

/// What is not known from the log.
const NOT_KNOWN: &str = "not known";

/// Every quantity with three standard deviations, and what the drive file said.
#[must_use]
pub fn table(drive: &Drive, identification: &Identification) -> String {
    let units = drive.kind.units();
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "quantity",
        "value",
        "+- 3 sigma",
        "unit",
        "drive file",
        "change",
    ]);
    let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
    for identified in &identification.quantities {
        let change = identified.value - identified.before;
        let deviation = if identified.held {
            "held".into()
        } else {
            format!("{:.2e}", 3.0 * identified.std)
        };
        if !identified.known {
            table.add_row([
                Cell::new(identified.quantity.name()),
                right(NOT_KNOWN.into()),
                right(String::new()),
                Cell::new(identified.quantity.unit(units)),
                right(significant(identified.before, 6)),
                right(String::new()),
            ]);
            continue;
        }
        let change = if identified.held || identified.before == 0.0 {
            String::new()
        } else {
            format!("{:+.2} %", 100.0 * change / identified.before)
        };
        table.add_row([
            Cell::new(identified.quantity.name()),
            right(significant(identified.value, 6)),
            right(deviation),
            Cell::new(identified.quantity.unit(units)),
            right(significant(identified.before, 6)),
            right(change),
        ]);
    }
    let left_out = match identification.left_out {
        0 => String::new(),
        periods => format!("the last {periods} control periods of the log were not needed\n"),
    };
    let mut whole = Table::new();
    whole.load_style(presets::ASCII_MARKDOWN);
    whole.set_header(["of the whole", "value", "+- 3 sigma", "unit"]);
    for figure in &identification.figures {
        let [value, deviation] = if figure.known() {
            [
                significant(figure.value, 6),
                format!("{:.2e}", 3.0 * figure.std),
            ]
        } else {
            [NOT_KNOWN.into(), String::new()]
        };
        whole.add_row([
            Cell::new(&figure.name),
            right(value),
            right(deviation),
            Cell::new(unit(figure.unit, units)),
        ]);
    }
    let remarks = identification.remarks.iter();
    let remarks = remarks.fold(String::new(), |text, remark| text + remark + "\n");
    format!(
        "{table}\n{whole}\n{remarks}fit: {:.2} % of the motion above half of the slowest mode, simulated from the current \
         alone\n{left_out}",
        identification.fit_percent
    )
}

/// Motion, innovations, their correlation and the frequency response, as SVG.
///
/// # Errors
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
pub fn plot(
    drive: &Drive,
    identification: &Identification,
    experiment: Experiment,
) -> Result<String> {
    let period = drive.control.sample_time;
    let units = drive.kind.units();
    let line = |values: &mut dyn Iterator<Item = f64>| -> Vec<(f64, f64)> {
        let timed = values.enumerate();
        timed.map(|(k, value)| (k as f64 * period, value)).collect()
    };
    let motion: Vec<Series> = vec![
        Series::line(
            "measured",
            0,
            line(&mut identification.fitted.iter().map(|pair| 1e3 * pair.0)),
        ),
        Series::line(
            "simulated",
            1,
            line(&mut identification.fitted.iter().map(|pair| 1e3 * pair.1)),
        ),
    ];
    let innovations = vec![Series::line(
        "innovation",
        0,
        line(&mut identification.innovations.iter().map(|e| 1e6 * e)),
    )];
    let correlation = identification.correlation.iter().enumerate().skip(1);
    let correlation = vec![Series::line(
        "correlation",
        0,
        correlation
            .map(|(lag, value)| (lag as f64 * period, *value))
            .collect(),
    )];
    let position = format!("position [{}]", units.milli_position);
    let small = format!("innovation [{}]", units.micro_position);
    let ratio = format!("dB of 1 ({})/A", units.acceleration);
    let mut content = vec![
        Panel {
            caption: "motion, slow part left out",
            axes: ("time [s]", &position),
            series: motion,
            ..Panel::default()
        },
        Panel {
            caption: "residual",
            axes: ("time [s]", &small),
            series: innovations,
            ..Panel::default()
        },
        Panel {
            caption: "correlation of the residual",
            axes: ("lag [s]", "1"),
            series: correlation,
            ..Panel::default()
        },
    ];
    if experiment == Experiment::Excitation {
        let chain = identification.machine.chain();
        let hz = |omega: f64| omega / std::f64::consts::TAU;
        let decibel = |magnitude: f64| 20.0 * magnitude.log10();
        let points = &identification.response;
        let response = vec![
            Series::line(
                "measured",
                0,
                points
                    .iter()
                    .map(|point| (hz(point.omega), decibel(point.response.norm())))
                    .collect::<Vec<_>>(),
            ),
            Series::line(
                "model",
                1,
                points
                    .iter()
                    .map(|point| {
                        let model = model_response(chain, point.omega, period);
                        (hz(point.omega), decibel(model.norm()))
                    })
                    .collect(),
            ),
        ];
        content.push(Panel {
            caption: "acceleration over current",
            axes: ("frequency [Hz]", &ratio),
            series: response,
            ..Panel::default()
        });
    }
    panels("identification", &content)
}
