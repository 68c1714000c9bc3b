//! Curves over the last seconds: positions, and the current.

use super::model::{Curve, Model, WINDOW};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType};

/// Of the reference, of the actuator, and of each load.
pub(super) const COLOURS: [Color; 8] = [
    Color::Gray,
    Color::Yellow,
    Color::Cyan,
    Color::Green,
    Color::Magenta,
    Color::Blue,
    Color::LightRed,
    Color::LightGreen,
];

/// Least range of an axis: of positions in counts of the encoder, of the current as a part of the full one, and of
/// either as a part of its largest value.
const COUNTS: f64 = 20.0;
const PART: f64 = 0.02;
const FLAT: f64 = 1e-6;
/// What stays free above and below a curve, as a part of its range.
const MARGIN: f64 = 0.05;

/// A curve with its colour; time, s, and value in the unit that is shown.
struct Shown {
    colour: Color,
    points: Vec<(f64, f64)>,
}

impl Shown {
    /// * `scale`: by which SI becomes the unit that is shown
    fn new(curve: &Curve, colour: Color, scale: f64) -> Self {
        let points = curve.points.iter();
        Self {
            colour,
            points: points.map(|(time, value)| (*time, scale * value)).collect(),
        }
    }
}

/// Draws both side by side.
pub(super) fn draw(frame: &mut Frame<'_>, model: &Model, area: Rect) {
    let [left, right] = Layout::horizontal([Constraint::Fill(3), Constraint::Fill(2)]).areas(area);
    let unit = model.subject.origin.kind.units().milli_position;
    let positions = model.positions.iter().zip(COLOURS.iter().cycle());
    let positions = positions.map(|(curve, colour)| Shown::new(curve, *colour, 1e3));
    let positions: Vec<Shown> = positions.collect();
    let title = format!(" position [{unit}] ");
    let least = COUNTS * 1e3 * model.subject.resolution;
    chart(frame, left, &title, &positions, least, model.time);
    let current = [Shown::new(&model.current, COLOURS[2], 1.0)];
    let least = PART * model.full_current();
    chart(frame, right, " current [A] ", &current, least, model.time);
}

/// * `least_range`: of the values' axis
/// * `now`: s
fn chart(
    frame: &mut Frame<'_>,
    area: Rect,
    title: &str,
    curves: &[Shown],
    least_range: f64,
    now: f64,
) {
    let values = curves.iter().flat_map(|curve| &curve.points);
    let [least, greatest] = range(values.map(|point| point.1), least_range);
    let decimals = (1.0 - (greatest - least).log10().floor()).clamp(0.0, 9.0) as usize;
    let labels = [least, f64::midpoint(least, greatest), greatest];
    let labels = labels.map(|value| format!("{value:.decimals$}"));
    let datasets = curves.iter().map(|curve| {
        let set = Dataset::default()
            .data(&curve.points)
            .marker(Marker::Braille);
        set.graph_type(GraphType::Line).style(curve.colour)
    });
    let time = Axis::default()
        .bounds([now - WINDOW, now])
        .labels([format!("-{WINDOW} s"), "now".into()]);
    let value = Axis::default().bounds([least, greatest]).labels(labels);
    let chart = Chart::new(datasets.collect())
        .block(Block::bordered().title(title))
        .x_axis(time)
        .y_axis(value);
    frame.render_widget(chart, area);
}

/// Least and greatest of the values with some room, also where there are none.
fn range(values: impl Iterator<Item = f64>, least_range: f64) -> [f64; 2] {
    let least_and_greatest = [f64::INFINITY, f64::NEG_INFINITY];
    let [least, greatest] = values.fold(least_and_greatest, |[least, greatest], value| {
        [least.min(value), greatest.max(value)]
    });
    if least > greatest {
        return [-1.0, 1.0];
    }
    let flat = least_range.max(FLAT * least.abs().max(greatest.abs()));
    let short = 0.5 * (flat.max(f64::MIN_POSITIVE) - (greatest - least)).max(0.0);
    let room = short + MARGIN * (greatest - least);
    [least - room, greatest + room]
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn an_axis_has_a_range_whatever_is_on_it() {
        for values in [&[][..], &[0.0], &[1e30], &[-3.0, 5.0], &[f64::MIN_POSITIVE]] {
            let [least, greatest] = range(values.iter().copied(), 0.01);
            assert!(greatest - least > 0.009, "{values:?}");
            for value in values {
                assert!((least..=greatest).contains(value), "{values:?}");
            }
        }
    }
}
