//! Ramping joints move along a straight line, each within its own limits.

use super::*;
use proptest::prelude::*;
use std::vec::Vec;

extern crate std;

const DT_S: f64 = 1e-3;

fn limits(angle: f64, rate: f64, jerk: f64) -> Limits {
    Limits::new(angle, rate, jerk).expect("positive")
}

/// Distance of `c` from the line from zero to `from`.
fn beside<const N: usize>(c: &[f64; N], from: &[f64; N]) -> f64 {
    let along = |a: &[f64; N], b: &[f64; N]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let share = along(c, from) / along(from, from);
    c.iter().zip(from).map(|(c, f)| (c - share * f).abs()).fold(0.0, f64::max)
}

proptest! {
    #[test]
    fn a_correction_at_rest_ramps_out_along_a_line(
        from in prop::array::uniform3(-5e-3..5e-3_f64), rates in prop::array::uniform3(5e-3..0.2_f64),
        jerks in prop::array::uniform3(1.0..20.0_f64),
    ) {
        let limits = |i: usize| Some(limits(0.01, rates[i], jerks[i]));
        let mut arm = Limiters::from_motion(|i| (from[i], 0.0, 0.0));
        let longest = from.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
        for _ in 0..5000 {
            let c = arm.step(&[0.0; 3], limits, Elapsed::exact(DT_S));
            // A joint with less than a hundredth of the longest distance, or less than 20 µrad, may
            // arrive sooner.
            prop_assert!(beside(&c, &from) <= 0.011 * longest + 2e-5, "{c:?} from {from:?}");
        }
        prop_assert_eq!(arm.step(&[0.0; 3], limits, Elapsed::exact(DT_S)), [0.0; 3]);
    }

    #[test]
    fn a_correction_in_motion_ramps_out_near_its_line(
        motion in prop::array::uniform3((-5e-3..5e-3_f64, -0.02..0.02_f64, -0.1..0.1_f64)),
    ) {
        let limits = |_| Some(limits(0.02, 0.1, 5.0));
        let mut arm = Limiters::from_motion(|i| motion[i]);
        let from = motion.map(|(value, ..)| value);
        // Distance of the fastest stop of the initial motion.
        let reach = motion.iter().map(|(_, rate, acceleration)| {
            let alone = Motion { value: 0.0, rate: *rate, acceleration: *acceleration };
            crate::plan::Ramp::to_rate(alone, 0.0, 2.5).end_of(alone).value.abs()
        });
        let reach = from.iter().fold(0.0_f64, |most, c| most.max(c.abs())).max(reach.fold(0.0, f64::max));
        for _ in 0..3000 {
            let c = arm.step(&[0.0; 3], limits, Elapsed::exact(DT_S));
            prop_assert!(beside(&c, &from) <= 2.0 * reach, "{c:?} from {from:?}");
        }
        prop_assert_eq!(arm.step(&[0.0; 3], limits, Elapsed::exact(DT_S)), [0.0; 3]);
    }

    #[test]
    fn each_joint_keeps_its_limits_whatever_the_others_do(
        jumps in prop::collection::vec((0..600_usize, 0..3_usize, -6e-3..6e-3_f64), 0..12),
        noise in prop_oneof![Just(0.0), 1e-9..1e-3_f64], sine in (0.0..3e-3_f64, 0.1..300.0_f64),
    ) {
        let joint_limits = [limits(2e-3, 0.02, 5.0), limits(4e-3, 0.1, 1.0), limits(1e-3, 0.01, 20.0)];
        let mut arm = Limiters::<3>::at_rest();
        let mut outputs: Vec<[f64; 3]> = Vec::new();
        for k in 0..900_usize {
            let wanted = core::array::from_fn(|i| {
                let jumped: f64 =
                    jumps.iter().filter(|(from, joint, _)| *from <= k && *joint == i).map(|j| j.2).sum();
                let hash = ((k * 3 + i) as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11;
                let shake = noise * (hash as f64 / (1u64 << 52) as f64 - 1.0);
                jumped + if k < 600 { sine.0 * libm::sin(sine.1 * DT_S * (k + i) as f64) + shake } else { 0.0 }
            });
            outputs.push(arm.step(&wanted, |i| Some(joint_limits[i]), Elapsed::exact(DT_S)));
        }
        for i in 0..3 {
            let c = |k: usize| outputs[k][i];
            for k in 3..outputs.len() {
                let jerk = (c(k) - 3.0 * c(k - 1) + 3.0 * c(k - 2) - c(k - 3)) / (DT_S * DT_S * DT_S);
                prop_assert!(c(k).abs() <= joint_limits[i].angle());
                prop_assert!((c(k) - c(k - 1)).abs() / DT_S <= joint_limits[i].rate() * (1.0 + 1e-9));
                prop_assert!(jerk.abs() <= joint_limits[i].jerk() * (1.0 + 1e-6) + 1e-5, "{jerk} at {k}");
            }
        }
    }
}

#[test]
fn a_joint_that_hardly_jumps_keeps_to_what_is_wanted_while_another_ramps() {
    // As at a reversal: one joint's backlash changes sides, which hardly affects the corrections of
    // the others.
    let run = |jump: f64, speed: f64, phase: f64| {
        let wave = |k: i32| 1e-4 * libm::sin(phase + speed / 1e-4 * DT_S * f64::from(k));
        let mut arm = Limiters::from_motion(|i| (wave(0) * i as f64, 0.0, 0.0));
        let mut most = 0.0_f64;
        for k in 1..3000 {
            let wanted = if k < 1000 { [0.0, wave(k)] } else { [3e-4, wave(k) - jump] };
            let c = arm.step(&wanted, |_| Some(limits(2e-3, 0.05, 5.0)), Elapsed::exact(DT_S));
            most = if k < 900 { 0.0 } else { most.max((c[1] - wanted[1]).abs()) };
        }
        most
    };
    for jump in [1e-9, 1e-8, 5e-8, 2e-7, 1e-6, 3e-6, 5e-6, 1e-5, 3e-5, 1e-4] {
        for speed in [1e-6, 2e-5, 1e-4, 1e-3] {
            for phase in 0..12 {
                let most = run(jump, speed, f64::from(phase) * 0.5);
                assert!(
                    most < 1e-6 + 3.0 * jump,
                    "{most:e} at a jump by {jump:e}, {speed}, {phase}"
                );
            }
        }
    }
}

proptest! {
    /// A daemon is restarted with tighter limits and answers intermittently: the joints alternately
    /// track its corrections, each by itself, and ramp to zero along a line.
    #[test]
    fn no_joint_keeps_the_pace_of_others_that_have_arrived(
        from in prop::array::uniform6(-2e-2..2e-2_f64), small in 1e-5..2e-4_f64,
        answered in prop::collection::vec(any::<bool>(), 40), every in 1_usize..60, late in 1_usize..300,
    ) {
        let (wide, tight) = (limits(0.02, 0.05, 5.0), limits(2e-3, 5e-3, 0.5));
        let mut from = from;
        from[0] = small;
        let mut arm = Limiters::from_motion(|i| (from[i], 0.0, 0.0));
        let mut alone_s: Option<f64> = None;
        for k in 0..6000 {
            let has_answer = answered.get(k / every).copied().unwrap_or(false);
            // A late cycle makes the others, which are fast, plan again.
            let dt_s = if k % late == 0 { 15.0 * DT_S } else { DT_S };
            let elapsed = Elapsed::exact(dt_s);
            let limits = |_| Some(if k < 10 { wide } else { tight });
            let c = if has_answer {
                arm.step_independently(&[0.0; 6], limits, elapsed)
            } else {
                arm.step(&[0.0; 6], limits, elapsed)
            };
            let arrived = |others: &[f64]| others.iter().all(|c| *c == 0.0);
            if c[0] != 0.0 && arrived(&c[1..]) {
                *alone_s.get_or_insert_default() += dt_s;
            }
        }
        // The swing by the change of limits takes up to 0.4 s by the fastest plan; at a hundredth
        // of the rate it would take seconds.
        prop_assert!(alone_s.unwrap_or_default() < 0.5, "{alone_s:?} s from {from:?}");
        prop_assert_eq!(arm.values(), [0.0; 6]);
    }
}

#[test]
fn joints_that_take_each_other_back_do_so_all_the_way_out() {
    // Two joints whose corrections cancel at the tool except for a tenth: 5 and -4 mrad, with lever
    // arms of 0.8 and 0.9 m.
    let (from, worth) = ([5e-3, -4e-3], [0.8, 0.9]);
    let at_tool = |c: &[f64; 2]| c[0] * worth[0] + c[1] * worth[1];
    let mut arm = Limiters::from_motion(|i| (from[i], 0.0, 0.0));
    let mut most = 0.0_f64;
    for _ in 0..2000 {
        let c = arm.step(&[0.0; 2], |_| Some(limits(0.01, 0.1, 5.0)), Elapsed::exact(DT_S));
        most = most.max(at_tool(&c).abs());
    }
    assert!(most <= at_tool(&from).abs() * (1.0 + 1e-9), "{most}");
}

#[test]
fn a_joint_without_limits_stands_and_holds_nobody_up() {
    let mut arm = Limiters::from_motion(|i| ([1e-3, 2e-3][i], 0.0, 0.0));
    let limits = |i| (i == 0).then(|| limits(0.01, 0.1, 5.0));
    for _ in 0..1000 {
        arm.step(&[0.0; 2], limits, Elapsed::exact(DT_S));
    }
    assert_eq!(arm.step(&[0.0; 2], limits, Elapsed::exact(DT_S)), [0.0, 2e-3]);
}

#[test]
fn a_long_step_amid_a_slow_ramp_leaves_no_swing() {
    // The stop that a late step forces leaves more acceleration than a plan at the line's pace, an
    // eighth of the jerk, removes without a swing: the first joint went to 1 mrad here, to 5 mrad
    // where the fault simulation found it.
    let starts =
        [(-1.35e-4, -1.99e-3, -6.7e-3), (-8.4e-4, -1.25e-2, -0.04), (-5.8e-4, -8.9e-3, -0.03)];
    let wanted = [-3.78e-4, -1.73e-3, -6.6e-4];
    let limits = |_| Some(limits(0.02, 0.05, 5.0));
    for (turn, late) in (5..40).flat_map(|turn| (turn + 1..turn + 12).map(move |late| (turn, late)))
    {
        let mut arm = Limiters::from_motion(|i| starts[i]);
        for k in 0..3000 {
            let dt_s = if k == late { 20.0 * DT_S } else { DT_S };
            let [first, ..] =
                arm.step(if k < turn { &wanted } else { &[0.0; 3] }, limits, Elapsed::exact(dt_s));
            assert!(first.abs() < 7e-4, "{first} at {k}, turned at {turn}, late at {late}");
        }
    }
}

#[test]
fn nobody_waits_for_a_joint_that_has_arrived() {
    // Joints in motion, one of them with a long way back: the others move slowly because of it, and
    // took 3.2 times as long as each alone while they did so to the end.
    let starts = [
        [(3.5e-3, 0.043, -0.478), (1.3e-3, -8.6e-3, -0.17), (4.7e-3, -0.0186, -0.135)],
        [(-9.5e-4, 0.0106, 0.175), (3.85e-3, -0.0155, -0.142), (3.64e-3, 0.0348, -0.47)],
        [(-2.0e-3, 0.018, -0.205), (-3.88e-3, 0.0203, 0.129), (4.0e-4, -0.0196, 0.279)],
    ];
    let limits = |_| Some(limits(0.02, 0.05, 5.0));
    for start in starts {
        let (mut together, mut alone) =
            (Limiters::from_motion(|i| start[i]), Limiters::from_motion(|i| start[i]));
        let arrived =
            |step: &mut dyn FnMut() -> [f64; 3]| (0..4000).position(|_| step() == [0.0; 3]);
        let elapsed = Elapsed::exact(DT_S);
        let together = arrived(&mut || together.step(&[0.0; 3], limits, elapsed)).expect("in 4 s");
        let alone =
            arrived(&mut || alone.step_independently(&[0.0; 3], limits, elapsed)).expect("in 4 s");
        assert!(4 * together <= 11 * alone, "{together} ms, each alone in {alone} ms");
    }
}

#[test]
fn a_joint_does_not_swing_for_the_sake_of_one_that_brakes_into_tighter_bounds() {
    // The change of limits makes the first joint swing to 0.9 mrad by itself; at the pace of the
    // second, which still moves at ten times its new rate, it went on to 1.6 mrad on the way back
    // and took 1.4 s.
    let (wide, tight) = (limits(0.02, 0.05, 5.0), limits(2e-3, 5e-3, 0.5));
    let from = [1.76398798e-4, -1.9943786e-2, 1.39421906e-3];
    let mut arm = Limiters::from_motion(|i| (from[i], 0.0, 0.0));
    let mut arrived = None;
    for k in 0..2000 {
        let elapsed = Elapsed::exact(if k % 35 == 0 { 15.0 * DT_S } else { DT_S });
        let limits = |_| Some(if k < 10 { wide } else { tight });
        let answered = k < 4 || (140..144).contains(&k);
        let [first, ..] = if answered {
            arm.step_independently(&[0.0; 3], limits, elapsed)
        } else {
            arm.step(&[0.0; 3], limits, elapsed)
        };
        assert!(first.abs() < 1e-3, "{first} at {k}");
        arrived = if first == 0.0 { arrived.or(Some(k)) } else { None };
    }
    assert!(arrived.is_some_and(|k| k < 800), "{arrived:?}");
}

/// Random numbers between 0 and 1 (Marsaglia's xorshift), by seed.
struct Rng(u64);

impl Rng {
    fn new(seed: u64) -> Self {
        let mut chance = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..8 {
            chance.unit();
        }
        chance
    }

    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, most: f64) -> f64 {
        most * (2.0 * self.unit() - 1.0)
    }
}

/// Three joints in motion ramp to zero at an uneven pace. Returns the time that the last one takes
/// after the others have arrived, beyond what its own limits require, s.
fn held_up_s(seed: u64) -> f64 {
    let chance = &mut Rng::new(seed);
    let start = [8e-3, 1e-3, 1e-3]
        .map(|width| (chance.within(width), chance.within(8e-3), chance.within(0.1)));
    let limits = limits(2e-2, 1e-2, 5.0);
    let mut arm = Limiters::from_motion(|i| start[i]);
    let (mut alone_s, mut from) = (0.0, 0.0);
    for _ in 0..20_000 {
        let elapsed = Elapsed { dt_s: DT_S * (0.05 + 1.9 * chance.unit()), jitter_s: DT_S };
        let c = arm.step(&[0.0; 3], |_| Some(limits), elapsed);
        match c.iter().filter(|c| **c != 0.0).count() {
            0 => return alone_s - from / limits.rate(),
            1 if alone_s == 0.0 => {
                from = c.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
                alone_s = elapsed.dt_s;
            }
            1 => alone_s += elapsed.dt_s,
            _ => (alone_s, from) = (0.0, 0.0),
        }
    }
    f64::INFINITY
}

#[test]
fn the_last_joint_on_its_way_goes_by_its_own_limits() {
    // At an uneven pace a joint arrives with a remaining rate that its target does not have.
    // Counted as a distance, that delayed the last joint by 0.66 to 6.4 s in the first five cases.
    // A start, a stop and a swing within the jerk take up to 0.4 s.
    for seed in [2315, 8870, 14_885, 16_773, 21_519].into_iter().chain(1..2000) {
        let held_up_s = held_up_s(seed);
        assert!(held_up_s < 0.45, "{held_up_s} s, seed {seed}");
    }
}

/// Its arrival makes the others plan anew while they decelerate, half way through their stop.
#[test]
fn joints_that_decelerate_stay_on_their_line_when_a_small_one_arrives() {
    let from = [4.931e-3, -2.204e-5, 1.645e-3];
    let (rates, jerks) = ([0.0487, 0.005, 0.01114], [13.5, 1.0, 16.36]);
    let limits = |i: usize| Some(limits(0.01, rates[i], jerks[i]));
    let mut arm = Limiters::from_motion(|i| (from[i], 0.0, 0.0));
    for k in 0..400 {
        let [first, _, last] = arm.step(&[0.0; 3], limits, Elapsed::exact(DT_S));
        assert!((first / from[0] - last / from[2]).abs() < 1e-6, "step {k}: {first:e}, {last:e}");
        assert!(first > -2e-4 * from[0], "{first:e} beyond zero in step {k}");
    }
    assert_eq!(arm.values(), [0.0; 3]);
}
