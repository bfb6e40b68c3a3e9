//! Recordings: `trued.recording/1` in memory, SI inside.
//!
//! Format: docs/reference/recording.md. A valid [`Recording`] is consistent: equally long columns,
//! finite strictly increasing times within each segment, no infinite value, unit quaternions,
//! joints that are either revolute or prismatic. NaN marks a missing sample.

mod build;
mod cells;
mod channel;
mod check_gauges;
mod duplicate_columns;
mod epoch_time;
#[cfg(test)]
mod forms_tests;
mod gauges;
mod hold;
mod metadata;
mod metadata_toml;
mod number;
#[cfg(feature = "parquet")]
mod parquet;
mod places;
mod required_data;
mod row_by_row;
mod rows;
mod separator;
mod suffix;
mod table;
mod table_end;
#[cfg(test)]
mod tests;
mod text;
mod time_format;
mod units_line;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) use build::Builder;
pub(crate) use channel::Column;
pub use channel::{Channel, FileUnits, GAUGES_MAX, JOINTS_MAX, TARGETS_MAX};
pub use epoch_time::Epoch;
pub(crate) use epoch_time::{Decimal, EPOCH_S, Times, epoch_note};
pub use gauges::{Distance, Gauges, Probe, TouchedPlane, TouchedSphere};
pub(crate) use metadata::read_cut;
pub use metadata::{
    CoordinateFrame, Cut, DirectionSource, HeldOut, InputKind, RecordingKind, RecordingMetadata,
};
pub(crate) use number::is_number;
pub(crate) use table::{Dialect, NumericColumns, RawTable};
pub(crate) use text::{number_text, read_content};
pub use text::{read, read_text, write};
pub(crate) use time_format::{TimeFormat, instant_us};
pub(crate) use units_line::is_unit;

use physics::JointKind;

use crate::faults::{Fault, Faults};

/// Data that a reader requires of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequiredData {
    /// Inputs and at least one measured group: for calibration and diagnosis.
    Measurement,
    /// Joint positions only: for replay and correction of paths.
    Path,
    /// Samples of anything over time: for spectra.
    Samples,
}

/// A recording: columns of equal length over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The source file, for messages; empty if made in code.
    pub file: PathBuf,
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Segment of each row.
    pub segment: Vec<i64>,
    /// Metadata from its TOML.
    pub metadata: RecordingMetadata,
    /// Units in which positions were read, and will be written.
    pub units: FileUnits,
    /// Unknown columns, as text: kept, otherwise ignored.
    pub other: Vec<(String, Vec<String>)>,
    /// Remarks on the file that are not faults, one sentence each.
    pub notes: Vec<String>,
    columns: BTreeMap<Channel, Vec<f64>>,
    kinds: BTreeMap<usize, JointKind>,
    /// What was subtracted from the times in the file.
    epoch: Option<Epoch>,
    /// Names in the file it was read from.
    names: BTreeMap<Channel, String>,
}

impl Recording {
    /// A recording with times only, in one segment, with SI units in its file.
    #[must_use]
    pub fn new(t_s: Vec<f64>) -> Self {
        Self {
            file: PathBuf::new(),
            segment: vec![0; t_s.len()],
            t_s,
            metadata: RecordingMetadata::default(),
            units: FileUnits::SI,
            other: Vec::new(),
            notes: Vec::new(),
            columns: BTreeMap::new(),
            kinds: BTreeMap::new(),
            epoch: None,
            names: BTreeMap::new(),
        }
    }

    /// Applies the checks of [`read`] to a recording that was read with fewer requirements.
    ///
    /// # Errors
    /// Missing columns.
    pub fn check_need(&self, need: RequiredData) -> Result<(), Faults> {
        let mut faults = Faults::new(self.file.display().to_string());
        required_data::lacking(&self.columns, need)
            .into_iter()
            .for_each(|fault| faults.push(fault));
        if need == RequiredData::Measurement {
            self.twins().iter().for_each(|twins| faults.push(twins.fault()));
        }
        if faults.is_empty() { Ok(()) } else { Err(faults) }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether it has no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// A column's samples, SI; NaN for missing ones.
    #[must_use]
    pub fn column(&self, channel: Channel) -> Option<&[f64]> {
        self.columns.get(&channel).map(Vec::as_slice)
    }

    /// The existing columns, in order.
    pub fn channels(&self) -> impl Iterator<Item = Channel> + '_ {
        self.columns.keys().copied()
    }

    /// Name of a column in the source file; the first one if it was made of several.
    #[must_use]
    pub fn name_in_file(&self, channel: Channel) -> Option<&str> {
        self.names.get(&channel).map(String::as_str)
    }

    /// Adds or replaces a column. A column of another length is truncated or filled with NaN.
    pub fn set(&mut self, channel: Channel, mut samples: Vec<f64>) {
        samples.resize(self.len(), f64::NAN);
        self.columns.insert(channel, samples);
    }

    /// Removes a column.
    pub fn remove(&mut self, channel: Channel) -> Option<Vec<f64>> {
        self.columns.remove(&channel)
    }

    /// The kind of a joint by the unit of its columns; revolute if unknown.
    #[must_use]
    pub fn joint_kind(&self, joint: usize) -> JointKind {
        self.kinds.get(&joint).copied().unwrap_or(JointKind::Revolute)
    }

    /// Sets the kind of a joint, for recordings made in code.
    pub fn set_joint_kind(&mut self, joint: usize, kind: JointKind) {
        self.kinds.insert(joint, kind);
    }

    /// One more than the highest joint that any column names.
    #[must_use]
    pub fn joint_count(&self) -> usize {
        let joints = self.columns.keys().filter_map(|channel| channel.joint());
        joints.max().map_or(0, |highest| highest + 1)
    }

    /// One more than the highest target that any column, distance or probe names.
    #[must_use]
    pub fn target_count(&self) -> usize {
        let target = |channel: &Channel| match channel {
            Channel::Target(target, _) => Some(target + 1),
            _ => None,
        };
        let of_columns = self.columns.keys().filter_map(target).max().unwrap_or(0);
        of_columns.max(self.metadata.gauges.target_count())
    }

    /// The column with the input of a joint: `q` or `qa`, by the TOML or by default.
    #[must_use]
    pub fn input(&self, joint: usize) -> Option<&[f64]> {
        match self.input_kind() {
            InputKind::Command => self.column(Channel::Command(joint)),
            InputKind::Motor => self.column(Channel::Motor(joint)),
        }
    }

    /// Which group is the input: as the TOML states; otherwise `qa` if only the link side was
    /// measured along a path; otherwise `q` if present, otherwise `qa`.
    #[must_use]
    pub fn input_kind(&self) -> InputKind {
        let any = |wanted: fn(&Channel) -> bool| self.columns.keys().any(wanted);
        let commands = any(|channel| matches!(channel, Channel::Command(_)));
        let beside_motors = self.metadata.kind == RecordingKind::Path
            && any(|channel| matches!(channel, Channel::Link(_)))
            && !any(|channel| {
                matches!(
                    channel,
                    Channel::Position(_) | Channel::Target(..) | Channel::Orientation(_)
                )
            })
            && (0..self.joint_count()).all(|joint| self.column(Channel::Motor(joint)).is_some());
        let unsaid = if commands && !beside_motors { InputKind::Command } else { InputKind::Motor };
        self.metadata.input.unwrap_or(unsaid)
    }

    /// Standard uncertainty of a column, SI, if the TOML states it.
    #[must_use]
    pub fn sigma(&self, channel: Channel) -> Option<f64> {
        self.metadata.sigma.get(&channel).copied()
    }

    /// Checks that the input covers exactly the joints of a model, each of the right kind.
    ///
    /// # Errors
    /// Every joint that is missing, too many, or of the other kind.
    pub fn check_joints(&self, kinds: &[JointKind]) -> Result<(), Faults> {
        let mut faults = Faults::new(self.file.display().to_string());
        for (joint, kind) in kinds.iter().enumerate() {
            if self.input(joint).is_none() {
                let name = Channel::Command(joint).name(None);
                faults.push(
                    Fault::new(name, "is missing: the model has this joint")
                        .expected(format!("the positions of all {} joints", kinds.len())),
                );
            } else if self.kinds.get(&joint).is_some_and(|found| found != kind) {
                let unit = if *kind == JointKind::Revolute { "`_deg` or `_rad`" } else { "`_mm`" };
                faults.push(
                    Fault::new(Channel::Command(joint).base(), "has the unit of the other kind")
                        .expected(format!("{unit}, as the model's joint {}", joint + 1)),
                );
            }
        }
        if self.joint_count() > kinds.len() {
            faults.push(Fault::new(
                Channel::Command(kinds.len()).base(),
                format!(
                    "the recording has {} joints and the model {}",
                    self.joint_count(),
                    kinds.len()
                ),
            ));
        }
        if faults.is_empty() { Ok(()) } else { faults.into_result(None) }
    }
}

/// Whether a file is a recording by its name: of the daemon, or Parquet.
pub(crate) fn is_recording_name(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    ["mcap", "parquet"].iter().any(|name| extension.eq_ignore_ascii_case(name))
}

/// Path of a recording's TOML: `NAME.toml` for `NAME.csv`.
#[must_use]
pub fn metadata_path(recording: &Path) -> PathBuf {
    recording.with_extension("toml")
}
