//! `trued top`: a running cell on a terminal, with keys for the operator's requests.
//!
//! Two connections to the cell: one for the display, one for requests, so that a daemon that does not respond does not block the display. Only cells of the
//! terminal that changed are written (ratatui): usable over a slow line.

mod requests;
mod screen;
mod view;

use std::io;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event, KeyEventKind};
use trued_client::Monitor;

use crate::LiveError;
use crate::cell_watch::{self, CellWatch, ReaderPosition};
use screen::{KeyAction, Screen};

/// Time to wait for a key before the cell is polled.
const KEY_TIMEOUT: Duration = Duration::from_millis(50);
/// Interval between redraws without a key: as often as a person can read numbers.
const REDRAW_EVERY: Duration = Duration::from_millis(250);

/// Why the display ended.
#[derive(Debug, thiserror::Error)]
pub enum TopError {
    /// The terminal cannot be used.
    #[error("cannot use the terminal: {0}; without a terminal, use `trued status --watch`")]
    Terminal(#[from] io::Error),
    /// The system refused a thread.
    #[error(transparent)]
    Thread(#[from] LiveError),
}

/// Shows `cell` until the user quits or `stop` is set. `looking` and `asking` are two connections
/// to it.
///
/// # Errors
/// See [`TopError`]. The terminal is restored, also on a panic.
pub fn run(
    cell: &str,
    looking: Monitor,
    asking: Monitor,
    stop: &Arc<AtomicBool>,
) -> Result<(), TopError> {
    let watch = Arc::new(CellWatch::default());
    let ended = Arc::new(AtomicBool::new(false));
    let (ask, requests_sent) = mpsc::channel();
    let (answer, answers) = mpsc::channel();
    let looks = {
        let (name, watch, ended) = (cell.to_owned(), Arc::clone(&watch), Arc::clone(&ended));
        spawn("watch", move || cell_watch::run(&name, looking, None, false, &watch, &ended))?
    };
    // It ends when `ask` is dropped; a daemon that does not respond is not waited for.
    spawn("ask", move || requests::run(asking, &requests_sent, &answer))?;
    let mut terminal = ratatui::try_init()?;
    let shown = show(cell, &mut terminal, &Channels { watch: &watch, ask, answers }, stop);
    let restored = ratatui::try_restore();
    ended.store(true, Relaxed);
    let _ = looks.join();
    shown?;
    restored?;
    Ok(())
}

/// Connections of the display to the cell's state and to the thread for requests.
struct Channels<'a> {
    watch: &'a CellWatch,
    ask: mpsc::Sender<requests::OperatorRequest>,
    answers: mpsc::Receiver<requests::AnsweredRequest>,
}

fn show(
    cell: &str,
    terminal: &mut ratatui::DefaultTerminal,
    channels: &Channels<'_>,
    stop: &AtomicBool,
) -> io::Result<()> {
    let mut screen = Screen::new(cell);
    let mut reader = ReaderPosition::default();
    let mut drawn: Option<Instant> = None;
    while !stop.load(Relaxed) {
        let news = channels.watch.wait_for_update(&mut reader, Duration::ZERO);
        screen.update(news);
        channels.answers.try_iter().for_each(|answered| screen.add_answer(&answered));
        let mut at_once = drawn.is_none_or(|drawn| drawn.elapsed() >= REDRAW_EVERY);
        if event::poll(if at_once { Duration::ZERO } else { KEY_TIMEOUT })? {
            match event::read()? {
                Event::Key(key) if key.kind != KeyEventKind::Release => match screen.key(key) {
                    KeyAction::None => {}
                    KeyAction::Quit => return Ok(()),
                    // If the thread has ended, the screen continues to show that no answer was
                    // received.
                    KeyAction::Ask(request) => drop(channels.ask.send(request)),
                },
                _ => {}
            }
            at_once = true;
        }
        if at_once {
            terminal.draw(|frame| view::draw(frame, &screen))?;
            drawn = Some(Instant::now());
        }
    }
    Ok(())
}

fn spawn(
    name: &str,
    run: impl FnOnce() + Send + 'static,
) -> Result<thread::JoinHandle<()>, LiveError> {
    thread::Builder::new().name(name.to_owned()).spawn(run).map_err(LiveError::Thread)
}
