//! Content of the screen and handling of keys. Independent of a terminal, so that tests can press keys and read the screen.

use std::collections::VecDeque;
use std::sync::Arc;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use shm_schema::Status;
use trued_client::Mode;

use super::ask::{Answered, Request};
use crate::changes::Changes;
use crate::watch::{News, Seen};

/// Number of events kept.
const EVENTS_KEPT: usize = 200;
/// The rate of commands is averaged over this time, s: short enough to follow changes, long enough
/// for two digits at 10 Hz.
const RATE_OVER_S: f64 = 2.0;

/// Result of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Effect {
    None,
    Ask(Request),
    Quit,
}

/// An event, with the daemon's time since its start.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Happened {
    pub(super) uptime_s: f64,
    pub(super) says: String,
}

/// Number of commands at a time.
#[derive(Clone, Copy, Debug)]
struct Count {
    t_ns: u64,
    commands: u64,
}

/// The screen.
#[derive(Debug)]
pub(super) struct Screen {
    pub(super) cell: String,
    /// The displayed state of the cell; `None` before its first status.
    pub(super) seen: Option<Arc<Seen>>,
    /// The present state of the cell, while the display is frozen.
    waiting: Option<Arc<Seen>>,
    pub(super) frozen: bool,
    /// The request to be confirmed with `y`.
    pub(super) asks: Option<Request>,
    /// The request sent and not yet answered.
    pub(super) pending: Option<Request>,
    /// Newest first.
    pub(super) events: VecDeque<Happened>,
    /// Commands per second; `None` without commands.
    pub(super) rate_hz: Option<f64>,
    counted: VecDeque<Count>,
    changes: Changes,
}

impl Screen {
    pub(super) fn new(cell: &str) -> Self {
        Self {
            cell: cell.to_owned(),
            seen: None,
            waiting: None,
            frozen: false,
            asks: None,
            pending: None,
            events: VecDeque::new(),
            rate_hz: None,
            counted: VecDeque::new(),
            changes: Changes::default(),
        }
    }

    /// Processes a new state of the cell.
    pub(super) fn hear(&mut self, news: News) {
        for verdict in news.verdicts {
            self.happened(verdict.to_string());
        }
        let Some(seen) = news.seen else { return };
        self.count(&seen.status);
        for says in self.changes.since_last(&seen.report) {
            self.happened(says);
        }
        if self.frozen {
            self.waiting = Some(seen);
        } else {
            self.seen = Some(seen);
        }
    }

    /// Processes an answer of the daemon.
    pub(super) fn answered(&mut self, answered: &Answered) {
        self.pending = None;
        self.happened(format!("{}: {}", answered.request.says(), answered.says));
    }

    /// Processes a key.
    pub(super) fn key(&mut self, key: KeyEvent) -> Effect {
        let is_ctrl_c =
            key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_ctrl_c {
            return Effect::Quit;
        }
        if let Some(request) = self.asks.take() {
            return match key.code {
                KeyCode::Char('y' | 'Y') => self.send(request),
                _ => Effect::None,
            };
        }
        match key.code {
            KeyCode::Char('q') | KeyCode::Esc => Effect::Quit,
            KeyCode::Char('b') => {
                let bypassed = self.now().is_some_and(|seen| seen.report.bypassed);
                self.ask(Request::Bypass(!bypassed))
            }
            KeyCode::Char('s') => self.ask(Request::Mode(Mode::Shadow)),
            KeyCode::Char('l') => self.ask(Request::Mode(Mode::Limited)),
            KeyCode::Char('f') => self.ask(Request::Mode(Mode::Full)),
            KeyCode::Char('a') => self.ask(Request::Arm),
            KeyCode::Char('r') => self.ask(Request::Reload),
            KeyCode::Char(' ') => {
                self.frozen = !self.frozen;
                if let Some(seen) = self.waiting.take() {
                    self.seen = Some(seen);
                }
                Effect::None
            }
            _ => Effect::None,
        }
    }

    /// The present state of the cell, displayed or not.
    fn now(&self) -> Option<&Arc<Seen>> {
        self.waiting.as_ref().or(self.seen.as_ref())
    }

    fn ask(&mut self, request: Request) -> Effect {
        if request.needs_a_yes() {
            self.asks = Some(request);
            Effect::None
        } else {
            self.send(request)
        }
    }

    fn send(&mut self, request: Request) -> Effect {
        self.pending = Some(request);
        Effect::Ask(request)
    }

    fn happened(&mut self, says: String) {
        let uptime_s = self.now().map_or(0.0, |seen| seen.report.uptime_s);
        self.events.push_front(Happened { uptime_s, says });
        self.events.truncate(EVENTS_KEPT);
    }

    fn count(&mut self, status: &Status) {
        let now = Count { t_ns: status.t_ns, commands: status.commands };
        if self.counted.back().is_some_and(|last| last.commands > now.commands) {
            // A new daemon.
            self.counted.clear();
        }
        self.counted.push_back(now);
        let since_s = |count: &Count| now.t_ns.saturating_sub(count.t_ns) as f64 * 1e-9;
        while self.counted.get(1).is_some_and(|second| since_s(second) >= RATE_OVER_S) {
            self.counted.pop_front();
        }
        self.rate_hz = self.counted.front().and_then(|first| {
            let (span_s, commands) = (since_s(first), now.commands - first.commands);
            (span_s > 0.0 && commands > 0).then(|| commands as f64 / span_s)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;

    fn press(screen: &mut Screen, key: char) -> Effect {
        screen.key(KeyEvent::new(KeyCode::Char(key), KeyModifiers::NONE))
    }

    fn status(screen: &mut Screen, status: Status) {
        let report = Report::of("cell", &status, None);
        let seen = Some(Arc::new(Seen { report, status, robot: None }));
        screen.hear(News { seen, verdicts: Vec::new() });
    }

    #[test]
    fn requests_that_remove_the_correction_are_sent_at_once_others_after_confirmation() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status::default());
        assert_eq!(press(&mut screen, 'b'), Effect::Ask(Request::Bypass(true)));
        assert_eq!(press(&mut screen, 's'), Effect::Ask(Request::Mode(Mode::Shadow)));
        for (key, request) in [
            ('l', Request::Mode(Mode::Limited)),
            ('f', Request::Mode(Mode::Full)),
            ('a', Request::Arm),
            ('r', Request::Reload),
        ] {
            assert_eq!(press(&mut screen, key), Effect::None);
            assert_eq!(press(&mut screen, 'n'), Effect::None, "`{key}` then no");
            assert_eq!(press(&mut screen, 'y'), Effect::None, "nothing waits for a yes any more");
            assert_eq!(press(&mut screen, key), Effect::None);
            assert_eq!(press(&mut screen, 'y'), Effect::Ask(request));
        }
    }

    #[test]
    fn a_bypassed_cell_is_asked_to_end_it() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status { bypassed: 1, ..Status::default() });
        assert_eq!(press(&mut screen, 'b'), Effect::None);
        assert_eq!(press(&mut screen, 'y'), Effect::Ask(Request::Bypass(false)));
    }

    #[test]
    fn a_frozen_screen_stays_and_the_bypass_key_goes_by_the_cell_as_it_is() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status::default());
        assert_eq!(press(&mut screen, ' '), Effect::None);
        status(&mut screen, Status { bypassed: 1, commands: 9, ..Status::default() });
        assert_eq!(screen.seen.as_ref().map(|seen| seen.report.counts.commands), Some(0));
        assert_eq!(press(&mut screen, 'b'), Effect::None, "it is bypassed: a yes is needed");
        assert_eq!(screen.asks, Some(Request::Bypass(false)));
        assert_eq!(press(&mut screen, 'n'), Effect::None);
        assert_eq!(press(&mut screen, ' '), Effect::None);
        assert_eq!(screen.seen.as_ref().map(|seen| seen.report.counts.commands), Some(9));
    }

    #[test]
    fn changes_of_state_are_events_and_answers_too() {
        let mut screen = Screen::new("cell");
        status(&mut screen, Status { health: 2, ..Status::default() });
        assert!(screen.events.is_empty(), "the first status is no change");
        status(&mut screen, Status { health: 3, mode: 1, bypassed: 1, ..Status::default() });
        screen.answered(&Answered { request: Request::Arm, says: "refused: no".to_owned() });
        let says: Vec<&str> = screen.events.iter().map(|one| one.says.as_str()).collect();
        assert_eq!(says[..3], ["arm: refused: no", "bypassed", "mode shadow -> limited"]);
        assert!(says[3].starts_with("running -> degraded"), "{says:?}");
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
        assert_eq!(press(&mut screen, 'q'), Effect::Quit);
        let escape = KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE);
        assert_eq!(press(&mut screen, 'a'), Effect::None);
        assert_eq!(screen.key(escape), Effect::None, "it leaves the question");
        assert_eq!(screen.key(escape), Effect::Quit);
        let ctrl_c = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(press(&mut screen, 'a'), Effect::None);
        assert_eq!(screen.key(ctrl_c), Effect::Quit);
    }
}
