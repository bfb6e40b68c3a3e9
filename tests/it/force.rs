//! The force stream over shared memory: losses, repetitions and restarts are detected and counted
//! as such.

use crate::TRUED;
use shm_schema::{Cell, SensorFault, Status, Verdict, VibrationState, WatchState, monotonic_ns};
use std::f64::consts::TAU;
use std::time::{Duration, Instant};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::rng::TestRng;
use tests::sensor::{ANY_CLOCK, Sensor};
use trued_client::{ForceSamples, ForceSource, Monitor, Samples, WrenchFrame};

const LIMIT: Duration = Duration::from_secs(20);

/// A daemon that monitors a stream with that rate and number of channels.
fn watching(rate_hz: f64, channels: u32) -> (TestDirectory, Process) {
    let tables = format!(
        "[force]\nrate_Hz = {rate_hz}\nchannels = {channels}\n{ANY_CLOCK}[vibration]\nenabled = true\n"
    );
    let place = TestDirectory::new("shadow", &tables);
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    (place, daemon)
}

/// A tone on y.
fn tone(frequency_hz: f64, amplitude: f64) -> impl Fn(u32, f64) -> f64 {
    move |channel, t_s| {
        if channel == 1 { amplitude * (TAU * frequency_hz * t_s).sin() } else { 0.0 }
    }
}

fn quiet(_: u32, _: f64) -> f64 {
    0.0
}

fn has(status: &Status, fault: SensorFault) -> bool {
    status.stream_faults & fault.bit() != 0
}

/// The last confirmed line.
fn confirmed(verdicts: &[Verdict]) -> Option<&Verdict> {
    verdicts.iter().rfind(|verdict| verdict.state() == Ok(VibrationState::Confirmed))
}

#[test]
fn six_channels_at_51_2_khz_are_taken_to_the_last_block() {
    let (place, _daemon) = watching(51_200.0, 6);
    let mut sensor = Sensor::join(&place, 51_200.0, 6);
    let (start, seconds) = (Instant::now(), 5.0);
    sensor.run(seconds, tone(684.0, 3.0));
    let status = sensor.settled();
    let took_s = start.elapsed().as_secs_f64();
    println!("{seconds} s of 6 channels at 51.2 kHz in {took_s:.2} s, {} blocks", sensor.sent);
    assert_eq!((status.force_blocks, status.force_gaps, status.force_refused), (sensor.sent, 0, 0));
    assert_eq!(status.force_faults().count(), 0, "{}", status.message);
    assert_eq!(status.watch(), Ok(WatchState::Watching));
    assert!((confirmed(&sensor.verdicts).unwrap().frequency_hz - 684.0).abs() < 1.0);
}

#[test]
fn small_blocks_at_51_2_khz_are_taken_to_the_last_one_too() {
    let (place, _daemon) = watching(51_200.0, 6);
    let mut sensor = Sensor::join(&place, 51_200.0, 6);
    sensor.block.samples = 32;
    sensor.run(0.6, quiet);
    let status = sensor.settled();
    assert_eq!((status.force_blocks, status.force_gaps, status.force_refused), (960, 0, 0));
}

#[test]
fn every_number_of_channels_and_every_rate_is_watched() {
    for (channels, rate_hz, frequency_hz) in
        [(3, 1000.0, 72.0), (4, 2000.0, 130.0), (5, 10_000.0, 684.0), (6, 51_200.0, 35.0)]
    {
        let (place, _daemon) = watching(rate_hz, channels);
        let mut sensor = Sensor::join(&place, rate_hz, channels);
        assert_eq!(sensor.status().watch(), Ok(WatchState::Learning));
        sensor.run(2.0, quiet);
        let learned = sensor.settled();
        assert_eq!(learned.watch(), Ok(WatchState::Watching), "{rate_hz} Hz: {}", learned.message);
        sensor.run(1.5, tone(frequency_hz, 4.0));
        let status = sensor.settled();
        let line = confirmed(&sensor.verdicts).expect("the tone is confirmed");
        assert!((line.frequency_hz - frequency_hz).abs() < 0.5, "{rate_hz} Hz: {line}");
        assert!((line.amplitude - 4.0).abs() < 0.5 && line.axis == 1, "{rate_hz} Hz: {line}");
        assert_eq!(status.verdict.event, line.event);
        assert!(status.message.as_str().contains("Hz on y"), "{}", status.message);
    }
}

#[test]
fn a_gap_is_counted_to_the_block_and_the_watch_continues() {
    let (place, _daemon) = watching(10_000.0, 3);
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    sensor.run(2.0, quiet);
    sensor.lose(7);
    sensor.run(0.3, quiet);
    let status = sensor.settled();
    assert_eq!((status.force_gaps, status.force_blocks), (7, sensor.sent));
    assert!(has(&status, SensorFault::Gaps), "{}", status.message);
    assert!(sensor.verdicts.is_empty(), "a gap is no line: {:?}", sensor.verdicts);
    sensor.run(2.0, tone(72.0, 4.0));
    let status = sensor.settled();
    assert!(!has(&status, SensorFault::Gaps), "over after a second: {}", status.message);
    assert!((confirmed(&sensor.verdicts).unwrap().frequency_hz - 72.0).abs() < 0.5);
}

#[test]
fn a_sender_that_restarts_is_no_gap() {
    let (place, _daemon) = watching(10_000.0, 3);
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    for _ in 0..2 {
        sensor.run(1.5, quiet);
        sensor.start_anew();
    }
    sensor.run(1.5, tone(72.0, 4.0));
    let status = sensor.settled();
    assert_eq!((status.force_gaps, status.force_refused), (0, 0));
    assert_eq!(status.force_faults().count(), 0, "{}", status.message);
    assert!((confirmed(&sensor.verdicts).unwrap().frequency_hz - 72.0).abs() < 0.5);
}

#[test]
fn blocks_that_come_twice_or_too_late_are_refused_and_change_nothing() {
    let (place, _daemon) = watching(10_000.0, 3);
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    sensor.run(2.0, quiet);
    let mut before = sensor.block.clone();
    for _ in 0..20 {
        sensor.run(0.05, tone(72.0, 4.0));
        sensor.send(&before);
        before = sensor.block.clone();
        sensor.send(&before);
    }
    let status = sensor.settled();
    assert_eq!((status.force_refused, status.force_gaps), (40, 0));
    assert!(has(&status, SensorFault::OutOfOrder), "{}", status.message);
    assert!((confirmed(&sensor.verdicts).unwrap().frequency_hz - 72.0).abs() < 0.5);
}

/// The verdicts on samples of that precision, sent through the client library.
fn said_of(cell: &Cell, single: bool) -> Vec<Verdict> {
    let mut source = ForceSource::connect_to(cell, LIMIT).unwrap();
    let mut monitor = Monitor::connect_to(cell, LIMIT).unwrap();
    let mut chance = TestRng::new(11);
    let start_ns = monotonic_ns();
    let mut verdicts = Vec::new();
    for k in 0..350_u64 {
        let t_s = |i: u64| (100 * k + i) as f64 * 1e-4;
        let sample = |i: u64| if i % 3 == 1 { 4.0 * (TAU * 72.0 * t_s(i / 3)).sin() } else { 0.0 };
        let samples: Vec<f64> = (0..300)
            .map(|i| chance.uniform() - 0.5 + if k > 200 { sample(i) } else { 0.0 })
            .collect();
        // Both runs begin with the same bits.
        let rounded: Vec<f32> = samples.iter().map(|x| *x as f32).collect();
        let samples = if single { Samples::F32(&rounded) } else { Samples::F64(&samples) };
        let (t_ns, rate_hz) = (start_ns + k * 10_000_000, 10_000.0);
        source
            .send(&ForceSamples { t_ns, rate_hz, channels: 3, frame: WrenchFrame::Tool, samples })
            .unwrap();
        let start = Instant::now();
        while k % 32 == 31 && monitor.status().is_none_or(|status| status.force_blocks < k) {
            assert!(start.elapsed() < LIMIT);
            std::thread::sleep(Duration::from_millis(1));
        }
        verdicts.extend(std::iter::from_fn(|| monitor.vibration()));
    }
    std::thread::sleep(Duration::from_millis(200));
    verdicts.extend(std::iter::from_fn(|| monitor.vibration()));
    assert_eq!(source.lost(), 0);
    verdicts
}

#[test]
fn single_and_double_precision_lead_to_the_same_verdicts() {
    let [single, double] = [true, false].map(|single| {
        let (place, _daemon) = watching(10_000.0, 3);
        said_of(&place.cell(), single)
    });
    assert!(confirmed(&double).is_some(), "{double:?}");
    assert_eq!(single.len(), double.len());
    for (a, b) in single.iter().zip(&double) {
        assert_eq!((a.state, a.class, a.axis, a.event), (b.state, b.class, b.axis, b.event));
        assert!((a.frequency_hz - b.frequency_hz).abs() < 1e-4, "{a} against {b}");
        assert!((a.amplitude - b.amplitude).abs() < 1e-4, "{a} against {b}");
    }
}

#[test]
fn a_tone_stands_in_the_spectrum_at_its_frequency_with_its_amplitude_once_somebody_reads() {
    let (place, _daemon) = watching(10_000.0, 3);
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    let mut reader = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon that is ready");
    sensor.run(1.0, quiet);
    let _ = sensor.settled();
    assert!(reader.spectrum().is_none(), "nothing is made for nobody");
    let begun = Instant::now();
    let mut spectra = Vec::new();
    while spectra.len() < 4 {
        assert!(begun.elapsed() < LIMIT, "{} spectra", spectra.len());
        sensor.run(0.1, tone(684.0, 8.0));
        spectra.extend(std::iter::from_fn(|| reader.spectrum()));
    }
    assert_eq!(spectra[0].seq, 1, "none was made before");
    let newest = &spectra[3];
    let all = newest.amplitudes_n().iter().enumerate();
    let (bin, &largest) = all.max_by(|a, b| a.1.total_cmp(b.1)).expect("bins");
    assert!((newest.frequency_hz(bin) - 684.0).abs() <= 0.5 * newest.bin_hz, "{bin}");
    assert!((largest / 8.0 - 1.0).abs() < 0.03, "{largest} N");
    let is_distant = |bin: &usize| (newest.frequency_hz(*bin) - 684.0).abs() > 20.0;
    let rest = (0..newest.bins as usize).filter(is_distant).map(|bin| newest.amplitude_n[bin]);
    assert!(rest.fold(0.0, f64::max) < 0.3, "noise of 0.6 N rms over all bins");
    let pauses_ns = spectra.windows(2).map(|pair| pair[1].made_ns - pair[0].made_ns);
    assert!(pauses_ns.min() > Some(99_000_000), "ten a second at most");
    assert!(spectra.windows(2).all(|pair| pair[1].t_ns > pair[0].t_ns));
}

/// Verdicts on a line, and what became of the blocks; with a reader of spectra that never reads, or without.
fn verdicts(stalled_reader: bool) -> Vec<(u32, u32, u64, u64)> {
    let (place, _daemon) = watching(10_000.0, 3);
    let mut reader = Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon that is ready");
    if stalled_reader {
        assert!(reader.spectrum().is_none(), "it only joins");
    }
    let mut sensor = Sensor::join(&place, 10_000.0, 3);
    sensor.run(2.0, quiet);
    // Long enough for more spectra than the reader's buffer holds.
    for _ in 0..40 {
        std::thread::sleep(Duration::from_millis(20));
        sensor.run(0.01, quiet);
    }
    sensor.run(1.0, tone(72.0, 4.0));
    let status = sensor.settled();
    assert_eq!((status.force_blocks, status.force_gaps, status.force_refused), (sensor.sent, 0, 0));
    assert!(confirmed(&sensor.verdicts).is_some());
    let of = |v: &Verdict| (v.state, v.class, v.frequency_hz.to_bits(), v.amplitude.to_bits());
    sensor.verdicts.iter().map(of).collect()
}

#[test]
fn a_reader_of_spectra_that_never_reads_changes_no_verdict_and_costs_no_block() {
    assert_eq!(verdicts(true), verdicts(false));
}
