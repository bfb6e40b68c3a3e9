//! The sets, in the order of the document: description, inputs of the program, and source of the reference values.
//!
//! Descriptions are facts about the set and from its authors; results of runs are not stated here.

mod challenge;
mod emps;
mod forces;
mod link_encoder;
mod tracker;
mod ur10e;
mod workpiece;

use super::case::Case;
use super::set_runner::SetRunner;

/// A set.
pub(super) struct Set {
    pub(super) name: &'static str,
    /// Description, one sentence.
    pub(super) description: &'static str,
    pub(super) source: &'static str,
    /// The model given to the program.
    pub(super) given_model: &'static str,
    pub(super) files: &'static [&'static str],
    /// Reason why it is not run at all.
    pub(super) not_run_reason: Option<&'static str>,
    pub(super) run: fn(&SetRunner) -> Result<Vec<Case>, String>,
}

/// All sets.
pub(super) const SETS: &[Set] = &[
    emps::SET,
    ur10e::SET,
    link_encoder::SET,
    tracker::IRB120,
    tracker::MOTOMAN,
    tracker::SWEEPS,
    tracker::HILTI,
    Set {
        name: "dlr-elastic",
        description: "A humanoid's arm and torso, two markers seen by cameras, 500 poses.",
        source: "github.com/dlr-alr/dlr-elastic-calibration",
        given_model: "",
        files: &[],
        not_run_reason: Some(
            "its nominal geometry and masses are published in an image only, and it is a branched body",
        ),
        run: |_| Ok(Vec::new()),
    },
    forces::TURNING,
    forces::MILLING,
    forces::BEAM,
    workpiece::TAP,
    workpiece::SURFACE,
    challenge::SET,
];
