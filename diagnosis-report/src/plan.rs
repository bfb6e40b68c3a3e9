//! Plans of measuring poses for people and programs: `trued.plan/1` as JSON, text, HTML page, and files for controller and measurements.
//!
//! [`measuring_poses`] chooses the poses of a calibration, [`next_pose`] one more and whether it is worth measuring, [`check_poses`] poses that
//! detect damage, [`iso_poses`] the test of ISO 9283. [`test_validity`] tests whether a model is still valid, [`crate::iso9283`] evaluates accuracy and
//! repeatability, [`experiment`] writes the experiment proposed by a diagnosis. Computation: [`diagnosis::plan`]. Modules in reading order: `poses`,
//! `next`, `check`, `validity`, `iso`, `experiment` (one result each), `page` and `files` (common to plans).
//!
//! The same model, recordings and seed give the same bytes. Writes no file.

mod check;
pub mod experiment;
mod files;
mod iso;
mod next;
mod page;
mod poses;
mod validity;

pub use check::{CheckPlan, CheckReport, check_poses};
pub use files::{FILES, LIST, PAGE, PlanFile, Programs};
pub use iso::{IsoPlan, IsoReport, iso_poses};
pub use next::{NextPlan, NextReport, next_pose};
pub use poses::{PosesPlan, PosesReport, measuring_poses};
pub use validity::{ValidityReport, ValidityTest, test_validity};

use std::path::{Path, PathBuf};

use diagnosis::plan::check::{Damage, DetectableDamage};
use diagnosis::plan::setup::MeasuringSetup;
use diagnosis::plan::starting_point::StartingPoint;
use diagnosis::plan::working_zone::WorkingZone;
use diagnosis::plan::{Criterion, MeasurementKind, PlanSettings};
use physics::{Joints, Model};
use recording::model::RobotModel;
use recording::series::Recording;
use report::{TextLine, shell_word, significant};
use serde::Serialize;

use crate::error::Error;

/// Number of poses at which the tool's error is evaluated. Origin: a choice; the standard error of the mean is a ninth of their scatter.
const TOOL_POSES: usize = 80;
/// mm per m, mrad per rad.
const MILLI: f64 = 1e3;

/// A robot with its existing measurements.
#[derive(Clone, Copy, Debug)]
pub struct Robot<'a> {
    /// Its model.
    pub model: &'a RobotModel,
    /// Measurements; may be empty.
    pub recordings: &'a [Recording],
}

/// Settings of a plan.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Instrument, targets, constraints.
    pub setup: MeasuringSetup,
    /// Region in which the tool's error is evaluated. Default: none, so that it is the whole workspace.
    pub zone: Option<WorkingZone>,
    /// Candidate poses, such as poses known to be collision-free, rad or m. Default: none, so that poses are drawn at random.
    pub candidate_poses: Vec<Joints>,
    /// Number of candidate poses that are drawn; 20 to 5000. Default 600. Origin: a choice.
    pub candidates: usize,
    /// Seed of all random draws. Default 0.
    pub seed: u64,
    /// Motion between the poses, and axes of the controller.
    pub programs: Programs,
    /// Path of the model in the commands shown. Default `ROBOT.toml`.
    pub model_path: PathBuf,
    /// Folder of the files, for the texts. Default: none.
    pub out: Option<PathBuf>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            setup: MeasuringSetup::default(),
            zone: None,
            candidate_poses: Vec::new(),
            candidates: 600,
            seed: 0,
            programs: Programs::default(),
            model_path: PathBuf::from("ROBOT.toml"),
            out: None,
        }
    }
}

impl Settings {
    /// The starting point of the plan, without poses for the evaluation of the tool's error.
    fn start(&self, robot: Robot<'_>) -> Result<StartingPoint, Error> {
        let Robot { model, recordings } = robot;
        let mut start = StartingPoint::of(model, recordings, &self.setup).map_err(Error::input)?;
        start.task.given_poses.clone_from(&self.candidate_poses);
        Ok(start)
    }

    /// The starting point of the plan.
    fn start_with_zone(&self, robot: Robot<'_>) -> Result<StartingPoint, Error> {
        let mut start = self.start(robot)?;
        let chance = self.seed.wrapping_add(1);
        let task = &mut start.task;
        task.test_poses = match &self.zone {
            None => task.workspace(TOOL_POSES, chance),
            Some(zone) => zone.positions(&robot.model.physics.arm, &task.reach, TOOL_POSES, chance),
        };
        if task.test_poses.is_empty() {
            return Err(Error::input(match self.zone {
                Some(_) => {
                    "the arm reaches nothing of the zone in these directions: check --zone (mm, base frame), --direction, and what bars it"
                }
                None => {
                    "the arm is free in no pose within its joint limits: check what bars it (--keep-out, --floor-mm, --margin-deg, --link-radius-mm, --base-radius-mm)"
                }
            }));
        }
        Ok(start)
    }

    fn plan_settings(&self, count: usize, criterion: Criterion) -> PlanSettings {
        let candidates = self.candidates.max(4 * count);
        PlanSettings { count, criterion, candidates, seed: self.seed }
    }

    /// The region in which the tool's error is evaluated, as part of a sentence.
    fn region(&self) -> &'static str {
        if self.zone.is_some() { "in the zone" } else { "over the workspace" }
    }

    /// The command that evaluates the completed list.
    fn evaluation_command(&self, command: &str, options: &str) -> String {
        let list = self.out.as_deref().unwrap_or(Path::new("")).join(LIST);
        let [model, list] =
            [&self.model_path, &list].map(|path| shell_word(&path.display().to_string()));
        format!("trued {command} --model {model} {options}{list}")
    }

    /// Instructions for the poses of a calibration, and the command that evaluates the measurements.
    fn calibration_steps(&self) -> (&'static str, String) {
        let instruction = "Load the program and run it slowly first; then measure, fill the readings into poses.csv, and calibrate.";
        (instruction, self.evaluation_command("calibrate", "--out calibrated.toml "))
    }

    /// Constraints that were not checked, one sentence each.
    fn not_checked(&self, sees: &MeasurementKind) -> Vec<&'static str> {
        let bodies = if self.setup.keep_out.is_empty() {
            "fixtures, cables and the tool's body: describe them as boxes with --keep-out"
        } else {
            "fixtures, cables and the tool's body outside the boxes"
        };
        let mut open = vec!["the way between two poses: try the program slowly first", bodies];
        if matches!(sees, MeasurementKind::Points { .. }) && self.setup.instrument_base_m.is_none()
        {
            open.push(
                "whether the instrument sees the target: say where it stands with --instrument",
            );
        }
        open
    }

    /// The last lines of a text: constraints that were not checked, and the location of the files.
    fn closing(&self, not_checked: &[&str]) -> impl Iterator<Item = TextLine> {
        let open = not_checked.iter().map(|open| TextLine::from(format!("not checked: {open}")));
        let written = self.out.as_ref().map(|out| {
            let out = out.display();
            TextLine::from(format!("written: {out}/poses.csv with poses.toml (fill in what is measured), poses.mod, poses.src, poses.dat"))
        });
        open.chain(written).collect::<Vec<_>>().into_iter()
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct DetectableReport {
    damage: String,
    unit: &'static str,
    least: Option<f64>,
}

impl DetectableReport {
    fn of(model: &Model, found: &DetectableDamage) -> Self {
        let minimum = found.least.map(|minimum| MILLI * minimum);
        Self {
            damage: found.damage.says(),
            unit: damage_unit(model, &found.damage),
            least: minimum,
        }
    }

    fn all(model: &Model, found: &[DetectableDamage]) -> Vec<Self> {
        found.iter().map(|one| Self::of(model, one)).collect()
    }
}

fn damage_unit(model: &Model, damage: &Damage) -> &'static str {
    if damage.is_angle(model) { "mrad" } else { "mm" }
}

/// The minimum detectable change with its unit.
fn minimum_detectable(model: &Model, found: &DetectableDamage) -> String {
    found.least.map_or("not detectable: absorbed by the fitted parameters".to_owned(), |minimum| {
        format!("{} {}", significant(MILLI * minimum, 2), damage_unit(model, &found.damage))
    })
}

/// The damage that check poses can detect, as a text table.
fn detectable_table(
    model: &Model,
    detectable: &[DetectableDamage],
    width_max: Option<usize>,
) -> String {
    let start = report::TextTable::new(["damage", "minimum detectable change"]);
    let table = detectable.iter().fold(start, |table, found| {
        table.row([found.damage.says(), minimum_detectable(model, found)])
    });
    table.render(width_max)
}

/// The assumptions made where nothing was stated.
fn assumptions(robot: Robot<'_>) -> Vec<String> {
    let mut list = Vec::new();
    let Robot { model, recordings } = robot;
    if !model.sigma.iter().flatten().any(|sigma| *sigma > 0.0) {
        list.push(format!("{} states no uncertainty: it is taken as exact", model.file.name));
    }
    for recording in recordings.iter().filter(|recording| recording.metadata.sigma.is_empty()) {
        let file = recording.file.display();
        list.push(format!("{file}: no `sigma` is stated: 0.05 mm is taken"));
    }
    list
}
