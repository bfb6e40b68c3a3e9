//! `trued demo`: the daemon and a virtual cell, each a process of its own, and what the correction is worth there.
//!
//! This process only starts the two, shows how far they are, and says what the cell measured. The cell's process is the same
//! program with a hidden option ([`cell`]).

mod cell;
mod log;
mod outcome;
mod page;
mod scene;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;

use crate::child::Guarded;
use crate::exit::{Answer, Failure, Outcome};
use crate::interrupt;
use crate::options::Seed;
use crate::output::{Console, Paint};
use crate::progress;
use crate::table::Table;

use outcome::Report;
use scene::Scene;

/// See the correction at work: a virtual robot that mills, without and with it
#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// The short form: one slot, ten seconds
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    seed: Seed,
    /// Where the recording and the page go
    #[arg(long, value_name = "DIR", default_value = "demo-out")]
    out: PathBuf,
    /// This process is the cell of that name
    #[arg(long, hide = true, value_name = "NAME")]
    cell: Option<String>,
}

impl Demo {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let seed = self.seed.settle();
        let scene = Scene::new(seed, self.quick).map_err(Failure::input)?;
        match &self.cell {
            Some(name) => cell::run(name, &scene, &self.out),
            None => self.show(console, &scene),
        }
    }

    fn show(&self, console: &mut Console, scene: &Scene) -> Outcome {
        let stop = interrupt::flag()?;
        introduce(console, scene)?;
        std::fs::create_dir_all(&self.out).map_err(|e| cannot_make(&self.out, &e))?;
        let name = format!("demo-{}", std::process::id());
        let config = self.out.join("cell.toml");
        console.file(&config, &scene.cell_toml(&name))?;
        console.file(&self.out.join("model.toml"), scene.model_text())?;

        let mut daemon = Guarded::spawn(&mut daemon_command(&config, console)?)?;
        let mut cell = Guarded::spawn(&mut self.cell_command(&name, scene.seed)?)?;
        let lines = cell.stdout().map(BufReader::new);
        let report = follow(console, scene, lines, &stop, &mut daemon)?;
        finish(&mut cell, "the cell")?;
        daemon.end();
        interrupt::check(&stop)?;
        say(console, &report, &self.out)?;
        console.json("trued.demo/1", &report)?;
        Ok(Answer::Done)
    }

    fn cell_command(&self, name: &str, seed: u64) -> Result<Command, Failure> {
        let mut command = Guarded::myself()?;
        command.arg("demo").args(["--cell", name, "--seed", &seed.to_string()]);
        command.arg("--out").arg(&self.out).stdout(Stdio::piped());
        if self.quick {
            command.arg("--quick");
        }
        Ok(command)
    }
}

fn introduce(console: &mut Console, scene: &Scene) -> Result<(), Failure> {
    let strong = |text: &str, console: &Console| console.paint(Paint::Strong, text);
    let robot = strong(&scene.model.file.name, console);
    console.say(format!(
        "{robot} mills {} in {:.0} s, seed {}",
        scene.what(),
        scene.duration_s(),
        scene.seed
    ))?;
    console.say("The daemon's model: as calibrated. The true robot: every parameter off by its stated uncertainty, and")?;
    for extra in &scene.truth.extras {
        console.say(format!("  unknown to the model: {}", extra.words))?;
    }
    console.say("")
}

fn daemon_command(config: &Path, console: &Console) -> Result<Command, Failure> {
    let mut command = Guarded::myself()?;
    command.args(["run", "--with-parent"]).arg("--config").arg(config).stdout(Stdio::null());
    if console.common().verbose == 0 {
        command.arg("--quiet");
    }
    Ok(command)
}

/// Reads the cell's lines: how far it is, and in the end what it measured.
fn follow(
    console: &Console,
    scene: &Scene,
    lines: Option<BufReader<ChildStdout>>,
    stop: &AtomicBool,
    daemon: &mut Guarded,
) -> Result<Report, Failure> {
    let bar = progress::bar(console, scene.path.samples.len() as u64, "milling");
    for line in lines.into_iter().flat_map(BufRead::lines) {
        let line = line.map_err(Failure::system)?;
        interrupt::check(stop)?;
        if let Some(step) = line.strip_prefix("tick ").and_then(|k| k.parse().ok()) {
            bar.set_position(step);
        } else if let Some(report) = line.strip_prefix("report ") {
            return serde_json::from_str(report).map_err(Failure::system);
        }
    }
    match daemon.ended() {
        Some(status) => {
            Err(Failure::system(format!("the daemon ended early ({status}); its words are above")))
        }
        None => Err(Failure::system("the cell ended without a result; its words are above")),
    }
}

fn say(console: &mut Console, report: &Report, out: &Path) -> Result<(), Failure> {
    let mm = |value: f64| format!("{value:.3}");
    let (without, with) = (&report.tool_error_mm.without, &report.tool_error_mm.with);
    let errors = Table::new(["tool error, mm", "mean", "95 %", "largest"])
        .row(["without correction".to_owned(), mm(without.mean), mm(without.p95), mm(without.max)])
        .row(["with correction".to_owned(), mm(with.mean), mm(with.p95), mm(with.max)]);
    console.say(errors.render())?;
    let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
    let l = &report.latency_ns;
    let latency =
        Table::new(["command to corrected target, µs", "middle", "99 %", "99.9 %", "worst"]).row([
            "round trip between two processes".to_owned(),
            us(l.p50),
            us(l.p99),
            us(l.p999),
            us(l.max),
        ]);
    console.say(latency.render())?;
    console.say(format!(
        "{} cycles at 1 kHz; {} missed, {} commands rejected, {} invariants broken",
        report.cycles, report.missed_cycles, report.rejected_commands, report.invariants_broken
    ))?;
    console.say(format!("vibration: true is {}", report.ringing.words))?;
    for event in report.vibration.iter().filter(|event| event.state == "alarm") {
        let since = event.after_onset_ms.filter(|ms| *ms >= 0.0);
        let since =
            since.map_or_else(String::new, |ms| format!(", {ms:.0} ms after it rang that loud"));
        console.say(format!("  flagged at {:.2} s{since}: {}", event.t_s, event.says))?;
    }
    console.say("")?;
    console.say(format!("page       {}", out.join("report.html").display()))?;
    console.say(format!("recording  {}", out.join("recording.csv").display()))?;
    console
        .say(format!("black box  {} (MCAP, of the daemon itself)", out.join("blackbox").display()))
}

fn finish(child: &mut Guarded, who: &str) -> Result<(), Failure> {
    let status = child.wait()?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure::system(format!("{who} ended with {status}")))
    }
}

fn cannot_make(dir: &Path, error: &std::io::Error) -> Failure {
    Failure::system(format!("{}: cannot make this folder: {error}", dir.display()))
}

/// Whether someone asked to stop; for loops that have to tidy up themselves.
fn is_set(stop: &AtomicBool) -> bool {
    stop.load(Ordering::Relaxed)
}
