//! Checks that a recording has the columns that a command needs.

use std::collections::BTreeMap;

use super::RequiredData;
use super::channel::Channel;
use crate::faults::{Fault, Setting};

const MAPPING_HELP: &str = "rename the columns, or use a mapping";

/// The fault of columns that lack what a reader requires.
pub(super) fn lacking(columns: &BTreeMap<Channel, Vec<f64>>, need: RequiredData) -> Option<Fault> {
    let has = |wanted: fn(&Channel) -> bool| columns.keys().any(wanted);
    let inputs = has(|c| matches!(c, Channel::Command(_) | Channel::Motor(_)));
    let forces = has(|c| matches!(c, Channel::Wrench(_) | Channel::Acceleration(_)));
    let both = has(|c| matches!(c, Channel::Command(_))) && has(|c| matches!(c, Channel::Motor(_)));
    let measured = both
        || forces
        || has(|c| {
            matches!(
                c,
                Channel::Link(_)
                    | Channel::Position(_)
                    | Channel::Target(..)
                    | Channel::Orientation(_)
                    | Channel::Torque(_)
                    | Channel::Current(_)
                    | Channel::Distance(_)
                    | Channel::TouchPlane
                    | Channel::TouchSphere
            )
        });
    if need == RequiredData::Samples {
        // Any column is accepted.
        None
    } else if !inputs && (need == RequiredData::Path || !forces) {
        let fault = Fault::new("q1_deg", "there are no joint positions");
        Some(
            fault.expected("`q1_deg` …, or `qa1_deg` …").help(MAPPING_HELP).by(&[Setting::Mapping]),
        )
    } else if need == RequiredData::Measurement && !measured {
        let fault = Fault::new("", "there are no measurements, only inputs");
        Some(fault.expected(
            "x_mm, target1_x_mm, distance1_mm, touch_plane, ql1_deg, tau1_Nm, fx_N or similar",
        ))
    } else {
        None
    }
}
