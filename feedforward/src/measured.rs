//! Error of each joint from a measured run, on the rows of the path.
//!
//! Link-side joint positions are used if available, otherwise those of the motor side; points of the tool are converted to joints by damped least squares
//! (`Δq = Jᵀ (J Jᵀ + μ² I)⁻¹ Δx`), with minimum norm and free orientation.
//! For an unknown measuring frame the best-fit rigid motion is removed (Horn 1987), so that form and timing of the path remain.
//!
//! Missing samples are interpolated (`world::forward::positions_at`). The model is not fitted.

use crate::FeedforwardError;
use crate::grid::median_step_s;
use crate::settings::Settings;
use crate::tool::points;
use diagnosis::campaign_import::{self, CampaignError};
use diagnosis::rigid_motion::fit_rigid_motion;
use glam::{DMat3, DVec3};
use joint_dynamics::plant::{Plant, Plants};
use physics::{Arm, Chain, Inputs, JointKind, Joints, Model};
use recording::series::{Channel, Recording};
use world::dynamics::Dynamics;
use world::forward::{self, positions_at};

/// Damping of the step from a point to joints, m per rad: directions in which the tool moves less
/// than this are hardly used.
const DAMPING_M: f64 = 0.02;
/// Units are compared where a joint moves by more than this, rad or m, root mean square; smaller motion may be lost in noise.
const MIN_MOTION_RMS: f64 = 1e-3;
/// Least squared correlation of the measured with the commanded motion for which their ratio is that of units.
const MIN_SQUARED_CORRELATION: f64 = 0.8;
/// The ratio of two motions is that of two units within this share.
const UNIT_TOLERANCE: f64 = 0.2;
/// Largest clock offset of the search, s, and its steps, s.
const OFFSET_MOST_S: f64 = 1.0;
const OFFSET_STEP_S: f64 = 1e-3;

/// A delay is compared with the model's where it explains at least this share, 0 to 1, of the squares that the model does not explain. Origin: a
/// choice.
const MIN_EXPLAINED_POWER: f64 = 0.75;
/// Largest lateness that is searched, s, and the steps of the search, s. Origin: a choice.
const LATE_MOST_S: f64 = 0.12;
const LATE_STEPS_S: [f64; 3] = [6e-3, 6e-4, 6e-5];

/// Relation of the measurement's clock to that of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// Added to the times of the measurement, s; 0 for a common clock.
    Offset(f64),
    /// The offset is estimated by the best agreement with the model's prediction.
    Unknown,
}

/// The measured quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredQuantity {
    /// The joint's link.
    Link,
    /// The joint's motor.
    Motor,
    /// The tool.
    Tool,
}

/// Targets and predictions of the joints of a path, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Expected<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Times of the rows, s.
    pub times_s: &'a [f64],
    /// Targets of the motors, rad or m, a list per joint.
    pub motors: &'a [Vec<f64>],
    /// Targets of the links.
    pub links: &'a [Vec<f64>],
    /// Joints that give the target of the tool by the controller's geometry.
    pub tool: &'a [Vec<f64>],
    /// Errors of the joints predicted by the model for the commands sent, rad or m.
    pub error: &'a [Vec<f64>],
    /// Delay and lags of the model.
    pub timing: Timing,
}

/// Delay and lags of the slowest joint by the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Their sum, s.
    pub lag_s: f64,
    /// Its standard uncertainty, s.
    pub sigma_s: f64,
}

impl Timing {
    /// Of a model.
    #[must_use]
    pub fn of(plants: &Plants) -> Self {
        let of_joint = |plant: &Plant| {
            let all = || plant.delays_s.iter().chain(&plant.lags_s);
            let variance: f64 = all().map(|number| number.sigma * number.sigma).sum();
            Self { lag_s: all().map(|number| number.value).sum(), sigma_s: variance.sqrt() }
        };
        let none = Self { lag_s: 0.0, sigma_s: 0.0 };
        plants.joints.iter().map(of_joint).fold(none, |most, one| Self {
            lag_s: most.lag_s.max(one.lag_s),
            sigma_s: most.sigma_s.max(one.sigma_s),
        })
    }

    /// The largest lateness of a plant within the uncertainty of its model, s.
    #[must_use]
    pub fn uncertainty_s(&self, settings: &Settings) -> f64 {
        settings.sigmas * self.sigma_s
    }

    /// The largest lateness of a plant for which a step is robust, s; at least a row of the path.
    fn most_s(&self, settings: &Settings, step_s: f64) -> f64 {
        (settings.robust_to * self.lag_s + self.uncertainty_s(settings)).max(step_s)
    }
}

/// The errors of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredErrors {
    /// Measured quantity and error (target minus measured, rad or m) per joint; `None` without a
    /// measurement.
    pub joints: Vec<Option<(MeasuredQuantity, Vec<f64>)>>,
    /// Offset added to the times of the measurement, s.
    pub clock_offset_s: f64,
    /// What the measurement is later than the model predicts from the commands, s, after that offset; 0 where it
    /// is not later or earlier, or where a delay does not explain the difference.
    pub late_s: f64,
}

/// Positions of the links for motors at `motors` on the path of `recording`, by all effects of the
/// model except delay, lag and modes, rad or m.
///
/// # Errors
/// A recording that lacks a joint.
pub fn links(
    model: &Model,
    recording: &Recording,
    motors: &[Vec<f64>],
) -> Result<Vec<Vec<f64>>, CampaignError> {
    let mut static_path = recording.clone();
    for (joint, motor) in motors.iter().enumerate() {
        static_path.set(Channel::Command(joint), motor.clone());
    }
    let rows = campaign_import::motion(&model.arm, &static_path)?;
    let inputs: Vec<Inputs> = rows.iter().map(|row| row.inputs).collect();
    let quantity = forward::path(model, &Dynamics::default(), &inputs);
    let link = |joint: usize| quantity.iter().map(|quantity| quantity.link[joint]).collect();
    Ok((0..motors.len()).map(link).collect())
}

/// A column of a measurement, at its own sampling times.
struct Column {
    times_s: Vec<f64>,
    values: Vec<f64>,
}

impl Column {
    fn of(recording: &Recording, channel: Channel) -> Option<Self> {
        let samples = recording.column(channel)?;
        let sampled = recording.t_s.iter().zip(samples).filter(|(_, value)| value.is_finite());
        let (times_s, values): (Vec<f64>, Vec<f64>) = sampled.unzip();
        (times_s.len() >= crate::grid::ROWS_LEAST).then_some(Self { times_s, values })
    }

    fn at(&self, times_s: &[f64], offset_s: f64) -> Vec<f64> {
        let at_s: Vec<f64> = times_s.iter().map(|t_s| t_s - offset_s).collect();
        positions_at(&self.times_s, &self.values, &at_s)
    }
}

/// The columns of a run.
struct Run<'a> {
    expected: Expected<'a>,
    joints: Vec<Option<(MeasuredQuantity, Column)>>,
    tool: Option<[Column; 3]>,
    in_base: bool,
}

impl MeasuredErrors {
    /// The errors of a path measured in `recording`.
    ///
    /// # Errors
    /// Nothing measured, a sampling that is too coarse, a motion that is not covered, an error beyond the settings' bound.
    pub fn of(
        recording: &Recording,
        expected: Expected<'_>,
        clock: Clock,
        settings: &Settings,
    ) -> Result<Self, FeedforwardError> {
        let segments = recording.segment.chunk_by(|a, b| a == b).count();
        if segments > 1 {
            return Err(FeedforwardError::Segments(segments));
        }
        let run = Run::of(recording, expected)?;
        settings.check_step("the measurement", median_step_s(run.times_s())?)?;
        let clock_offset_s = match clock {
            Clock::Offset(offset_s) => offset_s,
            Clock::Unknown => run.offset_s(),
        };
        run.check_covered(clock_offset_s)?;
        let late_s = if clock == Clock::Unknown { 0.0 } else { run.late_s(clock_offset_s) };
        let joints = run.errors(clock_offset_s);
        run.check_units(&joints)?;
        run.check_timing(late_s, settings)?;
        for (joint, (_, errors)) in
            joints.iter().enumerate().filter_map(|(i, e)| Some((i, e.as_ref()?)))
        {
            let beyond = errors.iter().position(|error| error.abs() > settings.error_max);
            if let Some(row) = beyond {
                let (joint, most) = (joint + 1, settings.error_max);
                let (error, t_s) = (errors[row].abs(), expected.times_s[row]);
                return Err(FeedforwardError::TooFarOff { joint, error, t_s, most });
            }
        }
        Ok(Self { joints, clock_offset_s, late_s })
    }
}

impl<'a> Run<'a> {
    fn of(recording: &Recording, expected: Expected<'a>) -> Result<Self, FeedforwardError> {
        let axis = |axis| Column::of(recording, Channel::Position(axis));
        let tool = axis(0).zip(axis(1)).zip(axis(2)).map(|((x, y), z)| [x, y, z]);
        let joint = |joint: usize| {
            let link =
                Column::of(recording, Channel::Link(joint)).map(|c| (MeasuredQuantity::Link, c));
            link.or_else(|| {
                Column::of(recording, Channel::Motor(joint))
                    .map(|column| (MeasuredQuantity::Motor, column))
            })
        };
        let joints: Vec<_> = (0..expected.arm.count()).map(joint).collect();
        if tool.is_none() && joints.iter().all(Option::is_none) {
            return Err(FeedforwardError::NothingMeasured);
        }
        let in_base = recording.metadata.measured_in_base;
        Ok(Self { expected, joints, tool, in_base })
    }

    /// The times of the first column that is used.
    fn times_s(&self) -> &[f64] {
        let joint = self.joints.iter().flatten().next().map(|(_, column)| column);
        let column = self.tool.as_ref().map(|tool| &tool[0]).or(joint);
        column.map_or(&[], |column| &column.times_s)
    }

    fn errors(&self, offset_s: f64) -> Vec<Option<(MeasuredQuantity, Vec<f64>)>> {
        if let Some(tool) = &self.tool {
            let joints = self.errors_of_tool(tool, offset_s);
            return joints
                .into_iter()
                .map(|errors| Some((MeasuredQuantity::Tool, errors)))
                .collect();
        }
        let Expected { times_s, motors, links, .. } = self.expected;
        let of_joint = |(joint, column): (usize, &Option<(MeasuredQuantity, Column)>)| {
            let (quantity, column) = column.as_ref()?;
            let wanted =
                if *quantity == MeasuredQuantity::Motor { &motors[joint] } else { &links[joint] };
            let measured = column.at(times_s, offset_s);
            Some((*quantity, wanted.iter().zip(measured).map(|(w, m)| w - m).collect()))
        };
        self.joints.iter().enumerate().map(of_joint).collect()
    }

    fn errors_of_tool(&self, tool: &[Column; 3], offset_s: f64) -> Vec<Vec<f64>> {
        let Expected { arm, times_s, tool: wanted, .. } = self.expected;
        let [x, y, z] = [0, 1, 2].map(|axis| tool[axis].at(times_s, offset_s));
        let measured: Vec<DVec3> =
            (0..times_s.len()).map(|k| DVec3::new(x[k], y[k], z[k])).collect();
        let wanted_points = points(arm, wanted);
        let motion = if self.in_base { None } else { fit_rigid_motion(&measured, &wanted_points) };
        let mut errors = vec![Vec::with_capacity(times_s.len()); arm.count()];
        for (row, (measured, point)) in measured.iter().zip(wanted_points).enumerate() {
            let measured = motion.map_or(*measured, |motion| motion.point(*measured));
            let mut q = Joints::default();
            q.iter_mut().zip(wanted).for_each(|(q, joint)| *q = joint[row]);
            let step = joint_step(arm, &q, point - measured);
            errors.iter_mut().zip(step).for_each(|(errors, step)| errors.push(step));
        }
        errors
    }

    /// Squares of what the model does not predict of the errors, without their means.
    fn unexplained(&self, offset_s: f64) -> f64 {
        let of_joint = |(errors, expected): (&Option<(MeasuredQuantity, Vec<f64>)>, &Vec<f64>)| {
            let Some((_, errors)) = errors else { return 0.0 };
            let differences: Vec<f64> = errors.iter().zip(expected).map(|(e, x)| e - x).collect();
            let mean = differences.iter().sum::<f64>() / differences.len() as f64;
            differences.iter().map(|difference| (difference - mean).powi(2)).sum::<f64>()
        };
        self.errors(offset_s).iter().zip(self.expected.error).map(of_joint).sum()
    }

    /// Of evenly spaced offsets that with the best agreement, s.
    fn nearest_offset_s(&self, around_s: f64, step_s: f64, steps: i32) -> f64 {
        let offsets = (-steps..=steps).map(|k| around_s + f64::from(k) * step_s);
        let all = offsets.map(|offset_s| (offset_s, self.unexplained(offset_s)));
        let least = all.min_by(|a, b| a.1.total_cmp(&b.1));
        least.map_or(around_s, |(offset_s, _)| offset_s)
    }

    /// The offset with the best agreement between measurement and prediction, s.
    fn offset_s(&self) -> f64 {
        let coarse_s = self.nearest_offset_s(0.0, OFFSET_MOST_S / 50.0, 50);
        let fine_s = self.nearest_offset_s(coarse_s, OFFSET_STEP_S, 20);
        self.nearest_offset_s(fine_s, OFFSET_STEP_S / 20.0, 20)
    }

    /// What the measurement is later than the prediction at an offset, s; 0 where a delay explains too little.
    fn late_s(&self, offset_s: f64) -> f64 {
        let steps = |step_s: f64, range_s: f64| (range_s / step_s).round() as i32;
        let [coarse_s, medium_s, fine_s] = LATE_STEPS_S;
        let best_s = self.nearest_offset_s(offset_s, coarse_s, steps(coarse_s, LATE_MOST_S));
        let best_s = self.nearest_offset_s(best_s, medium_s, steps(medium_s, coarse_s));
        let best_s = self.nearest_offset_s(best_s, fine_s, steps(fine_s, medium_s));
        let left = self.unexplained(best_s) / self.unexplained(offset_s).max(f64::MIN_POSITIVE);
        if left < 1.0 - MIN_EXPLAINED_POWER { offset_s - best_s } else { 0.0 }
    }

    /// Checks that the measurement is no later or earlier than a plant for which learning converges.
    fn check_timing(&self, late_s: f64, settings: &Settings) -> Result<(), FeedforwardError> {
        let Expected { times_s, timing, .. } = self.expected;
        let most_s = timing.most_s(settings, times_s[1] - times_s[0]);
        if late_s.abs() <= most_s {
            return Ok(());
        }
        let (excess_ms, most_ms, is_late) = (late_s.abs() * 1e3, most_s * 1e3, late_s > 0.0);
        Err(FeedforwardError::ClockMismatch { excess_ms, is_late, most_ms })
    }

    /// Checks that no joint was measured in degrees and read as radians, or the other way round.
    fn check_units(
        &self,
        joints: &[Option<(MeasuredQuantity, Vec<f64>)>],
    ) -> Result<(), FeedforwardError> {
        let Expected { motors, links, arm, .. } = self.expected;
        for (index, joint) in arm.joints().iter().enumerate() {
            let (wanted, errors) = match joints.get(index) {
                Some(Some((MeasuredQuantity::Link, errors))) => (&links[index], errors),
                Some(Some((MeasuredQuantity::Motor, errors))) => (&motors[index], errors),
                _ => continue,
            };
            let factor = motion_scale(wanted, errors).unwrap_or(1.0);
            let is = |expected: f64| (factor / expected - 1.0).abs() < UNIT_TOLERANCE;
            let mistaken = match joint.kind {
                JointKind::Revolute if is(1f64.to_radians()) => "radians in a column of degrees",
                JointKind::Revolute if is(1f64.to_degrees()) => "degrees in a column of radians",
                JointKind::Prismatic if is(1e-3) => "metres in a column of millimetres",
                JointKind::Prismatic if is(1e3) => "millimetres in a column of metres",
                _ => continue,
            };
            return Err(FeedforwardError::OtherUnit { joint: index + 1, factor, mistaken });
        }
        Ok(())
    }

    /// Checks that the measurement lasts as long as the path moves.
    fn check_covered(&self, offset_s: f64) -> Result<(), FeedforwardError> {
        let Expected { times_s, motors, .. } = self.expected;
        let moves = |row: &usize| motors.iter().any(|joint| joint[*row] != joint[*row + 1]);
        let first = (0..times_s.len() - 1).find(moves);
        let last = (0..times_s.len() - 1).rfind(moves);
        let (Some(first), Some(last)) = (first, last) else { return Ok(()) };
        let measured = self.times_s();
        let (Some(from_s), Some(to_s)) = (measured.first(), measured.last()) else {
            return Err(FeedforwardError::NothingMeasured);
        };
        let (from_s, to_s) = (from_s + offset_s, to_s + offset_s);
        let (moves_from_s, moves_to_s) = (times_s[first], times_s[last + 1]);
        // A sample of the path may be missing at each end.
        let step_s = times_s[1] - times_s[0];
        if from_s <= moves_from_s + step_s && to_s >= moves_to_s - step_s {
            return Ok(());
        }
        Err(FeedforwardError::Uncovered { from_s, to_s, moves_from_s, moves_to_s })
    }
}

/// Measured over wanted motion about their means, where the joint moves and both have one shape; `errors`: wanted minus measured.
fn motion_scale(wanted: &[f64], errors: &[f64]) -> Option<f64> {
    let rows = wanted.len() as f64;
    let measured: Vec<f64> = wanted.iter().zip(errors).map(|(w, error)| w - error).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / rows;
    let (w, m) = (mean(wanted), mean(&measured));
    let (mut ww, mut wm, mut mm) = (0.0, 0.0, 0.0);
    for (wanted, measured) in wanted.iter().zip(&measured) {
        let (wanted, measured) = (wanted - w, measured - m);
        (ww, wm, mm) = (ww + wanted * wanted, wm + wanted * measured, mm + measured * measured);
    }
    let moves = ww > rows * MIN_MOTION_RMS * MIN_MOTION_RMS;
    (moves && wm * wm > MIN_SQUARED_CORRELATION * ww * mm).then(|| wm / ww)
}

/// The step of the joints that moves the tool by `by` at `q`.
fn joint_step(arm: &Arm, q: &Joints, by: DVec3) -> Vec<f64> {
    let chain = Chain::nominal(arm, q);
    let columns: Vec<DVec3> = (arm.joints().iter().enumerate())
        .map(|(i, joint)| chain.motion_of(i, joint.kind).0)
        .collect();
    let mut square = DMat3::from_diagonal(DVec3::splat(DAMPING_M * DAMPING_M));
    for column in &columns {
        square += DMat3::from_cols(*column * column.x, *column * column.y, *column * column.z);
    }
    let force = square.inverse() * by;
    columns.iter().map(|column| column.dot(force)).collect()
}

#[cfg(test)]
mod tests;
