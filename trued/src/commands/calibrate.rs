//! `trued calibrate`: from measurements of the tool to a model with its uncertainty, validated on held-out poses.
//!
//! Gross errors are looked for first and reported with a remedy; held-out figures come from fits
//! that did not use these poses; parameters that the data cannot determine are named; a model is
//! written only if it loads and if the held-out poses do not rate it worse than the first. Poses
//! that a recording reserves for validation are never fitted.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use diagnosis::gross::Suspicion;
use diagnosis_report::Error;
use diagnosis_report::calibration::{self, Calibrated, Refused, Settings, calibrate};
use tracing::warn;

use crate::exit::{Answer, Outcome};
use crate::input::Reading;
use crate::options::{Seed, tolerance_mm};
use crate::output::{Console, Paint};
use crate::{progress, wrap};

/// Stages that the progress shows.
const STAGES: u64 = 7;
/// How often the progress draws while a stage lasts.
const TICK: Duration = Duration::from_millis(200);

/// Identify the robot: from tracker measurements to a calibrated model with its uncertainty
///
/// Recordings hold joint positions and what was measured there: points (x, y, z), reflectors, orientations, joint positions on the link side,
/// distances (ballbar, cable), touches of a probe. The measuring frame (one for each `station` that rows name), the reflectors' places, fixed points and what is
/// touched are fitted along where they are not said. Three models are compared on poses that took no part in any fit: the model as it is,
/// with the geometry of every joint, and with the effects that the data ask for; the last is written. Exit 1, and no model, where a gross fault (swapped columns,
/// a wrong unit or sign, a mirrored frame, a wrong tool) makes a fit senseless; where the new model is worse on the held-out poses than the one it began with;
/// and where the remaining error is so large that only a gross fault explains it.
#[derive(Debug, Args)]
pub(crate) struct Calibrate {
    #[command(flatten)]
    reading: Reading,
    /// Where the calibrated model goes
    #[arg(long, value_name = "MODEL2")]
    out: PathBuf,
    /// Write a page with errors, parameters, and what remains open
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Share of the poses, drawn by chance, on which the models are compared, where no recording keeps any (`heldout`)
    #[arg(long, value_name = "PERCENT", default_value_t = 30, value_parser = clap::value_parser!(u8).range(5..=80))]
    heldout: u8,
    /// Where one joint moves alone, take out the sag of the others before its axis is told
    #[arg(long, value_enum, value_name = "WHETHER", default_value_t = Sag::On)]
    sag: Sag,
    /// Write the model also where its own proof fails (see above), and exit 0
    #[arg(long)]
    accept_worse: bool,
    /// The tool error that is allowed, mm: exit 1 where 5 of 100 held-out errors or more exceed it; the model is written all the same
    #[arg(long, value_name = "MM", value_parser = tolerance_mm, allow_negative_numbers = true)]
    tolerance_mm: Option<f64>,
    #[command(flatten)]
    seed: Seed,
    /// Recordings of one robot, each with measuring frames of its own
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
}

/// Whether the sag of the stationary joints is removed from a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Sag {
    On,
    Off,
}

impl Calibrate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().file(&self.out).pages(&self.report);
        outputs.check(self.recordings.iter().chain(self.reading.files()))?;
        let (model, recordings) = self.reading.measured(&self.recordings)?;
        let progress = progress::bar(console, STAGES, "reading recordings");
        progress.enable_steady_tick(TICK);
        let calibrated = calibrate(model, &recordings, &self.settings(), &mut |stage| {
            progress.inc(1);
            progress.set_message(stage);
        });
        progress.finish_and_clear();
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
        for reason in &calibrated.refused {
            let head = console.paint(Paint::Bad, "not proven");
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
            seed: self.seed.settle(),
            heldout_share: 0.01 * f64::from(self.heldout),
            sag: match self.sag {
                Sag::On => calibration::Sag::AllOthers,
                Sag::Off => calibration::Sag::AsMeasured,
            },
            tolerance_mm: self.tolerance_mm,
            ..Settings::default()
        }
    }

    fn is_written(&self, calibrated: &Calibrated) -> bool {
        self.accept_worse || calibrated.is_proven()
    }
}

/// Gross errors make any fit meaningless: they are reported, and nothing is written.
fn refuse(console: &mut Console, faults: &[Suspicion]) -> Outcome {
    console.json("trued.calibrate/1", &Refused::of(faults))?;
    let head = console.paint(Paint::Bad, "not calibrated");
    let more = if faults.len() > 1 { "; one of these explains it" } else { "" };
    console.say(format!(
        "{head}: the recording and the model do not belong together as they are{more}"
    ))?;
    for fault in faults {
        console.say(format!("  {}", fault.says))?;
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
        ResultSchema::of::<Refused<'_>>("calibrate-refused", "trued.calibrate/1"),
    ]
}
