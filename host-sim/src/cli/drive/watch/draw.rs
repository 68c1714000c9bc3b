//! Draws a [`Model`], whatever the size of the terminal.

use super::charts;
use super::model::Model;
use crate::link::fault_words;
use crate::output::significant;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Gauge, Paragraph, Row, Table, Wrap};

/// What the keys do.
const KEYS: &str = " q, Esc: end, the drive goes on as it is   s: stop, bring the machine to rest";

/// Lines of the box with the state and its borders, of that with the masses beside each load, fewest of the curves,
/// most of the last faults.
const STATE: u16 = 13;
const MASSES: u16 = 8;
const CURVES: u16 = 8;
const FAULTS: usize = 4;

/// Puts everything on a frame.
pub(super) fn draw(frame: &mut Frame<'_>, model: &Model) {
    let area = frame.area();
    let fault = fault_in_words(model);
    let fault_lines = if fault.is_some() { 2 } else { 0 };
    let both = STATE.max(MASSES + model.subject.origin.loads as u16);
    let left = area.height.saturating_sub(2 + fault_lines + both + CURVES);
    let past = model.faults.len().min(FAULTS) as u16;
    // Borders, too; not at the cost of the curves.
    let past = if past > 0 && left >= past + 2 {
        past + 2
    } else {
        0
    };
    let [title, alarm, top, curves, faults, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(fault_lines),
        Constraint::Max(both),
        Constraint::Min(0),
        Constraint::Length(past),
        Constraint::Length(1),
    ])
    .areas(area);

    frame.render_widget(header(model), title);
    if let Some(words) = fault {
        let words = Paragraph::new(words).wrap(Wrap { trim: true });
        frame.render_widget(words.white().on_red(), alarm);
    }
    let [state, motion] =
        Layout::horizontal([Constraint::Length(36), Constraint::Min(0)]).areas(top);
    let [masses, current] =
        Layout::vertical([Constraint::Min(0), Constraint::Length(3)]).areas(motion);
    frame.render_widget(state_of(model), state);
    draw_masses(frame, model, masses);
    frame.render_widget(gauge(model), current);
    charts::draw(frame, model, curves);
    if past > 0 {
        frame.render_widget(past_faults(model), faults);
    }
    frame.render_widget(footer(model), foot);
}

/// Which drive it is.
fn header(model: &Model) -> Line<'static> {
    let subject = &model.subject;
    let mut line = Line::from(vec![
        Span::from(format!(" {} ", subject.origin.mark())).bold(),
        Span::from(format!(
            "on {}, firmware {}, a record of every {} periods of {} s",
            subject.port, subject.firmware, subject.every, subject.origin.period
        )),
    ]);
    if let Some(silent) = model.silent {
        let words = format!("  no answer for {silent:.1} s ");
        line.push_span(Span::from(words).white().on_red());
    }
    line
}

/// The fault that stops the drive.
fn fault_in_words(model: &Model) -> Option<String> {
    let status = model.status?;
    let fault = status.mode.fault()?;
    Some(fault_words(fault, status.fault_value))
}

/// What the drive is doing, and how it fares.
fn state_of(model: &Model) -> Paragraph<'static> {
    let block = Block::bordered().title(" drive ");
    let Some(status) = model.status else {
        return Paragraph::new("no status yet").block(block);
    };
    let units = model.subject.origin.kind.units();
    let held = model.target().map(|target| position(model, target));
    let plain = Style::new();
    let (alarm, alert) = (plain.fg(Color::Red), plain.fg(Color::Yellow));
    let when = |bad: bool, style: Style| if bad { style } else { plain };
    let state = if model.faulty() {
        alarm
    } else {
        plain.fg(Color::Green)
    };
    let yes = |yes: bool, words: [&str; 2]| words[usize::from(!yes)].to_owned();
    let lines = [
        ("state", status.state().name().to_owned(), state.bold()),
        ("mode", model.mode().to_owned(), plain),
        (
            "run switch",
            yes(status.run_switch, ["closed", "open"]),
            when(!status.run_switch, alert),
        ),
        (
            "zero",
            yes(status.position_set, ["known", "not known"]),
            when(!status.position_set, alert),
        ),
        (
            "heeds",
            yes(status.remote, ["the link", "its switches"]),
            plain,
        ),
        (
            "held at",
            held.unwrap_or_else(|| {
                let otherwise = yes(status.jogging, ["-, jogs", "-"]);
                if status.homing {
                    "-, homes".into()
                } else {
                    otherwise
                }
            }),
            plain,
        ),
        (
            "vibration",
            format!(
                "{} {} rms",
                significant(1e6 * f64::from(status.vibration), 3),
                units.micro_position
            ),
            plain,
        ),
        ("worst cycles", status.worst_cycles.to_string(), plain),
        (
            "missed here",
            format!("{} of {}", model.missed, model.taken + model.missed),
            when(model.missed > 0, alert),
        ),
        (
            "lost there",
            format!("{} records", status.lost),
            when(status.lost > 0, alert),
        ),
        (
            "damaged",
            format!("{} frames", status.damaged),
            when(status.damaged > 0, alert),
        ),
    ];
    let lines = lines.map(|(name, value, style)| {
        Line::from(vec![
            Span::from(format!("{name:<13}")).dim(),
            Span::styled(value, style),
        ])
    });
    Paragraph::new(lines.to_vec()).block(block)
}

/// A position in thousandths of its unit, to a count of the encoder.
fn position(model: &Model, length: f64) -> String {
    let subject = &model.subject;
    let decimals = decimals(subject.resolution * 1e3);
    let unit = subject.origin.kind.units().milli_position;
    format!("{:.decimals$} {unit}", 1e3 * length)
}

/// Decimals that tell apart what is so far apart.
fn decimals(step: f64) -> usize {
    (-step.log10()).ceil().clamp(0.0, 9.0) as usize
}

/// Where each mass is, how far from the reference, and how fast.
fn draw_masses(frame: &mut Frame<'_>, model: &Model, area: Rect) {
    let units = model.subject.origin.kind.units();
    let resolution = model.subject.resolution;
    let (milli, micro) = (decimals(1e3 * resolution), decimals(1e6 * resolution));
    let cell = |value: Option<f64>, text: &dyn Fn(f64) -> String| {
        let text = value.map_or("-".into(), text);
        Cell::from(Line::from(text).right_aligned())
    };
    let place = |at: Option<f64>| cell(at, &|at| format!("{:.milli$}", 1e3 * at));
    let masses = model.masses();
    let rows = masses.iter().zip(charts::COLOURS.iter().skip(1).cycle());
    let rows = rows.map(|(mass, colour)| {
        Row::new([
            Cell::from(mass.name.clone()).style(*colour),
            place(mass.position),
            cell(mass.deviation, &|off| format!("{:+.micro$}", 1e6 * off)),
            cell(mass.velocity, &|velocity| format!("{velocity:+.4}")),
        ])
    });
    let name = Cell::from("reference").style(charts::COLOURS[0]);
    let reference = Row::new([name, place(model.reference())]);
    let head = [
        String::new(),
        format!("at [{}]", units.milli_position),
        format!("off [{}]", units.micro_position),
        format!("v [{}]", units.velocity),
    ];
    let head = head.map(|title| Cell::from(Line::from(title).right_aligned()).dim());
    let column = Constraint::Fill(1);
    let widths = [Constraint::Length(9), column, column, column];
    let table = Table::new(std::iter::once(reference).chain(rows), widths);
    let table = table.header(Row::new(head));
    frame.render_widget(table.block(Block::bordered().title(" masses ")), area);
}

/// The current against its limit, or against the largest so far where the limit is not known.
fn gauge(model: &Model) -> Gauge<'static> {
    let full = model.full_current();
    let command = model.command();
    let ratio = command.map_or(0.0, |command| command.abs() / full);
    // Nothing of nothing is nothing.
    let ratio = if ratio.is_finite() {
        ratio.clamp(0.0, 1.0)
    } else {
        0.0
    };
    let limited = model.status.is_some_and(|status| status.limited);
    let label = match (command, model.current_limit) {
        (None, _) => "no current yet".into(),
        (Some(command), Some(limit)) => {
            let acts = if limited { ", at its limit" } else { "" };
            format!("{command:+.3} A of {} A{acts}", significant(limit, 3))
        }
        (Some(command), None) => {
            format!("{command:+.3} A, largest so far {} A", significant(full, 3))
        }
    };
    let colour = if limited { Color::Red } else { Color::Cyan };
    Gauge::default()
        .block(Block::bordered().title(" current "))
        .gauge_style(colour)
        .ratio(ratio)
        .label(label)
}

/// The last faults, the newest first.
fn past_faults(model: &Model) -> Paragraph<'static> {
    let newest = model.faults.iter().rev().take(FAULTS);
    let lines = newest.map(|past| {
        let words = fault_words(past.fault, past.value);
        Line::from(format!("{:9.1} s ago: {words}", model.age(past)))
    });
    let lines: Vec<Line<'_>> = lines.collect();
    Paragraph::new(lines).block(Block::bordered().title(" last faults "))
}

/// What the keys do, and what became of the last one.
fn footer(model: &Model) -> Line<'static> {
    let said = if model.said.is_empty() {
        String::new()
    } else {
        format!("   {}", model.said)
    };
    Line::from(vec![
        Span::from(KEYS).reversed(),
        Span::from(said).fg(Color::Yellow),
    ])
}
