//! A cell with an instrument in virtual time: the daemon's own cycle, the client's own output, a
//! robot whose tool deviates from the model, and an instrument that is late, noisy, sometimes
//! blind, and jumps. The oracle checks every target of the robot.
//!
//! Robot and instrument are independent of the trim. The robot follows a target after its reaction
//! time; its tool is at the model's position plus an error unknown to the model: 1 mm along base z,
//! and a part that depends on joints 1 and 2.

use crate::cell_loop::{JOINTS, MIDDLE, TICK_NS};
use crate::oracle::Oracle;
use crate::place::MODEL;
use crate::rng::TestRng;
use crate::simulation::run::Run;
use corrector::{Corrector, Mode};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::robot::{Link, Robot};
use daemon::setup;
use glam::DVec3;
use physics::{Chain, Inputs, JOINTS_MAX, Joints, Memories, Model};
use recording::cell::CellConfig;
use recording::model::presets::preset;
use shm_schema::{
    Command, Corrected, DaemonPorts, JointBounds, MeasuredPoint, PortError, RobotState,
    SendOutcome, Status, TrimReason, TrimState,
};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use trued_client::{Output, Setpoint};

/// Start time of a run, ns.
const START_NS: u64 = 1 << 40;
/// Time after its command at which the robot's loop reads the answer, ns.
const READ_AFTER_NS: u64 = 300_000;

/// Simulated properties of instrument and robot.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedErrors {
    /// Delay from a measurement to its arrival, ms.
    pub latency_ms: u64,
    /// Interval between two measurements, ms.
    pub interval_ms: u64,
    /// Reaction time of the tool to a target, ms.
    pub reaction_ms: u64,
    /// Whether the instrument stamps its measurements.
    pub stamps: bool,
    /// Standard deviation of each axis, m.
    pub noise_m: f64,
    /// Share of the measurements that are lost.
    pub dropouts: f64,
    /// Share of the measurements that are off by 1 mm.
    pub jumps: f64,
    /// Amplitude of the joints' oscillation about their middle, rad, with the period `period_s`.
    pub swing_rad: f64,
    /// Period of the oscillation, s.
    pub period_s: f64,
}

impl SimulatedErrors {
    /// 20 ms late, 100 Hz, 0.02 mm of noise, 10 % dropouts, jumps of 1 mm; the robot is at rest.
    #[must_use]
    pub const fn stated() -> Self {
        Self {
            latency_ms: 20,
            interval_ms: 10,
            reaction_ms: 10,
            stamps: true,
            noise_m: 2e-5,
            dropouts: 0.1,
            jumps: 0.02,
            swing_rad: 0.0,
            period_s: 8.0,
        }
    }
}

/// Event at a tick.
#[derive(Clone, Copy, Debug)]
pub enum Event {
    /// The beam is interrupted, or restored.
    Blind(bool),
    /// The instrument's coordinates shift along y, m.
    Shift(f64),
    /// The mode of the correction.
    Mode(Mode),
    /// The correction is bypassed, or released again.
    Bypass(bool),
    /// Armed: the registration counts as checked.
    Arm,
    /// The model is loaded again.
    Reload,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// Position error of the tool, base frame, m.
    pub off_m: DVec3,
    /// State of the trim.
    pub state: TrimState,
    /// Why.
    pub reason: TrimReason,
    /// The trim, base frame, m.
    pub trim_m: DVec3,
    /// Its estimate of the model's error, base frame, m.
    pub found_m: DVec3,
    /// Measurements received and refused.
    pub counts: [u64; 2],
}

impl Run<Tick> {
    /// The largest error of a range of ticks, m.
    #[must_use]
    pub fn worst_m(&self, ticks: std::ops::Range<usize>) -> f64 {
        self.ticks[ticks].iter().fold(0.0, |most: f64, tick| most.max(tick.off_m.length()))
    }

    /// Its root mean square, m.
    #[must_use]
    pub fn rms_m(&self, ticks: std::ops::Range<usize>) -> f64 {
        let count = ticks.len() as f64;
        let sum: f64 = self.ticks[ticks].iter().map(|tick| tick.off_m.length_squared()).sum();
        (sum / count).sqrt()
    }
}

struct SimulatedLink {
    truth: SimulatedErrors,
    model: Model,
    bounds: JointBounds,
    exchange: Arc<Exchange>,
    events: Vec<(usize, Event)>,
    ticks: usize,
    now_ns: u64,
    chance: TestRng,
    output: Output,
    oracle: Oracle,
    sent: Option<Command>,
    newest: Option<Corrected>,
    /// Targets and commands of the last milliseconds, the newest last.
    moves: VecDeque<(Joints, Joints)>,
    memories: Memories,
    under_way: VecDeque<(u64, MeasuredPoint)>,
    measured: u64,
    is_blind: bool,
    shift_m: f64,
    run: Run<Tick>,
}

/// Runs a number of ticks of a cell with these tables in its configuration.
///
/// # Panics
/// On an invalid configuration.
#[must_use]
pub fn run(
    tables: &str,
    truth: SimulatedErrors,
    ticks: usize,
    events: Vec<(usize, Event)>,
    seed: u64,
) -> Run<Tick> {
    let text = format!(
        "schema = \"trued.cell/1\"\ncell = \"cell\"\nmodel = \"{MODEL}\"\nmode = \"full\"\n{tables}"
    );
    let config = CellConfig::parse("cell.toml", &text).expect("a configuration");
    let model = preset(MODEL).and_then(|p| p.model().ok()).expect("a preset of the house").physics;
    let settings = setup::settings(&config, &model.arm, false).expect("bounds");
    let bounds = setup::bounds(&settings, &model.arm);
    let exchange = Arc::new(Exchange::new(settings.mode, false));
    let mut output = Output::new();
    output.set_bounds(&bounds);
    let wire = SimulatedLink {
        truth,
        model,
        bounds,
        exchange: Arc::clone(&exchange),
        events,
        ticks,
        now_ns: START_NS,
        chance: TestRng::new(seed),
        output,
        oracle: Oracle::new(&bounds, 0.0),
        sent: None,
        newest: None,
        moves: VecDeque::new(),
        memories: Memories::default(),
        under_way: VecDeque::new(),
        measured: 0,
        is_blind: false,
        shift_m: 0.0,
        run: Run::default(),
    };
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
    cycle.robot.link.run
}

impl SimulatedLink {
    fn command(&self) -> Joints {
        let turns = self.now_ns.saturating_sub(START_NS) as f64 * 1e-9 / self.truth.period_s;
        let mut q = [0.0; JOINTS_MAX];
        for (i, middle) in MIDDLE.iter().enumerate() {
            // From rest: cosines.
            let swing = 1.0 - (std::f64::consts::TAU * turns).cos();
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            q[i] = middle + side * self.truth.swing_rad * swing;
        }
        q
    }

    /// The robot's loop reads the answer, the tool moves, the instrument measures.
    fn finish_tick(&mut self) {
        let Some(sent) = self.sent else { return };
        let q_cmd = self.command_of(&sent);
        let read_ns = self.now_ns + READ_AFTER_NS;
        let target =
            self.output.target(&q_cmd[..JOINTS], self.newest.as_ref(), Some(&sent), read_ns);
        let target = target.expect("a command of numbers");
        if let Err(violation) =
            self.oracle.take(read_ns, sent.t_ns, &q_cmd[..JOINTS], target.joints())
        {
            let tick = self.run.ticks.len();
            self.run.broken.get_or_insert(format!("tick {tick}: {violation}"));
        }
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(target.joints());
        self.moves.push_back((q, q_cmd));
        while self.moves.len() as u64 > self.truth.reaction_ms + 1 {
            self.moves.pop_front();
        }
        self.move_tool();
    }

    fn command_of(&self, sent: &Command) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q[..JOINTS].copy_from_slice(sent.joints());
        q
    }

    fn move_tool(&mut self) {
        let (q, q_cmd) = *self.moves.front().expect("one at least");
        let inputs = Inputs::at_rest(q);
        self.model.settle(&inputs, &mut self.memories);
        let by_model = self.model.evaluate(&inputs, &self.memories).real.base_from_tool.origin;
        let unknown_m = 1e-3 * DVec3::new(0.8 * (2.0 * q[0]).sin(), 1.5 * q[1] * q[1], 1.0);
        let tool_m = by_model + unknown_m;
        let should_m = Chain::tool_at(&self.model.arm, &q_cmd).origin;
        let mut status = Status::default();
        self.exchange.counters.trim.write_status(&mut status);
        self.run.ticks.push(Tick {
            off_m: tool_m - should_m,
            state: status.trim_state().expect("a state"),
            reason: status.trim_reason().expect("a reason"),
            trim_m: DVec3::from_array(status.trim_m),
            found_m: DVec3::from_array(status.trim_found_m),
            counts: [status.trim_measurements, status.trim_refused],
        });
        if self.run.ticks.len().is_multiple_of(self.truth.interval_ms as usize) {
            self.measure(tool_m);
        }
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.chance.uniform()).sum::<f64>() - 6.0
    }

    fn measure(&mut self, tool_m: DVec3) {
        let noise = [(); 3].map(|()| self.normal());
        let lost = self.chance.uniform() < self.truth.dropouts;
        let jump_m = if self.chance.uniform() < self.truth.jumps { 1e-3 } else { 0.0 };
        if lost || self.is_blind {
            return;
        }
        self.measured += 1;
        let off_m = self.truth.noise_m * DVec3::from_array(noise);
        let point_m = tool_m + off_m + DVec3::new(jump_m, self.shift_m, 0.0);
        let arrives_ns = self.now_ns + self.truth.latency_ms * TICK_NS;
        let message = MeasuredPoint {
            seq: self.measured,
            session: 1,
            t_ns: self.now_ns,
            sent_ns: arrives_ns,
            flags: if self.truth.stamps { MeasuredPoint::HAS_TIME } else { 0 },
            point_m: point_m.to_array(),
            ..MeasuredPoint::default()
        };
        self.under_way.push_back((arrives_ns, message));
    }

    fn happen(&mut self, event: Event) {
        match event {
            Event::Blind(is_blind) => self.is_blind = is_blind,
            Event::Shift(by_m) => self.shift_m += by_m,
            Event::Mode(mode) => {
                self.exchange.set_mode(mode);
                let mut bounds = self.bounds;
                let share = mode.angle_share().unwrap_or(1.0);
                bounds.angle.iter_mut().for_each(|angle| *angle *= share);
                self.oracle.set_shadow(self.now_ns, mode == Mode::Shadow);
                self.oracle.set_bounds(self.now_ns, &bounds);
                self.output.set_bounds(&bounds);
            }
            Event::Bypass(bypassed) => self.exchange.bypassed.store(bypassed, Relaxed),
            Event::Arm => self.exchange.rearm_instrument.store(true, Relaxed),
            Event::Reload => {
                while self.exchange.retired_models.pop().is_some() {}
                let loaded = Box::new(LoadedModel::new(self.model, 2));
                let _ = self.exchange.next_model.push(loaded);
            }
        }
    }
}

impl Link for SimulatedLink {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_command(&mut self, _: u64) -> Option<(Command, u64)> {
        self.finish_tick();
        let tick = self.run.ticks.len();
        if tick >= self.ticks || self.run.broken.is_some() {
            self.exchange.stop();
            return None;
        }
        self.now_ns += TICK_NS;
        let due: Vec<Event> = self
            .events
            .iter()
            .filter(|(at_tick, _)| *at_tick == tick)
            .map(|(_, event)| *event)
            .collect();
        due.into_iter().for_each(|event| self.happen(event));
        let q = self.command();
        let setpoint = Setpoint::new(&q[..JOINTS]).at_ns(self.now_ns);
        let command = setpoint.command(tick as u64 + 1, 1, self.now_ns).expect("numbers");
        self.sent = Some(command);
        Some((command, self.now_ns))
    }

    fn take_state(&mut self) -> Option<RobotState> {
        None
    }

    fn take_measured(&mut self) -> Option<MeasuredPoint> {
        self.under_way.front().filter(|(at_ns, _)| *at_ns <= self.now_ns)?;
        self.under_way.pop_front().map(|(_, message)| message)
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        self.newest = Some(*target);
        SendOutcome::Delivered
    }

    fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
        Ok(())
    }
}
