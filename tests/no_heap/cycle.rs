//! The daemon's own cycle and its vibration thread, over real shared memory.

use crate::heap_of;
use allocation_counter::AllocationInfo;
use corrector::{Corrector, Mode, Settings};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::pacer::{Pacer, WaitMode};
use daemon::process::MonitorInputs;
use daemon::robot::Robot;
use daemon::sensor_inputs::{SensorInputs, WrenchSource};
use daemon::vibration::{ForceProcessor, VibrationThread};
use envelope::Limits;
use recording::model::presets::preset;
use shm_schema::{
    Command, Corrected, DaemonPorts, DaemonSide, ForceBlock, JOINTS_MAX, JoinedEpoch, Role,
    RoleClaim, SPECTRUM_BINS_MAX, Spectrum, Verdict, monotonic_ns,
};
use spectrum::{
    DisplaySpectrum, GEAR_FREQUENCIES_MAX, GearFrequency, MODES_MAX, MonitorConfig, ProcessState,
    VibrationMonitor,
};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;
use tests::cell_loop::{JOINTS, path};
use tests::place::{MODEL, TestDirectory};

const WARM_UP: u64 = 50;
const MESSAGES: u64 = 2_000;
/// Force blocks of 10 ms; it rings once while the ports warm up, and once more when all is counted.
const BLOCKS: u64 = 1_000;
const WARM_UP_BLOCKS: u64 = 450;
/// Blocks among which some are broken.
const SPOILED: Range<u64> = 480..560;

fn cycle(ports: &DaemonPorts) -> Cycle {
    let limits = Limits::new(0.02, 0.05, 5.0).unwrap();
    let settings = Settings { stale_ns: 3_000_000, ..Settings::with_envelope(limits) };
    let physics = preset(MODEL).unwrap().model().unwrap().physics;
    Cycle {
        robot: Robot::join(ports, Pacer::new(WaitMode::Sleep, settings.period_ns)).unwrap(),
        corrector: Corrector::new(settings),
        model: Box::new(LoadedModel::new(physics, 1)),
        sensor_inputs: SensorInputs::new(WrenchSource::Force),
        stale_ns: settings.stale_ns,
        period_ns: settings.period_ns,
        lockstep: false,
    }
}

fn command(seq: u64, session: u64) -> Command {
    let now_ns = monotonic_ns();
    let mut q = [0.0; JOINTS_MAX];
    q[..JOINTS].copy_from_slice(&path(now_ns));
    if seq % 50 == 49 {
        q[0] = f64::NAN;
    }
    let (t_ns, sent_ns, joints) = (now_ns, now_ns, JOINTS as u32);
    Command { seq, session, t_ns, sent_ns, joints, q, ..Command::default() }
}

/// Commands until that many targets were published, then stops the cycle.
fn feed(cell: &mut CellEnd, exchange: &Exchange, targets: u64) {
    while exchange.counters.cycles.load(Relaxed) < targets {
        cell.seq += 1;
        // Now and then a silence.
        let pause = if cell.seq.is_multiple_of(200) { 20_000 } else { 200 };
        cell.commands.send(&command(cell.seq, 1));
        std::thread::sleep(Duration::from_micros(pause));
        cell.answers.take_newest();
    }
    exchange.stop();
}

struct CellEnd {
    commands: shm_schema::PeerPublisher<Command>,
    answers: shm_schema::PeerSubscriber<Corrected>,
    seq: u64,
}

fn joined(place: &TestDirectory, role: Role) -> (RoleClaim, JoinedEpoch) {
    let mut seat = RoleClaim::new(&place.cell(), role);
    let joined = seat.join().unwrap();
    (seat, joined)
}

/// Runs `first` and `then` in one thread, the second one counted.
fn counted<T>(
    subject: &mut T,
    first: impl FnOnce(&mut T),
    then: impl FnOnce(&mut T),
) -> AllocationInfo {
    first(subject);
    heap_of(|| then(subject))
}

#[test]
fn the_cycle_takes_one_block_per_published_target_and_gives_it_back() {
    let place = TestDirectory::new("full", "");
    let domain = DaemonSide::create(&place.cell()).unwrap();
    let ports = domain.ports();
    let [warm, exchange] = [0, 1].map(|_| Exchange::new(Mode::Full, true));
    let made = AtomicBool::new(false);
    let heap = std::thread::scope(|scope| {
        let subject = scope.spawn(|| {
            let mut cycle = cycle(&ports);
            made.store(true, Relaxed);
            counted(&mut cycle, |cycle| cycle.run(&warm), |cycle| cycle.run(&exchange))
        });
        while !made.load(Relaxed) {
            std::thread::sleep(Duration::from_millis(1));
        }
        domain.announce().unwrap();
        let (_seat, joined) = joined(&place, Role::Cell);
        let (commands, answers) = (joined.publisher().unwrap(), joined.subscriber().unwrap());
        let mut cell = CellEnd { commands, answers, seq: 0 };
        feed(&mut cell, &warm, WARM_UP);
        feed(&mut cell, &exchange, MESSAGES);
        subject.join().unwrap()
    });
    let counters = &exchange.counters;
    let [published, rejected, stale] = [&counters.cycles, &counters.rejected, &counters.stale]
        .map(|counter| counter.load(Relaxed));
    assert!(rejected > 0 && stale > 0, "through all of its states: {rejected}, {stale}");
    assert_eq!(heap.count_total, published, "one block per target: {heap:?}");
    assert_eq!((heap.count_current, heap.bytes_current), (0, 0), "each given back: {heap:?}");
    assert_eq!(heap.count_max, 1, "never two at once: {heap:?}");
}

#[test]
fn the_vibration_thread_takes_one_block_per_verdict_and_spectrum_and_gives_it_back() {
    let place = TestDirectory::new("full", "");
    let domain = DaemonSide::create(&place.cell()).unwrap();
    let ports = domain.ports();
    let [warm, exchange] = [0, 1].map(|_| Exchange::new(Mode::Full, false));
    let made = AtomicBool::new(false);
    let spectra = AtomicU64::new(0);
    let heap = std::thread::scope(|scope| {
        let subject = scope.spawn(|| {
            let config =
                MonitorConfig { rate_hz: 10_000.0, channels: 3, ..MonitorConfig::default() };
            let overview = Some(Box::new(DisplaySpectrum::new(&config, SPECTRUM_BINS_MAX)));
            let force_processor =
                ForceProcessor::Watch(Box::new(VibrationMonitor::new(config).unwrap()));
            let mut vibration_thread =
                VibrationThread::join(&ports, force_processor, overview).unwrap();
            made.store(true, Relaxed);
            let first = |thread: &mut VibrationThread| {
                thread.run(&warm);
                spectra.store(thread.spectra_sent(), Relaxed);
            };
            let then = |thread: &mut VibrationThread| {
                thread.run(&exchange);
                spectra.store(thread.spectra_sent() - spectra.load(Relaxed), Relaxed);
            };
            counted(&mut vibration_thread, first, then)
        });
        while !made.load(Relaxed) {
            std::thread::sleep(Duration::from_millis(1));
        }
        domain.announce().unwrap();
        let (_seats, [force, monitor]) = {
            let (a, force) = joined(&place, Role::Force);
            let (b, monitor) = joined(&place, Role::Monitor);
            ([a, b], [force, monitor])
        };
        let mut blocks = force.publisher::<ForceBlock>().unwrap();
        let _verdicts = monitor.subscriber::<Verdict>().unwrap();
        let _spectra = monitor.subscriber::<Spectrum>().unwrap();
        let mut block = Box::<ForceBlock>::default();
        (block.channels, block.samples, block.rate_hz) = (3, 100, 10_000.0);
        for seq in 0..BLOCKS {
            ring(&mut block, seq);
            spoil(&mut block, seq);
            blocks.send(&block);
            for exchange in [&warm, &exchange] {
                let _ = exchange.monitor_inputs.push(known(seq));
            }
            std::thread::sleep(Duration::from_millis(1));
            if seq == WARM_UP_BLOCKS {
                warm.stop();
            }
        }
        exchange.stop();
        subject.join().unwrap()
    });
    let counters = &exchange.counters;
    let taken = counters.force_blocks.load(Relaxed);
    let verdicts = exchange.verdicts.len() as u64;
    assert!(taken > BLOCKS / 3 && verdicts > 0, "{taken} blocks, {verdicts} verdicts");
    let [gaps, refused, malformed] =
        [&counters.force_gaps, &counters.force_refused, &counters.malformed]
            .map(|counter| counter.load(Relaxed));
    assert!(gaps > 0 && refused > 0 && malformed > 0, "{gaps}, {refused}, {malformed}");
    let spectra = spectra.into_inner();
    assert!(spectra > 3, "{spectra} spectra");
    assert_eq!(heap.count_total, verdicts + spectra, "one block per message: {heap:?}");
    assert_eq!((heap.count_current, heap.bytes_current), (0, 0), "each given back: {heap:?}");
}

/// Every kind of invalid block, occasionally, while faults are counted and no vibration is
/// reported.
fn spoil(block: &mut ForceBlock, seq: u64) {
    (block.rate_hz, block.channels) = (10_000.0, 3);
    // Another session, and a block that is missing.
    block.session = u64::from(seq > SPOILED.end);
    block.seq += u64::from(seq > SPOILED.start);
    if !SPOILED.contains(&seq) {
        return;
    }
    match seq % 11 {
        1 => block.rate_hz = f64::NAN,
        2 => block.channels = 6,
        3 => block.channels = u32::MAX,
        4 => (block.seq, block.t_ns) = (block.seq - 5, block.t_ns - 50_000_000),
        5 => block.data[..20].fill(f64::NAN),
        _ => block.data[100..300].fill(0.0),
    }
}

/// The process, as it changes all the time.
fn known(seq: u64) -> MonitorInputs {
    let state = ProcessState {
        spindle_rpm: 10_000.0 + (seq / 600) as f64,
        teeth: 2,
        feed_mm_s: 5.0 + (seq / 200) as f64,
        in_cut: SPOILED.contains(&seq).then_some(seq % 20 > 10),
    };
    let wheel = GearFrequency { joint: 1, shaft: 1, teeth: 1, cycles_per_mm: 0.0165 };
    let mode = spectrum::Mode::at_hz(72.0);
    MonitorInputs {
        state,
        wheels: [Some(wheel); GEAR_FREQUENCIES_MAX],
        modes: [Some(mode); MODES_MAX],
    }
}

/// Ten milliseconds of force, that rings in the third and the eighth second.
fn ring(block: &mut ForceBlock, seq: u64) {
    (block.seq, block.samples_before, block.t_ns) = (seq, seq * 100, seq * 10_000_000);
    for s in 0..100 {
        let t_s = seq as f64 * 0.01 + s as f64 * 1e-4;
        let rings = (2.5..4.0).contains(&t_s) || (7.0..8.5).contains(&t_s);
        let line = if rings { 8.0 * (std::f64::consts::TAU * 72.0 * t_s).sin() } else { 0.0 };
        for channel in 0..3 {
            let noise = ((s * 7919 + channel * 104_729 + seq as usize * 31) % 1009) as f64 / 1009.0;
            block.data[channel * 100 + s] = line + noise;
        }
    }
}
