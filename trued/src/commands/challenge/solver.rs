//! An external solver: started once per case, with a time limit, and read after its end.
//!
//! A solver that fails, hangs or gives an invalid answer counts as no answer, and the challenge
//! continues. No argument contains information about the truth.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use challenge_report::SolverAnswer;
use harness::child::ChildGuard;

use crate::child::this_program;
use crate::exit::Failure;
use crate::interrupt;

/// Interval of checks whether the solver has ended.
const POLL_EVERY: Duration = Duration::from_millis(3);
/// An answer longer than this is none, bytes.
const ANSWER_BYTES_MAX: u64 = 16 << 20;

/// How the solver is started.
#[derive(Debug)]
pub(super) struct Solver {
    /// The solver's command; `None`: this program's own `diagnose`.
    command: Option<Vec<String>>,
    limit: Duration,
}

impl Solver {
    pub(super) fn new(command: Option<&str>, limit: Duration) -> Result<Self, Failure> {
        let command =
            command.map(|text| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
        if command.as_ref().is_some_and(Vec::is_empty) {
            return Err(Failure::input("--solver names no program"));
        }
        Ok(Self { command, limit })
    }

    fn command(&self) -> Result<Command, Failure> {
        match self.command.as_deref() {
            Some([program, arguments @ ..]) => {
                let mut command = Command::new(program);
                command.args(arguments);
                Ok(command)
            }
            _ => {
                let mut command = this_program().map_err(Failure::system)?;
                command.args(["diagnose", "--quiet"]);
                Ok(command)
            }
        }
    }

    /// Runs it on one case; its output streams go to `solver.log` beside its answer.
    pub(super) fn answer(
        &self,
        case: &Path,
        out: &Path,
        stop: &AtomicBool,
    ) -> Result<SolverAnswer, Failure> {
        fs::create_dir_all(out).map_err(Failure::system)?;
        let log = File::create(out.join("solver.log")).map_err(Failure::system)?;
        let mut command = self.command()?;
        command
            .arg("--model")
            .arg(case.join("model.toml"))
            .arg("--out")
            .arg(out)
            .args(["--seed", "1"]);
        command.arg(case.join("recording.csv"));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let start = Instant::now();
        let mut child = ChildGuard::spawn(&mut command).map_err(Failure::system)?;
        let ended = loop {
            if let Some(status) = child.try_exit_status() {
                break Some(status);
            }
            if start.elapsed() > self.limit {
                break None;
            }
            interrupt::check(stop)?;
            std::thread::sleep(POLL_EVERY);
        };
        let seconds = start.elapsed().as_secs_f64();
        drop(child);
        if !ended.is_some_and(|status| status.success()) {
            return Ok(SolverAnswer::default());
        }
        let text = |name: &str| read(&out.join(name));
        Ok(SolverAnswer {
            diagnosis: text("diagnosis.json"),
            model: text("model.toml"),
            seconds: Some(seconds),
        })
    }
}

/// A text that is there and not too long.
fn read(path: &Path) -> Option<String> {
    let mut text = String::new();
    File::open(path).ok()?.take(ANSWER_BYTES_MAX).read_to_string(&mut text).ok()?;
    Some(text)
}
