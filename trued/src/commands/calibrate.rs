//! `trued calibrate`: from measurements of the tool to a model with its uncertainty, validated on held-out poses.
//!
//! Gross errors are looked for first and reported with a remedy; held-out figures come from fits
//! that did not use these poses; parameters that the data cannot determine are named; a model is
//! written only if it loads and if the held-out poses do not rate it worse than the first. Poses
//! that a recording reserves for validation are never fitted.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use diagnosis::gross_errors::SuspectedError;
use diagnosis_report::Error;
use diagnosis_report::calibration::{self, CalibrationResult, Rejection, Settings, calibrate};
use tracing::warn;

use crate::exit::{Answer, Outcome};
use crate::input::Reading;
use crate::options::{Seed, in_unit, tolerance_mm};
use crate::output::{Console, Emphasis};
use crate::{progress, wrap};

/// Calibrate a robot: identify its model, with uncertainties, from measurements of the tool
///
/// Recordings contain joint positions and the measurements at each pose: points (x, y, z), reflectors, orientations, link-side joint positions,
/// distances (ballbar, cable) or contacts of a probe. Measuring frames (one for each `station` of the rows), reflector positions, fixed points and contacted
/// surfaces are estimated too, unless they are given. Three models are compared on a held-out set of poses: the given model, the same with identified joint geometry,
/// and with the effects selected from the data as well. The last one is written. Exit 1 and no model if a gross fault (swapped columns, a wrong unit or sign,
/// a mirrored frame, a wrong tool) makes a fit meaningless, if the new model is worse than the given one on the held-out poses, or if the remaining error
/// is so large that only a gross fault explains it.
#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    reading: Reading,
    /// Output file for the calibrated model
    #[arg(long, value_name = "MODEL2")]
    out: PathBuf,
    /// Write a page with the errors, the parameters and what the data do not determine
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Percentage of the poses held out at random to compare the models, 5 to 80; not used if a recording marks held-out poses itself (`heldout`)
    #[arg(long, value_name = "PERCENT", default_value_t = in_unit(Settings::default().heldout_share, PERCENT) as u8, value_parser = clap::value_parser!(u8).range(5..=80))]
    heldout: u8,
    /// Where one joint moves alone, subtract the gravity deflection of the other joints before its axis is determined
    #[arg(long, value_enum, value_name = "WHETHER", default_value_t = Sag::of(Settings::default().sag))]
    sag: Sag,
    /// Write the model and exit 0 even if the validation on held-out poses fails (see above)
    #[arg(long)]
    accept_worse: bool,
    /// Allowed tool error, mm, above 0: exit 1 if 5 % or more of the held-out errors exceed it; the model is still written
    #[arg(long, value_name = "MM", value_parser = tolerance_mm, allow_negative_numbers = true)]
    tolerance_mm: Option<f64>,
    #[command(flatten)]
    seed: Seed,
    /// Recordings of one robot; each has its own measuring frames
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
}

/// One percent.
const PERCENT: f64 = 0.01;

/// Whether the sag of the stationary joints is removed from a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Sag {
    On,
    Off,
}

impl Sag {
    fn of(sag: calibration::SagCorrection) -> Self {
        match sag {
            calibration::SagCorrection::AsMeasured => Self::Off,
            calibration::SagCorrection::AllOthers | calibration::SagCorrection::Carriers => {
                Self::On
            }
        }
    }
}

impl Calibrate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().file(&self.out).pages(&self.report);
        outputs.check(self.recordings.iter().chain(self.reading.files()))?;
        let spinner = progress::stages(console, "reading recordings");
        let (model, recordings) = self.reading.measured(&self.recordings)?;
        let calibrated = calibrate(model, &recordings, &self.settings(), &|stage, done| {
            progress::show(&spinner, stage, done);
        });
        spinner.finish_and_clear();
        let calibrated = match calibrated {
            Err(Error::GrossFaults(faults)) => return refuse(console, &faults),
            calibrated => calibrated?,
        };
        let written = self.is_written(&calibrated).then_some(self.out.as_path());
        if let Some(out) = written {
            outputs.put(out, calibrated.model_toml()?);
        }
        calibrated.warnings.iter().for_each(|warning| warn!("{warning}"));
        if let Some(report) = &self.report {
            outputs.put_page(report, calibrated.page(written));
        }
        console.write(outputs, "trued.calibrate/1", &calibrated.report(written))?;
        console.say(calibrated.text(written, wrap::columns_of_stdout()))?;
        for reason in &calibrated.rejection_reasons {
            let head = console.paint(Emphasis::Bad, "not validated");
            console.say(format!("{head}: {reason}"))?;
        }
        if written.is_some() {
            let meets = calibrated.tolerance().is_none_or(|tolerance| tolerance.met);
            return Ok(if meets { Answer::Done } else { Answer::No });
        }
        console.say("no model was written; use --accept-worse to write it anyway")?;
        Ok(Answer::No)
    }

    fn settings(&self) -> Settings {
        Settings {
            seed: self.seed.resolve(),
            heldout_share: PERCENT * f64::from(self.heldout),
            sag: match self.sag {
                Sag::On => calibration::SagCorrection::AllOthers,
                Sag::Off => calibration::SagCorrection::AsMeasured,
            },
            tolerance_mm: self.tolerance_mm,
            ..Settings::default()
        }
    }

    fn is_written(&self, calibrated: &CalibrationResult) -> bool {
        self.accept_worse || calibrated.is_validated()
    }
}

/// Gross errors make any fit meaningless: they are reported, and nothing is written.
fn refuse(console: &mut Console, faults: &[SuspectedError]) -> Outcome {
    console.json("trued.calibrate/1", &Rejection::of(faults))?;
    let head = console.paint(Emphasis::Bad, "not calibrated");
    let more = if faults.len() > 1 { "; one of these explains it" } else { "" };
    console.say(format!("{head}: the recording and the model do not match{more}"))?;
    for fault in faults {
        console.say(format!("  {}", fault.message))?;
    }
    console.say("no model was written")?;
    Ok(Answer::No)
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<calibration::Report>("calibrate", "trued.calibrate/1"),
        ResultSchema::of::<Rejection<'_>>("calibrate-refused", "trued.calibrate/1"),
    ]
}
