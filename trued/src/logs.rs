//! Logs to standard error, above the progress bars, never through them.
//!
//! Promises: a log that nobody reads any more costs its lines; the program goes on.

use std::io::{self, Write};

use indicatif::MultiProgress;
use tracing_subscriber::filter::LevelFilter;

use crate::output::Console;

/// A line of log that waits until the bars are out of the way.
struct BesideBars(MultiProgress);

impl Write for BesideBars {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        // There is nobody to tell that there is nobody.
        let _ = self.0.suspend(|| io::stderr().write_all(text));
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Starts the log of the process; a second start in one process changes nothing.
pub(crate) fn start(console: &Console) {
    let common = console.common();
    let level = match (common.quiet, common.verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    };
    let bars = console.progress().clone();
    let log = tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(move || BesideBars(bars.clone()))
        .with_ansi(console.colour_on_stderr())
        // It would say so on standard error, and panic where that is closed.
        .log_internal_errors(false)
        .with_target(common.verbose > 0)
        .without_time()
        .finish();
    // Already set: a test runs the program several times in one process, and the first log serves them all.
    let _ = tracing::subscriber::set_global_default(log);
}
