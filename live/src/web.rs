//! Page, status, events and metrics over HTTP. Read-only: requests other than `GET` are refused.

use std::io::{self, Write};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

use serde::Serialize;

use crate::access::AccessRequest;
use crate::cell_watch::{CellState, CellWatch, ReaderPosition, unix_ms};
use crate::history::{Entries, HistoryPosition, SPAN_MS, STEP_MS};
use crate::http::{self, Request};
use crate::report::Report;
use crate::snapshot::SnapshotPage;
use crate::{Access, LiveError, metrics};

/// The page: self-contained, without other files or servers.
const PAGE: &str = include_str!("page.html");
/// Limit on browsers that receive events; each takes a connection and its thread.
const EVENT_READERS_MAX: usize = 32;
/// Interval at which a comment is sent if there are no events, so that a closed connection is
/// detected.
const HEARTBEAT_AFTER: Duration = Duration::from_secs(2);

/// Answer to a request without access.
const REFUSED: &str = "a token is required (?token=TOKEN); without one, use the address 127.0.0.1 or localhost, and no page of another server\n";

const HTML: &str = "text/html; charset=utf-8";
const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const EVENTS: &str = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\
    Cache-Control: no-store\r\nConnection: close\r\n\r\n";

/// Answers browsers and Prometheus.
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
    access: Access,
}

impl Server {
    /// Binds the address.
    pub(crate) fn listen(address: SocketAddr, access: Access) -> Result<Self, LiveError> {
        let refused = |why: io::Error| LiveError::Listen { address, why: why.to_string() };
        let listener = http::listen(address).map_err(refused)?;
        let address = listener.local_addr().map_err(refused)?;
        Ok(Self { listener, address, access })
    }

    /// The address bound.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until `stop` is set.
    pub(crate) fn run(self, watch: &Arc<CellWatch>, stop: &Arc<AtomicBool>) {
        let site = Site {
            access: self.access,
            watch: Arc::clone(watch),
            stop: Arc::clone(stop),
            followers: AtomicUsize::new(0),
        };
        http::serve(&self.listener, stop, move |request| site.answer(request));
    }
}

/// What requests are answered from.
struct Site {
    access: Access,
    watch: Arc<CellWatch>,
    stop: Arc<AtomicBool>,
    followers: AtomicUsize,
}

impl Site {
    fn answer(&self, request: Request) {
        let access = AccessRequest {
            target: &request.target,
            host: request.header("Host"),
            origin: request.header("Origin"),
            authorization: request.header("Authorization"),
        };
        if !self.access.allows(access) {
            return respond(request, 401, TEXT, REFUSED);
        }
        if request.method != "GET" {
            return respond(request, 405, TEXT, "only GET is supported\n");
        }
        let cell_state = self.watch.current();
        let report = cell_state.as_deref().map(|cell_state| &cell_state.report);
        let path = request.target.split('?').next().unwrap_or_default().to_owned();
        match path.as_str() {
            "/" => respond(request, 200, HTML, PAGE),
            "/status" => match report.map(json) {
                Some(text) => respond(request, 200, JSON, &text),
                None => respond(request, 503, TEXT, "no status received yet\n"),
            },
            "/metrics" => {
                let cell = report.map_or("", |report| &report.cell);
                let text = metrics::metrics_text(cell, report).unwrap_or_default();
                respond(request, 200, OPEN_METRICS, &text);
            }
            "/report" => match cell_state {
                Some(cell_state) => send_report(request, &self.watch, cell_state),
                None => respond(request, 503, TEXT, "no status received yet\n"),
            },
            "/events" => self.stream_events(request),
            _ => {
                let places = "not found; available: /, /status, /events, /metrics, /report\n";
                respond(request, 404, TEXT, places);
            }
        }
    }

    /// Sends each change of the status until the browser disconnects.
    fn stream_events(&self, request: Request) {
        if self.followers.fetch_add(1, Relaxed) >= EVENT_READERS_MAX {
            self.followers.fetch_sub(1, Relaxed);
            let message = format!("{EVENT_READERS_MAX} browsers are connected already\n");
            return respond(request, 503, TEXT, &message);
        }
        // On an error the browser has disconnected.
        let _ = send_events(&mut request.into_stream(), &self.watch, &self.stop);
        self.followers.fetch_sub(1, Relaxed);
    }
}

fn json(report: &Report) -> String {
    let value = serde_json::to_value(report).unwrap_or_default();
    let mut with_schema = serde_json::json!({
        "schema": "trued.status/1",
        "version": recording::program::version(),
    });
    if let (Some(all), Some(fields)) = (with_schema.as_object_mut(), value.as_object()) {
        all.extend(fields.clone());
    }
    with_schema.to_string()
}

/// The report, under the name by which a browser saves it.
fn send_report(request: Request, watch: &CellWatch, cell_state: Arc<CellState>) {
    let entries = watch.history(&mut HistoryPosition::default());
    let moment = SnapshotPage { cell_state, entries, now_ms: unix_ms() };
    let saved = format!("attachment; filename=\"{}\"", moment.file_name());
    respond_as(request, 200, HTML, &moment.html(), Some(("Content-Disposition", &saved)));
}

fn respond(request: Request, code: u16, kind: &str, text: &str) {
    respond_as(request, code, kind, text, None);
}

fn respond_as(request: Request, code: u16, kind: &str, text: &str, also: Option<(&str, &str)>) {
    let headers = [
        ("Content-Type", kind),
        ("Cache-Control", "no-store"),
        ("X-Content-Type-Options", "nosniff"),
        ("Content-Security-Policy", "default-src 'self' 'unsafe-inline'; img-src data:"),
    ];
    let headers: Vec<_> = headers.into_iter().chain(also).collect();
    request.respond(code, &headers, text);
}

fn send_events(to: &mut impl Write, watch: &CellWatch, stop: &AtomicBool) -> io::Result<()> {
    let (mut reader, mut mark, mut is_first) =
        (ReaderPosition::default(), HistoryPosition::default(), true);
    let mut drawn = String::new();
    to.write_all(EVENTS.as_bytes())?;
    to.flush()?;
    while !stop.load(Relaxed) {
        let news = watch.wait_for_update(&mut reader, HEARTBEAT_AFTER);
        send_history(to, &watch.history(&mut mark), is_first)?;
        is_first = false;
        match news.cell_state {
            Some(cell_state) => {
                if let Some(robot) = &cell_state.robot {
                    let drawing = serde_json::to_string(robot).unwrap_or_default();
                    // An unchanged drawing is sent once to each reader, however often the status is published.
                    if drawing != drawn {
                        write!(to, "event: robot\ndata: {drawing}\n\n")?;
                        drawn = drawing;
                    }
                }
                write!(to, "data: {}\n\n", json(&cell_state.report))?;
            }
            None => to.write_all(b":\n\n")?,
        }
        to.flush()?;
    }
    Ok(())
}

/// First the whole history as one event, so that a page draws it once; then each new entry.
fn send_history(to: &mut impl Write, entries: &Entries, is_first: bool) -> io::Result<()> {
    if is_first {
        let whole = serde_json::json!({ "now_ms": unix_ms(), "span_ms": SPAN_MS, "step_ms": STEP_MS, "entries": entries });
        return send(to, "history", &whole);
    }
    entries.latency.iter().try_for_each(|one| send(to, "latency", one))?;
    entries.events.iter().try_for_each(|one| send(to, "happened", one))?;
    entries.spectra.iter().try_for_each(|one| send(to, "spectrum", one.as_ref()))
}

fn send(to: &mut impl Write, event: &str, data: &impl Serialize) -> io::Result<()> {
    let data = serde_json::to_string(data).unwrap_or_default();
    write!(to, "event: {event}\ndata: {data}\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell_watch::CellState;
    use crate::robot::Drawing;
    use shm_schema::Status;

    /// Publishes the next state when the events so far were sent; ends after the last one.
    struct Page<'a> {
        watch: &'a CellWatch,
        stop: &'a AtomicBool,
        shifts_mm: Vec<f64>,
        text: String,
    }

    impl Write for Page<'_> {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.text += &String::from_utf8_lossy(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            match self.shifts_mm.pop() {
                Some(x) => self.watch.set_state(state(x)),
                None => self.stop.store(true, Relaxed),
            }
            Ok(())
        }
    }

    fn state(x: f64) -> CellState {
        let status = Status::default();
        let report = Report::new("cell", &status, None);
        let robot =
            Drawing::Arm { points_mm: vec![[0.0; 3]], shift_mm: [x, 0.0, 0.0], reach_mm: 1.0 };
        CellState { report, status, robot: Some(robot) }
    }

    #[test]
    fn a_drawing_is_sent_to_each_reader_at_once_and_again_when_it_has_changed() {
        let watch = CellWatch::default();
        watch.set_state(state(1.0));
        for _ in 0..2 {
            let stop = AtomicBool::new(false);
            let shifts_mm = vec![1.0, 2.0, 2.0, 1.0, 1.0];
            let mut page = Page { watch: &watch, stop: &stop, shifts_mm, text: String::new() };
            send_events(&mut page, &watch, &stop).expect("written");
            assert_eq!(page.text.matches("event: robot").count(), 3, "{}", page.text);
            assert_eq!(page.text.matches("event: history").count(), 1, "{}", page.text);
            assert_eq!(page.text.matches("\ndata: {\"").count(), 1 + 3 + 5, "{}", page.text);
        }
    }
}
