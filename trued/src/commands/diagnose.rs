//! `trued diagnose`: differences between a model and recordings, missing effects with their parameters, and validation.
//!
//! `diagnosis.json`, `model.toml` and `report.html` are written together or not at all, never over
//! an input; the same input and seed give the same bytes. Nothing is claimed if a recording does
//! not belong to the model.

mod apply;
mod batch;
mod forces;
mod rows;

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::force::has_force;
use diagnosis_report::{
    DiagnosisJson, JSON, MODEL, PAGE, RobotDiagnosis, Settings, diagnose, lines, summary,
};
use recording::model::RobotModel;
use recording::series::Recording;

use crate::exit::{Answer, Failure, Outcome};
use crate::input::{InspectedRecording, Reading};
use crate::options::{Seed, Threads, tolerance_mm};
use crate::output::{Console, Emphasis};
use crate::pages::Outputs;
use crate::progress;

/// Identify the physical effects that a robot's model lacks, with validation on held-out data
///
/// Recordings contain joint positions and measurements: of the tool, reflectors, link-side joint positions, drive torques or currents; or forces
/// or accelerations at the tool, without joint positions. Writes DIR/diagnosis.json,
/// DIR/model.toml (the model with the effects found) and DIR/report.html. Measuring frames and reflector positions are estimated too. Exit 0 for every verdict
/// (without --apply); 2 for invalid input, and nothing is written. With --batch, each recording of a manifest is diagnosed separately into one Parquet file
/// (docs/batch.md); exit 1 if some were rejected, 3 if some could not be read.
#[derive(Debug, Args)]
pub(crate) struct Diagnose {
    #[command(flatten)]
    reading: Reading,
    /// Output folder
    #[arg(long, value_name = "DIR", default_value = "diagnosis")]
    out: PathBuf,
    #[command(flatten)]
    seed: Seed,
    /// Load the resulting model into the running daemon of this cell, given by its configuration (CELL.toml) or its name. Only
    /// if the verdict is `missing_physics`; otherwise exit 1, and the daemon keeps its model
    #[arg(long, value_name = "CELL")]
    apply: Option<PathBuf>,
    /// Cut-off frequency of the low-pass filter for torques and motion, Hz, above 0 [default: 40, or a tenth of the sampling rate]
    #[arg(long, value_name = "HZ", value_parser = band)]
    band: Option<f64>,
    /// Allowed tool error, mm, above 0: reports whether 95 % of the held-out errors are within it, with the given and with the resulting model
    #[arg(long, value_name = "MM", value_parser = tolerance_mm, allow_negative_numbers = true)]
    tolerance_mm: Option<f64>,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    batch: batch::Batch,
    /// Recordings of one robot
    #[arg(value_name = "RECORDING", required_unless_present = "batch")]
    recordings: Vec<PathBuf>,
}

/// Recordings that were read, with the model that they belong to.
enum DiagnosisInput {
    /// Forces without any joint.
    Forces(Box<(RobotModel, Recording)>),
    /// What was measured of a robot.
    Robot(Box<RobotModel>, Vec<Recording>),
}

impl DiagnosisInput {
    /// Reads recordings of one robot, or one of forces alone.
    fn of(reading: &Reading, recordings: &[PathBuf]) -> Result<Self, Failure> {
        let inspected = recordings.first().map(|first| reading.inspect(first)).transpose()?;
        let read = match inspected {
            Some(InspectedRecording::WithoutArm(alone)) if has_force(&alone.1) => {
                if recordings.len() > 1 {
                    let why = "recordings with forces only are diagnosed one at a time; give one RECORDING";
                    return Err(Failure::input(why));
                }
                return Ok(Self::Forces(alone));
            }
            Some(InspectedRecording::WithoutArm(alone)) => Some(alone.1),
            Some(InspectedRecording::OfArm(read)) => read.map(|read| *read),
            None => None,
        };
        let (model, recordings) = reading.measured_after(read, recordings)?;
        Ok(Self::Robot(Box::new(model), recordings))
    }
}

/// A frequency above zero.
fn band(text: &str) -> Result<f64, String> {
    let hz: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
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
        let (model, recordings) = match DiagnosisInput::of(&self.reading, &self.recordings)? {
            DiagnosisInput::Forces(alone) => {
                stage.finish_and_clear();
                return forces::diagnose_forces(self, *alone, console);
            }
            DiagnosisInput::Robot(model, recordings) => (*model, recordings),
        };
        let cell = self.apply.as_deref().map(apply::cell).transpose()?;
        let mut outputs = outputs(console.outputs(), &self.out);
        outputs.check(self.inputs())?;
        let seed = self.seed.resolve();
        let (band_hz, tolerance_mm) = (self.band, self.tolerance_mm);
        let settings = Settings { seed, band_hz, tolerance_mm, ..Settings::default() };
        let found = diagnose(model, recordings, &settings, &|begun, done| {
            progress::show(&stage, begun, done);
        })?;
        stage.set_message("figures and files");
        let reports = found.reports();
        add_files(&mut outputs, &found, &self.out)?;
        stage.finish_and_clear();
        console.write(outputs, "trued.diagnosis/1", &DiagnosisJson::of(&reports))?;
        for report in &reports {
            let domain =
                if reports.len() > 1 { format!("{}, ", report.domain) } else { String::new() };
            let head = format!("{domain}{}", report.verdict.replace('_', " "));
            let head = console.paint(Emphasis::Strong, &head);
            console.say(format!("{head}: {}", summary(report)))?;
            for line in lines(report) {
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

/// With the files that a diagnosis is written to, in `dir`.
pub(super) fn outputs(outputs: Outputs, dir: &Path) -> Outputs {
    outputs.in_folder(dir).result(dir.join(JSON)).result(dir.join(MODEL)).page(dir.join(PAGE))
}

/// Adds diagnosis, model and page to the [`outputs`] in `dir`.
///
/// # Errors
/// The model does not load.
pub(super) fn add_files(
    outputs: &mut Outputs,
    found: &RobotDiagnosis,
    dir: &Path,
) -> Result<(), Failure> {
    outputs.put(&dir.join(JSON), found.json()?);
    outputs.put(&dir.join(MODEL), found.model_toml()?);
    outputs.put_page(&dir.join(PAGE), found.page(dir));
    Ok(())
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<diagnosis_report::DiagnosisJson<'_>>("diagnosis", "trued.diagnosis/1"),
        batch::result_schema(),
    ]
}
