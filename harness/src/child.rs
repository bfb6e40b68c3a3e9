//! A child process that is ended together with its handle: asked when dropped, killed if it does not end.

use std::io::Write;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

/// Time limit for a process to end or to stop.
const WITHIN: Duration = Duration::from_secs(2);

/// A child process.
#[derive(Debug)]
pub struct ChildGuard(pub(crate) Child);

impl ChildGuard {
    /// Starts it with the streams of `command`.
    ///
    /// # Errors
    /// The system cannot start the program; the error names it.
    pub fn spawn(command: &mut Command) -> std::io::Result<Self> {
        let program = command.get_program().display().to_string();
        let started = command.spawn();
        started.map(Self).map_err(|why| {
            std::io::Error::new(why.kind(), format!("cannot start {program}: {why}"))
        })
    }

    /// Starts it; standard input and output are pipes to the bench, standard error is the bench's.
    pub(crate) fn spawn_piped(mut command: Command) -> std::io::Result<Self> {
        Self::spawn(command.stdin(Stdio::piped()).stdout(Stdio::piped()))
    }

    /// Writes a line to its standard input, which must be a pipe.
    ///
    /// # Errors
    /// The standard input is no pipe, or is closed.
    pub fn write_line(&mut self, line: &str) -> std::io::Result<()> {
        let input = self.0.stdin.as_mut();
        let input = input
            .ok_or_else(|| std::io::Error::other("the child process has no standard input"))?;
        writeln!(input, "{line}").and_then(|()| input.flush())
    }

    /// Its standard output, if it is piped; can be taken once.
    pub fn stdout(&mut self) -> Option<ChildStdout> {
        self.0.stdout.take()
    }

    /// How it ended, if it has.
    pub fn try_exit_status(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok().flatten()
    }

    /// Waits until it ends by itself.
    ///
    /// # Errors
    /// The system cannot wait for it.
    pub fn wait(&mut self) -> std::io::Result<ExitStatus> {
        self.0.wait()
    }

    /// Asks it to end, and waits for a while.
    pub fn terminate(&mut self) {
        if self.try_exit_status().is_some() {
            return;
        }
        self.signal(Signal::TERM);
        self.signal(Signal::CONT);
        let since = Instant::now();
        while self.try_exit_status().is_none() && since.elapsed() < WITHIN {
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    pub(crate) fn signal(&self, signal: Signal) {
        if let Some(pid) = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw) {
            // A process that has ended needs no signal.
            let _ = kill_process(pid, signal);
        }
    }

    /// Stops it (SIGSTOP); true once the system reports it as stopped.
    pub(crate) fn stop(&self) -> bool {
        self.signal(Signal::STOP);
        let since = Instant::now();
        while !self.is_stopped() {
            if since.elapsed() > WITHIN {
                return false;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
        true
    }

    /// Continues it.
    pub(crate) fn resume(&self) {
        self.signal(Signal::CONT);
    }

    fn is_stopped(&self) -> bool {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.0.id()));
        let stat = |dir: std::path::PathBuf| std::fs::read_to_string(dir.join("stat"));
        let is_stopped =
            |text: String| text.rsplit(')').next().is_some_and(|s| s.starts_with(" T"));
        tasks.is_ok_and(|mut tasks| {
            tasks.all(|task| task.is_ok_and(|task| stat(task.path()).is_ok_and(is_stopped)))
        })
    }
}

impl Drop for ChildGuard {
    fn drop(&mut self) {
        self.terminate();
        if self.try_exit_status().is_none() {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}
