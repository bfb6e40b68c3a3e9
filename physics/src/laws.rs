//! Effects that depend only on a joint's own position and load, evaluated for all joints at once.
//!
//! Most effects of a calibrated arm are of this kind: they are summed for four joints at a time, without evaluating each effect separately.
//!
//! Equal to the sum of the separate effects, to rounding. Without memory.

use crate::deviation::{Contribution, Deviation};
use crate::lanes::Lanes;
use crate::signals::Signals;
use crate::slopes::{Slope, SlopeSums};
use crate::trig::{sin_cos, sin_cos_four};
use crate::{JOINTS_MAX, Joints};

/// Contribution of one effect to its joint's position, rad or m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Constant.
    Offset(f64),
    /// Proportional to the position.
    Ratio(f64),
    /// `amplitude · sin(cycles · q + phase)`.
    Wave {
        /// Amplitude, rad or m.
        amplitude: f64,
        /// Phase per unit of the position, rad.
        cycles: f64,
        /// Phase at position zero, rad.
        phase: f64,
    },
    /// Proportional to the load, rad/Nm or m/N.
    Compliance {
        /// For the load by gravity.
        gravity: f64,
        /// For the load by the wrench.
        wrench: f64,
        /// For the inertial load.
        inertia: f64,
    },
}

impl Law {
    /// Its contribution at `joint`, and the derivative of that.
    pub(crate) fn at(&self, joint: usize, signals: &Signals<'_>) -> (Contribution, Slope) {
        let (q, loads) = (signals.inputs.q[joint], signals.loads);
        let (delta, slope) = match *self {
            Self::Offset(offset) => (offset, Slope::Zero),
            Self::Ratio(ratio) => (ratio * q, Slope::Position(ratio)),
            Self::Wave { amplitude, cycles, phase } => {
                let (sine, cosine) = sin_cos(cycles * q + phase);
                (amplitude * sine, Slope::Position(amplitude * cycles * cosine))
            }
            Self::Compliance { gravity, wrench, inertia } => {
                let at_rest = gravity * loads.gravity_torque[joint];
                let under_wrench = at_rest + wrench * loads.wrench_torque[joint];
                let delta = under_wrench + inertia * loads.inertia_torque[joint];
                (delta, Slope::Load { gravity, wrench })
            }
        };
        (Contribution::Joint { joint, delta }, slope)
    }
}

/// Largest number of waves per joint.
const WAVES_MAX: usize = 4;

/// One wave per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
struct Waves {
    amplitude: Joints,
    cycles: Joints,
    phase: Joints,
}

/// The laws of all joints.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Laws {
    offset: Joints,
    ratio: Joints,
    pub(crate) gravity: Joints,
    pub(crate) wrench: Joints,
    inertia: Joints,
    waves: [Waves; WAVES_MAX],
    /// Number of waves per joint, and the largest of these.
    counts: [usize; JOINTS_MAX],
    max_waves: usize,
    pub(crate) is_compliant: bool,
    /// Whether every joint has the same compliance under gravity and under the wrench.
    pub(crate) is_even: bool,
}

impl Laws {
    /// Without effects.
    pub(crate) const NONE: Self = {
        let none = [0.0; JOINTS_MAX];
        let waves = [Waves { amplitude: none, cycles: none, phase: none }; WAVES_MAX];
        let (counts, max_waves, is_compliant, is_even) = ([0; JOINTS_MAX], 0, false, true);
        let (offset, ratio, gravity, wrench, inertia) = (none, none, none, none, none);
        Self {
            offset,
            ratio,
            gravity,
            wrench,
            inertia,
            waves,
            counts,
            max_waves,
            is_compliant,
            is_even,
        }
    };

    /// Adds a law of `joint`; false if there is no room for it.
    pub(crate) fn add(&mut self, joint: usize, law: &Law) -> bool {
        match *law {
            Law::Offset(offset) => self.offset[joint] += offset,
            Law::Ratio(ratio) => self.ratio[joint] += ratio,
            Law::Wave { amplitude, cycles, phase } => {
                let Some(waves) = self.waves.get_mut(self.counts[joint]) else { return false };
                waves.amplitude[joint] = amplitude;
                (waves.cycles[joint], waves.phase[joint]) = (cycles, phase);
                self.counts[joint] += 1;
                self.max_waves = self.max_waves.max(self.counts[joint]);
            }
            Law::Compliance { gravity, wrench, inertia } => {
                self.gravity[joint] += gravity;
                self.wrench[joint] += wrench;
                self.inertia[joint] += inertia;
                self.is_compliant = true;
                self.is_even &= gravity == wrench;
            }
        }
        true
    }

    /// Starts a deviation of the joints and, if requested, its derivatives.
    #[inline(always)]
    pub(crate) fn begin<S: Lanes>(
        &self,
        lanes: S,
        signals: &Signals<'_>,
        deviation: &mut Deviation,
        mut slopes: Option<&mut SlopeSums>,
    ) {
        let loads = signals.loads;
        for k in 0..S::PARTS {
            let q = lanes.part(&signals.inputs.q, k);
            let mut slope = lanes.part(&self.ratio, k);
            let mut sum = lanes.mul_add(slope, q, lanes.part(&self.offset, k));
            for (bends, load) in [
                (&self.gravity, &loads.gravity_torque),
                (&self.wrench, &loads.wrench_torque),
                (&self.inertia, &loads.inertia_torque),
            ] {
                sum = lanes.mul_add(lanes.part(bends, k), lanes.part(load, k), sum);
            }
            for waves in self.waves.iter().take(self.max_waves) {
                let amplitude = lanes.part(&waves.amplitude, k);
                let cycles = lanes.part(&waves.cycles, k);
                let angle = lanes.mul_add(cycles, q, lanes.part(&waves.phase, k));
                let (sine, cosine) = sin_cos_four(lanes, angle);
                sum = lanes.mul_add(amplitude, sine, sum);
                slope = lanes.mul_add(lanes.mul(amplitude, cycles), cosine, slope);
            }
            lanes.store(sum, &mut deviation.joints, k);
            if let Some(sums) = &mut slopes {
                lanes.store(slope, &mut sums.position, k);
            }
        }
    }
}
