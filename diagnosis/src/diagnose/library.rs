//! What is asked of the data: every effect that moves the tool, on every joint, as something new; and every effect that the model has, as
//! something wrong by how much.
//!
//! Order is preference: where two names explain the same, the earlier is said (contract `effects.md`, "What may answer for what").
//!
//! Promises: the physics' own list is asked, none of its own. Never: a look at the residuals.

use crate::campaign::Campaign;
use crate::candidates::{Candidate, List, candidates};
use physics::spec::ActsOn;
use physics::{Arm, Model};

/// All candidates for what `model` may lack or have wrong.
pub(super) fn library(model: &Model, campaign: &Campaign) -> Vec<Candidate> {
    let moves = |acts_on: ActsOn| !matches!(acts_on, ActsOn::DriveTorque | ActsOn::ToolForce);
    let known = model.effects().enumerate().filter(|(_, e)| moves(e.spec().acts_on));
    let mut all: Vec<Candidate> =
        known.map(|(place, effect)| Candidate::change(place, effect)).collect();
    all.extend(geometry(&model.arm, campaign));
    all.extend(candidates(&model.arm, campaign));
    all.retain(|candidate| !model.effects().any(|effect| candidate.is_rival_of(effect)));
    all
}

/// Where axes and tool may stand elsewhere than the model says.
fn geometry(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = List::new(arm, campaign);
    for joint in 0..arm.count() {
        list.values("joint_offset", Some(joint), &[("offset", &[0.0])]);
        list.values("axis_shift", Some(joint), &[("shift", &[0.0; 3])]);
        list.values("axis_tilt", Some(joint), &[("tilt", &[0.0; 2])]);
    }
    list.values("tool_offset", None, &[("shift", &[0.0; 3]), ("turn", &[0.0; 3])]);
    list.found
}
