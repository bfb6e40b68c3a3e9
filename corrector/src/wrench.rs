//! The force-compensation gate: use of the measured wrench in the correction.
//!
//! Correcting for a force that the correction itself increases is positive feedback: it pushes into the cut. The wrench
//! is therefore low-passed well below the first mode, ramped to zero when stale or when its sensor has a fault, and multiplied by a share that keeps the loop gain below its limit.
//! With a known process stiffness k the loop gain is `k λmax(C_tcp)`: below the limit the share goes to one, above it to zero until the
//! end of contact. Otherwise the share stops at one half, which is stable against any stiffness, since process and robot in series are
//! never stiffer than the robot (small-gain theorem; holds while the model's compliance is below twice the true one), and
//! [`LoopGainEstimator`] estimates meanwhile whether it can go to one, along the direction of the observed force, or must return to zero.
//!
//! Invariant: the share takes at least [`FADE_S`] from zero to one.

use crate::compliance;
use crate::cycle_inputs::WrenchSample;
use crate::loop_gain::{CONTACT_N, LoopGainEstimator, LoopGainVerdict};
use crate::low_pass::{LowPass, StepCoefficients};
use crate::outcome::GateState;
use crate::settings::WrenchSettings;
use glam::DVec3;
use physics::{Evaluation, Inputs, Memories, Model, Wrench};

/// How long the share takes from zero to one, s.
const FADE_S: f64 = 0.5;
/// The share that is stable for any contact.
const SAFE_SHARE: f64 = 0.5;
/// Least age of a column of the compliance before it is renewed, s: the arm hardly moves in that
/// time.
const PROBE_EVERY_S: f64 = 1e-3;

/// The filter and its gate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrenchFilter {
    filter: [LowPass; 6],
    share: f64,
    latched: bool,
    estimator: LoopGainEstimator,
    /// The model's translational compliance at the TCP, base axes, m/N; one column is renewed at a time.
    compliance: [DVec3; 3],
    column: usize,
    /// Time since a column was renewed, s.
    probed_s: f64,
    /// The largest eigenvalue of the compliance's symmetric part, m/N, once all columns are known.
    largest: Option<f64>,
    /// The wrench of the last correction, base axes.
    last: Wrench,
    loop_gain: f64,
}

impl WrenchFilter {
    pub(crate) fn new() -> Self {
        Self {
            filter: [LowPass::default(); 6],
            share: 0.0,
            latched: false,
            estimator: LoopGainEstimator::default(),
            compliance: [DVec3::ZERO; 3],
            column: 0,
            probed_s: f64::INFINITY,
            largest: None,
            last: Wrench::ZERO,
            loop_gain: f64::NAN,
        }
    }

    /// The loop gain at a share of one; NaN if unknown.
    pub(crate) fn loop_gain(&self) -> f64 {
        self.loop_gain
    }

    /// Opens a latched gate for a new trial.
    pub(crate) fn rearm(&mut self) {
        self.latched = false;
        self.estimator.rearm();
    }

    /// The wrench to be used in the correction, base axes, and the state of the gate. `measured` is
    /// in base axes and plausible.
    pub(crate) fn step(
        &mut self,
        settings: &WrenchSettings,
        measured: Option<WrenchSample>,
        dt_s: f64,
    ) -> (Wrench, GateState) {
        if !settings.enabled {
            return (Wrench::ZERO, GateState::Off);
        }
        let fresh = fresh(settings, measured);
        let filtered = self.filtered(fresh, settings.low_pass_hz, dt_s);
        let goal =
            if fresh.is_some() { self.target_share(settings, filtered.force, dt_s) } else { 0.0 };
        self.probed_s += if fresh.is_some() { dt_s } else { 0.0 };
        let most = dt_s / FADE_S;
        self.share += (goal - self.share).clamp(-most, most);
        let gate = match fresh {
            None if measured.is_none() && self.share == 0.0 => GateState::Absent,
            None => closed_state(measured),
            Some(_) if self.latched => GateState::GainTooHigh,
            Some(_) if self.share == 1.0 => GateState::Open,
            Some(_) => GateState::Partly,
        };
        self.last = self.gated(settings, &filtered);
        (self.last, gate)
    }

    /// The same for a recorded pose at rest: the wrench is used in full, because there is no
    /// feedback from a recording.
    pub(crate) fn settled(
        &self,
        settings: &WrenchSettings,
        measured: Option<WrenchSample>,
    ) -> (Wrench, GateState) {
        match fresh(settings, measured) {
            _ if !settings.enabled => (Wrench::ZERO, GateState::Off),
            Some(wrench) => (wrench, GateState::Open),
            None if measured.is_none() => (Wrench::ZERO, GateState::Absent),
            None => (Wrench::ZERO, closed_state(measured)),
        }
    }

    fn filtered(&mut self, fresh: Option<Wrench>, corner_hz: f64, dt_s: f64) -> Wrench {
        // A lost wrench keeps its last filtered value while the share goes to zero.
        if let Some(w) = fresh {
            let values = [w.force.x, w.force.y, w.force.z, w.moment.x, w.moment.y, w.moment.z];
            let coefficients = StepCoefficients::new(corner_hz, dt_s);
            for (filter, value) in self.filter.iter_mut().zip(values) {
                filter.step(value, &coefficients);
            }
        }
        let [fx, fy, fz, mx, my, mz] = self.filter.map(|f| f.output);
        Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) }
    }

    fn target_share(&mut self, settings: &WrenchSettings, force: DVec3, dt_s: f64) -> f64 {
        let Some(stiffness) = settings.process_stiffness else {
            return self.target_share_by_trial(settings, force, dt_s);
        };
        if force.length_squared() < CONTACT_N * CONTACT_N {
            self.latched = false;
        }
        let Some(compliance) = self.largest else { return 0.0 };
        self.loop_gain = stiffness * compliance;
        self.latched |= self.loop_gain >= settings.loop_gain_max;
        if self.latched { 0.0 } else { 1.0 }
    }

    fn target_share_by_trial(&mut self, settings: &WrenchSettings, force: DVec3, dt_s: f64) -> f64 {
        self.estimator.update(force, self.share, settings.low_pass_hz, dt_s);
        self.loop_gain = self.estimator.gain().unwrap_or(f64::NAN);
        self.latched = self.estimator.verdict() == LoopGainVerdict::High;
        match self.estimator.verdict() {
            LoopGainVerdict::Waiting | LoopGainVerdict::High => 0.0,
            LoopGainVerdict::Unknown => SAFE_SHARE,
            LoopGainVerdict::Low => 1.0,
        }
    }

    /// The share of the wrench; above the safe share only along the force whose loop gain was
    /// estimated.
    fn gated(&self, settings: &WrenchSettings, filtered: &Wrench) -> Wrench {
        if settings.process_stiffness.is_some() || self.share <= SAFE_SHARE {
            return filtered.times(self.share);
        }
        let along = self.estimator.direction();
        let beyond = along * (along.dot(filtered.force) * (self.share - SAFE_SHARE));
        filtered.times(SAFE_SHARE).plus(&Wrench { force: beyond, moment: DVec3::ZERO })
    }

    /// Renews one column of the model's compliance when due: the displacement of the TCP by a force
    /// along one base axis. `inputs` are those of the last correction, apart from the wrench;
    /// `scratch` belongs to the model's arm.
    pub(crate) fn probe_compliance(
        &mut self,
        model: &Model,
        inputs: &Inputs,
        memories: &Memories,
        scratch: &mut Evaluation,
    ) {
        if self.probed_s < PROBE_EVERY_S {
            return;
        }
        let loaded = Inputs { wrench_base: self.last, ..*inputs };
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][self.column];
        self.compliance[self.column] =
            compliance::compliance_along(axis, model, &loaded, memories, scratch).per_newton;
        self.probed_s = 0.0;
        self.column = (self.column + 1) % 3;
        if self.largest.is_some() || self.column == 0 {
            self.largest = Some(self.largest_compliance());
        }
    }

    /// The largest eigenvalue of the symmetric part, m/N.
    fn largest_compliance(&self) -> f64 {
        let [a, b, c] = self.compliance;
        let matrix = nalgebra::Matrix3::new(a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z);
        ((matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues().max()
    }
}

/// The wrench, unless it is too old or its sensor has a fault.
fn fresh(settings: &WrenchSettings, measured: Option<WrenchSample>) -> Option<Wrench> {
    measured
        .filter(|sample| !sample.faulty && sample.age_ns <= settings.stale_ns)
        .map(|sample| sample.wrench)
}

/// Why a wrench is not used.
fn closed_state(measured: Option<WrenchSample>) -> GateState {
    if measured.is_some_and(|sample| sample.faulty) {
        GateState::SensorFault
    } else {
        GateState::Stale
    }
}
