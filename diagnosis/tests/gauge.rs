//! Calibrations of a KR 240 simulated with errors of every axis and compliant drives. Kinematics (product of exponentials) and gravity are implemented
//! independently here, without the effects of `physics`.
//!
//! Frame and targets are fitted, so that a third of the geometric parameters are gauge freedoms. Axes 2 and 3 are nominally parallel: a direction that is
//! not identifiable for the nominal geometry is weakly identifiable for the real robot. The residual must reach the noise for every training set.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

use diagnosis::hold_out::{Calibration, HoldOutSplit, PositionErrors, calibrate};
use diagnosis::progress::ignore;
use diagnosis::{
    Arrival, Campaign, Extrinsics, Fit, FitParameter, FitSettings, Hypothesis, Influence,
    Instrument, MeasuringFrame, Observation, Pose, Reading, ReadingNoise, RecordingInfo, ToolPoint,
    fit,
};
use glam::{DQuat, DVec3};
use physics::{AnyEffect, Frame, Inputs, JOINTS_MAX, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::model::presets::preset;

const NOISE_M: f64 = 5e-5;
const POSES: usize = 100;
const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.80665);
/// Axis, a point on it (m), mass (kg) and centre of mass (m) of a link, from the preset.
type Link = (DVec3, DVec3, f64, DVec3);

fn links(model: &Model) -> Vec<Link> {
    let link = |joint: &physics::Joint| {
        let body = joint.link.expect("the preset states masses");
        (joint.axis, joint.point, body.mass, body.centre)
    };
    model.arm.joints().iter().map(link).collect()
}

/// A simulated robot.
struct Robot {
    /// Zero offset (rad), tilt of the axis (rotation vector, rad), displacement of the axis (m) and compliance (rad/Nm) of each joint.
    errors: Vec<(f64, DVec3, DVec3, f64)>,
    measuring: (DQuat, DVec3),
    targets: [DVec3; 3],
}

impl Robot {
    fn drawn(links: &[Link], chance: &mut ChaCha8Rng) -> Self {
        let mut normal = |size: f64| size * chance.sample::<f64, _>(StandardNormal);
        let mut vector = |size: f64| DVec3::new(normal(size), normal(size), normal(size));
        let error = |(joint, (axis, ..)): (usize, &Link)| {
            let across = |v: DVec3| v - *axis * axis.dot(v);
            let (tilt, shift) = (across(vector(5e-4)), across(vector(5e-4)));
            let soft = [0.0, 3e-7, 4e-7, 6e-7, 8e-7, 0.0][joint];
            (vector(1e-3).x, tilt, shift, soft * (1.0 + 0.5 * vector(0.5).x.clamp(-1.0, 1.0)))
        };
        let errors = links.iter().enumerate().map(error).collect();
        let turned = DQuat::from_rotation_z(3.0 * vector(0.4).x) * DQuat::from_rotation_x(0.03);
        let targets = [[0.12, 0.0, 0.15], [-0.08, 0.1, 0.2], [-0.06, -0.11, 0.1]];
        let targets = targets.map(|position| DVec3::from_array(position) + vector(0.01));
        Self { errors, measuring: (turned, vector(2.0)), targets }
    }

    /// Positions of the targets in the measuring frame, m.
    fn target_positions(&self, links: &[Link], model: &Model, q: &[f64]) -> [DVec3; 3] {
        let loads = loads(links, q);
        let mut pose = RigidMotion::NONE;
        for (joint, (axis, point, ..)) in links.iter().enumerate() {
            let (zero, tilt, shift, soft) = self.errors[joint];
            let axis = DQuat::from_scaled_axis(tilt) * *axis;
            let by =
                DQuat::from_axis_angle(axis.normalize(), q[joint] + zero + soft * loads[joint]);
            pose = pose.then_about(*point + shift, by);
        }
        let tool = &model.arm.tool;
        let (measuring, offset) = self.measuring;
        self.targets
            .map(|target| measuring * pose.of(tool.base_from_tool * target + tool.tcp) + offset)
    }
}

/// A rotation about the origin, then a translation.
#[derive(Clone, Copy)]
struct RigidMotion {
    rotation: DQuat,
    translation: DVec3,
}

impl RigidMotion {
    const NONE: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    fn of(self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// Product of exponentials: a further rotation about a point, both in the coordinates that this motion maps from.
    fn then_about(self, point: DVec3, rotation: DQuat) -> Self {
        let translation = self.of(point - rotation * point);
        Self { rotation: self.rotation * rotation, translation }
    }
}

/// Gravity torque of each joint, Nm.
fn loads(links: &[Link], q: &[f64]) -> Vec<f64> {
    let mut pose = RigidMotion::NONE;
    let (mut axes, mut middles) = (Vec::new(), Vec::new());
    for (joint, (axis, point, _, middle)) in links.iter().enumerate() {
        axes.push((pose.rotation * *axis, pose.of(*point)));
        pose = pose.then_about(*point, DQuat::from_axis_angle(*axis, q[joint]));
        middles.push(pose.of(*middle));
    }
    let load = |(joint, (axis, point)): (usize, &(DVec3, DVec3))| {
        let carried = links.iter().zip(&middles).skip(joint);
        carried.map(|(link, centre)| axis.dot((*centre - *point).cross(GRAVITY * link.2))).sum()
    };
    axes.iter().enumerate().map(load).collect()
}

/// Displacements of the axes relative to the preceding ones, without components along the axes, as `axis_shift` has them, m.
fn carried(links: &[Link], robot: &Robot) -> Vec<DVec3> {
    let mut moved = DVec3::ZERO;
    let one = |((axis, ..), (_, _, place, _)): (&Link, &(f64, DVec3, DVec3, f64))| {
        let further = *place - moved;
        let across = further - *axis * axis.dot(further);
        moved += across;
        across
    };
    links.iter().zip(&robot.errors).map(one).collect()
}

/// Simulated measurements at random poses, by a tracker with noise of `noise_m`.
fn measured(model: &Model, robot: &Robot, noise_m: f64, chance: &mut ChaCha8Rng) -> Campaign {
    let links = links(model);
    let whitening = ReadingNoise::Equal(NOISE_M).whitening(DVec3::ZERO).expect("sound");
    let ranges = [[-3.2, 3.2], [-2.2, -0.3], [-0.8, 1.8], [-3.0, 3.0], [-2.1, 2.1], [-3.0, 3.0]];
    let pose = |row: usize| {
        let mut q = [0.0; JOINTS_MAX];
        for (slot, [low, high]) in q.iter_mut().zip(ranges) {
            *slot = chance.random_range(low..high);
        }
        let points = robot.target_positions(&links, model, &q);
        let mut normal = || noise_m * chance.sample::<f64, _>(StandardNormal);
        let observations = points.iter().enumerate().map(|(target, point)| {
            let position = *point + DVec3::new(normal(), normal(), normal());
            let reading =
                Reading::Point { place: ToolPoint::Target(target), frame: 0, at: position };
            Observation { reading, whitening, instrument: 0 }
        });
        let observations = observations.collect();
        Pose {
            inputs: Inputs::at_rest(q),
            arrival: Arrival::Settled,
            recording: 0,
            row,
            seen: observations,
        }
    };
    let station = MeasuringFrame { measuring_from_base: Frame::IDENTITY, pivot: DVec3::ZERO };
    Campaign {
        poses: (0..POSES).map(pose).collect(),
        surroundings: Extrinsics {
            frames: vec![FitParameter::unknown(station)],
            targets: vec![FitParameter::unknown(DVec3::ZERO); 3],
            ..Extrinsics::default()
        },
        instruments: vec![Instrument {
            name: "tracker".to_owned(),
            noise_is_known: true,
            ..Instrument::default()
        }],
        recordings: vec![RecordingInfo::of_poses("made")],
    }
}

/// A robot with its measurements, and noise-free measurements at other poses.
struct Case {
    robot: Robot,
    campaign: Campaign,
    unseen: Campaign,
}

fn case(model: &Model, number: u64) -> Case {
    let mut chance = ChaCha8Rng::seed_from_u64(number);
    let robot = Robot::drawn(&links(model), &mut chance);
    let campaign = measured(model, &robot, NOISE_M, &mut chance);
    let unseen = measured(model, &robot, 0.0, &mut chance);
    Case { robot, campaign, unseen }
}

/// Calibration on 70 % of the poses, selected at random with `seed`.
fn calibrated(model: &Model, campaign: &Campaign, seed: u64) -> Calibration {
    let training = HoldOutSplit::random(campaign, 0.7, seed).training;
    calibrate(campaign, model, &[], &training, &ignore)
}

/// RMS error at poses that were not measured, with frame and targets fitted, m.
fn rms_error_m(found: &Fit, unseen: &Campaign) -> f64 {
    let used = vec![true; unseen.poses.len()];
    let settings = FitSettings::full(&used, Influence::Equal);
    let registered = fit(unseen, &Hypothesis::fixed(*found.hypothesis.model), &settings);
    let errors = PositionErrors::of(&registered, unseen, &used).sorted_m;
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn every_split_ends_at_the_noise_and_no_number_runs_away() {
    let model = preset("kuka-kr240").expect("preset").model().expect("sound").physics;
    for number in 0..6 {
        let Case { campaign, unseen, .. } = case(&model, number);
        for seed in [1, 2] {
            let found = calibrated(&model, &campaign, seed).advanced.fit;
            assert!(
                found.converged && found.factors == [1.0],
                "{number} {seed}: {:?}",
                found.factors
            );
            let rms_error_m = rms_error_m(&found, &unseen);
            assert!(
                rms_error_m < 0.6 * NOISE_M,
                "campaign {number}, seed {seed}: {} mm",
                rms_error_m * 1e3
            );
            let beyond = found.beyond_tolerance(1.0);
            assert!(beyond.is_empty(), "campaign {number}, seed {seed}: {beyond:?}");
        }
    }
}

#[test]
fn where_targets_are_known_the_tools_place_on_the_flange_is_fitted_too() {
    let model = preset("kuka-kr240").expect("preset").model().expect("sound").physics;
    for number in 0..3 {
        let Case { robot, mut campaign, mut unseen } = case(&model, number);
        for campaign in [&mut campaign, &mut unseen] {
            campaign.surroundings.targets = robot.targets.map(FitParameter::known).to_vec();
        }
        let found = calibrated(&model, &campaign, 1).advanced.fit;
        assert!(found.factors == [1.0], "{number}: {:?}", found.factors);
        let rms_error_m = rms_error_m(&found, &unseen);
        assert!(rms_error_m < 0.8 * NOISE_M, "campaign {number}: {} mm", rms_error_m * 1e3);
    }
}

#[test]
fn what_is_called_identifiable_lies_within_its_interval() {
    let model = preset("kuka-kr240").expect("preset").model().expect("sound").physics;
    let (mut inside, mut all) = (0, 0);
    for number in 10..26 {
        let Case { robot, campaign, .. } = case(&model, number);
        let used = vec![true; POSES];
        let found = calibrate(&campaign, &model, &[], &used, &ignore).advanced.fit;
        for (k, (free, value)) in
            found.hypothesis.free.iter().zip(found.hypothesis.values()).enumerate()
        {
            let Some(sigma) = found.sigma(found.column_of(k)) else { continue };
            let effect = found.hypothesis.effect_of(free).expect("there");
            let joint = effect.joint().expect("a joint's");
            let (zero, tilt, _, soft) = robot.errors[joint];
            let truth = match effect {
                AnyEffect::JointOffset(_) => zero,
                AnyEffect::JointCompliance(_) => soft,
                AnyEffect::AxisShift(_) => carried(&links(&model), &robot)[joint][free.value],
                AnyEffect::AxisTilt(_) => {
                    let (first, second) = physics::frame::normals(model.arm.joints()[joint].axis);
                    tilt.dot([first, second][free.value])
                }
                other => panic!("{} is none of the truth", other.spec().kind),
            };
            all += 1;
            inside += u32::from((value - truth).abs() < 2.0 * sigma);
        }
    }
    // 95 % of about forty parameters are expected inside; 84 % is three standard deviations below.
    assert!(all >= 32 && f64::from(inside) > 0.84 * f64::from(all), "{inside} of {all}");
}
