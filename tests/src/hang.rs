//! A thread whose writes block, like a disk that does not respond: `strace` delays each of them.
//!
//! Other threads of the process are not affected; when released, the thread continues.

use crate::process::Process;
use rustix::process::{Pid, Signal, kill_process};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Delays the writes of one thread until it is released.
#[derive(Debug)]
pub struct BlockedWrites(Child);

impl BlockedWrites {
    /// Delays each write of the thread with that name from now on; `None` if `strace` is missing or
    /// not permitted.
    #[must_use]
    pub fn start(process: &Process, thread: &str, each: Duration) -> Option<Self> {
        let thread = process.thread(thread)?.to_string();
        let inject = format!("inject=write:delay_enter={}", each.as_micros());
        let mut strace = Command::new("strace")
            .args(["-e", "trace=write", "-e", &inject, "-o", "/dev/null", "-p", &thread])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        // Without permission to trace, `strace` ends at once.
        std::thread::sleep(Duration::from_millis(300));
        matches!(strace.try_wait(), Ok(None)).then_some(Self(strace))
    }

    /// Releases the thread.
    pub fn end(mut self) {
        // SIGINT, because SIGKILL would leave the thread stopped.
        let _ = kill_process(Pid::from_child(&self.0), Signal::INT);
        let _ = self.0.wait();
    }

    /// Ends `strace` at once, when the process ends too: a traced thread disappears only after its
    /// tracer has been notified.
    pub fn kill(mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
