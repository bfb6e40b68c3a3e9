//! A child process of the bench: stopped when dropped, killed if it does not end.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

/// Time limit for a process to end or to stop.
const WITHIN: Duration = Duration::from_secs(2);

/// A child process.
#[derive(Debug)]
pub(crate) struct Guarded(pub(crate) Child);

impl Guarded {
    /// Starts it; standard input and output are pipes to the bench, standard error is the bench's.
    pub(crate) fn spawn(mut command: Command) -> std::io::Result<Self> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map(Self)
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
        while !self.stands() {
            if since.elapsed() > WITHIN {
                return false;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
        true
    }

    /// Continues it.
    pub(crate) fn go_on(&self) {
        self.signal(Signal::CONT);
    }

    fn stands(&self) -> bool {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.0.id()));
        let stat = |dir: std::path::PathBuf| std::fs::read_to_string(dir.join("stat"));
        let stands = |text: String| text.rsplit(')').next().is_some_and(|s| s.starts_with(" T"));
        tasks.is_ok_and(|mut tasks| {
            tasks.all(|task| task.is_ok_and(|task| stat(task.path()).is_ok_and(stands)))
        })
    }

    pub(crate) fn ended(&mut self) -> Option<std::process::ExitStatus> {
        self.0.try_wait().ok().flatten()
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.signal(Signal::TERM);
        self.signal(Signal::CONT);
        let since = Instant::now();
        while self.ended().is_none() && since.elapsed() < WITHIN {
            std::thread::sleep(Duration::from_millis(2));
        }
        if self.ended().is_none() {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}
