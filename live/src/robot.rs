//! Drawing of the robot for the page: positions of joints and tool at the last command, and the displacement of the tool by the correction.
//!
//! Positions are those of the nominal geometry in the cell's model file, base frame. Drawn only while that file is the active model.

use std::path::PathBuf;

use physics::{Arm, Chain, JOINTS_MAX, Joints};
use recording::model::RobotModel;
use serde::Serialize;
use shm_schema::Status;

const MM: f64 = 1e3;

/// The model file of a cell.
#[derive(Debug)]
pub(crate) struct RobotModelFile {
    path: PathBuf,
    /// The file, or why it cannot be used.
    model: Result<RobotModel, String>,
    /// Hash of the active model for which the file was read.
    read_for_hash: Option<u64>,
}

/// Drawing of a robot.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Drawing {
    /// The arm at the last command.
    Arm {
        /// From the base to the tool, base frame, mm.
        points_mm: Vec<[f64; 3]>,
        /// Displacement of the tool by the correction, base frame, mm.
        shift_mm: [f64; 3],
        /// Length of all links together, mm: no point is farther from the base.
        reach_mm: f64,
    },
    /// Nothing.
    Nothing {
        /// The reason, for people.
        why: String,
    },
}

impl RobotModelFile {
    /// The robot whose model is in this file.
    pub(crate) fn new(path: PathBuf) -> Self {
        Self { path, model: Err(String::new()), read_for_hash: None }
    }

    /// The drawing for a status. Reads the file again after the daemon has changed its model.
    pub(crate) fn drawing(&mut self, status: &Status) -> Drawing {
        if self.read_for_hash != Some(status.model_hash) {
            self.model = RobotModel::read(&self.path).map_err(|why| why.to_string());
            self.read_for_hash = Some(status.model_hash);
        }
        match &self.model {
            Err(why) => Drawing::Nothing { why: why.clone() },
            Ok(model) if model.hash != status.model_hash => {
                let why = format!("{} is not the model in use", self.path.display());
                Drawing::Nothing { why }
            }
            Ok(model) => arm(&model.physics.arm, &status.q_command, &status.correction),
        }
    }
}

fn arm(arm: &Arm, q: &Joints, correction: &[f64; JOINTS_MAX]) -> Drawing {
    let chain = Chain::nominal(arm, q);
    let tool = Chain::tool_at(arm, q).origin;
    let joints = (0..arm.count()).map(|joint| chain.point(joint));
    let points: Vec<_> = std::iter::once(glam::DVec3::ZERO).chain(joints).chain([tool]).collect();
    let reach: f64 = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let corrected: Joints = std::array::from_fn(|i| q[i] + correction[i]);
    let shift = Chain::tool_at(arm, &corrected).origin - tool;
    Drawing::Arm {
        points_mm: points.iter().map(|point| (*point * MM).to_array()).collect(),
        shift_mm: (shift * MM).to_array(),
        reach_mm: reach * MM,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> RobotModel {
        recording::model::presets::preset("irb1600-6-145")
            .expect("a preset")
            .model()
            .expect("valid")
    }

    #[test]
    fn a_correction_of_the_first_joint_displaces_the_tool_around_the_vertical() {
        let arm_of = model().physics.arm;
        let (q, mut correction) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
        correction[0] = 1e-3;
        let Drawing::Arm { points_mm, shift_mm, reach_mm } = arm(&arm_of, &q, &correction) else {
            panic!("an arm");
        };
        let tool = points_mm.last().expect("a tool");
        assert_eq!(points_mm.len(), arm_of.count() + 2);
        let radius = tool[0].hypot(tool[1]);
        assert!((shift_mm[1] - 1e-3 * radius).abs() < 1e-3 * 1e-3 * radius && shift_mm[2] == 0.0);
        assert!(points_mm.iter().all(|p| p[0].hypot(p[1]).hypot(p[2]) <= reach_mm + 1e-9));
    }

    #[test]
    fn a_file_that_is_not_the_model_in_use_is_not_drawn() {
        let file = std::env::temp_dir().join(format!("trued-live-{}.toml", std::process::id()));
        model().file.write(&file).expect("a temporary folder");
        let mut robot = RobotModelFile::new(file.clone());
        let mut status = Status { model_hash: model().hash, ..Status::default() };
        assert!(matches!(robot.drawing(&status), Drawing::Arm { .. }));
        status.model_hash += 1;
        let Drawing::Nothing { why } = robot.drawing(&status) else { panic!("another model") };
        assert!(why.contains("not the model in use"), "{why}");
        std::fs::remove_file(&file).expect("its own file");
        let Drawing::Nothing { why } = RobotModelFile::new(file).drawing(&status) else {
            panic!("no file")
        };
        assert!(why.contains("trued-live"), "{why}");
    }
}
