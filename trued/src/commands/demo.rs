//! `trued demo`: runs the daemon and a simulated cell as separate processes and shows the benefit
//! of the correction, what the daemon's model lacks, and the benefit of knowing it.
//!
//! The crate `demo-report` does the work. The cell's process is the same program with a hidden
//! option.

use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use clap::Args;
use demo_report::{DIAGNOSIS, Error, Event, FILES, PAGE, Programs, Scene, run_cell};
use indicatif::ProgressBar;

use super::diagnose;
use crate::child::this_program;
use crate::exit::{Answer, Failure, Outcome};
use crate::options::Seed;
use crate::output::Console;
use crate::pages::Outputs;
use crate::provenance::Invocation;
use crate::{interrupt, progress, wrap};

/// Demonstrate trued: a simulated robot mills without and with correction, before and after a diagnosis
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Short form: one slot of 10 s, and the diagnosis
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    seed: Seed,
    /// Output folder for recordings, diagnosis and page; if not given, `demo-out`, or `demo-out-2`, … if that exists
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// This process is the cell of that name
    #[arg(long, hide = true, value_name = "NAME")]
    cell: Option<String>,
}

/// This program, as daemon and as cell.
struct ThisProgram {
    quick: bool,
    seed: u64,
    /// The daemon's messages are not shown.
    is_quiet: bool,
}

impl Programs for ThisProgram {
    fn daemon(&self, config: &Path) -> io::Result<Command> {
        let mut command = this_program()?;
        command.args(["run", "--with-parent"]).arg("--config").arg(config);
        command.args(self.is_quiet.then_some("--quiet"));
        Ok(command)
    }

    fn cell(&self, name: &str, out: &Path) -> io::Result<Command> {
        let mut command = this_program()?;
        command.args(["demo", "--cell", name, "--seed", &self.seed.to_string()]);
        command.arg("--out").arg(out).args(self.quick.then_some("--quick"));
        Ok(command)
    }
}

impl Demo {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let scene = Scene::new(self.seed.resolve(), self.quick)?;
        let out = self.out.clone().unwrap_or_else(fresh_folder);
        let stop = interrupt::flag()?;
        if let Some(name) = &self.cell {
            let provenance =
                self.repeat_invocation(console, scene.seed(), &out).provenance(Vec::new());
            run_cell(name, &scene, &out, provenance, &stop)?;
            return Ok(Answer::Done);
        }
        outputs(console, &out).check([])?;
        let demo = demo_report::Demo {
            may_replace: console.common().overwrite,
            provenance: console.invocation().provenance(Vec::new()),
            width: wrap::columns_of_stdout(),
            ..demo_report::Demo::new(&scene, out)
        };
        let (quick, seed) = (self.quick, scene.seed());
        let programs = ThisProgram { quick, seed, is_quiet: console.common().verbose == 0 };
        // The diagnosis reports on its own threads.
        let bar = Mutex::new(ProgressBar::hidden());
        let present = || bar.lock().unwrap_or_else(PoisonError::into_inner);
        let mut show = |event| {
            match event {
                Event::Text(lines) => console.say_lines(&lines).map_err(Error::system)?,
                Event::Stage(what) => *present() = progress::stages(console, what),
                Event::Begins { what, steps } => *present() = progress::bar(console, steps, what),
                Event::Done(steps) => present().set_position(steps),
                Event::Ended => present().finish_and_clear(),
            }
            Ok(())
        };
        let listener = |stage, done| progress::show(&present(), stage, done);
        let report = demo.run(&programs, &stop, &mut show, &listener)?;
        console.json("trued.demo/1", &report)?;
        Ok(Answer::Done)
    }

    /// The command line with which a user would repeat this run.
    fn repeat_invocation(&self, console: &Console, seed: u64, out: &Path) -> Invocation {
        let seed = seed.to_string();
        let arguments = ["demo", "--seed", &seed].map(str::to_owned).into_iter();
        let quick = self.quick.then(|| "--quick".to_owned());
        let out = ["--out".to_owned(), out.display().to_string()];
        console.invocation().typed(arguments.chain(quick).chain(out))
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::Input(error) => Self::Input(error),
            Error::File(error) => crate::input::unusable(error),
            Error::Write(error) => error.into(),
            Error::Diagnosis(error) => error.into(),
            Error::System(error) => Self::System(error),
            Error::Interrupted => Self::Interrupted,
        }
    }
}

/// The first of `demo-out`, `demo-out-2`, … that does not exist.
fn fresh_folder() -> PathBuf {
    let name = |k: u32| {
        PathBuf::from(if k == 1 { "demo-out".to_owned() } else { format!("demo-out-{k}") })
    };
    (1..).map(name).find(|folder| !folder.exists()).unwrap_or_else(|| name(1))
}

/// All files that this process and its cell write during the demo.
fn outputs(console: &Console, out: &Path) -> Outputs {
    let outputs = console.outputs().in_folder(out).page(out.join(PAGE));
    let outputs = FILES.map(|name| out.join(name)).into_iter().fold(outputs, Outputs::file);
    diagnose::outputs(outputs, &out.join(DIAGNOSIS)).in_folder(out)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<demo_report::Report>("demo", "trued.demo/1")
}
