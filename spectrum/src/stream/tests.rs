//! Faults of a stream: loss, repetition, restarts, wrong statements, still channels.

use super::*;

fn stream() -> SensorStream {
    SensorStream::new(&MonitorConfig { rate_hz: 1000.0, ..MonitorConfig::default() })
}

/// A block of a sender with counts: 10 samples of 3 channels, 1 kHz.
fn sent(session: u64, seq: u64) -> Block<'static> {
    let samples_before = Some(10 * seq);
    Block { session, samples_before, ..block(seq, seq * 10_000_000, &[0.0; 30]) }
}

/// Takes a block whole, samples and all.
fn take(stream: &mut SensorStream, block: &Block<'_>) -> BlockAdmission {
    let admission = stream.admit(block);
    if admission != BlockAdmission::Rejected {
        stream.advance(10);
    }
    admission
}

fn block(seq: u64, t_ns: u64, samples: &[f64]) -> Block<'_> {
    Block { seq, t_ns, rate_hz: 1000.0, channels: 3, samples, ..Block::default() }
}

#[test]
fn blocks_in_order_are_taken_and_a_jump_is_a_gap() {
    let mut stream = stream();
    let samples = [0.0; 30];
    assert_eq!(stream.admit(&block(7, 0, &samples)), BlockAdmission::Continuous);
    assert_eq!(stream.admit(&block(8, 10_000_000, &samples)), BlockAdmission::Continuous);
    assert_eq!(stream.admit(&block(11, 40_000_000, &samples)), BlockAdmission::Restarted);
    assert_eq!((stream.health().gaps, stream.health().lost_blocks), (1, 2));
    assert!(stream.health().stream.contains(Fault::Gap));
    assert_eq!(stream.admit(&block(12, 90_000_000, &samples)), BlockAdmission::Restarted);
}

#[test]
fn a_wrong_rate_or_shape_is_refused_and_named() {
    let mut stream = stream();
    let wrong = Block { rate_hz: 2000.0, ..block(0, 0, &[0.0; 3]) };
    assert_eq!(stream.admit(&wrong), BlockAdmission::Rejected);
    assert_eq!(stream.admit(&block(0, 0, &[0.0; 4])), BlockAdmission::Rejected);
    let nan = Block { rate_hz: f64::NAN, ..block(0, 0, &[0.0; 3]) };
    assert_eq!(stream.admit(&nan), BlockAdmission::Rejected);
    let health = stream.health();
    assert_eq!(health.refused_blocks, 3);
    assert!(health.stream.contains(Fault::WrongRate) && health.stream.contains(Fault::WrongShape));
}

#[test]
fn a_sender_that_samples_slower_than_it_says_is_found_out() {
    let mut stream = stream();
    let samples = [0.0; 30];
    for seq in 0..300 {
        stream.admit(&block(seq, seq * 10_500_000, &samples));
        stream.advance(10);
    }
    assert!(stream.health().stream.contains(Fault::WrongRate));
}

#[test]
fn one_silent_channel_among_noisy_ones_is_dead() {
    let mut stream = stream();
    for i in 0..1500 {
        let x = (0.7 * f64::from(i)).sin();
        for (channel, sample) in [x, 1e-9 * x, x].into_iter().enumerate() {
            stream.check_sample(channel, sample);
        }
        stream.advance(1);
    }
    let channel = stream.health().channel;
    assert!(channel[1].contains(Fault::Dead) && channel[0].is_empty(), "{channel:?}");
}

#[test]
fn another_session_restarts_the_counts_without_a_gap() {
    let mut stream = stream();
    for seq in 500..700 {
        take(&mut stream, &sent(1, seq));
    }
    assert_eq!(take(&mut stream, &sent(2, 1)), BlockAdmission::Restarted);
    assert_eq!(take(&mut stream, &sent(2, 2)), BlockAdmission::Continuous);
    let health = stream.health();
    assert_eq!(
        (health.restarts, health.gaps, health.lost_blocks, health.lost_samples),
        (1, 0, 0, 0)
    );
    assert!(!health.stream.contains(Fault::Gap));
}

#[test]
fn a_sender_that_restarts_all_the_time_is_named() {
    let mut stream = stream();
    for session in 1..20 {
        take(&mut stream, &sent(session, 1));
    }
    assert!(stream.health().stream.contains(Fault::Gap), "no window ever fills");
}

#[test]
fn blocks_that_come_twice_or_late_are_refused_and_cost_nothing() {
    let mut stream = stream();
    for seq in [1, 2, 2, 3, 1, 4] {
        take(&mut stream, &sent(7, seq));
    }
    let health = stream.health();
    assert_eq!((health.blocks, health.refused_blocks, health.gaps), (4, 2, 0));
    assert!(health.stream.contains(Fault::OutOfOrder));
}

#[test]
fn a_sender_that_restarts_its_count_silently_is_not_refused_for_ever() {
    let mut stream = stream();
    for seq in 500..520 {
        take(&mut stream, &sent(7, seq));
    }
    let again = |seq: u64| Block { t_ns: 5_200_000_000 + seq * 10_000_000, ..sent(7, seq) };
    assert_eq!(take(&mut stream, &again(1)), BlockAdmission::Restarted);
    assert_eq!(take(&mut stream, &again(2)), BlockAdmission::Continuous);
    assert_eq!((stream.health().gaps, stream.health().lost_blocks), (1, 0));
}

#[test]
fn samples_that_are_missing_between_numbered_blocks_are_counted() {
    let mut stream = stream();
    take(&mut stream, &sent(7, 1));
    let short = Block { samples_before: Some(23), ..sent(7, 2) };
    assert_eq!(take(&mut stream, &short), BlockAdmission::Restarted);
    assert_eq!((stream.health().gaps, stream.health().lost_samples), (1, 3));
    let lost = Block { samples_before: Some(83), ..sent(7, 8) };
    assert_eq!(take(&mut stream, &lost), BlockAdmission::Restarted);
    let health = stream.health();
    assert_eq!((health.gaps, health.lost_blocks, health.lost_samples), (2, 5, 53));
}

#[test]
fn time_that_jumps_back_is_a_gap() {
    let mut stream = stream();
    take(&mut stream, &sent(7, 100));
    assert_eq!(take(&mut stream, &Block { t_ns: 0, ..sent(7, 101) }), BlockAdmission::Restarted);
}

#[test]
fn zero_for_a_while_is_dead_and_any_other_constant_stuck_until_it_moves() {
    let mut stream = stream();
    let mut run = |milliseconds: u32, y: &dyn Fn(u32) -> f64| {
        for i in 0..milliseconds {
            let x = (0.7 * f64::from(i)).sin();
            for (channel, sample) in [x, y(i), x].into_iter().enumerate() {
                stream.check_sample(channel, sample);
            }
            stream.advance(1);
        }
        let faults = stream.health().channel[1];
        (faults.iter().collect::<Vec<_>>(), stream.is_suspended(1), stream.take_recovered())
    };
    let moving = |i: u32| (1.1 * f64::from(i)).cos();
    assert_eq!(run(2000, &moving), (vec![], false, 0));
    assert_eq!(run(150, &|_| 0.0), (vec![Fault::Dead], true, 0));
    assert_eq!(run(2000, &|_| 2.5), (vec![Fault::Stuck], true, 0));
    assert_eq!(run(2000, &moving), (vec![], false, 0b10));
    assert_eq!(run(10, &moving), (vec![], false, 0));
}

#[test]
fn a_quiet_moment_beside_a_loud_force_is_not_dead() {
    let config = MonitorConfig { rate_hz: 1000.0, channels: 6, ..MonitorConfig::default() };
    let mut stream = SensorStream::new(&config);
    for i in 0..1500 {
        let x = (0.7 * f64::from(i)).sin();
        for channel in 0..6 {
            stream.check_sample(channel, if channel < 3 { 2000.0 * x } else { 1e-3 * x });
        }
        stream.advance(1);
    }
    assert!(stream.health().is_good(), "{:?}", stream.health());
}
