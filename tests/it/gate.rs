//! Invalid wrenches do not reach the correction: blocks with another clock, channels that fail.
//! Temperatures expire.

use crate::TRUED;
use shm_schema::{ForceBlock, Health, SensorFault, Status, WrenchGate, monotonic_ns};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tests::cell_loop::{CellLoop, MIDDLE};
use tests::place::TestDirectory;
use tests::process::Process;
use tests::sensor::Sensor;
use trued_client::{Client, Setpoint};

const LIMIT: Duration = Duration::from_secs(20);
const RATE_HZ: f64 = 1000.0;
const FULL_SCALE_N: f64 = 50.0;
/// The channel that fails.
const Z: usize = 2;
const HOUR_NS: u64 = 3_600_000_000_000;
/// The length of a block, ns.
const BLOCK_NS: u64 = 10_000_000;
/// How far a stamp may lie ahead, as the cells below have it, ns.
const AHEAD_NS: u64 = 5_000_000;

/// How old a wrench may be, by default, ns.
const STALE_NS: u64 = 100_000_000;

/// A change of the samples of a block.
type Change = fn(&mut ForceBlock);

/// A moving robot with a force sensor that sends at its own rate.
struct Bench {
    _place: TestDirectory,
    daemon: Process,
    sensor: Sensor,
    /// When the next block is complete, at the sensor's own rate.
    due_ns: u64,
    over: Arc<AtomicBool>,
    cell: Option<JoinHandle<Vec<String>>>,
}

impl Bench {
    fn new(wrench: &str) -> Self {
        let place = TestDirectory::new(
            "full",
            &format!(
                "[cycle]\nstale_ms = 500.0\n[wrench]\nsource = \"force\"\nframe = \"base\"\n\
                 process_stiffness_N_per_um = 0.02\n{wrench}\
                 [force]\nrate_Hz = {RATE_HZ}\nchannels = 3\nfull_scale_N = {FULL_SCALE_N}\nahead_ms = 5.0\n"
            ),
        );
        let daemon = Process::daemon(TRUED, &place);
        assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
        let sensor = Sensor::join(&place, RATE_HZ, 3);
        let over = Arc::new(AtomicBool::new(false));
        let (end, shared_cell) = (Arc::clone(&over), place.cell());
        let cell = std::thread::spawn(move || {
            let mut cell = CellLoop::join(&shared_cell, LIMIT).unwrap();
            while !end.load(Relaxed) {
                cell.tick();
            }
            cell.broken
        });
        Self { _place: place, daemon, sensor, due_ns: monotonic_ns(), over, cell: Some(cell) }
    }

    /// Sends a block every 10 ms, changed by `change`, until the status is as wanted.
    fn until(&mut self, what: &str, change: Change, wanted: impl Fn(&Status) -> bool) -> Status {
        let start = Instant::now();
        loop {
            self.due_ns += BLOCK_NS;
            let early_ns = self.due_ns.saturating_sub(monotonic_ns());
            std::thread::sleep(Duration::from_nanos(early_ns));
            let first_ns = self.due_ns - BLOCK_NS;
            let stamp = |block: &mut ForceBlock| {
                (block.t_ns, block.sent_ns) = (first_ns, monotonic_ns());
                change(block);
            };
            self.sensor.run_broken(0.01, |_, _| 0.0, stamp);
            let status = self.sensor.monitor.status().filter(&wanted);
            if let Some(status) = status {
                return status;
            }
            let last = self.sensor.monitor.status();
            assert!(start.elapsed() < LIMIT, "{what} did not come: {last:?}");
        }
    }

    /// The fault closes the gate, is named, and ends when the cause ends.
    fn strike(&mut self, change: Change, fault: SensorFault, channel: Option<usize>, text: &str) {
        let is_open = |status: &Status| status.wrench_gate == WrenchGate::Open.code();
        self.until("an open gate", |_| {}, is_open);
        let status = self.until("a closed gate", change, |status| {
            let set =
                channel.map_or(status.stream_faults, |channel| status.channel_faults[channel]);
            status.wrench_gate == WrenchGate::SensorFault.code() && set & fault.bit() != 0
        });
        assert!(status.message.as_str().contains(text), "{}", status.message);
        assert_eq!(status.health(), Ok(Health::Degraded));
        self.until(
            "an open gate again",
            |_| {},
            |status| is_open(status) && status.force_faults().next().is_none(),
        );
        assert!(
            self.daemon.wait_for_output(&format!("WARN {text}"), LIMIT),
            "{:#?}",
            self.daemon.lines()
        );
        assert!(
            self.daemon.wait_for_output(&format!("cleared: {text}"), LIMIT),
            "{:#?}",
            self.daemon.lines()
        );
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
        let broken = self.cell.take().and_then(|cell| cell.join().ok()).unwrap_or_default();
        assert!(broken.is_empty() || std::thread::panicking(), "{broken:?}");
    }
}

/// A channel with constant values.
fn stuck(block: &mut ForceBlock) {
    let samples = block.samples as usize;
    block.data[Z * samples..(Z + 1) * samples].fill(3.25);
}

#[test]
fn forces_from_the_future_close_the_gate_and_are_named() {
    let mut bench = Bench::new("");
    let message = "force stream has timestamps in the future";
    bench.strike(|block| block.t_ns += HOUR_NS, SensorFault::InFuture, None, message);
    let a_little = |block: &mut ForceBlock| block.t_ns = monotonic_ns() + 10 * AHEAD_NS;
    bench.strike(a_little, SensorFault::InFuture, None, message);
}

#[test]
fn a_stamp_within_the_tolerance_is_none_from_the_future() {
    let mut bench = Bench::new("");
    let ahead = |block: &mut ForceBlock| block.t_ns = monotonic_ns() + AHEAD_NS / 2;
    let is_open = |status: &Status| status.wrench_gate == WrenchGate::Open.code();
    let status = bench.until("an open gate", ahead, is_open);
    assert_eq!(status.force_faults().count(), 0, "{}", status.message);
}

#[test]
fn forces_by_a_clock_that_is_behind_close_the_gate_and_are_named() {
    let message = "force stream has timestamps long before arrival";
    let mut bench = Bench::new("");
    let behind: Change = |block| block.t_ns = block.t_ns.saturating_sub(HOUR_NS);
    bench.strike(behind, SensorFault::Late, None, message);
    // Just too old to be used.
    let a_little: Change = |block| block.t_ns -= 2 * STALE_NS;
    bench.strike(a_little, SensorFault::Late, None, message);
}

#[test]
fn a_channel_that_is_stuck_or_saturated_closes_the_gate() {
    let mut bench = Bench::new("");
    bench.strike(stuck, SensorFault::Stuck, Some(Z), "force channel z is stuck: check the sensor");
    let at_full_scale =
        |block: &mut ForceBlock| block.data[Z * block.samples as usize] = FULL_SCALE_N;
    let message = "force channel z is saturated: choose a larger range";
    bench.strike(at_full_scale, SensorFault::Saturated, Some(Z), message);
}

#[test]
fn a_cell_may_go_on_with_a_channel_that_is_stuck() {
    let mut bench = Bench::new("use_faulty_channels = true\n");
    let open = |status: &Status| status.wrench_gate == WrenchGate::Open.code();
    bench.until("an open gate", |_| {}, open);
    let is_told = |status: &Status| status.channel_faults[Z] & SensorFault::Stuck.bit() != 0;
    bench.until("a stuck channel", stuck, is_told);
    let since = Instant::now();
    // Still so half a second later: the gate fades in that time.
    let status = bench.until("half a second", stuck, |_| since.elapsed().as_millis() > 500);
    assert!(open(&status) && is_told(&status), "{}", status.message);
}

/// Cycles at 1 ms for that long with the additions of `setpoint` to each command; returns the
/// largest step of a correction between two answers, rad.
fn drive(client: &mut Client, time: Duration, setpoint: fn(Setpoint) -> Setpoint) -> f64 {
    let (start, mut last, mut step) = (Instant::now(), None, 0.0_f64);
    while start.elapsed() < time {
        let now_ns = monotonic_ns();
        let sent = client.send(&setpoint(Setpoint::new(&MIDDLE).at_ns(now_ns)));
        if let Some(answer) = sent.ok().and_then(|seq| client.wait_corrected(seq, LIMIT))
            && let Some(before) = last.replace(answer.correction)
        {
            let moved = answer.correction.iter().zip(before).map(|(a, b)| (a - b).abs());
            step = step.max(moved.fold(0.0, f64::max));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    step
}

#[test]
fn temperatures_hold_for_their_time_and_are_then_named_stale_without_a_step() {
    let place =
        TestDirectory::new("full", "[cycle]\nstale_ms = 500.0\n[temperature]\nstale_s = 1.0\n");
    let model = std::fs::read_to_string(place.file("model.toml")).unwrap();
    let warm = "\n[[effect]]\nkind = \"thermal_growth\"\njoint = 2\ngrowth_um_per_K = 20.0\n";
    place.write("model.toml", &format!("{model}{warm}"));
    let daemon = Process::daemon(TRUED, &place);
    assert!(daemon.wait_for_output("ready", LIMIT), "{:?}", daemon.lines());
    let mut client = Client::connect_to(&place.cell(), LIMIT).unwrap();
    let second = Duration::from_secs(1);
    drive(&mut client, 3 * second, |setpoint| setpoint.temperatures(60.0, &[]));
    let wanted = |client: &mut Client| client.newest().unwrap().wanted;
    let warm = wanted(&mut client);
    // The last value is kept.
    drive(&mut client, second / 2, |setpoint| setpoint);
    assert_eq!(client.status().unwrap().stale_temperatures, 0);
    let apart = |a: [f64; 16], b: [f64; 16]| {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(apart(wanted(&mut client), warm) < 1e-5);
    let step = drive(&mut client, 2 * second, |setpoint| setpoint);
    let status = client.status().unwrap();
    assert_eq!(status.stale_temperatures, 1, "{}", status.message);
    assert_eq!(status.health(), Ok(Health::Degraded));
    let message = "temperatures are stale and treated as unknown: ambient";
    assert!(status.message.as_str().contains(message), "{}", status.message);
    assert!(daemon.wait_for_output(&format!("WARN {message}"), LIMIT), "{:#?}", daemon.lines());
    let changed = apart(wanted(&mut client), warm);
    assert!(changed > 1e-4, "the growth is no longer corrected: {changed}");
    assert!(step < 0.5 * changed, "ramped: {step} of {changed}");
    drive(&mut client, second, |setpoint| setpoint.temperatures(60.0, &[]));
    assert_eq!(client.status().unwrap().stale_temperatures, 0);
    assert!(daemon.wait_for_output("temperatures are no longer stale: ambient", LIMIT));
}
