//! `trued demo`: runs the daemon and a simulated cell as separate processes and shows the benefit
//! of the correction, what the daemon's model lacks, and the benefit of knowing it.
//!
//! This process starts the two, diagnoses the cell's measurements ([`act`]), replaces the model,
//! and reports the result ([`words`]). The cell's process is the same program with a hidden option
//! ([`cell`]).

mod act;
mod cell;
mod log;
mod measure;
mod outcome;
mod page;
mod scene;
mod standing;
mod words;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::ProgressBar;

use crate::child::Guarded;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::options::Seed;
use crate::output::Console;
use crate::pages::Outputs;
use crate::progress;
use crate::provenance::Invocation;

use super::diagnose;
use outcome::{Again, Milled, Report};
use scene::Scene;

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

impl Demo {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let seed = self.seed.settle();
        let scene = Scene::new(seed, self.quick).map_err(Failure::input)?;
        let out = self.out.clone().unwrap_or_else(fresh_folder);
        match &self.cell {
            Some(name) => cell::run(name, &scene, &out, self.again(console, &scene, &out)),
            None => self.show(console, &scene, &out),
        }
    }

    fn show(&self, console: &mut Console, scene: &Scene, out: &Path) -> Outcome {
        let stop = interrupt::flag()?;
        outputs(console, out).check([])?;
        words::introduce(console, scene)?;
        let name = format!("demo-{}", std::process::id());
        let config = out.join("cell.toml");
        let mut first = console.files().in_folder(out);
        first.put(&config, scene.cell_toml(&name));
        first.put(&out.join("model.toml"), scene.model_text.as_str());
        first.write()?;

        let mut daemon = Guarded::spawn(&mut daemon_command(&config, console)?)?;
        let mut cell = Guarded::spawn_listening(&mut self.cell_command(&name, scene.seed, out)?)?;
        let lines = cell.stdout().map(BufReader::new).into_iter().flat_map(BufRead::lines);
        let mut cell_says = Lines { lines: Box::new(lines), stop: &stop, daemon: &mut daemon };

        let bar = progress::bar(console, scene.path.samples.len() as u64, "milling");
        let milled: Milled = from_json(&cell_says.until("milled ", &bar)?)?;
        bar.finish_and_clear();
        words::milled(console, &milled)?;
        words::measures(console, scene)?;
        cell_says.until("measured", &ProgressBar::hidden())?;
        let (told, swapped) = act::play(console, scene, &name, out)?;
        let go_on = if swapped { "again" } else { "end" };
        cell.tell(&format!("{go_on} {}", serde_json::to_string(&told).map_err(Failure::system)?))?;
        let bar = progress::bar(console, scene.work.samples.len() as u64, "milling again");
        let again: Option<Again> = from_json(&cell_says.until("again ", &bar)?)?;
        bar.finish_and_clear();
        finish(&mut cell, "the cell")?;
        daemon.end();
        interrupt::check(&stop)?;
        let report = Report::new(milled, told, again);
        words::end(console, &report, out)?;
        console.json("trued.demo/1", &report)?;
        Ok(Answer::Done)
    }

    /// The command line with which a user would repeat this run.
    fn again(&self, console: &Console, scene: &Scene, out: &Path) -> Invocation {
        let seed = scene.seed.to_string();
        let words = ["demo", "--seed", &seed].map(str::to_owned).into_iter();
        let quick = self.quick.then(|| "--quick".to_owned());
        let out = ["--out".to_owned(), out.display().to_string()];
        console.invocation().typed(words.chain(quick).chain(out))
    }

    fn cell_command(&self, name: &str, seed: u64, out: &Path) -> Result<Command, Failure> {
        let mut command = Guarded::myself()?;
        command.arg("demo").args(["--cell", name, "--seed", &seed.to_string()]);
        command.arg("--out").arg(out).stdout(Stdio::piped());
        if self.quick {
            command.arg("--quick");
        }
        Ok(command)
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
    let file = |name: &str| out.join(name);
    let named = ["cell.toml", "model.toml", "recording.csv", "recording.toml"];
    let named = named.into_iter().chain(["measured.csv", "measured.toml"]).map(file);
    let outputs = console.outputs().in_folder(out).page(file("report.html"));
    let outputs = named.fold(outputs, Outputs::file);
    diagnose::outputs(outputs, &out.join(act::FOLDER)).in_folder(out)
}

fn daemon_command(config: &Path, console: &Console) -> Result<Command, Failure> {
    let mut command = Guarded::myself()?;
    command.args(["run", "--with-parent"]).arg("--config").arg(config).stdout(Stdio::null());
    if console.common().verbose == 0 {
        command.arg("--quiet");
    }
    Ok(command)
}

/// The cell's output, line by line.
struct Lines<'a> {
    lines: Box<dyn Iterator<Item = std::io::Result<String>>>,
    stop: &'a AtomicBool,
    daemon: &'a mut Guarded,
}

impl Lines<'_> {
    /// The rest of the next line that begins with `head`; until then the progress bar is updated.
    fn until(&mut self, head: &str, bar: &ProgressBar) -> Result<String, Failure> {
        for line in self.lines.by_ref() {
            let line = line.map_err(Failure::system)?;
            interrupt::check(self.stop)?;
            if let Some(step) = line.strip_prefix("tick ").and_then(|k| k.parse().ok()) {
                bar.set_position(step);
            } else if let Some(rest) = line.strip_prefix(head) {
                return Ok(rest.to_owned());
            }
        }
        Err(Failure::system(match self.daemon.ended() {
            Some(status) => format!("the daemon ended early ({status}); see its messages above"),
            None => "the cell ended without a result; see its messages above".to_owned(),
        }))
    }
}

fn from_json<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, Failure> {
    serde_json::from_str(text).map_err(Failure::system)
}

fn finish(child: &mut Guarded, who: &str) -> Result<(), Failure> {
    let status = child.wait()?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure::system(format!("{who} ended with {status}")))
    }
}

/// Whether an interruption was requested; for loops that have to clean up themselves.
fn is_set(stop: &AtomicBool) -> bool {
    stop.load(Ordering::Relaxed)
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("demo", "trued.demo/1")
}
