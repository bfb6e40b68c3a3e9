//! Limits that change during any motion: the larger of both hold while it brakes, then the new
//! ones.

use super::*;

fn any_limits() -> impl Strategy<Value = Limits> {
    (-3.5..-1.5_f64, -2.5..-0.5_f64, -1.0..2.0_f64).prop_map(|(angle, rate, jerk)| {
        let power = |exponent| libm::pow(10.0, exponent);
        Limits::new(power(angle), power(rate), power(jerk)).expect("positive")
    })
}

/// A motion that can stop within `limits`, most often only just.
fn motion_within(limits: &Limits, shares: (f64, f64, f64), share: f64) -> Motion {
    let peak_acceleration = libm::sqrt(limits.jerk() * limits.rate());
    let swinging = Motion {
        value: shares.0 * limits.angle(),
        rate: shares.1 * limits.rate(),
        acceleration: shares.2 * peak_acceleration,
    };
    let scaled = |by: f64| Motion {
        value: by * swinging.value,
        rate: by * swinging.rate,
        acceleration: by * swinging.acceleration,
    };
    let (mut inside, mut outside) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = (inside + outside) / 2.0;
        if scaled(middle).stops_inside(limits) { inside = middle } else { outside = middle }
    }
    scaled(inside * share)
}

fn shares() -> impl Strategy<Value = (f64, f64, f64)> {
    (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64)
}

/// Upper bound of the time for braking into `new`: a stop, and the fastest motion to `goal` at
/// rest.
fn longest_s(from: Motion, goal: f64, larger: &Limits) -> f64 {
    let stop = Plan::to_zero(
        Motion { value: 0.0, ..from },
        (-larger.rate(), larger.rate()),
        larger.jerk(),
    );
    let way = Plan::to_zero(
        from.minus(Motion::at_rest(goal)),
        (-larger.rate(), larger.rate()),
        larger.jerk(),
    );
    stop.remaining_s() + way.remaining_s()
}

/// Whether four samples in a row keep the limits.
fn kept(outputs: &[f64], limits: &Limits) -> Result<(), TestCaseError> {
    let slack = 1.0 + 1e-6;
    let newest = outputs.len() - 1;
    let back = |by: usize| outputs[newest - by];
    prop_assert!(back(0).abs() <= limits.angle() * slack, "angle {}", back(0));
    let rate = (back(0) - back(1)) / DT_S;
    prop_assert!(rate.abs() <= limits.rate() * slack + 1e-13, "rate {rate} of {limits:?}");
    if newest >= 3 {
        let third = back(0) - 3.0 * back(1) + 3.0 * back(2) - back(3);
        let jerk = third / (DT_S * DT_S * DT_S);
        let rounding = 16.0 * 4e-18 / (DT_S * DT_S * DT_S);
        prop_assert!(jerk.abs() <= limits.jerk() * slack + rounding, "jerk {jerk} of {limits:?}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn the_larger_limits_hold_until_the_new_ones_do(
        old in any_limits(), new in any_limits(), shares in shares(),
        share in prop_oneof![Just(1.0), 0.0..1.0_f64], wanted in -2.0..2.0_f64,
    ) {
        let larger = old.union(&new);
        let from = motion_within(&old, shares, share);
        let mut limiter = Limiter::from_motion(from.value, from.rate, from.acceleration);
        limiter.update_limits(&old);
        let goal = wanted * old.angle().max(new.angle());
        let held = goal.clamp(-new.angle(), new.angle());
        let longest_s = longest_s(from, held, &larger) + 3.0 * DT_S;
        // The initial motion is continuous; its samples before the first step are taken from it.
        let before = |k: i32| from.after(f64::from(k) * DT_S, 0.0).value;
        let mut outputs = std::vec![before(-2), before(-1), from.value];
        let mut inside_s = None;
        for k in 1..=6000 {
            outputs.push(limiter.step(goal, &new, DT_S));
            kept(&outputs[outputs.len() - 4..], &larger)?;
            if inside_s.is_none() && limiter.in_force == Some(new) {
                inside_s = Some(f64::from(k) * DT_S);
            }
            if inside_s.is_some_and(|s| f64::from(k) * DT_S > s + 3.0 * DT_S) {
                kept(&outputs[outputs.len() - 4..], &new)?;
            }
            prop_assert!(
                inside_s.is_some() || f64::from(k) * DT_S <= longest_s,
                "outside for {} s of {longest_s} s: {:?}", f64::from(k) * DT_S, limiter.motion
            );
        }
    }

    #[test]
    fn braking_never_turns_back(
        old in any_limits(), new in any_limits(), shares in shares(), wanted in -1.0..1.0_f64,
    ) {
        let from = motion_within(&old, shares, 1.0);
        let mut limiter = Limiter::from_motion(from.value, from.rate, from.acceleration);
        limiter.update_limits(&old);
        // Towards the new limits, or to a stop: the rate changes its sign at most once.
        let (mut last, mut sign, mut turns) = (from.value, 0.0, 0);
        for _ in 0..6000 {
            let output = limiter.step(wanted * new.angle(), &new, DT_S);
            if limiter.in_force == Some(new) {
                break;
            }
            let moved = output - last;
            if moved.abs() > 1e-15 {
                turns += u32::from(sign != 0.0 && moved.signum() != sign);
                sign = moved.signum();
            }
            last = output;
        }
        prop_assert!(turns <= 2, "turned {turns} times from {from:?}");
    }

    #[test]
    fn limits_that_change_all_the_time_are_kept(
        all in prop::collection::vec(any_limits(), 12), wanted in prop::collection::vec(-2.0..2.0_f64, 12),
        lasts in prop::collection::vec(1..400_usize, 12),
    ) {
        let mut limiter = Limiter::at_rest();
        let mut outputs = std::vec![0.0; 3];
        let mut recent: [Option<Limits>; 4] = [None; 4];
        for ((limits, wanted), lasts) in all.iter().zip(wanted).zip(lasts) {
            for _ in 0..lasts {
                outputs.push(limiter.step(wanted * limits.angle(), limits, DT_S));
                let now = limiter.in_force.expect("stepped");
                let before = recent[0].map_or(*limits, |before| before.union(limits));
                prop_assert!(now.angle() <= before.angle() * (1.0 + 1e-9), "{now:?} after {before:?}");
                prop_assert!(now.rate() <= before.rate() * (1.0 + 1e-9), "{now:?} after {before:?}");
                recent.rotate_right(1);
                recent[0] = Some(now);
                let all = recent.iter().flatten().fold(now, |all, one| all.union(one));
                kept(&outputs[outputs.len() - 4..], &all)?;
            }
        }
    }

    #[test]
    fn what_is_wanted_is_reached_under_the_new_limits(
        old in any_limits(), new in any_limits(), shares in shares(), wanted in -1.0..1.0_f64,
    ) {
        let from = motion_within(&old, shares, 1.0);
        let mut limiter = Limiter::from_motion(from.value, from.rate, from.acceleration);
        limiter.update_limits(&old);
        let goal = wanted * new.angle();
        // While it brakes into the new limits it may still move across all of them.
        let way = goal.abs() + old.angle() + 2.0 * new.angle();
        let ramp_s = libm::cbrt(32.0 * way / (0.5 * new.jerk())) + way / (0.9 * new.rate());
        let longest_s = longest_s(from, goal, &old.union(&new)) + 2.0 * ramp_s + 0.1;
        for _ in 0..(longest_s / DT_S) as usize {
            limiter.step(goal, &new, DT_S);
        }
        prop_assert_eq!(limiter.value().to_bits(), goal.to_bits());
    }
}
