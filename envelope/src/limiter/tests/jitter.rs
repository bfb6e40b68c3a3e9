//! Uncertain times: a moving request is still followed.

use super::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_signal_sampled_evenly_is_followed_bit_for_bit_whatever_the_jitter_of_its_times(
        share in 0.1..0.6_f64, rad_s in 0.2..6.0_f64, jitter_share in 0.0..0.4_f64,
        noise in prop::collection::vec(-0.5..0.5_f64, 3000), gap in 300..900_usize,
    ) {
        let l = Limits::new(0.02, 0.05, 5.0).expect("positive");
        let amplitude = share * l.angle().min(l.rate() / rad_s).min(l.jerk() / (rad_s * rad_s * rad_s));
        let jitter_s = jitter_share * DT_S;
        let mut limiter = Limiter::from_motion(0.0, amplitude * rad_s, 0.0);
        let (mut exact, mut before) = (0, 0.0);
        for (k, noise) in noise.iter().enumerate() {
            let wanted = amplitude * libm::sin(rad_s * DT_S * k as f64);
            // One answer is missed: the signal is constant for a sample, then jumps.
            let wanted = if k == gap { limiter.value() } else { wanted };
            // Each time deviates from its nominal one by up to a quarter of the spread of the
            // intervals; the deviations do not accumulate.
            let elapsed = Elapsed { dt_s: DT_S + jitter_s / 2.0 * (noise - before), jitter_s };
            before = *noise;
            if !limiter.try_follow(wanted, &l, elapsed) {
                limiter.step_on_plan(&l, LimitShares::FULL, elapsed);
            }
            prop_assert!((limiter.value() - wanted).abs() < 0.1 * amplitude + 2e-5, "{} for {wanted} of {amplitude} at {k}, gap {gap}", limiter.value());
            if k > 2000 {
                exact += usize::from(limiter.value().to_bits() == wanted.to_bits());
            }
        }
        prop_assert!(exact >= 990, "{exact} of 999 exact, {amplitude} rad, jitter {jitter_s} s");
    }

    #[test]
    fn a_plan_that_begins_at_followed_samples_keeps_the_jerk_of_jitter(
        rad_s in 0.5..6.0_f64, jitter_s in 1e-6..3e-4_f64, shares in prop::collection::vec(-1.0..1.0_f64, 1..12),
    ) {
        let l = Limits::new(0.02, 0.05, 5.0).expect("positive");
        let amplitude = 0.5 * l.angle().min(l.rate() / rad_s).min(l.jerk() / (rad_s * rad_s * rad_s));
        let mut limiter = Limiter::from_motion(0.0, amplitude * rad_s, 0.0);
        let elapsed = Elapsed { dt_s: DT_S, jitter_s };
        let cube_s3 = DT_S * DT_S * DT_S;
        let mut outputs = std::vec![0.0];
        for k in 1..600 {
            let back = |by: usize| outputs[outputs.len() - by];
            let smooth = amplitude * libm::sin(rad_s * DT_S * f64::from(k));
            // Smooth for 0.2 s; then samples with deviations that jitter can or cannot explain;
            // then no request.
            let wanted = match shares.get((k as usize).wrapping_sub(200)) {
                Some(share) => 3.0 * back(1) - 3.0 * back(2) + back(3) + share * 3.0 * limiter.rate().abs() * jitter_s,
                None if k < 200 => smooth,
                None => 0.0,
            };
            if !limiter.try_follow(wanted, &l, elapsed) {
                limiter.step_on_plan(&l, LimitShares::FULL, elapsed);
            }
            outputs.push(limiter.value());
            if k < 12 {
                continue;
            }
            let newest = &outputs[outputs.len() - 12..];
            let rates: Vec<f64> = newest.windows(2).map(|two| (two[1] - two[0]) / DT_S).collect();
            let fastest = rates.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
            let change = rates.windows(2).fold(0.0_f64, |most, two| most.max((two[1] - two[0]).abs()));
            let third = newest[11] - 3.0 * newest[10] + 3.0 * newest[9] - newest[8];
            let most = l.jerk() + 8.0 * (fastest + 3.0 * change) * jitter_s / cube_s3;
            prop_assert!((third / cube_s3).abs() <= most * (1.0 + 1e-6), "jerk {} of {most} at {k}", third / cube_s3);
        }
    }

    #[test]
    fn angle_and_rate_hold_in_the_times_that_are_given_whatever_the_jitter(
        signal in signal(), steps_s in steps_s(), jitter_s in 0.0..1e-3_f64,
    ) {
        let l = limits();
        let mut limiter = Limiter::at_rest();
        let (mut t, mut last, mut before_s) = (0.0, 0.0, 0.0);
        for (k, dt_s) in steps_s.into_iter().enumerate() {
            t += dt_s;
            let elapsed = Elapsed { dt_s, jitter_s };
            if !limiter.try_follow(signal.at(k, t), &l, elapsed) {
                limiter.step_on_plan(&l, LimitShares::FULL, elapsed);
            }
            let output = limiter.value();
            prop_assert!(output.abs() <= l.angle(), "{output} at {t}");
            let rate = (output - last) / dt_s;
            let rounding = 4e-18 / dt_s;
            // Closer samples are checked against the rate together.
            let is_node = dt_s.min(before_s) >= NODE_SPACING_S;
            let most = l.rate() * (1.0 + 1e-9) + rounding;
            prop_assert!(rate.abs() <= most || !is_node, "rate {rate} at {t}");
            before_s = dt_s;
            last = output;
        }
    }

    #[test]
    fn a_sample_right_after_another_bends_no_plan(
        rate in 1e-6..0.02_f64, again_s in 1e-6..3e-4_f64, to in -1e-3..1e-3_f64,
    ) {
        let l = Limits::new(2e-3, 0.05, 5.0).expect("positive");
        let mut limiter = Limiter::from_motion(0.0, rate, 0.0);
        let mut outputs = std::vec![0.0];
        for k in 1..100 {
            let wanted = if k < 20 { rate * DT_S * f64::from(k) } else { to };
            // A command arrives twice, with one answer; after it another value is requested.
            let steps_s = if k == 20 { std::vec![again_s, DT_S - again_s] } else { std::vec![DT_S] };
            for (j, dt_s) in steps_s.iter().enumerate() {
                let wanted = if j + 1 < steps_s.len() { limiter.value() } else { wanted };
                let jitter_s = if (20..28).contains(&k) { again_s } else { 0.0 };
                let elapsed = Elapsed { dt_s: *dt_s, jitter_s };
                if !limiter.try_follow(wanted, &l, elapsed) {
                    limiter.step_on_plan(&l, LimitShares::FULL, elapsed);
                }
            }
            outputs.push(limiter.value());
        }
        let cube_s3 = DT_S * DT_S * DT_S;
        let most = l.jerk() + 8.0 * rate * again_s / cube_s3;
        for x in outputs.windows(4) {
            let jerk = (x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]) / cube_s3;
            prop_assert!(jerk.abs() <= most, "{jerk} of {most}");
        }
    }

    #[test]
    fn a_loop_that_runs_flat_out_comes_back_to_what_is_wanted(
        share in 0.1..0.6_f64, rad_s in 0.2..6.0_f64, off in -1e-5..1e-5_f64,
        pause_ns in prop_oneof![Just(0_u64), 1e4 as u64..2_000_000],
    ) {
        // An output every 3 to 5 µs, with occasional pauses, as between two polling processes. An
        // earlier version strayed by up to 10 mrad here.
        let l = Limits::new(0.02, 0.05, 5.0).expect("positive");
        let amplitude = share * l.angle().min(l.rate() / rad_s).min(l.jerk() / (rad_s * rad_s * rad_s));
        let mut limiter = Limiter::from_motion(off, amplitude * rad_s, 0.0);
        let mut intervals = crate::Intervals::new();
        let (mut now_ns, mut follows) = (0, 0);
        for k in 0..40_000_u64 {
            let hash = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
            now_ns += 3_000 + hash % 2_000 + if hash % 199 == 0 { pause_ns } else { 0 };
            let elapsed = intervals.elapse(now_ns, None).expect("no silence");
            let wanted = amplitude * libm::sin(rad_s * 1e-9 * now_ns as f64);
            if !limiter.try_follow(wanted, &l, elapsed) {
                limiter.step_on_plan(&l, LimitShares::FULL, elapsed);
            }
            follows += usize::from(limiter.is_following());
            // The request may change while nothing is put out.
            let most = off.abs() + 1.01 * amplitude * rad_s * 1e-9 * (5_000 + pause_ns) as f64;
            let is_off = (limiter.value() - wanted).abs();
            prop_assert!(is_off <= most, "{is_off} off at {k}");
        }
        prop_assert!(follows > 20_000, "{follows} of 40 000 are what is wanted");
    }
}
