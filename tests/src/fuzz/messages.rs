//! Shared memory: for any content written by another process, no target violates a limit and no
//! text fails.
//!
//! No ports; these are the checks after reception.

use corrector::{Corrector, CycleInputs, Mode, Settings, WrenchSample};
use envelope::Limits;
use glam::DVec3;
use physics::{Model, Wrench};
use recording::model::presets::preset;
use shm_schema::{
    Announcement, Command, Corrected, ForceBlock, Horizon, MeasuredPoint, Payload, Request,
    Response, RobotState, Spectrum, Status, Verdict,
};
use spectrum::{Block, MonitorConfig, VibrationMonitor};
use std::fmt::Debug;
use std::sync::LazyLock;

const PERIOD_NS: u64 = 1_000_000;

/// The messages that these bytes are, one behind the other; the last is filled up with zeros.
fn messages<T: Payload>(bytes: &[u8]) -> impl Iterator<Item = T> {
    let whole = |part: &[u8]| {
        let mut part = part.to_vec();
        part.resize(size_of::<T>(), 0);
        T::from_bytes(&part).expect("as many bytes as it has")
    };
    bytes.chunks(size_of::<T>()).map(whole)
}

pub(super) static MODEL: LazyLock<Model> = LazyLock::new(|| {
    let preset = preset("irb1600-6-145-thesis").expect("a preset of the house");
    preset.model().expect("a sound preset").physics
});

/// Commands in a row, as the cycle takes them: checked, judged, corrected, bounded.
pub(super) fn commands(bytes: &[u8]) {
    let limits = Limits::new(0.02, 0.05, 5.0).expect("bounds as a cell has them");
    let settings = Settings { mode: Mode::Full, ..Settings::with_envelope(limits) };
    let mut corrector = Corrector::new(settings);
    for (index, command) in messages::<Command>(bytes).enumerate() {
        let now_ns = (index as u64 + 1) * PERIOD_NS;
        let _ = (command.joints().len(), format!("{command:?}"));
        if command.check().is_err() {
            continue;
        }
        let claim = daemon::translate::command(&command, now_ns, false);
        let world = CycleInputs { wrench: Some(wrench(&command)), ..CycleInputs::default() };
        let wanted = corrector.correct(&MODEL, &claim, &world, now_ns);
        let outcome = corrector.limit(&MODEL, &wanted);
        corrector.prepare(&MODEL);
        let message = daemon::translate::corrected(&outcome, MODEL.arm.count());
        assert!(message.check().is_ok(), "what goes out can be read");
        for (i, correction) in outcome.correction.iter().enumerate() {
            let within = correction.abs() <= limits.angle() * (1.0 + 1e-9);
            assert!(within, "joint {i} corrected by {correction}");
        }
    }
}

fn wrench(command: &Command) -> WrenchSample {
    let [fx, fy, fz, mx, my, mz] = command.wrench;
    let wrench = Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) };
    let in_base = command.has(Command::WRENCH_IN_BASE);
    WrenchSample { wrench, in_base, age_ns: PERIOD_NS, faulty: false }
}

/// Force blocks in a row, through the vibration monitor.
pub(super) fn force(bytes: &[u8]) {
    let config = MonitorConfig { rate_hz: 1000.0, channels: 3, ..MonitorConfig::default() };
    let mut watch =
        VibrationMonitor::new(MonitorConfig { band_hz: [5.0, 400.0], ..config }).expect("a band");
    for block in messages::<ForceBlock>(bytes) {
        let readable = block.check().map_err(|fault| fault.to_string()).is_ok();
        let (channels, samples) =
            if readable { (block.channels as usize, block.samples as usize) } else { (0, 0) };
        let sample = |i: usize| block.channel(i % channels)[i / channels];
        let samples: Vec<f64> = (0..channels * samples).map(sample).collect();
        let _ = block.channel(usize::MAX);
        let verdicts = watch.push(&Block {
            session: block.session,
            seq: block.seq,
            samples_before: Some(block.samples_before),
            t_ns: block.t_ns,
            rate_hz: block.rate_hz,
            channels,
            samples: &samples,
        });
        for verdict in &verdicts {
            let health = watch.health();
            let message = daemon::verdicts::verdict(verdict, &health, 1);
            assert!(message.check().is_ok() && !message.to_string().is_empty());
        }
    }
    let _ = (watch.health(), watch.lines());
}

/// Every other message with arbitrary memory content, and the file that identifies the memory. The
/// first byte selects it.
pub(super) fn all_others(bytes: &[u8]) {
    let Some((kind, rest)) = bytes.split_first() else { return };
    match kind % 10 {
        0 => each::<RobotState>(rest, |state| format!("{state:?}")),
        1 => each::<Request>(rest, |request| {
            format!("{:?} {}", request.operation(), request.path.as_str())
        }),
        2 => each::<Response>(rest, |response| format!("{response:?} {}", response.message)),
        3 => each::<Verdict>(rest, ToString::to_string),
        4 => each::<Status>(rest, |status| {
            let faults: Vec<_> = status.force_faults().map(|fault| fault.to_string()).collect();
            let codes = (status.health(), status.mode(), status.watch());
            format!("{codes:?} {faults:?} {} {}", status.message, status.verdict)
        }),
        5 => each::<Corrected>(rest, |target| {
            format!("{:?} {:?} {:?}", target.status(), target.reason(), target.correction())
        }),
        6 => {
            let _ = Announcement::parse(&String::from_utf8_lossy(rest));
        }
        7 => each::<MeasuredPoint>(rest, |point| format!("{point:?}")),
        8 => horizons(rest),
        _ => each::<Spectrum>(rest, |spectrum| format!("{:?}", spectrum.amplitudes_n())),
    }
}

/// Horizons, as the daemon reads them one after the other: one that passes the check is numbers throughout.
fn horizons(bytes: &[u8]) {
    let mut newest = Box::new(Horizon::default());
    for horizon in messages::<Horizon>(bytes) {
        horizon.copy_into(&mut newest);
        assert_eq!(newest.check(), horizon.check());
        if newest.check().is_ok() {
            assert!(newest.points().iter().flatten().all(|q| q.is_finite()));
        }
    }
}

fn each<T: Payload + Debug>(bytes: &[u8], describe: impl Fn(&T) -> String) {
    for message in messages::<T>(bytes) {
        let _ = message.check().map_err(|fault| fault.to_string());
        assert!(!describe(&message).is_empty());
    }
}
