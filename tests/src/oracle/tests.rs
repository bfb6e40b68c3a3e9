//! The oracle sees each kind of step, and excuses what it says it does.

use super::*;
use shm_schema::JOINTS_MAX;

const MS: u64 = 1_000_000;
const Q: [f64; JOINTS] = [0.1, -0.2, 0.3, -0.4, 0.5, -0.6];

fn bounds(angle: f64, rate: f64, jerk: f64) -> JointBounds {
    JointBounds {
        min: [-3.0; JOINTS_MAX],
        max: [3.0; JOINTS_MAX],
        angle: [angle; JOINTS_MAX],
        rate: [rate; JOINTS_MAX],
        jerk: [jerk; JOINTS_MAX],
    }
}

fn oracle() -> Oracle {
    Oracle::new(&bounds(0.02, 0.05, 5.0), 0.0)
}

fn sent(c: f64) -> [f64; JOINTS] {
    Q.map(|q| q + c)
}

/// A correction that keeps all bounds: half a wave.
fn smooth(k: u64) -> f64 {
    1e-3 * (1.0 - (5.0 * k as f64 * 1e-3).cos())
}

fn told(from: u64, c: impl Fn(u64) -> f64) -> Result<(), String> {
    let mut oracle = oracle();
    for k in 0..from {
        oracle.take(k * MS, k * MS, &Q, &sent(smooth(k)))?;
    }
    (from..from + 100).try_for_each(|k| oracle.take(k * MS, k * MS, &Q, &sent(c(k))))
}

#[test]
fn a_smooth_correction_breaks_nothing_and_each_kind_of_step_is_seen() {
    assert_eq!(told(300, smooth), Ok(()));
    for (what, c) in [
        ("a dropped correction", 0.0),
        ("a step", smooth(300) + 1e-4),
        ("a small step", smooth(300) + 1e-6),
        ("no number", f64::NAN),
        ("beyond the angle", 0.03),
    ] {
        assert!(told(300, |_| c).is_err(), "{what}");
    }
    assert!(told(300, |k| if k == 350 { 0.0 } else { smooth(k) }).is_err(), "one tick");
}

#[test]
fn a_run_begins_at_its_command() {
    assert!(oracle().take(0, 0, &Q, &sent(1e-3)).is_err());
}

#[test]
fn after_a_silence_the_correction_is_what_it_was() {
    let after = |c: f64| {
        let mut oracle = oracle();
        (0..300).try_for_each(|k| oracle.take(k * MS, k * MS, &Q, &sent(smooth(k)))).unwrap();
        oracle.take(500 * MS, 500 * MS, &Q, &sent(c))
    };
    assert_eq!(after(smooth(299)), Ok(()));
    assert!(after(smooth(299) + 1e-6).is_err());
    assert!(after(0.0).is_err());
}

#[test]
fn tighter_bounds_bind_once_they_could_be_braked_into() {
    let mut oracle = oracle();
    for k in 0..2000 {
        oracle.take(k * MS, k * MS, &Q, &sent(smooth(k))).unwrap();
    }
    oracle.set_bounds(2000 * MS, &bounds(1e-4, 0.05, 5.0));
    let broken = (2000..8000).find(|k| oracle.take(k * MS, k * MS, &Q, &sent(smooth(*k))).is_err());
    assert!(broken.is_some_and(|k| k > 2100), "{broken:?}");
}

#[test]
fn shadow_mode_is_the_command_to_the_bit() {
    let mut oracle = oracle();
    oracle.set_shadow(0, true);
    assert_eq!(oracle.take(0, 0, &Q, &Q), Ok(()));
    let mut off = Q;
    off[3] = off[3].next_up();
    assert!(oracle.take(MS, MS, &Q, &off).is_err());
}

#[test]
fn jitter_excuses_what_it_makes_of_a_motion_and_no_step() {
    let judged = |step: f64| {
        let mut oracle = oracle();
        (0..400_u64).try_for_each(|k| {
            let c = smooth(k) + if k > 300 { step } else { 0.0 };
            let t_ns = k * MS + (k * 7 % 11) * 20_000;
            oracle.take(t_ns, t_ns, &Q, &sent(c))
        })
    };
    assert_eq!(judged(0.0), Ok(()));
    assert!(judged(1e-4).is_err());
}
