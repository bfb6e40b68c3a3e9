//! Simulated measurements of instruments, in the columns and rows of a recording.
//!
//! Values are written where one was measured (in all rows, if a column is present but empty); the
//! noise of a row depends only on the seed and the row. Targets on the base or on a link are not
//! changed; currents, accelerations, and torques without a model are omitted and listed. Forces of
//! a cut: [`forces`].

pub mod forces;

use glam::{DMat3, DQuat, DVec3};
use physics::frame::rotation_from_vector;
use physics::{Arm, Frame, Joints};
use recording::series::{Channel, InputKind, Recording};

use crate::forward::ArmState;
use crate::random::{Purpose, normals};

/// Motion of the arm in each row of a recording.
#[derive(Clone, Debug)]
pub struct SimulatedMotion {
    /// Positions of joints and tool in each row.
    pub states: Vec<ArmState>,
    /// Simulated torques, Nm or N; none if not requested.
    pub torques: Option<Vec<Joints>>,
}

/// Instruments that measure an arm.
pub struct Instrument<'a> {
    /// Base coordinates to measuring coordinates in a row.
    pub measuring_from_base: &'a dyn Fn(usize) -> Frame,
    /// Targets on the tool, tool frame, m.
    pub targets_tool_m: &'a [DVec3],
    /// Whether measured positions are in the base frame.
    pub in_base: bool,
    /// Standard deviation, m and rad; 0 or above.
    pub noise: f64,
    /// Standard deviation of torques, Nm and N; 0 or above.
    pub torque_noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// A recording with simulated measurements.
#[derive(Clone, Debug)]
pub struct Readings {
    /// The recording with its measured columns replaced.
    pub recording: Recording,
    /// Columns that were simulated.
    pub columns: Vec<String>,
    /// Columns that were measured and cannot be simulated.
    pub left_out: Vec<String>,
    /// Columns whose noise exceeds the recording's stated uncertainty.
    pub understated: Vec<String>,
    /// Recorded minus simulated points without noise, rms over single values, m.
    pub recorded_rms_m: Option<f64>,
    /// Rows in which a joint's load exceeds the validity range of its stiffness.
    pub rows_beyond: usize,
}

impl Readings {
    /// Without a simulated arm: the known process data is written to every row.
    ///
    /// ```
    /// use recording::series::Recording;
    /// use world::instrument::Readings;
    ///
    /// let readings = Readings::without_arm(Recording::new(vec![0.0, 0.1]));
    /// assert!(readings.columns.is_empty());
    /// ```
    #[must_use]
    pub fn without_arm(mut recording: Recording) -> Self {
        recording.hold_inputs();
        let (columns, left_out, understated) = Default::default();
        Self { recording, columns, left_out, understated, recorded_rms_m: None, rows_beyond: 0 }
    }
}

impl Instrument<'_> {
    /// The recording of an arm with its measured columns replaced.
    #[must_use]
    pub fn read(&self, arm: &Arm, mut recording: Recording, run: &SimulatedMotion) -> Readings {
        let left_out = remove_unsimulated(&mut recording, run);
        let wanted = simulated_columns(&recording, run);
        let columns = self.columns(&wanted, &recording, run);
        let mut understated = Vec::new();
        let squares = PointResiduals::of(&wanted, &columns, &recording);
        for (channel, (mut exact, noise)) in wanted.iter().zip(columns) {
            let has_value = recording.rows_with_values(*channel);
            for (row, (value, noise)) in exact.iter_mut().zip(noise).enumerate() {
                *value = if has_value(row) { *value + noise } else { f64::NAN };
            }
            let sigma = match channel {
                // The components of a quaternion change by half the angle.
                Channel::Orientation(_) => 0.5 * self.noise,
                Channel::Torque(_) => self.torque_noise,
                _ => self.noise,
            };
            if sigma > 0.0 {
                // The stated uncertainty of an instrument may include more than noise, such as the
                // residual of its calibration or the seat of a reflector.
                let stated = *recording.metadata.sigma.entry(*channel).or_insert(sigma);
                if sigma > stated {
                    understated.push(channel.base());
                }
            }
            if let Some(joint) = channel.joint() {
                recording.set_joint_kind(joint, arm.joints()[joint].kind);
            }
            recording.set(*channel, exact);
        }
        recording.metadata.measured_in_base = self.in_base;
        let columns = wanted.iter().map(|channel| channel.base()).collect();
        let rows_beyond = run.states.iter().filter(|state| state.beyond).count();
        let recorded_rms_m = squares.rms();
        Readings { recording, columns, left_out, understated, recorded_rms_m, rows_beyond }
    }

    /// Exact values and noise of each wanted column.
    fn columns(
        &self,
        wanted: &[Channel],
        recording: &Recording,
        run: &SimulatedMotion,
    ) -> Vec<(Vec<f64>, Vec<f64>)> {
        let mut columns =
            vec![
                (Vec::with_capacity(run.states.len()), Vec::with_capacity(run.states.len()));
                wanted.len()
            ];
        let mut before = DQuat::IDENTITY;
        for (row, state) in run.states.iter().enumerate() {
            let mut of_torque = normals(self.seed, Purpose::Torque, row as u32);
            let mut normal = normals(self.seed, Purpose::Tracker, row as u32);
            let mut draw = || self.noise * normal();
            let turned = DVec3::from_array(std::array::from_fn(|_| draw()));
            let measuring_from_tool = (self.measuring_from_base)(row).after(&state.base_from_tool);
            let exact = quaternion(&measuring_from_tool.rotation, recorded(recording, row), before);
            let read = rotation_from_vector(turned) * measuring_from_tool.rotation;
            let read = quaternion(&read, None, exact);
            before = exact;
            for (channel, (values, noise)) in wanted.iter().zip(&mut columns) {
                let (value, error) = match *channel {
                    Channel::Position(axis) => (measuring_from_tool.origin[axis], draw()),
                    Channel::Target(target, axis) => {
                        let place = self.targets_tool_m.get(target).copied().unwrap_or(DVec3::NAN);
                        (measuring_from_tool.point(place)[axis], draw())
                    }
                    Channel::Orientation(part) => {
                        (parts(exact)[part], parts(read)[part] - parts(exact)[part])
                    }
                    Channel::Motor(joint) => (state.motor[joint], draw()),
                    Channel::Link(joint) => (state.link[joint], draw()),
                    Channel::Torque(joint) => {
                        let torque = run.torques.as_ref().map_or(f64::NAN, |all| all[row][joint]);
                        (torque, self.torque_noise * of_torque())
                    }
                    _ => (f64::NAN, 0.0),
                };
                values.push(value);
                noise.push(error);
            }
        }
        columns
    }
}

/// Removes measured columns that cannot be simulated; returns their names.
fn remove_unsimulated(recording: &mut Recording, run: &SimulatedMotion) -> Vec<String> {
    let foreign = |channel: &Channel| match channel {
        Channel::Current(_) | Channel::Acceleration(_) => true,
        Channel::Torque(_) => run.torques.is_none(),
        _ => false,
    };
    let left: Vec<Channel> = recording.channels().filter(foreign).collect();
    for channel in &left {
        recording.remove(*channel);
        recording.metadata.sigma.remove(channel);
    }
    if left.iter().any(|channel| matches!(channel, Channel::Current(_))) {
        recording.metadata.torque_per_ampere.clear();
    }
    left.iter().map(|channel| channel.base()).collect()
}

/// Columns that are simulated: those that were measured, the tool's position if there are none.
fn simulated_columns(recording: &Recording, run: &SimulatedMotion) -> Vec<Channel> {
    let motor_is_input = recording.input_kind() == InputKind::Motor;
    let on_links = &recording.metadata.targets_on_link;
    let simulated = |channel: &Channel| match channel {
        Channel::Target(target, _) if on_links.contains_key(target) => false,
        Channel::Motor(_) => !motor_is_input,
        Channel::Link(_) | Channel::Position(_) | Channel::Target(..) | Channel::Orientation(_) => {
            true
        }
        Channel::Torque(_) => run.torques.is_some(),
        _ => false,
    };
    let mut wanted: Vec<Channel> = recording.channels().filter(simulated).collect();
    if wanted.is_empty() {
        wanted.extend((0..3).map(Channel::Position));
    }
    wanted
}

fn parts(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

fn recorded(recording: &Recording, row: usize) -> Option<DQuat> {
    let part = |k: usize| recording.column(Channel::Orientation(k)).map(|column| column[row]);
    let [w, x, y, z] = [part(0)?, part(1)?, part(2)?, part(3)?];
    Some(DQuat::from_xyzw(x, y, z, w)).filter(|q| q.is_finite())
}

/// Of the two quaternions of a rotation the one nearer to the recorded one, or else to the previous
/// one.
fn quaternion(rotation: &DMat3, recorded: Option<DQuat>, before: DQuat) -> DQuat {
    let q = DQuat::from_mat3(rotation).normalize();
    if q.dot(recorded.unwrap_or(before)) < 0.0 { -q } else { q }
}

/// Recorded minus simulated, of points.
#[derive(Default)]
struct PointResiduals {
    sum: f64,
    count: usize,
}

impl PointResiduals {
    fn of(wanted: &[Channel], columns: &[(Vec<f64>, Vec<f64>)], recording: &Recording) -> Self {
        let mut squares = Self::default();
        for (channel, (values, _)) in wanted.iter().zip(columns) {
            if !matches!(channel, Channel::Position(_) | Channel::Target(..)) {
                continue;
            }
            for (recorded, made) in
                recording.column(*channel).unwrap_or_default().iter().zip(values)
            {
                if recorded.is_finite() {
                    squares.sum += (recorded - made) * (recorded - made);
                    squares.count += 1;
                }
            }
        }
        squares
    }

    fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}
