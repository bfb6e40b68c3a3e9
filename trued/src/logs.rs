//! Logs to standard error, above the progress bars, never through them.

use std::io::{self, Write};

use indicatif::MultiProgress;
use tracing_subscriber::filter::LevelFilter;

use crate::output::Console;

/// A line of log that waits until the bars are out of the way.
struct BesideBars(MultiProgress);

impl Write for BesideBars {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        self.0.suspend(|| io::stderr().write(text))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
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
        .with_target(common.verbose > 0)
        .without_time()
        .finish();
    // Already set: a test runs the program several times in one process, and the first log serves them all.
    let _ = tracing::subscriber::set_global_default(log);
}
