//! Drawing: panels of lines or dots, two in a row, each with its legend above it, as SVG.

use super::lines::{Points, cut, span, thinned};
use crate::error::{Error, Result};
use plotters::coord::Shift;
use plotters::prelude::*;

/// Size of a panel, of the title over all of them, and of what is above a panel's chart, in pixels.
const PANEL: (u32, u32) = (620, 400);
const TITLE: u32 = 36;
const CAPTION: i32 = 26;
const LEGEND: i32 = 18;
/// Width of a letter of the legend and of the stroke beside it, in pixels, on the safe side.
const LETTER: i32 = 7;
const STROKE: i32 = 18;

const COLOURS: [RGBColor; 7] = [
    RGBColor(90, 90, 90),
    RGBColor(214, 39, 40),
    RGBColor(31, 119, 180),
    RGBColor(44, 160, 44),
    RGBColor(148, 103, 189),
    RGBColor(255, 127, 14),
    RGBColor(23, 190, 207),
];
const GREY: RGBColor = RGBColor(170, 170, 170);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error>;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Style {
    Line,
    Dashed,
    Dots,
    /// Filled between the heights of two points, with a share of its colour.
    Band(f64),
}

/// What belongs together in a panel: a line, or dots.
#[derive(Clone, Debug)]
pub struct Series {
    name: String,
    points: Points,
    style: Style,
    /// One of [`COLOURS`]; grey where there is none.
    colour: Option<usize>,
}

impl Series {
    /// A line.
    ///
    /// * `colour`: any number; the same number is the same colour
    #[must_use]
    pub fn line(name: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Self {
            name: name.into(),
            points,
            style: Style::Line,
            colour: Some(colour % COLOURS.len()),
        }
    }

    /// A grey line, to compare with.
    #[must_use]
    pub fn behind(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self {
            colour: None,
            ..Self::line(name, 0, points)
        }
    }

    /// Dashed lines at some heights: a limit, or the edges of a band. They need not be seen whole.
    #[must_use]
    pub fn bounds(name: impl Into<String>, heights: &[f64], (from, to): (f64, f64)) -> Vec<Self> {
        let each = heights.iter().map(|height| Self {
            style: Style::Dashed,
            ..Self::behind("", vec![(from, *height), (to, *height)])
        });
        let mut all: Vec<Self> = each.collect();
        if let Some(first) = all.first_mut() {
            first.name = name.into();
        }
        all
    }

    /// A filled band between two heights, cut where the picture ends.
    ///
    /// * `shade`: from 0, not seen, to 1, as grey as a line
    #[must_use]
    pub fn band(
        name: impl Into<String>,
        shade: f64,
        (low, high): (f64, f64),
        (from, to): (f64, f64),
    ) -> Self {
        Self {
            style: Style::Band(shade),
            ..Self::behind(name, vec![(from, low), (to, high)])
        }
    }

    /// Dots.
    #[must_use]
    pub fn dots(name: impl Into<String>, colour: usize, points: Vec<(f64, f64)>) -> Self {
        Self {
            style: Style::Dots,
            ..Self::line(name, colour, points)
        }
    }

    fn rgb(&self) -> RGBColor {
        self.colour.map_or(GREY, |colour| COLOURS[colour])
    }
}

/// One panel.
#[derive(Clone, Debug, Default)]
pub struct Panel<'a> {
    /// Over it.
    pub caption: &'a str,
    /// Titles of its horizontal and its vertical axis.
    pub axes: (&'a str, &'a str),
    /// Its lines.
    pub series: Vec<Series>,
    /// Heights beyond which lines are cut; everything is shown where there are none.
    pub heights: Option<(f64, f64)>,
    /// Names of rows, from the top, where the vertical axis has rows: the first is at height 0, the next at
    /// -1, and so on.
    pub rows: Vec<String>,
}

/// Draws panels, two in a row.
///
/// # Errors
/// [`Error::Report`] when the drawing cannot be made.
pub fn panels(title: &str, content: &[Panel<'_>]) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, title, content)
        .map_err(|error| Error::Report(format!("the plot cannot be drawn: {error}")))?;
    Ok(svg)
}

fn draw(svg: &mut String, title: &str, content: &[Panel<'_>]) -> std::result::Result<(), Failure> {
    let rows = content.len().div_ceil(2);
    let size = (2 * PANEL.0, TITLE + rows as u32 * PANEL.1);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 22))?;
    for (area, panel) in root.split_evenly((rows, 2)).iter().zip(content) {
        panel.draw(area)?;
    }
    root.present()?;
    Ok(())
}

impl Panel<'_> {
    fn draw(&self, area: &Area<'_>) -> std::result::Result<(), Failure> {
        let chart = self.legend(area)?;
        let points = || self.series.iter().map(|series| &series.points[..]);
        let x = range(points().map(|points| span(points, |point| point.0)));
        let y = match self.heights {
            Some((low, high)) => low..high,
            None if !self.rows.is_empty() => 0.5 - self.rows.len() as f64..0.5,
            None => range(points().map(|points| span(points, |point| point.1))),
        };
        let heights = (y.start, y.end);
        let rows = !self.rows.is_empty();
        let (width, height) = (x.end - x.start, y.end - y.start);
        let mut chart = ChartBuilder::on(&chart)
            .margin(8)
            .margin_right(16)
            .x_label_area_size(36)
            .y_label_area_size(if rows { 120 } else { 64 })
            .build_cartesian_2d(x, y)?;
        let name = |height: &f64| {
            let row = (-height).round();
            let name = self.rows.get(row as usize);
            let at = name.filter(|_| (row + height).abs() < 1e-6);
            at.cloned().unwrap_or_default()
        };
        let mut mesh = chart.configure_mesh();
        let along = |value: &f64| tick(*value, width);
        let up = |value: &f64| tick(*value, height);
        mesh.x_desc(self.axes.0)
            .x_label_formatter(&along)
            .light_line_style(WHITE);
        if rows {
            mesh.y_label_formatter(&name)
                .y_labels(2 * self.rows.len() + 1);
        } else {
            mesh.y_desc(self.axes.1).y_label_formatter(&up);
        }
        mesh.draw()?;
        for series in &self.series {
            let colour = series.rgb();
            let style = colour.stroke_width(2);
            if let (Style::Band(shade), [from, to]) = (series.style, &series.points[..]) {
                let within = |y: f64| y.clamp(heights.0, heights.1);
                let corners = [(from.0, within(from.1)), (to.0, within(to.1))];
                chart.draw_series([Rectangle::new(corners, colour.mix(shade).filled())])?;
                continue;
            }
            if series.style == Style::Dots {
                let dots = series.points.iter();
                chart.draw_series(dots.map(|point| Circle::new(*point, 4, colour.filled())))?;
                continue;
            }
            for piece in cut(&thinned(&series.points), heights) {
                match series.style {
                    Style::Dashed => {
                        chart.draw_series(DashedLineSeries::new(piece, 6, 4, style))?;
                    }
                    _ => {
                        chart.draw_series(LineSeries::new(piece, style))?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Caption and legend above the chart, so that no line is under them; the rest of the area.
    fn legend<'a>(&self, area: &Area<'a>) -> std::result::Result<Area<'a>, Failure> {
        let width = area.dim_in_pixel().0 as i32;
        let named: Vec<&Series> = self.series.iter().filter(|s| !s.name.is_empty()).collect();
        let mut at = (64, CAPTION);
        let mut places = Vec::new();
        for series in &named {
            let needed = STROKE + 6 + LETTER * series.name.chars().count() as i32 + 14;
            if at.0 + needed > width && at.0 > 64 {
                at = (64, at.1 + LEGEND);
            }
            places.push(at);
            at.0 += needed;
        }
        let (above, below) = area.split_vertically(at.1 + LEGEND);
        let caption = Text::new(self.caption, (64, 6), ("sans-serif", 16));
        above.draw(&caption)?;
        for (series, (x, y)) in named.into_iter().zip(places) {
            let colour = series.rgb();
            let middle = y + 7;
            if let Style::Band(shade) = series.style {
                let corners = [(x, middle - 5), (x + STROKE, middle + 5)];
                above.draw(&Rectangle::new(corners, colour.mix(shade).filled()))?;
            } else if series.style == Style::Dots {
                let middle = (x + STROKE / 2, middle);
                above.draw(&Circle::new(middle, 4, colour.filled()))?;
            } else {
                let gap = if series.style == Style::Dashed { 4 } else { 0 };
                let half = STROKE / 2;
                let style = colour.stroke_width(2);
                for (from, to) in [(x, x + half - gap), (x + half, x + STROKE - gap)] {
                    above.draw(&PathElement::new([(from, middle), (to, middle)], style))?;
                }
            }
            let name = Text::new(
                series.name.as_str(),
                (x + STROKE + 6, y),
                ("sans-serif", 13),
            );
            above.draw(&name)?;
        }
        Ok(below)
    }
}

/// A number at an axis of some length: no more figures than it needs, and no zero with a sign.
fn tick(value: f64, length: f64) -> String {
    let decimals = (3.0 - length.log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = match text.split_once('.') {
        Some(_) => text.trim_end_matches('0').trim_end_matches('.'),
        None => &text,
    };
    if text == "-0" { "0" } else { text }.to_owned()
}

/// The span of all values with a margin, never empty.
fn range(spans: impl Iterator<Item = (f64, f64)>) -> std::ops::Range<f64> {
    let (low, high) = spans.fold((f64::MAX, f64::MIN), |(low, high), span| {
        (low.min(span.0), high.max(span.1))
    });
    if low > high {
        return 0.0..1.0;
    }
    let margin = if high > low {
        0.04 * (high - low)
    } else {
        0.5 * low.abs().max(1.0)
    };
    low - margin..high + margin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_have_the_figures_they_need() {
        for (value, length, expected) in [
            (0.1, 0.25, "0.1"),
            (0.15000000000000002, 0.25, "0.15"),
            (-1e-17, 0.6, "0"),
            (30.0, 33.0, "30"),
            (-6000.0, 9000.0, "-6000"),
            (2e-5, 1e-4, "0.00002"),
        ] {
            assert_eq!(tick(value, length), expected);
        }
    }
}
