//! Content of the screen and handling of keys. Independent of a terminal, so that tests can press keys and read the screen.

use std::collections::VecDeque;
use std::sync::Arc;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use shm_schema::Status;
use trued_client::Mode;

use super::requests::{AnsweredRequest, OperatorRequest};
use crate::cell_watch::{CellState, CellUpdate};
use crate::changes::Changes;

/// Number of events kept.
const EVENTS_KEPT: usize = 200;
/// The rate of commands is averaged over this time, s: short enough to follow changes, long enough
/// for two digits at 10 Hz.
const RATE_WINDOW_S: f64 = 2.0;

/// Result of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KeyAction {
    None,
    Ask(OperatorRequest),
    Quit,
}

/// An event, with the daemon's time since its start.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ScreenEvent {
    pub(super) uptime_s: f64,
    pub(super) text: String,
}

/// Number of commands at a time.
#[derive(Clone, Copy, Debug)]
struct CommandCount {
    t_ns: u64,
    commands: u64,
}

/// The screen.
#[derive(Debug)]
pub(super) struct Screen {
    pub(super) cell: String,
    /// The displayed state of the cell; `None` before its first status.
    pub(super) cell_state: Option<Arc<CellState>>,
    /// The present state of the cell, while the display is frozen.
    waiting: Option<Arc<CellState>>,
    pub(super) frozen: bool,
    /// The request to be confirmed with `y`.
    pub(super) unconfirmed: Option<OperatorRequest>,
    /// The request sent and not yet answered.
    pub(super) pending: Option<OperatorRequest>,
    /// Newest first.
    pub(super) events: VecDeque<ScreenEvent>,
    /// Commands per second; `None` without commands.
    pub(super) rate_hz: Option<f64>,
    command_counts: VecDeque<CommandCount>,
    changes: Changes,
}

impl Screen {
    pub(super) fn new(cell: &str) -> Self {
        Self {
            cell: cell.to_owned(),
            cell_state: None,
            waiting: None,
            frozen: false,
            unconfirmed: None,
            pending: None,
            events: VecDeque::new(),
            rate_hz: None,
            command_counts: VecDeque::new(),
            changes: Changes::default(),
        }
    }

    /// Processes a new state of the cell.
    pub(super) fn update(&mut self, news: CellUpdate) {
        for verdict in news.verdicts {
            self.add_event(verdict.to_string());
        }
        let Some(cell_state) = news.cell_state else { return };
        self.count(&cell_state.status);
        for text in self.changes.since_last(&cell_state.report) {
            self.add_event(text);
        }
        if self.frozen {
            self.waiting = Some(cell_state);
        } else {
            self.cell_state = Some(cell_state);
        }
    }

    /// Processes an answer of the daemon.
    pub(super) fn add_answer(&mut self, answered: &AnsweredRequest) {
        self.pending = None;
        self.add_event(format!("{}: {}", answered.request.description(), answered.message));
    }

    /// Processes a key.
    pub(super) fn key(&mut self, key: KeyEvent) -> KeyAction {
        let is_ctrl_c =
            key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_ctrl_c {
            return KeyAction::Quit;
        }
        if let Some(request) = self.unconfirmed.take() {
            return match key.code {
                KeyCode::Char('y' | 'Y') => self.send(request),
                _ => KeyAction::None,
            };
        }
        match key.code {
            KeyCode::Char('q') | KeyCode::Esc => KeyAction::Quit,
            KeyCode::Char('b') => {
                let bypassed = self.now().is_some_and(|cell_state| cell_state.report.bypassed);
                self.ask(OperatorRequest::Bypass(!bypassed))
            }
            KeyCode::Char('s') => self.ask(OperatorRequest::Mode(Mode::Shadow)),
            KeyCode::Char('l') => self.ask(OperatorRequest::Mode(Mode::Limited)),
            KeyCode::Char('f') => self.ask(OperatorRequest::Mode(Mode::Full)),
            KeyCode::Char('a') => self.ask(OperatorRequest::Arm),
            KeyCode::Char('r') => self.ask(OperatorRequest::Reload),
            KeyCode::Char(' ') => {
                self.frozen = !self.frozen;
                if let Some(cell_state) = self.waiting.take() {
                    self.cell_state = Some(cell_state);
                }
                KeyAction::None
            }
            _ => KeyAction::None,
        }
    }

    /// The present state of the cell, displayed or not.
    fn now(&self) -> Option<&Arc<CellState>> {
        self.waiting.as_ref().or(self.cell_state.as_ref())
    }

    fn ask(&mut self, request: OperatorRequest) -> KeyAction {
        if request.needs_confirmation() {
            self.unconfirmed = Some(request);
            KeyAction::None
        } else {
            self.send(request)
        }
    }

    fn send(&mut self, request: OperatorRequest) -> KeyAction {
        self.pending = Some(request);
        KeyAction::Ask(request)
    }

    fn add_event(&mut self, text: String) {
        let uptime_s = self.now().map_or(0.0, |cell_state| cell_state.report.uptime_s);
        self.events.push_front(ScreenEvent { uptime_s, text });
        self.events.truncate(EVENTS_KEPT);
    }

    fn count(&mut self, status: &Status) {
        let now = CommandCount { t_ns: status.t_ns, commands: status.commands };
        if self.command_counts.back().is_some_and(|last| last.commands > now.commands) {
            // A new daemon.
            self.command_counts.clear();
        }
        self.command_counts.push_back(now);
        let since_s = |count: &CommandCount| now.t_ns.saturating_sub(count.t_ns) as f64 * 1e-9;
        while self.command_counts.get(1).is_some_and(|second| since_s(second) >= RATE_WINDOW_S) {
            self.command_counts.pop_front();
        }
        self.rate_hz = self.command_counts.front().and_then(|first| {
            let (span_s, commands) = (since_s(first), now.commands - first.commands);
            (span_s > 0.0 && commands > 0).then(|| commands as f64 / span_s)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;

    fn press(screen: &mut Screen, key: char) -> KeyAction {
        screen.key(KeyEvent::new(KeyCode::Char(key), KeyModifiers::NONE))
    }

    fn status(screen: &mut Screen, status: Status) {
        let report = Report::new("cell", &status, None);
        let cell_state = Some(Arc::new(CellState { report, status, robot: None }));
        screen.update(CellUpdate { cell_state, verdicts: Vec::new() });
    }

    #[test]
    fn requests_that_remove_the_correction_are_sent_at_once_others_after_confirmation() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status::default());
        assert_eq!(press(&mut screen, 'b'), KeyAction::Ask(OperatorRequest::Bypass(true)));
        assert_eq!(press(&mut screen, 's'), KeyAction::Ask(OperatorRequest::Mode(Mode::Shadow)));
        for (key, request) in [
            ('l', OperatorRequest::Mode(Mode::Limited)),
            ('f', OperatorRequest::Mode(Mode::Full)),
            ('a', OperatorRequest::Arm),
            ('r', OperatorRequest::Reload),
        ] {
            assert_eq!(press(&mut screen, key), KeyAction::None);
            assert_eq!(press(&mut screen, 'n'), KeyAction::None, "`{key}` then no");
            assert_eq!(
                press(&mut screen, 'y'),
                KeyAction::None,
                "nothing waits for a yes any more"
            );
            assert_eq!(press(&mut screen, key), KeyAction::None);
            assert_eq!(press(&mut screen, 'y'), KeyAction::Ask(request));
        }
    }

    #[test]
    fn a_bypassed_cell_is_asked_to_end_it() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status { bypassed: 1, ..Status::default() });
        assert_eq!(press(&mut screen, 'b'), KeyAction::None);
        assert_eq!(press(&mut screen, 'y'), KeyAction::Ask(OperatorRequest::Bypass(false)));
    }

    #[test]
    fn a_frozen_screen_stays_and_the_bypass_key_goes_by_the_cell_as_it_is() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status::default());
        assert_eq!(press(&mut screen, ' '), KeyAction::None);
        status(&mut screen, Status { bypassed: 1, commands: 9, ..Status::default() });
        assert_eq!(
            screen.cell_state.as_ref().map(|cell_state| cell_state.report.counts.commands),
            Some(0)
        );
        assert_eq!(press(&mut screen, 'b'), KeyAction::None, "it is bypassed: a yes is needed");
        assert_eq!(screen.unconfirmed, Some(OperatorRequest::Bypass(false)));
        assert_eq!(press(&mut screen, 'n'), KeyAction::None);
        assert_eq!(press(&mut screen, ' '), KeyAction::None);
        assert_eq!(
            screen.cell_state.as_ref().map(|cell_state| cell_state.report.counts.commands),
            Some(9)
        );
    }

    #[test]
    fn changes_of_state_are_events_and_answers_too() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status { health: 2, ..Status::default() });
        assert!(screen.events.is_empty(), "the first status is no change");
        status(&mut screen, Status { health: 3, mode: 1, bypassed: 1, ..Status::default() });
        screen.add_answer(&AnsweredRequest {
            request: OperatorRequest::Arm,
            message: "refused: no".to_owned(),
        });
        let texts: Vec<&str> = screen.events.iter().map(|one| one.text.as_str()).collect();
        assert_eq!(texts[..3], ["arm: refused: no", "bypassed", "mode shadow -> limited"]);
        assert!(texts[3].starts_with("running -> degraded"), "{texts:?}");
    }

    #[test]
    fn the_rate_is_that_of_the_last_two_seconds_and_restarts_with_another_daemon() {
        let mut screen = Screen::new("cell");
        for k in 0..100_u64 {
            let (t_ns, commands) = (k * 40_000_000, k * 10);
            status(&mut screen, Status { t_ns, commands, ..Status::default() });
        }
        assert!(screen.rate_hz.is_some_and(|rate| (rate - 250.0).abs() < 1e-6));
        status(&mut screen, Status { t_ns: 1, commands: 0, ..Status::default() });
        assert_eq!(screen.rate_hz, None);
    }

    #[test]
    fn q_escape_and_ctrl_c_quit_and_a_question_is_left_by_any_key() {
        let mut screen = Screen::new("cell");
        assert_eq!(press(&mut screen, 'q'), KeyAction::Quit);
        let escape = KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE);
        assert_eq!(press(&mut screen, 'a'), KeyAction::None);
        assert_eq!(screen.key(escape), KeyAction::None, "it leaves the question");
        assert_eq!(screen.key(escape), KeyAction::Quit);
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(press(&mut screen, 'a'), KeyAction::None);
        assert_eq!(screen.key(ctrl_c), KeyAction::Quit);
    }
}
