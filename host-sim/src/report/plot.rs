//! One plot per experiment: time history, current, and the phase portraits of the first and the
//! second mass as the paper draws them.

use crate::chain::controlled_mass;
use crate::error::{Error, Result};
use crate::simulate::Run;
use plotters::coord::Shift;
use plotters::prelude::*;

const SIZE: (u32, u32) = (1200, 840);
const COLOURS: [RGBColor; 7] = [
    RGBColor(90, 90, 90),
    RGBColor(214, 39, 40),
    RGBColor(31, 119, 180),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(23, 190, 207),
];
const BOUND: RGBColor = RGBColor(170, 170, 170);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Line = Vec<(f64, f64)>;

/// Draws the core's run with the full-state bound behind it, as SVG.
///
/// # Errors
/// [`Error::Report`] when the drawing cannot be made.
pub fn plot(core: &Run, bound: &Run) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, core, bound)
        .map_err(|error| Error::Report(format!("its plot cannot be drawn: {error}")))?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    core: &Run,
    bound: &Run,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let title = format!("{}: {}", core.scenario.name, core.scenario.title(core.kind));
    let units = core.kind.units();
    let position = format!("position [{}]", units.milli_position);
    let velocity = format!("velocity [{}]", units.velocity);
    let root = root.titled(&title, ("sans-serif", 22))?;
    let panels = root.split_evenly((2, 2));
    let masses = core
        .samples
        .first()
        .map_or(0, |sample| sample.truth.len() / 2);

    let mut history = Vec::new();
    let mut estimates = Vec::new();
    for mass in 0..masses {
        let name = if mass == 0 {
            "x_a".into()
        } else {
            format!("x_{mass}")
        };
        history.push((
            name,
            COLOURS[mass % COLOURS.len()],
            time_series(core, |s| 1e3 * s.truth[2 * mass]),
        ));
        if mass > 0 {
            let line = core.samples.iter().filter_map(|s| {
                let position = s.record.as_ref()?.load_position.get(mass - 1)?;
                Some((s.time, 1e3 * f64::from(*position)))
            });
            estimates.push((COLOURS[mass % COLOURS.len()], line.collect::<Line>()));
        }
    }
    history.push((
        "reference".into(),
        BLACK,
        time_series(core, |s| 1e3 * s.reference),
    ));
    lines(
        &panels[0],
        "motion (dots: estimate)",
        "time [s]",
        &position,
        &history,
        &estimates,
    )?;

    let current = [
        (
            "full state".into(),
            BOUND,
            time_series(bound, |s| s.command),
        ),
        ("drive".into(), COLOURS[1], time_series(core, |s| s.command)),
    ];
    lines(
        &panels[1],
        "current",
        "time [s]",
        "current [A]",
        &current,
        &[],
    )?;

    let second = controlled_mass(masses.saturating_sub(1));
    for (panel, mass) in panels[2..].iter().zip([1, second]) {
        let portrait = |run: &Run| -> Line {
            run.samples
                .iter()
                .map(|s| (1e3 * s.truth[2 * mass], s.truth[2 * mass + 1]))
                .collect()
        };
        let series = [
            ("full state".into(), BOUND, portrait(bound)),
            ("drive".into(), COLOURS[mass], portrait(core)),
        ];
        let caption = format!("phase portrait of mass {mass}");
        lines(panel, &caption, &position, &velocity, &series, &[])?;
    }
    root.present()?;
    Ok(())
}

/// Name and points of a line.
pub type Series = (String, Vec<(f64, f64)>);

/// One panel.
pub struct Panel<'a> {
    /// Over it.
    pub caption: &'a str,
    /// Titles of its horizontal and its vertical axis.
    pub axes: (&'a str, &'a str),
    /// Its lines.
    pub series: Vec<Series>,
}

/// Draws panels, two in a row.
///
/// # Errors
/// [`Error::Report`] when the drawing cannot be made.
pub fn panels(title: &str, content: &[Panel<'_>]) -> Result<String> {
    let mut svg = String::new();
    draw_panels(&mut svg, title, content)
        .map_err(|error| Error::Report(format!("the plot cannot be drawn: {error}")))?;
    Ok(svg)
}

fn draw_panels(
    svg: &mut String,
    title: &str,
    content: &[Panel<'_>],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 22))?;
    for (area, panel) in root
        .split_evenly((content.len().div_ceil(2), 2))
        .iter()
        .zip(content)
    {
        let coloured: Vec<_> = panel
            .series
            .iter()
            .enumerate()
            .map(|(i, (name, line))| (name.clone(), COLOURS[i % COLOURS.len()], line.clone()))
            .collect();
        let (x, y) = panel.axes;
        lines(area, panel.caption, x, y, &coloured, &[])?;
    }
    root.present()?;
    Ok(())
}

fn time_series(run: &Run, value: impl Fn(&crate::simulate::Sample) -> f64) -> Line {
    run.samples
        .iter()
        .map(|sample| (sample.time, value(sample)))
        .collect()
}

fn lines(
    area: &Area<'_>,
    caption: &str,
    x_title: &str,
    y_title: &str,
    series: &[(String, RGBColor, Line)],
    dots: &[(RGBColor, Line)],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let points = || series.iter().flat_map(|(_, _, line)| line);
    let x = range(points().map(|point| point.0));
    let y = range(points().map(|point| point.1));
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 16))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc(x_title)
        .y_desc(y_title)
        .light_line_style(WHITE)
        .draw()?;
    for (name, colour, line) in series {
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(line.iter().copied(), style))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    }
    for (colour, line) in dots {
        let every = (line.len() / 120).max(1);
        let circles = line
            .iter()
            .step_by(every)
            .map(|point| Circle::new(*point, 2, colour.filled()));
        chart.draw_series(circles)?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BOUND)
        .draw()?;
    Ok(())
}

/// The span of the values with a margin, never empty.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(x), high.max(x))
        });
    if low > high {
        return 0.0..1.0;
    }
    let margin = if high > low { 0.04 * (high - low) } else { 0.5 };
    low - margin..high + margin
}
