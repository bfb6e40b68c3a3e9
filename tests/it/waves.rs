//! A long waveform, read under an address-space limit.

use crate::program::Place;
use std::f64::consts::TAU;
use tests::rng::TestRng;

/// Interleaved 16-bit samples at 20 kHz with one line in every channel, and another in the last
/// tenth of the last channel only.
fn long_wav(channels: u16, seconds: u32, line_hz: f64, late_hz: f64) -> Vec<u8> {
    const RATE_HZ: u32 = 20_000;
    let bytes = RATE_HZ * seconds * u32::from(channels) * 2;
    let mut file = Vec::with_capacity(44 + bytes as usize);
    file.extend(b"RIFF");
    file.extend((36 + bytes).to_le_bytes());
    file.extend(b"WAVEfmt \x10\0\0\0\x01\0");
    file.extend(channels.to_le_bytes());
    file.extend(RATE_HZ.to_le_bytes());
    file.extend((RATE_HZ * u32::from(channels) * 2).to_le_bytes());
    file.extend((2 * channels).to_le_bytes());
    file.extend([16, 0]);
    file.extend(b"data");
    file.extend(bytes.to_le_bytes());
    let mut chance = TestRng::new(1);
    for sample in 0..RATE_HZ * seconds {
        let wave = |hz: f64| (TAU * hz * f64::from(sample) / f64::from(RATE_HZ)).sin();
        let value = 2000.0 * wave(line_hz) + 1000.0 * (chance.uniform() - 0.5);
        let is_late = sample >= RATE_HZ * seconds / 10 * 9;
        for channel in 1..=channels {
            let late = if is_late && channel == channels { 4000.0 * wave(late_hz) } else { 0.0 };
            file.extend(((value + late) as i16).to_le_bytes());
        }
    }
    file
}

/// 12 million samples are 96 MB as numbers; the program itself maps about 60 MB.
#[test]
fn a_long_waveform_is_read_in_parts() {
    let place = Place::new();
    std::fs::write(place.path("long.wav"), long_wav(6, 100, 684.0, 420.0)).unwrap();
    let done = place.run_within_mb(120, &["spectrum", "--json", "found.json", "long.wav"]);
    assert_eq!(done.code, Some(0), "{done:#?}");
    let found = place.json("found.json");
    let lines = found["lines"].as_array().expect("lines");
    let has = |hz: f64, channel: &str| {
        lines.iter().any(|line| {
            let is_near = line["frequency_Hz"].as_f64().is_some_and(|f| (f - hz).abs() < 0.2);
            is_near && line["channel"] == channel
        })
    };
    assert!(has(684.0, "column 1") && has(420.0, "column 6"), "{lines:#?}");
    assert!(!has(420.0, "column 1"), "{lines:#?}");
}
