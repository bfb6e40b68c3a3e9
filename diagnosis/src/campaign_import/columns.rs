//! The columns of a recording that make a campaign, looked up once instead of at every row. Missing
//! values are NaN.

use glam::DVec3;
use recording::series::{Channel, Recording};

/// Samples of a column; `None` if the recording does not have it.
type Samples<'a> = Option<&'a [f64]>;

/// The columns that are read at every row.
pub(super) struct RecordingColumns<'a> {
    /// Joint positions, of the group that is the input.
    pub(super) inputs: Vec<Samples<'a>>,
    pub(super) directions: Vec<Samples<'a>>,
    pub(super) joint_temperatures: Vec<Samples<'a>>,
    pub(super) links: Vec<Samples<'a>>,
    pub(super) ambient: Samples<'a>,
    pub(super) spindle: Samples<'a>,
    pub(super) tilt: [Samples<'a>; 2],
    pub(super) wrench: [Samples<'a>; 6],
    pub(super) position: [Samples<'a>; 3],
    pub(super) targets: Vec<[Samples<'a>; 3]>,
    pub(super) orientation: [Samples<'a>; 4],
}

impl<'a> RecordingColumns<'a> {
    pub(super) fn of(recording: &'a Recording, joints: usize) -> Self {
        let column = |channel| recording.column(channel);
        let of_joints = |channel: fn(usize) -> Channel| -> Vec<Samples<'a>> {
            (0..joints).map(|joint| recording.column(channel(joint))).collect()
        };
        let target = |target| [0, 1, 2].map(|axis| column(Channel::Target(target, axis)));
        Self {
            inputs: (0..joints).map(|joint| recording.input(joint)).collect(),
            directions: of_joints(Channel::Direction),
            joint_temperatures: of_joints(Channel::JointTemperature),
            links: of_joints(Channel::Link),
            ambient: column(Channel::Ambient),
            spindle: column(Channel::Spindle),
            tilt: [0, 1].map(|axis| column(Channel::BaseTilt(axis))),
            wrench: [0, 1, 2, 3, 4, 5].map(|part| column(Channel::Wrench(part))),
            position: [0, 1, 2].map(|axis| column(Channel::Position(axis))),
            targets: (0..recording.target_count()).map(target).collect(),
            orientation: [0, 1, 2, 3].map(|part| column(Channel::Orientation(part))),
        }
    }
}

/// A sample; NaN if missing.
pub(super) fn sample(column: Samples<'_>, row: usize) -> f64 {
    column.and_then(|column| column.get(row)).copied().unwrap_or(f64::NAN)
}

/// Three samples; `None` unless all are finite.
pub(super) fn vector(columns: &[Samples<'_>; 3], row: usize) -> Option<DVec3> {
    let vector = DVec3::from_array(columns.map(|column| sample(column, row)));
    vector.is_finite().then_some(vector)
}
