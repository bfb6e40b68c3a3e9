//! Catalogue of motions and loads for experiments: each joint alone, reversals under gravity in either direction, the same poses with and without a load,
//! with the arm stretched and folded, slow and fast, cold and warm.
//!
//! Invariants: motions stay within the joint limits and maximum speeds of the arm; the same arm gives the same catalogue. Obstacles are not checked.

use glam::DVec3;
use physics::{Arm, Chain, Joint, JointKind, Joints};
use recording::series::{
    Channel, CoordinateFrame, DirectionSource, FileUnits, Recording, RecordingKind,
};
use std::f64::consts::{FRAC_PI_2, PI};

/// Time step of a path, s, and dwell time per pose of the warm-up, s.
const STEP_S: f64 = 0.1;
const RETURN_S: f64 = 30.0;
/// Share of a joint's maximum speed in ordinary motions, and upper limit of that speed, rad/s and m/s. Then the same for fast motions.
const SPEED_SHARE: f64 = 0.2;
const SPEED_MAX: [f64; 2] = [0.5, 0.1];
const FAST_SPEED_SHARE: f64 = 0.8;
const FAST_SPEED_MAX: [f64; 2] = [3.0, 1.0];
/// Share of the distance from the middle to a joint limit that is used.
const RANGE_SHARE: f64 = 0.9;
/// Largest distance from the middle in motions of a single joint, and in a tour, rad and m.
const SINGLE_JOINT_REACH: [f64; 2] = [FRAC_PI_2, 0.5];
const TOUR_REACH: [f64; 2] = [0.6, 0.2];
/// Number of poses of a tour.
const TOUR_POSES: usize = 14;
/// Strokes of the reversals, degrees (mm for a prismatic joint).
const STROKES: [f64; 4] = [0.01, 0.1, 1.0, 10.0];
/// Force on the tool, N.
const LOAD_N: f64 = 50.0;
/// Warm-up: initial and final temperature, °C, time constant, s, and number of returns to the poses.
const COLD_CELSIUS: f64 = 20.0;
const WARM_CELSIUS: f64 = 35.0;
const WARMING_S: f64 = 2400.0;
const RETURNS: usize = 24;

/// Fractional parts of multiples of an irrational number fill a range evenly.
const IRRATIONALS: [f64; 6] = [0.7548, 0.5698, 0.6180, 0.8191, 0.6711, 0.5497];

/// One row of an experiment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExperimentRow {
    /// Segment that the row belongs to.
    pub segment: i64,
    /// Time since the start of the experiment, s.
    pub time_s: f64,
    /// Commanded joint positions, rad or m.
    pub q: Joints,
    /// Force on the tool centre point, base frame, N.
    pub force_n: DVec3,
    /// Temperature of air and joints, °C; NaN if it is irrelevant.
    pub celsius: f64,
}

/// An experiment: commanded motion with loads and temperatures.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Name within the catalogue.
    pub name: String,
    /// Instruction for the technician.
    pub says: String,
    /// The rows.
    pub rows: Vec<ExperimentRow>,
    joints: usize,
    kinds: Vec<JointKind>,
}

/// Measured quantities of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeasuredChannels {
    /// Columns to be measured.
    pub channels: Vec<Channel>,
}

impl Experiment {
    /// Duration, s.
    #[must_use]
    pub fn takes_s(&self) -> f64 {
        self.rows.last().map_or(0.0, |row| row.time_s)
    }

    /// The experiment as a recording with `value` in the `measured` columns (NaN: still to be measured).
    #[must_use]
    pub fn recording(&self, measured: &MeasuredChannels, value: f64) -> Recording {
        let mut made = Recording::new(self.rows.iter().map(|row| row.time_s).collect());
        made.segment = self.rows.iter().map(|row| row.segment).collect();
        made.units = FileUnits::WORKSHOP;
        for joint in 0..self.joints {
            made.set_joint_kind(joint, self.kinds[joint]);
            made.set(Channel::Command(joint), self.rows.iter().map(|row| row.q[joint]).collect());
        }
        if self.rows.iter().any(|row| row.force_n != DVec3::ZERO) {
            for axis in 0..6 {
                let force = |row: &ExperimentRow| if axis < 3 { row.force_n[axis] } else { 0.0 };
                made.set(Channel::Wrench(axis), self.rows.iter().map(force).collect());
            }
            made.metadata.wrench_frame = Some(CoordinateFrame::Base);
        }
        if self.rows.iter().any(|row| row.celsius.is_finite()) {
            let celsius: Vec<f64> = self.rows.iter().map(|row| row.celsius).collect();
            made.set(Channel::Ambient, celsius.clone());
            (0..self.joints).for_each(|j| made.set(Channel::JointTemperature(j), celsius.clone()));
            made.metadata.kind = RecordingKind::Poses;
            made.metadata.approach = DirectionSource::Sequence;
        }
        for channel in &measured.channels {
            made.set(*channel, vec![value; self.rows.len()]);
        }
        made
    }
}

/// All experiments for an arm.
#[must_use]
pub fn catalogue(arm: &Arm) -> Vec<Experiment> {
    let mut all: Vec<Experiment> = Vec::new();
    for joint in 0..arm.count() {
        all.push(single_joint_motion(arm, joint));
        all.push(reversals(arm, joint));
    }
    let side = DVec3::Y * LOAD_N;
    all.push(tour(
        arm,
        "tour",
        "visit the requested poses, with the arm stretched and folded",
        &[DVec3::ZERO],
        false,
    ));
    all.push(tour(
        arm,
        "tour, fast",
        "visit the requested poses once slowly and once fast",
        &[DVec3::ZERO],
        true,
    ));
    all.push(tour(
        arm,
        "tour, hanging load",
        "visit the requested poses twice, first without a load and then with 5 kg hanging on the tool (50 N)",
        &[DVec3::ZERO, -DVec3::Z * LOAD_N],
        false,
    ));
    all.push(tour(
        arm,
        "tour, sideways load",
        "visit the requested poses twice, first without a load and then with a lateral force of 50 N on the tool, along the base's y axis",
        &[DVec3::ZERO, side],
        false,
    ));
    all.push(warm_up(arm));
    all
}

fn unit_index(joint: &Joint) -> usize {
    usize::from(joint.kind == JointKind::Prismatic)
}

/// Least and largest position, at most `most` from the middle.
fn motion_range(joint: &Joint, most: [f64; 2]) -> (f64, f64) {
    let most = most[unit_index(joint)];
    let (low, high) = joint.limits;
    let bounded = low.is_finite() && high.is_finite();
    let middle = if bounded && !(low < 0.0 && 0.0 < high) { 0.5 * (low + high) } else { 0.0 };
    let reach =
        |limit: f64| if limit.is_finite() { RANGE_SHARE * (limit - middle).abs() } else { most };
    (middle - most.min(reach(low)), middle + most.min(reach(high)))
}

fn tour_centre(arm: &Arm) -> Joints {
    let mut q = Joints::default();
    for (slot, joint) in q.iter_mut().zip(arm.joints()) {
        let (low, high) = motion_range(joint, TOUR_REACH);
        *slot = 0.5 * (low + high);
    }
    q
}

/// An experiment under construction.
struct MotionBuilder<'a> {
    arm: &'a Arm,
    rows: Vec<ExperimentRow>,
    now: ExperimentRow,
    fast: bool,
}

impl<'a> MotionBuilder<'a> {
    fn start_at(arm: &'a Arm, q: Joints) -> Self {
        let now =
            ExperimentRow { segment: 0, time_s: 0.0, q, force_n: DVec3::ZERO, celsius: f64::NAN };
        Self { arm, rows: vec![now], now, fast: false }
    }

    fn speed(&self, joint: &Joint) -> f64 {
        let (share, most) =
            if self.fast { (FAST_SPEED_SHARE, FAST_SPEED_MAX) } else { (SPEED_SHARE, SPEED_MAX) };
        (share * joint.max_speed).min(most[unit_index(joint)])
    }

    /// Moves all joints simultaneously with a cosine velocity profile.
    fn move_to(&mut self, q: Joints) {
        let from = self.now.q;
        let times = self.arm.joints().iter().enumerate().map(|(k, joint)| {
            // The profile's peak speed is π/2 times its mean speed.
            FRAC_PI_2 * (q[k] - from[k]).abs() / self.speed(joint)
        });
        let longest = times.fold(0.0, f64::max);
        let count = ((longest / STEP_S).ceil() as usize).max(5);
        for k in 1..=count {
            let part = 0.5 - 0.5 * libm::cos(PI * k as f64 / count as f64);
            self.now.time_s += STEP_S;
            for (slot, (a, b)) in self.now.q.iter_mut().zip(from.iter().zip(&q)) {
                *slot = if k == count { *b } else { a + part * (b - a) };
            }
            self.rows.push(self.now);
        }
    }

    fn move_joint_to(&mut self, joint: usize, position: f64) {
        let mut q = self.now.q;
        q[joint] = position;
        self.move_to(q);
    }

    fn finish(self, name: String, instruction: String) -> Experiment {
        let (joints, rows) = (self.arm.count(), self.rows);
        let kinds = self.arm.joints().iter().map(|joint| joint.kind).collect();
        Experiment { name, says: instruction, rows, joints, kinds }
    }
}

fn single_joint_motion(arm: &Arm, joint: usize) -> Experiment {
    let (low, high) = motion_range(&arm.joints()[joint], SINGLE_JOINT_REACH);
    let mut q = tour_centre(arm);
    q[joint] = low;
    let mut going = MotionBuilder::start_at(arm, q);
    going.move_joint_to(joint, high);
    going.move_joint_to(joint, low);
    let n = joint + 1;
    going.finish(
        format!("joint {n} alone"),
        format!("move joint {n} alone through its range, in both directions"),
    )
}

/// Reversals about two postures in which gravity acts on the joint in opposite directions, as far as such postures exist.
fn reversals(arm: &Arm, joint: usize) -> Experiment {
    let moved_joint = &arm.joints()[joint];
    let [one, other] = gravity_postures(arm, joint);
    let mut going = MotionBuilder::start_at(arm, one);
    for posture in [one, other] {
        going.move_to(posture);
        let unit = if unit_index(moved_joint) == 0 { PI / 180.0 } else { 1e-3 };
        for stroke in STROKES.map(|stroke| stroke * unit) {
            for _ in 0..2 {
                going.move_joint_to(joint, posture[joint] + 0.5 * stroke);
                going.move_joint_to(joint, posture[joint] - 0.5 * stroke);
            }
        }
    }
    let n = joint + 1;
    let unit = if unit_index(moved_joint) == 0 { "degrees" } else { "mm" };
    going.finish(
        format!("joint {n} to and fro"),
        format!(
            "move joint {n} slowly back and forth with strokes of 0.01, 0.1, 1 and 10 {unit}, once with gravity acting in one direction and once in the other"
        ),
    )
}

/// Of the poses of the tour, those with the least and the largest gravity torque at a joint; without masses, those with the least and the largest x
/// coordinate of the tool.
fn gravity_postures(arm: &Arm, joint: usize) -> [Joints; 2] {
    let model = physics::Model::nominal(*arm);
    let pull = |q: &Joints| {
        let evaluation =
            model.evaluate(&physics::Inputs::at_rest(*q), &physics::Memories::default());
        let torque = evaluation.loads.torque(joint);
        let tool = Chain::nominal(arm, q).base_from_tool.origin;
        if arm.bodies().next().is_some() { torque } else { tool.x }
    };
    let mut poses = tour_poses(arm, 4 * TOUR_POSES);
    let stroke = if unit_index(&arm.joints()[joint]) == 0 { 6.0 * PI / 180.0 } else { 6e-3 };
    let (low, high) = motion_range(&arm.joints()[joint], SINGLE_JOINT_REACH);
    for q in &mut poses {
        let inside = (low + stroke).min(high)..=(high - stroke).max(low);
        q[joint] = if inside.contains(&q[joint]) { q[joint] } else { 0.5 * (low + high) };
    }
    let by = |a: &&Joints, b: &&Joints| pull(a).total_cmp(&pull(b));
    let weakest = poses.iter().min_by(by).copied().unwrap_or_else(|| tour_centre(arm));
    [weakest, poses.iter().max_by(by).copied().unwrap_or(weakest)]
}

fn tour_poses(arm: &Arm, count: usize) -> Vec<Joints> {
    let pose = |row: usize| {
        let mut q = Joints::default();
        for (k, (slot, joint)) in q.iter_mut().zip(arm.joints()).enumerate() {
            let (low, high) =
                motion_range(joint, if k < 3 { TOUR_REACH } else { SINGLE_JOINT_REACH });
            let part = ((row + 1) as f64 * IRRATIONALS[k % 6] + (k / 6) as f64 * 0.31).fract();
            *slot = low + part * (high - low);
        }
        q
    };
    (0..count).map(pose).collect()
}

/// The same poses under each of these forces, and once more at high speed if `fast`.
fn tour(arm: &Arm, name: &str, instruction: &str, forces: &[DVec3], fast: bool) -> Experiment {
    let poses = tour_poses(arm, TOUR_POSES);
    let mut going = MotionBuilder::start_at(arm, poses[0]);
    for (round, force) in forces.iter().enumerate() {
        if round > 0 {
            going.now.segment += 1;
            going.now.time_s += 1.0;
            going.now.q = poses[0];
            going.now.force_n = *force;
            going.rows.push(going.now);
        }
        poses[1..].iter().for_each(|q| going.move_to(*q));
    }
    if fast {
        going.fast = true;
        poses.iter().for_each(|q| going.move_to(*q));
    }
    going.finish(name.to_owned(), instruction.to_owned())
}

fn warm_up(arm: &Arm) -> Experiment {
    let poses = tour_poses(arm, 10);
    let mut going = MotionBuilder::start_at(arm, poses[0]);
    going.rows.clear();
    for visit in 0..RETURNS * poses.len() {
        let time_s = RETURN_S * visit as f64;
        let celsius = WARM_CELSIUS - (WARM_CELSIUS - COLD_CELSIUS) * libm::exp(-time_s / WARMING_S);
        going.rows.push(ExperimentRow {
            time_s,
            q: poses[visit % poses.len()],
            celsius,
            ..going.now
        });
    }
    going.finish(
        "warm-up".to_owned(),
        "warm up the cold robot for 2 h, record the temperatures, and return to the same ten poses every 5 min".to_owned(),
    )
}
