//! A historian that is not written with this library (Python, the decoder of the public package `mqtt-spb-wrapper`) behind a real broker (Mosquitto): each is cut off, paused, killed and restarted, and nothing is lost.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::Value;

use crate::follower::{Cable, python};
use crate::place::{Folder, HERE, Process, endpoint, plant, skipped, until};

/// The broker's program, where it is installed.
fn mosquitto() -> Option<PathBuf> {
    let places = ["/usr/sbin/mosquitto", "/usr/bin/mosquitto", "/usr/local/sbin/mosquitto"];
    places.map(PathBuf::from).into_iter().find(|path| path.is_file())
}

struct Broker {
    program: PathBuf,
    folder: Folder,
    port: u16,
}

impl Broker {
    fn new(program: PathBuf) -> Self {
        let port = endpoint().rsplit_once(':').unwrap().1.parse().unwrap();
        let folder = Folder::new();
        let config = format!("listener {port} 127.0.0.1\nallow_anonymous true\n");
        std::fs::write(folder.0.join("broker.conf"), config).unwrap();
        Self { program, folder, port }
    }

    /// The same for users with a password alone.
    fn with_user(program: PathBuf, user: &str, password: &str) -> Self {
        let broker = Self::new(program);
        let users = broker.folder.0.join("users");
        let mut passwd = Command::new("mosquitto_passwd");
        let made = passwd.args(["-b", "-c"]).arg(&users).args([user, password]).status().unwrap();
        assert!(made.success());
        let port = broker.port;
        // Started as root, the broker gives up its rights and could not read the file.
        let config = format!(
            "listener {port} 127.0.0.1\nallow_anonymous false\nuser root\npassword_file {}\n",
            users.display()
        );
        std::fs::write(broker.folder.0.join("broker.conf"), config).unwrap();
        broker
    }

    fn start(&self) -> Process {
        let config = self.folder.0.join("broker.conf");
        let mut command = Command::new(&self.program);
        command.arg("-c").arg(config).stdout(Stdio::null()).stderr(Stdio::null());
        let process = Process(command.spawn().unwrap());
        until("the broker", || TcpStream::connect(("127.0.0.1", self.port)).ok());
        process
    }

    fn endpoint(&self) -> String {
        format!("tcp/127.0.0.1:{}", self.port)
    }
}

/// The historian, and all that it has seen.
struct Historian {
    child: Child,
    commands: ChildStdin,
    messages: Arc<Mutex<Vec<Value>>>,
}

impl Historian {
    fn start(python: &Path, port: u16) -> Self {
        let script = format!("{HERE}/examples/historian.py");
        let arguments = [script, "127.0.0.1".to_owned(), port.to_string(), "line".to_owned()];
        let mut command = Command::new(python);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (messages, out) = (Arc::<Mutex<Vec<Value>>>::default(), child.stdout.take().unwrap());
        let into = Arc::clone(&messages);
        std::thread::spawn(move || {
            for line in BufReader::new(out).lines().map_while(Result::ok) {
                into.lock().unwrap().push(serde_json::from_str(&line).unwrap());
            }
        });
        let commands = child.stdin.take().unwrap();
        let historian = Self { child, commands, messages };
        historian.subscribed(1);
        historian
    }

    fn messages(&self) -> Vec<Value> {
        self.messages.lock().unwrap().clone()
    }

    fn count(&self, is: impl Fn(&Value) -> bool) -> usize {
        self.messages().iter().filter(|one| is(one)).count()
    }

    fn subscribed(&self, times: usize) {
        until("a subscription", || {
            (self.count(|one| one["subscribed"] == true) >= times).then_some(())
        });
    }

    /// Waits until it has seen this many more messages with a number.
    fn sees(&self, more: usize) {
        let goal = self.count(|one| number(one).is_some()) + more;
        until("messages", || (self.count(|one| number(one).is_some()) >= goal).then_some(()));
    }

    fn of(&self, kind: &str) -> Vec<Value> {
        self.messages().into_iter().filter(|one| one["kind"] == kind).collect()
    }
}

impl Drop for Historian {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The number of a data message; births have none, or that of another message.
fn number(message: &Value) -> Option<u64> {
    let is_data = message["kind"] == "NDATA" || message["kind"] == "DDATA";
    message["metrics"]["number"].as_u64().filter(|_| is_data)
}

/// What the test needs; says what is skipped.
fn tools() -> Option<(PathBuf, PathBuf)> {
    let what = "Sparkplug B with a broker and a decoder of others";
    let Some(mosquitto) = mosquitto() else {
        skipped(what, "no program `mosquitto`");
        return None;
    };
    match python("mqtt-spb-wrapper", "2.1.2", "mqtt_spb_wrapper") {
        Ok(python) => Some((mosquitto, python)),
        Err(why) => {
            skipped(what, &why);
            None
        }
    }
}

fn bridge(folder: &Folder, listen: &str, broker: &str) -> Process {
    let arguments = ["bridge", "cell", "--group", "line", "--rate-hz", "10", "--listen", listen];
    let mut command = plant(&arguments);
    let broker = broker.strip_prefix("tcp/").unwrap();
    command.args(["--mqtt", broker, "--spool"]).arg(folder.0.join("spool"));
    Process::start(command.env("TRUED_RUNTIME_DIR", folder.0.join("run")), "mqtt: 127")
}

/// A bridge that signs in, until it prints a line with `ready`.
fn signed_in(folder: &Folder, broker: &Broker, password: Option<&str>, ready: &str) -> Process {
    let arguments = ["bridge", "cell", "--group", "line", "--listen", &endpoint()];
    let mut command = plant(&arguments);
    let port = broker.port;
    command.args(["--mqtt", &format!("127.0.0.1:{port}"), "--mqtt-user", "line", "--spool"]);
    command.arg(folder.0.join("spool")).env("TRUED_RUNTIME_DIR", folder.0.join("run"));
    command.env_remove("TRUED_MQTT_PASSWORD");
    if let Some(password) = password {
        command.env("TRUED_MQTT_PASSWORD", password);
    }
    Process::start(&mut command, ready)
}

#[test]
fn a_broker_for_users_alone_is_joined_with_the_right_password_and_no_other() {
    let Some(mosquitto) = mosquitto() else {
        return skipped("a password at the broker", "no program `mosquitto`");
    };
    let broker = Broker::with_user(mosquitto, "line", "a right one");
    let (_running, folder) = (broker.start(), Folder::new());
    signed_in(&folder, &broker, Some("a wrong one"), "refused").kill();
    signed_in(&folder, &broker, Some("a right one"), "connected").kill();
    signed_in(&folder, &broker, None, "TRUED_MQTT_PASSWORD").kill();
}

fn unix_ms() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis() as u64
}

/// Every number once and in order; a repeated one only as historical, after it was seen.
fn check_numbers(messages: &[Value]) -> u64 {
    let mut next = 1;
    let mut repeated = 0;
    for one in messages {
        let Some(number) = number(one) else { continue };
        if number < next {
            assert_eq!(one["historical"], true, "{one}");
            repeated += 1;
            continue;
        }
        assert_eq!(number, next, "nothing is missing: {one}");
        next += 1;
    }
    eprintln!("{} messages, {repeated} of them again after a loss", next - 1);
    next
}

/// From each birth of the node on, its messages are counted without a gap, and no device or data comes before it.
fn check_sequence(messages: &[Value]) {
    let mut next = None;
    for one in messages.iter().filter(|one| !one["seq"].is_null()) {
        let seq = one["seq"].as_u64().unwrap();
        if one["kind"] == "NBIRTH" {
            assert_eq!(seq, 0, "{one}");
        } else {
            assert_eq!(Some(seq), next, "{one}");
        }
        next = Some((seq + 1) % 256);
    }
}

#[test]
fn a_historian_misses_no_message_whoever_is_cut_off_paused_killed_or_restarted() {
    let Some((mosquitto, python)) = tools() else { return };
    let (broker, folder) = (Broker::new(mosquitto), Folder::new());
    let running = broker.start();
    let historian = Historian::start(&python, broker.port);
    let (cable, listen) = (Cable::to(&broker.endpoint()), endpoint());
    let running_bridge = bridge(&folder, &listen, &cable.endpoint);
    historian.sees(8);
    assert_eq!(historian.of("NDEATH").len(), 0);

    cable.pull();
    let cut_unix_ms = unix_ms();
    std::thread::sleep(Duration::from_secs(2));
    let plugged_unix_ms = unix_ms();
    cable.plug();
    historian.sees(12);
    let deaths = historian.of("NDEATH");
    assert_eq!(deaths.len(), 1, "the broker sends the will");
    // A fifth of a second for the loss to be noticed.
    let cut = cut_unix_ms + 200..plugged_unix_ms;
    let made_while_cut = |one: &&Value| {
        number(one).is_some() && one["made"].as_u64().is_some_and(|made| cut.contains(&made))
    };
    let (messages, born) = (historian.messages(), historian.of("NBIRTH").len());
    let of_the_cut: Vec<&Value> = messages.iter().filter(made_while_cut).collect();
    assert!(!of_the_cut.is_empty() && born == 2, "{born}");
    assert!(of_the_cut.iter().all(|one| one["historical"] == true), "{of_the_cut:?}");
    eprintln!("{} messages were made while the cable was pulled", of_the_cut.len());

    // The broker takes messages from the network that it never reads, and dies with them. The historian is back before the bridge, as the broker keeps nothing for it.
    running.signal("-STOP");
    std::thread::sleep(Duration::from_secs(2));
    cable.pull();
    running.kill();
    let running = broker.start();
    historian.subscribed(2);
    cable.plug();
    historian.sees(12);

    running.signal("-STOP");
    std::thread::sleep(Duration::from_secs(7));
    running.signal("-CONT");
    historian.sees(20);

    running_bridge.kill();
    std::thread::sleep(Duration::from_millis(500));
    let running_bridge = bridge(&folder, &listen, &cable.endpoint);
    historian.sees(8);
    running_bridge.signal("-TERM");
    // Each connection has a number of its own, and its death names it. A connection that the broker took while it was paused may have died before its birth.
    let numbers = |kind: &str| -> Vec<u64> {
        let of = historian.of(kind);
        of.iter().map(|one| one["metrics"]["bdSeq"].as_u64().unwrap()).collect()
    };
    let born = numbers("NBIRTH");
    until("the last death", || (numbers("NDEATH").last() == born.last()).then_some(()));
    assert!(born.is_sorted_by(|a, b| a < b) && born.len() >= 4, "{born:?}");
    assert_eq!(numbers("NDEATH").first(), born.first(), "of the connection that was cut");

    let messages = historian.messages();
    let next = check_numbers(&messages);
    assert!(next > 50, "{next}");
    check_sequence(&messages);
}

#[test]
fn births_name_all_metrics_with_their_types_and_are_repeated_when_asked_for() {
    let Some((mosquitto, python)) = tools() else { return };
    let (broker, folder) = (Broker::new(mosquitto), Folder::new());
    let _running = broker.start();
    let mut historian = Historian::start(&python, broker.port);
    let _bridge = bridge(&folder, &endpoint(), &broker.endpoint());
    historian.sees(5);
    historian.commands.write_all(b"rebirth cell\n").unwrap();
    until("a second birth", || (historian.of("DBIRTH").len() >= 2).then_some(()));
    historian.sees(5);
    let (nodes, devices) = (historian.of("NBIRTH"), historian.of("DBIRTH"));
    assert_eq!((nodes.len(), devices.len(), historian.of("NDEATH").len()), (2, 2, 0));
    assert_eq!(nodes[0]["topic"], "spBv1.0/line/NBIRTH/cell");
    assert_eq!(devices[0]["topic"], "spBv1.0/line/DBIRTH/cell/robot");
    assert_eq!(nodes[0]["metrics"]["bdSeq"], nodes[1]["metrics"]["bdSeq"], "the same connection");
    assert_eq!(nodes[0]["metrics"]["Node Control/Rebirth"], false);
    assert_eq!(nodes[0]["metrics"]["bridge_version"], env!("CARGO_PKG_VERSION"));
    for data in historian.of("DDATA") {
        assert_eq!(data["types"], devices[0]["types"], "as born");
    }
    for data in historian.of("NDATA") {
        for (name, datatype) in data["types"].as_object().unwrap() {
            assert_eq!(Some(datatype), nodes[0]["types"].get(name), "{name}");
        }
    }
    let last = historian.of("DDATA").pop().unwrap();
    assert_eq!(last["metrics"]["alarms"], "daemon_away", "{last}");
    assert!(last["metrics"]["health"].is_null(), "no daemon was there");
    assert!(historian.of("NDATA").iter().any(|data| {
        data["metrics"]["event"].as_str().is_some_and(|event| event.contains("bridge_started"))
    }));
    let born = nodes[0]["timestamp"].as_u64().unwrap();
    for data in historian.messages().iter().filter(|one| number(one).is_some()) {
        let made = data["made"].as_u64().unwrap();
        let is_flagged = data["historical"] == true;
        assert!(if is_flagged { made <= born } else { made >= born }, "{born}: {data}");
    }
    check_numbers(&historian.messages());
    check_sequence(&historian.messages());
}
