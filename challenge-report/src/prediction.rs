//! Evaluation of a written model on an unseen motion: predicted as in a simulation ([`diagnosis::recording_simulation`]).
//!
//! A model that is missing or does not load counts as the given model. Nothing is fitted here.

use challenge::arm::JOINTS;
use challenge::case::PositionCase;
use challenge::case_files;
use challenge::evaluation::{Evaluation, Predicted};
use challenge::scene::Scene;
use challenge::score::PredictionErrors;
use challenge::transform::{IDENTITY, Transform, Vector3};
use challenge::{force, torque};
use diagnosis::recording_simulation;
use recording::model::RobotModel;
use recording::series::{self, RecordingMetadata, RequiredData};
use world::forward::ArmState;

/// Rows per second on which torques are predicted.
const FINE_HZ: f64 = 2000.0;

/// The errors of a case with a hidden effect; `None` for a null case.
pub(crate) fn of_positions(case: &PositionCase, model: Option<&str>) -> Option<PredictionErrors> {
    if case.hidden.is_empty() {
        return None;
    }
    let unseen = case.unseen_scene();
    let evaluation = Evaluation::of(case, &unseen);
    let before = evaluation.nominal_error();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let about = RecordingMetadata::parse("recording.toml", &case_files::metadata(case)).ok()?;
        let training = predicted(case, &case.scene, &model, &about)?;
        let unseen = predicted(case, &unseen, &model, &about)?;
        evaluation.predicted_error(&training, &unseen)
    });
    Some(PredictionErrors {
        before,
        after: after.unwrap_or(before),
        oracle: evaluation.oracle_error(),
    })
}

/// The errors of a torque case with a hidden effect; `None` for a null case.
pub(crate) fn of_torques(
    case: &torque::case::TorqueCase,
    model: Option<&str>,
) -> Option<PredictionErrors> {
    if case.hidden.is_empty() {
        return None;
    }
    let unseen = case.unseen_motion();
    let evaluation = torque::evaluation::Evaluation::of(case, &unseen);
    let before = evaluation.nominal_error();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let [training, unseen] = evaluation.motions().map(|motion| torques(case, motion, &model));
        evaluation.predicted_error(&training?, &unseen?)
    });
    Some(PredictionErrors {
        before,
        after: after.unwrap_or(before),
        oracle: evaluation.oracle_error(),
    })
}

/// The drive torques that the model predicts in each row of a motion. Rates are differences of
/// rows, so a finer time grid is used.
fn torques(
    case: &torque::case::TorqueCase,
    motion: &torque::motion::Motion,
    model: &RobotModel,
) -> Option<Vec<[f64; JOINTS]>> {
    let finer = (FINE_HZ / motion.rate_hz).round().max(1.0) as usize;
    let about = RecordingMetadata::parse("recording.toml", &torque::case_files::metadata()).ok()?;
    let text = torque::case_files::command(case, motion, finer);
    let recording =
        series::read_text("motion.csv", &text, None, Some(about), RequiredData::Path).ok()?;
    let exerted = recording_simulation::torques(model, recording).ok()?;
    let row = |row: usize| exerted.get(row).map(|row| std::array::from_fn(|joint| row[joint]));
    torque::case_files::commanded(motion, finer).into_iter().map(row).collect()
}

/// The errors of a force case with a hidden effect; `None` for a null case or with chatter.
pub(crate) fn of_forces(
    case: &force::case::ForceCase,
    model: Option<&str>,
) -> Option<PredictionErrors> {
    let unseen = case.unseen_passes();
    let evaluation = force::evaluation::Evaluation::of(case, &unseen)?;
    let before = evaluation.nominal_error();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let [training, unseen] =
            evaluation.recordings().each_ref().map(|ride| forces(case, ride, &model));
        evaluation.predicted_error(&training?, &unseen?)
    });
    Some(PredictionErrors {
        before,
        after: after.unwrap_or(before),
        oracle: evaluation.oracle_error(),
    })
}

/// The sensor readings that the model predicts in each row.
fn forces(
    case: &force::case::ForceCase,
    ride: &force::laws::SimulatedPasses<'_>,
    model: &RobotModel,
) -> Option<Vec<Vector3>> {
    let about =
        RecordingMetadata::parse("recording.toml", &force::case_files::metadata(case)).ok()?;
    let text = force::case_files::command(ride);
    let recording =
        series::read_text("passes.csv", &text, None, Some(about), RequiredData::Samples).ok()?;
    let read = recording_simulation::cut_forces(model, &recording).ok()?;
    Some(read.iter().map(glam::DVec3::to_array).collect())
}

/// Tool poses or link positions that the model predicts in each row of a motion.
fn predicted(
    case: &PositionCase,
    scene: &Scene,
    model: &RobotModel,
    about: &RecordingMetadata,
) -> Option<Predicted> {
    let blank = case.simulate_measurements(scene, 2);
    let text = case_files::recording(case, scene, &blank);
    let recording =
        series::read_text("motion.csv", &text, None, Some(about.clone()), RequiredData::Path)
            .ok()?;
    let states = recording_simulation::positions(model, recording).ok()?;
    Some(if case.instrument.points.is_empty() {
        let count = case.scene.arm.joint_count();
        Predicted::Links(states.iter().map(|state| state.link[..count].to_vec()).collect())
    } else {
        Predicted::Tools(states.iter().map(tool).collect())
    })
}

fn tool(state: &ArmState) -> Transform {
    let frame = &state.base_from_tool;
    let mut tool = IDENTITY;
    for (k, column) in
        [frame.rotation.x_axis, frame.rotation.y_axis, frame.rotation.z_axis].iter().enumerate()
    {
        for (row, x) in tool.iter_mut().zip(column.to_array()) {
            row[k] = x;
        }
    }
    for (row, x) in tool.iter_mut().zip(frame.origin.to_array()) {
        row[3] = x;
    }
    tool
}
