//! Page, status, events and metrics over HTTP. Read-only: requests other than `GET` are refused.

use std::io::{self, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use serde::Serialize;
use tiny_http::{Header, Method, Request, Response, StatusCode};

use crate::access::AccessRequest;
use crate::cell_watch::{CellState, CellWatch, ReaderPosition, unix_ms};
use crate::history::{Entries, HistoryPosition, SPAN_MS, STEP_MS};
use crate::report::Report;
use crate::snapshot::SnapshotPage;
use crate::{Access, LiveError, metrics};

/// The page: self-contained, without other files or servers.
const PAGE: &str = include_str!("page.html");
/// How often `stop` is polled.
const POLL_EVERY: Duration = Duration::from_millis(100);
/// Limit on browsers that receive events; each takes a thread.
const EVENT_READERS_MAX: usize = 32;
/// Interval at which a comment is sent if there are no events, so that a closed connection is
/// detected.
const HEARTBEAT_AFTER: Duration = Duration::from_secs(2);

/// Answer to a request without access.
const REFUSED: &str =
    "a token is required (?token=TOKEN); without one, use the address 127.0.0.1 or localhost\n";

const HTML: &str = "text/html; charset=utf-8";
const JSON: &str = "application/json";
const TEXT: &str = "text/plain; charset=utf-8";
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const EVENTS: &str = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\
    Cache-Control: no-store\r\nConnection: close\r\n\r\n";

/// Answers browsers and Prometheus.
pub(crate) struct Server {
    http: tiny_http::Server,
    address: SocketAddr,
    access: Access,
}

impl Server {
    /// Binds the address.
    pub(crate) fn listen(address: SocketAddr, access: Access) -> Result<Self, LiveError> {
        let http = tiny_http::Server::http(address)
            .map_err(|why| LiveError::Listen { address, why: why.to_string() })?;
        let address = http.server_addr().to_ip().unwrap_or(address);
        Ok(Self { http, address, access })
    }

    /// The address bound.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers requests until `stop` is set.
    pub(crate) fn run(self, watch: &Arc<CellWatch>, stop: &Arc<AtomicBool>) {
        let followers = Arc::new(AtomicUsize::new(0));
        while !stop.load(Relaxed) {
            // An error here concerns one connection only.
            if let Ok(Some(request)) = self.http.recv_timeout(POLL_EVERY) {
                self.answer(request, watch, &followers, stop);
            }
        }
    }

    fn answer(
        &self,
        request: Request,
        watch: &Arc<CellWatch>,
        followers: &Arc<AtomicUsize>,
        stop: &Arc<AtomicBool>,
    ) {
        let header = |name: &'static str| {
            let found = request.headers().iter().find(|header| header.field.equiv(name));
            found.map(|header| header.value.as_str())
        };
        let (host, authorization) = (header("Host"), header("Authorization"));
        if !self.access.allows(AccessRequest { target: request.url(), host, authorization }) {
            return respond(request, 401, TEXT, REFUSED.to_owned());
        }
        if *request.method() != Method::Get {
            return respond(request, 405, TEXT, "only GET is supported\n".to_owned());
        }
        let cell_state = watch.current();
        let report = cell_state.as_deref().map(|cell_state| &cell_state.report);
        let path = request.url().split('?').next().unwrap_or_default();
        match path {
            "/" => respond(request, 200, HTML, PAGE.to_owned()),
            "/status" => match report.map(json) {
                Some(text) => respond(request, 200, JSON, text),
                None => respond(request, 503, TEXT, "no status received yet\n".to_owned()),
            },
            "/metrics" => {
                let cell = report.map_or("", |report| &report.cell);
                let text = metrics::metrics_text(cell, report).unwrap_or_default();
                respond(request, 200, OPEN_METRICS, text);
            }
            "/report" => match cell_state {
                Some(cell_state) => send_report(request, watch, cell_state),
                None => respond(request, 503, TEXT, "no status received yet\n".to_owned()),
            },
            "/events" => stream_events(request, watch, followers, stop),
            _ => {
                let places =
                    "not found; available: /, /status, /events, /metrics, /report\n".to_owned();
                respond(request, 404, TEXT, places);
            }
        }
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
    respond_as(request, 200, HTML, moment.html(), Some(("Content-Disposition", &saved)));
}

fn respond(request: Request, code: u16, kind: &str, text: String) {
    respond_as(request, code, kind, text, None);
}

fn respond_as(request: Request, code: u16, kind: &str, text: String, also: Option<(&str, &str)>) {
    let header = |name: &str, value: &str| Header::from_bytes(name, value).ok();
    let headers = [
        header("Content-Type", kind),
        header("Cache-Control", "no-store"),
        header("X-Content-Type-Options", "nosniff"),
        header("Content-Security-Policy", "default-src 'self' 'unsafe-inline'; img-src data:"),
        also.and_then(|(name, value)| header(name, value)),
    ];
    // Sent with a stated length, so that a browser can show the progress of a download.
    let response = Response::from_string(text).with_chunked_threshold(usize::MAX);
    let mut response = response.with_status_code(StatusCode(code));
    headers.into_iter().flatten().for_each(|header| response.add_header(header));
    // A client that has left needs no answer.
    let _ = request.respond(response);
}

/// Sends each change of the status, in a separate thread, until the browser disconnects.
fn stream_events(
    request: Request,
    watch: &Arc<CellWatch>,
    followers: &Arc<AtomicUsize>,
    stop: &Arc<AtomicBool>,
) {
    if followers.fetch_add(1, Relaxed) >= EVENT_READERS_MAX {
        followers.fetch_sub(1, Relaxed);
        let message = format!("{EVENT_READERS_MAX} browsers are connected already\n");
        return respond(request, 503, TEXT, message);
    }
    let (watch, stop, count) = (Arc::clone(watch), Arc::clone(stop), Arc::clone(followers));
    let thread = thread::Builder::new().name("events".to_owned());
    let spawned = thread.spawn(move || {
        let mut to = request.into_writer();
        // On an error the browser has disconnected.
        let _ = send_events(&mut to, &watch, &stop);
        count.fetch_sub(1, Relaxed);
    });
    if spawned.is_err() {
        followers.fetch_sub(1, Relaxed);
    }
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
