//! Process state from the cell and its commands: the monitor uses it for classes and advice.

use crate::TRUED;
use shm_schema::{Advice, Status, Verdict, VibrationClass, VibrationState};
use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;
use tests::cell_loop::JOINTS;
use tests::place::TestDirectory;
use tests::process::Process;
use tests::sensor::{ANY_CLOCK, Sensor};
use trued_client::{Answer, Client, InCut, ProcessState, Setpoint};

const LIMIT: Duration = Duration::from_secs(20);
const RATE_HZ: f64 = 2000.0;
/// Motor turns per turn of joint 1, by its teeth 10:131 and 13:129.
const RATIO: f64 = 131.0 / 10.0 * 129.0 / 13.0;
/// Distance of the TCP from the axis of joint 1 in the pose below, mm: flange centre of the preset.
const RADIUS_MM: f64 = 815.0;

fn watching(tables: &str) -> (TestDirectory, Process, Sensor) {
    let force =
        format!("[force]\nrate_Hz = {RATE_HZ}\nchannels = 3\n{ANY_CLOCK}[vibration]\n{tables}");
    let place = TestDirectory::new("shadow", &force);
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let sensor = Sensor::join(&place, RATE_HZ, 3);
    (place, daemon, sensor)
}

fn quiet(_: u32, _: f64) -> f64 {
    0.0
}

/// A tone on y.
fn tone(frequency_hz: f64) -> impl Fn(u32, f64) -> f64 {
    move |channel, t_s| if channel == 1 { 4.0 * (TAU * frequency_hz * t_s).sin() } else { 0.0 }
}

fn cutting(spindle_rpm: f64, holds_for: Option<Duration>) -> ProcessState {
    let in_cut = Some(true);
    ProcessState { spindle_rpm, teeth: 2, in_cut, holds_for, ..ProcessState::default() }
}

fn tell(sensor: &mut Sensor, process: &ProcessState) {
    let answer = sensor.monitor.process_state(process, LIMIT).unwrap();
    assert_eq!(answer.answer(), Ok(Answer::Done), "{}", answer.message);
    let in_cut = InCut::Cut.code();
    sensor.wait("the process", |status| status.in_cut == in_cut);
}

fn confirmed(verdicts: &[Verdict], near_hz: f64) -> Verdict {
    let fits = |v: &&Verdict| {
        v.state() == Ok(VibrationState::Confirmed) && (v.frequency_hz - near_hz).abs() < 1.0
    };
    let found = verdicts.iter().rfind(fits).copied();
    assert!(found.is_some(), "{near_hz} Hz is not confirmed: {verdicts:?}");
    found.unwrap()
}

#[test]
fn what_would_help_stands_in_verdict_status_and_log() {
    for (rpm, frequency_hz, advice, part) in [
        (28_000.0, 72.0, Advice::ChangeCut, "not affected by spindle speed"),
        (2400.0, 72.0, Advice::StabilityPocket, ": change to 2160 rev/min, stability lobe 1"),
        (2160.0, 72.0, Advice::MoveOffMode, "to move the tooth frequency away from the modes"),
        (28_000.0, 66.67, Advice::SampleFaster, "may be an aliased harmonic of the spindle speed"),
    ] {
        let (_place, daemon, mut sensor) = watching("");
        tell(&mut sensor, &cutting(rpm, None));
        assert_eq!(sensor.status().spindle_rpm, rpm);
        sensor.run(2.0, quiet);
        sensor.run(2.0, tone(frequency_hz));
        let status = sensor.settled();
        let line = confirmed(&sensor.verdicts, frequency_hz);
        assert_eq!(Advice::try_from(line.advice), Ok(advice), "{line}");
        assert_eq!(status.verdict.advice, line.advice);
        for text in [status.message.to_string(), line.to_string()] {
            assert!(text.contains(part) && text.contains("confirmed"), "{part}: {text}");
        }
        assert!(daemon.wait_for_output("WARN alarm ", LIMIT), "{:#?}", daemon.lines());
        assert!(daemon.wait_for_output(part, LIMIT), "{:#?}", daemon.lines());
        sensor.run(1.5, quiet);
        let status = sensor.settled();
        assert_eq!(status.verdict.state(), Ok(VibrationState::Over));
        assert!(!status.message.as_str().contains(part), "{}", status.message);
        assert!(daemon.wait_for_output("INFO over ", LIMIT), "{:#?}", daemon.lines());
    }
}

#[test]
fn a_report_with_a_time_limit_expires() {
    let (_place, daemon, mut sensor) = watching("spindle_rpm = 6000.0\nteeth = 3\n");
    assert_eq!(sensor.status().spindle_rpm, 6000.0, "as configured");
    tell(&mut sensor, &cutting(28_000.0, Some(Duration::from_millis(300))));
    assert!(daemon.wait_for_output("the reported process state has expired", LIMIT));
    let status = sensor.status();
    assert_eq!((status.spindle_rpm, status.in_cut), (6000.0, InCut::Unknown.code()));
    let wrong = ProcessState { spindle_rpm: -5.0, ..ProcessState::default() };
    let answer = sensor.monitor.process_state(&wrong, LIMIT).unwrap();
    assert_eq!(answer.answer(), Ok(Answer::Refused), "{}", answer.message);
}

/// Turns joint 1 to and fro between its limits, commanded at 1 kHz, at the speed in `speed` (rad/s, as bits).
fn turn(mut client: Client, speed: &AtomicU64, over: &AtomicBool) {
    let (mut q, mut sense) = ([0.0; JOINTS], 1.0);
    q[0] = -3.0;
    let mut before_ns = trued_client::monotonic_ns();
    while !over.load(Relaxed) {
        std::thread::sleep(Duration::from_millis(1));
        let now_ns = trued_client::monotonic_ns();
        let dt_s = (now_ns - before_ns) as f64 * 1e-9;
        before_ns = now_ns;
        q[0] += sense * f64::from_bits(speed.load(Relaxed)) * dt_s;
        if q[0].abs() > 3.0 {
            (q[0], sense) = (3.0 * q[0].signum(), -q[0].signum());
        }
        let _ = client.send(&Setpoint::new(&q).at_ns(now_ns));
    }
}

#[test]
fn a_line_that_turns_with_a_wheel_at_two_feeds_is_named_with_its_joint_and_shaft() {
    let (place, daemon, mut sensor) = watching("");
    let client = Client::connect_to(&place.cell(), LIMIT).unwrap();
    let over = Arc::new(AtomicBool::new(false));
    let speed = Arc::new(AtomicU64::new(0));
    let runner = {
        let (speed, over) = (Arc::clone(&speed), Arc::clone(&over));
        std::thread::spawn(move || turn(client, &speed, &over))
    };
    tell(&mut sensor, &cutting(28_000.0, None));
    sensor.run(2.0, quiet);
    // Neither is near a mode of the robot.
    let mut last = Verdict::default();
    for wheel_hz in [25.0, 29.5] {
        let joint_rad_s = TAU * wheel_hz / RATIO;
        speed.store(joint_rad_s.to_bits(), Relaxed);
        let feed_mm_s = joint_rad_s * RADIUS_MM;
        let moves = |status: &Status| (status.feed_mm_s / feed_mm_s - 1.0).abs() < 0.01;
        sensor.wait("the feed", moves);
        sensor.run(2.5, tone(wheel_hz));
        last = sensor.settled().verdict;
        for verdict in [last, confirmed(&sensor.verdicts, wheel_hz)] {
            assert_eq!(verdict.class(), Ok(VibrationClass::Gear), "{verdict}");
            assert_eq!((verdict.gear_joint, verdict.gear_shaft), (1, 1), "{verdict}");
            assert_eq!(verdict.advice, Advice::CheckGear.code());
        }
    }
    assert!((last.frequency_hz - 29.5).abs() < 0.2, "{last}");
    assert_eq!(last.rivals, 0, "it followed the feed: {last}");
    assert!(daemon.wait_for_output("gear shaft 1 of joint 1", LIMIT), "{:#?}", daemon.lines());
    over.store(true, Relaxed);
    runner.join().unwrap();
    let status = sensor.wait("the end of the feed", |status| status.feed_mm_s.is_nan());
    assert_eq!(status.spindle_rpm, 28_000.0, "what was told holds");
}
