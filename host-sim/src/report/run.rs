//! One experiment: motion, its error enlarged, current within its limits, what the observer misses, and the
//! phase portraits of the first and the second mass as the paper draws them.

use super::plot::{Panel, Series, panels};
use crate::chain::controlled_mass;
use crate::drive::SETTLING_BAND;
use crate::error::Result;
use crate::simulate::{Run, Sample};

/// How much longer than the motion the time axis is.
const LONGER: f64 = 1.4;
/// Shortest time axis, control periods.
const SHORTEST: usize = 50;
/// Share of the limit below which a current is drawn without it.
const SMALL: f64 = 0.2;
/// Half height of the enlarged error, in settling bands.
const ENLARGED: f64 = 4.0;

/// Draws the core's run with the full-state bound behind it, as SVG.
///
/// * `limit`: of the current, A
///
/// # Errors
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
pub fn plot(core: &Run, bound: &Run, limit: f64) -> Result<String> {
    let units = core.kind.units();
    let masses = masses(core);
    let whole = core.samples.len();
    let shown = moving(core).max(moving(bound)).min(whole);
    let (drive, full) = (
        &core.samples[..shown],
        &bound.samples[..shown.min(bound.samples.len())],
    );
    let last = drive.last().map_or(0.0, |sample| sample.time);
    let times = (0.0, last);
    let mut title = format!("{}: {}", core.scenario.name, core.scenario.title(core.kind));
    if shown < whole {
        let all = core.samples.last().map_or(0.0, |sample| sample.time);
        title += &format!(
            " (the first {last:.3} s of {all:.3} s, then all within 1 % of where they end)"
        );
    }

    let milli = format!("position [{}]", units.milli_position);
    let micro = format!("error [{}]", units.micro_position);
    let velocity = format!("velocity [{}]", units.velocity);
    let over = "time [s]";
    let position = |mass: usize| move |s: &Sample| Some(1e3 * s.truth[2 * mass]);
    let each = |line: &dyn Fn(usize) -> Series| -> Vec<Series> { (0..masses).map(line).collect() };

    let reference = series(drive, |s| Some(1e3 * s.reference));
    let mut motion = vec![Series::behind("reference", reference)];
    motion.extend(each(&|mass| {
        let points = series(drive, position(mass));
        Series::line(name(mass), mass, points)
    }));

    let band = 1e3 * band(core);
    let mut error = Series::bounds("2 % of the way", &[-band, band], times);
    error.extend(each(&|mass| {
        let points = series(drive, |s| Some(1e3 * (s.truth[2 * mass] - s.reference)));
        Series::line(name(mass), mass, points)
    }));

    let (current_caption, current) = current(drive, full, limit, times);

    let missed = (1..masses).map(|mass| {
        let points = series(drive, |s| {
            let estimate = s.record.as_ref()?.load_position.get(mass - 1)?;
            Some(1e6 * (f64::from(*estimate) - s.truth[2 * mass]))
        });
        Series::line(name(mass), mass, points)
    });

    let mut content = vec![
        Panel {
            caption: "motion",
            axes: (over, &milli),
            series: motion,
            ..Panel::default()
        },
        Panel {
            caption: "distance from the reference, enlarged",
            axes: (over, &milli),
            series: error,
            heights: (band > 0.0).then_some((-ENLARGED * band, ENLARGED * band)),
            ..Panel::default()
        },
        Panel {
            caption: &current_caption,
            axes: (over, "current [A]"),
            series: current,
            ..Panel::default()
        },
        Panel {
            caption: "estimate minus truth",
            axes: (over, &micro),
            series: missed.collect(),
            ..Panel::default()
        },
    ];
    let mut portraits = vec![1, controlled_mass(masses.saturating_sub(1))];
    portraits.dedup();
    let captions: Vec<String> = portraits
        .iter()
        .map(|mass| format!("phase portrait of mass {mass}"))
        .collect();
    for (mass, caption) in portraits.into_iter().zip(&captions) {
        let portrait = |samples: &[Sample]| -> Vec<(f64, f64)> {
            let points = samples.iter();
            points
                .map(|s| (1e3 * s.truth[2 * mass], s.truth[2 * mass + 1]))
                .collect()
        };
        content.push(Panel {
            caption,
            axes: (&milli, &velocity),
            series: vec![
                Series::behind("full state", portrait(full)),
                Series::line("drive", mass, portrait(drive)),
            ],
            ..Panel::default()
        });
    }
    panels(&title, &content)
}

/// Caption and lines of the current; far from its limits it would be a flat line between them, and is drawn
/// without.
fn current(
    drive: &[Sample],
    full: &[Sample],
    limit: f64,
    times: (f64, f64),
) -> (String, Vec<Series>) {
    let commands = drive.iter().chain(full).map(|s| s.command.abs());
    let peak = commands.fold(0.0, f64::max);
    let small = peak > 0.0 && peak < SMALL * limit;
    let mut lines = Vec::new();
    if !small {
        lines = Series::bounds("limit", &[-limit, limit], times);
    }
    lines.push(Series::behind(
        "full state",
        series(full, |s| Some(s.command)),
    ));
    lines.push(Series::line("drive", 1, series(drive, |s| Some(s.command))));
    let enlarged = if small { ", enlarged" } else { "" };
    (format!("current, limited to {limit} A{enlarged}"), lines)
}

fn masses(run: &Run) -> usize {
    let first = run.samples.first();
    first.map_or(0, |sample| sample.truth.len() / 2)
}

fn name(mass: usize) -> String {
    if mass == 0 {
        "x_a".into()
    } else {
        format!("x_{mass}")
    }
}

/// Half width of the band in which the controlled mass counts as settled, m.
fn band(run: &Run) -> f64 {
    let controlled = 2 * controlled_mass(masses(run).saturating_sub(1));
    let start = run.samples.first().map_or(0.0, |s| s.truth[controlled]);
    SETTLING_BAND * (run.scenario.target - start).abs()
}

/// Samples up to some time after the last one in which a mass is not where it ends, on its target or beside it,
/// or the reference not at its end; all of them when that goes on to the end.
fn moving(run: &Run) -> usize {
    let band = band(run) / 2.0;
    let target = run.scenario.target;
    let end = run.samples.last().map_or(&[][..], |s| s.truth.as_slice());
    let moves = |s: &Sample| {
        let positions = s.truth.iter().zip(end).step_by(2);
        positions.into_iter().any(|(x, end)| (x - end).abs() > band)
            || (s.reference - target).abs() > band
    };
    let last = run.samples.iter().rposition(moves).unwrap_or(0);
    let shown = (LONGER * last as f64) as usize;
    shown.max(SHORTEST).min(run.samples.len())
}

fn series(samples: &[Sample], value: impl Fn(&Sample) -> Option<f64>) -> Vec<(f64, f64)> {
    let points = samples.iter();
    points
        .filter_map(|sample| Some((sample.time, value(sample)?)))
        .collect()
}
