//! Simulated measurements of a force sensor for the cut described by a recording's `[cut]`.
//!
//! Forces are written where forces were measured (in all rows, if a column is present but empty); the noise of a row depends only on the seed and the
//! row. Moments are not simulated; their columns are omitted and listed.

use glam::DVec3;
use physics::Model;
use recording::series::{Channel, Cut, Recording};

use crate::milling::{self, Row};
use crate::random::{Purpose, normals};

/// A recording has a `[cut]` and lacks a column that the cut needs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: has a [cut] and no column `{column}`: give it, or a constant in a mapping")]
pub struct ProcessColumnMissing {
    /// The recording.
    pub file: String,
    /// The column.
    pub column: &'static str,
}

/// Names of simulated columns, and of omitted ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ForceColumns {
    /// Columns that were simulated.
    pub columns: Vec<String>,
    /// Columns that were measured and cannot be simulated.
    pub left_out: Vec<String>,
}

/// Replaces the measured forces of a recording by those of the cut that its `[cut]` describes; nothing without one. `model` has the effects of cutter
/// and sensor; `noise`: standard deviation, N.
///
/// ```
/// use recording::model::RobotModel;
/// use recording::series::Recording;
/// use world::instrument::forces;
///
/// let model = RobotModel::read("irb120".as_ref()).expect("a preset").physics;
/// let mut recording = Recording::new(vec![0.0, 0.1]);
/// let read = forces::read(&model, &mut recording, 0.0, 1).expect("no cut needs no column");
/// assert!(read.columns.is_empty());
/// ```
///
/// # Errors
/// Spindle speed or feed is missing.
pub fn read(
    model: &Model,
    recording: &mut Recording,
    noise: f64,
    seed: u64,
) -> Result<ForceColumns, ProcessColumnMissing> {
    let Some(cut) = recording.metadata.cut.clone() else { return Ok(ForceColumns::default()) };
    let forces = exact(model, &cut, recording)?;
    let mut found = ForceColumns::default();
    for moment in (3..6).map(Channel::Wrench) {
        if recording.remove(moment).is_some() {
            recording.metadata.sigma.remove(&moment);
            found.left_out.push(moment.base());
        }
    }
    let is_there = |channel: &Channel| recording.column(*channel).is_some();
    let mut wanted: Vec<usize> = (0..3).filter(|k| is_there(&Channel::Wrench(*k))).collect();
    if wanted.is_empty() {
        wanted.extend(0..3);
    }
    let noisy = |(row, force): (usize, &DVec3)| {
        let mut normal = normals(seed, Purpose::Force, row as u32);
        let noise: [f64; 3] = std::array::from_fn(|_| noise * normal());
        *force + DVec3::from_array(noise)
    };
    let readings: Vec<DVec3> = forces.iter().enumerate().map(noisy).collect();
    for axis in wanted {
        let channel = Channel::Wrench(axis);
        let has_value = recording.rows_with_values(channel);
        let value = |row: usize| if has_value(row) { readings[row][axis] } else { f64::NAN };
        recording.set(channel, (0..readings.len()).map(value).collect());
        if noise > 0.0 {
            recording.metadata.sigma.insert(channel, noise);
        }
        found.columns.push(channel.base());
    }
    Ok(found)
}

/// Measured force in each row of a cut without noise, N.
///
/// # Errors
/// Spindle speed or feed is missing.
pub fn exact(
    model: &Model,
    cut: &Cut,
    recording: &Recording,
) -> Result<Vec<DVec3>, ProcessColumnMissing> {
    let column = |channel: Channel, column: &'static str| {
        let file = || recording.file.display().to_string();
        recording.column(channel).ok_or_else(|| ProcessColumnMissing { file: file(), column })
    };
    let speed = column(Channel::Spindle, "spindle_rpm")?;
    let feed = column(Channel::Feed, "feed_mm_s")?;
    let row = |k: usize| Row {
        t_s: recording.t_s[k],
        segment: recording.segment[k],
        spindle_rpm: speed[k],
        feed_m_s: feed[k],
    };
    let rows: Vec<Row> = (0..recording.len()).map(row).collect();
    Ok(milling::measured_forces(model, &cut.cutter(), &rows))
}
