//! The daemon (`trued run`): threads, shared memory, time, health, reload.
//!
//! | thread | does | rate |
//! | --- | --- | --- |
//! | `cycle` ([`cycle`]) | receives commands, corrects, publishes | that of the commands |
//! | `vibration` ([`vibration`]) | force blocks in, verdicts out, the newest wrench to the cycle | that of the blocks |
//! | `recorder` ([`recorder`]) | writes the rings to the recording | 20 per second |
//! | `supervisor` ([`supervisor`]) | status, requests, reload, dead clients | 50 per second |
//!
//! Each cell has its own four threads; the caller's thread waits for their end.
//!
//! Promises: the daemon never makes the robot step, whatever fails; a start that fails leaves nothing behind.
//! Never: an equation. The cycle is one short file, [`cycle`].

pub mod admission;
pub mod ageing;
pub mod alarms;
pub mod at_rest;
pub mod change_log;
pub mod cycle;
pub mod exchange;
pub mod feed;
pub mod instrument;
pub mod latency;
pub mod mend;
pub mod notebook;
pub mod notify;
pub mod pacer;
pub mod position;
pub mod process;
pub mod realtime;
pub mod recorder;
pub mod records;
pub mod robot;
pub mod sender;
pub mod senses;
pub mod setup;
pub mod shelf;
pub mod status;
pub mod supervisor;
pub mod temperatures;
pub mod throttle;
pub mod translate;
pub mod travel;
pub mod verdicts;
pub mod vibration;

use crate::cycle::Cycle;
use crate::exchange::{Exchange, LoadedModel};
use crate::notify::Manager;
use crate::pacer::Pacer;
use crate::realtime::Refused;
use crate::recorder::Recorder;
use crate::robot::Robot;
use crate::supervisor::Supervisor;
use crate::vibration::{Ears, Listener};
use corrector::{Corrector, Settings};
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

/// How the daemon is to run.
#[derive(Debug)]
pub struct Options {
    /// The cell.
    pub config: CellConfig,
    /// What faults of the configuration call it.
    pub config_name: String,
    /// Its text, for the black box.
    pub config_text: String,
    /// Commands pace the cycle and carry the time: a replay.
    pub lockstep: bool,
}

/// Why the daemon did not start, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The model, or the configuration against it.
    #[error(transparent)]
    File(#[from] FileError),
    /// A bound of the envelope.
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
    /// Real-time manners that the configuration insists on.
    #[error("{0}; or set `[realtime] enforce = false`, and the daemon goes on without")]
    Refused(#[from] Refused),
    /// A thread could not be started, or did not end as it should.
    #[error("thread `{name}`: {why}")]
    Thread {
        /// Which.
        name: &'static str,
        /// Why.
        why: String,
    },
}

impl DaemonError {
    fn thread(name: &'static str, why: impl Into<String>) -> Self {
        Self::Thread { name, why: why.into() }
    }
}

/// Runs the daemon for one cell or several until `stop` is set. Calls `ready` once clients can join all of them. Cells share the process and
/// nothing else; where one of them does not start, or ends, the others end with it.
///
/// # Errors
/// See [`DaemonError`], that of the first cell that has one; the shared memory is cleaned up then.
pub fn run(
    cells: Vec<Options>,
    stop: &AtomicBool,
    ready: impl FnOnce() + Send,
) -> Result<(), DaemonError> {
    let count = cells.len();
    let over = Over { stop, ended: AtomicBool::new(false), several: count > 1 };
    let manager = Mutex::new(Manager::of_environment(count));
    let mut ready = Some(ready);
    std::thread::scope(|scope| {
        let mut supervisors = Vec::new();
        for (place, options) in cells.into_iter().enumerate() {
            let (tell, told) = mpsc::channel();
            let (over, manager) = (&over, &manager);
            let supervisor = std::thread::Builder::new().name("supervisor".to_owned());
            let served = supervisor.spawn_scoped(scope, move || {
                let ready = || {
                    // Whoever waits for this has not gone: it waits.
                    let _ = tell.send(());
                };
                let served = serve(options, (manager, place), over, ready);
                over.ended.store(true, Relaxed);
                lock(manager).ended(place);
                served
            });
            let refused = |why: std::io::Error| DaemonError::thread("supervisor", why.to_string());
            supervisors.push(served.map_err(refused));
            // One that ends before it says anything has its reason to tell: below.
            if told.recv().is_err() {
                over.ended.store(true, Relaxed);
                break;
            }
        }
        // Those behind one that did not start never will.
        (supervisors.len()..count).for_each(|place| lock(&manager).ended(place));
        if !over.ended.load(Relaxed) {
            lock(&manager).ready();
            ready.take().into_iter().for_each(|ready| ready());
        }
        let ended = |thread: ScopedJoinHandle<'_, Result<(), DaemonError>>| {
            let panicked = |_| Err(DaemonError::thread("supervisor", "it panicked"));
            thread.join().unwrap_or_else(panicked)
        };
        // All of them are waited for, whatever the first one has to say.
        let served: Vec<_> = supervisors.into_iter().map(|thread| thread.and_then(ended)).collect();
        served.into_iter().collect()
    })
}

/// When a cell's threads are to end.
struct Over<'a> {
    /// From outside.
    stop: &'a AtomicBool,
    /// A cell of this daemon has ended.
    ended: AtomicBool,
    /// The process serves several cells: each names itself in the log.
    several: bool,
}

impl Over<'_> {
    fn over(&self) -> bool {
        self.stop.load(Relaxed) || self.ended.load(Relaxed)
    }
}

/// A supervisor that panicked ends the daemon: its half of a word does no harm.
fn lock(manager: &Mutex<Manager>) -> MutexGuard<'_, Manager> {
    manager.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves one cell, in the thread of its supervisor, until it is over.
fn serve(
    options: Options,
    (manager, place): (&Mutex<Manager>, usize),
    over: &Over<'_>,
    ready: impl FnOnce(),
) -> Result<(), DaemonError> {
    let Options { config, config_name, config_text, lockstep } = options;
    let _named = over.several.then(|| info_span!("cell", name = config.cell).entered());
    let model = RobotModel::read(&config.model)?;
    let arm = &model.physics.arm;
    config.check_against(&config_name, &setup::joint_kinds(arm)).map_err(FileError::from)?;
    if let Some(fault) = setup::deflection_limit_fault(&config, &model.physics) {
        let mut faults = Faults::of(&config_name);
        faults.push(fault);
        return Err(FileError::from(faults).into());
    }
    let settings = setup::settings(&config, arm, lockstep)?;
    let bounds = setup::bounds(&settings, arm);
    let ears = setup::ears(&config, &model)?;
    let exchange = Arc::new(Exchange::new(settings.mode, config.recorder.is_some()));
    notebook::open(&exchange);
    tell_model(&model);

    let domain = DaemonSide::create(&Cell::new(&config.cell)?)?;
    if config.realtime.lock_memory {
        tolerate(realtime::lock_memory(), config.realtime.enforce)?;
    }
    let mut supervisor = Supervisor::join(domain, &config, model.clone(), bounds)?;
    let threads =
        start_threads(&config, settings, &model, ears, config_text, &mut supervisor, &exchange)
            .inspect_err(|_| exchange.stop())?;
    info!(cell = config.cell, mode = ?settings.mode, "ready");
    lock(manager).says(place, 0, supervisor.words());
    ready();
    let mut served = Ok(());
    while served.is_ok() && !over.over() && threads.iter().all(|(_, thread)| !thread.is_finished())
    {
        served = supervisor.look(&exchange);
        lock(manager).says(place, exchange.counters.turns.load(Relaxed), supervisor.words());
        std::thread::sleep(supervisor::LOOK_EVERY);
    }
    exchange.stop();
    lock(manager).ended(place);
    supervisor.tell(&exchange);
    let ended = threads.into_iter().try_for_each(|(name, thread)| finish(name, thread));
    change_log::summarise(&config.cell, &exchange);
    ended?;
    Ok(served?)
}

/// Name of the thread that neither logs nor allocates.
const CYCLE: &str = "cycle";
/// How long the threads may take to end.
const END_PATIENCE: Duration = Duration::from_secs(5);

type Thread = JoinHandle<Result<(), DaemonError>>;

/// Starts all threads; once they have their ports, clients may join.
fn start_threads(
    config: &CellConfig,
    settings: Settings,
    model: &RobotModel,
    ears: Ears,
    config_text: String,
    supervisor: &mut Supervisor,
    exchange: &Arc<Exchange>,
) -> Result<Vec<(&'static str, Thread)>, DaemonError> {
    let ports = supervisor.domain.ports();
    let cycle = start_cycle(config, settings, model, &ports, exchange)?;
    let manners = below(config.realtime);
    let rules = setup::block_rules(config, settings.lockstep);
    let vibration = start("vibration", exchange, move |exchange, started| {
        take_manners(manners)?;
        let mut listener = Listener::join(&ports, ears)?.with_rules(rules);
        started();
        listener.run(exchange);
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
    supervisor.tell(exchange);
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
    let pacer = Pacer::new(setup::wait(config), settings.period_ns);
    let senses = setup::senses(config, settings.lockstep);
    let loaded = Box::new(LoadedModel { physics: model.physics, epoch: 1 });
    start(CYCLE, exchange, move |exchange, started| {
        realtime::sleep_exactly();
        take_manners(realtime)?;
        let mut cycle = Cycle {
            robot: Robot::join(&ports, pacer)?,
            corrector: Corrector::new(settings),
            model: loaded,
            senses,
            stale_ns: settings.stale_ns,
            period_ns: settings.period_ns,
            lockstep: settings.lockstep,
        };
        started();
        cycle.run(exchange);
        Ok(())
    })
}

/// Starts a thread and waits until it has said that it is ready.
fn start(
    name: &'static str,
    exchange: &Arc<Exchange>,
    body: impl FnOnce(&Exchange, &dyn Fn()) -> Result<(), DaemonError> + Send + 'static,
) -> Result<Thread, DaemonError> {
    let (tell, told) = mpsc::channel();
    let shared = Arc::clone(exchange);
    let thread = std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || {
            if name != CYCLE {
                notebook::open(&shared);
            }
            body(&shared, &|| {
                // Whoever waits for this has not gone: it waits.
                let _ = tell.send(());
            })
        })
        .map_err(|why| DaemonError::thread(name, why.to_string()))?;
    if told.recv().is_ok() {
        return Ok(thread);
    }
    match thread.join() {
        Ok(Err(fault)) => Err(fault),
        _ => Err(DaemonError::thread(name, "it ended at once")),
    }
}

/// Waits for a thread that has been told to stop; for one that waits for its disk not for ever.
fn finish(name: &'static str, thread: Thread) -> Result<(), DaemonError> {
    let since = Instant::now();
    while !thread.is_finished() {
        if since.elapsed() > END_PATIENCE {
            return Err(DaemonError::thread(name, "it hangs; what it had not written is lost"));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    match thread.join() {
        Ok(done) => done,
        Err(_) => Err(DaemonError::thread(name, "it panicked")),
    }
}

/// Real-time manners of the calling thread, as configured.
fn take_manners(realtime: Realtime) -> Result<(), Refused> {
    if let Some(core) = realtime.core {
        tolerate(realtime::pin_to(core), realtime.enforce)?;
    }
    if let Some(priority) = realtime.fifo_priority {
        tolerate(realtime::set_fifo(priority), realtime.enforce)?;
    }
    Ok(())
}

/// The manners of a thread that gives way to the cycle: a priority below it, on any core.
fn below(realtime: Realtime) -> Realtime {
    let priority = realtime.fifo_priority.map(|priority| priority.saturating_sub(1));
    Realtime { fifo_priority: priority.filter(|priority| *priority > 0), core: None, ..realtime }
}

/// A refusal ends the start where the configuration insists; else it is told.
fn tolerate(done: Result<(), Refused>, enforce: bool) -> Result<(), Refused> {
    match done {
        Err(refused) if enforce => Err(refused),
        Err(refused) => {
            warn!(%refused, "going on without");
            Ok(())
        }
        Ok(()) => Ok(()),
    }
}

/// Logs which model is active now, and of which robot.
pub(crate) fn tell_model(model: &RobotModel) {
    info!(
        model = model.file.name,
        robot = %model.file.robot,
        geometry = model.file.identity().geometry(),
        hash = format_args!("{:016x}", model.hash),
        joints = model.physics.arm.count(),
        effects = model.physics.effects().len(),
        "loaded"
    );
    let not_compensated = model.not_compensated_names().join(", ");
    if !not_compensated.is_empty() {
        info!("not compensated: {not_compensated}");
    }
}
