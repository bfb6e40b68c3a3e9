//! Loads outside the range of an effect's law: there is no solution; the last correction is held
//! for a while, then ramps to zero and returns without a step.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{Outcome, Reason, Settings, Status};
use physics::Model;
use support::{DT_NS, Run, effect, envelope, six};

/// Torque at which the law of a strongly stiffening joint ends, Nm.
const LAW_ENDS_NM: f64 = 500.0;
const COMPLIANCE: f64 = 3e-6;

fn stiffening() -> Model {
    let arm = six();
    let cubic = COMPLIANCE / (3.0 * LAW_ENDS_NM * LAW_ENDS_NM);
    let linear = effect(&arm, "joint_compliance", Some(1), &[("compliance", &[COMPLIANCE])]);
    let hardening = effect(&arm, "stiffness_hardening", Some(1), &[("cubic", &[cubic])]);
    Model::new(arm, &[linear, hardening]).expect("sound")
}

/// Pose with the upper arm leaning forward by `lean`, rad; the load of its joint grows with it.
fn leaning(lean: f64) -> [f64; 6] {
    [0.2, lean, 0.0, 0.3, 0.5, 0.1]
}

/// Cycles at rest.
fn stay(run: &mut Run, lean: f64, cycles: u64) -> Vec<Outcome> {
    (0..cycles).map(|_| run.cycle(&leaning(lean))).collect()
}

#[test]
fn without_a_solution_the_last_correction_is_held_then_taken_out_and_comes_back() {
    let settings = Settings::with_envelope(envelope());
    let mut run = Run::new(stiffening(), settings);
    let (light, heavy) = (-0.3, 0.6);
    let before = *stay(&mut run, light, 1000).last().expect("cycles");
    assert_eq!(before.status, Status::Corrected);
    assert!(before.correction[1].abs() > 1e-5, "{before:?}");

    let hold = settings.hold_ns / DT_NS;
    let mut all = vec![before];
    all.extend(
        (0..900).map(|k| run.cycle(&leaning(light + (heavy - light) * f64::from(k) / 900.0))),
    );
    let first = all.iter().position(|o| o.reason == Reason::NotConverged).expect("beyond");
    all.extend(stay(&mut run, heavy, hold + 1000));
    let lost = &all[first..];
    let held = lost.iter().take_while(|o| o.status == Status::Held).count() as u64;
    assert!((hold..=hold + 1).contains(&held), "held for {held} cycles, not {hold}");
    let last = lost.last().expect("cycles");
    assert_eq!((last.status, last.reason), (Status::Ramping, Reason::NotConverged));
    assert!(last.correction.iter().all(|c| c.abs() < 1e-12), "{last:?}");

    all.extend(stay(&mut run, light, 1000));
    let back = all.last().expect("cycles");
    assert_eq!(back.status, Status::Corrected);
    assert!((back.correction[1] - before.correction[1]).abs() < 1e-9);
    let most = envelope().rate() * DT_NS as f64 * 1e-9 * (1.0 + 1e-9);
    for pair in all.windows(2) {
        let step = (0..6).map(|i| (pair[1].correction[i] - pair[0].correction[i]).abs());
        assert!(step.fold(0.0, f64::max) <= most, "{pair:?}");
    }
}
