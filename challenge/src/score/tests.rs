//! Scores of answers with obvious quality.

use super::*;
use crate::detectability::Detectability;
use crate::truth::HiddenEffect;

fn hidden(z: f64, rivals: &[(&'static str, Option<usize>)]) -> HiddenEffect {
    let least_gain = if rivals.is_empty() { 50.0 } else { 1.0 };
    HiddenEffect {
        effect: Some("backlash"),
        law: "Backlash".into(),
        joint: Some(3),
        change: "new",
        parameters: [("width_mrad", vec![0.4])].into(),
        counted: vec![("width_mrad", 0)],
        detectability: Detectability {
            z,
            rho: 0.01 * z,
            least_gain,
            rivals: rivals.to_vec(),
            ..Detectability::default()
        },
    }
}

fn outcome(tier: Tier, hidden: Vec<HiddenEffect>, answer: &str) -> Outcome {
    let truth =
        Truth { case: "0001".into(), tier, hidden, depends_on: vec!["q2".into(), "v3".into()] };
    Outcome {
        truth,
        answer: Answer::parse(answer, "position").ok(),
        errors: None,
        seconds: Some(1.0),
    }
}

fn answer_text(
    verdict: &str,
    effect: &str,
    joint: usize,
    alternative: &str,
    ci: [f64; 2],
) -> String {
    format!(
        r#"{{"schema": "trued.diagnosis/1", "verdict": "{verdict}", "domain": "position", "findings": [
            {{"effect": "{effect}", "joint": {joint}, "confidence": 0.9,
              "parameters": {{"width_mrad": {{"value": 0.41, "ci95": [{}, {}]}}}},
              "alternatives": [{{"effect": "{alternative}", "joint": 3}}]}}],
            "unexplained": {{"depends_on": ["v3", "q2"]}}}}"#,
        ci[0], ci[1]
    )
}

fn none(verdict: &str) -> String {
    format!(r#"{{"schema": "trued.diagnosis/1", "verdict": "{verdict}", "findings": []}}"#)
}

const FITS: [f64; 2] = [0.38, 0.44];

#[test]
fn the_truth_is_right_another_joint_is_not_and_an_answer_without_claim_is_not() {
    let scored = |answer: &str| outcome(Tier::Single, vec![hidden(30.0, &[])], answer);
    let right = scored(&answer_text("missing_physics", "backlash", 3, "x", FITS));
    assert!(
        right.is_scored() && right.is_first_correct() && right.is_joint_correct() == Some(true)
    );
    assert_eq!(right.intervals(), [Some(true)]);
    let joint = scored(&answer_text("missing_physics", "backlash", 2, "x", FITS));
    assert!(!joint.is_first_correct() && joint.is_joint_correct() == Some(false));
    assert_eq!(joint.intervals(), [None]);
    assert!(!scored(&answer_text("undetermined", "backlash", 3, "x", FITS)).is_first_correct());
    assert!(!scored("no answer at all").is_first_correct());
    let aside = scored(&answer_text("missing_physics", "hysteresis", 3, "backlash", FITS));
    assert!(
        !aside.is_first_correct() && aside.is_among_first_three(),
        "an alternative that can be distinguished is wrong"
    );
    assert_eq!(
        scored(&answer_text("missing_physics", "backlash", 3, "x", [0.41, 0.44])).intervals(),
        [Some(false)]
    );
}

#[test]
fn what_cannot_be_told_apart_is_right_with_the_truth_beside_it() {
    let rivals = [("hysteresis", Some(3))];
    let scored = |answer: &str| outcome(Tier::Ambiguous, vec![hidden(30.0, &rivals)], answer);
    let both = scored(&answer_text("missing_physics", "hysteresis", 3, "backlash", FITS));
    assert!(
        both.is_first_correct()
            && both.is_ambiguous()
            && both.reported_undetermined()
            && !both.is_scored()
    );
    let alone = scored(&answer_text("missing_physics", "hysteresis", 3, "x", FITS));
    assert!(!alone.is_first_correct() && !alone.reported_undetermined());
    assert!(scored(&none("undetermined")).reported_undetermined());
}

#[test]
fn the_figures_count_what_they_say() {
    let single = |z, answer: &str| outcome(Tier::Single, vec![hidden(z, &[])], answer);
    let right = answer_text("missing_physics", "backlash", 3, "x", FITS);
    let wrong = answer_text("missing_physics", "joint_offset", 1, "x", FITS);
    let null = |answer: &str| outcome(Tier::Null, Vec::new(), answer);
    let outside = |answer: &str| {
        let mut law = hidden(30.0, &[]);
        (law.effect, law.detectability.unexplained_z) = (None, 30.0);
        outcome(Tier::Outside, vec![law], answer)
    };
    let mut all = vec![
        single(30.0, &right),
        single(30.0, &wrong),
        single(100.0, &right),
        single(5.0, &wrong),
        null(&none("consistent")),
        null(&right),
        outside(&answer_text("unknown_structure", "x", 1, "y", FITS)),
        outside(&wrong),
    ];
    for (outcome, after) in all.iter_mut().zip([1.0, 5.0, 2.0]) {
        outcome.errors = Some(PredictionErrors { before: 6.0, after, oracle: 1.0 });
    }
    let statistics = compute_statistics(7, "a", "b", &all);
    assert_eq!((statistics.counting, statistics.nulls, statistics.false_findings), (3, 2, 1));
    assert_eq!(statistics.first_right, Some(2.0 / 3.0));
    let at_z: Vec<_> =
        statistics.first_right_at_z.iter().map(|bin| (bin.cases, bin.first_right)).collect();
    assert_eq!(at_z, [(3, Some(2.0 / 3.0)), (1, Some(1.0)), (1, Some(1.0))]);
    // Wrong: the second and fourth single case, and the effect reported for one outside the dictionary.
    assert_eq!((statistics.named, statistics.named_wrong), (5, Some(3.0 / 5.0)));
    assert_eq!(
        (statistics.unknown_recognised, statistics.depends_on_right),
        (Some(0.5), Some(1.0))
    );
    assert_eq!((statistics.coverage95, statistics.coverage95_found), (Some(2.0 / 3.0), Some(1.0)));
    assert_eq!(statistics.gain_vs_oracle_median, Some(0.8));
    assert_eq!(statistics.undetermined_recognised, None, "none was asked");
    assert_eq!(statistics.by_effect[0].instead, [("joint_offset".to_owned(), 1)]);
}
