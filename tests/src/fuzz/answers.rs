//! JSON input: a solver's answer to a challenge, and experiment requests of a diagnosis.
//!
//! No files, no solver.

use challenge::answer::Answer;
use challenge::case::Tier;
use challenge::detectability::Detectability;
use challenge::score::{Outcome, compute_statistics};
use challenge::truth::{HiddenEffect, Truth};
use diagnosis_report::plan::experiment::Request;
use recording::series::{self, FileUnits, RequiredData};

use super::files::NAME;
use super::messages::MODEL;

/// The truth of an answer: clearly visible backlash at joint 3, similar to something else.
fn truth(tier: Tier) -> Truth {
    let rivals = vec![("hysteresis", Some(3))];
    Truth {
        case: "0001".to_owned(),
        tier,
        hidden: vec![HiddenEffect {
            effect: Some("backlash"),
            law: "Backlash".to_owned(),
            joint: Some(3),
            change: "new",
            parameters: [("width_mrad", vec![0.4])].into(),
            counted: vec![("width_mrad", 0)],
            detectability: Detectability {
                z: 40.0,
                rho: 1.0,
                least_gain: 50.0,
                rivals,
                ..Detectability::default()
            },
        }],
        depends_on: vec!["q2".to_owned(), "v3".to_owned()],
    }
}

/// Any answer is scored; every share is valid.
pub(super) fn answer(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    for domain in ["position", "torque", "force"] {
        let read = Answer::parse(&text, domain).map_err(|fault| fault.to_string());
        if let Ok(answer) = &read {
            assert!(answer.reported_effects().count() >= answer.findings.len());
            for number in answer.findings.iter().flat_map(|finding| &finding.parameters) {
                assert!(number.value.is_finite(), "{number:?}");
            }
        }
        let answer = read.ok();
        for tier in [Tier::Single, Tier::Null, Tier::Outside] {
            let outcome =
                Outcome { truth: truth(tier), answer: answer.clone(), errors: None, seconds: None };
            assert_eq!(outcome.summary().verdict, answer.as_ref().map(|answer| answer.verdict));
            let scored = compute_statistics(1, "", "", &[outcome]);
            let shares = [scored.first_right, scored.joint_right, scored.named_wrong];
            let shares = shares.into_iter().chain([scored.coverage95, scored.calibration_error]);
            let mut shares = shares.flatten();
            assert!(shares.all(|share| (0.0..=1.0).contains(&share)), "{scored:?}");
        }
    }
}

/// A requested experiment is a readable path, once it was measured.
pub(super) fn request(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let request = match Request::parse(&text) {
        Ok(request) => request,
        Err(fault) => return assert!(!fault.to_string().is_empty()),
    };
    let Some(request) = request else { return };
    let Some(experiment) = request.experiment(&MODEL.arm) else { return };
    let mut made = experiment.motion.recording(&request.measured, 0.5);
    made.units = FileUnits::SI;
    let written = String::from_utf8_lossy(&made.to_csv()).into_owned();
    let again = series::read_text(NAME, &written, None, None, RequiredData::Path);
    assert_eq!(again.map(|again| again.len()).ok(), Some(made.len()), "{written}");
}
