//! A status as JSON: its codes as words, its units in its keys.

use serde::Serialize;
use shm_schema::{RecorderState, WrenchGate};
use trued_client::{Health, InCut, Mode, Status, VibrationState, WatchState, monotonic_ns};

/// How a cell is.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) cell: String,
    /// Why the daemon does not answer now; none where it does.
    pub(super) away: Option<String>,
    /// Age of all that follows.
    pub(super) age_s: f64,
    pub(super) pid: u32,
    pub(super) uptime_s: f64,
    pub(super) health: &'static str,
    pub(super) message: String,
    pub(super) mode: &'static str,
    pub(super) bypassed: bool,
    pub(super) robot: Robot,
    pub(super) model: Model,
    pub(super) counts: Counts,
    pub(super) latency_us: Latency,
    pub(super) force: Force,
    pub(super) vibration: Vibration,
    pub(super) recorder: &'static str,
    pub(super) recorder_dropped: u64,
    /// 0: ambient, n: joint n.
    pub(super) stale_temperatures: Vec<u32>,
}

#[derive(Serialize)]
pub(super) struct Robot {
    pub(super) maker: String,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) serial: String,
    pub(super) joints: u32,
}

#[derive(Serialize)]
pub(super) struct Model {
    pub(super) epoch: u64,
    pub(super) hash: String,
    pub(super) geometry_hash: String,
    pub(super) uncompensated_effects: u32,
    pub(super) holds: bool,
    pub(super) measurements: u64,
    pub(super) residual_mm: f64,
}

#[derive(Serialize)]
pub(super) struct Counts {
    pub(super) cycles: u64,
    pub(super) missed_cycles: u64,
    pub(super) commands: u64,
    pub(super) commands_lost: u64,
    pub(super) rejected: u64,
    pub(super) held: u64,
    pub(super) stale: u64,
    pub(super) corrected_lost: u64,
    pub(super) malformed: u64,
}

#[derive(Serialize)]
pub(super) struct Latency {
    pub(super) p50: f64,
    pub(super) p99: f64,
    pub(super) p999: f64,
    pub(super) max: f64,
}

#[derive(Serialize)]
pub(super) struct Force {
    pub(super) wrench_gate: &'static str,
    pub(super) loop_gain: f64,
    pub(super) blocks: u64,
    pub(super) gaps: u64,
    pub(super) refused: u64,
    /// In words.
    pub(super) faults: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct Vibration {
    pub(super) watch: &'static str,
    /// The line that matters most, in words; none where there is none.
    pub(super) line: Option<String>,
    pub(super) in_cut: &'static str,
    pub(super) spindle_rpm: f64,
    pub(super) feed_mm_s: f64,
}

/// The word of a code; of a later version's, that it is not known here.
fn word<T, E>(code: Result<T, E>, name: impl Fn(T) -> &'static str) -> &'static str {
    code.map_or("unknown", name)
}

impl Report {
    pub(super) fn of(cell: &str, status: &Status, away: Option<String>) -> Self {
        let seconds = |from_ns: u64, to_ns: u64| to_ns.saturating_sub(from_ns) as f64 * 1e-9;
        let is_stale = |place: &u32| status.stale_temperatures & (1 << place) != 0;
        Self {
            cell: cell.to_owned(),
            away,
            age_s: seconds(status.t_ns, monotonic_ns()),
            pid: status.pid,
            uptime_s: seconds(status.started_ns, status.t_ns),
            health: word(status.health(), Health::name),
            message: status.message.to_string(),
            mode: word(status.mode(), Mode::name),
            bypassed: status.bypassed != 0,
            robot: Robot {
                maker: status.robot_maker.to_string(),
                kind: status.robot_type.to_string(),
                serial: status.robot_serial.to_string(),
                joints: status.joints,
            },
            model: Model {
                epoch: status.model_epoch,
                hash: format!("{:016x}", status.model_hash),
                geometry_hash: format!("{:016x}", status.geometry_hash),
                uncompensated_effects: status.uncompensated_effects,
                holds: status.model_broken_since_ns == 0,
                measurements: status.model_measurements,
                residual_mm: 1e3 * status.model_residual_m,
            },
            counts: counts(status),
            latency_us: latency(status),
            force: Force {
                wrench_gate: word(status.wrench_gate.try_into(), WrenchGate::name),
                loop_gain: status.wrench_loop_gain,
                blocks: status.force_blocks,
                gaps: status.force_gaps,
                refused: status.force_refused,
                faults: status.force_faults().map(|fault| fault.to_string()).collect(),
            },
            vibration: vibration(status),
            recorder: word(status.recorder.try_into(), RecorderState::name),
            recorder_dropped: status.recorder_dropped,
            stale_temperatures: (0..=status.joints).filter(is_stale).collect(),
        }
    }
}

fn counts(status: &Status) -> Counts {
    Counts {
        cycles: status.cycles,
        missed_cycles: status.missed_cycles,
        commands: status.commands,
        commands_lost: status.commands_lost,
        rejected: status.rejected,
        held: status.held,
        stale: status.stale,
        corrected_lost: status.corrected_lost,
        malformed: status.malformed,
    }
}

fn latency(status: &Status) -> Latency {
    let us = |ns: u64| ns as f64 * 1e-3;
    Latency {
        p50: us(status.latency_p50_ns),
        p99: us(status.latency_p99_ns),
        p999: us(status.latency_p999_ns),
        max: us(status.latency_max_ns),
    }
}

fn vibration(status: &Status) -> Vibration {
    let has_line = status.verdict.state().is_ok_and(|state| state != VibrationState::Over);
    Vibration {
        watch: word(status.watch(), WatchState::name),
        line: has_line.then(|| status.verdict.to_string()),
        in_cut: word(status.in_cut.try_into(), InCut::name),
        spindle_rpm: status.spindle_rpm,
        feed_mm_s: status.feed_mm_s,
    }
}
