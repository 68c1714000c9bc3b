//! One experiment: motion, its distance from the target enlarged twice, current within its limits, what the
//! observer misses, and the phase portraits of the first and the second mass as the paper draws them.

use super::plot::{Panel, Series, panels};
use crate::chain::controlled_mass;
use crate::drive::SETTLING_BAND;
use crate::error::Result;
use crate::machine::Units;
use crate::simulate::experiment::Aim;
use crate::simulate::metrics::HELD;
use crate::simulate::{Run, Sample};

/// How much longer than the motion the time axis is.
const LONGER: f64 = 1.4;
/// Shortest time axis, control periods.
const SHORTEST: usize = 50;
/// Share of the limit below which a current is drawn without it.
const SMALL: f64 = 0.2;
/// Half height of an enlarged error, in settling bands, and in tolerances.
const ENLARGED: f64 = 4.0;
const FURTHER: f64 = 2.0;
/// The same over the error that is left at the end, where that is more.
const LEFT: f64 = 1.5;
/// Shades of the two bands.
const SHADES: (f64, f64) = (0.3, 0.8);

/// Draws the core's run with that of full-state feedback behind it, as SVG.
///
/// * `title`: what the run shows
/// * `aims`: in order, one at least
/// * `limit`: of the current, A
///
/// # Errors
/// [`Error::Report`](crate::error::Error::Report) when the drawing cannot be made.
pub fn plot(core: &Run, full_state: &Run, title: &str, aims: &[Aim], limit: f64) -> Result<String> {
    let units = core.kind.units();
    let masses = masses(core);
    let shown = moving(core, aims).max(moving(full_state, aims));
    let shown = shown.min(core.samples.len());
    let (drive, full) = (
        &core.samples[..shown],
        &full_state.samples[..shown.min(full_state.samples.len())],
    );
    let last = drive.last().map_or(0.0, |sample| sample.time);
    let times = (0.0, last);
    let title = title.to_owned() + &cut_short(core, aims, shown);

    let milli = format!("position [{}]", units.milli_position);
    let milli_distance = format!("distance [{}]", units.milli_position);
    let micro_distance = format!("distance [{}]", units.micro_position);
    let micro_error = format!("error [{}]", units.micro_position);
    let velocity = format!("velocity [{}]", units.velocity);
    let over = "time [s]";
    let position = |mass: usize| move |s: &Sample| Some(1e3 * s.truth[2 * mass]);
    let each = |line: &dyn Fn(usize) -> Series| -> Vec<Series> { (0..masses).map(line).collect() };

    let bands: Vec<Band> = bands(core, aims, last);
    let mut motion = of_the_way(&bands, |band| band.target);
    motion.push(Series::behind(
        "reference",
        series(drive, |s| Some(1e3 * s.reference)),
    ));
    motion.extend(each(&|mass| {
        let points = series(drive, position(mass));
        Series::line(name(mass), mass, points)
    }));

    let (enlarged, height) = enlarged(core, drive, aims, &bands);
    let (after, small) = after_arrival(core, drive, aims, &bands);

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
            caption: "distance from the target, enlarged",
            axes: (over, &milli_distance),
            series: enlarged,
            heights: Some((-height, height)),
            ..Panel::default()
        },
        Panel {
            caption: "distance from the target after arrival, enlarged further",
            axes: (over, &micro_distance),
            series: after,
            heights: Some((-small, small)),
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
            axes: (over, &micro_error),
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

/// What a title says of a run that is not shown whole.
fn cut_short(run: &Run, aims: &[Aim], shown: usize) -> String {
    let time = |sample: Option<&Sample>| sample.map_or(0.0, |sample| sample.time);
    if shown >= run.samples.len() {
        return String::new();
    }
    format!(
        " (the first {:.3} s of {:.3} s, then all within {} of where they end)",
        time(run.samples[..shown].last()),
        time(run.samples.last()),
        micro(ended(run, aims), run.kind.units())
    )
}

/// The bands of 2 % around something, mm.
fn of_the_way(bands: &[Band], around: impl Fn(&Band) -> f64) -> Vec<Series> {
    let each = bands.iter().enumerate().map(|(number, band)| {
        let name = if number == 0 { "2 % of the way" } else { "" };
        let (middle, half) = (1e3 * around(band), 1e3 * band.half_width);
        Series::band(name, SHADES.0, (middle - half, middle + half), band.times)
    });
    each.collect()
}

/// The settling tolerance, in parts of a metre.
fn within_tolerance(run: &Run, parts: f64, times: (f64, f64)) -> Series {
    let tolerance = run.settling_tolerance;
    let name = format!("tolerance {}", micro(tolerance, run.kind.units()));
    let half = parts * tolerance;
    Series::band(name, SHADES.1, (-half, half), times)
}

/// Distance of every mass from the target, in parts of a metre.
fn distances(samples: &[Sample], aims: &[Aim], parts: f64) -> Vec<Series> {
    let masses = samples.first().map_or(0, |s| s.truth.len() / 2);
    let each = (0..masses).map(|mass| {
        let points = series(samples, |s| Some(parts * distance(s, mass, aims)));
        Series::line(name(mass), mass, points)
    });
    each.collect()
}

fn distance(sample: &Sample, mass: usize, aims: &[Aim]) -> f64 {
    sample.truth[2 * mass] - aim(aims, sample.time).target
}

/// Distance from the target with both bands, and the half height that shows both, mm.
fn enlarged(run: &Run, drive: &[Sample], aims: &[Aim], bands: &[Band]) -> (Vec<Series>, f64) {
    let last = drive.last().map_or(0.0, |sample| sample.time);
    let mut lines = of_the_way(bands, |_| 0.0);
    lines.push(within_tolerance(run, 1e3, (0.0, last)));
    lines.extend(distances(drive, aims, 1e3));
    let widest = bands.iter().map(|band| band.half_width).fold(0.0, f64::max);
    (lines, 1e3 * ENLARGED * widest.max(run.settling_tolerance))
}

/// The same after arrival with the tolerance, and what is left at the end, um.
fn after_arrival(run: &Run, drive: &[Sample], aims: &[Aim], bands: &[Band]) -> (Vec<Series>, f64) {
    let last = drive.last().map_or(0.0, |sample| sample.time);
    let arrival = arrival(run, bands);
    let arrived = &drive[drive.partition_point(|s| s.time < arrival)..];
    let mut lines = vec![within_tolerance(run, 1e6, (arrival, last))];
    lines.extend(distances(arrived, aims, 1e6));
    let left = run.samples.last().map_or(0.0, |end| {
        let each = (0..masses(run)).map(|mass| distance(end, mass, aims).abs());
        each.fold(0.0, f64::max)
    });
    let half = (FURTHER * run.settling_tolerance).max(LEFT * left);
    (lines, 1e6 * half)
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

fn micro(length: f64, units: &Units) -> String {
    format!("{} {}", (1e7 * length).round() / 10.0, units.micro_position)
}

/// Where the run is sent at a time.
fn aim(aims: &[Aim], time: f64) -> Aim {
    // Asked for in the very period in which it begins.
    let begun = aims.partition_point(|aim| aim.from <= time + 1e-9);
    aims[begun.saturating_sub(1)]
}

/// The band in which the controlled mass counts as settled, while one target holds.
struct Band {
    target: f64,
    half_width: f64,
    times: (f64, f64),
}

fn bands(run: &Run, aims: &[Aim], last: f64) -> Vec<Band> {
    let controlled = 2 * controlled_mass(masses(run).saturating_sub(1));
    let until = aims.iter().skip(1).map(|next| next.from);
    let until = until.chain([f64::INFINITY]);
    let each = aims.iter().zip(until).map(|(aim, until)| {
        let first = run.samples.partition_point(|s| s.time + 1e-9 < aim.from);
        let start = run.samples.get(first).map_or(0.0, |s| s.truth[controlled]);
        Band {
            target: aim.target,
            half_width: SETTLING_BAND * (aim.target - start).abs(),
            times: (aim.from.min(last), until.min(last)),
        }
    });
    each.collect()
}

/// When the controlled mass has come into its band for the first time to stay there until the next target, s; 0
/// when it never does.
fn arrival(run: &Run, bands: &[Band]) -> f64 {
    let controlled = 2 * controlled_mass(masses(run).saturating_sub(1));
    let mut each = bands.iter().filter_map(|band| {
        let (from, to) = band.times;
        let outside = |s: &&Sample| {
            let off = (s.truth[controlled] - band.target).abs();
            (from..to).contains(&s.time) && off > band.half_width
        };
        let time = run.samples.iter().rfind(outside).map_or(from, |s| s.time);
        (time + HELD * (to - from) < to).then_some(time)
    });
    each.next().unwrap_or(0.0)
}

/// How near to where it ends a mass has come when its motion is over, m.
fn ended(run: &Run, aims: &[Aim]) -> f64 {
    let widths = bands(run, aims, f64::INFINITY).into_iter();
    let widths = widths.map(|band| band.half_width / 2.0);
    widths.fold(run.settling_tolerance, f64::min)
}

/// Samples up to some time after the last one in which a mass is not where it ends, on its target or beside it,
/// or the reference not at its end; all of them when that goes on to the end.
fn moving(run: &Run, aims: &[Aim]) -> usize {
    let near = ended(run, aims);
    let end = run.samples.last();
    let ends = end.map_or(&[][..], |s| s.truth.as_slice());
    let target = aims[aims.len() - 1].target;
    let moves = |s: &Sample| {
        let positions = s.truth.iter().zip(ends).step_by(2);
        positions.into_iter().any(|(x, end)| (x - end).abs() > near)
            || (s.reference - target).abs() > near
    };
    let last = run.samples.iter().rposition(moves).unwrap_or(0);
    let begin = run
        .samples
        .partition_point(|s| s.time < aims[aims.len() - 1].from)
        .min(last);
    let shown = begin + (LONGER * (last - begin) as f64) as usize;
    shown.max(SHORTEST).min(run.samples.len())
}

fn series(samples: &[Sample], value: impl Fn(&Sample) -> Option<f64>) -> Vec<(f64, f64)> {
    let points = samples.iter();
    points
        .filter_map(|sample| Some((sample.time, value(sample)?)))
        .collect()
}
