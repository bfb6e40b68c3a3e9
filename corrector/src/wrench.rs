//! The measured wrench on its way into the correction.
//!
//! Correcting for a force that the correction itself raises is positive feedback: it pushes into the cut. Therefore the wrench
//! is low-passed well below the first mode, fades out when stale, and enters with a share that keeps the loop gain
//! `γ = k_process · λmax(C_tcp)` below its bound: known and below, the share goes to one; known and above, to zero until the
//! contact is over; not known, to one half, which is stable against any stiffness, since process and robot in series are never
//! stiffer than the robot (small-gain theorem; holds while the model's compliance is below twice the true one).
//!
//! Promises: a change of the share takes at least [`FADE_S`] for its whole way. Never: a clock.

use crate::outcome::Gate;
use crate::settings::WrenchSettings;
use glam::DVec3;
use libm::{sqrt, tan};
use physics::{Inputs, JOINTS_MAX, Memories, Model, Wrench};

/// How long the share takes from zero to one, s.
const FADE_S: f64 = 0.5;
/// The share while the process stiffness is not known.
const SAFE_SHARE: f64 = 0.5;
/// A contact is over once the filtered force stays below this, N.
const NO_CONTACT_N: f64 = 1.0;
/// The force that probes the model's compliance, N.
const PROBE_N: f64 = 100.0;

/// A wrench as it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrenchSample {
    /// What the environment exerts on the tool, at the TCP.
    pub wrench: Wrench,
    /// In base axes; else in tool axes.
    pub in_base: bool,
    /// How old it is, ns.
    pub age_ns: u64,
}

/// What is known of the world besides the command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// The newest wrench.
    pub wrench: Option<WrenchSample>,
    /// Ambient temperature, °C; NaN where unknown.
    pub ambient_celsius: f64,
    /// Joints' temperatures, °C; NaN where unknown.
    pub joint_celsius: [f64; JOINTS_MAX],
    /// Spindle speed, rev/min; NaN where unknown.
    pub spindle_rpm: f64,
}

impl Default for World {
    fn default() -> Self {
        Self {
            wrench: None,
            ambient_celsius: f64::NAN,
            joint_celsius: [f64::NAN; JOINTS_MAX],
            spindle_rpm: f64::NAN,
        }
    }
}

/// The filter and its gate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrenchPath {
    filter: [LowPass; 6],
    share: f64,
    latched: bool,
    /// The model's translational compliance at the TCP, base axes, m/N; one column is renewed per cycle.
    compliance: [DVec3; 3],
    column: usize,
    known: bool,
    loop_gain: f64,
}

impl WrenchPath {
    pub(crate) fn new() -> Self {
        Self {
            filter: [LowPass::default(); 6],
            share: 0.0,
            latched: false,
            compliance: [DVec3::ZERO; 3],
            column: 0,
            known: false,
            loop_gain: f64::NAN,
        }
    }

    /// The estimated loop gain; NaN where the process stiffness is not known.
    pub(crate) fn loop_gain(&self) -> f64 {
        self.loop_gain
    }

    /// Lets a latched gate try again.
    pub(crate) fn rearm(&mut self) {
        self.latched = false;
    }

    /// The wrench that the correction may use, base axes, and what the gate says. `measured` is in base axes.
    pub(crate) fn step(
        &mut self,
        settings: &WrenchSettings,
        measured: Option<(Wrench, u64)>,
        dt_s: f64,
    ) -> (Wrench, Gate) {
        if !settings.enabled {
            return (Wrench::ZERO, Gate::Off);
        }
        let sound = measured.filter(|(w, _)| w.force.is_finite() && w.moment.is_finite());
        let fresh = sound.filter(|(_, age_ns)| *age_ns <= settings.stale_ns);
        let filtered = self.filtered(fresh.map(|(wrench, _)| wrench), settings.low_pass_hz, dt_s);
        let goal = if fresh.is_some() { self.goal(settings, filtered.force) } else { 0.0 };
        let most = dt_s / FADE_S;
        self.share += (goal - self.share).clamp(-most, most);
        let gate = match fresh {
            None if measured.is_none() && self.share == 0.0 => Gate::Absent,
            None => Gate::Stale,
            Some(_) if self.latched => Gate::GainTooHigh,
            Some(_) if self.share == 1.0 => Gate::Open,
            Some(_) => Gate::Partly,
        };
        (scaled(filtered, self.share), gate)
    }

    fn filtered(&mut self, fresh: Option<Wrench>, corner_hz: f64, dt_s: f64) -> Wrench {
        // A lost wrench keeps its last filtered value while the share takes it out.
        let Some(w) = fresh else { return self.held() };
        let values = [w.force.x, w.force.y, w.force.z, w.moment.x, w.moment.y, w.moment.z];
        for (filter, value) in self.filter.iter_mut().zip(values) {
            filter.step(value, corner_hz, dt_s);
        }
        self.held()
    }

    fn held(&self) -> Wrench {
        let [fx, fy, fz, mx, my, mz] = self.filter.map(|f| f.output);
        Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) }
    }

    fn goal(&mut self, settings: &WrenchSettings, force: DVec3) -> f64 {
        if sqrt(force.length_squared()) < NO_CONTACT_N {
            self.latched = false;
        }
        let Some(stiffness) = settings.process_stiffness else { return SAFE_SHARE };
        if !self.known {
            return 0.0;
        }
        self.loop_gain = stiffness * self.largest_compliance();
        self.latched |= self.loop_gain >= settings.loop_gain_max;
        if self.latched { 0.0 } else { 1.0 }
    }

    /// Renews one column of the model's compliance: how the TCP gives way to a force along one base axis.
    pub(crate) fn probe(&mut self, model: &Model, inputs: &Inputs, memories: &Memories) {
        let mut pushed = *inputs;
        let along = [DVec3::X, DVec3::Y, DVec3::Z][self.column];
        let tcp = |inputs: &Inputs| model.evaluate(inputs, memories).real.base_from_tool.origin;
        pushed.wrench_base.force = inputs.wrench_base.force + along * PROBE_N;
        let there = tcp(&pushed);
        pushed.wrench_base.force = inputs.wrench_base.force - along * PROBE_N;
        self.compliance[self.column] = (there - tcp(&pushed)) / (2.0 * PROBE_N);
        self.known |= self.column == 2;
        self.column = (self.column + 1) % 3;
    }

    /// The largest eigenvalue of the symmetric part, m/N.
    fn largest_compliance(&self) -> f64 {
        let [a, b, c] = self.compliance;
        let matrix = nalgebra::Matrix3::new(a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z);
        ((matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues().max()
    }
}

fn scaled(wrench: Wrench, share: f64) -> Wrench {
    Wrench { force: wrench.force * share, moment: wrench.moment * share }
}

/// Second-order Butterworth low pass, bilinear with prewarping, for a step that may vary.
#[derive(Clone, Copy, Debug, Default)]
struct LowPass {
    input: [f64; 2],
    past: [f64; 2],
    output: f64,
}

impl LowPass {
    fn step(&mut self, input: f64, corner_hz: f64, dt_s: f64) {
        if dt_s <= 0.0 {
            return;
        }
        let k = tan(core::f64::consts::PI * (corner_hz * dt_s).min(0.45));
        let root = core::f64::consts::SQRT_2;
        let norm = 1.0 / (1.0 + root * k + k * k);
        let gain = k * k * norm;
        let a1 = 2.0 * (k * k - 1.0) * norm;
        let a2 = (1.0 - root * k + k * k) * norm;
        let [x1, x2] = self.input;
        let [y1, y2] = self.past;
        let output = gain * (input + 2.0 * x1 + x2) - a1 * y1 - a2 * y2;
        self.input = [input, x1];
        self.past = [output, y1];
        self.output = output;
    }
}
