//! HTTP/1.1 for short requests without a body: one request per connection, each in a thread.
//!
//! A request is read within [`REQUEST_BYTES_MAX`] and [`REQUEST_WITHIN`]; nothing is allocated by what
//! it states. A request that announces a body of more than [`BODY_BYTES_MAX`], or one of unknown
//! length, is refused and its connection closed, without waiting for it.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

/// Limit on request line and headers together, bytes: as common servers (8 KiB to 16 KiB).
const REQUEST_BYTES_MAX: usize = 16 * 1024;
/// Limit on the number of headers: as common servers; a browser sends about 20.
const HEADERS_MAX: usize = 64;
/// Limit on a body, bytes: no request needs one; a small one is ignored.
const BODY_BYTES_MAX: u64 = 4096;
/// Time for request line and headers: a person's network, with retransmissions.
const REQUEST_WITHIN: Duration = Duration::from_secs(3);
/// A client that takes no byte of its answer for this long is disconnected.
const STALLED_AFTER: Duration = Duration::from_secs(5);
/// Limit on connections at one time; each takes a thread.
const CONNECTIONS_MAX: usize = 64;
/// How often `stop` and new connections are polled.
const POLL_EVERY: Duration = Duration::from_millis(20);
/// Bytes, and time, that are read and dropped after an answer, so that a client that still sends
/// receives the answer before the connection is closed.
const DRAIN_BYTES_MAX: u64 = 64 * 1024;
const DRAIN_FOR: Duration = Duration::from_millis(200);

/// A request, and where its answer goes.
pub(crate) struct Request {
    /// `GET` and others.
    pub(crate) method: String,
    /// Path and query.
    pub(crate) target: String,
    headers: Vec<(String, String)>,
    stream: TcpStream,
}

/// Why a connection has no request that can be answered.
#[derive(Debug, PartialEq, Eq)]
enum Refusal {
    /// With this code and text.
    Answer(u16, &'static str),
    /// The client has left, or sends too slowly.
    Close,
}

impl Request {
    /// The first header of this name, in any case.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut all = self.headers.iter();
        all.find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, value)| value.as_str())
    }

    /// Sends the answer and ends the connection.
    pub(crate) fn respond(mut self, code: u16, headers: &[(&str, &str)], body: &str) {
        // A client that has left needs no answer.
        let _ = send(&mut self.stream, code, headers, body);
    }

    /// The connection itself, for an answer that goes on.
    pub(crate) fn into_stream(self) -> TcpStream {
        self.stream
    }
}

/// Accepts connections until `stop` is set, and passes their requests to `answer`, each in a thread.
pub(crate) fn serve(
    listener: &TcpListener,
    stop: &AtomicBool,
    answer: impl Fn(Request) + Send + Sync + 'static,
) {
    let (answer, open) = (Arc::new(answer), Arc::new(AtomicUsize::new(0)));
    while !stop.load(Relaxed) {
        let Ok((mut stream, _)) = listener.accept() else {
            thread::sleep(POLL_EVERY);
            continue;
        };
        if open.fetch_add(1, Relaxed) >= CONNECTIONS_MAX {
            open.fetch_sub(1, Relaxed);
            // Non-blocking: this thread waits for nobody.
            let _ = stream.set_nonblocking(true);
            let _ = write_answer(&mut stream, 503, &[], "too many connections\n");
            continue;
        }
        let (answer, count) = (Arc::clone(&answer), Arc::clone(&open));
        let spawned = thread::Builder::new().name("http".to_owned()).spawn(move || {
            handle(stream, answer.as_ref());
            count.fetch_sub(1, Relaxed);
        });
        if spawned.is_err() {
            open.fetch_sub(1, Relaxed);
        }
    }
}

/// Binds an address for [`serve`].
pub(crate) fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

fn handle(mut stream: TcpStream, answer: &impl Fn(Request)) {
    let prepared = stream
        .set_nonblocking(false)
        .and_then(|()| stream.set_nodelay(true))
        .and_then(|()| stream.set_write_timeout(Some(STALLED_AFTER)));
    if prepared.is_err() {
        return;
    }
    match receive(&mut stream) {
        Ok((method, target, headers)) => answer(Request { method, target, headers, stream }),
        Err(Refusal::Answer(code, text)) => {
            let _ = send(&mut stream, code, &[("Content-Type", "text/plain")], text);
        }
        Err(Refusal::Close) => {}
    }
}

type Head = (String, String, Vec<(String, String)>);

/// Receives request line and headers.
fn receive(stream: &mut TcpStream) -> Result<Head, Refusal> {
    let until = Instant::now() + REQUEST_WITHIN;
    let mut received = Vec::new();
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
            return Err(Refusal::Close);
        }
        let mut part = [0; 2048];
        match stream.read(&mut part) {
            Ok(0) => return Err(Refusal::Close),
            Ok(count) => received.extend_from_slice(part.get(..count).unwrap_or_default()),
            Err(why) if why.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return Err(Refusal::Close),
        }
        if let Some(head) = parse(&received)? {
            return Ok(head);
        }
        if received.len() > REQUEST_BYTES_MAX {
            return Err(Refusal::Answer(431, "the request is too long\n"));
        }
    }
}

/// The request in these bytes; `None` if they do not hold all of it yet.
fn parse(bytes: &[u8]) -> Result<Option<Head>, Refusal> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS_MAX];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) => return Ok(None),
        Ok(httparse::Status::Complete(_)) => {}
        Err(httparse::Error::TooManyHeaders) => {
            return Err(Refusal::Answer(431, "the request has too many headers\n"));
        }
        Err(_) => return Err(Refusal::Answer(400, "not an HTTP request\n")),
    }
    for header in request.headers.iter() {
        let is_long = |value: &[u8]| {
            let number = std::str::from_utf8(value).ok().and_then(|text| text.trim().parse().ok());
            number.is_none_or(|length: u64| length > BODY_BYTES_MAX)
        };
        if header.name.eq_ignore_ascii_case("Transfer-Encoding")
            || (header.name.eq_ignore_ascii_case("Content-Length") && is_long(header.value))
        {
            return Err(Refusal::Answer(413, "requests have no body here\n"));
        }
    }
    let text = |value: &[u8]| String::from_utf8_lossy(value).into_owned();
    let headers = request.headers.iter().map(|one| (one.name.to_owned(), text(one.value)));
    let (method, target) = (request.method.unwrap_or_default(), request.path.unwrap_or_default());
    Ok(Some((method.to_owned(), target.to_owned(), headers.collect())))
}

/// Sends an answer; then waits a moment for what the client still sends.
fn send(stream: &mut TcpStream, code: u16, headers: &[(&str, &str)], body: &str) -> io::Result<()> {
    write_answer(stream, code, headers, body)?;
    stream.shutdown(Shutdown::Write)?;
    stream.set_read_timeout(Some(DRAIN_FOR))?;
    let until = Instant::now() + DRAIN_FOR;
    let (mut dropped, mut part) = (0, [0; 2048]);
    while dropped < DRAIN_BYTES_MAX && Instant::now() < until {
        match stream.read(&mut part)? {
            0 => break,
            count => dropped += count as u64,
        }
    }
    Ok(())
}

fn write_answer(
    stream: &mut TcpStream,
    code: u16,
    headers: &[(&str, &str)],
    body: &str,
) -> io::Result<()> {
    let mut head = format!(
        "HTTP/1.1 {code} {}\r\nContent-Length: {}\r\nConnection: close\r\n",
        reason(code),
        body.len()
    );
    for (name, value) in headers {
        // A line break would end the header.
        let value: String = value.chars().filter(|one| !one.is_control()).collect();
        head += &format!("{name}: {value}\r\n");
    }
    head += "\r\n";
    stream.write_all(head.as_bytes())?;
    stream.write_all(body.as_bytes())?;
    stream.flush()
}

fn reason(code: u16) -> &'static str {
    match code {
        200 => "OK",
        400 => "Bad Request",
        401 => "Unauthorized",
        404 => "Not Found",
        405 => "Method Not Allowed",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Serves `hello` until dropped.
    struct Served {
        address: SocketAddr,
        stop: Arc<AtomicBool>,
    }

    impl Served {
        fn start() -> Self {
            let listener = listen("127.0.0.1:0".parse().unwrap()).unwrap();
            let address = listener.local_addr().unwrap();
            let stop = Arc::new(AtomicBool::new(false));
            let stopped = Arc::clone(&stop);
            thread::spawn(move || {
                serve(&listener, &stopped, |request| request.respond(200, &[], "hello"));
            });
            Self { address, stop }
        }

        fn connect(&self, request: &str) -> TcpStream {
            let mut stream = TcpStream::connect(self.address).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
            stream.write_all(request.as_bytes()).unwrap();
            stream
        }

        fn answer(&self, request: &str) -> String {
            let mut answer = String::new();
            self.connect(request).read_to_string(&mut answer).unwrap();
            answer
        }
    }

    impl Drop for Served {
        fn drop(&mut self) {
            self.stop.store(true, Relaxed);
        }
    }

    const GET: &str = "GET / HTTP/1.1\r\nHost: localhost\r\n";

    #[test]
    fn a_body_of_any_stated_length_neither_ends_the_server_nor_delays_another_request() {
        let served = Served::start();
        for body in [
            "Content-Length: 99999999999\r\n",
            "Content-Length: 3000000000\r\n",
            "Content-Length: 18446744073709551615\r\n",
            "Content-Length: 99999999999999999999999\r\n",
            "Content-Length: -1\r\n",
            "Transfer-Encoding: chunked\r\n",
            "Expect: 100-continue\r\nContent-Length: 3000000000\r\n",
        ] {
            let attack = served.connect(&format!("{GET}{body}\r\nFFFFFFFFFFFFFFF\r\nslow"));
            let begun = Instant::now();
            assert!(served.answer(&format!("{GET}\r\n")).starts_with("HTTP/1.1 200 OK"), "{body}");
            assert!(begun.elapsed() < Duration::from_secs(2), "{body}");
            let mut answer = String::new();
            let mut attack = attack;
            attack.read_to_string(&mut answer).unwrap();
            assert!(answer.starts_with("HTTP/1.1 413 "), "{body}: {answer}");
        }
    }

    #[test]
    fn a_request_that_does_not_end_is_disconnected_and_delays_no_other() {
        let served = Served::start();
        let mut slow: Vec<_> = (0..CONNECTIONS_MAX / 2).map(|_| served.connect(GET)).collect();
        assert!(served.answer(&format!("{GET}\r\n")).ends_with("hello"));
        let mut nothing = Vec::new();
        slow[0].read_to_end(&mut nothing).unwrap();
        assert!(nothing.is_empty(), "closed without an answer");
        let endless = format!("{GET}X: {}", "x".repeat(2 * REQUEST_BYTES_MAX));
        assert!(served.answer(&endless).starts_with("HTTP/1.1 431 "));
        let many: String = (0..100).map(|n| format!("X{n}: 1\r\n")).collect();
        assert!(served.answer(&format!("{GET}{many}\r\n")).starts_with("HTTP/1.1 431 "));
        assert!(served.answer("\u{1}\u{2}\r\n\r\n").starts_with("HTTP/1.1 400 "));
    }

    #[test]
    fn a_small_body_is_ignored() {
        let served = Served::start();
        let answer = served.answer(&format!("{GET}Content-Length: 5\r\n\r\n12345"));
        assert!(answer.starts_with("HTTP/1.1 200 OK") && answer.ends_with("hello"), "{answer}");
    }
}
