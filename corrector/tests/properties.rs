//! Properties for any robot: random errors of random size and random poses, through the whole
//! corrector.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

#[path = "support/random.rs"]
mod random;
mod support;

use corrector::{Command, Corrector, CycleInputs, Mode, Outcome, Reason, Settings, Status};
use physics::{Chain, Inputs, JOINTS_MAX, Memories, Model};
use proptest::prelude::*;
use random::{arm, erring, errors, places, pose};
use support::{DT_NS, envelope};

/// The outcome for a pose at rest of a corrector without history.
fn settled(model: &Model, q: &[f64], mode: Mode) -> Outcome {
    let settings = Settings { mode, lockstep: true, ..Settings::with_envelope(envelope()) };
    let mut corrector = Corrector::new(settings);
    let mut command = Command::new(1, DT_NS, q);
    command.settled = true;
    let wanted = corrector.correct(model, &command, &CycleInputs::default(), DT_NS);
    corrector.limit(model, &wanted)
}

fn filled(q: &[f64]) -> [f64; JOINTS_MAX] {
    let mut all = [0.0; JOINTS_MAX];
    all[..q.len()].copy_from_slice(q);
    all
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 4000, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn a_corrected_robot_stands_where_the_nominal_one_would(which in 0..3_u8, errors in errors(), places in places()) {
        let model = erring(arm(which), &errors, 1.0);
        let q = pose(&model.arm, &places);
        let outcome = settled(&model, &q, Mode::Full);
        prop_assume!((outcome.status, outcome.reason) == (Status::Corrected, Reason::None));
        let target = outcome.added_to(&q);
        let real = model.evaluate(&Inputs::at_rest(target), &Memories::default()).real.base_from_tool;
        let wanted = Chain::nominal(&model.arm, &filled(&q)).base_from_tool;
        let error = (real.origin - wanted.origin).length();
        prop_assert!(error < 1e-8, "{error} m");
        let turned = real.rotation - wanted.rotation;
        prop_assert!(turned.to_cols_array().iter().all(|x| x.abs() < 1e-8), "{turned:?}");
    }

    #[test]
    fn no_error_however_large_leads_out_of_the_envelope_or_to_no_number(
        which in 0..3_u8, errors in errors(), places in places(), size in -3.0..6.0_f64, limited in any::<bool>(),
    ) {
        let model = erring(arm(which), &errors, 10.0_f64.powf(size));
        let q = pose(&model.arm, &places);
        let (mode, share) = if limited { (Mode::Limited, 0.1) } else { (Mode::Full, 1.0) };
        let outcome = settled(&model, &q, mode);
        let target = outcome.added_to(&q);
        for (i, joint) in model.arm.joints().iter().enumerate() {
            let (low, high) = joint.limits;
            prop_assert!((low..=high).contains(&target[i]), "joint {i} at {}", target[i]);
            let correction = (target[i] - q[i]).abs();
            prop_assert!(correction <= share * envelope().angle() * (1.0 + 1e-12), "joint {i} off by {correction}");
            prop_assert!(outcome.requested[i].is_finite(), "joint {i} wants {}", outcome.requested[i]);
        }
    }

    #[test]
    fn a_robot_without_errors_is_left_alone_wherever_it_stands(which in 0..3_u8, places in places()) {
        let model = Model::nominal(arm(which));
        let q = pose(&model.arm, &places);
        for mode in [Mode::Full, Mode::Limited, Mode::Shadow] {
            let outcome = settled(&model, &q, mode);
            prop_assert_eq!(outcome.correction, [0.0; JOINTS_MAX]);
        }
    }

    #[test]
    fn the_same_target_again_is_the_same_correction(which in 0..3_u8, errors in errors(), places in places()) {
        let model = erring(arm(which), &errors, 1.0);
        let q = pose(&model.arm, &places);
        let mut corrector = Corrector::new(Settings::with_envelope(envelope()));
        let mut answer = |seq: u64| {
            let command = Command::new(seq, seq * DT_NS, &q);
            let wanted = corrector.correct(&model, &command, &CycleInputs::default(), seq * DT_NS);
            corrector.limit(&model, &wanted)
        };
        let arrived = (1..1500).map(&mut answer).last().expect("cycles");
        prop_assume!(arrived.status == Status::Corrected);
        for seq in 1500..1510 {
            prop_assert_eq!(answer(seq).correction, arrived.correction);
        }
    }
}
