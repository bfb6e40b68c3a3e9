//! A retrofitted cell: application → bridge → daemon → bridge → a virtual EGM robot with the
//! thesis' errors, which mills.
//!
//! The application streams a path by EGM and is unaware of corrections; the robot is that of
//! `world`, with targets and measured force sent by EGM. The robot's errors are drawn by seed.

use crate::egm::{BridgeRig, EgmRobot, PATIENCE, bridge, config, socket};
use crate::place::TestDirectory;
use crate::process::Process;
use physics::{JOINTS_MAX, Joints};
use recording::model::presets::preset;
use std::ffi::OsStr;
use std::time::{Duration, Instant};
use world::cell::{Cell, FORCES_PER_TICK, Setup};
use world::draw::{Calibration, draw};
use world::joint_path::{JointPath, Sample};
use world::path::tool_along;
use world::slots::Slots;
use world::workplace::workplace;

/// EGM's cycle.
const CYCLE: Duration = Duration::from_micros(4_032);
/// Cycles at rest before the robot moves, so that the correction ramps in.
const DWELL: usize = 500;
/// Tables of the cell besides its robot: the controller's force, and a compliant cut.
const TABLES: &str = "jerk_mrad_s3 = 5000.0\n[cycle]\nperiod_ms = 4.0\nstale_ms = 100.0\n\
    [wrench]\nsource = \"force\"\nprocess_stiffness_N_per_um = 0.02\n\
    [force]\nrate_Hz = 248.0\nchannels = 6\n[vibration]\nenabled = true\n";

/// Result of a run.
#[derive(Debug)]
pub struct Outcome {
    /// The tool's distance from its path, without and with the bridge, m, for every cycle on the path.
    pub errors_m: Vec<(f64, f64)>,
    /// Cycles without an answer.
    pub missed: usize,
    /// Answers that took longer than a cycle, which depends on the load of the machine.
    pub late: usize,
    /// Counters of the bridge.
    pub counted: Vec<String>,
}

impl Outcome {
    /// Mean and largest error, without and with, m.
    #[must_use]
    pub fn mean_and_largest_m(&self) -> [(f64, f64); 2] {
        let of = |pick: fn(&(f64, f64)) -> f64| {
            let errors = self.errors_m.iter().map(pick);
            let sum: f64 = errors.clone().sum();
            (sum / self.errors_m.len().max(1) as f64, errors.fold(0.0, f64::max))
        };
        [of(|error| error.0), of(|error| error.1)]
    }
}

/// Mills the demo's short path; `program` with `before` in front of its arguments is `trued`.
///
/// # Panics
/// If a part of the rig fails.
#[must_use]
pub fn run(program: &str, before: &[&str], seed: u64) -> Outcome {
    let place = TestDirectory::new("full", TABLES);
    let cell_toml = place.file("cell.toml");
    let mut arguments: Vec<&OsStr> = before.iter().map(OsStr::new).collect();
    arguments.extend(["run", "--config"].map(OsStr::new));
    arguments.push(cell_toml.as_os_str());
    let daemon = Process::start(program, &arguments, &place);
    assert!(daemon.wait_for_output("ready", PATIENCE), "{:#?}", daemon.lines());

    let mut cell = cell(seed);
    let application = socket();
    let config =
        config("off", "joints", application.local_addr().ok(), "[force]\nframe = \"tool\"\n");
    let (mut process, address) = bridge(program, before, "egm", &place, &config);
    assert!(process.wait_for_output("connected to the daemon", PATIENCE), "{:#?}", process.lines());
    let first = cell.next_command().map_or([0.0; JOINTS_MAX], |sample| sample.q);
    let mut rig = BridgeRig { robot: EgmRobot::new(address, &degrees(&first)), application };
    let mut outcome = Outcome { errors_m: Vec::new(), missed: 0, late: 0, counted: Vec::new() };
    let mut due = Instant::now();
    for k in 0..cell.ticks() {
        cycle(&mut cell, &mut rig, &mut outcome, k);
        outcome.late += usize::from(due.elapsed() > CYCLE);
        due = (due + CYCLE).max(Instant::now());
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
    process.end();
    assert!(process.wait_for_output("force samples: ", PATIENCE), "{:#?}", process.lines());
    outcome.counted = process.lines();
    outcome
}

fn cycle(cell: &mut Cell, rig: &mut BridgeRig, outcome: &mut Outcome, k: usize) {
    let Some(q_cmd) = cell.next_command().map(|sample| sample.q) else { return };
    let mut published: Joints = q_cmd;
    match rig.cycle(&degrees(&q_cmd)) {
        Some(answer) => {
            published.iter_mut().zip(&answer).for_each(|(q, deg)| *q = deg.to_radians());
        }
        None => outcome.missed += 1,
    }
    let Some(tick) = cell.step(&published) else { return };
    let force = tick.forces_tool.iter().sum::<glam::DVec3>() / FORCES_PER_TICK as f64;
    rig.robot.force = Some([force.x, force.y, force.z, 0.0, 0.0, 0.0]);
    if k >= DWELL {
        outcome.errors_m.push(tick.errors_m());
    }
}

fn degrees(q: &Joints) -> Vec<f64> {
    q[..crate::cell_loop::JOINTS].iter().map(|q| q.to_degrees()).collect()
}

/// The demo's slot, after a rest, for a robot that differs from its model by the residual error of
/// a calibration.
fn cell(seed: u64) -> Cell {
    let model = preset(crate::place::MODEL).expect("a preset of the house").model().expect("sound");
    let arm = &model.physics.arm;
    let rotation = tool_along(-glam::DVec3::Z, arm.tool.base_from_tool);
    let place = workplace(arm, rotation).expect("a place within reach");
    let slots = Slots::quick(place.point_base).tool_path(rotation).expect("a sound path");
    let path =
        JointPath::plan(arm, &slots, CYCLE.as_secs_f64(), Some(&place.q)).expect("within reach");
    let standing = std::iter::repeat_n(path.samples[0], DWELL);
    let samples = standing.chain(path.samples.iter().copied()).enumerate();
    let samples =
        samples.map(|(k, sample)| Sample { t_s: k as f64 * path.dt_s, ..sample }).collect();
    let path = JointPath { samples, ..path };
    let calibration = Calibration { model: &model.physics, sigmas: &model.sigma };
    let truth = draw(&calibration, seed).expect("a true robot");
    Cell::new(&truth, Setup::without_chatter(path, seed))
}
