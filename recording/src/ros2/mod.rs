//! Recordings as MCAP files of standard ROS 2 messages, which `ros2 bag`, Foxglove and the `mcap` packages read without message packages of trued.
//!
//! Format: docs/reference/recording.md, "ROS 2". The messages of a recording of the daemon have its
//! wall-clock times; those of a table are its `t_s` after the beginning of 1970, so that tables of one recording keep
//! their relation; where `t_s` is negative, the first row is at 0, which is reported. Columns of a table without
//! a standard message are left out and listed.

mod messages;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};

use self::messages::{
    DiagnosticArray, Header, JointState, Level, Log, PointStamped, PoseStamped, RosMessage,
    Temperature, Time, WrenchStamped,
};
use crate::mcap_recording::cdr::CdrWriter;
use crate::mcap_recording::{
    Clocks, Contents, CycleRecord, ForceRecord, LogRecord, Record, StatusRecord, VerdictRecord,
};
use crate::program;
use crate::series::{Channel, CoordinateFrame, Recording};

/// The frames of the messages: the model's base and its tool.
const BASE: &str = "base";
const TOOL: &str = "tool";

/// The topic of force samples, one message each.
pub const FORCE_TOPIC: &str = "/trued/force";

/// A file of ROS 2 messages.
#[derive(Debug)]
pub struct Bag {
    /// The MCAP file.
    pub bytes: Vec<u8>,
    /// Messages of each topic.
    pub topics: BTreeMap<String, usize>,
    /// Columns that no standard message carries, by their names in the file.
    pub left_out: Vec<String>,
    /// What was added to the times of a table that begins before 0, s: the format has no negative times.
    pub shifted_s: f64,
}

/// A recording of the daemon as ROS 2 messages.
///
/// # Errors
/// An error of the container, which does not occur for a file in memory.
pub fn from_daemon_recording(contents: &Contents) -> Result<Bag, McapError> {
    let mut bag = BagWriter::new()?;
    let mut clocks = contents.clocks.iter().copied().peekable();
    let mut clock = clocks.next().unwrap_or_default();
    let cell = &contents.header.cell;
    for record in &contents.records {
        let stamp_ns = stamp_ns(record);
        while let Some(next) = clocks.next_if(|next| next.monotonic_ns <= stamp_ns) {
            clock = next;
        }
        let time = |stamp_ns| Time(clock.wall_ns(stamp_ns));
        match record {
            Record::Cycle(cycle) => bag.cycle(cycle, clock)?,
            Record::Force(block) => bag.forces(block, clock)?,
            Record::Verdict(verdict) => bag.verdict(verdict, time(stamp_ns), cell)?,
            Record::Status(status) => bag.status(status, time(stamp_ns), cell)?,
            Record::Log(line) => bag.log(line, time(stamp_ns), cell)?,
        }
    }
    bag.end(Vec::new())
}

/// A table as ROS 2 messages.
///
/// # Errors
/// See [`from_daemon_recording`].
pub fn from_table(recording: &Recording) -> Result<Bag, McapError> {
    let mut bag = BagWriter::new()?;
    let joints = recording.joint_count();
    let names = joint_names(joints);
    let shifted_s = -recording.t_s.iter().copied().fold(0.0, f64::min);
    let frame = match recording.metadata.wrench_frame {
        Some(CoordinateFrame::Base) => BASE,
        _ => TOOL,
    };
    let measuring = if recording.metadata.measured_in_base { BASE } else { "measuring" };
    for (row, t_s) in recording.t_s.iter().enumerate() {
        let stamp = Time(((t_s + shifted_s) * 1e9).round() as u64);
        let value = |channel| recording.column(channel).map_or(f64::NAN, |column| column[row]);
        let all = |channel: fn(usize) -> Channel| -> Vec<f64> {
            let numbers: Vec<f64> = (0..joints).map(|joint| value(channel(joint))).collect();
            if numbers.iter().all(|number| number.is_nan()) { Vec::new() } else { numbers }
        };
        let in_base = Header { stamp, frame: BASE };
        let mut joints = |topic: &str, position: &[f64], effort: &[f64]| {
            if position.is_empty() && effort.is_empty() {
                return Ok(());
            }
            let state = JointState { header: in_base, names: &names, position, effort };
            bag.put(topic, stamp, &state)
        };
        joints("/trued/joint_command", &all(Channel::Command), &[])?;
        joints("/joint_states", &all(Channel::Motor), &all(Channel::Torque))?;
        joints("/trued/joint_link", &all(Channel::Link), &[])?;
        let wrench = std::array::from_fn(|part| value(Channel::Wrench(part)));
        bag.wrench("/trued/wrench", Header { stamp, frame }, wrench)?;
        bag.temperatures(stamp, value(Channel::Ambient), &all(Channel::JointTemperature))?;
        bag.measured(Header { stamp, frame: measuring }, recording.target_count(), &value)?;
    }
    Ok(Bag { shifted_s, ..bag.end(left_out(recording))? })
}

/// The columns that [`from_table`] has no message for.
fn left_out(recording: &Recording) -> Vec<String> {
    let has_message = |channel: &Channel| {
        matches!(
            channel,
            Channel::Command(_)
                | Channel::Motor(_)
                | Channel::Link(_)
                | Channel::Torque(_)
                | Channel::Wrench(_)
                | Channel::Ambient
                | Channel::JointTemperature(_)
                | Channel::Position(_)
                | Channel::Orientation(_)
                | Channel::Target(..)
        )
    };
    let named = |channel: Channel| {
        recording.name_in_file(channel).map_or_else(|| channel.base(), str::to_owned)
    };
    let ours = recording.channels().filter(|channel| !has_message(channel)).map(named);
    ours.chain(recording.other.iter().map(|(name, _)| name.clone())).collect()
}

fn stamp_ns(record: &Record) -> u64 {
    match record {
        Record::Cycle(cycle) => cycle.received_ns,
        Record::Force(block) => block.t_ns,
        Record::Verdict(verdict) => verdict.t_ns,
        Record::Status(status) => status.t_ns,
        Record::Log(line) => line.t_ns,
    }
}

fn joint_names(joints: usize) -> Vec<String> {
    (1..=joints).map(|joint| format!("joint_{joint}")).collect()
}

/// Writer of a file in memory.
struct BagWriter {
    writer: Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<String, (u16, u32)>,
    out: CdrWriter,
}

impl BagWriter {
    fn new() -> Result<Self, McapError> {
        let options =
            WriteOptions::new().compression(None).profile("ros2").library(program::version());
        let writer = options.create(Cursor::new(Vec::new()))?;
        Ok(Self { writer, channels: BTreeMap::new(), out: CdrWriter::default() })
    }

    fn put<M: RosMessage>(
        &mut self,
        topic: &str,
        stamp: Time,
        message: &M,
    ) -> Result<(), McapError> {
        if !self.channels.contains_key(topic) {
            let schema = self.writer.add_schema(M::NAME, "ros2msg", M::DEFINITION.as_bytes())?;
            let channel = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new())?;
            self.channels.insert(topic.to_owned(), (channel, 0));
        }
        let Some((channel_id, sequence)) = self.channels.get_mut(topic) else { return Ok(()) };
        self.out.begin();
        message.put(&mut self.out);
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: stamp.0,
            publish_time: stamp.0,
        };
        *sequence += 1;
        self.writer.write_to_known_channel(&header, self.out.bytes())
    }

    fn end(mut self, left_out: Vec<String>) -> Result<Bag, McapError> {
        self.writer.finish()?;
        let topics = self.channels.iter();
        let topics = topics.map(|(topic, (_, count))| (topic.clone(), *count as usize)).collect();
        let bytes = self.writer.into_inner().into_inner();
        Ok(Bag { bytes, topics, left_out, shifted_s: 0.0 })
    }

    /// All messages of a cycle have the time at which the command was received, except the measured
    /// point, which has its own time.
    fn cycle(&mut self, cycle: &CycleRecord, clock: Clocks) -> Result<(), McapError> {
        let stamp = Time(clock.wall_ns(cycle.received_ns));
        let header = Header { stamp, frame: BASE };
        let names = joint_names(cycle.q_command.as_slice().len());
        let (measured, tau) = (cycle.q_measured.as_slice(), cycle.tau.as_slice());
        let states = [
            ("/trued/joint_command", cycle.q_command.as_slice(), &[][..]),
            ("/trued/joint_corrected", cycle.q_corrected.as_slice(), &[][..]),
            ("/joint_states", measured, tau),
        ];
        for (topic, position, effort) in states {
            if !position.is_empty() || !effort.is_empty() {
                let state = JointState { header, names: &names, position, effort };
                self.put(topic, stamp, &state)?;
            }
        }
        if let Ok(wrench) = <[f64; 6]>::try_from(cycle.wrench_used.as_slice()) {
            let frame = if cycle.wrench_in_base == 0 { TOOL } else { BASE };
            self.wrench("/trued/wrench", Header { stamp, frame }, wrench)?;
        }
        if let Some((ambient, joints)) = cycle.temperature_c.as_slice().split_first() {
            self.temperatures(stamp, *ambient, joints)?;
        }
        match (<[f64; 3]>::try_from(cycle.measured_m.as_slice()), cycle.measured_ns) {
            (Ok(point), t_ns) if t_ns != 0 => {
                let stamp = Time(clock.wall_ns(t_ns));
                let header = Header { stamp, frame: BASE };
                self.put("/trued/measured_point", stamp, &PointStamped { header, point })
            }
            _ => Ok(()),
        }
    }

    fn forces(&mut self, block: &ForceRecord, clock: Clocks) -> Result<(), McapError> {
        let channels = (block.channels as usize).clamp(1, 6);
        let samples = block.data.len() / channels;
        let begin_ns = clock.wall_ns(block.t_ns);
        for sample in 0..samples {
            let later_ns = (1e9 * sample as f64 / block.rate_hz) as u64;
            let header = Header { stamp: Time(begin_ns.saturating_add(later_ns)), frame: TOOL };
            let wrench = std::array::from_fn(|part| match part < channels {
                true => block.data[part * samples + sample],
                false => f64::NAN,
            });
            self.wrench(FORCE_TOPIC, header, wrench)?;
        }
        Ok(())
    }

    /// A wrench with at least one known component.
    fn wrench(
        &mut self,
        topic: &str,
        header: Header<'_>,
        wrench: [f64; 6],
    ) -> Result<(), McapError> {
        if wrench.iter().all(|part| part.is_nan()) {
            return Ok(());
        }
        self.put(topic, header.stamp, &WrenchStamped { header, wrench })
    }

    fn temperatures(&mut self, stamp: Time, ambient: f64, joints: &[f64]) -> Result<(), McapError> {
        for (place, &celsius) in std::iter::once(&ambient).chain(joints).enumerate() {
            if celsius.is_nan() {
                continue;
            }
            let name = if place == 0 { "ambient".to_owned() } else { format!("joint_{place}") };
            let header = Header { stamp, frame: &name };
            let topic = format!("/trued/temperature/{name}");
            self.put(&topic, stamp, &Temperature { header, celsius })?;
        }
        Ok(())
    }

    /// The instrument's measurement of the tool in one row.
    fn measured(
        &mut self,
        header: Header<'_>,
        targets: usize,
        value: &impl Fn(Channel) -> f64,
    ) -> Result<(), McapError> {
        let is_known = |numbers: &[f64]| numbers.iter().all(|number| !number.is_nan());
        let position = std::array::from_fn(|axis| value(Channel::Position(axis)));
        let [w, x, y, z] = std::array::from_fn(|part| value(Channel::Orientation(part)));
        let orientation_xyzw = [x, y, z, w];
        if is_known(&position) && is_known(&orientation_xyzw) {
            let pose = PoseStamped { header, position, orientation_xyzw };
            self.put("/trued/measured_pose", header.stamp, &pose)?;
        } else if is_known(&position) {
            let point = PointStamped { header, point: position };
            self.put("/trued/measured_point", header.stamp, &point)?;
        }
        for target in 0..targets {
            let point = std::array::from_fn(|axis| value(Channel::Target(target, axis)));
            if is_known(&point) {
                let topic = format!("/trued/target_{}", target + 1);
                self.put(&topic, header.stamp, &PointStamped { header, point })?;
            }
        }
        Ok(())
    }

    fn status(&mut self, status: &StatusRecord, stamp: Time, cell: &str) -> Result<(), McapError> {
        let level = match status.health.as_str() {
            "starting" | "idle" | "running" | "stopping" => Level::Ok,
            "degraded" => Level::Warn,
            _ => Level::Error,
        };
        let values = [
            ("health", status.health.clone()),
            ("mode", status.mode.clone()),
            ("bypassed", (status.bypassed != 0).to_string()),
            ("cycles", status.cycles.to_string()),
            ("late cycles", status.missed.to_string()),
            ("rejected commands", status.rejected.to_string()),
            ("dropped records", status.dropped.to_string()),
            ("model epoch", status.model_epoch.to_string()),
            ("latency, 99 %, ns", status.latency_p99_ns.to_string()),
        ];
        self.diagnostic(stamp, level, "trued: daemon", &status.says, cell, &values)
    }

    fn verdict(
        &mut self,
        verdict: &VerdictRecord,
        stamp: Time,
        cell: &str,
    ) -> Result<(), McapError> {
        let level = match verdict.state.as_str() {
            "over" => Level::Ok,
            "warn" => Level::Warn,
            _ => Level::Error,
        };
        let message = format!("{}: {} Hz", verdict.class, verdict.frequency_hz);
        let values = [
            ("state", verdict.state.clone()),
            ("class", verdict.class.clone()),
            ("axis", verdict.axis.clone()),
            ("frequency, Hz", verdict.frequency_hz.to_string()),
            ("amplitude, N", verdict.amplitude_n.to_string()),
        ];
        self.diagnostic(stamp, level, "trued: vibration", &message, cell, &values)
    }

    fn diagnostic(
        &mut self,
        stamp: Time,
        level: Level,
        name: &str,
        message: &str,
        hardware: &str,
        values: &[(&'static str, String)],
    ) -> Result<(), McapError> {
        let header = Header { stamp, frame: "" };
        let array = DiagnosticArray { header, level, name, message, hardware, values };
        self.put("/diagnostics", stamp, &array)
    }

    fn log(&mut self, line: &LogRecord, stamp: Time, cell: &str) -> Result<(), McapError> {
        let level = match line.level.as_str() {
            "error" => 40,
            "warn" => 30,
            _ => 20,
        };
        let message =
            if line.level == "mark" { format!("mark: {}", line.says) } else { line.says.clone() };
        let log = Log { stamp, level, name: &format!("trued.{cell}"), message: &message };
        self.put("/rosout", stamp, &log)
    }
}
