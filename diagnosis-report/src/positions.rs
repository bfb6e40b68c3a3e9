//! Joint positions in the columns and units of recordings.

use std::collections::BTreeMap;

use physics::{Arm, JointKind, Joints};
use report::fixed;

/// By column name, as in recordings: `q1_deg`, `q2_mm`, ….
#[must_use]
pub fn columns(arm: &Arm, q: &Joints) -> BTreeMap<String, f64> {
    let each = arm.joints().iter().zip(q).enumerate();
    each.map(|(i, (joint, q))| match joint.kind {
        JointKind::Revolute => (format!("q{}_deg", i + 1), q.to_degrees()),
        JointKind::Prismatic => (format!("q{}_mm", i + 1), 1e3 * q),
    })
    .collect()
}

/// As text, joint by joint, degrees and mm with one decimal.
#[must_use]
pub fn joint_positions_text(arm: &Arm, q: &Joints) -> String {
    let each: Vec<String> = columns(arm, q).into_values().map(|number| fixed(number, 1)).collect();
    each.join(" ")
}
