//! Dynamic candidates for paths: delay, lag, modes, reversal spikes.
//!
//! Settled poses give no candidates; there is no servo lag if the input is the measured joint position (docs/reference/recording.md). Frequencies
//! above the sampling limit are not tried.

use super::{Candidate, CandidateList, CandidateParameter, ParameterMapping, slot};
use crate::campaign::Campaign;
use crate::path_dynamics::paths;
use physics::{AnyEffect, Arm, ParameterValues};

/// Trial time constants of a reversal spike, s.
const SPIKES_S: [f64; 3] = [0.015, 0.05, 0.15];
/// Indices of participation and dynamic compliance in the parameters of a mode.
const PARTICIPATION: usize = 2;
const COMPLIANCE: usize = 3;

/// Delays, lags and reversal spikes; modes are searched for in `diagnose::modes`.
pub(crate) fn path_candidates(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = CandidateList::new(arm, campaign);
    let Some(path) = paths(campaign).next() else { return list.candidates };
    let of_path = campaign.recordings.get(campaign.poses[path.start].recording);
    list.add_effect("time_delay", None, &[("delay", &[0.0])]);
    for joint in 0..arm.count() {
        if of_path.is_some_and(|source| !source.reads_back) {
            list.add_effect("servo_lag", Some(joint), &[("time_constant", &[0.0])]);
        }
        for time_constant in SPIKES_S {
            let law: &[(&str, &[f64])] =
                &[("amplitude", &[0.0]), ("time_constant", &[time_constant])];
            list.add_effect("reversal_spike", Some(joint), law);
        }
    }
    list.candidates
}

/// Excitation of a mode that is to be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ModeExcitation {
    /// By the acceleration of the joint.
    Motion,
    /// By loads.
    Load,
    /// By both.
    Both,
}

impl ModeExcitation {
    pub(super) fn fixed_stems(self) -> &'static [&'static str] {
        match self {
            Self::Motion => &["dynamic_compliance"],
            Self::Load => &["participation"],
            Self::Both => &[],
        }
    }
}

/// A mode of a joint, or of the base about an axis.
pub(crate) fn mode_candidate(
    arm: &Arm,
    (joint, axis): (Option<usize>, Option<[f64; 3]>),
    (frequency_hz, damping_ratio): (f64, f64),
    driven: ModeExcitation,
) -> Option<Candidate> {
    let mut given: Vec<(&str, &[f64])> = vec![
        ("frequency", std::slice::from_ref(&frequency_hz)),
        ("damping_ratio", std::slice::from_ref(&damping_ratio)),
        ("participation", &[0.0]),
    ];
    given.extend(axis.as_ref().map(|axis| ("axis", axis.as_slice())));
    let effect = AnyEffect::build("flexible_mode", arm, joint, ParameterValues(&given)).ok()?;
    let probed: &[usize] = match driven {
        ModeExcitation::Motion => &[PARTICIPATION],
        ModeExcitation::Load => &[COMPLIANCE],
        ModeExcitation::Both => &[PARTICIPATION, COMPLIANCE],
    };
    Some(Candidate {
        slot: slot(&effect),
        joint,
        probes: probed.iter().map(|value| CandidateParameter { effect, value: *value }).collect(),
        settings: axis.map(|axis| ("axis", axis.to_vec())).into_iter().collect(),
        mapping: ParameterMapping::Mode(driven),
    })
}
