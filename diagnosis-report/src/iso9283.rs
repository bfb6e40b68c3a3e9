//! Pose accuracy and repeatability of a recording (ISO 9283) for people and programs: `trued.plan/1` as JSON, lines of text.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use diagnosis::campaign_import;
//! use diagnosis::plan::iso::Evaluation;
//! use diagnosis_report::iso9283;
//! use recording::model::RobotModel;
//! use recording::series::{RequiredData, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let model = RobotModel::read(Path::new("arm.toml"))?;
//! let visits = read(Path::new("visits.csv"), None, RequiredData::Measurement)?;
//! let campaign = campaign_import::campaign(&model.physics.arm, &[visits])?;
//! let evaluation = Evaluation::of(&model.physics.arm, &campaign)?;
//! for pose in &evaluation.poses {
//!     println!("{} visits, {:.3} mm", pose.figures.visits, 1e3 * pose.figures.repeatability_m);
//! }
//! println!("{}", iso9283::text(&model, &evaluation, None));
//! println!("{}", iso9283::json(&model, &evaluation)?);
//! # Ok(())
//! # }
//! ```

use std::collections::BTreeMap;

use diagnosis::plan::iso::{EvaluatedPose, Evaluation, VISITS_REQUIRED};
use glam::DVec3;
use physics::Arm;
use recording::model::RobotModel;
use recording::program;
use report::{TextTable, fixed, pluralise};
use serde::Serialize;

use crate::error::Error;
use crate::positions::{columns, joint_positions_text};

/// mm per m, mrad per rad.
const MILLI: f64 = 1e3;

/// Accuracy and repeatability: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EvaluationReport<'a> {
    does: &'static str,
    model: &'a str,
    is_frame_known: bool,
    poses: Vec<PoseReport>,
    distance: Option<DistanceReport>,
    notes: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PoseReport {
    #[serde(flatten)]
    q: BTreeMap<String, f64>,
    visits: usize,
    accuracy_mm: Option<f64>,
    accuracy_xyz_mm: Option<[f64; 3]>,
    accuracy_abc_mrad: Option<[f64; 3]>,
    repeatability_mm: f64,
    repeatability_abc_mrad: Option<[f64; 3]>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct DistanceReport {
    visits: usize,
    accuracy_mm: f64,
    repeatability_mm: f64,
}

/// The result as an object.
#[must_use]
pub fn report<'a>(model: &'a RobotModel, evaluation: &Evaluation) -> EvaluationReport<'a> {
    let arm = &model.physics.arm;
    let with_accuracy = evaluation.has_accuracy();
    let poses = evaluation.poses.iter();
    EvaluationReport {
        does: "iso9283",
        model: &model.file.name,
        is_frame_known: evaluation.is_frame_known,
        poses: poses.map(|pose| PoseReport::of(arm, pose, with_accuracy)).collect(),
        distance: evaluation.distance.map(|distance| DistanceReport {
            visits: distance.visits,
            accuracy_mm: MILLI * distance.accuracy_m,
            repeatability_mm: MILLI * distance.repeatability_m,
        }),
        notes: notes(evaluation),
    }
}

/// The result as JSON.
///
/// # Errors
/// [`Error::Internal`]
pub fn json(model: &RobotModel, evaluation: &Evaluation) -> Result<String, Error> {
    let text =
        program::json("trued.plan/1", &report(model, evaluation)).map_err(Error::internal)?;
    Ok(text + "\n")
}

impl PoseReport {
    fn of(arm: &Arm, pose: &EvaluatedPose, with_accuracy: bool) -> Self {
        let figures = &pose.figures;
        let milli = |v: DVec3| (MILLI * v).to_array();
        Self {
            q: columns(arm, &pose.visits.q),
            visits: figures.visits,
            accuracy_mm: with_accuracy.then_some(MILLI * figures.accuracy_m),
            accuracy_xyz_mm: with_accuracy.then(|| milli(figures.accuracy_xyz_m)),
            accuracy_abc_mrad: figures.accuracy_abc_rad.filter(|_| with_accuracy).map(milli),
            repeatability_mm: MILLI * figures.repeatability_m,
            repeatability_abc_mrad: figures.repeatability_abc_rad.map(milli),
        }
    }
}

/// Requirements of the standard that this recording does not meet.
fn notes(evaluation: &Evaluation) -> Vec<String> {
    let mut notes = Vec::new();
    if !evaluation.has_accuracy() {
        notes.push("accuracy not evaluated: it requires measurements in the base frame (`measuring_frame = \"base\"`, --frame-known) and the target's position on the tool (`target1_mm`); a fitted frame would hide the error".to_owned());
    }
    if !evaluation.has_all_visits() {
        notes.push(format!("the standard requires {VISITS_REQUIRED} visits of each pose"));
    }
    notes
}

/// Summary: the largest repeatability.
#[must_use]
pub fn headline(evaluation: &Evaluation) -> String {
    let worst =
        evaluation.poses.iter().map(|pose| pose.figures.repeatability_m).fold(0.0, f64::max);
    format!("repeatability {} mm", fixed(MILLI * worst, 3))
}

/// The text after the [`headline`]: the largest accuracy error, and a table of the poses, at most `width_max` characters wide.
#[must_use]
pub fn details(model: &RobotModel, evaluation: &Evaluation, width_max: Option<usize>) -> String {
    let with_accuracy = evaluation.has_accuracy();
    let poses = &evaluation.poses;
    let mut text = String::new();
    if with_accuracy {
        let worst = poses.iter().map(|pose| pose.figures.accuracy_m).fold(0.0, f64::max);
        text += &format!(", accuracy {} mm", fixed(MILLI * worst, 3));
    }
    text += &format!(" (worst of {})\n", pluralise(poses.len(), "pose"));
    let mut table = TextTable::new(["joints, deg (mm)", "visits", "AP, mm", "RP, mm"]);
    for EvaluatedPose { visits, figures } in poses {
        let accuracy =
            if with_accuracy { fixed(MILLI * figures.accuracy_m, 3) } else { "–".to_owned() };
        table = table.row([
            joint_positions_text(&model.physics.arm, &visits.q),
            figures.visits.to_string(),
            accuracy,
            fixed(MILLI * figures.repeatability_m, 3),
        ]);
    }
    text += &table.render(width_max);
    if let Some(found) = evaluation.distance {
        text += &format!(
            "distance between the two most distant poses: accuracy {} mm, repeatability ±{} mm\n",
            fixed(MILLI * found.accuracy_m, 3),
            fixed(MILLI * found.repeatability_m, 3)
        );
    }
    notes(evaluation).iter().for_each(|note| text += &format!("note: {note}\n"));
    text
}

/// The result as text, its table at most `width_max` characters wide.
#[must_use]
pub fn text(model: &RobotModel, evaluation: &Evaluation, width_max: Option<usize>) -> String {
    headline(evaluation) + &details(model, evaluation, width_max)
}
