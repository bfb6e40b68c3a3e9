//! Measuring equipment and constraints of a [`Task`]: instrument, targets, probe, joint limits, obstacles.
//!
//! Positions on the tool are in the tool frame, all others in the base frame; SI units.

use super::arm_constraints::ArmConstraints;
use super::line_of_sight::LineOfSight;
use super::task::{MeasurementKind, Task, TouchSurface, calibration_hypothesis};
use crate::campaign::{Campaign, ReadingNoise};
use crate::extrinsics::{Anchor, Extrinsics, FitParameter, MeasuringFrame, Plane, Sphere};
use glam::DVec3;
use physics::{Arm, Frame};
use recording::model::RobotModel;

/// Standard uncertainty of a length if neither the setup nor a recording gives one, m. Origin: a laser tracker at a few metres.
pub const LENGTH_SIGMA_M: f64 = 5e-5;

/// Measuring equipment and constraints of the poses.
///
/// ```
/// use diagnosis::plan::setup::{MeasuringSetup, ToolTarget};
/// use glam::DVec3;
///
/// let reflector = ToolTarget {
///     place_tool_m: DVec3::new(0.0, 0.0, 0.1),
///     facing_tool: Some(DVec3::X),
/// };
/// let setup = MeasuringSetup {
///     instrument_base_m: Some(DVec3::new(3.0, 0.0, 1.2)),
///     targets: vec![reflector],
///     ..MeasuringSetup::default()
/// };
/// assert_eq!(setup.sight().expect("an instrument").facing_tool, [Some(DVec3::X)]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuringSetup {
    /// Position of the instrument, base frame, m. Default: none, so that no line of sight is required.
    pub instrument_base_m: Option<DVec3>,
    /// Smallest and largest measuring distance of the instrument, m. Default 0.3 and 30. Origin: data sheets of laser trackers.
    pub range_m: [f64; 2],
    /// Largest angle between the axis of a reflector and the beam, rad; above 0. Default 25 degrees. Origin: data sheets of ball-mounted
    /// retroreflectors.
    pub acceptance_rad: f64,
    /// Targets on the tool. Default: none, so that the TCP is measured.
    pub targets: Vec<ToolTarget>,
    /// Minimum number of targets that must be visible at a pose. Default 1.
    pub targets_seen_least: usize,
    /// Whether the positions of the targets on the tool are known; otherwise they are fitted. Default false.
    pub targets_known: bool,
    /// Whether the measuring frame is the robot's base frame; otherwise it is fitted. Default false.
    pub frame_known: bool,
    /// Standard uncertainty of a length, m; above 0. Default: none, so that it is estimated from the recordings, or is [`LENGTH_SIGMA_M`].
    pub length_sigma_m: Option<f64>,
    /// Standard uncertainty of the tool's orientation, rad; above 0. Default: none, so that it is not measured.
    pub orientation_sigma_rad: Option<f64>,
    /// A ballbar or cable sensor, which measures distances instead of points. Default: none.
    pub ballbar: Option<Ballbar>,
    /// Planes that a probe touches instead of point measurements. Default: none.
    pub planes: Vec<TouchedPatch>,
    /// Spheres that a probe touches instead of point measurements. Default: none.
    pub spheres: Vec<TouchedSphere>,
    /// Margin to the limits of revolute joints, rad; 0 to π/2. Default 5 degrees. Origin: a choice.
    pub margin_rad: f64,
    /// Radius of the capsules around the links, m; above 0. Default: that of [`ArmConstraints::of`].
    pub link_radius_m: Option<f64>,
    /// Radius of the capsule around the base, m; above 0. Default: that of [`ArmConstraints::of`].
    pub base_radius_m: Option<f64>,
    /// The floor. Default: at the foot of the base for an upright arm.
    pub floor: Floor,
    /// Boxes that the links must not enter: lowest and highest corner, base frame, m. Default: none.
    pub keep_out: Vec<[DVec3; 2]>,
    /// Whether each pose is measured twice, with all joints approaching from below and from above. Default true.
    pub both_ways: bool,
}

/// A target on the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolTarget {
    /// Position, tool frame, m.
    pub place_tool_m: DVec3,
    /// Axis of the reflector, tool frame, unit length; `None` if visible from all directions.
    pub facing_tool: Option<DVec3>,
}

/// A ballbar or cable sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ballbar {
    /// Approximate position of its fixed end, base frame, m; fitted.
    pub anchor_base_m: DVec3,
    /// Shortest and longest measurable distance, m.
    pub length_m: [f64; 2],
}

/// A region of a plane that a probe touches; the plane is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchedPatch {
    /// Centre of the region, base frame, m.
    pub middle_base_m: DVec3,
    /// Outward normal of the plane, base frame, unit length.
    pub normal_base: DVec3,
    /// Radius of the region, m.
    pub within_m: f64,
}

/// A sphere that a probe touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TouchedSphere {
    /// Approximate centre, base frame, m; fitted.
    pub centre_base_m: DVec3,
    /// Radius, m; known.
    pub radius_m: f64,
}

/// Floor below the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Floor {
    /// At the foot of the base for an upright arm, otherwise none.
    #[default]
    OfArm,
    /// No floor.
    None,
    /// At this height in the base frame, m.
    At(f64),
}

impl Default for MeasuringSetup {
    fn default() -> Self {
        Self {
            instrument_base_m: None,
            range_m: [0.3, 30.0],
            acceptance_rad: 25.0_f64.to_radians(),
            targets: Vec::new(),
            targets_seen_least: 1,
            targets_known: false,
            frame_known: false,
            length_sigma_m: None,
            orientation_sigma_rad: None,
            ballbar: None,
            planes: Vec::new(),
            spheres: Vec::new(),
            margin_rad: 5.0_f64.to_radians(),
            link_radius_m: None,
            base_radius_m: None,
            floor: Floor::default(),
            keep_out: Vec::new(),
            both_ways: true,
        }
    }
}

impl MeasuringSetup {
    /// The task of a model without measurements; [`Task::test_poses`] is empty.
    #[must_use]
    pub fn task(&self, model: &RobotModel) -> Task {
        Task {
            hypothesis: calibration_hypothesis(&model.physics, &model.sigma),
            surroundings: self.surroundings(),
            measurement: self.sees(),
            noise: self.noise(LENGTH_SIGMA_M),
            sight: self.sight(),
            reach: self.reach(&model.physics.arm),
            both_directions: self.both_ways,
            given_poses: Vec::new(),
            test_poses: Vec::new(),
        }
    }

    /// Adds what this setup states to the campaign of a recording: a known measuring frame, known target positions.
    pub fn add_to(&self, campaign: &mut Campaign) {
        let Extrinsics { frames, targets, .. } = &mut campaign.surroundings;
        frames.iter_mut().for_each(|frame| frame.free &= !self.frame_known);
        for (found, stated) in targets.iter_mut().zip(&self.targets) {
            if found.free && self.targets_known {
                *found = FitParameter::known(stated.place_tool_m);
            }
        }
    }

    /// Standard uncertainty of lengths, m: as stated, otherwise `otherwise_m`.
    #[must_use]
    pub fn noise(&self, otherwise_m: f64) -> ReadingNoise {
        ReadingNoise::Equal(self.length_sigma_m.unwrap_or(otherwise_m))
    }

    /// Constraints of the arm.
    #[must_use]
    pub fn reach(&self, arm: &Arm) -> ArmConstraints {
        let usual = ArmConstraints::of(arm);
        ArmConstraints {
            margin_rad: self.margin_rad,
            link_radius_m: self.link_radius_m.unwrap_or(usual.link_radius_m),
            base_radius_m: self.base_radius_m.unwrap_or(usual.base_radius_m),
            floor_m: match self.floor {
                Floor::OfArm => usual.floor_m,
                Floor::None => None,
                Floor::At(height_m) => Some(height_m),
            },
            keep_out: self.keep_out.clone(),
            ..usual
        }
    }

    /// Line-of-sight constraint; `None` without an instrument.
    #[must_use]
    pub fn sight(&self) -> Option<LineOfSight> {
        Some(LineOfSight {
            instrument_base: self.instrument_base_m?,
            range_m: self.range_m,
            acceptance_rad: self.acceptance_rad,
            facing_tool: self.targets.iter().map(|target| target.facing_tool).collect(),
        })
    }

    fn sees(&self) -> MeasurementKind {
        if let Some(Ballbar { length_m, .. }) = self.ballbar {
            return MeasurementKind::Distance { length_m };
        }
        let plane = |(plane, patch): (usize, &TouchedPatch)| TouchSurface::Plane {
            plane,
            centre: patch.middle_base_m,
            radius_m: patch.within_m,
        };
        let planes = self.planes.iter().enumerate().map(plane);
        let touched: Vec<TouchSurface> =
            planes.chain((0..self.spheres.len()).map(TouchSurface::Sphere)).collect();
        if touched.is_empty() {
            let orientation_rad = self.orientation_sigma_rad;
            return MeasurementKind::Points { least: self.targets_seen_least, orientation_rad };
        }
        MeasurementKind::Touch(touched)
    }

    fn surroundings(&self) -> Extrinsics {
        let station = MeasuringFrame { measuring_from_base: Frame::IDENTITY, pivot: DVec3::ZERO };
        let target = |target: &ToolTarget| FitParameter {
            value: target.place_tool_m,
            free: !self.targets_known,
        };
        let anchor = |ballbar: &Ballbar| Anchor {
            place: FitParameter::unknown(ballbar.anchor_base_m),
            offset_m: FitParameter::known(0.0),
        };
        let plane = |patch: &TouchedPatch| {
            let normal = patch.normal_base;
            FitParameter::unknown(Plane { normal, offset_m: normal.dot(patch.middle_base_m) })
        };
        let sphere = |sphere: &TouchedSphere| Sphere {
            centre: FitParameter::unknown(sphere.centre_base_m),
            radius_m: FitParameter::known(sphere.radius_m),
        };
        Extrinsics {
            frames: vec![FitParameter { value: station, free: !self.frame_known }],
            targets: self.targets.iter().map(target).collect(),
            anchors: self.ballbar.iter().map(anchor).collect(),
            planes: self.planes.iter().map(plane).collect(),
            spheres: self.spheres.iter().map(sphere).collect(),
        }
    }
}
