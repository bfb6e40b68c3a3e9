//! Drawing of the screen: state and reason, correction per joint, cycle, vibration, events, keys. Designed for 80 × 24; on smaller terminals sections are
//! omitted from the bottom up, except state and keys.

use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph, Wrap};

use shm_schema::FeedState;

use super::screen::Screen;
use crate::report::{Joint, Report};

/// Age at which a status is out of date, s: one is published every 40 ms.
const STATUS_AGE_MAX_S: f64 = 1.0;
/// From this share of its limit on a correction counts as near the limit, 0 to 1.
const NEAR_LIMIT: f64 = 0.8;
/// Length of a joint's bar to each side, columns.
const BAR_COLUMNS: usize = 10;
/// Below this width the cycle is shown below the joints instead of next to them, columns.
const NARROW_COLUMNS: u16 = 70;
/// Rows of title, state and keys.
const FIXED_ROWS: u16 = 6;

/// Draws the screen.
pub(super) fn draw(frame: &mut Frame<'_>, screen: &Screen) {
    let [title, state, rest, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(FIXED_ROWS - 2),
        Constraint::Min(0),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    draw_title(frame, title, screen);
    frame.render_widget(Paragraph::new(keys_line(screen)), keys);
    let Some(cell_state) = &screen.cell_state else {
        let text = Paragraph::new("waiting for the first status ...");
        frame.render_widget(text.alignment(Alignment::Center), state);
        return;
    };
    let report = &cell_state.report;
    draw_state(frame, state, report, screen.frozen);
    let joints = u16::try_from(report.joints.len()).unwrap_or(u16::MAX).saturating_add(2);
    let (joint_rows, cycle_rows) = (joints.max(3), 7);
    if rest.width < NARROW_COLUMNS {
        let rows = [Constraint::Length(joint_rows), Constraint::Length(cycle_rows)];
        let [corrections, cycle, events] =
            Layout::vertical([rows[0], rows[1], Constraint::Min(0)]).areas(rest);
        draw_joints(frame, corrections, &report.joints);
        draw_cycle(frame, cycle, report, screen.rate_hz);
        draw_events(frame, events, screen);
    } else {
        let rows = Constraint::Length(joint_rows.max(cycle_rows));
        let [above, events] = Layout::vertical([rows, Constraint::Min(0)]).areas(rest);
        let columns = [Constraint::Length(44), Constraint::Min(0)];
        let [corrections, cycle] = Layout::horizontal(columns).areas(above);
        draw_joints(frame, corrections, &report.joints);
        draw_cycle(frame, cycle, report, screen.rate_hz);
        draw_events(frame, events, screen);
    }
}

fn draw_title(frame: &mut Frame<'_>, area: Rect, screen: &Screen) {
    let robot = screen.cell_state.as_ref().map_or(String::new(), |cell_state| {
        let robot = &cell_state.report.robot;
        let named = [robot.maker.as_str(), robot.kind.as_str(), robot.serial.as_str()];
        named.into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>().join(" ")
    });
    let text = format!(" trued top   {}   {robot}", screen.cell);
    frame.render_widget(Paragraph::new(text).style(Style::new().reversed()), area);
}

/// The state in large letters, and its colour.
fn state_word(report: &Report) -> (String, Color) {
    if report.away.is_some() {
        return ("NO DAEMON".to_owned(), Color::Red);
    }
    if report.age_s > STATUS_AGE_MAX_S {
        return (format!("NO STATUS FOR {:.0} s", report.age_s), Color::Red);
    }
    if report.bypassed {
        return ("BYPASSED: NO CORRECTION".to_owned(), Color::Yellow);
    }
    let colour = match report.health {
        "running" => Color::Green,
        "fault" => Color::Red,
        "degraded" => Color::Yellow,
        _ => Color::Gray,
    };
    (format!("{}, {}", report.health.to_uppercase(), report.mode.to_uppercase()), colour)
}

fn draw_state(frame: &mut Frame<'_>, area: Rect, report: &Report, frozen: bool) {
    let (label, colour) = state_word(report);
    let mut first = vec![Span::styled(
        format!("  {label}  "),
        Style::new().fg(Color::Black).bg(colour).add_modifier(Modifier::BOLD),
    )];
    if frozen {
        first.push(Span::styled("  display frozen", Style::new().add_modifier(Modifier::BOLD)));
    }
    let why = report.away.as_deref().unwrap_or(&report.message);
    let model = &report.model;
    let holds = if model.holds { "" } else { ", outdated by measurements" };
    let lines = vec![Line::from(first), Line::from(why.to_owned())];
    let [state, about] = Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(area);
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: true }), state);
    let about_text = format!(
        "model {} epoch {}{holds}; recorder {}; up {:.0} s",
        &model.hash[..8.min(model.hash.len())],
        model.epoch,
        report.recorder,
        report.uptime_s
    );
    frame.render_widget(Paragraph::new(about_text).style(Style::new().dim()), about);
}

/// A bar to the left or right of the centre, for a share from -1 to 1.
fn bar(share: f64) -> String {
    let filled = ((share.abs().min(1.0) * BAR_COLUMNS as f64).round() as usize).min(BAR_COLUMNS);
    let (full, empty) = ("#".repeat(filled), " ".repeat(BAR_COLUMNS - filled));
    let none = " ".repeat(BAR_COLUMNS);
    if share < 0.0 { format!("{empty}{full}|{none}") } else { format!("{none}|{full}{empty}") }
}

fn draw_joints(frame: &mut Frame<'_>, area: Rect, joints: &[Joint]) {
    let line = |(k, joint): (usize, &Joint)| {
        let is_near = joint.share.abs() >= NEAR_LIMIT;
        let style = if is_near { Style::new().fg(Color::Yellow) } else { Style::new() };
        let text = format!("{:>2} [{}] {:>7.1} %", k + 1, bar(joint.share), 100.0 * joint.share);
        Line::styled(format!("{text}{}", if is_near { " near" } else { "" }), style)
    };
    let lines: Vec<Line<'_>> = joints.iter().enumerate().map(line).collect();
    let block = Block::new().borders(Borders::ALL).title(" correction relative to its limit ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_cycle(frame: &mut Frame<'_>, area: Rect, report: &Report, rate_hz: Option<f64>) {
    let (latency, counts) = (&report.latency_us, &report.counts);
    let (rate, share) = match rate_hz {
        Some(rate) => {
            let period_us = 1e6 / rate;
            let percent = 100.0 * latency.p999 / period_us;
            (format!("{rate:.0} commands/s"), format!(" ({percent:.0} % of period)"))
        }
        None => ("no commands".to_owned(), String::new()),
    };
    let lost = counts.commands_lost + counts.corrected_lost;
    let lines = [
        rate,
        format!("median {:.1} us", latency.p50),
        format!("99.9 % {:.1} us{share}", latency.p999),
        format!("largest {:.1} us, missed {}", latency.max, counts.missed_cycles),
        format!("rejected {}, held {}, lost {lost}", counts.rejected, counts.held),
        format!("wrench gate {}{}", report.force.wrench_gate, feed(report)),
    ];
    let lines: Vec<Line<'_>> = lines.into_iter().map(Line::from).collect();
    let block = Block::new().borders(Borders::ALL).title(" cycle ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The feed override after the wrench gate; empty if the cell does not adapt its feed.
fn feed(report: &Report) -> String {
    if report.feed.state == FeedState::Off.name() {
        return String::new();
    }
    format!(", feed {:.0} % {}", report.feed.override_percent, report.feed.state)
}

fn draw_events(frame: &mut Frame<'_>, area: Rect, screen: &Screen) {
    let vibration = screen.cell_state.as_ref().map_or(String::new(), |cell_state| {
        let vibration = &cell_state.report.vibration;
        let line = vibration.line.as_ref().map_or(String::new(), |line| format!(": {line}"));
        format!("vibration {}{line}", vibration.watch)
    });
    let mut lines = vec![Line::styled(vibration, Style::new().add_modifier(Modifier::BOLD))];
    let event = |one: &super::screen::ScreenEvent| {
        Line::from(format!("{:>8.1} s  {}", one.uptime_s, one.text))
    };
    lines.extend(screen.events.iter().map(event));
    let block = Block::new().borders(Borders::TOP).title(" vibration, events, newest first ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn keys_line(screen: &Screen) -> Line<'static> {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    if let Some(request) = screen.unconfirmed {
        return Line::styled(format!("{}? y: yes, any other key: no", request.description()), bold);
    }
    if let Some(request) = screen.pending {
        return Line::styled(format!("{} ... waiting for the daemon", request.description()), bold);
    }
    // The first ones fit on a narrow terminal too.
    let keys = [
        ("q", "uit"),
        ("b", "ypass"),
        ("s", "hadow"),
        ("l", "imited"),
        ("f", "ull"),
        ("a", "rm"),
        ("r", "eload"),
        ("space", " freeze"),
    ];
    let mut spans = Vec::new();
    for (key, rest) in keys {
        spans.push(Span::styled(key, bold.add_modifier(Modifier::UNDERLINED)));
        spans.push(Span::raw(format!("{rest}  ")));
    }
    Line::from(spans)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell_watch::{CellState, CellUpdate};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use shm_schema::Status;
    use std::sync::Arc;

    fn shown(status: &Status, width: u16, height: u16) -> Vec<String> {
        let mut screen = Screen::new("cell");
        let report = Report::new("cell", status, None);
        let cell_state = Some(Arc::new(CellState {
            report: Report { age_s: 0.0, ..report },
            status: *status,
            robot: None,
        }));
        screen.update(CellUpdate { cell_state, verdicts: Vec::new() });
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a terminal");
        terminal.draw(|frame| draw(frame, &screen)).expect("drawn");
        let buffer = terminal.backend().buffer();
        let row = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(row).collect()
    }

    fn running() -> Status {
        let mut status = Status { joints: 6, health: 2, mode: 2, ..Status::default() };
        status.bounds.angle = [2e-3; shm_schema::JOINTS_MAX];
        status.correction[1] = 1e-3;
        status.correction[2] = -1.9e-3;
        status
    }

    #[test]
    fn state_corrections_and_keys_are_all_on_80_by_24() {
        let rows = shown(&running(), 80, 24);
        let text = rows.join("\n");
        assert!(rows[1].contains("RUNNING, FULL"), "{text}");
        assert!(text.contains(" 2 [          |#####     ]    50.0 %"), "{text}");
        assert!(text.contains(" 3 [##########|          ]   -95.0 % near"), "{text}");
        assert!(text.contains("rejected 0") && text.contains("vibration"), "{text}");
        assert!(rows[23].contains("quit") && rows[23].contains("freeze"), "{text}");
    }

    #[test]
    fn a_small_terminal_keeps_state_and_keys() {
        for (width, height) in [(40, 12), (20, 6), (10, 3), (1, 1)] {
            let rows = shown(&running(), width, height);
            assert_eq!(rows.len(), usize::from(height));
            if height >= 6 && width >= 20 {
                assert!(rows[1].contains("RUNNING"), "{rows:?}");
                assert!(rows[usize::from(height) - 1].contains("quit  bypass"), "{rows:?}");
            }
        }
    }

    #[test]
    fn a_bypass_is_the_most_prominent_state() {
        let rows = shown(&Status { bypassed: 1, ..running() }, 80, 24);
        assert!(rows[1].contains("BYPASSED: NO CORRECTION"), "{rows:?}");
    }
}
