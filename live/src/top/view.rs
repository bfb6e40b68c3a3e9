//! Drawing of the screen: state and reason, correction per joint, cycle, vibration, events, keys. Designed for 80 × 24; on smaller terminals sections are
//! omitted from the bottom up, except state and keys.

use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

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
/// Rows of the cycle with its border.
const CYCLE_ROWS: u16 = 7;
/// Events that a long message leaves on the screen, if there are so many.
const EVENT_ROWS_MIN: usize = 2;

/// Draws the screen.
pub(super) fn draw(frame: &mut Frame<'_>, screen: &Screen) {
    let state_rows = state_rows(frame.area(), screen);
    let [title, state, rest, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(state_rows),
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
    let joint_rows = joint_rows(report);
    let cycle_rows = CYCLE_ROWS;
    if rest.width < NARROW_COLUMNS {
        let rows = [Constraint::Length(joint_rows), Constraint::Length(cycle_rows)];
        let [corrections, cycle, events] =
            Layout::vertical([rows[0], rows[1], Constraint::Min(0)]).areas(rest);
        draw_joints(frame, corrections, report);
        draw_cycle(frame, cycle, report, screen.rate_hz);
        draw_events(frame, events, screen);
    } else {
        let rows = Constraint::Length(joint_rows.max(cycle_rows));
        let [above, events] = Layout::vertical([rows, Constraint::Min(0)]).areas(rest);
        let columns = [Constraint::Length(44), Constraint::Min(0)];
        let [corrections, cycle] = Layout::horizontal(columns).areas(above);
        draw_joints(frame, corrections, report);
        draw_cycle(frame, cycle, report, screen.rate_hz);
        draw_events(frame, events, screen);
    }
}

/// Rows of the joints with their border.
fn joint_rows(report: &Report) -> u16 {
    u16::try_from(report.joints.len()).unwrap_or(u16::MAX).saturating_add(2).max(3)
}

/// Rows of the state: more than usual if its message is long and the sections below leave rows free.
fn state_rows(area: Rect, screen: &Screen) -> u16 {
    let usual = FIXED_ROWS - 2;
    let Some(report) = screen.cell_state.as_ref().map(|cell_state| &cell_state.report) else {
        return usual;
    };
    let below = if area.width < NARROW_COLUMNS {
        joint_rows(report).saturating_add(CYCLE_ROWS)
    } else {
        joint_rows(report).max(CYCLE_ROWS)
    };
    let events = screen.events.len().min(EVENT_ROWS_MIN);
    let events = u16::try_from(events).unwrap_or(0) + 2;
    let free = area.height.saturating_sub(FIXED_ROWS).saturating_sub(below).saturating_sub(events);
    let wanted = wrapped(message(report), usize::from(area.width)).len();
    u16::try_from(wanted).unwrap_or(u16::MAX).saturating_add(2).clamp(usual, usual + free)
}

/// Why the cell is in its state.
fn message(report: &Report) -> &str {
    report.away.as_deref().unwrap_or(&report.message)
}

/// Lines of at most `columns`, broken between words.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(last) if last.chars().count() + 1 + word.chars().count() <= columns => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// As many lines as there are rows; the last one ends with an ellipsis if something is missing.
fn cut(mut lines: Vec<String>, rows: usize, columns: usize) -> Vec<String> {
    if lines.len() > rows {
        lines.truncate(rows);
        if let Some(last) = lines.last_mut() {
            let kept: String = last.chars().take(columns.saturating_sub(1)).collect();
            *last = kept + "…";
        }
    }
    lines
}

/// Whether the daemon's numbers are of the past.
fn is_outdated(report: &Report) -> bool {
    report.away.is_some() || report.age_s > STATUS_AGE_MAX_S
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
    let model = &report.model;
    let holds = if model.holds { "" } else { ", outdated by measurements" };
    let [state, about] = Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(area);
    let columns = usize::from(state.width);
    let why = wrapped(message(report), columns);
    let rows = usize::from(state.height).saturating_sub(1);
    let why = cut(why, rows, columns).into_iter().map(Line::from);
    let lines: Vec<Line<'_>> = std::iter::once(Line::from(first)).chain(why).collect();
    frame.render_widget(Paragraph::new(lines), state);
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

fn draw_joints(frame: &mut Frame<'_>, area: Rect, report: &Report) {
    let is_outdated = is_outdated(report);
    let line = |(k, joint): (usize, &Joint)| {
        if is_outdated {
            return Line::from(format!("{:>2} [{}] unknown", k + 1, bar(0.0)));
        }
        let is_near = joint.share.abs() >= NEAR_LIMIT;
        let style = if is_near { Style::new().fg(Color::Yellow) } else { Style::new() };
        let text = format!("{:>2} [{}] {:>7.1} %", k + 1, bar(joint.share), 100.0 * joint.share);
        Line::styled(format!("{text}{}", if is_near { " near" } else { "" }), style)
    };
    let lines: Vec<Line<'_>> = report.joints.iter().enumerate().map(line).collect();
    let block = Block::new().borders(Borders::ALL).title(" correction relative to its limit ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_cycle(frame: &mut Frame<'_>, area: Rect, report: &Report, rate_hz: Option<f64>) {
    let (latency, counts) = (&report.latency_us, &report.counts);
    let (rate, share) = match rate_hz.filter(|_| !is_outdated(report)) {
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
        format!("median {}", microseconds(latency.p50)),
        format!("99.9 % {}{share}", microseconds(latency.p999)),
        format!("largest {}, missed {}", microseconds(latency.max), counts.missed_cycles),
        format!("rejected {}, held {}, lost {lost}", counts.rejected, counts.held),
        format!("wrench gate {}{}", report.force.wrench_gate, feed(report)),
    ];
    let lines: Vec<Line<'_>> = lines.into_iter().map(Line::from).collect();
    let block = Block::new().borders(Borders::ALL).title(" cycle ");
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// A latency; `unknown` before the first command.
fn microseconds(us: f64) -> String {
    if us > 0.0 { format!("{us:.1} us") } else { "unknown".to_owned() }
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

    fn drawn(change: impl Fn(&mut Report), width: u16, height: u16) -> String {
        let mut screen = Screen::new("cell");
        let mut report = Report { age_s: 0.0, ..Report::new("cell", &running(), None) };
        change(&mut report);
        let cell_state = Arc::new(CellState { report, status: running(), robot: None });
        screen.update(CellUpdate { cell_state: Some(cell_state), verdicts: Vec::new() });
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a terminal");
        terminal.draw(|frame| draw(frame, &screen)).expect("drawn");
        let buffer = terminal.backend().buffer();
        let row = |y: u16| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(row).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_long_message_takes_free_rows_and_ends_with_an_ellipsis_where_it_is_cut() {
        let words: Vec<String> = (0..90).map(|word| format!("word{word}")).collect();
        let long = words.join(" ");
        for (width, height) in [(60, 20), (80, 24), (120, 50)] {
            let text = drawn(|report| report.message = long.clone(), width, height);
            assert!(text.contains("word89") || text.contains('…'), "{width}x{height}\n{text}");
        }
        let text = drawn(|report| report.message = words[..40].join(" "), 80, 24);
        assert!(text.contains("word39") && !text.contains('…'), "{text}");
    }

    #[test]
    fn without_a_daemon_no_correction_is_shown_and_without_commands_no_latency() {
        let text = drawn(|_| {}, 80, 24);
        assert!(text.contains("median unknown") && text.contains("50.0 %"), "{text}");
        let text = drawn(|report| report.away = Some("it ended".to_owned()), 80, 24);
        assert!(text.contains("2 [          |          ] unknown"), "{text}");
        assert!(!text.contains("50.0 %"), "{text}");
    }

    #[test]
    fn a_bypass_is_the_most_prominent_state() {
        let rows = shown(&Status { bypassed: 1, ..running() }, 80, 24);
        assert!(rows[1].contains("BYPASSED: NO CORRECTION"), "{rows:?}");
    }
}
