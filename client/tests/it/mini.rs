//! A daemon and a cell in miniature, each a process of its own that this test program runs as.
//!
//! They talk of what they see on standard output, and end cleanly when their standard input closes.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Spawn, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use shm_schema::*;
use trued_client::{Client, Connection, Source};

const ROLE: &str = "TRUED_TEST_ROLE";
const CYCLE: Duration = Duration::from_millis(1);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Who {
    Daemon,
    /// In its first epoch it gets no command, as if its memory were another under the same name.
    DeafDaemon,
    Cell,
}

/// A runtime directory of its own, in memory, gone at the end.
pub(crate) struct Runtime(PathBuf);

impl Runtime {
    pub(crate) fn new(name: &str) -> Self {
        let dir = PathBuf::from(format!("/dev/shm/trued-test-{name}-{:x}", new_session()));
        std::fs::create_dir(&dir).unwrap();
        Self(dir)
    }

    pub(crate) fn cell(&self) -> Cell {
        Cell::at(&self.0, "test").unwrap()
    }

    /// Every name of the cell that is still there.
    pub(crate) fn left(&self) -> Vec<String> {
        let names = |dir: &Path| -> Vec<String> {
            let entries = std::fs::read_dir(dir).into_iter().flatten().flatten();
            entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect()
        };
        let prefix = self.cell().shared_memory_prefix();
        let memory = names(Path::new("/dev/shm")).into_iter().filter(|n| n.starts_with(&prefix));
        names(&self.0).into_iter().chain(memory).collect()
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let _ = remove_leftovers(&self.cell());
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The last that a process said: when, of which daemon, and its last words.
#[derive(Default)]
struct Said {
    answered_ns: u64,
    daemon: u32,
    renewals: usize,
    last_line: String,
}

/// A started process; killed when dropped.
pub(crate) struct Process {
    child: Child,
    state: Arc<Mutex<Said>>,
}

impl Process {
    pub(crate) fn start(who: Who, runtime: &Runtime) -> Self {
        let mut child = Spawn::new(std::env::current_exe().unwrap())
            .args(["--exact", "mini::as_another_process", "--nocapture", "--test-threads=1"])
            .env(ROLE, format!("{who:?}"))
            .env(RUNTIME_DIR_ENV, &runtime.0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let state = Arc::new(Mutex::new(Said::default()));
        let (shared, lines) = (state.clone(), BufReader::new(child.stdout.take().unwrap()).lines());
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let mut state = shared.lock().unwrap();
                match line.strip_prefix("answered ").and_then(|rest| rest.split_once(" by ")) {
                    Some((at_ns, by)) => {
                        if let (Ok(at_ns), Ok(by)) = (at_ns.parse(), by.parse()) {
                            (state.answered_ns, state.daemon) = (at_ns, by);
                        }
                    }
                    None => {
                        state.renewals += usize::from(line == "renewed");
                        state.last_line = line;
                    }
                }
            }
        });
        Self { child, state }
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Lets it end by itself.
    pub(crate) fn end(&mut self) {
        drop(self.child.stdin.take());
        self.child.wait().unwrap();
    }

    pub(crate) fn answered_since(&self, ns: u64, daemon: u32) -> bool {
        let state = self.state.lock().unwrap();
        state.answered_ns > ns && state.daemon == daemon
    }

    pub(crate) fn renewals(&self) -> usize {
        self.state.lock().unwrap().renewals
    }

    pub(crate) fn last_words(&self) -> String {
        self.state.lock().unwrap().last_line.clone()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a started process runs: daemon or cell, as the environment says; nothing when the tests run.
#[test]
fn as_another_process() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let over = Arc::new(AtomicBool::new(false));
    let end = over.clone();
    std::thread::spawn(move || {
        let _ = std::io::stdin().read(&mut [0]);
        end.store(true, Ordering::Relaxed);
    });
    println!();
    match role.as_str() {
        "Daemon" => daemon(&over, true),
        "DeafDaemon" => daemon(&over, false),
        _ => cell(&over),
    }
}

fn daemon(over: &AtomicBool, mut hears: bool) {
    let mut side = DaemonSide::create(&Cell::new("test").unwrap()).unwrap();
    while !over.load(Ordering::Relaxed) && serve(&side, over, hears) {
        side.renew().unwrap();
        hears = true;
        println!("renewed");
    }
}

/// Serves one epoch; true when a new one is asked for.
fn serve(side: &DaemonSide, over: &AtomicBool, hears: bool) -> bool {
    let ports = side.ports();
    let mut commands = ports.subscriber::<Command>().unwrap();
    let mut answers = ports.publisher::<Corrected>().unwrap();
    let mut statuses = ports.publisher::<Status>().unwrap();
    let mut control = ports.control().unwrap();
    let mut status = Status { joints: 6, pid: std::process::id(), ..Status::default() };
    status.bounds.angle = [0.02; JOINTS_MAX];
    status.bounds.rate = [0.02; JOINTS_MAX];
    status.bounds.jerk = [5.0; JOINTS_MAX];
    statuses.send(&status);
    side.announce().unwrap();
    let mut answer = Corrected { joints: 6, ..Corrected::default() };
    for cycle in 0_u64.. {
        if let Some(command) = commands.take_newest() {
            answer.command_seq = command.seq;
            answer.command_session = command.session;
        }
        answer.seq += 1;
        answer.made_ns = monotonic_ns();
        if hears {
            answers.send(&answer);
        }
        if cycle % 20 == 0 {
            status.seq += 1;
            statuses.send(&status);
            control.serve(|request| Response::to(request, Answer::Done, "pong"));
            if side.supervise().epoch_requested {
                return true;
            }
        }
        if over.load(Ordering::Relaxed) {
            return false;
        }
        std::thread::sleep(CYCLE);
    }
    false
}

fn cell(over: &AtomicBool) {
    let mut client = loop {
        match Client::connect("test", Duration::from_secs(5)) {
            Ok(client) => break client,
            Err(e) => println!("{e}"),
        }
        if over.load(Ordering::Relaxed) {
            return;
        }
    };
    let mut q = [0.5; 6];
    while !over.load(Ordering::Relaxed) {
        q[0] += 1e-6;
        let Ok(target) = client.exchange(&q, 5 * CYCLE) else { continue };
        if let (Source::Corrected, Connection::Connected { pid, .. }) =
            (target.source(), client.connection())
        {
            println!("answered {} by {pid}", monotonic_ns());
        }
        while let Some(event) = client.next_event() {
            println!("{event:?}");
        }
        std::thread::sleep(CYCLE);
    }
}
