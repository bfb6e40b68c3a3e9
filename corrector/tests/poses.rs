//! Poses at rest, as a replay commands them.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{Command, Outcome, Settings, Status};
use physics::Model;
use support::{Run, envelope, erring, six, smooth};

fn settings() -> Settings {
    Settings::with_envelope(envelope())
}

#[test]
fn settled_poses_are_solved_without_ramps_and_only_in_lockstep() {
    for lockstep in [true, false] {
        let mut run = Run::new(erring(six()), Settings { lockstep, ..settings() });
        let mut command = Command::new(1, 60_000_000_000, &smooth(3.0));
        command.settled = true;
        let outcome = run.give(&command, 60_000_000_000);
        let at_once = outcome.correction[..6] == outcome.requested[..6];
        assert_eq!(at_once && outcome.status == Status::Corrected, lockstep);
    }
}

#[test]
fn minutes_between_poses_are_time_to_warm_up_in() {
    let arm = six();
    let given: &[(&str, &[f64])] = &[("amplitude", &[2e-4]), ("time_constant", &[1800.0])];
    let warm = support::effect(&arm, "thermal_growth", Some(1), given);
    let model = Model::new(arm, &[warm]).expect("room");
    let mut run = Run::new(model, Settings { lockstep: true, ..settings() });
    let largest =
        |outcome: &Outcome| outcome.requested.iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    let sizes: Vec<f64> = (0..121)
        .map(|minute| {
            let t_ns = minute * 60_000_000_000;
            let mut command = Command::new(minute + 1, t_ns, &smooth(3.0));
            command.settled = true;
            largest(&run.give(&command, t_ns))
        })
        .collect();
    assert!(sizes[0] < 1e-12 && sizes[120] > 5e-5, "{} {}", sizes[0], sizes[120]);
    let share = sizes[30] / sizes[120];
    assert!((share - (1.0 - (-1.0_f64).exp()) / (1.0 - (-4.0_f64).exp())).abs() < 0.01, "{share}");
}
