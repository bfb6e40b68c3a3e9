//! Position hysteresis, building up over a distance after each reversal.
//!
//! `δθᵢ = z`, `dz/d|q| = −(z + (h/2) sign(dq))/s`    h: `amplitude`, rad or m, ≥ 0 · s: `reversal`, rad or m, > 0 · dq: the motor's
//! motion. Source: docs/reference/effects.md; the law is Dahl's, 1968. Rate-independent. With a distance below
//! the step of the data, or at settled poses, it is indistinguishable from `backlash`.
//!
//! Memory: `[u, du/ds]` with `z = h u`.

use crate::Inputs;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};
use libm::{exp, expm1};

/// Newton's method from the right on a convex function never overshoots; a test verifies that this
/// number suffices.
const STEPS: usize = 8;

/// `hysteresis` of a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteresis {
    joint: usize,
    values: [f64; 2],
}

impl Effect for Hysteresis {
    const SPEC: Spec = Spec {
        kind: "hysteresis",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Direction],
        has_memory: true,
        parameters: &[
            Parameter::linear("amplitude", Unit::Milliradian, Range::NotNegative),
            Parameter::nonlinear("reversal", Unit::Milliradian, Range::Positive),
        ],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("amplitude"), site.one("reversal")] })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        let [amplitude, _] = self.values;
        Contribution::Joint { joint: self.joint, delta: amplitude * memory.0[0] }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }

    fn derivative(&self, k: usize, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        let [amplitude, _] = self.values;
        let delta = [memory.0[0], amplitude * memory.0[1]][k];
        Contribution::Joint { joint: self.joint, delta }
    }

    fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        settle(inputs.direction[self.joint], memory);
    }

    fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
        let moved = inputs.q[self.joint] - inputs.q_before[self.joint];
        carry(moved, self.values[1], memory);
    }

    /// The motor moves by `m` so that the link moves by `d`: `d = m − c (1 − e^(−m/s))`, with c the
    /// remaining change of z.
    fn follow(&self, inputs: &Inputs, memory: &mut Memory) {
        let [amplitude, reversal] = self.values;
        let link = inputs.q[self.joint] - inputs.q_before[self.joint];
        let (sign, distance) = (if link < 0.0 { -1.0 } else { 1.0 }, link.abs());
        let left = (amplitude * (sign * memory.0[0] + 0.5)).max(0.0);
        if distance == 0.0 {
            return;
        }
        let mut motor = distance + left;
        for _ in 0..STEPS {
            let over = motor + left * expm1(-motor / reversal) - distance;
            let slope = 1.0 - left / reversal * exp(-motor / reversal);
            if slope <= 0.0 {
                break;
            }
            motor -= over / slope;
        }
        carry(sign * motor, reversal, memory);
    }
}

/// After a long move in this direction.
pub(super) fn settle(direction: f64, memory: &mut Memory) {
    memory.0 = [-0.5 * direction, 0.0, 0.0, 0.0];
}

/// The exact solution over a motion in one direction, and its derivative by the distance s, `reversal`.
pub(super) fn carry(moved: f64, reversal: f64, memory: &mut Memory) {
    if moved == 0.0 {
        return;
    }
    let end = if moved > 0.0 { -0.5 } else { 0.5 };
    let [u, by_reversal, ..] = memory.0;
    let passed = moved.abs() / reversal;
    let (gap, rest) = (u - end, exp(-passed));
    let by_reversal = (by_reversal + gap * passed / reversal) * rest;
    memory.0 = [end + gap * rest, by_reversal, 0.0, 0.0];
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::conformance::scene;
    use proptest::prelude::*;

    fn effect(amplitude: f64, reversal: f64) -> Hysteresis {
        Hysteresis { joint: 1, values: [amplitude, reversal] }
    }

    fn by(distance: f64) -> Inputs {
        let mut inputs = scene().inputs;
        inputs.q_before[1] = 0.0;
        inputs.q[1] = distance;
        inputs
    }

    fn carried(u: f64, effect: &Hysteresis, distance: f64) -> f64 {
        let mut memory = Memory([u, 0.0, 0.0, 0.0]);
        carry(distance, effect.values[1], &mut memory);
        memory.0[0]
    }

    #[test]
    fn over_its_distance_it_turns_over_by_63_percent_in_one_step_or_in_ten() {
        let effect = effect(4e-4, 5e-3);
        let wanted = 0.5 - libm::exp(-1.0);
        assert!((carried(-0.5, &effect, -5e-3) - wanted).abs() < 1e-15);
        let in_ten = (0..10).fold(-0.5, |u, _| carried(u, &effect, -5e-4));
        assert!((in_ten - wanted).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn following_the_link_is_the_inverse_of_following_the_motor(
            u in -0.5..0.5_f64, amplitude in 0.0..1e-3_f64, reversal in 1e-4..1e-2_f64, motor in -1e-2..1e-2_f64,
        ) {
            let effect = effect(amplitude, reversal);
            let expected = carried(u, &effect, motor);
            let link = motor + amplitude * (expected - u);
            // A motion within a gap that is wider than its distance first moves the link back: no
            // inverse there.
            prop_assume!(link * motor > 0.0);
            let mut memory = Memory([u, 0.0, 0.0, 0.0]);
            effect.follow(&by(link), &mut memory);
            prop_assert!((memory.0[0] - expected).abs() < 1e-9, "{} for {expected}", memory.0[0]);
        }
    }
}
