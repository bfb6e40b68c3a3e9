//! Present state of the cell and its last five minutes, from one monitor shared by all viewers.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use shm_schema::{Status, Verdict};
use trued_client::Monitor;

use crate::history::{Entries, History, HistoryPosition};
use crate::report::Report;
use crate::robot::{Drawing, RobotModelFile};

/// Polling interval; the daemon publishes a status every 40 ms.
const POLL_EVERY: Duration = Duration::from_millis(20);
/// Without a new status the last one is resent after this time, with its present age.
const RESEND_AFTER: Duration = Duration::from_secs(1);
/// Number of vibration verdicts kept for slow readers.
const VERDICTS_KEPT: usize = 256;

/// State of the cell at one time.
#[derive(Debug)]
pub(crate) struct CellState {
    /// The status, with names instead of codes.
    pub(crate) report: Report,
    /// The status as received.
    pub(crate) status: Status,
    /// Drawing of the robot; `None` if its model file is not known.
    pub(crate) robot: Option<Drawing>,
}

/// A vibration verdict and its number, from 0.
type NumberedVerdict = (u64, Verdict);

#[derive(Debug, Default)]
struct SharedState {
    /// Number of the state.
    number: u64,
    cell_state: Option<Arc<CellState>>,
    verdicts: Vec<NumberedVerdict>,
    verdict_number: u64,
    history: History,
}

/// Shared state of the cell; readers wait for changes.
#[derive(Debug, Default)]
pub(crate) struct CellWatch {
    known: Mutex<SharedState>,
    news: Condvar,
}

/// Position of a reader.
#[derive(Debug, Default)]
pub(crate) struct ReaderPosition {
    number: u64,
    verdict_number: u64,
}

/// Changes for a reader.
#[derive(Debug, Default)]
pub(crate) struct CellUpdate {
    /// The present state of the cell, if it changed.
    pub(crate) cell_state: Option<Arc<CellState>>,
    /// Verdicts since the last update.
    pub(crate) verdicts: Vec<Verdict>,
}

impl CellWatch {
    fn lock_state(&self) -> MutexGuard<'_, SharedState> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The present state of the cell; `None` before the first status.
    pub(crate) fn current(&self) -> Option<Arc<CellState>> {
        self.lock_state().cell_state.clone()
    }

    /// Changes for `reader`, waiting up to `limit`.
    pub(crate) fn wait_for_update(
        &self,
        reader: &mut ReaderPosition,
        limit: Duration,
    ) -> CellUpdate {
        let known = self.lock_state();
        let nothing = |known: &mut SharedState| {
            known.number == reader.number && known.verdict_number == reader.verdict_number
        };
        let waited = self.news.wait_timeout_while(known, limit, nothing);
        let (known, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let is_new = |(number, _): &&NumberedVerdict| *number >= reader.verdict_number;
        let verdicts = known.verdicts.iter().filter(is_new).map(|(_, verdict)| *verdict).collect();
        let cell_state = known.cell_state.clone().filter(|_| known.number != reader.number);
        (reader.number, reader.verdict_number) = (known.number, known.verdict_number);
        CellUpdate { cell_state, verdicts }
    }

    /// Entries of the history since `mark`; they come with [`CellWatch::wait_for_update`], at the latest after a second.
    pub(crate) fn history(&self, mark: &mut HistoryPosition) -> Entries {
        self.lock_state().history.since(mark)
    }

    pub(crate) fn set_state(&self, cell_state: CellState) {
        let mut known = self.lock_state();
        known.history.add_status(unix_ms(), &cell_state.status, &cell_state.report);
        known.number += 1;
        known.cell_state = Some(Arc::new(cell_state));
        drop(known);
        self.news.notify_all();
    }

    fn add_verdict(&self, verdict: Verdict) {
        let mut known = self.lock_state();
        let number = known.verdict_number;
        known.history.add_verdict(unix_ms(), &verdict);
        known.verdict_number += 1;
        known.verdicts.push((number, verdict));
        let surplus = known.verdicts.len().saturating_sub(VERDICTS_KEPT);
        known.verdicts.drain(..surplus);
        drop(known);
        self.news.notify_all();
    }
}

/// This computer's clock, ms since 1970.
pub(crate) fn unix_ms() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_millis()).unwrap_or(u64::MAX)
}

/// Polls the cell until `stop` is set; spectra only if `shows_spectra`, because the daemon computes them only while they are read.
pub(crate) fn run(
    cell: &str,
    mut monitor: Monitor,
    mut robot: Option<RobotModelFile>,
    shows_spectra: bool,
    watch: &CellWatch,
    stop: &AtomicBool,
) {
    let mut last: Option<(u64, Option<String>)> = None;
    let mut last_sent = Instant::now();
    while !stop.load(Relaxed) {
        while let Some(verdict) = monitor.vibration() {
            watch.add_verdict(verdict);
        }
        while let Some(spectrum) = shows_spectra.then(|| monitor.spectrum()).flatten() {
            watch.lock_state().history.add_spectrum(unix_ms(), &spectrum);
        }
        if let Some(status) = monitor.status() {
            let away = monitor.disconnect_reason().map(|away| away.to_string());
            let key = (status.t_ns, away);
            // A daemon that has just started has not published a status yet: this one is from its
            // predecessor.
            let is_former = key.1.is_none()
                && last.as_ref().is_some_and(|(t_ns, away)| *t_ns == key.0 && away.is_some());
            if is_former {
                std::thread::sleep(POLL_EVERY);
                continue;
            }
            if last.as_ref() != Some(&key) || last_sent.elapsed() > RESEND_AFTER {
                let report = Report::new(cell, &status, key.1.clone());
                let robot = robot.as_mut().map(|robot| robot.drawing(&status));
                watch.set_state(CellState { report, status, robot });
                (last, last_sent) = (Some(key), Instant::now());
            }
        }
        std::thread::sleep(POLL_EVERY);
    }
}
