//! Diagnoses of few poses, whose rows are too few for a validation set.

use physics::{AnyEffect, ParameterValues};

use super::{Verdict, diagnose};
use crate::campaign_simulation::simulate_readings;
use crate::progress::ignore;
use crate::test_campaigns::{nominal_robot, unmeasured_campaign};

/// Zero offsets and compliances that leave errors of a millimetre.
const ERRORS: [(&str, usize, &str, f64); 5] = [
    ("joint_offset", 1, "offset", 1.2e-3),
    ("joint_offset", 2, "offset", -0.8e-3),
    ("joint_offset", 4, "offset", 1.5e-3),
    ("joint_compliance", 1, "compliance", 2e-6),
    ("joint_compliance", 2, "compliance", 3e-6),
];

#[test]
fn errors_far_above_the_noise_are_found_from_few_poses_and_not_taken_for_unknown_structure() {
    let nominal = nominal_robot();
    let mut robot = nominal;
    for (kind, joint, name, value) in ERRORS {
        let values = [(name, &[value][..])];
        let effect = AnyEffect::build(kind, &nominal.arm, Some(joint), ParameterValues(&values));
        robot.push(effect.expect("sound")).expect("space for it");
    }
    for (targets, poses, seed) in [(1, 80, 1), (1, 100, 2), (3, 60, 3), (3, 100, 4)] {
        let bare = unmeasured_campaign(targets, poses);
        let campaign = simulate_readings(&bare, &robot, &bare.surroundings, 0.6, seed);
        let found = diagnose(campaign, &nominal, &[], None, seed, &ignore);
        let case = format!("{poses} poses of {targets} targets, seed {seed}");
        assert_eq!(found.verdict, Verdict::MissingPhysics, "{case}");
        assert!(found.test_errors.before > 3e-4, "{case}");
        assert!(found.test_errors.after < 1e-4, "{case}");
        // Of the other errors these poses determine only combinations.
        let wrist = found.findings.iter().find(|finding| {
            matches!(finding.effect, AnyEffect::JointOffset(_)) && finding.effect.joint() == Some(4)
        });
        let offset = wrist.unwrap_or_else(|| panic!("{case}")).effect.values()[0];
        assert!((offset - 1.5e-3).abs() < 1.5e-4, "{case}: {offset}");
    }
}
