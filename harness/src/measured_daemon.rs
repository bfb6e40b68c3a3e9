//! The measured daemon: the bench's own, or that of a running cell.
//!
//! The daemon has the requested settings or does not start; it ends with the bench.

use std::fs::DirEntry;
use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;
use std::time::{Duration, Instant};

use trued_client::{Client, Connection, ForceSource, Monitor};

use crate::bench_directory::BenchDirectory;
use crate::child::ChildGuard;
use crate::error::BenchError;
use crate::plan::{Plan, Policy, Programs, Wait};
use crate::thread_settings::ThreadSettings;

/// The daemon's name for the thread of a cell's cycle, and the kernel's number of the policy.
const CYCLE_THREAD: &str = "cycle";
const SCHED_FIFO: u32 = 1;
/// Time limit for joining.
pub(crate) const JOIN_WITHIN: Duration = Duration::from_secs(10);
/// Time limit for reading a cell's status.
const LOOK_WITHIN: Duration = Duration::from_secs(1);
/// Sampling rate of the simulated force stream, Hz.
pub(crate) const FORCE_RATE_HZ: f64 = 10_000.0;

/// Settings of the daemon.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Setup {
    /// Settings of its cycle.
    pub(crate) thread_settings: ThreadSettings,
    pub(crate) wait: Wait,
    /// Time between commands, s.
    pub(crate) period_s: f64,
    /// Whether it receives force blocks.
    pub(crate) listens: bool,
}

/// What a daemon serves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ServedModel<'a> {
    /// The text of its model.
    pub(crate) model: &'a str,
    /// Number of cells, all with that model.
    pub(crate) cells: usize,
}

/// A cell that can be joined.
#[derive(Debug)]
pub(crate) struct MeasuredDaemon {
    /// The daemon, if started by the bench.
    pub(crate) daemon: Option<ChildGuard>,
    cell: String,
}

impl MeasuredDaemon {
    /// The named running cell, or a daemon started by the bench.
    pub(crate) fn new(
        plan: &Plan,
        programs: &dyn Programs,
        place: &BenchDirectory,
        setup: Setup,
    ) -> Result<Self, BenchError> {
        match &plan.cell {
            Some(cell) => Ok(Self { daemon: None, cell: cell.clone() }),
            None => Self::start(
                programs,
                place,
                ServedModel { model: &plan.models[0], cells: 1 },
                setup,
            ),
        }
    }

    /// A daemon started by the bench; with several cells, the first.
    pub(crate) fn start(
        programs: &dyn Programs,
        place: &BenchDirectory,
        served: ServedModel<'_>,
        setup: Setup,
    ) -> Result<Self, BenchError> {
        let started = launch(programs, place, served, setup)?;
        Ok(Self { daemon: Some(ready(started)?), cell: place.cell(0) })
    }

    pub(crate) fn client(&self) -> Result<Client, BenchError> {
        let mut client = Client::connect(&self.cell, JOIN_WITHIN)?;
        client.set_fresh(Duration::from_secs(1));
        Ok(client)
    }

    pub(crate) fn monitor(&self) -> Result<Monitor, BenchError> {
        Ok(Monitor::connect(&self.cell, JOIN_WITHIN)?)
    }

    pub(crate) fn force(&self) -> Result<ForceSource, BenchError> {
        Ok(ForceSource::connect(&self.cell, JOIN_WITHIN)?)
    }
}

/// Checks that a running cell has the requested real-time policy.
///
/// # Errors
/// Its cycle has another policy, or it cannot be joined.
pub(crate) fn require_fifo(cell: &str, within: Duration) -> Result<(), BenchError> {
    let mut monitor = Monitor::connect(cell, within)?;
    let Connection::Connected { pid, .. } = monitor.connection() else { return Ok(()) };
    let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
    let text = |task: &DirEntry, name| std::fs::read_to_string(task.path().join(name));
    let cycles =
        tasks.filter(|task| text(task, "comm").is_ok_and(|comm| comm.trim() == CYCLE_THREAD));
    let mut policies = cycles.filter_map(|task| policy_in(&text(&task, "stat").ok()?));
    if policies.any(|policy| policy != SCHED_FIFO) {
        return Err(BenchError::OfCell { cell: cell.to_owned(), pid });
    }
    Ok(())
}

/// Whether the daemon of a running cell has the real-time policy; false without an answer.
#[must_use]
pub fn runs_fifo(cell: &str) -> bool {
    require_fifo(cell, LOOK_WITHIN).is_ok()
}

/// The policy in `/proc/PID/task/TID/stat`: the 41st field (proc(5)), the 39th after the closing
/// bracket of the name.
fn policy_in(stat: &str) -> Option<u32> {
    stat.rsplit(')').next()?.split_whitespace().nth(38)?.parse().ok()
}

/// Starts a daemon, without waiting until it is ready.
pub(crate) fn launch(
    programs: &dyn Programs,
    place: &BenchDirectory,
    served: ServedModel<'_>,
    setup: Setup,
) -> Result<ChildGuard, BenchError> {
    let model = place.write("model.toml", served.model)?;
    let config = |k| place.write(&format!("cell-{k}.toml"), &cell_toml(&place.cell(k), setup));
    let configs = (0..served.cells).map(config).collect::<Result<Vec<_>, _>>()?;
    let failed = |e| BenchError::io("start the daemon for", &model, e);
    let mut command = programs.daemon(&configs).map_err(failed)?;
    command.stderr(Stdio::piped());
    ChildGuard::spawn_piped(command).map_err(failed)
}

/// Waits until a daemon is ready.
pub(crate) fn ready(mut daemon: ChildGuard) -> Result<ChildGuard, BenchError> {
    let mut line = String::new();
    if let Some(out) = daemon.0.stdout.take() {
        // A daemon that ends closes its output, which ends this wait too.
        let _ = BufReader::new(out).read_line(&mut line);
    }
    if line.trim() == "ready" {
        drain(&mut daemon);
        return Ok(daemon);
    }
    let mut log = String::new();
    if let Some(mut stderr) = daemon.0.stderr.take() {
        let _ = stderr.read_to_string(&mut log);
    }
    let since = Instant::now();
    while daemon.try_exit_status().is_none() && since.elapsed() < Duration::from_secs(1) {
        std::thread::sleep(Duration::from_millis(1));
    }
    let status =
        daemon.try_exit_status().map_or_else(|| "still there".into(), |status| status.to_string());
    Err(BenchError::Daemon { status, said: log.trim().to_owned() })
}

/// Reads and discards its log: a full pipe would block it.
fn drain(daemon: &mut ChildGuard) {
    if let Some(mut stderr) = daemon.0.stderr.take() {
        std::thread::spawn(move || std::io::copy(&mut stderr, &mut std::io::sink()));
    }
}

/// A cell that compensates everything in its model: every effect, gravity, the wrench sent with the
/// command.
fn cell_toml(name: &str, setup: Setup) -> String {
    let ThreadSettings { core, policy, priority } = setup.thread_settings;
    let period_ms = setup.period_s * 1e3;
    let policy = match policy {
        Policy::Fifo => format!("policy = \"fifo\"\npriority = {priority}\nlock_memory = true\n"),
        Policy::Other => "policy = \"other\"\n".to_owned(),
    };
    let force = if setup.listens {
        format!(
            "[force]\nrate_Hz = {FORCE_RATE_HZ:.1}\nchannels = 3\n[vibration]\nenabled = true\n"
        )
    } else {
        String::new()
    };
    format!(
        "schema = \"trued.cell/1\"\ncell = \"{name}\"\nmodel = \"model.toml\"\nmode = \"full\"\n\
         [cycle]\nperiod_ms = {period_ms:?}\nstale_ms = 10000.0\nwait = \"{}\"\n\
         [wrench]\nsource = \"command\"\nprocess_stiffness_N_per_um = 0.02\n{force}\
         [realtime]\n{policy}core = {core}\nenforce = true\n",
        setup.wait.name()
    )
}
