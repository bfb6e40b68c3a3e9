//! Evaluation of a written model on an unseen motion: predicted as in a simulation ([`diagnosis::simulated`]).
//!
//! A model that is missing or does not load counts as the given model. Nothing is fitted here.

use challenge::arm::JOINTS;
use challenge::case::Case;
use challenge::proof::{Predicted, Proof};
use challenge::scene::Scene;
use challenge::score::Errors;
use challenge::space::{ONE, T4, V3};
use challenge::write;
use challenge::{force, torque};
use diagnosis::simulated;
use recording::model::RobotModel;
use recording::series::{self, About, Need};
use world::forward::Seen;

/// Rows per second on which torques are predicted.
const FINE_HZ: f64 = 2000.0;

/// The errors of a case with a hidden effect; `None` for a null case.
pub(crate) fn of_positions(case: &Case, model: Option<&str>) -> Option<Errors> {
    if case.hidden.is_empty() {
        return None;
    }
    let unseen = case.unseen();
    let proof = Proof::of(case, &unseen);
    let before = proof.before();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let about = About::parse("recording.toml", &write::about(case)).ok()?;
        let training = predicted(case, &case.scene, &model, &about)?;
        let unseen = predicted(case, &unseen, &model, &about)?;
        proof.after(&training, &unseen)
    });
    Some(Errors { before, after: after.unwrap_or(before), oracle: proof.oracle() })
}

/// The errors of a torque case with a hidden effect; `None` for a null case.
pub(crate) fn of_torques(case: &torque::case::Case, model: Option<&str>) -> Option<Errors> {
    if case.hidden.is_empty() {
        return None;
    }
    let unseen = case.unseen();
    let proof = torque::proof::Proof::of(case, &unseen);
    let before = proof.before();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let [training, unseen] = proof.motions().map(|motion| torques(case, motion, &model));
        proof.after(&training?, &unseen?)
    });
    Some(Errors { before, after: after.unwrap_or(before), oracle: proof.oracle() })
}

/// The drive torques that the model predicts in each row of a motion. Rates are differences of
/// rows, so a finer time grid is used.
fn torques(
    case: &torque::case::Case,
    motion: &torque::motion::Motion,
    model: &RobotModel,
) -> Option<Vec<[f64; JOINTS]>> {
    let finer = (FINE_HZ / motion.rate_hz).round().max(1.0) as usize;
    let about = About::parse("recording.toml", &torque::write::about()).ok()?;
    let text = torque::write::command(case, motion, finer);
    let recording = series::read_text("motion.csv", &text, None, Some(about), Need::Path).ok()?;
    let exerted = simulated::torques(model, recording).ok()?;
    let row = |row: usize| exerted.get(row).map(|row| std::array::from_fn(|joint| row[joint]));
    torque::write::commanded(motion, finer).into_iter().map(row).collect()
}

/// The errors of a case of forces; none of a null, and none where something swings by itself.
pub(crate) fn of_forces(case: &force::case::Case, model: Option<&str>) -> Option<Errors> {
    let unseen = case.unseen();
    let proof = force::proof::Proof::of(case, &unseen)?;
    let before = proof.before();
    let written = model.and_then(|text| RobotModel::parse("model.toml", text).ok());
    let after = written.and_then(|model| {
        let [training, unseen] = proof.rides().each_ref().map(|ride| forces(case, ride, &model));
        proof.after(&training?, &unseen?)
    });
    Some(Errors { before, after: after.unwrap_or(before), oracle: proof.oracle() })
}

/// The sensor readings that the model predicts in each row.
fn forces(
    case: &force::case::Case,
    ride: &force::laws::Ride<'_>,
    model: &RobotModel,
) -> Option<Vec<V3>> {
    let about = About::parse("recording.toml", &force::write::about(case)).ok()?;
    let text = force::write::command(ride);
    let recording =
        series::read_text("passes.csv", &text, None, Some(about), Need::Samples).ok()?;
    let read = simulated::cut_forces(model, &recording).ok()?;
    Some(read.iter().map(glam::DVec3::to_array).collect())
}

/// Where the model puts the robot in each row of a motion.
fn predicted(case: &Case, scene: &Scene, model: &RobotModel, about: &About) -> Option<Predicted> {
    let blank = case.measured(scene, 2);
    let text = write::recording(case, scene, &blank);
    let recording =
        series::read_text("motion.csv", &text, None, Some(about.clone()), Need::Path).ok()?;
    let seen = simulated::positions(model, recording).ok()?;
    Some(if case.view.places.is_empty() {
        let count = case.scene.arm.count();
        Predicted::Links(seen.iter().map(|seen| seen.link[..count].to_vec()).collect())
    } else {
        Predicted::Tools(seen.iter().map(tool).collect())
    })
}

fn tool(seen: &Seen) -> T4 {
    let frame = &seen.base_from_tool;
    let mut tool = ONE;
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
