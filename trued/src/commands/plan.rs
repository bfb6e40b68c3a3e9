//! `trued plan`: selection of measuring poses, their contributions and the stopping rule; ten check poses; the test of ISO 9283.
//!
//! Every pose is inside the joint limits, visible to the instrument as described, and free of the
//! described obstacles; what is not checked is stated. Inputs are not overwritten, and no robot is
//! moved.

mod setup;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::campaign_import;
use diagnosis::plan::Criterion;
use diagnosis::plan::check::ErrorRates;
use diagnosis::plan::iso::{Evaluation, VISITS_REQUIRED};
use diagnosis::plan::working_zone::WorkingZone;
use diagnosis_report::Error;
use diagnosis_report::iso9283;
use diagnosis_report::plan::experiment::{self, Request};
use diagnosis_report::plan::{self as plans, FILES, PAGE, PlanFile, Programs, Robot, Settings};
use glam::DVec3;
use physics::Joints;
use recording::model::RobotModel;
use recording::programs::Axis;
use recording::series::Recording;
use report::{Page, TextLine, Tone};
use serde::Serialize;
use tracing::warn;

use self::setup::{CommaTuple, Setup, corners_m};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{self, Reading};
use crate::options::Seed;
use crate::output::Console;
use crate::pages::Outputs;
use crate::wrap;

/// Number of poses of a calibration where none is given.
const CALIBRATION_POSES: usize = 30;
/// The same of a check.
const CHECK_POSES: usize = 10;
/// Joint positions that round to the same multiple of this are one, rad or m: less than the resolution of any encoder.
const SAME_POSE: f64 = 1e-6;
/// Probability with which a check detects the minimum damage that it states.
const CHECK_POWER: f64 = 0.9;

/// Select the poses to measure: for a calibration, for a check after a collision, for ISO 9283
///
/// Candidate poses are drawn within the joint limits. Poses where a link meets the base, the floor or a box, or where the instrument does not see the target, are
/// discarded. The rest is selected by the information on the parameters that `trued calibrate` fits; measuring frame and unknown targets are estimated along. With
/// recordings, the poses complement the existing measurements. `--next` proposes one pose and states when to stop. `--check` selects ten poses that reveal damage;
/// with a recording of them, it judges whether the model still holds (exit 1 if it does not). `--iso9283` plans or evaluates the test of accuracy and repeatability.
/// Not considered: fixtures and cables that are not described, and the motion between poses.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("somewhere").args(["zone", "iso9283"]).multiple(true)))]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "asked_by" | "out" | "seed" | "json" | "overwrite" | "quiet" | "verbose" | "color" => arg,
    _ => arg.conflicts_with("asked_by"),
}))]
pub(crate) struct Plan {
    #[command(flatten)]
    reading: Reading,
    /// Propose the one pose to measure next, and state whether it is worth measuring
    #[arg(long, conflicts_with_all = ["check", "iso9283", "count", "criterion"])]
    next: bool,
    /// Plan poses that reveal damage, or judge a recording of them
    #[arg(long, conflicts_with = "iso9283")]
    check: bool,
    /// Plan the test of ISO 9283, or evaluate a recording of it
    #[arg(long)]
    iso9283: bool,
    /// Write the experiment that a diagnosis proposes, as a path to be recorded: experiment.csv and experiment.toml. `DIR` is the output folder of `trued diagnose`;
    /// the files are written there, or to `--out`
    #[arg(long = "for", value_name = "DIR")]
    asked_by: Option<PathBuf>,
    #[arg(long, value_name = "N", help = format!("Number of poses, by default {CALIBRATION_POSES}, for a check {CHECK_POSES}; with `--iso9283` the number of cycles, by default {VISITS_REQUIRED}"))]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=500))]
    count: Option<u16>,
    /// Optimality criterion: d: all parameters together; o1: information per reading; zone: the tool's error in `--zone` (by default in the workspace); random: random poses, for validation
    #[arg(long, value_name = "d|o1|zone|random", value_enum, conflicts_with = "iso9283")]
    criterion: Option<PlanCriterion>,
    /// Zone in which the tool's error is minimised, two corners of a box, base frame, mm; with `--iso9283` the cube
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", allow_hyphen_values = true)]
    zone: Option<CommaTuple<6>>,
    /// Direction of the tool's z axis in the zone, base frame; may be repeated
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        default_value = "0,0,-1",
        requires = "somewhere"
    )]
    direction: Vec<CommaTuple<3>>,
    /// Minimum reduction of the tool's expected error by ten more poses for which measuring is still recommended, mm, 0 or above
    #[arg(long, value_name = "MM", default_value_t = 0.003, value_parser = worth_mm, allow_negative_numbers = true)]
    #[arg(requires = "next", conflicts_with_all = ["check", "iso9283", "count", "criterion"])]
    worth_mm: f64,
    /// False alarm rate: the share of undamaged robots that a check calls damaged, above 0 and below 0.5
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    #[arg(requires = "check", conflicts_with_all = ["next", "iso9283"])]
    alarm: f64,
    /// Select from the poses of this recording, which are known to be free of collisions, instead of random candidates
    #[arg(long, value_name = "RECORDING", conflicts_with = "iso9283")]
    among: Option<PathBuf>,
    /// Number of random candidate poses
    #[arg(long, value_name = "N", default_value_t = Settings::default().candidates as u16, conflicts_with_all = ["among", "iso9283"], value_parser = clap::value_parser!(u16).range(20..=5000))]
    candidates: u16,
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    files: Files,
    /// Write the evaluation of a recording (with `--check`, `--iso9283`) as an HTML page
    #[arg(long, value_name = "FILE.html", requires = "recordings", conflicts_with = "next")]
    report: Option<PathBuf>,
    #[command(flatten)]
    seed: Seed,
    /// Existing measurements (with `--check`, `--iso9283`: the measurements to evaluate)
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
}

/// Output folder, and the approach to each pose.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Programs")]
struct Files {
    /// Write poses.csv (to be filled with measurements), poses.mod (ABB RAPID), poses.src and poses.dat (KUKA KRL) to this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Approach to each pose: direct, or both: twice, with all joints from below and from above, to reveal lost motion
    #[arg(
        long,
        value_name = "direct|both",
        value_enum,
        default_value = "both",
        conflicts_with = "iso9283"
    )]
    approach: ApproachDirections,
    /// Distance at which a joint begins its approach, degrees (mm for a linear joint)
    #[arg(long, value_name = "DEG", default_value_t = Programs::default().approach_deg, requires = "out")]
    approach_deg: f64,
    /// Pause at each pose, s
    #[arg(long, value_name = "S", default_value_t = Programs::default().pause_s, requires = "out")]
    pause_s: f64,
    /// Controller axis of each joint, if the order differs: E1,A1,A2,A3,A4,A5,A6
    #[arg(long, value_name = "A,…", value_delimiter = ',', requires = "out")]
    axes: Vec<Axis>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ApproachDirections {
    Direct,
    Both,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum PlanCriterion {
    D,
    O1,
    Zone,
    Random,
}

/// The robot's model and its recordings.
struct Input {
    model: RobotModel,
    recordings: Vec<Recording>,
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if share > 0.0 && share < 0.5 {
        Ok(share)
    } else {
        Err("expected above 0 and below 0.5".to_owned())
    }
}

fn worth_mm(word: &str) -> Result<f64, String> {
    let worth: f64 = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
    if worth.is_finite() && worth >= 0.0 {
        Ok(worth)
    } else {
        Err("expected a length of 0 mm or above".to_owned())
    }
}

impl Plan {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if let Some(diagnosed) = &self.asked_by {
            return self.experiment(diagnosed, console);
        }
        let is_judged = (self.check || self.iso9283) && !self.recordings.is_empty();
        if is_judged {
            self.check_judged()?;
        }
        if self.report.is_some() && !is_judged {
            return Err(Failure::input(
                "--report is the page of an evaluation: give --check or --iso9283 with a recording; the page of planned poses is written to --out",
            ));
        }
        let mut outputs = if is_judged {
            console.outputs().pages(&self.report)
        } else {
            self.files.outputs(console)
        };
        outputs.check(self.recordings.iter().chain(&self.among).chain(self.reading.files()))?;
        let input = self.input()?;
        let robot = Robot { model: &input.model, recordings: &input.recordings };
        if is_judged {
            return if self.check {
                self.judge(robot, console, outputs)
            } else {
                self.evaluate(robot, console, outputs)
            };
        }
        self.plan(robot, console, outputs)
    }

    /// Where a recording is judged no poses are planned: options of planning would do nothing.
    fn check_judged(&self) -> Result<(), Failure> {
        let given = [
            ("--out", self.files.out.is_some()),
            ("--count", self.count.is_some()),
            ("--criterion", self.criterion.is_some()),
            ("--zone", self.zone.is_some()),
            ("--among", self.among.is_some()),
        ];
        let idle: Vec<&str> =
            given.into_iter().filter_map(|(name, is_given)| is_given.then_some(name)).collect();
        if idle.is_empty() {
            return Ok(());
        }
        Err(Failure::input(format!(
            "a recording is judged, no poses are planned: leave out {}, or the recording",
            idle.join(", ")
        )))
    }

    fn input(&self) -> Result<Input, Failure> {
        if !self.recordings.is_empty() {
            let (model, recordings) = self.reading.measured(&self.recordings)?;
            return Ok(Input { model, recordings });
        }
        if self.reading.mapping.is_some() && self.among.is_none() {
            return Err(Failure::input(
                "--mapping is for recordings, and none is given: leave it out, or give a RECORDING",
            ));
        }
        let name = self.reading.model.as_deref().ok_or_else(|| {
            Failure::input("no model is named; give --model MODEL (a file, or a preset of `trued model presets`)")
        })?;
        Ok(Input { model: input::model(name)?, recordings: Vec::new() })
    }

    fn plan(&self, robot: Robot<'_>, console: &mut Console, outputs: Outputs) -> Outcome {
        let settings = self.settings(robot)?;
        let width = wrap::columns_of_stdout();
        let count = |otherwise: usize| self.count.map_or(otherwise, usize::from);
        if self.iso9283 {
            let along = self.directions()?.first().copied().unwrap_or(DVec3::NEG_Z);
            let plan = plans::iso_poses(robot, &settings, along, count(VISITS_REQUIRED))?;
            let result = PlanResult { report: plan.report(), text: plan.text(width) };
            return self.put(console, outputs, &result, || plan.page(), || plan.files());
        }
        if self.check {
            let poses = count(CHECK_POSES);
            let plan =
                plans::check_poses(robot, &settings, &self.terms(), self.criterion(), poses)?;
            let result = PlanResult { report: plan.report(), text: plan.text(width) };
            return self.put(console, outputs, &result, || plan.page(), || plan.files());
        }
        if self.next {
            let plan = plans::next_pose(robot, &settings, self.worth_mm)?;
            let result = PlanResult { report: plan.report(), text: plan.text() };
            return self.put(console, outputs, &result, || plan.page(), || plan.files());
        }
        let poses = count(CALIBRATION_POSES);
        let plan = plans::measuring_poses(robot, &settings, self.criterion(), poses)?;
        let result = PlanResult { report: plan.report(), text: plan.text(width) };
        self.put(console, outputs, &result, || plan.page(), || plan.files())
    }

    fn judge(&self, robot: Robot<'_>, console: &mut Console, mut outputs: Outputs) -> Outcome {
        let setup = self.setup.described(self.files.both_ways())?;
        let judged = plans::test_validity(robot, &setup, &self.terms())?;
        judged.warnings.iter().for_each(|warning| warn!("{warning}"));
        if let Some(report) = &self.report {
            outputs.put_page(report, judged.page());
        }
        console.write(outputs, "trued.plan/1", &judged.report())?;
        console.say_lines(&judged.text(wrap::columns_of_stdout()))?;
        let is_sound = judged.found.holds && judged.found.is_informative();
        Ok(if is_sound { Answer::Done } else { Answer::No })
    }

    fn evaluate(&self, robot: Robot<'_>, console: &mut Console, mut outputs: Outputs) -> Outcome {
        let Robot { model, recordings } = robot;
        let arm = &model.physics.arm;
        let setup = self.setup.described(self.files.both_ways())?;
        let mut campaign = campaign_import::campaign(arm, recordings).map_err(Failure::input)?;
        setup.add_to(&mut campaign);
        let evaluation = Evaluation::of(arm, &campaign).map_err(Failure::input)?;
        if let Some(report) = &self.report {
            outputs.put_page(report, iso9283::page(model, &evaluation));
        }
        console.write(outputs, "trued.plan/1", &iso9283::report(model, &evaluation))?;
        let details = iso9283::details(model, &evaluation, wrap::columns_of_stdout());
        let head = iso9283::headline(&evaluation);
        console.say_lines(&[TextLine::with_head(Tone::Plain, head, details)])?;
        Ok(Answer::Done)
    }

    /// Writes the requested experiment to `--out`, or beside the diagnosis.
    fn experiment(&self, diagnosed: &Path, console: &mut Console) -> Outcome {
        let shown = diagnosed.display();
        let request = read_request(&diagnosed.join("diagnosis.json"))?;
        let model = input::model(&diagnosed.join("model.toml"))?;
        let request = request.ok_or_else(|| {
            Failure::input(format!(
                "{shown}: this diagnosis asks for no experiment: nothing in it is ambiguous, or nothing was measured that an experiment could show"
            ))
        })?;
        let experiment = request.experiment(&model.physics.arm).ok_or_else(|| {
            Failure::input(format!(
                "{shown}: asks for the experiment `{}`, which this version does not know: diagnose again",
                request.name
            ))
        })?;
        let out = self.files.out.as_deref().unwrap_or(diagnosed);
        let [list, about] = experiment::FILES.map(|name| out.join(name));
        let recording = experiment.recording();
        let mut outputs = console.outputs().in_folder(out);
        outputs.put(&about, recording.about_toml());
        outputs.put(&list, recording.to_csv());
        let files = [list, about].map(|path| path.display().to_string());
        console.write(outputs, "trued.plan/1", &experiment.report(files.clone()))?;
        console.say_lines(&experiment.text(&files))?;
        Ok(Answer::Done)
    }

    /// Writes a plan: JSON, page and files, all or none, and says it.
    fn put<R: Serialize>(
        &self,
        console: &mut Console,
        mut outputs: Outputs,
        result: &PlanResult<R>,
        page: impl FnOnce() -> Page,
        files: impl FnOnce() -> Result<Vec<PlanFile>, Error>,
    ) -> Outcome {
        if let Some(out) = &self.files.out {
            for file in files()? {
                outputs.put(&out.join(file.name), file.bytes);
            }
            outputs.put_page(&out.join(PAGE), page());
        }
        console.write(outputs, "trued.plan/1", &result.report)?;
        console.say_lines(&result.text)?;
        Ok(Answer::Done)
    }

    fn settings(&self, robot: Robot<'_>) -> Result<Settings, Failure> {
        let Files { out, approach_deg, pause_s, axes, .. } = self.files.clone();
        let usual = Settings::default();
        Ok(Settings {
            setup: self.setup.described(self.files.both_ways())?,
            zone: self.zone()?,
            candidate_poses: self.candidate_poses(robot)?,
            candidates: usize::from(self.candidates),
            seed: self.seed.resolve(),
            programs: Programs { approach_deg, pause_s, axes },
            model_path: self.reading.model.clone().unwrap_or(usual.model_path),
            out,
        })
    }

    fn terms(&self) -> ErrorRates {
        ErrorRates { alarm: self.alarm, power: CHECK_POWER }
    }

    fn criterion(&self) -> Criterion {
        let fallback = if self.zone.is_some() { PlanCriterion::Zone } else { PlanCriterion::D };
        match self.criterion.unwrap_or(fallback) {
            PlanCriterion::D => Criterion::D,
            PlanCriterion::O1 => Criterion::O1,
            PlanCriterion::Zone => Criterion::Zone,
            PlanCriterion::Random => Criterion::Random,
        }
    }

    fn zone(&self) -> Result<Option<WorkingZone>, Failure> {
        let Some(corners) = &self.zone else { return Ok(None) };
        Ok(Some(WorkingZone { corners: corners_m(corners), directions: self.directions()? }))
    }

    fn directions(&self) -> Result<Vec<DVec3>, Failure> {
        let unit = |direction: &CommaTuple<3>| {
            let found = DVec3::from_array(direction.0).try_normalize();
            found.ok_or_else(|| Failure::input("--direction: expected a direction, found 0,0,0"))
        };
        self.direction.iter().map(unit).collect()
    }

    /// The poses to choose from; none where they are drawn.
    fn candidate_poses(&self, robot: Robot<'_>) -> Result<Vec<Joints>, Failure> {
        let Some(list) = &self.among else { return Ok(Vec::new()) };
        let found = self.reading.read(list, self.reading.model.as_deref())?.recording;
        let joints = 0..robot.model.physics.arm.count();
        let position = |row: usize, joint: usize| found.input(joint).map_or(f64::NAN, |q| q[row]);
        let poses = (0..found.len()).map(|row| {
            let mut q = Joints::default();
            joints.clone().for_each(|joint| q[joint] = position(row, joint));
            q
        });
        Ok(distinct(poses.filter(|q| q.iter().all(|q| q.is_finite()))))
    }
}

/// Each pose once, in order: one that is approached from both sides is in two rows of a recording.
fn distinct(poses: impl Iterator<Item = Joints>) -> Vec<Joints> {
    let mut known = BTreeSet::new();
    let place = |q: &Joints| q.map(|q| (q / SAME_POSE).round() as i64);
    poses.filter(|q| known.insert(place(q))).collect()
}

/// Results of a plan.
struct PlanResult<R> {
    report: R,
    text: Vec<TextLine>,
}

impl Files {
    /// Whether each pose is measured twice.
    fn both_ways(&self) -> bool {
        self.approach == ApproachDirections::Both
    }

    /// The output files of the poses, if requested.
    fn outputs(&self, console: &Console) -> Outputs {
        let Some(out) = &self.out else { return console.outputs() };
        let outputs = console.outputs().in_folder(out).page(out.join(PAGE));
        FILES.into_iter().fold(outputs, |outputs, name| outputs.file(out.join(name)))
    }
}

fn read_request(path: &Path) -> Result<Option<Request>, Failure> {
    let shown = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| {
        Failure::input(format!(
            "{shown}: cannot be read: {error}; expected what `trued diagnose` wrote"
        ))
    })?;
    Request::parse(&text).map_err(|error| Failure::input(format!("{shown}: {error}")))
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    use experiment::ExperimentReport;
    use plans::{CheckReport, IsoReport, NextReport, PosesReport, ValidityReport};
    vec![
        ResultSchema::of::<CheckReport<'_>>("plan-check", "trued.plan/1"),
        ResultSchema::of::<ValidityReport<'_>>("plan-check-judged", "trued.plan/1"),
        ResultSchema::of::<IsoReport<'_>>("plan-iso9283", "trued.plan/1"),
        ResultSchema::of::<iso9283::EvaluationReport<'_>>("plan-iso9283-evaluated", "trued.plan/1"),
        ResultSchema::of::<PosesReport<'_>>("plan-poses", "trued.plan/1"),
        ResultSchema::of::<NextReport<'_>>("plan-next", "trued.plan/1"),
        ResultSchema::of::<ExperimentReport<'_>>("plan-experiment", "trued.plan/1"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_that_is_approached_from_both_sides_is_one_pose_to_choose() {
        let pose = |first: f64| {
            let mut q = Joints::default();
            q[0] = first;
            q
        };
        let rows = [0.1, 0.1, 0.2, 0.2 + 1e-9, 0.1, 0.3].map(pose);
        assert_eq!(distinct(rows.into_iter()), [0.1, 0.2, 0.3].map(pose));
    }
}
