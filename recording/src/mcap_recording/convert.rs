//! Converts an MCAP recording to `trued.recording/1`, without loss.
//!
//! Fields with a column in `trued.recording/1` are written there; the rest of each cycle gets columns with
//! other names, as text that reads back to the same bits. Times of all tables count from the first cycle, or,
//! without cycles, from the first force sample; `command_ns` keeps the absolute time. Each model gets a
//! separate recording, and so do force blocks.

use super::records::{CycleRecord, ForceRecord, Record};
use super::{Contents, Header};
use physics::JointKind;

use crate::series::{Channel, CoordinateFrame, Recording, number_text};

/// Cycles of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// The header with that model; `None` if the file does not contain it.
    pub header: Option<Header>,
    /// One row per cycle.
    pub cycles: Recording,
}

/// The tables of an MCAP recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversion {
    /// One per model, in order of time, because a table refers to one model; empty without cycles.
    pub runs: Vec<Run>,
    /// One row per force sample; none without force blocks.
    pub forces: Option<Recording>,
    /// Number of infinite values, which were replaced by missing samples.
    pub not_finite: usize,
    /// Whether the times of the force samples are of another clock than those of the cycles
    /// ([`OTHER_CLOCK_S`]), and count from the first sample instead.
    pub forces_by_own_clock: bool,
}

/// First force sample and first cycle that are further apart, s, were stamped by different clocks: no
/// machine runs for three years between them.
pub const OTHER_CLOCK_S: f64 = 1e8;

/// What the times of the force samples count from, and whether that is another clock's time than
/// `start_ns` of the cycles.
fn force_origin(cycles: &[&CycleRecord], forces: &[&ForceRecord]) -> (u64, bool) {
    let own_ns = forces.first().map_or(0, |block| block.t_ns);
    let Some(start_ns) = cycles.first().map(|cycle| cycle.t_ns) else { return (own_ns, false) };
    let is_other = !forces.is_empty() && seconds(own_ns, start_ns).abs() > OTHER_CLOCK_S;
    (if is_other { own_ns } else { start_ns }, is_other)
}

/// Converts the contents of an MCAP recording.
///
/// A restarted sender begins a new segment.
#[must_use]
pub fn convert(contents: &Contents) -> Conversion {
    let cycles: Vec<&CycleRecord> = contents.records.iter().filter_map(cycle).collect();
    let forces: Vec<&ForceRecord> = contents.records.iter().filter_map(force).collect();
    let start_ns = cycles.first().map_or(0, |cycle| cycle.t_ns);
    let models = |cycle: &CycleRecord| contents.model_of(cycle);
    let runs = cycles
        .chunk_by(|one, next| one.model_epoch == next.model_epoch && models(one) == models(next));
    let run = |cycles: &[&CycleRecord]| Run {
        header: cycles.first().and_then(|cycle| models(cycle)).cloned(),
        cycles: cycles_of(contents, cycles, start_ns),
    };
    let (forces_ns, forces_by_own_clock) = force_origin(&cycles, &forces);
    let mut made = Conversion {
        runs: runs.map(run).collect(),
        forces: (!forces.is_empty()).then(|| forces_of(&forces, forces_ns)),
        not_finite: 0,
        forces_by_own_clock,
    };
    let tables = made.runs.iter_mut().map(|run| &mut run.cycles).chain(&mut made.forces);
    made.not_finite = tables.map(drop_infinite).sum();
    made
}

/// Replaces infinite values by missing ones; returns their number.
fn drop_infinite(recording: &mut Recording) -> usize {
    let mut dropped = 0;
    for channel in recording.channels().collect::<Vec<_>>() {
        let Some(column) = recording.column(channel) else { continue };
        let infinite = column.iter().filter(|value| value.is_infinite()).count();
        if infinite > 0 {
            let known = |value: &f64| if value.is_infinite() { f64::NAN } else { *value };
            let column = column.iter().map(known).collect();
            recording.set(channel, column);
            dropped += infinite;
        }
    }
    dropped
}

fn cycle(record: &Record) -> Option<&CycleRecord> {
    match record {
        Record::Cycle(cycle) => Some(cycle),
        _ => None,
    }
}

fn force(record: &Record) -> Option<&ForceRecord> {
    match record {
        Record::Force(force) => Some(force),
        _ => None,
    }
}

fn seconds(t_ns: u64, start_ns: u64) -> f64 {
    // Signed: a clock that was set back gives negative times, not huge ones.
    t_ns.wrapping_sub(start_ns).cast_signed() as f64 * 1e-9
}

type Numbers = fn(&CycleRecord) -> &[f64];
type Group = (Numbers, fn(usize) -> Channel);

fn cycles_of(contents: &Contents, cycles: &[&CycleRecord], start_ns: u64) -> Recording {
    let mut recording =
        Recording::new(cycles.iter().map(|cycle| seconds(cycle.t_ns, start_ns)).collect());
    recording.segment = segments(cycles);
    for (joint, kind) in contents.header.joints.iter().enumerate() {
        recording.set_joint_kind(joint, *kind);
    }
    let groups: [Group; 4] = [
        (|c| c.q_command.as_slice(), Channel::Command),
        (|c| c.q_measured.as_slice(), Channel::Motor),
        (|c| c.tau.as_slice(), Channel::Torque),
        (|c| c.wrench_used.as_slice(), Channel::Wrench),
    ];
    for (numbers, channel) in groups {
        put_group(&mut recording, cycles, numbers, channel);
    }
    put_group(
        &mut recording,
        cycles,
        |c| c.temperature_c.as_slice(),
        |index| index.checked_sub(1).map_or(Channel::Ambient, Channel::JointTemperature),
    );
    for (value, channel) in [
        ((|c| c.spindle_rpm) as fn(&CycleRecord) -> f64, Channel::Spindle),
        (|c| c.feed_m_s, Channel::Feed),
    ] {
        let values: Vec<f64> = cycles.iter().map(|cycle| value(cycle)).collect();
        if values.iter().any(|value| !value.is_nan()) {
            recording.set(channel, values);
        }
    }
    if cycles.iter().any(|cycle| cycle.wrench_in_base != 0) {
        recording.metadata.wrench_frame = Some(CoordinateFrame::Base);
    }
    recording.other = other_columns(contents, cycles);
    recording
}

fn segments(cycles: &[&CycleRecord]) -> Vec<i64> {
    let (mut segment, mut segments) = (0, Vec::with_capacity(cycles.len()));
    for (index, cycle) in cycles.iter().enumerate() {
        let before = index.checked_sub(1).and_then(|before| cycles.get(before));
        let anew = before.is_some_and(|before| {
            (before.session, before.segment) != (cycle.session, cycle.segment)
        });
        segment += i64::from(anew);
        segments.push(segment);
    }
    segments
}

fn put_group(
    recording: &mut Recording,
    cycles: &[&CycleRecord],
    numbers: Numbers,
    channel: impl Fn(usize) -> Channel,
) {
    let width = cycles.iter().map(|cycle| numbers(cycle).len()).max().unwrap_or(0);
    for index in 0..width {
        let value = |cycle: &&CycleRecord| numbers(cycle).get(index).copied().unwrap_or(f64::NAN);
        recording.set(channel(index), cycles.iter().map(value).collect());
    }
}

fn other_columns(contents: &Contents, cycles: &[&CycleRecord]) -> Vec<(String, Vec<String>)> {
    let name_of = |names: &[String], code: u32| {
        let name = usize::try_from(code).ok().and_then(|code| names.get(code));
        name.cloned().unwrap_or_else(|| code.to_string())
    };
    let header = &contents.header;
    let column = |name: &str, text: &dyn Fn(&CycleRecord) -> String| {
        (name.to_owned(), cycles.iter().map(|cycle| text(cycle)).collect())
    };
    let mut columns = vec![
        column("command_ns", &|c| c.t_ns.to_string()),
        column("seq", &|c| c.seq.to_string()),
        column("session", &|c| c.session.to_string()),
        column("sender_segment", &|c| c.segment.to_string()),
        column("received_ns", &|c| c.received_ns.to_string()),
        column("published_ns", &|c| c.published_ns.to_string()),
    ];
    let per_joint: [(&str, Numbers); 2] =
        [("c", |c| c.q_corrected.as_slice()), ("wanted", |c| c.q_wanted.as_slice())];
    for (name, numbers) in per_joint {
        let width = cycles.iter().map(|c| numbers(c).len()).max().unwrap_or(0);
        for joint in 0..width {
            let slides = header.joints.get(joint) == Some(&JointKind::Prismatic);
            let unit = if slides { "m" } else { "rad" };
            columns.push(column(&format!("{name}{}_{unit}", joint + 1), &|c| {
                numbers(c).get(joint).copied().map(number_text).unwrap_or_default()
            }));
        }
    }
    columns.extend(trim_columns(cycles));
    if cycles.iter().any(|cycle| cycle.feed_override != 0.0 && cycle.feed_override != 1.0) {
        columns.push(column("feed_override", &|c| format!("{:?}", c.feed_override)));
    }
    columns.push(column("status", &|c| name_of(&header.status_words, c.status)));
    columns.push(column("reason", &|c| name_of(&header.reason_words, c.reason)));
    columns.push(column("model_epoch", &|c| c.model_epoch.to_string()));
    columns.push(column("steps", &|c| c.steps.to_string()));
    columns.push(column("residual_m", &|c| number_text(c.residual_m)));
    columns.push(column("residual_rad", &|c| number_text(c.residual_rad)));
    columns
}

/// The trim and the measurements of the tool; empty without an instrument.
fn trim_columns(cycles: &[&CycleRecord]) -> Vec<(String, Vec<String>)> {
    if cycles.iter().all(|cycle| cycle.trim_m.as_slice().is_empty()) {
        return Vec::new();
    }
    let mut columns = Vec::new();
    let of_axis: [(&str, Numbers); 2] =
        [("trim", |c| c.trim_m.as_slice()), ("measured", |c| c.measured_m.as_slice())];
    for (name, numbers) in of_axis {
        for (index, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let text = |c: &&CycleRecord| {
                numbers(c).get(index).copied().map(number_text).unwrap_or_default()
            };
            columns.push((format!("{name}_{axis}_m"), cycles.iter().map(text).collect()));
        }
    }
    let stamp = |c: &&CycleRecord| match c.measured_ns {
        0 => String::new(),
        t_ns => t_ns.to_string(),
    };
    columns.push(("measured_ns".to_owned(), cycles.iter().map(stamp).collect()));
    columns
}

fn forces_of(blocks: &[&ForceRecord], start_ns: u64) -> Recording {
    let (mut t_s, mut segment) = (Vec::new(), Vec::new());
    let mut channels: [Vec<f64>; 6] = Default::default();
    let mut run = 0;
    for (index, block) in blocks.iter().enumerate() {
        let before = index.checked_sub(1).and_then(|before| blocks.get(before));
        // A lost block or a new sender starts a segment, so that filters are not applied across the
        // gap.
        run += i64::from(before.is_some_and(|before| {
            before.session != block.session || before.seq.wrapping_add(1) != block.seq
        }));
        let count = usize::try_from(block.channels).unwrap_or(6).clamp(1, 6);
        let samples = block.data.len() / count;
        for sample in 0..samples {
            t_s.push(seconds(block.t_ns, start_ns) + sample as f64 / block.rate_hz);
            segment.push(run);
            for (channel_index, channel) in channels.iter_mut().enumerate() {
                let value = (channel_index < count)
                    .then(|| block.data.get(channel_index * samples + sample))
                    .flatten();
                channel.push(value.copied().unwrap_or(f64::NAN));
            }
        }
    }
    let mut recording = Recording::new(t_s);
    recording.segment = segment;
    for (index, samples) in channels.into_iter().enumerate() {
        if samples.iter().any(|sample| !sample.is_nan()) {
            recording.set(Channel::Wrench(index), samples);
        }
    }
    recording
}
