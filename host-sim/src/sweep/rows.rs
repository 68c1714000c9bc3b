//! A row of the table: which sample, which law, what was drawn, and all figures of the run.

use super::table::{Cell, Kind, Schema};
use super::variation::{Variation, figure, shown};
use crate::simulate::ending::Motion;
use crate::simulate::metrics::Metrics;
use toml::Value;

/// Names of the columns that others look for.
pub(super) const LAW: &str = "law";
pub(super) const SETTLING: &str = "settling_time";
pub(super) const FAULT: &str = "fault";
pub(super) const FAILURE: &str = "failure";

/// What a column is of a run.
type OfRun = Box<dyn Fn(&Metrics) -> Option<f64> + Sync>;

/// A column of figures: its name, and what it is of a run.
type Figure = (String, OfRun);

/// How a run and a sample become a row.
pub(super) struct Rows {
    numeric: Vec<bool>,
    figures: Vec<Figure>,
    schema: Schema,
}

impl Rows {
    /// * `loads`: of every plant
    pub(super) fn new(variation: &Variation, loads: usize) -> Self {
        let figures = figures(loads);
        let mut schema = vec![("sample".into(), Kind::Integer), (LAW.into(), Kind::Text)];
        let keys = variation.keys();
        schema.extend(keys.map(|(name, numeric)| {
            let kind = if numeric { Kind::Number } else { Kind::Text };
            (name.to_owned(), kind)
        }));
        let figure = figures.iter().map(|(name, _)| (name.clone(), Kind::Number));
        schema.extend(figure);
        schema.extend([
            ("end_state".into(), Kind::Text),
            (FAULT.into(), Kind::Integer),
            (FAILURE.into(), Kind::Text),
        ]);
        Self {
            numeric: variation.keys().map(|(_, numeric)| numeric).collect(),
            figures,
            schema,
        }
    }

    /// The columns.
    pub(super) fn schema(&self) -> &Schema {
        &self.schema
    }

    /// One row.
    pub(super) fn row(
        &self,
        sample: u64,
        law: &str,
        values: &[Value],
        result: &Result<Metrics, String>,
    ) -> Vec<Cell> {
        let mut row = vec![
            Cell::Integer(Some(sample as i64)),
            Cell::Text(Some(law.into())),
        ];
        let keys = values.iter().zip(&self.numeric);
        row.extend(keys.map(|(value, numeric)| match numeric {
            true => Cell::Number(figure(value)),
            false => Cell::Text(Some(shown(value))),
        }));
        let metrics = result.as_ref().ok();
        let figures = self.figures.iter();
        row.extend(figures.map(|(_, figure)| Cell::Number(metrics.and_then(figure))));
        let state = metrics.map(|metrics| match metrics.end.state {
            Motion::Rest => "rest",
            Motion::Moving => "moving",
            Motion::Hunting => "hunting",
        });
        row.extend([
            Cell::Text(state.map(Into::into)),
            Cell::Integer(metrics.and_then(|metrics| metrics.fault).map(Into::into)),
            Cell::Text(result.as_ref().err().cloned()),
        ]);
        row
    }
}

/// All figures of a run, in the order of their columns; names as in the JSON of `simulate`.
fn figures(loads: usize) -> Vec<Figure> {
    let mut all: Vec<Figure> = Vec::new();
    let mut add = |name: &str, figure: OfRun| {
        all.push((name.into(), figure));
    };
    add(SETTLING, Box::new(|m| m.settling_time));
    add("within_band_from", Box::new(|m| m.within_band_from));
    add(
        "within_tolerance_from",
        Box::new(|m| m.within_tolerance_from),
    );
    add(
        "settling_tolerance",
        Box::new(|m| Some(m.settling_tolerance)),
    );
    add("overshoot", Box::new(|m| Some(m.overshoot)));
    add(
        "residual_vibration",
        Box::new(|m| {
            let each = m.residual_vibration.as_ref()?.iter().copied();
            each.reduce(f64::max)
        }),
    );
    let of_mass = |mass: usize| match mass {
        0 => "actuator".to_owned(),
        load => format!("load{load}"),
    };
    for mass in 0..=loads {
        add(
            &format!("residual_vibration_{}", of_mass(mass)),
            Box::new(move |m| m.residual_vibration.as_ref()?.get(mass).copied()),
        );
    }
    add("offset", Box::new(|m| m.offset));
    add("peak_current", Box::new(|m| Some(m.peak_current)));
    for mass in 0..=loads {
        add(
            &format!("estimation_error_{}", of_mass(mass)),
            Box::new(move |m| m.estimation_error.as_ref()?.get(mass).copied()),
        );
    }
    for (place, which) in ["actuator", "controlled"].into_iter().enumerate() {
        add(
            &format!("end_offset_{which}"),
            Box::new(move |m| m.end.offset.get(place).copied()),
        );
        add(
            &format!("end_motion_{which}"),
            Box::new(move |m| m.end.motion.get(place).copied()),
        );
    }
    add("end_from", Box::new(|m| Some(m.end.from)));
    add("end_tolerance", Box::new(|m| Some(m.end.tolerance)));
    add("fault_time", Box::new(|m| m.fault_time));
    all
}
