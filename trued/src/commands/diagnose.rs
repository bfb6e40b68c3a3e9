//! `trued diagnose`: differences between a model and recordings, missing effects with their parameters, and validation.
//!
//! Promises: `diagnosis.json`, `model.toml` and `report.html` are written together or not at all, never over an input; the same input and seed give
//! the same bytes. Never: a claim where a recording does not belong to the model.

mod apply;
mod batch;
mod drives;
mod forces;
mod page;
pub(super) mod told;

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::diagnose::{Diagnosis, Ingested, Thinned, ingest};
use diagnosis::force::has_force;
use diagnosis::gross::Suspicion;
use diagnosis::{Chosen, from_recording};
use recording::model::RobotModel;
use recording::series::{Heldout, Recording};

use drives::Drives;

use super::calibrate::numbers::{Entry, entries};
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{Looked, Reading};
use crate::options::{Seed, Threads};
use crate::output::{Console, Paint};
use crate::progress;

/// The file of the model with what was found.
pub(super) const MODEL: &str = "model.toml";
/// Measured rows from which on a recording can say anything.
const ROWS_LEAST: usize = 30;

/// Say where a model and recordings differ, name the missing physics, and prove the gain on rows that nothing has seen
///
/// Recordings hold joint positions and what was measured: the tool, reflectors, joint positions on the link side, the drives' torque or current; or forces
/// or accelerations at the tool, without any joint. Writes DIR/diagnosis.json,
/// DIR/model.toml (the model with what was found) and DIR/report.html. Measuring frames and places of reflectors are fitted along. Exit 0 whatever is said
/// (without --apply); 2 for bad input, with nothing written. With --batch each recording of a manifest is diagnosed for itself, one Parquet file each
/// (docs/batch.md); exit 1 where some were refused, 3 where some could not be read.
#[derive(Debug, Args)]
pub(crate) struct Diagnose {
    #[command(flatten)]
    reading: Reading,
    /// Where the result goes
    #[arg(long, value_name = "DIR", default_value = "diagnosis")]
    out: PathBuf,
    #[command(flatten)]
    seed: Seed,
    /// Swap the model with what was found into the running daemon of this cell: its configuration (CELL.toml), or its name. Only
    /// where the verdict is `missing_physics`; else exit 1, and the daemon goes on with its model
    #[arg(long, value_name = "CELL")]
    apply: Option<PathBuf>,
    /// Torque and motion are compared below this frequency [default: 40, or a tenth of the sampling rate]
    #[arg(long, value_name = "HZ", value_parser = band)]
    band: Option<f64>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    batch: batch::Batch,
    /// Recordings of one robot
    #[arg(value_name = "RECORDING", required_unless_present = "batch")]
    recordings: Vec<PathBuf>,
}

/// Recordings that were read, with the model that they belong to.
enum Read {
    /// Forces without any joint.
    Forces(Box<(RobotModel, Recording)>),
    /// What was measured of a robot.
    Robot(Box<RobotModel>, Vec<Recording>),
}

impl Read {
    /// Reads recordings of one robot, or one of forces alone.
    fn of(reading: &Reading, recordings: &[PathBuf]) -> Result<Self, Failure> {
        let looked = recordings.first().map(|first| reading.look(first)).transpose()?;
        let read = match looked {
            Some(Looked::WithoutArm(alone)) if has_force(&alone.1) => {
                if recordings.len() > 1 {
                    let why = "recordings of forces alone are diagnosed one at a time";
                    return Err(Failure::input(why));
                }
                return Ok(Self::Forces(alone));
            }
            Some(Looked::WithoutArm(alone)) => Some(alone.1),
            Some(Looked::OfArm(read)) => read.map(|read| *read),
            None => None,
        };
        let (model, recordings) = reading.measured_after(read, recordings)?;
        Ok(Self::Robot(Box::new(model), recordings))
    }
}

/// What was found, with what it was found in.
pub(super) struct Found {
    base: RobotModel,
    seed: u64,
    /// None where the recordings cannot be judged; then `doubts` say why.
    pub(super) diagnosis: Option<Diagnosis>,
    /// The model's effects with what was found.
    entries: Vec<Entry>,
    doubts: Vec<String>,
    /// What was seen in the recordings before anything was fitted, and what was done about it.
    notes: Vec<String>,
    rows: usize,
    /// Whether the recordings say anything of positions.
    has_positions: bool,
    /// What the torques say, where they were recorded.
    drives: Option<Drives>,
}

/// A frequency above zero.
fn band(text: &str) -> Result<f64, String> {
    let hz: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if hz.is_finite() && hz > 0.0 {
        Ok(hz)
    } else {
        Err("expected a frequency above 0 Hz".to_owned())
    }
}

impl Diagnose {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.threads.bound()?;
        if let Some(manifest) = &self.batch.batch {
            return self.batch.run(manifest, &self.out, console);
        }
        let stage = progress::stages(console, "reading recordings");
        let (model, mut recordings) = match Read::of(&self.reading, &self.recordings)? {
            Read::Forces(alone) => {
                stage.finish_and_clear();
                return forces::alone(self, *alone, console);
            }
            Read::Robot(model, recordings) => (*model, recordings),
        };
        let cell = self.apply.as_deref().map(apply::cell).transpose()?;
        let mut outputs = outputs(console.outputs(), &self.out);
        outputs.check(self.inputs())?;
        let seed = self.seed.settle();
        stage.set_message("drive torques: fit, search, proof");
        let drives = Drives::where_recorded(&model, &mut recordings, self.band, seed)?;
        stage.set_message("positions: fit, search, proof");
        let found = Found::with_drives(model, recordings, drives, seed)?;
        let reports = found.reports();
        stage.set_message("pictures and files");
        found.put(&mut outputs, &reports, &self.out)?;
        stage.finish_and_clear();
        console.write(outputs, "trued.diagnosis/1", &told::Whole::of(&reports))?;
        for report in &reports {
            let domain =
                if reports.len() > 1 { format!("{}, ", report.domain()) } else { String::new() };
            let head = format!("{domain}{}", report.verdict.replace('_', " "));
            let head = console.paint(Paint::Strong, &head);
            console.say(format!("{head}: {}", told::lead(report)))?;
            for line in told::lines(report) {
                console.say(line)?;
            }
        }
        console.say(format!("written to {}", self.out.display()))?;
        match cell {
            Some(cell) => apply::apply(console, &cell, &found, &self.out),
            None => Ok(Answer::Done),
        }
    }

    fn inputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.recordings.iter().chain(self.reading.files())
    }
}

const JSON: &str = "diagnosis.json";
const PAGE: &str = "report.html";

/// With the files that a diagnosis is written to, in `dir`.
pub(super) fn outputs(outputs: Outputs, dir: &Path) -> Outputs {
    outputs.in_folder(dir).result(dir.join(JSON)).result(dir.join(MODEL)).page(dir.join(PAGE))
}

impl Found {
    /// Diagnoses `base` by `recordings`, beside what their torques say; no recordings are left where torques are all that was recorded.
    ///
    /// # Errors
    /// Recordings that make no campaign.
    fn with_drives(
        base: RobotModel,
        recordings: Vec<Recording>,
        drives: Option<Drives>,
        seed: u64,
    ) -> Result<Self, Failure> {
        if drives.is_some() && recordings.is_empty() {
            return Ok(Self {
                base,
                seed,
                diagnosis: None,
                entries: Vec::new(),
                doubts: Vec::new(),
                notes: Vec::new(),
                rows: 0,
                has_positions: false,
                drives,
            });
        }
        Ok(Self { drives, ..Self::of(base, recordings, seed)? })
    }

    /// Diagnoses `base` by what `recordings` say of positions.
    ///
    /// # Errors
    /// Recordings that make no campaign.
    pub(super) fn of(
        base: RobotModel,
        mut recordings: Vec<Recording>,
        seed: u64,
    ) -> Result<Self, Failure> {
        let arm = &base.physics.arm;
        let has_positions = drives::positions_are_recorded(&recordings);
        let nothing = |base, doubts, notes, rows| {
            let (diagnosis, entries, drives) = (None, Vec::new(), None);
            Ok(Self { base, seed, diagnosis, entries, doubts, notes, rows, has_positions, drives })
        };
        let Ingested { notes, doubts } = ingest(arm, &mut recordings);
        if !doubts.is_empty() {
            return nothing(base, doubts, notes, 0);
        }
        let looked = Thinned::at(arm, &recordings).map_err(Failure::input)?;
        let rows = looked.rows;
        let doubts = self::doubts(&base, &looked);
        if !doubts.is_empty() {
            return nothing(base, doubts, notes, rows);
        }
        let is_said = |recording: &Recording| recording.about.heldout != Heldout::Unsaid;
        let held = recordings.iter().any(is_said);
        let held = held.then(|| from_recording::held_out(&looked.campaign, &recordings));
        drop(recordings);
        let diagnosis = looked.diagnose(&base.physics, &base.sigma, held, seed);
        if let Some(doubt) = diagnosis.doubt() {
            return nothing(base, vec![doubt], notes, rows);
        }
        let chosen: Vec<Chosen> = diagnosis
            .findings
            .iter()
            .chain(&diagnosis.candidates)
            .map(|finding| Chosen {
                effect: finding.place,
                gain: finding.gain,
                settings: finding.settings.clone(),
            })
            .collect();
        let entries = entries(&base, &diagnosis.fit, &chosen, &[])?;
        let diagnosis = Some(diagnosis);
        let drives = None;
        Ok(Self { base, seed, diagnosis, entries, doubts, notes, rows, has_positions, drives })
    }

    /// What the torques say, where they could be judged.
    fn torques(&self) -> Option<&diagnosis::torque::Diagnosis> {
        self.drives.as_ref().and_then(|drives| drives.result.as_ref().ok())
    }

    /// What is said of each domain that was recorded.
    pub(super) fn reports(&self) -> Vec<told::Report> {
        let of_positions = self.has_positions || self.drives.is_none();
        let mut reports: Vec<told::Report> =
            of_positions.then(|| told::Report::of(self)).into_iter().collect();
        if let Some(drives) = &self.drives {
            reports.push(told::Report::of_drives(&self.base, drives, &[], self.seed));
        }
        reports
    }

    /// Puts diagnosis, model and page into the [`outputs`] in `dir`.
    ///
    /// # Errors
    /// A model that does not load.
    pub(super) fn put(
        &self,
        outputs: &mut Outputs,
        reports: &[told::Report],
        dir: &Path,
    ) -> Result<(), Failure> {
        outputs.put(&dir.join(JSON), told::json(reports)?);
        outputs.put(&dir.join(MODEL), self.model()?);
        outputs.put_page(&dir.join(PAGE), page::render(self, reports, dir));
        Ok(())
    }

    /// The model with what was found, as text that loads.
    fn model(&self) -> Result<String, Failure> {
        let mut file = self.base.file.clone();
        for entry in &self.entries {
            match entry.of_base.and_then(|at| file.effects.get_mut(at)) {
                Some(there) => *there = entry.written.clone(),
                None if entry.is_empty() => {}
                None => file.effects.push(entry.written.clone()),
            }
        }
        if let Some(drives) = &self.drives {
            file.effects = drives.written(&self.base, &file.effects);
        }
        let by = format!("trued diagnose {}", env!("CARGO_PKG_VERSION"));
        file.meta.insert("diagnosed_by".to_owned(), by.into());
        let base = format!("{}, {:016x}", self.base.file.name, self.base.hash);
        file.meta.insert("diagnosed_from_model".to_owned(), base.into());
        let robot = self.base.file.identity().to_string();
        file.meta.insert("diagnosed_robot".to_owned(), robot.into());
        let text = file.to_toml();
        RobotModel::parse("the diagnosed model", &text).map_err(Failure::system)?;
        Ok(text)
    }
}

/// Why nothing can be said of these recordings.
fn doubts(base: &RobotModel, looked: &Thinned) -> Vec<String> {
    let rows = looked.rows;
    if rows < ROWS_LEAST {
        return vec![format!(
            "{rows} rows were measured, expected at least {ROWS_LEAST}: record more"
        )];
    }
    if !looked.moves {
        return vec!["no joint moves in the recording: move the arm".to_owned()];
    }
    looked.faults(&base.physics).into_iter().map(|Suspicion { says, .. }| says).collect()
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<told::Whole<'_>>("diagnosis", "trued.diagnosis/1"),
        batch::result_schema(),
    ]
}
