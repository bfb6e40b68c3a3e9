//! A cell seen from outside: page, report, status, events, metrics and the stream for Foxglove, while the
//! daemon runs, is bypassed, stalls and dies.

use crate::TRUED;
use crate::steering::trued;
use rustix::process::Signal;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};
use tests::cell_loop::CellLoop;
use tests::place::{CELL, TestDirectory};
use tests::process::Process;
use tests::sensor::{ANY_CLOCK, Sensor};
use trued_client::Monitor;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

const LIMIT: Duration = Duration::from_secs(10);

/// A live view of the cell of a place.
struct View {
    process: Process,
    http: SocketAddr,
    foxglove: SocketAddr,
}

impl View {
    fn of(place: &TestDirectory) -> Self {
        Self::of_cell(place, CELL)
    }

    /// Started with the cell's name or its file.
    fn of_cell(place: &TestDirectory, cell: &str) -> Self {
        let any = "127.0.0.1:0";
        let arguments = ["live", cell, "--listen", any, "--foxglove", any];
        let process = Process::start(TRUED, &arguments, place);
        assert!(process.wait_for_output("ws://", LIMIT), "{:?}", process.lines());
        let after = |prefix: &str| {
            let line = process.lines().into_iter().find_map(|line| {
                let (_, rest) = line.split_once(prefix)?;
                rest.split(['/', ' ']).next()?.parse().ok()
            });
            line.expect(prefix)
        };
        let (http, foxglove) = (after("http://"), after("ws://"));
        Self { process, http, foxglove }
    }

    /// The head and the body of an answer.
    fn get(&self, target: &str) -> (String, String) {
        let mut stream = TcpStream::connect(self.http).expect("a server");
        stream.set_read_timeout(Some(LIMIT)).expect("a limit");
        write!(stream, "GET {target} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
            .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
        (head.to_owned(), body.to_owned())
    }

    /// The head of the answer to a request that would change something.
    fn post(&self, target: &str) -> String {
        let mut stream = TcpStream::connect(self.http).expect("a server");
        stream.set_read_timeout(Some(LIMIT)).expect("a limit");
        write!(stream, "POST {target} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
            .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    }

    /// The lines of the server-sent events.
    fn events(&self) -> impl Iterator<Item = String> + use<> {
        let mut stream = TcpStream::connect(self.http).expect("a server");
        stream.set_read_timeout(Some(LIMIT)).expect("a limit");
        write!(stream, "GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n").unwrap();
        BufReader::new(stream).lines().map(|line| line.expect("a line"))
    }

    fn status(&self) -> Value {
        serde_json::from_str(&self.get("/status").1).expect("JSON")
    }

    fn metric(&self, begin: &str) -> Option<f64> {
        let text = self.get("/metrics").1;
        let line = text.lines().find(|line| line.starts_with(begin))?.to_owned();
        line.rsplit(' ').next()?.parse().ok()
    }

    fn stream(&self) -> WebSocket<TcpStream> {
        let mut request = format!("ws://{}", self.foxglove).into_client_request().unwrap();
        let protocol = HeaderValue::from_static("foxglove.sdk.v1");
        request.headers_mut().insert("Sec-WebSocket-Protocol", protocol);
        let stream = TcpStream::connect(self.foxglove).expect("a server");
        stream.set_read_timeout(Some(LIMIT)).expect("a limit");
        let (socket, answer) = tungstenite::client(request, stream).expect("a WebSocket");
        assert_eq!(answer.headers()["Sec-WebSocket-Protocol"], "foxglove.sdk.v1");
        socket
    }
}

fn ticks(robot: &mut CellLoop, count: usize) {
    for _ in 0..count {
        robot.tick();
    }
}

/// Time until `is` holds.
fn within(is: impl Fn() -> bool) -> Duration {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < LIMIT, "it never came");
        std::thread::sleep(Duration::from_millis(5));
    }
    begun.elapsed()
}

#[test]
fn page_status_and_metrics_show_a_bypass_and_the_end_of_the_daemon_and_its_return() {
    let place = TestDirectory::new("full", "");
    let mut daemon = Process::ready_daemon(TRUED, &place);
    let mut robot = CellLoop::join(&place.cell(), LIMIT).expect("a daemon");
    let view = View::of(&place);
    assert!(robot.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    ticks(&mut robot, 200);
    let (head, page) = view.get("/");
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("text/html"), "{head}");
    assert!(head.contains(&format!("Content-Length: {}", page.len())), "{head}");
    let names = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!names.contains("http://") && !names.contains("https://"), "no other host is needed");
    let _ = within(|| view.status()["counts"]["commands"].as_u64().is_some_and(|n| n >= 200));
    let status = view.status();
    let largest = |status: &Value| {
        let joints = status["joints"].as_array().expect("joints").iter();
        joints.map(|joint| joint["correction"].as_f64().unwrap().abs()).fold(0.0, f64::max)
    };
    assert_eq!((status["cell"].as_str(), status["mode"].as_str()), (Some(CELL), Some("full")));
    assert!(largest(&status) > 1e-5, "a correction is shown: {status}");
    assert_eq!(view.metric("trued_up"), Some(1.0));
    assert!(view.metric("trued_commands_total").is_some_and(|count| count >= 200.0));

    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon");
    monitor.bypass(true, LIMIT).expect("an answer");
    let _ = within(|| view.status()["bypassed"] == true);
    assert_eq!(view.metric("trued_bypassed"), Some(1.0));

    daemon.kill();
    let _ = within(|| !view.status()["away"].is_null());
    assert_eq!(view.metric("trued_up"), Some(0.0));
    assert_eq!(
        view.metric("trued_commands_total"),
        None,
        "no last value that looks like a present one"
    );
    let _daemon = Process::ready_daemon(TRUED, &place);
    let _ = within(|| view.status()["away"].is_null() && view.metric("trued_up") == Some(1.0));
    assert_eq!(view.status()["bypassed"], false);
}

#[test]
fn a_change_of_state_comes_as_an_event_within_three_tenths_of_a_second() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let view = View::of(&place);
    let mut lines = view.events();
    let mut next = move |bypassed: bool| {
        let wanted = format!("\"bypassed\":{bypassed}");
        lines.find(|line| line.contains(&wanted)).expect("an event")
    };
    next(false);
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon");
    let mut waits: Vec<Duration> = Vec::new();
    for on in [true, false, true, false, true] {
        let since = Instant::now();
        monitor.bypass(on, LIMIT).expect("an answer");
        next(on);
        waits.push(since.elapsed());
    }
    waits.sort_unstable();
    assert!(waits[2] < Duration::from_millis(300), "{waits:?}");
}

/// The next drawing of the robot among the events.
fn drawing(lines: &mut impl Iterator<Item = String>) -> Value {
    lines.find(|line| line == "event: robot").expect("a drawing");
    let data = lines.next().expect("its data");
    serde_json::from_str(data.strip_prefix("data: ").expect("data")).expect("JSON")
}

#[test]
fn the_robot_is_drawn_with_its_correction_while_its_file_is_the_model_in_use() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut robot = CellLoop::join(&place.cell(), LIMIT).expect("a daemon");
    assert!(robot.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    ticks(&mut robot, 100);
    let file = place.file("cell.toml");
    let view = View::of_cell(&place, file.to_str().expect("a plain path"));
    let mut lines = view.events();
    let shift_mm = |drawing: &Value| {
        let shift = drawing["shift_mm"].as_array().expect("a shift").iter();
        shift.map(|x| x.as_f64().unwrap()).fold(0.0, f64::hypot)
    };
    let shown = drawing(&mut lines);
    assert_eq!(shown["points_mm"].as_array().map(Vec::len), Some(8), "base, six joints, tool");
    assert!(shift_mm(&shown) > 0.05, "{shown}");
    assert_eq!(View::of(&place).events().take(4).find(|line| line == "event: robot"), None);

    let text = std::fs::read_to_string(place.file("model.toml")).expect("a model");
    place.write(
        "other.toml",
        &text.replacen("compliance_mrad_per_kNm = 2.2148", "compliance_mrad_per_kNm = 2.3", 1),
    );
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon");
    let answer = monitor.reload(Some(&place.file("other.toml")), LIMIT).expect("an answer");
    assert_eq!(answer.answer(), Ok(trued_client::Answer::Done), "{answer:?}");
    let is_left = |shown: Value| shown["why"].as_str().is_some_and(|why| why.contains("in use"));
    let end = Instant::now() + LIMIT;
    while !is_left(drawing(&mut lines)) {
        assert!(Instant::now() < end, "the former model is still drawn");
    }
}

/// A cell whose force vibrates with 4 N at 72 Hz, until the view has several columns of it. The sensor keeps it alive.
fn vibrating() -> (TestDirectory, Process, Sensor, View) {
    let tables = format!(
        "[force]\nrate_Hz = 10000.0\nchannels = 3\n{ANY_CLOCK}[vibration]\nenabled = true\n"
    );
    let place = TestDirectory::new("full", &tables);
    let daemon = Process::ready_daemon(TRUED, &place);
    let file = place.file("cell.toml");
    let view = View::of_cell(&place, file.to_str().expect("a plain path"));
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    sensor.run(2.0, |_, _| 0.0);
    let tone = |channel: u32, t_s: f64| {
        if channel == 1 { 4.0 * (std::f64::consts::TAU * 72.0 * t_s).sin() } else { 0.0 }
    };
    let begun = Instant::now();
    loop {
        sensor.run(0.1, tone);
        std::thread::sleep(Duration::from_millis(50));
        if history(&view)["spectra"].as_array().is_some_and(|spectra| spectra.len() >= 4) {
            break;
        }
        assert!(begun.elapsed() < 2 * LIMIT, "no columns");
    }
    (place, daemon, sensor, view)
}

/// What a page gets first.
fn history(view: &View) -> Value {
    let mut lines = view.events();
    let first = lines.find(|line| line.starts_with("event: ")).expect("an event");
    assert_eq!(first, "event: history", "before anything else");
    let data = lines.next().expect("its data");
    let mut whole: Value = serde_json::from_str(data.strip_prefix("data: ").unwrap()).unwrap();
    whole["entries"].take()
}

#[test]
fn a_page_that_is_opened_later_gets_the_spectra_and_events_of_before_at_once() {
    let (_place, _daemon, mut sensor, view) = vibrating();
    let before = history(&view);
    let newest = before["spectra"].as_array().and_then(|all| all.last()).expect("spectra");
    let number = |value: &Value| value.as_f64().expect("a number");
    let amplitudes = newest["amplitude_N"].as_array().expect("bins").iter().map(number);
    let (bin, most) = amplitudes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).expect("bins");
    let hz = number(&newest["first_Hz"]) + bin as f64 * number(&newest["bin_Hz"]);
    assert!((hz - 72.0).abs() < 5.0 && (most - 4.0).abs() < 0.3, "{most} N at {hz} Hz");
    let events = before["events"].as_array().expect("events");
    let alarm = events.iter().find(|one| one["state"] == "alarm").expect("an alarm");
    assert!((number(&alarm["frequency_Hz"]) - 72.0).abs() < 2.0, "{alarm}");
    assert!(before["latency"].as_array().is_some_and(|latency| !latency.is_empty()));
    let mut later = view.events().filter(|line| line.starts_with("event: "));
    assert_eq!(later.next().as_deref(), Some("event: history"));
    let begun = Instant::now();
    let mut names = later.inspect(|_| sensor.run(0.05, |_, _| 0.0));
    let is_new = |name: String| name == "event: spectrum";
    assert!(names.any(is_new) && begun.elapsed() < LIMIT, "then each new one");
}

/// The page that the button of a vibrating cell saves, for the audit of pages.
pub(crate) fn saved_report() -> String {
    let (_place, _daemon, _sensor, view) = vibrating();
    view.get("/report").1
}

#[test]
fn the_report_has_the_numbers_of_the_status_and_is_saved_under_a_name_of_its_own() {
    let (place, _daemon, _sensor, view) = vibrating();
    let mut robot = CellLoop::join(&place.cell(), LIMIT).expect("a daemon");
    assert!(robot.tick_until(LIMIT, |_, tick| tick.largest() > 1e-4));
    ticks(&mut robot, 100);
    drop(robot);
    let commands = || view.status()["counts"]["commands"].as_u64();
    let begun = Instant::now();
    loop {
        let before = commands();
        std::thread::sleep(Duration::from_millis(200));
        if before == commands() && before >= Some(100) {
            break;
        }
        assert!(begun.elapsed() < LIMIT, "{before:?} commands");
    }
    let status = view.status();
    let (head, page) = view.get("/report");
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("text/html"), "{head}");
    let name = head.split("filename=\"").nth(1).and_then(|rest| rest.split('"').next());
    let name = name.expect("a name").to_owned();
    let digits = name.strip_prefix("cell-").and_then(|rest| rest.strip_suffix(".html"));
    let is_time = |text: &str| text.len() == 15 && text.as_bytes()[8] == b'-';
    assert!(digits.is_some_and(is_time), "{name}");
    let text = |value: &Value| value.as_str().map_or(value.to_string(), str::to_owned);
    for (key, part) in
        [("model", "hash"), ("counts", "commands"), ("counts", "cycles"), ("robot", "serial")]
    {
        let value = text(&status[key][part]);
        assert!(page.contains(&value), "{key}.{part} {value}");
    }
    for part in [
        "72 Hz",
        "Force over time and frequency",
        "Robot from the side",
        "Latency over time",
        "trued mark",
    ] {
        assert!(page.contains(part), "{part}");
    }
    let page = page.replace("http://www.w3.org/", "");
    for outside in ["<script", "http://", "https://", "src="] {
        assert!(!page.contains(outside), "{outside}");
    }
    let post = view.post("/report");
    assert!(post.starts_with("HTTP/1.1 405"), "{post}");
}

#[test]
fn a_metrics_file_replaces_no_other_file() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    for name in ["cell.toml", "model.toml"] {
        let file = place.file(name);
        let before = std::fs::read(&file).expect("a file");
        let done = trued(&place, &["live", CELL, "--textfile", file.to_str().expect("a path")]);
        assert_eq!(done.code, Some(2), "{}", done.output);
        assert!(done.output.contains("not a metrics file of trued"), "{}", done.output);
        assert_eq!(std::fs::read(&file).expect("a file"), before);
    }
    let file = place.file("trued.prom");
    let text = file.to_str().expect("a path");
    for _ in 0..2 {
        // The second finds the file of one that was killed.
        let mut live = Process::start(TRUED, &["live", CELL, "--textfile", text], &place);
        let is_up = || std::fs::read_to_string(&file).is_ok_and(|text| text.contains("trued_up"));
        let _ = within(is_up);
        let metrics = std::fs::read_to_string(&file).expect("metrics");
        assert!(metrics.lines().any(|line| line.starts_with("trued_up") && line.ends_with(" 1.0")));
        live.kill();
    }
}

#[test]
fn foxglove_gets_the_topics_of_the_recordings() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let view = View::of(&place);
    let mut socket = view.stream();
    let mut json = |op: &str| -> Value {
        let text = socket.read().expect("a message").into_text().expect("text");
        let value: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["op"], op);
        value
    };
    json("serverInfo");
    let advertised = json("advertise");
    let channels = advertised["channels"].as_array().expect("channels");
    let topics: Vec<&str> = channels.iter().filter_map(|c| c["topic"].as_str()).collect();
    assert_eq!(topics, ["/trued/status", "/trued/vibration"]);
    assert!(channels.iter().all(|c| c["encoding"] == "cdr" && c["schemaEncoding"] == "ros2msg"));
    assert!(channels[0]["schema"].as_str().is_some_and(|s| s.contains("float64[] correction")));
    let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":1}]}"#;
    socket.send(Message::text(subscribe)).expect("sent");
    let frame = socket.read().expect("a message").into_data();
    assert_eq!((frame[0], &frame[1..5]), (1, &7_u32.to_le_bytes()[..]));
    let now_ns = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap();
    let stamp_ns = u64::from_le_bytes(frame[5..13].try_into().unwrap());
    assert!(now_ns.as_nanos().abs_diff(u128::from(stamp_ns)) < 2_000_000_000, "wall-clock time");
    // CDR, little-endian: the header, the time, then the length of `idle` and its letters.
    assert_eq!(&frame[13..17], [0, 1, 0, 0]);
    assert_eq!(&frame[25..33], b"\x05\0\0\0idle");
}

#[test]
fn stalls_errors_and_kills_of_the_view_do_not_affect_the_cell() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let mut robot = CellLoop::join(&place.cell(), LIMIT).expect("a daemon");
    let mut view = View::of(&place);
    let mut wild = Vec::new();
    for bytes in
        [&b"\0\xff\xfe\r\n\r\n"[..], b"GET", b"POST /status HTTP/1.1\r\n\r\n", &[b'x'; 100_000]]
    {
        for address in [view.http, view.foxglove] {
            let mut stream = TcpStream::connect(address).expect("a server");
            let _ = stream.write_all(bytes);
            wild.push(stream);
        }
    }
    ticks(&mut robot, 300);
    assert_eq!(view.metric("trued_up"), Some(1.0), "it answers others");
    assert!(view.get("/nothing").0.starts_with("HTTP/1.1 404"));
    let mut rebound = TcpStream::connect(view.http).expect("a server");
    write!(rebound, "GET /status HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut answer = String::new();
    rebound.read_to_string(&mut answer).expect("an answer");
    assert!(answer.starts_with("HTTP/1.1 401"), "a page of another name: {answer}");
    view.process.signal(Signal::STOP);
    ticks(&mut robot, 300);
    view.process.kill();
    ticks(&mut robot, 300);
    assert!(robot.broken.is_empty(), "{:?}", robot.broken);
    let mut monitor = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon");
    let status = std::iter::repeat_with(|| monitor.status()).find_map(|status| status);
    let status = status.expect("a status");
    assert_eq!(status.commands_lost, 0, "{status:?}");
}

#[test]
fn an_address_that_others_reach_needs_a_token() {
    let place = TestDirectory::new("full", "");
    let _daemon = Process::ready_daemon(TRUED, &place);
    let arguments = ["live", CELL, "--listen", "0.0.0.0:0", "--foxglove", "127.0.0.1:0"];
    let mut open = Process::start(TRUED, &arguments, &place);
    assert_eq!(open.wait().code(), Some(3));
    assert!(open.wait_for_output("TRUED_LIVE_TOKEN", LIMIT), "{:?}", open.lines());
}

#[test]
fn the_alerts_fire_for_each_cell_whose_daemon_or_view_is_gone() {
    let folder = crate::program::workspace().join("deploy/prometheus");
    let tested = std::process::Command::new("promtool")
        .args(["test", "rules", "alerts.test.yml"])
        .current_dir(folder)
        .output();
    match tested {
        Ok(tested) => assert!(tested.status.success(), "{tested:?}"),
        Err(why) => eprintln!("SKIPPED: promtool: {why}"),
    }
}

#[test]
fn alerts_and_the_grafana_board_name_metrics_that_exist() {
    let read =
        |file: &str| std::fs::read_to_string(crate::program::workspace().join(file)).unwrap();
    let known = read("docs/reference/metrics.md");
    for file in ["deploy/grafana/trued.json", "deploy/prometheus/alerts.yml"] {
        let text = read(file);
        let tokens = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        let mut unknown: Vec<&str> = tokens.filter(|token| token.starts_with("trued_")).collect();
        assert!(unknown.len() > 5, "{file} names metrics");
        unknown.retain(|name| !known.contains(&format!("`{name}`")));
        assert!(unknown.is_empty(), "{file}: {unknown:?}");
    }
    let board: Value = serde_json::from_str(&read("deploy/grafana/trued.json")).expect("JSON");
    assert!(board["panels"].as_array().is_some_and(|panels| panels.len() > 8));
}
