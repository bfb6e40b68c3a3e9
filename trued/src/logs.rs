//! Logs to standard error, without disturbing progress bars.
//!
//! If the log's reader is gone, its lines are lost and the program continues. A daemon's log goes
//! through a queue, so that a blocked reader blocks nothing else; lines beyond the queue's capacity
//! are dropped, counted, and the count is reported when the reader is back.

use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use indicatif::MultiProgress;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::layer::{Context, SubscriberExt};

use crate::exit::Failure;
use crate::output::Console;
use crate::wrap::{columns_of_stderr, wrapped};

/// Lines that wait for a reader at most.
const WAITING_MAX: usize = 1024;
/// How long the end waits for a reader.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(300);

/// Lines that wait for a reader, once this process serves robots.
static QUEUE: OnceLock<Queue> = OnceLock::new();

/// Lines for a thread that may block.
struct Queue {
    to: SyncSender<Vec<u8>>,
    counts: Arc<Counts>,
}

#[derive(Default)]
struct Counts {
    waiting: AtomicUsize,
    lost: AtomicU64,
}

impl Queue {
    /// Starts the thread that writes to `out`.
    fn start(mut out: impl Write + Send + 'static) -> io::Result<Self> {
        let (to, lines) = sync_channel::<Vec<u8>>(WAITING_MAX);
        let counts = Arc::<Counts>::default();
        let shared = Arc::clone(&counts);
        std::thread::Builder::new().name("log".to_owned()).spawn(move || {
            for line in lines {
                let lost = shared.lost.swap(0, Relaxed);
                // A write error cannot be reported.
                if lost > 0 {
                    let _ = writeln!(
                        out,
                        " WARN {lost} log lines were dropped: the log was not read fast enough"
                    );
                }
                let _ = out.write_all(&line);
                shared.waiting.fetch_sub(1, Relaxed);
            }
        })?;
        Ok(Self { to, counts })
    }

    fn push(&self, line: &[u8]) {
        self.counts.waiting.fetch_add(1, Relaxed);
        if self.to.try_send(line.to_vec()).is_err() {
            self.counts.waiting.fetch_sub(1, Relaxed);
            self.counts.lost.fetch_add(1, Relaxed);
        }
    }

    /// Waits, for a limited time, until all lines are written.
    fn drain(&self, limit: Duration) {
        let since = Instant::now();
        while self.counts.waiting.load(Relaxed) > 0 && since.elapsed() < limit {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Writes a log line while the progress bars are hidden.
struct LogWriter(MultiProgress);

impl Write for LogWriter {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        match QUEUE.get() {
            Some(queue) => queue.push(text),
            // A write error cannot be reported.
            None => {
                let text = on_terminal(text, columns_of_stderr());
                drop(self.0.suspend(|| io::stderr().write_all(&text)));
            }
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A log line as it is written to a terminal of this width; unchanged where standard error is none.
fn on_terminal(line: &[u8], columns: Option<usize>) -> Cow<'_, [u8]> {
    match (columns, std::str::from_utf8(line)) {
        (Some(columns), Ok(text)) => Cow::Owned(wrapped(text, columns).into_bytes()),
        _ => Cow::Borrowed(line),
    }
}

/// Passes the log of a cell's daemon to its recording.
struct RecordingLayer;

impl<S: Subscriber> Layer<S> for RecordingLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let level = match *event.metadata().level() {
            Level::ERROR => "error",
            Level::WARN => "warn",
            _ => "info",
        };
        daemon::recording_log::record_line(level, || {
            let mut line = Line::default();
            event.record(&mut line);
            line.message + &line.fields
        });
    }
}

/// An event's text: its message, then its fields.
#[derive(Default)]
struct Line {
    message: String,
    fields: String,
}

impl Visit for Line {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.record_debug(field, &format_args!("{value}"));
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a string cannot fail.
        let _ = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, " {name}={value:?}"),
        };
    }
}

/// Starts the log of the process; a second start in one process has no effect.
pub(crate) fn start(console: &Console) {
    let common = console.common();
    let level = match (common.quiet, common.verbose) {
        (true, _) => LevelFilter::ERROR,
        (false, 0) => LevelFilter::INFO,
        (false, 1) => LevelFilter::DEBUG,
        (false, _) => LevelFilter::TRACE,
    };
    let bars = console.progress().clone();
    let log = tracing_subscriber::fmt::layer()
        .with_writer(move || LogWriter(bars.clone()))
        .with_ansi(console.colour_on_stderr())
        // It would write to standard error, and panic if that is closed.
        .log_internal_errors(false)
        .with_target(common.verbose > 0)
        .without_time()
        .with_filter(level);
    // Whatever is shown, the recording of a cell gets its daemon's log.
    let recorded = RecordingLayer.with_filter(LevelFilter::INFO);
    let log = tracing_subscriber::registry().with(log).with(recorded);
    // Already set: a test runs the program several times in one process, and the first log serves them all.
    let _ = tracing::subscriber::set_global_default(log);
}

/// From now on no thread waits for the log's reader, until the end of the process.
///
/// [`Failure::System`] if the system provides no thread.
/// [`Failure::System`] where the system refuses a thread.
pub(crate) fn never_wait() -> Result<(), Failure> {
    if QUEUE.get().is_none() {
        let queue = Queue::start(io::stderr()).map_err(Failure::system)?;
        // If another thread was first, its queue is used.
        let _ = QUEUE.set(queue);
    }
    Ok(())
}

/// Writes the program's last message to the log; waits for its reader as the log does.
pub(crate) fn write(bars: &MultiProgress, text: &[u8]) {
    // If standard error is gone, the exit code remains.
    let _ = LogWriter(bars.clone()).write_all(text);
}

/// Gives the reader a last chance to read.
pub(crate) fn finish() {
    if let Some(queue) = QUEUE.get() {
        queue.drain(FLUSH_TIMEOUT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::sync::mpsc::{Receiver, channel};

    /// A reader that blocks until it is released.
    struct Stalled {
        until: Option<Receiver<()>>,
        read: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Stalled {
        fn write(&mut self, text: &[u8]) -> io::Result<usize> {
            if let Some(until) = self.until.take() {
                let _ = until.recv();
            }
            self.read.lock().expect("one writer").extend_from_slice(text);
            Ok(text.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_stalled_reader_loses_the_lines_beyond_the_queue_and_gets_their_number() {
        let (go_on, until) = channel();
        let read = Arc::<Mutex<Vec<u8>>>::default();
        let stalled = Stalled { until: Some(until), read: Arc::clone(&read) };
        let queue = Queue::start(stalled).expect("a thread");
        let lines = 2 * WAITING_MAX;
        (0..lines).for_each(|k| queue.push(format!("line {k}\n").as_bytes()));
        queue.drain(Duration::from_millis(1));
        assert!(read.lock().expect("one writer").is_empty(), "nothing was read so far");
        go_on.send(()).expect("the reader waits");
        queue.drain(Duration::from_secs(10));
        queue.push(b"after\n");
        queue.drain(Duration::from_secs(10));
        let text = String::from_utf8(read.lock().expect("one writer").clone()).expect("text");
        let kept = text.lines().filter(|line| line.starts_with("line ")).count();
        assert!((WAITING_MAX..=WAITING_MAX + 1).contains(&kept), "{kept}");
        // Lines lost before the thread's first line are reported too.
        let lost = text
            .split(" log lines were dropped")
            .filter_map(|before| before.split(' ').next_back()?.parse::<usize>().ok());
        assert_eq!(lost.sum::<usize>(), lines - kept, "{text}");
        assert!(text.ends_with("after\n"), "{text}");
    }
}
