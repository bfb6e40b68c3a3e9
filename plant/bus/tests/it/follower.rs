//! A subscriber that is not written with this library: Python, the public package `eclipse-zenoh`. Each side is paused, killed and cut off, and nothing is lost.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::place::{Folder, HERE, Process, endpoint, plant, skipped, until};

/// A Python with a package, installed once.
pub(crate) fn python(package: &str, version: &str, import: &str) -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(package);
    let python = folder.join("bin/python");
    let has = |python: &Path| {
        Command::new(python)
            .args(["-c", &format!("import {import}")])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    if has(&python) {
        return Ok(python);
    }
    let made = Command::new("python3").args(["-m", "venv"]).arg(&folder).output();
    made.map_err(|why| format!("python3: {why}"))?;
    let package = format!("{package}=={version}");
    let arguments = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", &package];
    let output = Command::new(&python).args(arguments).output().map_err(|why| why.to_string())?;
    if has(&python) {
        Ok(python)
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// A cable between the follower and the bridge that can be pulled.
pub(crate) struct Cable {
    pub(crate) endpoint: String,
    plugged: Arc<AtomicBool>,
    ends: Arc<Mutex<Vec<TcpStream>>>,
}

impl Cable {
    pub(crate) fn to(bridge: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", listener.local_addr().unwrap());
        let plugged = Arc::new(AtomicBool::new(true));
        let ends = Arc::<Mutex<Vec<TcpStream>>>::default();
        let address = bridge.strip_prefix("tcp/").unwrap().to_owned();
        let (is_plugged, open) = (Arc::clone(&plugged), Arc::clone(&ends));
        std::thread::spawn(move || {
            for local in listener.incoming().flatten() {
                let Ok(remote) = TcpStream::connect(&address) else { continue };
                if !is_plugged.load(Relaxed) {
                    continue;
                }
                for (from, to) in [(&local, &remote), (&remote, &local)] {
                    let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                    open.lock().unwrap().push(from.try_clone().unwrap());
                    std::thread::spawn(move || copy(from, to));
                }
            }
        });
        Self { endpoint, plugged, ends }
    }

    pub(crate) fn plug(&self) {
        self.plugged.store(true, Relaxed);
    }

    pub(crate) fn pull(&self) {
        self.plugged.store(false, Relaxed);
        for end in self.ends.lock().unwrap().drain(..) {
            let _ = end.shutdown(std::net::Shutdown::Both);
        }
    }
}

fn copy(mut from: TcpStream, mut to: TcpStream) {
    let mut bytes = [0; 65_536];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        if to.write_all(&bytes[..count]).is_err() {
            break;
        }
    }
    let _ = to.shutdown(std::net::Shutdown::Both);
}

/// `STREAM NUMBER` of each line.
fn followed(file: &Path) -> Vec<(u64, u64)> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let lines = text.lines().map(|line| {
        let mut fields = line.split(' ').map(|field| field.parse().unwrap_or(0));
        (fields.next().unwrap(), fields.next().unwrap())
    });
    lines.collect()
}

#[test]
fn a_subscriber_in_python_gets_every_message_once_and_in_order_whoever_is_paused_killed_or_cut_off()
{
    let python = match python("eclipse-zenoh", "1.10.2", "zenoh") {
        Ok(python) => python,
        Err(why) => return skipped("a Zenoh subscriber in Python", &why),
    };
    let (folder, address) = (Folder::new(), endpoint());
    let (spool, file) = (folder.0.join("spool"), folder.0.join("followed"));
    let bridge = || {
        let spool = spool.to_str().unwrap();
        let arguments = ["bridge", "cell", "--group", "line", "--spool", spool, "--rate-hz", "10"];
        let mut command = plant(&arguments);
        // The absence of a daemon is published as well.
        command.args(["--listen", &address]).env("TRUED_RUNTIME_DIR", folder.0.join("run"));
        Process::start(&mut command, "ready")
    };
    let cable = Cable::to(&address);
    let follower = || {
        let script = Path::new(HERE).join("examples/follow.py");
        let arguments = [cable.endpoint.as_str(), "line/cell", file.to_str().unwrap()];
        Process::start(Command::new(&python).arg(script).args(arguments), "ready")
    };
    let numbers = || followed(&file).len();
    let gets = |more: usize| {
        let had = numbers();
        until("more messages", || (numbers() >= had + more).then_some(()));
    };
    let one = bridge();
    std::thread::sleep(Duration::from_secs(1));
    let first = follower();
    gets(10);
    first.signal("-STOP");
    std::thread::sleep(Duration::from_secs(3));
    first.signal("-CONT");
    gets(40);
    cable.pull();
    let had = numbers();
    std::thread::sleep(Duration::from_secs(2));
    assert!(numbers() <= had + 2, "the cable is pulled");
    cable.plug();
    gets(25);
    one.signal("-STOP");
    std::thread::sleep(Duration::from_secs(2));
    one.signal("-CONT");
    gets(5);
    one.kill();
    let _two = bridge();
    gets(10);
    first.kill();
    std::thread::sleep(Duration::from_secs(2));
    let _second = follower();
    gets(25);
    let followed = followed(&file);
    let stream = followed[0].0;
    let expected: Vec<(u64, u64)> =
        (1..=followed.len() as u64).map(|number| (stream, number)).collect();
    assert_eq!(followed, expected);
    eprintln!("{} messages, each once and in order", followed.len());
}
