//! Converts recordings of a robot to a campaign.
//!
//! Each recording has its own measuring frame, or one per `station`; a target number denotes the same target in all recordings. Rows without
//! measurement become poses without observations, which effects with memory need.
//!
//! Nothing is omitted silently; noise that is not stated is estimated. No file is accessed.

mod columns;
mod gauges;
mod positions;
mod summary;
mod unusable;

use crate::campaign::{
    Arrival, Campaign, Instrument, Observation, Pose, Reading, ReadingNoise, RecordingInfo,
    ToolPoint,
};
use crate::extrinsics::{Extrinsics, FitParameter, MeasuringFrame};
use crate::frame_drift::FrameDrift;
use columns::{RecordingColumns, sample, vector};
use glam::{DMat3, DQuat, DVec3};
use physics::{Arm, Chain, Frame, Inputs, Joints, Wrench};
pub(crate) use positions::JointPositions;
use recording::series::{
    Channel, CoordinateFrame as Axes, DirectionSource, HeldOut, InputKind, Recording, RecordingKind,
};
pub(crate) use summary::RecordingSummary;
pub use unusable::CampaignError;

/// Assumed standard uncertainty of points where none is stated, m; the fit estimates a factor on it.
const POINT_M: f64 = 5e-5;
/// The same for orientations, rad.
const ORIENTATION_RAD: f64 = 1e-4;
/// The same for joint positions, rad or m.
const JOINT: f64 = 1e-5;

/// Builds the campaign from recordings of the robot `arm`.
///
/// # Errors
/// The first recording that cannot be used.
pub fn campaign(arm: &Arm, recordings: &[Recording]) -> Result<Campaign, CampaignError> {
    let mut campaign = read(arm, recordings, WantedRows::ALL)?;
    gauges::fix_unused_frames(&mut campaign);
    Ok(campaign)
}

/// Which rows become poses, and which of these keep their measurements; rows are counted through all recordings. `None`: all.
#[derive(Clone, Copy)]
struct WantedRows<'a> {
    kept: Option<&'a [bool]>,
    read: Option<&'a [bool]>,
}

impl WantedRows<'_> {
    const ALL: Self = Self { kept: None, read: None };

    fn is_kept(&self, row: usize) -> bool {
        self.kept.is_none_or(|kept| kept.get(row) == Some(&true))
    }

    fn reads(&self, row: usize) -> bool {
        self.read.is_none_or(|read| read.get(row) == Some(&true))
    }
}

fn read(
    arm: &Arm,
    recordings: &[Recording],
    wanted: WantedRows<'_>,
) -> Result<Campaign, CampaignError> {
    let mut campaign = Campaign {
        poses: Vec::new(),
        surroundings: Extrinsics::default(),
        instruments: Vec::new(),
        recordings: Vec::new(),
    };
    gauges::add_extrinsic_objects(recordings, &mut campaign.surroundings)?;
    let (mut stations, mut first_row) = (Vec::new(), 0);
    for (index, recording) in recordings.iter().enumerate() {
        let mut reader = Reader::of(arm, recording, index);
        reader.add_frames_and_targets(&mut campaign.surroundings, &mut stations);
        let instruments = reader.instruments(&mut campaign)?;
        let before = campaign.readings();
        reader.poses(&mut campaign, &instruments, first_row, wanted)?;
        gauges::read(&mut campaign, index, recording, |row| wanted.reads(first_row + row))?;
        if campaign.readings() == before && wanted.read.is_none() {
            return Err(CampaignError::NothingMeasured { file: reader.name() });
        }
        campaign.recordings.push(reader.source());
        first_row += recording.len();
    }
    gauges::exclude_link_targets(arm, &mut campaign, recordings)?;
    Ok(campaign)
}

/// Motion of the robot `arm` in `recording`, one pose per row, without measurements.
///
/// # Errors
/// An input lacks a joint.
pub fn motion(arm: &Arm, recording: &Recording) -> Result<Vec<Pose>, CampaignError> {
    let mut poses = Vec::with_capacity(recording.len());
    Reader::of(arm, recording, 0).follow(|pose| {
        poses.push(pose);
        Ok(())
    })?;
    Ok(poses)
}

/// Whether each pose of the campaign is held out for validation according to its recording.
#[must_use]
pub fn held_out(campaign: &Campaign, recordings: &[Recording]) -> Vec<bool> {
    let kept = |pose: &Pose| {
        let recording = recordings.get(pose.recording)?;
        let segment = recording.segment.get(pose.row)?;
        Some(match &recording.metadata.heldout {
            HeldOut::Unspecified => false,
            HeldOut::All => true,
            HeldOut::Segments(segments) => segments.contains(segment),
        })
    };
    campaign.poses.iter().map(|pose| kept(pose).unwrap_or(false)).collect()
}

/// The instruments of one recording, as indices into [`Campaign::instruments`].
struct RecordingInstruments {
    points: (usize, ReadingNoise),
    orientations: (usize, ReadingNoise),
    joints: (usize, Vec<ReadingNoise>),
}

struct Reader<'a> {
    arm: &'a Arm,
    recording: &'a Recording,
    columns: RecordingColumns<'a>,
    index: usize,
    /// The measuring frame of each row.
    frames: Vec<usize>,
    nests: Option<FrameDrift>,
}

impl<'a> Reader<'a> {
    fn of(arm: &'a Arm, recording: &'a Recording, index: usize) -> Self {
        let columns = RecordingColumns::of(recording, arm.count());
        let nests = FrameDrift::of(recording);
        Self { arm, recording, columns, index, frames: Vec::new(), nests }
    }

    fn name(&self) -> String {
        self.recording.file.display().to_string()
    }

    fn source(&self) -> RecordingInfo {
        RecordingInfo {
            name: self.name(),
            is_path: self.recording.metadata.kind == RecordingKind::Path,
            reads_back: self.recording.input_kind() == InputKind::Motor,
            frame_drift: self.nests.clone(),
        }
    }

    /// Adds measuring frames and targets of the recording. `stations`: station numbers with their frames, of all recordings so far.
    fn add_frames_and_targets(
        &mut self,
        surroundings: &mut Extrinsics,
        stations: &mut Vec<(u64, usize)>,
    ) {
        let about = &self.recording.metadata;
        let station = MeasuringFrame { measuring_from_base: Frame::IDENTITY, pivot: DVec3::ZERO };
        let mut without_number = None;
        let column = self.recording.column(Channel::Station);
        for row in 0..self.recording.len() {
            let number = sample(column, row);
            let known = if number.is_nan() {
                without_number
            } else {
                stations
                    .iter()
                    .find(|(station, _)| *station == number.to_bits())
                    .map(|(_, index)| *index)
            };
            let frame = known.unwrap_or(surroundings.frames.len());
            self.frames.push(frame);
            if known.is_none() {
                surroundings
                    .frames
                    .push(FitParameter { value: station, free: !about.measured_in_base });
                if number.is_nan() {
                    without_number = Some(frame);
                } else {
                    stations.push((number.to_bits(), frame));
                }
            }
        }
        for target in surroundings.targets.len()..self.recording.target_count() {
            let known = about.targets_tool.get(&target).map(|place| DVec3::from_array(*place));
            let unknown = FitParameter::unknown(DVec3::ZERO);
            surroundings.targets.push(known.map_or(unknown, FitParameter::known));
        }
    }

    fn instruments(&self, campaign: &mut Campaign) -> Result<RecordingInstruments, CampaignError> {
        let file = self.name();
        let mut add = |what: &str, noise_is_known: bool| {
            campaign.instruments.push(Instrument {
                name: format!("{what} of {file}"),
                noise_is_known,
                ..Instrument::default()
            });
            campaign.instruments.len() - 1
        };
        let sigma = |channel| self.recording.sigma(channel);
        let axes = |channel: &dyn Fn(usize) -> Channel| {
            let found = [0, 1, 2].map(|k| sigma(channel(k)));
            let [Some(x), Some(y), Some(z)] = found else { return None };
            Some(ReadingNoise::Axes(DVec3::new(x, y, z)))
        };
        let stated = axes(&Channel::Position).or_else(|| axes(&|k| Channel::Target(0, k)));
        let points =
            (add("points", stated.is_some()), stated.unwrap_or(ReadingNoise::Equal(POINT_M)));
        let turned = sigma(Channel::Orientation(1)).map(|sigma| ReadingNoise::Equal(2.0 * sigma));
        let orientations = (
            add("orientations", turned.is_some()),
            turned.unwrap_or(ReadingNoise::Equal(ORIENTATION_RAD)),
        );
        let count = self.arm.count();
        let known = (0..count).all(|joint| sigma(Channel::Link(joint)).is_some());
        let noise = |joint| ReadingNoise::Equal(sigma(Channel::Link(joint)).unwrap_or(JOINT));
        let joints = (add("joint positions", known), (0..count).map(noise).collect());
        Ok(RecordingInstruments { points, orientations, joints })
    }

    /// Adds the selected rows; `first_row` is the index of this recording's first row among the rows of all recordings.
    fn poses(
        &self,
        campaign: &mut Campaign,
        instruments: &RecordingInstruments,
        first_row: usize,
        wanted: WantedRows<'_>,
    ) -> Result<(), CampaignError> {
        let Campaign { poses, surroundings, .. } = campaign;
        if wanted.kept.is_none() {
            poses.reserve(self.recording.len());
        }
        self.follow(|mut pose| {
            let row = first_row + pose.row;
            if wanted.reads(row) {
                pose.seen = self.observations(pose.row, surroundings, instruments)?;
            }
            if wanted.is_kept(row) {
                poses.push(pose);
            }
            Ok(())
        })
    }

    /// Passes the pose of each row, without measurements, to `take`.
    fn follow(
        &self,
        mut take: impl FnMut(Pose) -> Result<(), CampaignError>,
    ) -> Result<(), CampaignError> {
        let Recording { t_s, metadata, .. } = self.recording;
        let mut last: Option<Inputs> = None;
        let mut start_s = 0.0;
        for (row, now_s) in t_s.iter().enumerate() {
            let is_contiguous = self.is_contiguous(row);
            let before = last.as_ref().filter(|_| is_contiguous);
            start_s = if is_contiguous { start_s } else { *now_s };
            let inputs = self.inputs(row, now_s - start_s, before)?;
            let follows = metadata.kind == RecordingKind::Path
                || metadata.approach == DirectionSource::Sequence;
            let arrival =
                if follows && before.is_some() { Arrival::FromPrevious } else { Arrival::Settled };
            last = Some(inputs);
            take(Pose { inputs, arrival, recording: self.index, row, seen: Vec::new() })?;
        }
        Ok(())
    }

    /// Whether a row belongs to the same segment as the preceding one.
    fn is_contiguous(&self, row: usize) -> bool {
        let segment = &self.recording.segment;
        row > 0 && segment.get(row) == segment.get(row - 1)
    }

    fn positions(&self, row: usize, before: Option<&Joints>) -> Result<Joints, CampaignError> {
        let mut q = Joints::default();
        for (joint, slot) in q.iter_mut().enumerate().take(self.arm.count()) {
            let missing = || CampaignError::JointMissing { file: self.name(), joint: joint + 1 };
            let value = self.columns.inputs[joint]
                .and_then(|column| column.get(row))
                .copied()
                .ok_or_else(missing)?;
            // A missing sample: the joint keeps its last position.
            *slot = if value.is_nan() { before.map_or(0.0, |q| q[joint]) } else { value };
        }
        Ok(q)
    }

    fn inputs(
        &self,
        row: usize,
        time_s: f64,
        before: Option<&Inputs>,
    ) -> Result<Inputs, CampaignError> {
        let mut inputs = Inputs::at_rest(self.positions(row, before.map(|before| &before.q))?);
        inputs.time_s = time_s;
        if let Some(before) = before {
            inputs.q_before = before.q;
            inputs.dt_s = inputs.time_s - before.time_s;
            inputs.direction = before.direction;
        }
        self.directions(row, before, &mut inputs);
        inputs.ambient_celsius = sample(self.columns.ambient, row);
        inputs.spindle_rpm = sample(self.columns.spindle, row);
        for joint in 0..self.arm.count() {
            inputs.joint_celsius[joint] = sample(self.columns.joint_temperatures[joint], row);
        }
        let tilt = self.columns.tilt.map(|column| sample(column, row));
        let known = tilt.map(|turn| if turn.is_nan() { 0.0 } else { turn });
        inputs.base_tilt = DVec3::new(known[0], known[1], 0.0);
        inputs.wrench_base = self.wrench(row, &inputs.q);
        Ok(inputs)
    }

    fn directions(&self, row: usize, before: Option<&Inputs>, inputs: &mut Inputs) {
        let about = &self.recording.metadata;
        let follows =
            about.kind == RecordingKind::Path || about.approach == DirectionSource::Sequence;
        for joint in 0..self.arm.count() {
            let recorded = sample(self.columns.directions[joint], row);
            let moved = before.map_or(0.0, |before| inputs.q[joint] - before.q[joint]);
            let direction = &mut inputs.direction[joint];
            if about.approach == DirectionSource::Columns && !recorded.is_nan() {
                *direction = recorded;
            } else if follows && moved != 0.0 {
                *direction = moved.signum();
            }
        }
    }

    fn wrench(&self, row: usize, q: &Joints) -> Wrench {
        let part = |k: usize| Some(sample(self.columns.wrench[k], row)).filter(|x| !x.is_nan());
        let all = |from: usize| DVec3::from_array([0, 1, 2].map(|k| part(from + k).unwrap_or(0.0)));
        let read = Wrench { force: all(0), moment: all(3) };
        if read == Wrench::ZERO || self.recording.metadata.wrench_frame == Some(Axes::Base) {
            return read;
        }
        let turned = Chain::nominal(self.arm, q).base_from_tool.rotation;
        Wrench { force: turned * read.force, moment: turned * read.moment }
    }

    fn observations(
        &self,
        row: usize,
        surroundings: &Extrinsics,
        instruments: &RecordingInstruments,
    ) -> Result<Vec<Observation>, CampaignError> {
        let mut list = Vec::new();
        let mut take =
            |reading: Reading, (instrument, noise): (usize, ReadingNoise), point: DVec3, what| {
                let missing = CampaignError::Sigma { file: self.name(), what };
                let whitening = noise.whitening(point).ok_or(missing)?;
                list.push(Observation { reading, whitening, instrument });
                Ok(())
            };
        let frame = self.frames[row];
        let laid =
            self.nests.as_ref().map_or(Frame::IDENTITY, |nests| nests.common_from_measured(row));
        if let Some(point) =
            vector(&self.columns.position, row).map(|measured| laid.point(measured))
        {
            let place = ToolPoint::Tcp;
            take(Reading::Point { place, frame, at: point }, instruments.points, point, "x, y, z")?;
        }
        for target in 0..surroundings.targets.len() {
            let columns = self.columns.targets.get(target);
            let measured = columns.and_then(|columns| vector(columns, row));
            if let Some(point) = measured.map(|measured| laid.point(measured)) {
                let place = ToolPoint::Target(target);
                take(
                    Reading::Point { place, frame, at: point },
                    instruments.points,
                    point,
                    "targets",
                )?;
            }
        }
        let [w, x, y, z] = self.columns.orientation.map(|column| sample(column, row));
        if [w, x, y, z].iter().all(|part| part.is_finite()) {
            let read = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
            let measuring_from_tool = laid.rotation * read;
            let reading = Reading::Orientation { frame, measuring_from_tool };
            take(reading, instruments.orientations, DVec3::ZERO, "orientations")?;
        }
        for (joint, noise) in instruments.joints.1.iter().enumerate() {
            let position = sample(self.columns.links[joint], row);
            if position.is_finite() {
                let reading = Reading::JointPosition { joint, position };
                take(reading, (instruments.joints.0, *noise), DVec3::ZERO, "ql")?;
            }
        }
        Ok(list)
    }
}

#[cfg(test)]
mod tests;
