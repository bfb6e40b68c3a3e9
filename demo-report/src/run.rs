//! The demonstration from the caller's side: starts daemon and cell, diagnoses, and reports.

use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use diagnosis_report::progress::Listener;
use harness::child::ChildGuard;
use recording::outputs::Outputs;
use report::{Provenance, TextLine};
use serde::de::DeserializeOwned;

use crate::diagnosis;
use crate::error::Error;
use crate::outcome::{MillingResult, RepeatRun, Report};
use crate::scene::Scene;
use crate::text;

/// Starts the two other processes: this library knows no command line.
pub trait Programs {
    /// The daemon for this configuration; it must end with its parent.
    ///
    /// # Errors
    /// The program cannot be found.
    fn daemon(&self, config: &Path) -> io::Result<Command>;

    /// The cell of this name: a program that calls [`crate::run_cell`] with the same scene and the folder `out`.
    ///
    /// # Errors
    /// The program cannot be found.
    fn cell(&self, name: &str, out: &Path) -> io::Result<Command>;
}

/// Events of a running demonstration.
#[derive(Debug, Clone)]
pub enum Event {
    /// Lines of the result, in order.
    Text(Vec<TextLine>),
    /// A stage of unknown length begins.
    Stage(&'static str),
    /// Work with a known number of steps begins.
    Begins {
        /// Description of the work.
        what: &'static str,
        /// Steps until its end.
        steps: u64,
    },
    /// Steps of that work that were done.
    Done(u64),
    /// The work or stage has ended.
    Ended,
}

/// Receives what is reported; an error ends the demonstration.
pub(crate) type EventSink<'t> = dyn FnMut(Event) -> Result<(), Error> + 't;

/// A demonstration.
#[derive(Debug, Clone)]
pub struct Demo<'s> {
    /// The scene.
    pub scene: &'s Scene,
    /// The folder of all files, which is created if it is missing.
    pub out: PathBuf,
    /// Whether files there are replaced.
    pub may_replace: bool,
    /// Provenance for the page of the diagnosis.
    pub provenance: Provenance,
    /// Width of the text in characters; `None`: not limited.
    pub width: Option<usize>,
}

impl<'s> Demo<'s> {
    /// With files in `out`, none of which is replaced, and text of any width.
    #[must_use]
    pub fn new(scene: &'s Scene, out: PathBuf) -> Self {
        let provenance = Provenance::default();
        Self { scene, out, may_replace: false, provenance, width: None }
    }

    /// Runs it to its end, reporting to `tell`, and the progress of its diagnosis to `listener`; ends early once `stop` is set.
    ///
    /// # Errors
    /// Files that cannot be written; a process that fails; `stop` was set; an error of `tell`.
    pub fn run(
        &self,
        programs: &dyn Programs,
        stop: &AtomicBool,
        tell: &mut EventSink<'_>,
        listener: Listener<'_>,
    ) -> Result<Report, Error> {
        let Self { scene, out, width, .. } = self;
        tell(Event::Text(text::introduction(scene)))?;
        tell(Event::Stage("starting daemon and cell"))?;
        let name = format!("demo-{}", std::process::id());
        let config = self.write_cell_files(&name)?;
        let mut command = programs.daemon(&config).map_err(Error::system)?;
        let daemon = ChildGuard::spawn(command.stdin(Stdio::null()).stdout(Stdio::null()));
        let mut daemon = daemon.map_err(Error::system)?;
        let mut command = programs.cell(&name, out).map_err(Error::system)?;
        let cell = ChildGuard::spawn(command.stdin(Stdio::piped()).stdout(Stdio::piped()));
        let mut cell = cell.map_err(Error::system)?;
        let lines = cell.stdout().map(BufReader::new).into_iter().flat_map(BufRead::lines);
        let mut lines = CellOutput { lines: Box::new(lines), stop, daemon: &mut daemon };

        tell(Event::Ended)?;
        let steps = scene.path.samples.len() as u64;
        tell(Event::Begins { what: "milling", steps })?;
        let milled: MillingResult = from_json(&lines.wait_for_line("milled ", tell)?)?;
        tell(Event::Ended)?;
        tell(Event::Text(text::milled(&milled, *width)))?;
        tell(Event::Text(text::measurement(scene)))?;
        tell(Event::Stage("measuring"))?;
        lines.wait_for_line("measured", &mut |_| Ok(()))?;
        let (outcome, swapped) = diagnosis::run(self, &name, tell, listener)?;
        let go_on = if swapped { "again" } else { "end" };
        let outcome_json = serde_json::to_string(&outcome).map_err(Error::system)?;
        cell.write_line(&format!("{go_on} {outcome_json}")).map_err(Error::system)?;
        let steps = scene.work.samples.len() as u64;
        tell(Event::Begins { what: "milling again", steps })?;
        let again: Option<RepeatRun> = from_json(&lines.wait_for_line("again ", tell)?)?;
        tell(Event::Ended)?;
        finish(&mut cell, "the cell")?;
        daemon.terminate();
        check(stop)?;
        let report = Report::new(milled, outcome, again);
        tell(Event::Text(text::summary(&report, out, *width)))?;
        Ok(report)
    }

    /// Writes the daemon's files; returns its configuration.
    fn write_cell_files(&self, name: &str) -> Result<PathBuf, Error> {
        let config = self.out.join("cell.toml");
        let mut outputs = Outputs::new(self.may_replace).in_folder(&self.out);
        outputs.put(&config, self.scene.cell_toml(name));
        outputs.put(&self.out.join(diagnosis_report::MODEL), self.scene.model_text.as_str());
        outputs.write()?;
        Ok(config)
    }
}

/// The cell's output, line by line.
struct CellOutput<'a> {
    lines: Box<dyn Iterator<Item = io::Result<String>>>,
    stop: &'a AtomicBool,
    daemon: &'a mut ChildGuard,
}

impl CellOutput<'_> {
    /// The rest of the next line that begins with `head`; until then progress is reported.
    fn wait_for_line(&mut self, head: &str, tell: &mut EventSink<'_>) -> Result<String, Error> {
        for line in self.lines.by_ref() {
            let line = line.map_err(Error::system)?;
            check(self.stop)?;
            if let Some(step) = line.strip_prefix("tick ").and_then(|k| k.parse().ok()) {
                tell(Event::Done(step))?;
            } else if let Some(rest) = line.strip_prefix(head) {
                return Ok(rest.to_owned());
            }
        }
        // Ctrl-C reaches the cell too: its output may end first.
        check(self.stop)?;
        Err(Error::system(match self.daemon.try_exit_status() {
            Some(status) => format!("the daemon ended early ({status}); see its messages above"),
            None => "the cell ended without a result; see its messages above".to_owned(),
        }))
    }
}

fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    serde_json::from_str(text).map_err(Error::system)
}

fn finish(child: &mut ChildGuard, who: &str) -> Result<(), Error> {
    let status = child.wait().map_err(Error::system)?;
    if status.success() { Ok(()) } else { Err(Error::system(format!("{who} ended with {status}"))) }
}

/// An error once `stop` is set.
pub(crate) fn check(stop: &AtomicBool) -> Result<(), Error> {
    if stop.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
