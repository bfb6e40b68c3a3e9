//! Outline of recordings: the data of every row needed to select the rows to use, and a campaign of the selected ones.
//!
//! A pose with its measurements takes a kilobyte, its outline some tens of bytes: of a million rows only the selected ones become poses.
//!
//! Invariant: the poses of a selection are bit-identical to those in the campaign of all rows.

use super::columns::{sample, vector};
use super::{CampaignError, Reader, WantedRows, gauges, read};
use crate::campaign::{Campaign, Pose};
use crate::extrinsics::Extrinsics;
use physics::{Arm, Joints};
use recording::series::{Recording, RecordingKind};
use std::ops::Range;

/// Outline of the rows of all recordings, counted through.
pub(crate) struct RecordingSummary {
    /// Ranges of rows that are consecutive in time along a path.
    pub(crate) paths: Vec<Range<usize>>,
    /// Whether each row has a measurement, except of points on the base and on links.
    pub(crate) measured: Vec<bool>,
    /// Whether a joint's direction differs from that in the preceding row.
    pub(crate) turned: Vec<bool>,
    /// Velocity and acceleration of each joint in each row; zero outside paths.
    pub(crate) rates: Vec<Vec<(f64, f64)>>,
    /// Whether any joint moves.
    pub(crate) moves: bool,
    /// The first row of each recording.
    firsts: Vec<usize>,
    /// Whether each measuring frame has a measurement.
    frames: Vec<bool>,
}

/// State while rows are read one by one.
struct SummaryBuilder<'a> {
    arm: &'a Arm,
    outline: RecordingSummary,
    on_links: Vec<usize>,
    /// Time since the beginning of the segment, s.
    time_s: Vec<f64>,
    /// Positions of each joint, rad or m.
    q: Vec<Vec<f64>>,
    last: Option<PreviousRow>,
}

/// The preceding row.
struct PreviousRow {
    recording: usize,
    direction: Joints,
}

impl RecordingSummary {
    /// # Errors
    /// The first recording that cannot be used.
    pub(crate) fn of(arm: &Arm, recordings: &[Recording]) -> Result<Self, CampaignError> {
        let mut surroundings = Extrinsics::default();
        gauges::add_extrinsic_objects(recordings, &mut surroundings)?;
        let on_links = crate::link_targets::link_target_places(recordings)
            .into_iter()
            .map(|(target, _)| target);
        let mut all = SummaryBuilder::new(arm, on_links.collect());
        let mut stations = Vec::new();
        for (index, recording) in recordings.iter().enumerate() {
            let mut reader = Reader::of(arm, recording, index);
            reader.add_frames_and_targets(&mut surroundings, &mut stations);
            all.outline.frames.resize(surroundings.frames.len(), false);
            all.take(&reader, surroundings.targets.len())?;
        }
        Ok(all.with_rates())
    }

    /// A campaign of the rows in `kept`, with measurements for those in `read`; velocities are those along all rows.
    ///
    /// # Errors
    /// The first recording that cannot be used.
    pub(crate) fn campaign(
        &self,
        (arm, recordings): (&Arm, &[Recording]),
        kept: &[bool],
        read_rows: &[bool],
    ) -> Result<Campaign, CampaignError> {
        let wanted = WantedRows { kept: Some(kept), read: Some(read_rows) };
        let mut campaign = read(arm, recordings, wanted)?;
        let frames = campaign.surroundings.frames.iter_mut();
        frames.zip(&self.frames).for_each(|(frame, used)| frame.free &= used);
        Ok(campaign)
    }

    /// Sets velocities and accelerations of the poses of a campaign.
    pub(crate) fn set_moving(&self, campaign: &mut Campaign) {
        for Pose { inputs, recording, row, .. } in &mut campaign.poses {
            let row = self.firsts.get(*recording).map_or(*row, |first| first + *row);
            for (joint, rates) in self.rates.iter().enumerate() {
                let rate = rates.get(row).copied().unwrap_or_default();
                (inputs.velocity[joint], inputs.acceleration[joint]) = rate;
            }
        }
    }
}

impl<'a> SummaryBuilder<'a> {
    fn new(arm: &'a Arm, on_links: Vec<usize>) -> Self {
        let outline = RecordingSummary {
            paths: Vec::new(),
            measured: Vec::new(),
            turned: Vec::new(),
            rates: Vec::new(),
            moves: false,
            firsts: Vec::new(),
            frames: Vec::new(),
        };
        let q = vec![Vec::new(); arm.count()];
        Self { arm, outline, on_links, time_s: Vec::new(), q, last: None }
    }

    /// Adds the rows of one recording; `targets`: their number.
    fn take(&mut self, reader: &Reader<'_>, targets: usize) -> Result<(), CampaignError> {
        let is_path = reader.recording.metadata.kind == RecordingKind::Path;
        self.outline.firsts.push(self.time_s.len());
        let (mut run, mut any) = (self.time_s.len(), false);
        reader.follow(|pose| {
            let k = self.time_s.len();
            let is_contiguous =
                self.time_s.last().is_some_and(|before| *before < pose.inputs.time_s);
            if k > run && !is_contiguous {
                self.end(run..k, is_path);
                run = k;
            }
            any |= self.take_row(reader, &pose, targets);
            Ok(())
        })?;
        self.end(run..self.time_s.len(), is_path);
        if any { Ok(()) } else { Err(CampaignError::NothingMeasured { file: reader.name() }) }
    }

    fn end(&mut self, run: Range<usize>, is_path: bool) {
        if is_path && run.len() > 2 {
            self.outline.paths.push(run);
        }
    }

    /// Adds one row; returns whether it has any measurement, including of points that do not move with the tool.
    fn take_row(&mut self, reader: &Reader<'_>, pose: &Pose, targets: usize) -> bool {
        let Self { outline, q, .. } = self;
        let (inputs, row, columns) = (&pose.inputs, pose.row, &reader.columns);
        let target = |target: &usize| {
            columns.targets.get(*target).is_some_and(|columns| vector(columns, row).is_some())
        };
        let on_links = |target: &usize| self.on_links.contains(target);
        let aside = (0..targets).filter(on_links).any(|index| target(&index));
        let points = vector(&columns.position, row).is_some()
            || columns.orientation.iter().all(|part| sample(*part, row).is_finite())
            || (0..targets).filter(|index| !on_links(index)).any(|index| target(&index));
        let joints = columns.links.iter().any(|link| sample(*link, row).is_finite());
        let measured = points || joints || gauges::is_read(reader.recording, row);
        if points && let Some(frame) = outline.frames.get_mut(reader.frames[row]) {
            *frame = true;
        }
        outline.measured.push(measured);
        let before = self.last.as_ref().filter(|last| last.recording == pose.recording);
        outline.turned.push(before.is_some_and(|before| before.direction != inputs.direction));
        self.last = Some(PreviousRow { recording: pose.recording, direction: inputs.direction });
        self.time_s.push(inputs.time_s);
        for (joint, q) in q.iter_mut().enumerate() {
            outline.moves |= q.first().is_some_and(|first| *first != inputs.q[joint]);
            q.push(inputs.q[joint]);
        }
        measured || aside
    }

    /// Adds velocities and accelerations.
    fn with_rates(mut self) -> RecordingSummary {
        for q in std::mem::take(&mut self.q) {
            let mut rates = vec![(0.0, 0.0); q.len()];
            for path in &self.outline.paths {
                let along = world::forward::rates(&self.time_s[path.clone()], &q[path.clone()]);
                rates[path.clone()].copy_from_slice(&along);
            }
            self.outline.rates.push(rates);
        }
        debug_assert_eq!(self.outline.rates.len(), self.arm.count());
        self.outline
    }
}
