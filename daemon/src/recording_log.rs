//! Log lines and states of the daemon for the recording.
//!
//! Storing a line is one copy, without waiting; without a recorder nothing is stored; while the disk
//! cannot be written, the newest lines are buffered for the next file. The cycle's thread does not
//! log.

use crate::exchange::Exchange;
use crate::records;
use recording::mcap_recording::{LogRecord, StatusRecord};
use shm_schema::{Status, monotonic_ns};
use std::cell::RefCell;
use std::sync::Arc;

/// Without a change the state is recorded this often, ns.
const STATUS_EVERY_NS: u64 = 1_000_000_000;

thread_local! {
    /// The cell of this thread.
    static CELL: RefCell<Option<Arc<Exchange>>> = const { RefCell::new(None) };
}

/// Sends log lines of this thread to the recording of this cell.
pub fn attach_thread(exchange: &Arc<Exchange>) {
    CELL.with_borrow_mut(|cell| *cell = Some(Arc::clone(exchange)));
}

/// The cell of this thread.
#[must_use]
pub fn attached_exchange() -> Option<Arc<Exchange>> {
    CELL.with_borrow(Clone::clone)
}

/// Stores a line logged by this thread, at `info`, `warn` or `error`; called by the program's
/// logger.
pub fn record_line(level: &str, message: impl FnOnce() -> String) {
    // A thread may log while its thread-local data are already destroyed.
    let _ = CELL.try_with(|cell| {
        // A line that is logged while another is stored is dropped.
        let Ok(cell) = cell.try_borrow() else { return };
        if let Some(exchange) = cell.as_ref() {
            let (t_ns, level) = (monotonic_ns(), level.to_owned());
            exchange.record_line(|| LogRecord { t_ns, level, says: message() });
        }
    });
}

/// Chooses which states are recorded: each change, and one per second.
#[derive(Debug, Default)]
pub struct StatusFilter {
    last: Option<(u64, [u64; 5])>,
}

impl StatusFilter {
    /// The state to be recorded, when due.
    pub fn select(&mut self, status: &Status) -> Option<StatusRecord> {
        let Status { health, mode, bypassed, recorder, model_epoch, .. } = *status;
        let [health, mode, bypassed, recorder] = [health, mode, bypassed, recorder].map(u64::from);
        let key = [health, mode, bypassed, recorder, model_epoch];
        let is_due = self.last.is_none_or(|(t_ns, before)| {
            before != key || status.t_ns.saturating_sub(t_ns) >= STATUS_EVERY_NS
        });
        is_due.then(|| {
            self.last = Some((status.t_ns, key));
            records::status(status)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_change_of_state_is_recorded_and_one_a_second_without() {
        let mut states = StatusFilter::default();
        let second = 1_000_000_000;
        let mut taken = |t_ns, bypassed| {
            states.select(&Status { t_ns, bypassed, ..Status::default() }).is_some()
        };
        assert!(taken(0, 0) && !taken(second / 2, 0));
        assert!(taken(second / 2 + 1, 1) && !taken(second, 1), "a change, and nothing new");
        assert!(taken(second / 2 + 1 + second, 1), "a second later");
    }

    #[test]
    fn lines_go_to_the_cell_of_their_thread_and_the_newest_wait_for_a_file() {
        record_line("info", || unreachable!("nobody records"));
        let exchange = Arc::new(Exchange::new(corrector::Mode::Full, true));
        let shared = Arc::clone(&exchange);
        let thread = std::thread::spawn(move || {
            attach_thread(&shared);
            (0..10_000).for_each(|number| record_line("warn", || format!("line {number}")));
        });
        thread.join().unwrap();
        let lines: Vec<_> = std::iter::from_fn(|| exchange.lines.pop()).collect();
        assert_eq!(lines.last().unwrap().says, "line 9999");
        assert!(lines.len() < 1000 && lines.iter().all(|line| line.level == "warn"));
    }
}
