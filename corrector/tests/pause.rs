//! A pause has no effect on later corrections.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{Command, Settings, Status};
use support::{DT_NS, Run, envelope, pose, twenty};

#[test]
fn after_a_pause_a_command_that_is_less_long_on_its_way_than_those_before_sets_off_no_ramp() {
    let mut run = Run::new(twenty(), Settings::with_envelope(envelope()));
    // From rest to rest within a second, so that only lost time could change the requested
    // correction.
    let path = |t_s: f64| {
        let turn = 0.1 * t_s.powi(3) * (6.0 * t_s * t_s - 15.0 * t_s + 10.0);
        std::array::from_fn::<f64, 6, _>(|i| pose()[i] + if i % 2 == 0 { turn } else { -turn })
    };
    let mut t_ns = 0;
    let mut give = |run: &mut Run, dt_ns, t_s, late_ns| {
        t_ns += dt_ns;
        run.cycles += 1;
        run.give(&Command::new(run.cycles, t_ns, &path(t_s)), t_ns + late_ns)
    };
    for _ in 0..1000 {
        give(&mut run, DT_NS, 0.0, 50_000);
    }
    // After the pause each command takes long to arrive, and in the middle of the path no longer.
    give(&mut run, 60_000_000, 0.0, 300_000);
    for k in 1..=1000 {
        let late_ns = if k < 500 { 300_000 } else { 50_000 };
        let made = give(&mut run, DT_NS, k as f64 * 1e-3, late_ns);
        assert_eq!(made.status, Status::Corrected, "{k}: {made:?}");
    }
}
