//! Force domain of `trued simulate`: sensor readings for the cut described in the recording's `[cut]`.
//!
//! Forces are written where forces were measured (in all rows, if a column is present but empty);
//! the noise of a row depends on the seed and the row alone. Moments are not simulated; their
//! columns are omitted and named.

use glam::DVec3;
use physics::Model;
use recording::series::{Channel, Cut, Recording};
use world::milling::{self, Row};
use world::random::{Purpose, normals};

use super::instrument::mask;
use super::lacking;
use crate::exit::Failure;

/// Names of simulated columns, and of omitted ones.
#[derive(Default)]
pub(super) struct Read {
    pub(super) columns: Vec<String>,
    pub(super) left_out: Vec<String>,
}

/// Replaces the measured forces of a recording by the model's; `noise` in N.
pub(super) fn read(
    model: &Model,
    recording: &mut Recording,
    noise: f64,
    seed: u64,
) -> Result<Read, Failure> {
    let Some(cut) = recording.about.cut.clone() else { return Ok(Read::default()) };
    let forces = forces(model, &cut, recording)?;
    let mut said = Read::default();
    for moment in (3..6).map(Channel::Wrench) {
        if recording.remove(moment).is_some() {
            recording.about.sigma.remove(&moment);
            said.left_out.push(moment.base());
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
        let stands = mask(recording, channel);
        let value = |row: usize| if stands(row) { readings[row][axis] } else { f64::NAN };
        recording.set(channel, (0..readings.len()).map(value).collect());
        if noise > 0.0 {
            recording.about.sigma.insert(channel, noise);
        }
        said.columns.push(channel.base());
    }
    Ok(said)
}

/// What the sensor reads in each row, N.
pub(super) fn forces(
    model: &Model,
    cut: &Cut,
    recording: &Recording,
) -> Result<Vec<DVec3>, Failure> {
    Ok(milling::readings(model, &cut.cutter(), &rows(recording)?))
}

/// The recording's process data.
fn rows(recording: &Recording) -> Result<Vec<Row>, Failure> {
    let column = |channel: Channel, name: &str| {
        recording.column(channel).ok_or_else(|| {
            let file = recording.file.display();
            lacking(format!(
                "{file}: has a [cut] and no column `{name}`: give it, or a constant in a mapping"
            ))
        })
    };
    let speed = column(Channel::Spindle, "spindle_rpm")?;
    let feed = column(Channel::Feed, "feed_mm_s")?;
    let row = |k: usize| Row {
        t_s: recording.t_s[k],
        segment: recording.segment[k],
        spindle_rpm: speed[k],
        feed_m_s: feed[k],
    };
    Ok((0..recording.len()).map(row).collect())
}
