//! `trued challenge --inject`: effects added to real torque recordings; the solver is run on each original and on each modified recording.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use challenge::answer::Answer;
use challenge_report::injection::{InjectionReport, RealRecording, cases};

use super::ParallelWork;
use super::solver::Solver;
use crate::exit::{self, Failure, Outcome};
use crate::input::Reading;
use crate::output::Console;

pub(super) struct Injection<'a> {
    pub(super) reading: &'a Reading,
    pub(super) recordings: &'a [PathBuf],
    pub(super) out: &'a Path,
    pub(super) seed: u64,
    pub(super) solver: &'a Solver,
}

/// Result of the solver: its answer, if valid, and the text of its model.
struct SolverResult {
    answer: Option<Answer>,
    model: Option<String>,
}

impl Injection<'_> {
    pub(super) fn run(&self, console: &mut Console, work: &ParallelWork<'_>) -> Outcome {
        let mut recordings = Vec::new();
        for path in self.recordings {
            recordings.push(self.diagnosed(path, work.stop)?);
        }
        let (cases, cannot) = cases(&recordings, self.seed);
        let lines = work.map_cases(console, cases.len(), "solving", |index| {
            let case = &cases[index];
            let name = format!("{index:03}");
            let solved = self.solve(case.recording, &name, case.table(), work.stop)?;
            Ok(case.line(solved.answer.as_ref()))
        })?;
        let report = InjectionReport::of(self.seed, &cases, lines, cannot);
        let text = serde_json::to_string_pretty(&report).map_err(Failure::system)?;
        let mut outputs = console.outputs();
        outputs.put(&self.out.join("outcomes.json"), text + "\n");
        console.write(outputs, "trued.injection/1", &report)?;
        console.say(report.text())?;
        Ok(exit::Answer::Done)
    }

    /// Reads a recording, diagnoses it, and diagnoses it again with the resulting model.
    fn diagnosed(&self, path: &Path, stop: &AtomicBool) -> Result<RealRecording, Failure> {
        let (model, recordings) = self.reading.measured(&[path.to_owned()])?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut recording = RealRecording::of(name, &model, &recordings).map_err(Failure::input)?;
        let table = recording.table();
        let first = self.solve(&recording, "first", table.clone(), stop)?;
        let written = first.model.ok_or_else(|| {
            Failure::input(format!(
                "{}: the solver gave no model for the plain recording",
                recording.name
            ))
        })?;
        recording.set_model(&written).map_err(Failure::input)?;
        let again = self.solve(&recording, "again", table, stop)?;
        recording.set_answer(again.answer.as_ref());
        Ok(recording)
    }

    fn solve(
        &self,
        recording: &RealRecording,
        case: &str,
        table: String,
        stop: &AtomicBool,
    ) -> Result<SolverResult, Failure> {
        let folder = self.out.join("cases").join(&recording.name).join(case);
        std::fs::create_dir_all(&folder).map_err(Failure::system)?;
        let files = [("model.toml", recording.model.clone()), ("recording.csv", table)];
        super::write(files.map(|(name, text)| (folder.join(name), text)))?;
        let out = self.out.join("answers").join(&recording.name).join(case);
        let given = self.solver.answer(&folder, &out, stop)?;
        let answer = given.diagnosis.as_deref().and_then(|text| Answer::parse(text, "torque").ok());
        Ok(SolverResult { answer, model: given.model })
    }
}
