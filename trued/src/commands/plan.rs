//! `trued plan`: selection of measuring poses, their contributions and the stopping rule; ten check poses; the test of ISO 9283.
//!
//! Every pose is inside the joint limits, visible to the instrument as described, and free of the
//! described obstacles; what is not checked is stated. Inputs are not overwritten, and no robot is
//! moved.

mod check;
mod files;
mod going;
mod iso;
mod page;
mod request;
mod setup;
mod told;

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis::plan::zone::Zone;
use diagnosis::plan::{Criterion, Known, Wish, next, plan};
use glam::DVec3;
use physics::Joints;
use recording::model::RobotModel;
use recording::series::Recording;

use self::files::Files;
use self::going::Going;
use self::setup::{Setup, Tuple};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{self, Reading};
use crate::options::Seed;
use crate::output::Console;

/// Number of poses at which the tool's error is evaluated.
const ASKED: usize = 80;

/// Choose the poses to measure next: for a calibration, for a check after a collision, for ISO 9283
///
/// Poses are drawn inside the joint limits, left out where a link meets base, floor or a box or the instrument does not see the target, and chosen by what they
/// tell of the numbers that `trued calibrate` finds; the measuring frame and unknown targets are found along and count for nothing. With recordings the poses
/// complement what was measured. `--next` names one pose and says when it is enough. `--check` chooses ten poses in which damage would show, and with a
/// recording of them judges whether the model still holds (exit 1 where it does not). `--iso9283` plans or evaluates accuracy and repeatability. Not looked at:
/// fixtures and cables that are not described, and the way between poses.
#[derive(Debug, Args)]
pub(crate) struct Plan {
    #[command(flatten)]
    reading: Reading,
    /// Name the one pose to measure next, and say whether it is worth it
    #[arg(long, conflicts_with_all = ["check", "iso9283", "count", "criterion"])]
    next: bool,
    /// Plan poses that show damage, or judge a recording of them
    #[arg(long, conflicts_with = "iso9283")]
    check: bool,
    /// Plan the test of ISO 9283, or evaluate a recording of it
    #[arg(long)]
    iso9283: bool,
    /// Write the experiment that a diagnosis asks for, as a path to be recorded: `DIR` is what `trued diagnose` wrote; experiment.csv and experiment.toml go there,
    /// or to `--out`
    #[arg(long = "for", value_name = "DIR", conflicts_with_all = ["next", "check", "iso9283", "count", "criterion", "recordings"])]
    asked_by: Option<PathBuf>,
    /// How many poses; 30, for a check 10; for ISO 9283 the cycles, 30
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=500))]
    count: Option<u16>,
    /// Best for what: all numbers together, each reading, or the tool in `--zone` (without one: in the workspace); or by chance, for validation
    #[arg(long, value_name = "d|o1|zone|random", value_enum)]
    criterion: Option<Best>,
    /// Where the tool's error counts, base frame, mm; for ISO 9283 the cube
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", allow_hyphen_values = true)]
    zone: Option<Tuple<6>>,
    /// Direction of the tool's z axis there, base frame; may be repeated
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, default_value = "0,0,-1")]
    direction: Vec<Tuple<3>>,
    /// What ten more poses have to take off the tool's expected error to be worth measuring, mm
    #[arg(long, value_name = "MM", default_value_t = 0.003, requires = "next")]
    worth_mm: f64,
    /// Share of sound robots that a check calls damaged
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    alarm: f64,
    /// Choose only from the poses of this recording, as those that are known to be free, instead of drawing them
    #[arg(long, value_name = "RECORDING")]
    among: Option<PathBuf>,
    /// Poses that are drawn to choose from
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u16).range(20..=5000))]
    candidates: u16,
    #[command(flatten)]
    setup: Setup,
    #[command(flatten)]
    files: Files,
    #[command(flatten)]
    seed: Seed,
    /// What was measured so far (with `--check`, `--iso9283`: what is judged)
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Best {
    D,
    O1,
    Zone,
    Random,
}

/// The robot and its measurements.
struct Input {
    model: RobotModel,
    recordings: Vec<Recording>,
}

fn share(word: &str) -> Result<f64, String> {
    let share: f64 = word.parse().map_err(|_| format!("`{word}` is no number"))?;
    if share > 0.0 && share < 0.5 {
        Ok(share)
    } else {
        Err("expected above 0 and below 0.5".to_owned())
    }
}

impl Plan {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        if let Some(diagnosed) = &self.asked_by {
            return request::run(diagnosed, self.files.out(), console);
        }
        let is_judged = (self.check || self.iso9283) && !self.recordings.is_empty();
        let mut outputs = if is_judged { console.outputs() } else { self.files.outputs(console) };
        outputs.check(self.recordings.iter().chain(&self.among).chain(self.reading.files()))?;
        let input = self.input()?;
        if self.iso9283 {
            return iso::run(self, console, outputs, &input);
        }
        if self.check {
            return check::run(self, console, outputs, &input);
        }
        let seed = self.seed.settle();
        let going = self.going(&input, seed)?;
        let known = going.known.as_ref().map(|(campaign, fit)| Known { campaign, fit });
        if self.next {
            let worth_m = 1e-3 * self.worth_mm;
            let found = next(&going.task, known, usize::from(self.candidates), worth_m, seed)
                .map_err(Failure::input)?;
            self.files.put(&mut outputs, &input.model, &going.task, &[found.pose.q])?;
            told::next(self, console, outputs, &input, &going, &found, seed)?;
            return Ok(Answer::Done);
        }
        let wish = self.wish(30, seed);
        let planned = plan(&going.task, known, &wish).map_err(Failure::input)?;
        let stops: Vec<_> = planned.poses.iter().map(|pose| pose.q).collect();
        self.files.put(&mut outputs, &input.model, &going.task, &stops)?;
        told::plan(self, console, outputs, &input, &going, &planned, seed)?;
        Ok(Answer::Done)
    }

    fn input(&self) -> Result<Input, Failure> {
        if !self.recordings.is_empty() {
            let (model, recordings) = self.reading.measured(&self.recordings)?;
            return Ok(Input { model, recordings });
        }
        let name = self.reading.model.as_deref().ok_or_else(|| {
            Failure::input("no model is named; give --model MODEL (a file, or a preset of `trued model presets`)")
        })?;
        Ok(Input { model: input::model(name)?, recordings: Vec::new() })
    }

    fn wish(&self, count: usize, seed: u64) -> Wish {
        let fallback = if self.zone.is_some() { Best::Zone } else { Best::D };
        let criterion = match self.criterion.unwrap_or(fallback) {
            Best::D => Criterion::D,
            Best::O1 => Criterion::O1,
            Best::Zone => Criterion::Zone,
            Best::Random => Criterion::Random,
        };
        let count = self.count.map_or(count, usize::from);
        Wish { count, criterion, candidates: usize::from(self.candidates).max(4 * count), seed }
    }

    fn directions(&self) -> Result<Vec<DVec3>, Failure> {
        let unit = |direction: &Tuple<3>| {
            let found = DVec3::from_array(direction.0).try_normalize();
            found.ok_or_else(|| Failure::input("--direction: expected a direction, found 0,0,0"))
        };
        self.direction.iter().map(unit).collect()
    }

    /// What to do with the poses of a calibration, and the command that evaluates the measurements.
    fn to_calibrate(&self) -> (&'static str, String) {
        let words = "Load the program and run it slowly first; then measure, fill the readings into poses.csv, and calibrate.";
        (words, self.measured_by("calibrate", "--out calibrated.toml "))
    }

    /// A command of this robot over the list that was filled in.
    fn measured_by(&self, command: &str, options: &str) -> String {
        let model = self.reading.model.as_deref().unwrap_or(Path::new("ROBOT.toml"));
        format!(
            "trued {command} --model {} {options}{}",
            model.display(),
            self.files.list().display()
        )
    }

    /// The task without the poses at which the tool's error counts.
    fn set_up(&self, input: &Input) -> Result<Going, Failure> {
        let mut going = Going::of(&self.setup, &self.files, input)?;
        if let Some(list) = &self.among {
            let found = self.reading.read(list, self.reading.model.as_deref())?;
            let joints = 0..input.model.physics.arm.count();
            let position = |row: usize, joint: usize| {
                found.recording.input(joint).map_or(f64::NAN, |q| q[row])
            };
            let poses = (0..found.recording.len()).map(|row| {
                let mut q = Joints::default();
                joints.clone().for_each(|joint| q[joint] = position(row, joint));
                q
            });
            going.task.among = poses.filter(|q| q.iter().all(|q| q.is_finite())).collect();
        }
        Ok(going)
    }

    /// What is to be planned, and what is known so far.
    fn going(&self, input: &Input, seed: u64) -> Result<Going, Failure> {
        let mut going = self.set_up(input)?;
        let chance = seed.wrapping_add(1);
        let task = &mut going.task;
        task.asked = match self.zone {
            None => task.workspace(ASKED, chance),
            Some(Tuple([a, b, c, d, e, f])) => {
                let (one, other) = (1e-3 * DVec3::new(a, b, c), 1e-3 * DVec3::new(d, e, f));
                let zone = Zone {
                    corners: [one.min(other), one.max(other)],
                    directions: self.directions()?,
                };
                zone.positions(&input.model.physics.arm, &task.reach, ASKED, chance)
            }
        };
        if task.asked.is_empty() {
            return Err(Failure::input(
                "the arm reaches nothing of the zone in these directions: check --zone (mm, base frame), --direction, and what bars it",
            ));
        }
        Ok(going)
    }
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    let several = [check::result_schemas(), iso::result_schemas(), told::result_schemas()];
    several.into_iter().flatten().chain([request::result_schema()]).collect()
}
