//! The poses as files: a list for the measurements, and robot programs.
//!
//! All files contain the same values. The programs stay within the joint limits.

use std::collections::BTreeSet;

use diagnosis::plan::pose_order::home;
use diagnosis::plan::{MeasurementKind, Task, TouchSurface};
use diagnosis::{FitParameter, ReadingNoise};
use physics::Joints;
use recording::files::FileError;
use recording::model::RobotModel;
use recording::programs::{Approach, Axis, Krl, Program, ProgramRequest, Rapid};
use recording::series::{Channel, Distance, Gauges, Probe, TouchedPlane, TouchedSphere};

use crate::error::Error;

/// Name of the list into which measurements are entered.
pub const LIST: &str = "poses.csv";
/// Name of the page.
pub const PAGE: &str = "plan.html";
/// Names of all files besides the page: a description and its list, ABB RAPID, KUKA KRL.
pub const FILES: [&str; 5] = ["poses.toml", LIST, "poses.mod", "poses.src", "poses.dat"];

/// A file of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanFile {
    /// File name without folder.
    pub name: &'static str,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Motion of the robot to the poses, and rest at them.
#[derive(Clone, Debug)]
pub struct Programs {
    /// Distance of the start of an approach for poses that are measured from both directions, degrees, mm for prismatic joints; above 0. Default 3.
    /// Origin: a choice, well above the lost motion of gears.
    pub approach_deg: f64,
    /// Rest time at each pose, s; 0 to 3600. Default 3. Origin: a choice, for vibrations to decay and the instrument to average.
    pub pause_s: f64,
    /// Controller axis of each joint. Default: none, so that joint `i` is axis `i`.
    pub axes: Vec<Axis>,
}

impl Default for Programs {
    fn default() -> Self {
        Self { approach_deg: 3.0, pause_s: 3.0, axes: Vec::new() }
    }
}

impl Programs {
    /// Approach of the poses; `both_ways`: each pose twice, all joints from below and from above.
    pub(super) fn approach(&self, both_ways: bool) -> Approach {
        if !both_ways {
            return Approach::Direct;
        }
        Approach::BothWays {
            turn_rad: self.approach_deg.to_radians(),
            slide_m: 1e-3 * self.approach_deg,
        }
    }

    /// The files for these stops.
    pub(super) fn files(
        &self,
        model: &RobotModel,
        task: &Task,
        stops: &[Joints],
        approach: Approach,
    ) -> Result<Vec<PlanFile>, Error> {
        let arm = &model.physics.arm;
        let list = |q: &Joints| q[..arm.count()].to_vec();
        let tour = ProgramRequest {
            name: "poses".to_owned(),
            home: list(&home(arm, &task.reach)),
            poses: stops.iter().map(list).collect(),
            approach,
            pause_s: self.pause_s,
            axes: self.axes.clone(),
        };
        let program = Program::new(&tour, &model.file).map_err(FileError::from)?;
        let krl = program.krl(&Krl::default()).map_err(FileError::from)?;
        let rapid = program.rapid(&Rapid::default()).map_err(FileError::from)?;
        let columns = columns(task);
        let mut recording = program.recording(&columns);
        if let ReadingNoise::Equal(sigma) = task.noise {
            let lengths = columns.iter().filter(|c| {
                matches!(c, Channel::Position(_) | Channel::Target(..) | Channel::Distance(_))
            });
            recording.metadata.sigma = lengths.map(|column| (*column, sigma)).collect();
        }
        recording.metadata.gauges = gauges(task);
        recording.metadata.measured_in_base =
            task.surroundings.frames.iter().all(|frame| !frame.free);
        let targets = task.surroundings.targets.iter().enumerate();
        recording.metadata.targets_tool = targets
            .filter(|(_, target)| !target.free)
            .map(|(place, target)| (place, target.value.to_array()))
            .collect();
        let texts = [
            recording.about_toml().into_bytes(),
            recording.to_csv(),
            rapid.into_bytes(),
            krl.src.into_bytes(),
            krl.dat.into_bytes(),
        ];
        Ok(FILES.into_iter().zip(texts).map(|(name, bytes)| PlanFile { name, bytes }).collect())
    }
}

/// Columns for the measurements.
fn columns(task: &Task) -> Vec<Channel> {
    let orientation_rad = match &task.measurement {
        MeasurementKind::Points { orientation_rad, .. } => orientation_rad,
        MeasurementKind::Distance { .. } => return vec![Channel::Distance(0)],
        MeasurementKind::Touch(patches) => {
            let touches = |patch: &TouchSurface| match patch {
                TouchSurface::Plane { .. } => Channel::TouchPlane,
                TouchSurface::Sphere(_) => Channel::TouchSphere,
            };
            return patches.iter().map(touches).collect::<BTreeSet<_>>().into_iter().collect();
        }
    };
    let mut columns: Vec<Channel> = match task.surroundings.targets.len() {
        0 => (0..3).map(Channel::Position).collect(),
        count => {
            (0..count).flat_map(|t| (0..3).map(move |axis| Channel::Target(t, axis))).collect()
        }
    };
    if orientation_rad.is_some() {
        columns.extend((0..4).map(Channel::Orientation));
    }
    columns
}

/// The reference points of distances and the touched surfaces, as far as they are known; the probe is treated as a point, as in the choice of the
/// poses.
fn gauges(task: &Task) -> Gauges {
    let around = &task.surroundings;
    let target = (!around.targets.is_empty()).then_some(0);
    let mut gauges = Gauges::default();
    match &task.measurement {
        MeasurementKind::Points { .. } => {}
        MeasurementKind::Distance { .. } => {
            gauges.distances = (0..)
                .zip(around.anchors.iter().take(1).map(|anchor| Distance {
                    anchor_m: known(anchor.place).map(|position| position.to_array()),
                    target,
                    offset_m: known(anchor.offset_m),
                }))
                .collect();
        }
        MeasurementKind::Touch(_) => {
            let sigma_m = match task.noise {
                ReadingNoise::Equal(sigma) => Some(sigma),
                _ => None,
            };
            gauges.probe = Some(Probe { radius_m: 0.0, target, sigma_m });
            gauges.planes = (0..)
                .zip(around.planes.iter().map(|plane| TouchedPlane {
                    normal: plane.value.normal.to_array(),
                    offset_m: known(*plane).map(|plane| plane.offset_m),
                }))
                .collect();
            gauges.spheres = (0..)
                .zip(around.spheres.iter().map(|sphere| TouchedSphere {
                    centre_m: known(sphere.centre).map(|position| position.to_array()),
                    radius_m: known(sphere.radius_m),
                }))
                .collect();
        }
    }
    gauges
}

fn known<T>(fitted: FitParameter<T>) -> Option<T> {
    (!fitted.free).then_some(fitted.value)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use recording::series::metadata_path;

    use super::*;

    #[test]
    fn the_description_has_the_name_that_belongs_to_the_list() {
        assert_eq!(metadata_path(Path::new(LIST)), Path::new(FILES[0]));
    }
}
