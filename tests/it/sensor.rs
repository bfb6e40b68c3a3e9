//! A failing force sensor: every fault is reported in the status and in the log, with its remedy;
//! healthy channels are still monitored.

use crate::TRUED;
use shm_schema::{ForceBlock, Health, SensorFault, Status, VibrationState, WatchState};
use std::f64::consts::TAU;
use std::time::Duration;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::sensor::{ANY_CLOCK, Sensor};

const LIMIT: Duration = Duration::from_secs(20);
const RATE_HZ: f64 = 10_000.0;
/// The channel that fails.
const Z: usize = 2;
const FULL_SCALE_N: f64 = 50.0;

/// A fault, its message, and its cause.
type Case = (SensorFault, &'static str, fn(&mut ForceBlock));

fn daemon(tables: &str) -> (TestDirectory, Process) {
    let place = TestDirectory::new("shadow", tables);
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    (place, daemon)
}

fn watching() -> (TestDirectory, Process, Sensor) {
    let tables = format!(
        "[force]\nrate_Hz = {RATE_HZ}\nchannels = 3\nfull_scale_N = {FULL_SCALE_N}\n\
         {ANY_CLOCK}[vibration]\nenabled = true\n"
    );
    let (place, daemon) = daemon(&tables);
    let sensor = Sensor::join(&place, RATE_HZ, 3);
    (place, daemon, sensor)
}

fn quiet(_: u32, _: f64) -> f64 {
    0.0
}

/// A tone on y.
fn tone(channel: u32, t_s: f64) -> f64 {
    if channel == 1 { 4.0 * (TAU * 72.0 * t_s).sin() } else { 0.0 }
}

/// Changes the failing channel's samples.
fn on_z(block: &mut ForceBlock, bad: impl Fn(usize, f64) -> f64) {
    let samples = block.samples as usize;
    for (s, value) in block.data[Z * samples..(Z + 1) * samples].iter_mut().enumerate() {
        *value = bad(s, *value);
    }
}

/// The status reports the fault of the channel (`None`: of the stream), as bits and as text.
fn names(status: &Status, channel: Option<usize>, fault: SensorFault, text: &str) {
    let set = channel.map_or(status.stream_faults, |channel| status.channel_faults[channel]);
    assert_ne!(set & fault.bit(), 0, "{fault}: {}", status.message);
    assert!(status.message.as_str().contains(text), "{text}: {}", status.message);
    assert_eq!(status.health(), Ok(Health::Degraded), "{}", status.message);
}

fn is_good(status: &Status) -> bool {
    status.force_faults().next().is_none() && !status.message.as_str().contains("force")
}

#[test]
fn a_channel_that_fails_is_named_while_the_others_are_watched_on() {
    let faults: [Case; 5] = [
        (
            SensorFault::NotFinite,
            "force channel z contains NaN or infinite samples: check",
            |block| {
                on_z(block, |s, x| if s % 50 == 0 { f64::NAN } else { x });
            },
        ),
        (
            SensorFault::NotFinite,
            "force channel z contains NaN or infinite samples: check",
            |block| {
                on_z(block, |_, _| f64::INFINITY);
            },
        ),
        (SensorFault::Stuck, "force channel z is stuck: check the sensor", |block| {
            on_z(block, |_, _| 3.25);
        }),
        (SensorFault::Saturated, "force channel z is saturated: choose a larger range", |block| {
            on_z(block, |_, x| if x > 1.3 { FULL_SCALE_N } else { x });
        }),
        (SensorFault::Dead, "force channel z is dead: check cable and amplifier", |block| {
            on_z(block, |_, _| 0.0);
        }),
    ];
    let (_place, daemon, mut sensor) = watching();
    sensor.run(2.0, quiet);
    assert!(is_good(&sensor.settled()));
    for (fault, message, broken) in faults {
        sensor.verdicts.clear();
        sensor.run_broken(1.2, quiet, broken);
        sensor.run_broken(1.2, tone, broken);
        names(&sensor.settled(), Some(Z), fault, message);
        assert!(daemon.wait_for_output(&format!("WARN {message}"), LIMIT), "{:#?}", daemon.lines());
        let alarm =
            |v: &&shm_schema::Verdict| v.state() == Ok(VibrationState::Alarm) && v.axis == 1;
        assert!(sensor.verdicts.iter().any(|v| alarm(&v)), "{fault}: {:?}", sensor.verdicts);
        // The line fades, the channel is clean for a second, and its noise is learned again.
        sensor.run(4.0, quiet);
        let status = sensor.settled();
        assert!(is_good(&status), "after {fault}: {}", status.message);
        assert!(
            daemon.wait_for_output(&format!("cleared: {message}"), LIMIT),
            "{:#?}",
            daemon.lines()
        );
        let on_z = sensor.verdicts.iter().filter(|v| v.axis as usize == Z).count();
        assert_eq!(on_z, 0, "no line where the channel failed: {:?}", sensor.verdicts);
    }
}

#[test]
fn a_channel_that_recovers_is_learned_again_without_an_alarm() {
    let (_place, _daemon, mut sensor) = watching();
    sensor.run_broken(3.0, quiet, |block| on_z(block, |_, _| 0.0));
    assert_eq!(sensor.settled().watch(), Ok(WatchState::Watching), "the others are known");
    // So loud that its noise would be full of lines against a floor of zero.
    let loud = |block: &mut ForceBlock| on_z(block, |_, x| 20.0 * x);
    sensor.run_broken(1.2, quiet, loud);
    assert_eq!(sensor.settled().watch(), Ok(WatchState::Learning), "its noise");
    sensor.run_broken(0.5, tone, loud);
    sensor.settled();
    assert!(
        sensor.verdicts.iter().any(|v| v.axis == 1),
        "the others do not wait: {:?}",
        sensor.verdicts
    );
    sensor.run_broken(4.0, quiet, loud);
    let status = sensor.settled();
    assert!(is_good(&status) && status.watch() == Ok(WatchState::Watching), "{}", status.message);
    assert!(sensor.verdicts.iter().all(|v| v.axis == 1), "{:?}", sensor.verdicts);
    let on_z = |channel: u32, t_s: f64| 2.0 * tone(channel.wrapping_sub(1), t_s);
    sensor.run_broken(1.5, on_z, loud);
    sensor.settled();
    assert!(sensor.verdicts.iter().any(|v| v.axis as usize == Z), "its own lines are seen again");
}

#[test]
fn a_stream_that_fails_is_named() {
    let faults: [Case; 5] = [
        (SensorFault::WrongRate, "force stream has a different rate than configured", |block| {
            block.rate_hz = 8000.0;
        }),
        (SensorFault::WrongRate, "force stream has a different rate than configured", |block| {
            block.rate_hz = f64::NAN;
        }),
        (SensorFault::WrongShape, "force stream has different channels than configured", |block| {
            block.channels = 6;
        }),
        (SensorFault::WrongShape, "force stream has different channels than configured", |block| {
            block.channels = u32::MAX;
        }),
        (SensorFault::Gaps, "force stream has gaps: check the sender", |block| {
            block.samples_before *= 2;
        }),
    ];
    let (_place, daemon, mut sensor) = watching();
    sensor.run(2.0, quiet);
    for (fault, message, broken) in faults {
        assert!(is_good(&sensor.settled()), "before {fault}");
        sensor.run_broken(0.5, quiet, broken);
        names(&sensor.settled(), None, fault, message);
        assert!(daemon.wait_for_output(&format!("WARN {message}"), LIMIT), "{:#?}", daemon.lines());
        sensor.run(2.5, quiet);
    }
    assert!(is_good(&sensor.settled()));
}

#[test]
fn a_sender_that_samples_slower_than_it_says_is_named() {
    let (_place, _daemon, mut sensor) = watching();
    let mut late_ns = 0;
    sensor.run_broken(3.5, quiet, |block| {
        late_ns += 400_000;
        block.t_ns += late_ns;
    });
    names(&sensor.settled(), None, SensorFault::WrongRate, "force stream has a different rate");
}

#[test]
fn silence_is_named_from_the_first_second_on_and_ends_with_the_first_block() {
    let (_place, daemon, mut sensor) = watching();
    let silent = |status: &Status| status.stream_faults & SensorFault::Silent.bit() != 0;
    let status = sensor.wait("silence at the start", silent);
    names(&status, None, SensorFault::Silent, "force stream delivers no data: start the sender");
    assert_eq!(status.watch(), Ok(WatchState::Learning));
    assert!(status.message.as_str().contains("is learning the noise floor"), "{}", status.message);
    sensor.run(3.0, tone);
    let status = sensor.settled();
    assert!(
        !silent(&status) && !status.message.as_str().contains("learning"),
        "{}",
        status.message
    );
    assert_eq!(status.verdict.state(), Ok(VibrationState::Confirmed));
    let status = sensor.wait("silence in between", silent);
    assert_eq!(status.verdict.state(), Ok(VibrationState::Over), "what rang then is not known now");
    assert!(
        daemon.wait_for_output("cleared: force stream delivers no data", LIMIT),
        "{:#?}",
        daemon.lines()
    );
}

#[test]
fn without_a_watch_the_sensor_is_looked_after_all_the_same() {
    let (place, _daemon) =
        daemon(&format!("[force]\nrate_Hz = 10000.0\nchannels = 3\n{ANY_CLOCK}"));
    let mut sensor = Sensor::join(&place, RATE_HZ, 3);
    sensor.run(1.0, quiet);
    assert_eq!(sensor.settled().watch(), Ok(WatchState::Off));
    sensor.run_broken(1.0, quiet, |block| on_z(block, |_, _| f64::NAN));
    let message = "force channel z contains NaN or infinite samples";
    names(&sensor.settled(), Some(Z), SensorFault::NotFinite, message);
    sensor.lose(3);
    sensor.run(0.1, quiet);
    assert_eq!(sensor.settled().force_gaps, 3);
}

#[test]
fn a_cell_without_a_force_stream_says_nothing_of_it() {
    let (place, _daemon) = daemon("");
    let mut sensor = Sensor::join(&place, RATE_HZ, 3);
    std::thread::sleep(Duration::from_millis(1500));
    let status = sensor.status();
    assert!(is_good(&status) && status.watch() == Ok(WatchState::Off), "{}", status.message);
}
