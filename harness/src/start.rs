//! Time from the start of a daemon to its first corrected target, as seen by a cell.
//!
//! The clock starts before the process does; the client is already running, as in a cell whose
//! daemon restarts; only an answer to its own command that includes a correction by the model
//! counts.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use shm_schema::monotonic_ns;
use trued_client::{Client, Connection, CorrectionStatus};

use crate::bench_directory::BenchDirectory;
use crate::error::BenchError;
use crate::latencies::Latencies;
use crate::measured_daemon::{ServedModel, Setup, launch, ready};
use crate::peers::trued::Trued;
use crate::plan::{Plan, Programs, Stage};

/// Time limit of one start.
const WITHIN: Duration = Duration::from_secs(10);
/// Time between two commands while waiting.
const TICK: Duration = Duration::from_millis(1);

/// Times from the start of the process to the first corrected target, ns.
pub(crate) fn run(
    plan: &Plan,
    programs: &dyn Programs,
    place: &BenchDirectory,
    setup: Setup,
    stop: &AtomicBool,
) -> Result<Latencies, BenchError> {
    let served = ServedModel { model: &plan.models[0], cells: 1 };
    let mut starts = Latencies::default();
    let mut trued: Option<Trued> = None;
    // The first start informs the client of the robot; it is not counted.
    for start in 0..=plan.repeats {
        let since_ns = monotonic_ns();
        let daemon = ready(launch(programs, place, served, setup)?)?;
        let mut client = match trued.take() {
            Some(client) => client,
            None => Trued::new(Client::connect(&place.cell(0), WITHIN)?),
        };
        let first_ns = first_corrected(&mut client, since_ns, stop)?;
        if start > 0 {
            starts.record(first_ns - since_ns);
        }
        drop(daemon);
        wait_for_end(&mut client, stop)?;
        trued = Some(client);
    }
    Ok(starts)
}

/// Time of the first corrected target for a command of this client.
fn first_corrected(trued: &mut Trued, since_ns: u64, stop: &AtomicBool) -> Result<u64, BenchError> {
    let by_model =
        [CorrectionStatus::Corrected, CorrectionStatus::Ramping].map(CorrectionStatus::code);
    while monotonic_ns() - since_ns < WITHIN.as_nanos() as u64 {
        let answered = trued.command(TICK);
        let newest = trued.newest.filter(|answer| by_model.contains(&answer.status));
        if let ((_, Some(here_ns)), Some(_)) = (answered, newest) {
            return Ok(here_ns);
        }
        if stop.load(Relaxed) {
            return Err(BenchError::Interrupted);
        }
        // Without a daemon a command is refused at once: a short pause.
        std::thread::sleep(Duration::from_micros(200));
    }
    Err(BenchError::Silent { stage: Stage::Start.name(), limit_ms: WITHIN.as_millis() as u64 })
}

/// Waits until the client notices that the daemon has ended.
fn wait_for_end(trued: &mut Trued, stop: &AtomicBool) -> Result<(), BenchError> {
    let since_ns = monotonic_ns();
    while matches!(trued.client.connection(), Connection::Connected { .. }) {
        if monotonic_ns() - since_ns > WITHIN.as_nanos() as u64 {
            return Err(BenchError::part("daemon", "it does not end"));
        }
        if stop.load(Relaxed) {
            return Err(BenchError::Interrupted);
        }
        std::thread::sleep(TICK);
    }
    Ok(())
}
