//! The simulated cell: a path, the true robot twice (uncorrected and corrected), and the cut, tick by tick.
//!
//! A tick is one joint command. The force of the cut depends on feed and direction alone, so both
//! robots are loaded by the same force; they are deflected by its mean over a revolution, since the
//! tooth passing is far above the bandwidth of an arm; chatter moves them through the structural
//! mode, not through the static compliance.
//!
//! Invariant: the same setup and targets give the same bits.

use crate::cutter::Cutter;
use crate::draw::TrueRobot;
use crate::joint_path::{JointPath, Sample};
use crate::random::{Purpose, stream};
use crate::robot::{Robot, Servo};
use crate::structural_mode::{Chatter, Mode};
use glam::{DMat3, DVec3};
use physics::{Frame, Inputs, JOINTS_MAX, Joints, Wrench};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Force samples per tick: 10 kHz at a tick of 1 ms.
pub const FORCES_PER_TICK: usize = 10;

/// Components of a cell besides the robot.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The commands; its `dt_s` is the tick.
    pub path: JointPath,
    /// The mill.
    pub cutter: Cutter,
    /// The cut with chatter, if any.
    pub chatter: Option<Chatter>,
    /// The mode that chatter excites.
    pub mode: Mode,
    /// Pure delay of the servos, in ticks.
    pub delay_ticks: usize,
    /// Lag of the servos, s.
    pub lag_s: f64,
    /// Standard deviation of the force sensor's white noise per sample and axis, N.
    pub force_noise_n: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Setup {
    /// The thesis' mill on `path`, servos without lag, 0.2 N of sensor noise, no chatter.
    pub fn without_chatter(path: JointPath, seed: u64) -> Self {
        Self {
            path,
            cutter: Cutter::default(),
            chatter: None,
            mode: Mode::at_72_hz(),
            delay_ticks: 0,
            lag_s: 0.0,
            force_noise_n: 0.2,
            seed,
        }
    }
}

/// State at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Time since the start of the path, s.
    pub t_s: f64,
    /// The command, rad or m.
    pub q_cmd: Joints,
    /// Target pose of the tool, base frame.
    pub wanted: Frame,
    /// Actual pose for the uncorrected command.
    pub uncorrected: Frame,
    /// Actual pose for the published target.
    pub corrected: Frame,
    /// Force of the cut on the tool, mean over a revolution, without chatter and noise, base axes.
    pub wrench_base: Wrench,
    /// The same in tool axes (of the target pose).
    pub wrench_tool: Wrench,
    /// Readings of the force sensor in order over the tick, each a mean over its interval, tool
    /// axes, N.
    pub forces_tool: [DVec3; FORCES_PER_TICK],
    /// The present cut (0-based); `None` in air.
    pub cut: Option<usize>,
    /// Speed along the path, m/s.
    pub feed_m_s: f64,
    /// Amplitude of the chatter, N; zero without chatter.
    pub chatter_n: f64,
}

impl Tick {
    /// Distance of the tool from its target, without and with correction, m.
    pub fn errors_m(&self) -> (f64, f64) {
        let error = |is: &Frame| (is.origin - self.wanted.origin).length();
        (error(&self.uncorrected), error(&self.corrected))
    }
}

/// A simulated cell.
#[derive(Clone, Debug)]
pub struct Cell {
    setup: Setup,
    ambient_celsius: f64,
    without: Robot,
    with: Robot,
    next: usize,
    cut: Option<usize>,
    cut_since_s: f64,
    noise: ChaCha8Rng,
}

impl Cell {
    /// A cell whose robots are at rest at the path's first command.
    pub fn new(truth: &TrueRobot, setup: Setup) -> Self {
        let start = setup.path.samples.first().map_or([0.0; JOINTS_MAX], |sample| sample.q);
        let (dt_s, delay_samples, lag_s) = (setup.path.dt_s, setup.delay_ticks, setup.lag_s);
        let servo = Servo { dt_s, delay_samples, lag_s };
        let robot = Robot::at_rest(&truth.model, servo, start, truth.ambient_celsius);
        let noise = stream(setup.seed, Purpose::ForceNoise, 0);
        Self {
            ambient_celsius: truth.ambient_celsius,
            without: robot.clone(),
            with: robot,
            next: 0,
            cut: None,
            cut_since_s: 0.0,
            noise,
            setup,
        }
    }

    /// Ambient temperature, °C, as a thermometer would report it to the daemon.
    pub const fn ambient_celsius(&self) -> f64 {
        self.ambient_celsius
    }

    /// Number of ticks of the path.
    pub fn ticks(&self) -> usize {
        self.setup.path.samples.len()
    }

    /// The command of the next tick; `None` at the end of the path.
    pub fn next_command(&self) -> Option<&Sample> {
        self.setup.path.samples.get(self.next)
    }

    /// Runs the next tick with `published` as the corrected robot's target; `None` at the end of
    /// the path.
    pub fn step(&mut self, published: &Joints) -> Option<Tick> {
        let sample = *self.next_command()?;
        self.next += 1;
        let point = sample.wanted;
        if point.cut != self.cut {
            (self.cut, self.cut_since_s) = (point.cut, sample.t_s);
        }
        let base_from_cut = cut_axes(point.direction_base, point.base_from_tool.rotation);
        let wrench_base = wrench(&sample, &self.setup.cutter);
        let force = wrench_base.force;
        self.without.follow(&sample.q, wrench_base);
        self.with.follow(published, wrench_base);
        let tool_from_base = point.base_from_tool.rotation.transpose();
        let forces_tool = self.forces(&sample, base_from_cut).map(|force| tool_from_base * force);
        let in_cut_s = sample.t_s - self.cut_since_s;
        let displacement = self.chatter_displacement(in_cut_s);
        let moved = |frame: Frame| Frame { origin: frame.origin + displacement, ..frame };
        Some(Tick {
            t_s: sample.t_s,
            q_cmd: sample.q,
            wanted: point.base_from_tool,
            uncorrected: moved(self.without.base_from_tool()),
            corrected: moved(self.with.base_from_tool()),
            wrench_base,
            wrench_tool: Wrench { force: tool_from_base * force, moment: DVec3::ZERO },
            forces_tool,
            cut: self.cut,
            feed_m_s: point.feed_m_s,
            chatter_n: self.chatter().map_or(0.0, |chatter| chatter.amplitude_n(in_cut_s)),
        })
    }

    fn chatter(&self) -> Option<&Chatter> {
        self.setup.chatter.as_ref().filter(|chatter| self.cut == Some(chatter.cut))
    }

    fn chatter_force(&self, in_cut_s: f64) -> DVec3 {
        self.chatter().map_or(DVec3::ZERO, |chatter| chatter.force_base(in_cut_s))
    }

    /// The sensor's samples over the tick, base axes, N.
    fn forces(&mut self, sample: &Sample, base_from_cut: DMat3) -> [DVec3; FORCES_PER_TICK] {
        let span = self.setup.path.dt_s / FORCES_PER_TICK as f64;
        core::array::from_fn(|i| {
            let t = sample.t_s + i as f64 * span;
            let cutting = match self.cut {
                Some(_) => self.setup.cutter.force_over(sample.wanted.feed_m_s, t, span),
                None => DVec3::ZERO,
            };
            let chatter = self.chatter_force(t + 0.5 * span - self.cut_since_s);
            let mut draw = || self.noise.sample::<f64, _>(StandardNormal);
            let noise = DVec3::new(draw(), draw(), draw()) * self.setup.force_noise_n;
            base_from_cut * cutting + chatter + noise
        })
    }

    /// Displacement of the structure by chatter at the end of the tick, base axes, m.
    fn chatter_displacement(&mut self, in_cut_s: f64) -> DVec3 {
        let span = self.setup.path.dt_s / FORCES_PER_TICK as f64;
        let mut displacement = DVec3::ZERO;
        for i in 0..FORCES_PER_TICK {
            let force = self.chatter_force(in_cut_s + (i as f64 + 0.5) * span);
            displacement = self.setup.mode.step(force, span);
        }
        displacement
    }
}

/// Force of the cut on the tool, mean over a revolution, base axes.
fn wrench(sample: &Sample, cutter: &Cutter) -> Wrench {
    let point = &sample.wanted;
    let base_from_cut = cut_axes(point.direction_base, point.base_from_tool.rotation);
    let force =
        point.cut.map_or(DVec3::ZERO, |_| base_from_cut * cutter.mean_force(point.feed_m_s));
    Wrench { force, moment: DVec3::ZERO }
}

/// Every `n`-th tick of a path as inputs of the robot, in air of `ambient_celsius`: enough to
/// assess an effect over the work.
pub fn work(path: &JointPath, cutter: &Cutter, n: usize, ambient_celsius: f64) -> Vec<Inputs> {
    let mut rows: Vec<Inputs> = Vec::new();
    for sample in path.samples.iter().step_by(n.max(1)) {
        let before = rows.last().copied().unwrap_or(Inputs::at_rest(sample.q));
        let mut inputs = Inputs { q: sample.q, q_before: before.q, ambient_celsius, ..before };
        (inputs.time_s, inputs.dt_s) = (sample.t_s, sample.t_s - before.time_s);
        inputs.wrench_base = wrench(sample, cutter);
        for (direction, (now, then)) in
            inputs.direction.iter_mut().zip(sample.q.iter().zip(&before.q))
        {
            if now != then {
                *direction = (now - then).signum();
            }
        }
        rows.push(inputs);
    }
    rows
}

/// Rotation from cut axes (feed, normal, up) to base axes; up is against the tool's z.
fn cut_axes(direction_base: DVec3, base_from_tool: DMat3) -> DMat3 {
    let up = -base_from_tool.z_axis;
    DMat3::from_cols(direction_base, up.cross(direction_base), up)
}

#[cfg(test)]
mod tests;
