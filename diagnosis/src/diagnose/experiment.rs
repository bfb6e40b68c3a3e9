//! What to record next where names cannot be told apart: the motion or load under which they part.
//!
//! By what each name stands for: a constant, a load, a reversal, a turn, a warmth (the pairs and their experiments: Gautier and Khalil 1992 for loads,
//! ISO 230-4 for reversals; the rest by the laws themselves).
//!
//! Promises: a sentence that a technician can carry out. Never: a claim which name is right.

use physics::AnyEffect;

/// What a name shows under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shows {
    Always,
    Load,
    Reversal,
    Turn,
    Heat,
}

fn shows(effect: &AnyEffect) -> Shows {
    match effect.spec().kind {
        "joint_offset" | "axis_tilt" | "axis_shift" | "tool_offset" => Shows::Always,
        "backlash" | "hysteresis" => Shows::Reversal,
        "thermal_zero" | "thermal_growth" | "spindle_growth" => Shows::Heat,
        "joint_ratio" | "joint_coupling" | "transmission_error" | "axis_wobble"
        | "joint_polynomial" => Shows::Turn,
        _ => Shows::Load,
    }
}

/// The experiment that would part `effect` from `rival`.
pub(super) fn experiment(effect: &AnyEffect, rival: &AnyEffect) -> String {
    let joint = |effect: &AnyEffect| effect.joint().map(|joint| joint + 1);
    let whose = match (joint(effect), joint(rival)) {
        (Some(a), Some(b)) if a != b => format!("joints {a} and {b}"),
        (Some(a), _) | (None, Some(a)) => format!("joint {a}"),
        (None, None) => "the arm".to_owned(),
    };
    let name = |effect: &AnyEffect| effect.spec().kind.replace('_', " ");
    let both = [shows(effect), shows(rival)];
    let has = |wanted| both.contains(&wanted);
    let what = if has(Shows::Reversal) {
        format!(
            "reverse {whose} slowly with strokes of 0.01, 0.1, 1 and 10 degrees, once where gravity pulls one way and once where it pulls the other"
        )
    } else if has(Shows::Heat) {
        "warm the robot up from cold for two hours with the temperature recorded, let it cool for two more, and return to the same ten poses every five minutes".to_owned()
    } else if has(Shows::Load) {
        format!(
            "repeat the same poses with and without a known load on the tool (a tenth of the payload or more, hanging and pulling sideways), at two reaches and \
             with {whose} turned by 90 degrees"
        )
    } else if has(Shows::Turn) {
        format!(
            "turn {whose} alone through the whole range, one after the other, both ways, in steps of 1 degree or finer"
        )
    } else {
        format!(
            "move {whose} through the whole range, one after the other, and see the tool in three points that are not in a line"
        )
    };
    format!("To tell {} from {}: {what}.", name(effect), name(rival))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::nominal;
    use physics::Given;

    #[test]
    fn the_pair_says_what_to_do() {
        let arm = nominal().arm;
        let build = |kind: &str, joint, stem| {
            AnyEffect::build(kind, &arm, Some(joint), Given(&[(stem, &[0.0])])).expect(kind)
        };
        let gap = build("backlash", 2, "width");
        let zero = build("joint_offset", 2, "offset");
        let soft = build("joint_compliance", 1, "compliance");
        assert!(experiment(&gap, &soft).contains("reverse joints 3 and 2 slowly"));
        assert!(experiment(&soft, &zero).contains("known load"));
        assert!(experiment(&zero, &build("joint_offset", 1, "offset")).contains("three points"));
    }
}
