//! The vibration monitor, from noise to a line and back, with gaps and broken samples.

use crate::heap_of;
use spectrum::{Block, MonitorConfig, State, VibrationMonitor};
use tests::rng::TestRng;

const RATE_HZ: f64 = 10_000.0;
const CHANNELS: usize = 3;
const FRAMES: usize = 10;
const BLOCKS: u64 = 6_000;

fn samples(k: u64, rng: &mut TestRng) -> [f64; CHANNELS * FRAMES] {
    let mut samples = [0.0; CHANNELS * FRAMES];
    for (i, sample) in samples.iter_mut().enumerate() {
        let t_s = (k * FRAMES as u64) as f64 / RATE_HZ + (i / CHANNELS) as f64 / RATE_HZ;
        let rings = (2.5..4.5).contains(&t_s);
        let line = if rings { 8.0 * (std::f64::consts::TAU * 72.0 * t_s).sin() } else { 0.0 };
        *sample = line + rng.uniform() - 0.5;
        if k % 1501 == 1500 {
            *sample = f64::NAN;
        }
    }
    samples
}

#[test]
fn the_watch_takes_nothing_from_the_heap() {
    let config = MonitorConfig { rate_hz: RATE_HZ, channels: CHANNELS, ..MonitorConfig::default() };
    let mut watch = VibrationMonitor::new(config).unwrap();
    let mut chance = TestRng::new(7);
    let (mut alarms, mut overs) = (0, 0);
    let heap = heap_of(|| {
        for k in 0..BLOCKS {
            let samples = samples(k, &mut chance);
            // A gap now and then, after the ringing.
            let seq = if k < 5_000 { k } else { k + k / 100 };
            let t_ns = k * 1_000_000;
            let block = Block {
                seq,
                t_ns,
                rate_hz: RATE_HZ,
                channels: CHANNELS,
                samples: &samples,
                ..Block::default()
            };
            for verdict in &watch.push(&block) {
                alarms += u32::from(verdict.state == State::Alarm);
                overs += u32::from(verdict.state == State::Over);
            }
        }
    });
    assert!(alarms > 0 && overs > 0, "it saw the line come and go: {alarms}, {overs}");
    assert_eq!((heap.count_total, heap.count_current), (0, 0));
}
