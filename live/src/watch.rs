//! Present state of the cell and its last five minutes, from one monitor shared by all viewers.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use shm_schema::{Status, Verdict};
use trued_client::Monitor;

use crate::history::{Entries, History, Mark};
use crate::report::Report;
use crate::robot::{Drawing, Robot};

/// Polling interval; the daemon publishes a status every 40 ms.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Without a new status the last one is sent again after this time, with its present age.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// Number of vibration verdicts kept for slow readers.
const VERDICTS_KEPT: usize = 256;

/// State of the cell at one time.
#[derive(Debug)]
pub(crate) struct Seen {
    /// The status, with names instead of codes.
    pub(crate) report: Report,
    /// The status as received.
    pub(crate) status: Status,
    /// What is drawn of the robot; `None` if its model file is not known.
    pub(crate) robot: Option<Drawing>,
}

/// A vibration verdict and its number, from 0.
type Numbered = (u64, Verdict);

#[derive(Debug, Default)]
struct Known {
    /// Number of the state.
    number: u64,
    seen: Option<Arc<Seen>>,
    verdicts: Vec<Numbered>,
    verdict_number: u64,
    history: History,
}

/// Shared state of the cell; readers wait for changes.
#[derive(Debug, Default)]
pub(crate) struct Watch {
    known: Mutex<Known>,
    news: Condvar,
}

/// Position of a reader.
#[derive(Debug, Default)]
pub(crate) struct Reader {
    number: u64,
    verdict_number: u64,
}

/// Changes for a reader.
#[derive(Debug, Default)]
pub(crate) struct News {
    /// The present state of the cell, if it changed.
    pub(crate) seen: Option<Arc<Seen>>,
    /// Verdicts since.
    pub(crate) verdicts: Vec<Verdict>,
}

impl Watch {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The present state of the cell; `None` before the first status.
    pub(crate) fn now(&self) -> Option<Arc<Seen>> {
        self.known().seen.clone()
    }

    /// Changes for `reader`, waiting up to `limit`.
    pub(crate) fn news(&self, reader: &mut Reader, limit: Duration) -> News {
        let known = self.known();
        let nothing = |known: &mut Known| {
            known.number == reader.number && known.verdict_number == reader.verdict_number
        };
        let waited = self.news.wait_timeout_while(known, limit, nothing);
        let (known, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let is_new = |(number, _): &&Numbered| *number >= reader.verdict_number;
        let verdicts = known.verdicts.iter().filter(is_new).map(|(_, verdict)| *verdict).collect();
        let seen = known.seen.clone().filter(|_| known.number != reader.number);
        (reader.number, reader.verdict_number) = (known.number, known.verdict_number);
        News { seen, verdicts }
    }

    /// Entries of the history since `mark`; they come with [`Watch::news`], at the latest after a second.
    pub(crate) fn history(&self, mark: &mut Mark) -> Entries {
        self.known().history.since(mark)
    }

    pub(crate) fn see(&self, seen: Seen) {
        let mut known = self.known();
        known.history.status(unix_ms(), &seen.status, &seen.report);
        known.number += 1;
        known.seen = Some(Arc::new(seen));
        drop(known);
        self.news.notify_all();
    }

    fn hear(&self, verdict: Verdict) {
        let mut known = self.known();
        let number = known.verdict_number;
        known.history.verdict(unix_ms(), &verdict);
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

/// Polls the cell until `stop` is set; with its spectra if something `shows_spectra`, as the daemon makes them only then.
pub(crate) fn run(
    cell: &str,
    mut monitor: Monitor,
    mut robot: Option<Robot>,
    shows_spectra: bool,
    watch: &Watch,
    stop: &AtomicBool,
) {
    let mut last: Option<(u64, Option<String>)> = None;
    let mut told = Instant::now();
    while !stop.load(Relaxed) {
        while let Some(verdict) = monitor.vibration() {
            watch.hear(verdict);
        }
        while let Some(spectrum) = shows_spectra.then(|| monitor.spectrum()).flatten() {
            watch.known().history.spectrum(unix_ms(), &spectrum);
        }
        if let Some(status) = monitor.status() {
            let away = monitor.away().map(|away| away.to_string());
            let key = (status.t_ns, away);
            // A daemon that has just started has not published a status yet: this one is from its
            // predecessor.
            let is_former = key.1.is_none()
                && last.as_ref().is_some_and(|(t_ns, away)| *t_ns == key.0 && away.is_some());
            if is_former {
                std::thread::sleep(LOOK_EVERY);
                continue;
            }
            if last.as_ref() != Some(&key) || told.elapsed() > AGAIN_AFTER {
                let report = Report::of(cell, &status, key.1.clone());
                let robot = robot.as_mut().map(|robot| robot.drawing(&status));
                watch.see(Seen { report, status, robot });
                (last, told) = (Some(key), Instant::now());
            }
        }
        std::thread::sleep(LOOK_EVERY);
    }
}
