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
use report::{
    Axis, Bars, Cell, Column, Number, Page, Table, TextTable, Tone, fixed, pluralise, significant,
};
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

/// The page of an evaluation.
#[must_use]
pub fn page(model: &RobotModel, evaluation: &Evaluation) -> Page {
    let poses = &evaluation.poses;
    let with_accuracy = evaluation.has_accuracy();
    let worst = |of: fn(&EvaluatedPose) -> f64| MILLI * poses.iter().map(of).fold(0.0, f64::max);
    let repeatability_mm = worst(|pose| pose.figures.repeatability_m);
    let accuracy_mm = with_accuracy.then(|| worst(|pose| pose.figures.accuracy_m));
    let accuracy = accuracy_mm.map_or("The accuracy was not evaluated".to_owned(), |mm| {
        format!("The pose accuracy (AP) is {} mm or better", significant(mm, 3))
    });
    let sentence = format!(
        "{accuracy}, the repeatability (RP) {} mm or better, over {}.",
        significant(repeatability_mm, 3),
        pluralise(poses.len(), "pose")
    );
    let open = notes(evaluation);
    let (tone, label) = if open.is_empty() {
        (Tone::Plain, "evaluated by ISO 9283")
    } else {
        (Tone::Caution, "evaluated by ISO 9283 in part")
    };
    let mut page = Page::new(format!("Accuracy and repeatability of {}", model.file.name))
        .kicker("trued plan --iso9283")
        .robot(model.file.identity().to_string())
        .verdict(tone, label, &sentence)
        .numbers(key_numbers(evaluation, repeatability_mm, accuracy_mm))
        .figure("Accuracy (AP) and repeatability (RP) of each test pose.", &bars(evaluation));
    page = if with_accuracy {
        page.next(
            "Compare with the robot's data sheet. Calibrate the robot if its accuracy is not sufficient: repeatability limits what a calibration can reach.",
            Some("trued plan --model MODEL.toml --out poses"),
        )
    } else {
        page.next(
            "State where the target is on the tool, and measure in the base frame, to evaluate the accuracy too.",
            Some("trued plan --iso9283 --model MODEL.toml --frame-known --target X,Y,Z --targets-known RECORDING.csv"),
        )
    };
    for note in &open {
        page = page.note(Tone::Caution, "Not as the standard requires", &report::capitalised(note));
    }
    page.section("Test poses").table(&pose_table(model, evaluation))
}

fn key_numbers(
    evaluation: &Evaluation,
    repeatability_mm: f64,
    accuracy_mm: Option<f64>,
) -> Vec<Number> {
    let visits = evaluation.poses.iter().map(|pose| pose.figures.visits).min().unwrap_or(0);
    let mut numbers = vec![
        Number::new("Repeatability RP, worst", repeatability_mm, "mm"),
        Number::new("Accuracy AP, worst", accuracy_mm.unwrap_or(f64::NAN), "mm"),
    ];
    if let Some(distance) = evaluation.distance {
        let note =
            format!("± {} mm repeatability", significant(MILLI * distance.repeatability_m, 2));
        let accuracy = Number::new("Distance accuracy", MILLI * distance.accuracy_m, "mm");
        numbers.push(accuracy.note(note));
    }
    let required = format!("{VISITS_REQUIRED} required");
    numbers.push(Number::text("Visits of each pose", visits.to_string()).note(required));
    numbers
}

fn bars(evaluation: &Evaluation) -> report::Svg {
    let with_accuracy = evaluation.has_accuracy();
    let groups: &[&str] =
        if with_accuracy { &["accuracy AP", "repeatability RP"] } else { &["repeatability RP"] };
    let start = Bars::new("Test poses", Axis::new("Error", "mm")).groups(groups.iter().copied());
    let rows = evaluation.poses.iter().enumerate();
    rows.fold(start, |bars, (place, EvaluatedPose { figures, .. })| {
        let accuracy = with_accuracy.then_some(MILLI * figures.accuracy_m);
        let values = accuracy.into_iter().chain([MILLI * figures.repeatability_m]);
        bars.row(format!("pose {}", place + 1), values)
    })
    .render()
}

fn pose_table(model: &RobotModel, evaluation: &Evaluation) -> Table {
    let heads = ["Pose", "Joints, deg (mm)", "Visits", "AP (mm)", "RP (mm)"].map(Column::new);
    let with_accuracy = evaluation.has_accuracy();
    let rows = evaluation.poses.iter().enumerate();
    rows.fold(
        Table::new("Each test pose, in the order of the recording", heads),
        |table, (place, one)| {
            let figures = &one.figures;
            let accuracy_mm = if with_accuracy { MILLI * figures.accuracy_m } else { f64::NAN };
            table.row([
                Cell::from((place + 1).to_string()),
                joint_positions_text(&model.physics.arm, &one.visits.q).into(),
                Cell::from(figures.visits as f64),
                accuracy_mm.into(),
                (MILLI * figures.repeatability_m).into(),
            ])
        },
    )
}

/// The result as text, its table at most `width_max` characters wide.
#[must_use]
pub fn text(model: &RobotModel, evaluation: &Evaluation, width_max: Option<usize>) -> String {
    headline(evaluation) + &details(model, evaluation, width_max)
}
