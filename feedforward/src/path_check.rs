//! Whether commands take the tool further from its path than the path's own commands do, by the model.
//!
//! The root mean square tracking error of each joint, which a step minimises, does not ensure it: joints that are equally
//! late stay on the path, joints of which only one is compensated leave it.

use glam::DVec3;
use joint_dynamics::plant::{Plant, Plants};
use physics::Arm;
use realfft::num_complex::Complex64;

use crate::fourier::Transform;
use crate::settings::Settings;
use crate::tool::{self, points};

/// A path, and how far from it the tool is without correction.
pub(crate) struct PathCheck<'a> {
    arm: &'a Arm,
    transform: &'a Transform,
    step_s: f64,
    floor_m: f64,
    wanted: Vec<DVec3>,
    /// Of the joints, at the bins of the transform.
    responses: Vec<Vec<Complex64>>,
    /// Largest distance without correction, m.
    without_m: f64,
}

/// Largest distances from the path by the model, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathDeviation {
    /// Without correction.
    pub without_m: f64,
    /// With it.
    pub with_m: f64,
}

impl<'a> PathCheck<'a> {
    pub(crate) fn new(
        arm: &'a Arm,
        plants: &Plants,
        transform: &'a Transform,
        (step_s, wanted): (f64, &[Vec<f64>]),
        settings: &Settings,
    ) -> Self {
        let bins_hz = transform.bins_hz();
        let response =
            |plant: &Plant| bins_hz.iter().map(|hz| plant.response(*hz)).collect::<Vec<_>>();
        let mut check = Self {
            arm,
            transform,
            step_s,
            floor_m: settings.path_floor_m,
            wanted: points(arm, wanted),
            responses: plants.joints.iter().map(response).collect(),
            without_m: 0.0,
        };
        let without = check.error(wanted);
        check.without_m = without.from_path.largest_m;
        let late_m = without.in_time.largest_m;
        check.floor_m = check.floor_m.max(settings.path_floor_share * late_m);
        check
    }

    /// The largest distances from the path by the model.
    pub(crate) fn deviation(&self, commanded: &[Vec<f64>]) -> PathDeviation {
        let with_m = self.error(commanded).from_path.largest_m;
        PathDeviation { without_m: self.without_m, with_m }
    }

    /// Whether the tool is no further from the path with the commands than without correction.
    pub(crate) fn is_no_worse(&self, commanded: &[Vec<f64>]) -> bool {
        self.deviation(commanded).with_m <= self.without_m.max(self.floor_m)
    }

    /// Root mean square tracking error of the tool by the model, m.
    pub(crate) fn in_time_rms_m(&self, commanded: &[Vec<f64>]) -> f64 {
        self.error(commanded).in_time.rms_m
    }

    fn error(&self, commanded: &[Vec<f64>]) -> tool::ToolError {
        let joints = commanded.iter().zip(&self.responses);
        let reached: Vec<Vec<f64>> =
            joints.map(|(joint, response)| self.transform.through(joint, response)).collect();
        tool::error(&self.wanted, &points(self.arm, &reached), self.step_s)
    }
}
