//! The daemon (`trued run`): threads, shared memory, time, health, reload.
//!
//! | thread | task | rate |
//! | --- | --- | --- |
//! | `cycle` ([`cycle`]) | receives commands, corrects, publishes | that of the commands |
//! | `vibration` ([`vibration`]) | analyses force blocks, publishes verdicts, passes the newest wrench to the cycle | that of the blocks |
//! | `recorder` ([`recorder`]) | writes the rings to the recording | 20 per second |
//! | `supervisor` ([`supervisor`]) | status, requests, reload, cleanup after terminated clients | 50 per second |
//!
//! Each cell has its own four threads; the caller's thread waits for them.
//!
//! Invariants: the daemon never makes the robot step, whatever fails; a start that fails leaves
//! nothing behind. The cycle is one short file, [`cycle`].

pub mod admission;
pub mod ageing;
pub mod alarms;
pub mod change_log;
pub mod cycle;
pub mod exchange;
pub mod feed;
pub mod instrument;
pub mod latency;
pub mod lead;
pub mod notify;
pub mod pacer;
pub mod position;
pub mod process;
pub mod realtime;
pub mod recorder;
pub mod recording_log;
pub mod records;
pub mod repair;
pub mod retention;
pub mod robot;
pub mod sender;
pub mod sensor_inputs;
pub mod setup;
pub(crate) mod spectra;
pub mod stable_file;
pub mod status;
pub mod supervisor;
pub mod temperatures;
pub mod throttle;
pub mod tool_motion;
pub mod translate;
pub mod verdicts;
pub mod vibration;

use crate::cycle::Cycle;
use crate::exchange::{Exchange, LoadedModel};
use crate::notify::ServiceManager;
use crate::pacer::Pacer;
use crate::realtime::RealtimeRefused;
use crate::recorder::Recorder;
use crate::robot::Robot;
use crate::supervisor::Supervisor;
use crate::vibration::{ForceProcessor, VibrationThread};
use corrector::{Corrector, Settings};
use joint_dynamics::plant::Plants;
use recording::cell::{CellConfig, Realtime};
use recording::faults::Faults;
use recording::files::FileError;
use recording::model::RobotModel;
use shm_schema::{Cell, DaemonPorts, DaemonSide, DomainError, PortError};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{JoinHandle, ScopedJoinHandle};
use std::time::{Duration, Instant};
use tracing::{info, info_span, warn};

/// Options of a run.
#[derive(Debug)]
pub struct Options {
    /// The cell.
    pub config: CellConfig,
    /// Name of the configuration in error messages.
    pub config_name: String,
    /// Its text, for the recording.
    pub config_text: String,
    /// Lockstep: the commands trigger the cycle and state the time (a replay).
    pub lockstep: bool,
}

/// Why the daemon did not start, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The model, or its combination with the configuration, is invalid.
    #[error(transparent)]
    File(#[from] FileError),
    /// A limit of the envelope.
    #[error(transparent)]
    Envelope(#[from] envelope::LimitsError),
    /// The vibration monitor.
    #[error(transparent)]
    Vibration(#[from] spectrum::ConfigError),
    /// The cell's shared memory.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A real-time setting that the configuration requires was refused.
    #[error("{0}; or set `[realtime] enforce = false` to continue without it")]
    Refused(#[from] RealtimeRefused),
    /// A thread could not be started, or did not end properly.
    #[error("thread `{name}`: {why}")]
    Thread {
        /// Name of the thread.
        name: &'static str,
        /// The error.
        why: String,
    },
}

impl DaemonError {
    fn thread(name: &'static str, why: impl Into<String>) -> Self {
        Self::Thread { name, why: why.into() }
    }
}

/// Runs the daemon for one cell or several until `stop` is set. Calls `ready` once clients can join
/// all of them. Cells only share the process; if one of them does not start, or ends, the others
/// end with it.
///
/// # Errors
/// See [`DaemonError`], that of the first cell that has one; the shared memory is cleaned up then.
pub fn run(
    cells: Vec<Options>,
    stop: &AtomicBool,
    ready: impl FnOnce() + Send,
) -> Result<(), DaemonError> {
    let count = cells.len();
    let over = StopCondition { stop, ended: AtomicBool::new(false), several: count > 1 };
    let manager = Mutex::new(ServiceManager::from_environment(count));
    let mut ready = Some(ready);
    std::thread::scope(|scope| {
        let mut supervisors = Vec::new();
        for (place, options) in cells.into_iter().enumerate() {
            let (ready, is_ready) = mpsc::channel();
            let (over, manager) = (&over, &manager);
            let supervisor = std::thread::Builder::new().name("supervisor".to_owned());
            let served = supervisor.spawn_scoped(scope, move || {
                let ready = || {
                    // The receiver waits for this message.
                    let _ = ready.send(());
                };
                let served = serve(options, (manager, place), over, ready);
                over.ended.store(true, Relaxed);
                lock(manager).ended(place);
                served
            });
            let refused = |why: std::io::Error| DaemonError::thread("supervisor", why.to_string());
            supervisors.push(served.map_err(refused));
            // A thread that ends without a message has a reason: see below.
            if is_ready.recv().is_err() {
                over.ended.store(true, Relaxed);
                break;
            }
        }
        // Cells after one that did not start are not started.
        (supervisors.len()..count).for_each(|place| lock(&manager).ended(place));
        if !over.ended.load(Relaxed) {
            lock(&manager).ready();
            ready.take().into_iter().for_each(|ready| ready());
        }
        let ended = |thread: ScopedJoinHandle<'_, Result<(), DaemonError>>| {
            let panicked = |_| Err(DaemonError::thread("supervisor", "it panicked"));
            thread.join().unwrap_or_else(panicked)
        };
        // All of them are joined, whatever the result of the first one.
        let served: Vec<_> = supervisors.into_iter().map(|thread| thread.and_then(ended)).collect();
        served.into_iter().collect()
    })
}

/// Condition under which the threads of a cell end.
struct StopCondition<'a> {
    /// Requested by the caller.
    stop: &'a AtomicBool,
    /// A cell of this daemon has ended.
    ended: AtomicBool,
    /// The process serves several cells: log lines carry the name of the cell.
    several: bool,
}

impl StopCondition<'_> {
    fn is_met(&self) -> bool {
        self.stop.load(Relaxed) || self.ended.load(Relaxed)
    }
}

/// A supervisor that panicked ends the daemon, so an incomplete state is harmless.
fn lock(manager: &Mutex<ServiceManager>) -> MutexGuard<'_, ServiceManager> {
    manager.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves one cell, in the thread of its supervisor, until it ends.
fn serve(
    options: Options,
    (manager, place): (&Mutex<ServiceManager>, usize),
    over: &StopCondition<'_>,
    ready: impl FnOnce(),
) -> Result<(), DaemonError> {
    let Options { config, config_name, config_text, lockstep } = options;
    let _named = over.several.then(|| info_span!("cell", name = config.cell).entered());
    let model = RobotModel::read(&config.model)?;
    let arm = &model.physics.arm;
    config.check_against(&config_name, &setup::joint_kinds(arm)).map_err(FileError::from)?;
    if let Some(fault) = setup::deflection_limit_fault(&config, &model.physics) {
        let mut faults = Faults::new(&config_name);
        faults.push(fault);
        return Err(FileError::from(faults).into());
    }
    let settings = setup::settings(&config, arm, lockstep)?;
    let bounds = setup::bounds(&settings, arm);
    let force_processor = setup::force_processor(&config, &model)?;
    let exchange = Arc::new(Exchange::new(settings.mode, config.recorder.is_some()));
    recording_log::attach_thread(&exchange);
    let lead = setup::lead(&config, settings.jump_margin);
    log_model(&model, lead.is_some());

    let domain = DaemonSide::create(&Cell::new(&config.cell)?)?;
    if config.realtime.lock_memory {
        tolerate_refusal(realtime::lock_memory(), config.realtime.enforce)?;
    }
    let mut supervisor = Supervisor::join(domain, &config, model.clone(), bounds, lead)?;
    let threads = start_threads(
        &config,
        settings,
        &model,
        force_processor,
        config_text,
        &mut supervisor,
        &exchange,
    )
    .inspect_err(|_| exchange.stop())?;
    info!(cell = config.cell, mode = ?settings.mode, "ready");
    lock(manager).report_alive(place, 0, supervisor.summary());
    ready();
    let mut served = Ok(());
    while served.is_ok()
        && !over.is_met()
        && threads.iter().all(|(_, thread)| !thread.is_finished())
    {
        served = supervisor.run_period(&exchange);
        lock(manager).report_alive(
            place,
            exchange.counters.iterations.load(Relaxed),
            supervisor.summary(),
        );
        std::thread::sleep(supervisor::PERIOD);
    }
    exchange.stop();
    lock(manager).ended(place);
    supervisor.publish_status(&exchange);
    let ended = threads.into_iter().try_for_each(|(name, thread)| finish(name, thread));
    change_log::summarise(&config.cell, &exchange);
    ended?;
    Ok(served?)
}

/// Name of the thread that neither logs nor allocates.
const CYCLE: &str = "cycle";
/// Time limit for the threads to end.
const END_TIMEOUT: Duration = Duration::from_secs(5);

type Thread = JoinHandle<Result<(), DaemonError>>;

/// Starts all threads; once they have their ports, clients may join.
fn start_threads(
    config: &CellConfig,
    settings: Settings,
    model: &RobotModel,
    force_processor: ForceProcessor,
    config_text: String,
    supervisor: &mut Supervisor,
    exchange: &Arc<Exchange>,
) -> Result<Vec<(&'static str, Thread)>, DaemonError> {
    let ports = supervisor.domain.ports();
    let cycle = start_cycle(config, settings, model, &ports, exchange)?;
    let below_cycle = below_cycle_priority(config.realtime);
    let rules = setup::block_rules(config, settings.lockstep);
    let overview = setup::overview(config);
    let vibration = start("vibration", exchange, move |exchange, started| {
        apply_realtime(below_cycle)?;
        let mut vibration_thread =
            VibrationThread::join(&ports, force_processor, overview)?.with_rules(rules);
        started();
        vibration_thread.run(exchange);
        Ok(())
    })?;
    let mut threads = vec![(CYCLE, cycle), ("vibration", vibration)];
    if let Some(settings) = config.recorder.clone() {
        let header = recorder::header(&config.cell, model, 1, config_text);
        let recorder = start("recorder", exchange, move |exchange, started| {
            started();
            Recorder::new(settings, header).run(exchange);
            Ok(())
        })?;
        threads.push(("recorder", recorder));
    }
    supervisor.publish_status(exchange);
    supervisor.domain.announce()?;
    Ok(threads)
}

fn start_cycle(
    config: &CellConfig,
    settings: Settings,
    model: &RobotModel,
    ports: &DaemonPorts,
    exchange: &Arc<Exchange>,
) -> Result<Thread, DaemonError> {
    let (ports, realtime) = (ports.clone(), config.realtime);
    let pacer = Pacer::new(setup::wait_mode(config), settings.period_ns);
    let sensor_inputs = setup::sensor_inputs(config, settings.lockstep);
    let lead = setup::lead(config, settings.jump_margin);
    let filter = lead.and_then(|lead| lead.filter(model));
    let loaded = Box::new(LoadedModel { filter, ..LoadedModel::new(model.physics, 1) });
    start(CYCLE, exchange, move |exchange, started| {
        realtime::minimize_timer_slack();
        apply_realtime(realtime)?;
        let mut cycle = Cycle {
            robot: Robot::join(&ports, pacer)?,
            corrector: Corrector::new(settings),
            model: loaded,
            sensor_inputs,
            stale_ns: settings.stale_ns,
            period_ns: settings.period_ns,
            lockstep: settings.lockstep,
        };
        started();
        cycle.run(exchange);
        Ok(())
    })
}

/// Starts a thread and waits until it is ready.
fn start(
    name: &'static str,
    exchange: &Arc<Exchange>,
    body: impl FnOnce(&Exchange, &dyn Fn()) -> Result<(), DaemonError> + Send + 'static,
) -> Result<Thread, DaemonError> {
    let (ready, is_ready) = mpsc::channel();
    let shared = Arc::clone(exchange);
    let thread = std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || {
            if name != CYCLE {
                recording_log::attach_thread(&shared);
            }
            body(&shared, &|| {
                // The receiver waits for this message.
                let _ = ready.send(());
            })
        })
        .map_err(|why| DaemonError::thread(name, why.to_string()))?;
    if is_ready.recv().is_ok() {
        return Ok(thread);
    }
    match thread.join() {
        Ok(Err(fault)) => Err(fault),
        _ => Err(DaemonError::thread(name, "it ended immediately")),
    }
}

/// Joins a thread that was told to stop; one that waits for its disk only for a limited time.
fn finish(name: &'static str, thread: Thread) -> Result<(), DaemonError> {
    let since = Instant::now();
    while !thread.is_finished() {
        if since.elapsed() > END_TIMEOUT {
            return Err(DaemonError::thread(name, "it does not respond; unwritten data are lost"));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    match thread.join() {
        Ok(done) => done,
        Err(_) => Err(DaemonError::thread(name, "it panicked")),
    }
}

/// Applies the configured real-time settings to the calling thread.
fn apply_realtime(realtime: Realtime) -> Result<(), RealtimeRefused> {
    if let Some(core) = realtime.core {
        tolerate_refusal(realtime::pin_to(core), realtime.enforce)?;
    }
    if let Some(priority) = realtime.fifo_priority {
        tolerate_refusal(realtime::set_fifo(priority), realtime.enforce)?;
    }
    Ok(())
}

/// Settings of a thread that must not preempt the cycle: a priority below it, on any core.
fn below_cycle_priority(realtime: Realtime) -> Realtime {
    let priority = realtime.fifo_priority.map(|priority| priority.saturating_sub(1));
    Realtime { fifo_priority: priority.filter(|priority| *priority > 0), core: None, ..realtime }
}

/// A refusal ends the start if the configuration requires the settings; otherwise it is logged.
fn tolerate_refusal(
    done: Result<(), RealtimeRefused>,
    enforce: bool,
) -> Result<(), RealtimeRefused> {
    match done {
        Err(refused) if enforce => Err(refused),
        Err(refused) => {
            warn!(%refused, "continuing without it");
            Ok(())
        }
        Ok(()) => Ok(()),
    }
}

/// Logs which model is active now, and of which robot.
pub(crate) fn log_model(model: &RobotModel, leads: bool) {
    info!(
        model = model.file.name,
        robot = %model.file.robot,
        geometry = model.file.identity().geometry(),
        hash = format_args!("{:016x}", model.hash),
        joints = model.physics.arm.count(),
        effects = model.physics.effects().len(),
        "loaded"
    );
    let not_compensated = Plants::not_compensated(model, leads).join(", ");
    if !not_compensated.is_empty() {
        info!("not compensated: {not_compensated}");
    }
}
