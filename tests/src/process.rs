//! A process started by a test: its output and its end.
//!
//! It is killed with the test at the latest.

use crate::place::TestDirectory;
use rustix::process::{Pid, Signal, kill_process};
use shm_schema::{RUNTIME_DIR_ENV, monotonic_ns};
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Time limit for a daemon to become ready on a loaded machine.
const READY_WITHIN: Duration = Duration::from_secs(10);

/// Captured output of a process.
#[derive(Debug, Default)]
struct CapturedOutput {
    lines: Vec<String>,
    /// The last `answered NS by PID` of a cell.
    answered: (u64, u32),
}

/// A started process.
#[derive(Debug)]
pub struct Process {
    child: Child,
    captured: Arc<Mutex<CapturedOutput>>,
    deaf: Arc<AtomicBool>,
    stalled: Arc<AtomicBool>,
}

impl Process {
    /// Starts `program` in a test directory.
    pub fn start<I: AsRef<OsStr>>(program: &str, args: &[I], place: &TestDirectory) -> Self {
        Self::spawn(Command::new(program).args(args), place)
    }

    /// Starts a command in a test directory.
    pub fn spawn(command: &mut Command, place: &TestDirectory) -> Self {
        Self::with_log(command, place, Stdio::piped())
    }

    /// The same with its standard error redirected to `log`.
    pub fn with_log(command: &mut Command, place: &TestDirectory, log: Stdio) -> Self {
        let mut child = command
            .env(RUNTIME_DIR_ENV, place.root())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .expect("the program starts");
        let captured = Arc::<Mutex<CapturedOutput>>::default();
        let [deaf, stalled] = [(); 2].map(|()| Arc::<AtomicBool>::default());
        listen(child.stdout.take(), &captured, [&deaf, &stalled]);
        listen(child.stderr.take(), &captured, [&deaf, &stalled]);
        Self { child, captured, deaf, stalled }
    }

    /// Starts the daemon of a test directory and waits until it is ready.
    pub fn ready_daemon(program: &str, place: &TestDirectory) -> Self {
        let daemon = Self::daemon(program, place);
        assert!(daemon.wait_for_output("ready", READY_WITHIN), "{:?}", daemon.lines());
        daemon
    }

    /// Starts the daemon of a test directory.
    pub fn daemon(program: &str, place: &TestDirectory) -> Self {
        let config = place.file("cell.toml");
        Self::start(program, &["run".as_ref(), "--config".as_ref(), config.as_os_str()], place)
    }

    /// Its id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has not ended yet.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Sends SIGTERM, as a service manager does, and waits for its end.
    pub fn end(&mut self) -> ExitStatus {
        self.signal(Signal::TERM);
        self.wait()
    }

    /// Sends it a signal.
    pub fn signal(&self, signal: Signal) {
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw).expect("a process");
        let _ = kill_process(pid, signal);
    }

    /// Number of the thread with this name.
    #[must_use]
    pub fn thread(&self, name: &str) -> Option<u32> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.id())).ok()?;
        let named = |task: &std::fs::DirEntry| {
            std::fs::read_to_string(task.path().join("comm")).is_ok_and(|comm| comm.trim() == name)
        };
        tasks.flatten().find(named)?.file_name().to_str()?.parse().ok()
    }

    /// State of each thread: name, kernel function in which it waits, system call with its
    /// arguments.
    #[must_use]
    pub fn waits(&self) -> Vec<String> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.id()));
        let of = |task: std::fs::DirEntry| {
            let read = |what| std::fs::read_to_string(task.path().join(what)).unwrap_or_default();
            ["comm", "wchan", "syscall"].map(|what| read(what).trim().to_owned()).join(" ")
        };
        tasks.into_iter().flatten().flatten().map(of).collect()
    }

    /// Time for which the thread with this name was runnable without a core; zero if the kernel
    /// does not report it.
    #[must_use]
    pub fn waited(&self, name: &str) -> Duration {
        let schedstat = |thread| std::fs::read_to_string(format!("/proc/{thread}/schedstat")).ok();
        let text = self.thread(name).and_then(schedstat).unwrap_or_default();
        let ns = text.split_whitespace().nth(1).and_then(|ns| ns.parse().ok());
        Duration::from_nanos(ns.unwrap_or(0))
    }

    /// Its resident memory, kB.
    #[must_use]
    pub fn resident_kb(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        line.trim().strip_suffix(" kB")?.trim().parse().ok()
    }

    /// Stops reading its output permanently.
    pub fn stop_reading(&mut self) {
        self.deaf.store(true, Relaxed);
    }

    /// Starts or stops reading its output.
    pub fn listen(&mut self, on: bool) {
        self.stalled.store(!on, Relaxed);
    }

    /// Writes a line to its standard input.
    pub fn write_line(&mut self, line: &str) {
        // A process that has ended does not read its input.
        let _ = self.child.stdin.as_mut().map(|stdin| writeln!(stdin, "{line}"));
    }

    /// Closes its standard input, at which `rig_cell` ends, and waits.
    pub fn close_input(&mut self) -> ExitStatus {
        drop(self.child.stdin.take());
        self.wait()
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        let status = self.child.wait().expect("a child");
        // Its last output may still be in the pipe.
        std::thread::sleep(Duration::from_millis(20));
        status
    }

    /// Waits until its output contains `words`; false if it does not within `limit`.
    pub fn wait_for_output(&self, text: &str, limit: Duration) -> bool {
        let start = Instant::now();
        while !self.lines().iter().any(|line| line.contains(text)) {
            if start.elapsed() > limit {
                return false;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        true
    }

    /// All lines so far, of both streams.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        lock(&self.captured).lines.clone()
    }

    /// Whether this cell received an answer of that daemon since `ns`.
    #[must_use]
    pub fn answered_since(&self, ns: u64, daemon: u32) -> bool {
        let (at_ns, by) = lock(&self.captured).answered;
        at_ns > ns && by == daemon
    }

    /// Time at which this cell reported its last answer (`CLOCK_MONOTONIC`, ns).
    #[must_use]
    pub fn answered_ns(&self) -> u64 {
        lock(&self.captured).answered.0
    }

    /// Waits for an answer made after this call.
    #[must_use]
    pub fn wait_answered(&self, daemon: &Self, limit: Duration) -> Option<Duration> {
        let (start, start_ns) = (Instant::now(), monotonic_ns());
        while start.elapsed() < limit {
            if self.answered_since(start_ns, daemon.id()) {
                return Some(start.elapsed());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        None
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

fn listen(
    stream: Option<impl Read + Send + 'static>,
    captured: &Arc<Mutex<CapturedOutput>>,
    [deaf, stalled]: [&Arc<AtomicBool>; 2],
) {
    let Some(stream) = stream else { return };
    let (captured, deaf, stalled) = (Arc::clone(captured), Arc::clone(deaf), Arc::clone(stalled));
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if deaf.load(Relaxed) {
                return;
            }
            while stalled.load(Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            let mut captured = lock(&captured);
            match answered(&line) {
                Some(answered) => captured.answered = answered,
                None => captured.lines.push(line),
            }
        }
    });
}

fn answered(line: &str) -> Option<(u64, u32)> {
    let (at_ns, by) = line.strip_prefix("answered ")?.split_once(" by ")?;
    Some((at_ns.parse().ok()?, by.parse().ok()?))
}

fn lock(captured: &Mutex<CapturedOutput>) -> MutexGuard<'_, CapturedOutput> {
    captured.lock().unwrap_or_else(PoisonError::into_inner)
}
