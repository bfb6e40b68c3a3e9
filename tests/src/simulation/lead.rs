//! A cell with lead compensation in motion, in virtual time: the daemon's cycle, the client's
//! output, a path whose next setpoints are known. The oracle checks every target sent to the robot;
//! the robot's response is simulated by the caller.

use crate::cell_loop::JOINTS;
use crate::oracle::Oracle;
use crate::rng::TestRng;
use corrector::{Corrector, Mode};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::robot::{Link, Robot};
use daemon::setup;
use physics::{JOINTS_MAX, Joints};
use recording::cell::CellConfig;
use recording::model::RobotModel;
use shm_schema::{
    Command, Corrected, DaemonPorts, Horizon, JointBounds, LeadState, PortError, RobotState,
    SendOutcome, Status,
};
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use trued_client::{Output, Setpoint};

const START_NS: u64 = 1 << 40;
/// Time after its command at which the robot's loop reads the answer, ns.
const READ_AFTER_NS: u64 = 300_000;

/// Random faults of the cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct RandomFaults {
    /// Share of lost commands.
    pub lost: f64,
    /// Share of the ticks at which something changes: mode, bypass, model, the length of the horizon, a horizon of another path, the client's session.
    pub changes: f64,
}

/// Result of a run.
#[derive(Debug, Default)]
pub struct Outcome {
    /// The targets sent to the robot, row by row.
    pub sent: Vec<Joints>,
    /// The violated rule, as text.
    pub broken: Option<String>,
    /// Number of ticks in each state of the lead compensation, by its code.
    pub states: [usize; 5],
    /// Horizons that a command differed from.
    pub horizons_refused: u32,
}

struct SimulatedLink<'a> {
    path: &'a [Joints],
    period_ns: u64,
    known: usize,
    trouble: RandomFaults,
    chance: TestRng,
    models: [RobotModel; 2],
    config: CellConfig,
    bounds: JointBounds,
    exchange: Arc<Exchange>,
    now_ns: u64,
    row: usize,
    session: u64,
    is_elsewhere: bool,
    output: Output,
    oracle: Oracle,
    sent: Option<Command>,
    newest: Option<Corrected>,
    outcome: Outcome,
}

/// Runs a path through a cell with these tables of its configuration; at each command the next `known` setpoints are known. `models` are loaded in turn.
///
/// # Panics
/// On a configuration that is none.
#[must_use]
pub fn run(
    tables: &str,
    models: [RobotModel; 2],
    path: &[Joints],
    known: usize,
    trouble: RandomFaults,
    seed: u64,
) -> Outcome {
    let text = format!(
        "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"model.toml\"\nmode = \"full\"\n{tables}"
    );
    let config = CellConfig::parse("cell.toml", &text).expect("a configuration");
    let arm = models[0].physics.arm;
    let settings = setup::settings(&config, &arm, false).expect("bounds");
    let bounds = setup::bounds(&settings, &arm);
    let exchange = Arc::new(Exchange::new(settings.mode, false));
    let mut output = Output::new();
    output.set_bounds(&bounds);
    let filter =
        setup::lead(&config, settings.jump_margin).and_then(|lead| lead.filter(&models[0]));
    let model = Box::new(LoadedModel { filter, ..LoadedModel::new(models[0].physics, 1) });
    let sensor_inputs = setup::sensor_inputs(&config, false);
    let wire = SimulatedLink {
        path,
        period_ns: settings.period_ns,
        known,
        trouble,
        chance: TestRng::new(seed),
        models,
        config,
        bounds,
        exchange: Arc::clone(&exchange),
        now_ns: START_NS,
        row: 0,
        session: 1,
        is_elsewhere: false,
        output,
        oracle: Oracle::new(&bounds, 0.0),
        sent: None,
        newest: None,
        outcome: Outcome::default(),
    };
    let mut cycle = Cycle {
        robot: Robot::with_link(wire),
        corrector: Corrector::new(settings),
        model,
        sensor_inputs,
        stale_ns: settings.stale_ns,
        period_ns: settings.period_ns,
        lockstep: false,
    };
    cycle.run(&exchange);
    cycle.robot.link.outcome
}

impl SimulatedLink<'_> {
    /// The robot's loop takes what there is.
    fn finish_tick(&mut self) {
        let Some(sent) = self.sent.take() else { return };
        let read_ns = self.now_ns + READ_AFTER_NS;
        let target = self.output.target(sent.joints(), self.newest.as_ref(), Some(&sent), read_ns);
        let target = target.expect("a command of numbers");
        let judged = self.oracle.take(read_ns, sent.t_ns, sent.joints(), target.joints());
        if let Err(violation) = judged {
            let row = self.row;
            self.outcome.broken.get_or_insert(format!("row {row}: {violation}"));
        }
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(target.joints());
        self.outcome.sent.push(q);
        let mut status = Status::default();
        self.exchange.counters.lead.write_status(&mut status);
        self.outcome.states[status.lead_state as usize] += 1;
        self.outcome.horizons_refused = status.horizons_refused;
    }

    fn change(&mut self) {
        match self.chance.below(6) {
            0 => {
                let drawn = self.chance.below(3) as usize;
                self.set_mode([Mode::Shadow, Mode::Limited, Mode::Full][drawn]);
            }
            1 => self.exchange.bypassed.store(self.chance.below(2) == 0, Relaxed),
            2 => self.reload(),
            3 => self.known = self.chance.below(Horizon::POINTS_MAX as u64 + 1) as usize,
            4 => self.is_elsewhere = !self.is_elsewhere,
            _ => self.session += 1,
        }
    }

    fn set_mode(&mut self, mode: Mode) {
        self.exchange.set_mode(mode);
        let mut bounds = self.bounds;
        let share = mode.angle_share().unwrap_or(1.0);
        bounds.angle.iter_mut().for_each(|angle| *angle *= share);
        self.oracle.set_shadow(self.now_ns, mode == Mode::Shadow);
        self.oracle.set_bounds(self.now_ns, &bounds);
        self.output.set_bounds(&bounds);
    }

    fn reload(&mut self) {
        while self.exchange.retired_models.pop().is_some() {}
        self.models.swap(0, 1);
        let filter = setup::lead(&self.config, 2.0).and_then(|lead| lead.filter(&self.models[0]));
        let loaded = LoadedModel { filter, ..LoadedModel::new(self.models[0].physics, 2) };
        let _ = self.exchange.next_model.push(Box::new(loaded));
    }

    fn seq(&self) -> u64 {
        self.row as u64
    }
}

impl Link for SimulatedLink<'_> {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_command(&mut self, _: u64) -> Option<(Command, u64)> {
        self.finish_tick();
        if self.row >= self.path.len() || self.outcome.broken.is_some() {
            self.exchange.stop();
            return None;
        }
        self.now_ns += self.period_ns;
        if self.chance.uniform() < self.trouble.changes {
            self.change();
        }
        let q = self.path[self.row];
        self.row += 1;
        let setpoint = Setpoint::new(&q[..JOINTS]).at_ns(self.now_ns);
        let command = setpoint.command(self.seq(), self.session, self.now_ns).expect("numbers");
        self.sent = Some(command);
        if self.chance.uniform() < self.trouble.lost {
            return None;
        }
        Some((command, self.now_ns))
    }

    fn take_state(&mut self) -> Option<RobotState> {
        None
    }

    fn take_horizon(&mut self, into: &mut Horizon) -> bool {
        if self.known == 0 {
            return false;
        }
        let following = &self.path[self.row.min(self.path.len())..];
        let count = following.len().min(self.known).min(Horizon::POINTS_MAX);
        into.points[..count].copy_from_slice(&following[..count]);
        if self.is_elsewhere {
            into.points[..count].iter_mut().for_each(|q| q[0] += 0.05);
        }
        (into.session, into.command_seq) = (self.session, self.seq());
        (into.layout, into.count) = (Horizon::default().layout, count as u32);
        true
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        self.newest = Some(*target);
        SendOutcome::Delivered
    }

    fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
        Ok(())
    }
}

impl Outcome {
    /// Ticks in a state.
    #[must_use]
    pub fn ticks_in(&self, state: LeadState) -> usize {
        self.states[state.code() as usize]
    }
}
