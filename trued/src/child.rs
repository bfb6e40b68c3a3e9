//! A child process that is ended together with its handle.

use std::io::Write;
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::exit::Failure;

/// How long a child may take to end in order.
const END_WITHIN: Duration = Duration::from_secs(2);

/// A child process; asked to end when dropped, and killed if it does not.
#[derive(Debug)]
pub(crate) struct Guarded(Child);

impl Guarded {
    /// Starts it, without standard input.
    pub(crate) fn spawn(command: &mut Command) -> Result<Self, Failure> {
        let started = command.stdin(Stdio::null()).spawn();
        let program = command.get_program().display();
        started.map(Self).map_err(|why| Failure::system(format!("cannot start {program}: {why}")))
    }

    /// Starts it with a standard input that [`Guarded::tell`] writes to.
    pub(crate) fn spawn_listening(command: &mut Command) -> Result<Self, Failure> {
        command.stdin(Stdio::piped()).spawn().map(Self).map_err(Failure::system)
    }

    /// Writes a line to its standard input.
    pub(crate) fn tell(&mut self, line: &str) -> Result<(), Failure> {
        let input = self
            .0
            .stdin
            .as_mut()
            .ok_or_else(|| Failure::system("the child process has no standard input"))?;
        writeln!(input, "{line}").and_then(|()| input.flush()).map_err(Failure::system)
    }

    /// This very program, for a further process of it.
    pub(crate) fn myself() -> Result<Command, Failure> {
        Ok(Command::new(std::env::current_exe().map_err(Failure::system)?))
    }

    /// How it ended, where it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok().flatten()
    }

    /// Its standard output, if it is piped; can be taken once.
    pub(crate) fn stdout(&mut self) -> Option<ChildStdout> {
        self.0.stdout.take()
    }

    /// Waits until it ends by itself.
    pub(crate) fn wait(&mut self) -> Result<ExitStatus, Failure> {
        self.0.wait().map_err(Failure::system)
    }

    /// Asks it to end, and waits for a while.
    pub(crate) fn end(&mut self) {
        if self.ended().is_some() {
            return;
        }
        if let Some(pid) = i32::try_from(self.0.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        let since = Instant::now();
        while self.ended().is_none() && since.elapsed() < END_WITHIN {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        self.end();
        if self.ended().is_none() {
            let _ = self.0.kill();
            let _ = self.0.wait();
        }
    }
}
