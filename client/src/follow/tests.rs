//! The correction on the robot's side, without a daemon and without a clock.

use super::*;
use envelope::Limiter;
use proptest::prelude::*;

const MS: u64 = 1_000_000;
const DT_S: f64 = 1e-3;

fn bounds() -> JointBounds {
    JointBounds {
        min: [-3.0; JOINTS_MAX],
        max: [3.0; JOINTS_MAX],
        angle: [0.02; JOINTS_MAX],
        rate: [0.02; JOINTS_MAX],
        jerk: [5.0; JOINTS_MAX],
    }
}

fn follower() -> Follower {
    let mut follower = Follower::new();
    follower.set_bounds(&bounds());
    follower
}

fn answer(seq: u64, q_cmd: &[f64], correction: f64) -> Corrected {
    let mut answer = Corrected {
        seq,
        command_seq: seq,
        made_ns: seq * MS,
        joints: q_cmd.len() as u32,
        ..Corrected::default()
    };
    for (i, q) in q_cmd.iter().enumerate() {
        answer.correction[i] = correction;
        answer.q[i] = q + correction;
    }
    answer
}

fn sent(seq: u64, q_cmd: &[f64]) -> Command {
    let mut command = Command { seq, joints: q_cmd.len() as u32, ..Command::default() };
    command.q[..q_cmd.len()].copy_from_slice(q_cmd);
    command
}

/// Brings the correction to `c` by a daemon that ramps to it, and gives the time in ms.
fn led_to(follower: &mut Follower, c: f64) -> u64 {
    let mut daemon = Limiter::at_rest();
    let limits = Limits::new(0.02, 0.02, 5.0).unwrap();
    for seq in 1..5_000 {
        let value = daemon.step(c, &limits, DT_S);
        let mut made = answer(seq, &[0.5; 6], value);
        made.correction_rate = [daemon.rate(); JOINTS_MAX];
        made.correction_acceleration = [daemon.acceleration(); JOINTS_MAX];
        follower.target(&[0.5; 6], Some(&made), None, seq * MS);
        if value == c && seq > 100 && follower.stage == Stage::Following {
            return seq;
        }
    }
    panic!("the daemon never got there");
}

/// Rate and third difference of a row of corrections, at worst.
fn roughness(row: &[f64]) -> (f64, f64) {
    let rate = row.windows(2).map(|w| (w[1] - w[0]).abs() / DT_S).fold(0.0, f64::max);
    let jerk = row
        .windows(4)
        .map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs() / DT_S.powi(3))
        .fold(0.0, f64::max);
    (rate, jerk)
}

#[test]
fn without_a_daemon_the_plain_command_is_published() {
    let target = follower().target(&[0.1, 0.2], None, None, MS);
    assert_eq!((target.joints(), target.source()), (&[0.1, 0.2][..], Source::Plain));
}

#[test]
fn the_answer_to_this_very_command_is_published_bit_for_bit() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.003);
    let q_cmd = [0.7; 6];
    let mut made = answer(at + 1, &q_cmd, 0.003);
    made.q[0] = made.q[0].next_up();
    let target = follower.target(&q_cmd, Some(&made), Some(&sent(at + 1, &q_cmd)), (at + 1) * MS);
    assert_eq!((target.joints(), target.source()), (made.joints(), Source::Corrected));
}

#[test]
fn an_answer_that_was_made_of_another_target_is_not_published() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.003);
    let q_cmd = [0.7; 6];
    let mut torn = answer(at + 1, &q_cmd, 0.003);
    torn.q[0] = 0.9;
    let target = follower.target(&q_cmd, Some(&torn), Some(&sent(at + 1, &q_cmd)), (at + 1) * MS);
    assert_eq!((target.joints(), target.source()), (&[0.703; 6][..], Source::LastCorrection));
}

#[test]
fn a_clock_of_commands_that_is_set_moves_no_ramp() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.003);
    let mut before = 0.003;
    for k in 0..200 {
        // An hour ahead, and back again, while the daemon is silent.
        let hour_ns = if (60..120).contains(&k) { 3_600_000 * MS } else { 0 };
        let now_ns = (at + 20 + k) * MS;
        let command = Command { t_ns: now_ns + hour_ns, ..sent(at + 20 + k, &[0.5; 6]) };
        let target = follower.target(&[0.5; 6], None, Some(&command), now_ns);
        let moved = (target.joints()[0] - 0.5 - before).abs();
        before = target.joints()[0] - 0.5;
        // After the first, which is 20 ms late: never more than 1 ms at the rate of the bounds.
        assert!(k == 0 || moved <= 0.02 * 1.01e-3, "{k}: {moved}");
    }
}

#[test]
fn a_later_command_borrows_the_newest_correction() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.003);
    let made = answer(at, &[0.5; 6], 0.003);
    let target = follower.target(&[0.51; 6], Some(&made), Some(&sent(at + 1, &[0.51; 6])), at * MS);
    assert_eq!(target.source(), Source::LastCorrection);
    assert!((target.joints()[0] - 0.513).abs() < 1e-15);
}

#[test]
fn a_daemon_that_dies_leaves_a_ramp_within_the_envelope_and_the_plain_command_at_its_end() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    let last = answer(at, &[0.5; 6], 0.01);
    let mut row = vec![0.01; 3];
    let mut sources = Vec::new();
    for ms in at..at + 3_000 {
        let target = follower.target(&[0.5; 6], Some(&last), None, ms * MS);
        row.push(target.joints()[3] - 0.5);
        sources.push(target.source());
    }
    let (rate, jerk) = roughness(&row);
    assert!(rate <= 0.02 * 1.000_1, "{rate}");
    assert!(jerk <= 5.0 * 1.001, "{jerk}");
    assert_eq!(sources[9], Source::LastCorrection);
    assert_eq!(sources[11], Source::Ramping);
    assert_eq!(*sources.last().unwrap(), Source::Plain);
    assert_eq!(*row.last().unwrap(), 0.0);
}

#[test]
fn a_pause_in_sending_moves_a_ramp_no_faster() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    let last = answer(at, &[0.5; 6], 0.01);
    let command = |ms: u64| Command { t_ns: ms * MS, ..sent(ms, &[0.5; 6]) };
    let mut row = Vec::new();
    for ms in at..at + 200 {
        // Nothing can be sent for 80 ms; then a command is stamped now.
        let stamped = if (at + 40..at + 120).contains(&ms) { at + 39 } else { ms };
        let target = follower.target(&[0.5; 6], Some(&last), Some(&command(stamped)), ms * MS);
        row.push(target.joints()[3] - 0.5);
    }
    let (rate, _) = roughness(&row);
    assert!(rate <= 0.02 * 1.000_1, "{rate}");
    assert!(*row.last().unwrap() < 0.009, "the ramp goes on: {row:?}");
}

#[test]
fn a_loop_that_jitters_ramps_no_further_than_time_has_passed() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    // As if commands had been sent all the while.
    (follower.sent_t_ns, follower.ahead_ns) = (Some(at * MS), 0);
    let last = answer(at, &[0.5; 6], 0.01);
    let mut put_out = |k: u64| {
        // Commands are stamped evenly; every other target is asked for early, ever more so.
        let command = Command { t_ns: (at + k) * MS, ..sent(at + k, &[0.5; 6]) };
        let now_ns = (at + k) * MS - if k.is_multiple_of(2) { 3_000 * k } else { 0 };
        follower.target(&[0.5; 6], Some(&last), Some(&command), now_ns).joints()[0] - 0.5
    };
    let row: Vec<f64> = (1..320).map(&mut put_out).collect();
    // At a ramp's full rate, nine tenths of the bound, between two targets that were asked for in time.
    let (ramped, due) = (row[170] - row[318], 0.9 * 0.02 * 0.148);
    assert!((ramped / due - 1.0).abs() < 3e-4, "{ramped}, not {due}");
}

#[test]
fn a_pause_of_this_thread_is_not_made_up_for_twice() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    let command = |ms: u64| Command { t_ns: ms * MS, ..sent(ms, &[0.5; 6]) };
    let mut put_out = |stamped_ms: u64, made_ms: u64, ms: u64| {
        let made = answer(made_ms, &[0.5; 6], 0.01);
        follower.target(&[0.5; 6], Some(&made), Some(&command(stamped_ms)), ms * MS).joints()[0]
    };
    put_out(at + 1, at + 1, at + 1);
    // Stamped, then held up for 60 ms: the last answer is stale by then, and the ramp has used the time.
    let late = put_out(at + 2, at + 1, at + 62);
    let next = put_out(at + 65, at + 64, at + 65);
    assert!((next - late).abs() <= 0.02 * 0.003 * 1.000_1, "{:e}", next - late);
}

#[test]
fn a_daemon_that_dies_while_its_correction_moves_leaves_no_kink() {
    let mut follower = follower();
    let limits = Limits::new(0.02, 0.02, 5.0).unwrap();
    let mut daemon = Limiter::at_rest();
    let mut row = Vec::new();
    let mut last = None;
    for ms in 1..=2_000_u64 {
        if ms <= 300 {
            let mut made = answer(ms, &[0.5; 6], daemon.step(0.015, &limits, DT_S));
            made.correction_rate = [daemon.rate(); JOINTS_MAX];
            made.correction_acceleration = [daemon.acceleration(); JOINTS_MAX];
            last = Some(made);
            follower.fresh_ns = FRESH_NS;
        } else {
            follower.fresh_ns = 0;
        }
        let target = follower.target(&[0.5; 6], last.as_ref(), None, ms * MS);
        row.push(target.joints()[0] - 0.5);
    }
    let (rate, jerk) = roughness(&row);
    assert!(row[299] > 0.001 && row[1_999] == 0.0);
    assert!(rate <= 0.02 * 1.000_1 && jerk <= 5.0 * 1.01, "{rate} {jerk}");
}

#[test]
fn contact_that_returns_is_blended_in_within_the_envelope_until_it_is_followed() {
    let mut follower = follower();
    let mut row = vec![0.0; 3];
    let mut source = Source::Plain;
    for ms in 1..=3_000 {
        let made = answer(ms, &[0.5; 6], 0.012);
        let target = follower.target(&[0.5; 6], Some(&made), None, ms * MS);
        row.push(target.joints()[5] - 0.5);
        source = target.source();
    }
    let (rate, jerk) = roughness(&row);
    assert!(rate <= 0.02 * 1.000_1 && jerk <= 5.0 * 1.01, "{rate} {jerk}");
    assert_eq!(source, Source::LastCorrection);
    assert!((row.last().unwrap() - 0.012).abs() < 1e-15);
}

#[test]
fn a_daemon_that_restarts_before_it_is_missed_makes_no_step() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    follower.rejoined();
    let mut row = vec![0.01; 3];
    for ms in at + 1..at + 3_000 {
        let made = answer(ms, &[0.5; 6], 0.0);
        row.push(follower.target(&[0.5; 6], Some(&made), None, ms * MS).joints()[0] - 0.5);
    }
    let (rate, jerk) = roughness(&row);
    assert!(rate <= 0.02 * 1.000_1 && jerk <= 5.0 * 1.01, "{rate} {jerk}");
    assert_eq!(*row.last().unwrap(), 0.0);
}

#[test]
fn a_moving_correction_is_caught_up_with_although_its_stamps_jitter() {
    let mut follower = follower();
    let mut caught = None;
    for ms in 1..=5_000_u64 {
        let of_joint = |j: usize| 2e-3 + 1e-3 * (ms as f64 * DT_S * 3.0 / (1 + j) as f64).sin();
        let correction = of_joint(0);
        let mut made = answer(ms, &[0.5; 6], correction);
        for j in 0..6 {
            made.correction[j] = of_joint(j);
            made.q[j] = 0.5 + of_joint(j);
        }
        made.made_ns = ms * MS + (ms * 7_919) % 100_000;
        let target = follower.target(&[0.5; 6], Some(&made), None, ms * MS + 100_000);
        if target.source() == Source::LastCorrection {
            caught = caught.or(Some(ms));
            assert!((target.joints()[0] - 0.5 - correction).abs() < 1e-15);
        }
    }
    assert!(caught.is_some_and(|ms| ms < 1_200), "{caught:?}");
}

#[test]
fn a_command_that_did_not_go_out_takes_no_time_from_one_tick_and_gives_it_to_the_next() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    // As if commands had been sent all the while.
    follower.ahead_ns = 0;
    let command = |t_ns: u64| Command { t_ns, ..sent(t_ns, &[0.5; 6]) };
    let (mut before, mut sent) = (None, command(at * MS));
    follower.sent_t_ns = Some(at * MS);
    for tick in 1..1000_u64 {
        let now_ns = (at + tick) * MS;
        // One in twenty does not go out, and from there on commands are stamped later or earlier by 0.3 ms than before.
        if tick % 20 != 0 {
            sent = command(now_ns + 300_000 * (tick / 20 % 2));
        }
        let target = follower.target(&[0.5; 6], None, Some(&sent), now_ns);
        let now = target.joints()[0] - 0.5;
        let moved = before.map_or(0.0, |before: f64| (now - before).abs());
        if target.source() == Source::Ramping {
            assert!(moved <= 0.02 * DT_S * 1.001, "tick {tick}: {moved}");
        }
        before = Some(now);
    }
    assert_eq!(before, Some(0.0));
}

#[test]
fn a_refused_command_publishes_the_daemons_last_good_target() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.0);
    let mut made = answer(at + 1, &[0.4; 6], 0.0);
    made.status = CorrectionStatus::Rejected.code();
    let target = follower.target(&[9.0; 6], Some(&made), None, (at + 1) * MS);
    assert_eq!((target.joints()[0], target.source()), (0.4, Source::Rejected));
}

#[test]
fn an_answer_that_is_no_number_counts_as_silence() {
    let mut follower = follower();
    let made = answer(1, &[0.5; 6], f64::NAN);
    let target = follower.target(&[0.5; 6], Some(&made), None, MS);
    assert_eq!((target.joints()[0], target.source()), (0.5, Source::Plain));
}

#[test]
fn a_borrowed_correction_stays_within_the_joint_limits() {
    let mut follower = follower();
    let at = led_to(&mut follower, 0.01);
    let made = answer(at, &[0.5; 6], 0.01);
    let target = follower.target(&[2.995; 6], Some(&made), None, at * MS);
    assert_eq!(target.joints()[0], 3.0);
}

proptest! {
    #[test]
    fn whatever_the_daemon_does_the_correction_keeps_its_rate(
        seed in proptest::collection::vec((any::<bool>(), -0.02..0.02_f64), 200),
    ) {
        let mut follower = follower();
        let limits = Limits::new(0.02, 0.02, 5.0).unwrap();
        let mut daemon = Limiter::at_rest();
        let mut before = 0.0;
        let mut wanted = 0.0;
        for (i, (there, jump)) in seed.iter().enumerate() {
            if i % 20 == 0 { wanted = *jump; }
            let ms = i as u64 * 4 + 1;
            // A daemon that comes back starts its correction anew.
            if !there && i % 7 == 0 { daemon = Limiter::at_rest(); follower.fresh_ns = 0; }
            let value = daemon.step(wanted, &limits, 4.0 * DT_S);
            let mut made = answer(ms, &[0.5; 6], value);
            made.correction_rate = [daemon.rate(); JOINTS_MAX];
            made.correction_acceleration = [daemon.acceleration(); JOINTS_MAX];
            let heard = there.then_some(&made);
            let target = follower.target(&[0.5; 6], heard, None, ms * MS);
            let now = target.joints()[0] - 0.5;
            prop_assert!(now.is_finite() && now.abs() <= 0.02 * 1.001);
            if follower.stage != Stage::Following {
                prop_assert!((now - before).abs() <= 0.02 * 4.0 * DT_S * 1.01 + 1e-12);
            }
            before = now;
        }
    }
}

#[test]
fn answers_that_were_missed_are_caught_up_with_within_the_rate() {
    let mut follower = follower();
    let (rate, q) = (0.01, [0.5; 6]);
    // The daemon ramps on at half the rate that it may; its answers 10 to 17 are late, younger ones come in time.
    let made = |seq: u64| {
        let mut made = answer(seq, &q, rate * DT_S * seq as f64);
        made.correction_rate = [rate; JOINTS_MAX];
        made
    };
    let mut before = 0.0;
    for tick in 1..1500_u64 {
        let newest = if (10..18).contains(&tick) { made(9) } else { made(tick) };
        let target = follower.target(&q, Some(&newest), None, tick * MS);
        let now = target.joints()[0] - q[0];
        if tick > 1 {
            assert!((now - before).abs() <= 2.0 * rate * DT_S, "tick {tick}: {before} to {now}");
        }
        before = now;
    }
    assert!((before - rate * DT_S * 1499.0).abs() < 1e-9, "it caught up: {before}");
}
