//! A cell that mills in virtual time: the daemon's own cycle, the client's own output, a compliant
//! robot, a cut whose depth varies 2:1, and a force sensor that fails on request. Every feed
//! override of the robot is checked against floor and rates.
//!
//! Robot, cut and sensor are independent of the feed's estimate. The tool moves around the first
//! axis, so that its speed is known. The force is `K depth speed`; the robot is deflected by force
//! over stiffness. 0.5 N/µm is typical of serial robots; with 250 N at full depth and the
//! programmed feed of 20 mm/s the deviation is 0.5 mm. The cutter of 10 mm radius enters another
//! depth over its radius. An override takes effect after a dead time and the controller's
//! smoothing, the force is a block's mean and is delayed: 60 ms in total.

use crate::cell_loop::{JOINTS, MIDDLE};
use crate::place::MODEL;
use crate::rng::TestRng;
use crate::simulation::run::Run;
use corrector::{Corrector, Mode};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::robot::{Link, Robot};
use daemon::sensor_inputs::MeasuredWrench;
use daemon::setup;
use physics::{Chain, JOINTS_MAX, Joints, Model};
use recording::cell::CellConfig;
use recording::model::presets::preset;
use shm_schema::{
    Command, Corrected, DaemonPorts, FeedReason, FeedState, JointBounds, PortError, RobotState,
    SendOutcome, Status,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use trued_client::{Output, Setpoint};

/// Start time of a run, ns.
const START_NS: u64 = 1 << 40;
/// Time between commands, ns.
pub const TICK_NS: u64 = 4_000_000;
/// Time after its command at which the robot's loop reads the answer, ns.
const READ_AFTER_NS: u64 = 300_000;
/// Ticks between two states of the daemon: 40 ms.
const STATUS_TICKS: usize = 10;
/// Stiffness of the robot, N/m.
pub const STIFFNESS_N_M: f64 = 0.5e6;
/// Programmed feed, m/s.
pub const PROGRAMMED_M_S: f64 = 0.02;
/// The force at full depth and the programmed feed, N.
pub const FULL_N: f64 = 250.0;
/// Length of the sections of half and full depth, after one in air, m.
const STRETCH_M: f64 = 0.1;
const AIR_M: f64 = 0.02;
const RADIUS_M: f64 = 0.01;
/// Delay of the override in the controller, ticks, and time constant of its smoothing, s.
const DEAD_TICKS: usize = 5;
const SMOOTHING_S: f64 = 0.025;
/// Delay of the force, ticks.
const SENSOR_TICKS: usize = 3;
/// Ripple of the force from one block to the next, share.
const RIPPLE: f64 = 0.03;

/// The simulated process.
#[derive(Clone, Debug)]
pub struct FeedScenario {
    /// Tables of the cell's file.
    pub tables: String,
    /// The mode at the start.
    pub mode: &'static str,
    /// The controller's own additional override, constant.
    pub constant: f64,
    /// Time limit, ticks.
    pub ticks: usize,
    /// Events by tick.
    pub events: Vec<(usize, Event)>,
    /// Seed of the ripple.
    pub seed: u64,
    /// Floor of the override for the oracle, and its rates of fall and rise, per s.
    pub bounds: [f64; 3],
    /// The model has the robot's load compliance; otherwise it is the nominal one.
    pub is_full_model: bool,
}

/// Event at a tick.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// State of the sensor from now on.
    Sensor(Sensor),
    /// The mode of the correction.
    Mode(Mode),
    /// The correction is bypassed, or released again.
    Bypass(bool),
    /// The model is loaded again.
    Reload,
    /// The daemon dies, and another one starts after this many ticks.
    Restart(usize),
    /// The program stops, or continues.
    Stop(bool),
}

/// State of the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sensor {
    /// The force.
    Good,
    /// No samples.
    Silent,
    /// The last sample repeatedly, with its old time.
    Stale,
    /// The force, from a channel that is stuck or a stream with another clock.
    Faulty,
    /// NaN.
    Nan,
    /// An implausibly large force.
    Absurd,
    /// The force, with one block in ten that is ten times as large.
    Spiky,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// Position of the tool on its path, m.
    pub at_m: f64,
    /// The process force, N.
    pub force_n: f64,
    /// Deflection of the robot by the force, m.
    pub off_m: f64,
    /// The feed override sent to the robot.
    pub feed_override: f64,
    /// State reported by the daemon.
    pub state: FeedState,
    /// Why.
    pub reason: FeedReason,
    /// The limit as a force, N.
    pub limit_n: f64,
}

impl Run<Tick> {
    /// The largest deviation, m.
    #[must_use]
    pub fn worst_m(&self) -> f64 {
        self.ticks.iter().fold(0.0, |most: f64, tick| most.max(tick.off_m))
    }

    /// Duration of the run, s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.ticks.len() as f64 * TICK_NS as f64 * 1e-9
    }

    /// Whether the tool reached the end of its path.
    #[must_use]
    pub fn is_through(&self) -> bool {
        self.ticks.last().is_some_and(|tick| tick.at_m >= length_m())
    }
}

/// The whole path, m.
fn length_m() -> f64 {
    AIR_M + 4.0 * STRETCH_M
}

/// Share of the full depth: in the air, then half and full in turn, over the cutter's radius.
fn depth(at_m: f64) -> f64 {
    let step = |from_m: f64| ((at_m - from_m) / RADIUS_M).clamp(0.0, 1.0);
    let cut = |k: f64| step(AIR_M + k * STRETCH_M);
    0.5 * (cut(0.0) + cut(1.0) - cut(2.0) + cut(3.0))
}

/// The robot with its cut and its sensor.
struct Plant {
    /// Overrides not yet effective in the interpolation, the newest last.
    under_way: VecDeque<f64>,
    constant: f64,
    /// The speed as a share of the programmed one.
    share: f64,
    at_m: f64,
    force_n: f64,
    forces: VecDeque<f64>,
    is_stopped: bool,
}

impl Plant {
    fn step(&mut self, feed_override: f64, rng: &mut TestRng) {
        let dt_s = TICK_NS as f64 * 1e-9;
        self.under_way.push_back(feed_override * self.constant);
        let taken =
            if self.under_way.len() > DEAD_TICKS { self.under_way.pop_front() } else { None };
        let requested = if self.is_stopped { 0.0 } else { taken.unwrap_or(self.share) };
        self.share += (requested - self.share) * (1.0 - (-dt_s / SMOOTHING_S).exp());
        self.at_m += self.share * PROGRAMMED_M_S * dt_s;
        self.force_n = FULL_N * depth(self.at_m) * self.share;
        let ripple = 1.0 + RIPPLE * (2.0 * rng.uniform() - 1.0);
        self.forces.push_back(self.force_n * ripple);
        while self.forces.len() > SENSOR_TICKS {
            self.forces.pop_front();
        }
    }
}

struct SimulatedLink {
    plan: FeedScenario,
    arm: Model,
    radius_m: f64,
    exchange: Arc<Exchange>,
    now_ns: u64,
    chance: TestRng,
    output: Output,
    sent: Option<Command>,
    newest: Option<Corrected>,
    plant: Plant,
    sensor: Sensor,
    last_sample: Option<MeasuredWrench>,
    before: Option<f64>,
    /// Remaining ticks without a daemon.
    away_ticks: Option<usize>,
    run: Run<Tick>,
}

/// Runs a scenario until the tool reaches the end of the path, or the time limit.
///
/// # Panics
/// On a configuration that is none.
#[must_use]
pub fn run(plan: FeedScenario) -> Run<Tick> {
    let FeedScenario { tables, mode, is_full_model, .. } = &plan;
    let text = format!(
        "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"{MODEL}\"\nmode = \"{mode}\"\nmode_max = \"full\"\n{tables}"
    );
    let config = CellConfig::parse("cell.toml", &text).expect("a configuration");
    let full = preset(MODEL).and_then(|p| p.model().ok()).expect("a preset of the house").physics;
    let model = if *is_full_model { full } else { Model::nominal(full.arm) };
    let settings = setup::settings(&config, &model.arm, false).expect("bounds");
    let mut wire = SimulatedLink::new(plan, model, &setup::bounds(&settings, &model.arm));
    let mut mode = settings.mode;
    loop {
        let exchange = Arc::new(Exchange::new(mode, false));
        wire.exchange = Arc::clone(&exchange);
        let mut cycle = Cycle {
            robot: Robot::with_link(wire),
            corrector: Corrector::new(settings),
            model: Box::new(LoadedModel::new(model, 1)),
            sensor_inputs: setup::sensor_inputs(&config, false),
            stale_ns: settings.stale_ns,
            period_ns: settings.period_ns,
            lockstep: false,
        };
        cycle.run(&exchange);
        wire = cycle.robot.link;
        let Some(away) = wire.away_ticks.take() else { return wire.run };
        mode = settings.mode;
        wire.newest = None;
        for _ in 0..away {
            wire.finish_tick();
            let _ = wire.next_command();
        }
    }
}

impl SimulatedLink {
    fn new(plan: FeedScenario, arm: Model, joint_bounds: &JointBounds) -> Self {
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&MIDDLE);
        let tool = Chain::tool_at(&arm.arm, &q).origin;
        let mut output = Output::new();
        output.set_bounds(joint_bounds);
        Self {
            arm,
            radius_m: tool.x.hypot(tool.y),
            exchange: Arc::new(Exchange::new(Mode::Full, false)),
            now_ns: START_NS,
            chance: TestRng::new(plan.seed),
            output,
            sent: None,
            newest: None,
            plant: Plant {
                under_way: VecDeque::new(),
                constant: plan.constant,
                share: 0.0,
                at_m: 0.0,
                force_n: 0.0,
                forces: VecDeque::new(),
                is_stopped: false,
            },
            sensor: Sensor::Good,
            last_sample: None,
            before: None,
            away_ticks: None,
            run: Run::default(),
            plan,
        }
    }

    /// The first joint turns by the path length over the tool's radius.
    fn q(&self) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(&MIDDLE);
        q[0] += self.plant.at_m / self.radius_m;
        q
    }

    fn status(&self) -> Status {
        let mut status = Status::default();
        self.exchange.counters.feed.write_status(&mut status);
        status
    }

    /// The robot's loop reads the answer and moves.
    fn finish_tick(&mut self) {
        let Some(sent) = self.sent else { return };
        let status = self.status();
        if self.run.ticks.len().is_multiple_of(STATUS_TICKS) && self.away_ticks.is_none() {
            self.output.set_feed_bounds(&status.feed_bounds);
        }
        let read_ns = self.now_ns + READ_AFTER_NS;
        let target = self.output.target(sent.joints(), self.newest.as_ref(), Some(&sent), read_ns);
        let feed_override = target.expect("a command of numbers").feed_override();
        self.judge(feed_override);
        self.plant.step(feed_override, &mut self.chance);
        self.run.ticks.push(Tick {
            at_m: self.plant.at_m,
            force_n: self.plant.force_n,
            off_m: self.plant.force_n / STIFFNESS_N_M,
            feed_override,
            state: status.feed_state().expect("a state"),
            reason: status.feed_reason().expect("a reason"),
            limit_n: status.feed_limit_n,
        });
    }

    /// Checks an override against its floor and rates.
    fn judge(&mut self, feed_override: f64) {
        let [floor, down_per_s, up_per_s] = self.plan.bounds;
        let dt_s = TICK_NS as f64 * 1e-9;
        let before = self.before.replace(feed_override).unwrap_or(feed_override);
        let (fallen, risen) = (before - feed_override, feed_override - before);
        let is_good = (floor..=1.0).contains(&feed_override)
            && fallen <= down_per_s * dt_s + 1e-9
            && risen <= up_per_s * dt_s + 1e-9;
        if !is_good {
            let tick = self.run.ticks.len();
            self.run.broken.get_or_insert(format!("tick {tick}: from {before} to {feed_override}"));
        }
    }

    /// A block of the sensor, as the vibration thread hands it to the cycle.
    fn sense(&mut self) {
        let Some(newest) = self.plant.forces.front().copied() else { return };
        let is_spike = self.sensor == Sensor::Spiky && self.chance.below(10) == 0;
        let newtons = match self.sensor {
            Sensor::Silent => return,
            Sensor::Nan => f64::NAN,
            Sensor::Absurd => 1e9,
            _ if is_spike => 10.0 * newest,
            _ => newest,
        };
        let late_ns = SENSOR_TICKS as u64 * TICK_NS;
        let fresh = MeasuredWrench {
            wrench: [0.6 * newtons, 0.0, 0.8 * newtons, 0.0, 0.0, 0.0],
            in_base: false,
            t_ns: self.now_ns - late_ns,
            faulty: self.sensor == Sensor::Faulty,
        };
        let sample = match (self.sensor, self.last_sample) {
            (Sensor::Stale, Some(last)) => last,
            _ => fresh,
        };
        self.last_sample = Some(sample);
        self.exchange.newest_wrench.force_push(sample);
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Sensor(sensor) => self.sensor = sensor,
            Event::Mode(mode) => self.exchange.set_mode(mode),
            Event::Bypass(bypassed) => self.exchange.bypassed.store(bypassed, Relaxed),
            Event::Reload => {
                while self.exchange.retired_models.pop().is_some() {}
                let loaded = Box::new(LoadedModel::new(self.arm, 2));
                let _ = self.exchange.next_model.push(loaded);
            }
            Event::Restart(ticks) => self.away_ticks = Some(ticks),
            Event::Stop(is_stopped) => self.plant.is_stopped = is_stopped,
        }
    }

    /// What happens at this tick, and the command of it.
    fn next_command(&mut self) -> Command {
        let tick = self.run.ticks.len();
        self.now_ns += TICK_NS;
        let due = self
            .plan
            .events
            .iter()
            .filter(|(at_tick, _)| *at_tick == tick)
            .map(|(_, event)| *event);
        let due: Vec<Event> = due.collect();
        due.into_iter().for_each(|event| self.happen(event));
        self.sense();
        let q = self.q();
        let setpoint = Setpoint::new(&q[..JOINTS]).at_ns(self.now_ns);
        let command = setpoint.command(tick as u64 + 1, 1, self.now_ns).expect("numbers");
        self.sent = Some(command);
        command
    }
}

impl Link for SimulatedLink {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_command(&mut self, _: u64) -> Option<(Command, u64)> {
        self.finish_tick();
        let is_over = self.run.is_through() || self.run.ticks.len() >= self.plan.ticks;
        if is_over || self.run.broken.is_some() {
            self.exchange.stop();
            return None;
        }
        let command = self.next_command();
        if self.away_ticks.is_some() {
            // The daemon ends before it has answered.
            self.exchange.stop();
            return None;
        }
        Some((command, self.now_ns))
    }

    fn take_state(&mut self) -> Option<RobotState> {
        None
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        self.newest = Some(*target);
        SendOutcome::Delivered
    }

    fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
        Ok(())
    }
}
