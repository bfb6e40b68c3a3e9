//! Backlash in the gear train: the link does not move until the motor has crossed the gap.
//!
//! At settled poses `δθᵢ = −(b/2) dᵢ`; on a path the play operator: `z ← clamp(z − Δq, −b/2, b/2)`, `δθᵢ = z`.
//! b: `width`, rad or m, ≥ 0 · dᵢ: sign of the joint's last motion · z: link minus motor. Source: docs/reference/effects.md.
//! Under strong preload a real gap can stay closed on one side; this is not modelled here but by `lost_motion`.
//!
//! Memory: `[z, side]`, side the sign of z where it last touched the gap's end.

use crate::Inputs;
use crate::deviation::Contribution;
use crate::effect::{BuildError, Effect, Memory, BuildContext};
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{ActsOn, Need, Parameter, EffectScope, Range, Spec, Unit};

/// `backlash`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backlash {
    joint: usize,
    values: [f64; 1],
}

impl Effect for Backlash {
    const SPEC: Spec = Spec {
        kind: "backlash",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Direction],
        has_memory: true,
        parameters: &[Parameter::linear("width", Unit::Milliradian, Range::NotNegative)],
    };

    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError> {
        Ok(Self { joint: site.joint, values: [site.one("width")] })
    }

    of_joint!();

    fn predict(&self, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        Contribution::Joint { joint: self.joint, delta: memory.0[0] }
    }

    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Zero
    }

    /// A wider gap moves the end that z last touched; inside the gap z moves with that end.
    fn derivative(&self, _k: usize, _signals: &Signals<'_>, memory: &Memory) -> Contribution {
        Contribution::Joint { joint: self.joint, delta: 0.5 * memory.0[1] }
    }

    fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
        let side = -inputs.direction[self.joint];
        memory.0 = [0.5 * self.values[0] * side, side, 0.0, 0.0];
    }

    fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
        let half = 0.5 * self.values[0];
        let moved = inputs.q[self.joint] - inputs.q_before[self.joint];
        let carried = memory.0[0] - moved;
        let z = carried.clamp(-half, half);
        if z != carried {
            // Not the sign of z: a gap of unknown, still zero, width also has two ends.
            memory.0[1] = if carried < 0.0 { -1.0 } else { 1.0 };
        }
        memory.0[0] = z;
    }

    /// For the link to reverse at once, the motor has to cross the gap at once.
    fn follow(&self, inputs: &Inputs, memory: &mut Memory) {
        if inputs.direction[self.joint] != 0.0 {
            self.settle(inputs, memory);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::conformance::{scene, with_inputs};

    const WIDTH: f64 = 4e-4;

    fn gap() -> Backlash {
        Backlash { joint: 1, values: [WIDTH] }
    }

    fn moved(effect: &Backlash, memory: &mut Memory, from: f64, to: f64) -> f64 {
        let mut inputs = scene().inputs;
        inputs.q_before[1] = from;
        inputs.q[1] = to;
        effect.advance(&inputs, memory);
        to + memory.0[0]
    }

    #[test]
    fn the_link_stays_while_the_motor_crosses_the_gap() {
        let effect = gap();
        let mut memory = Memory::default();
        let leading = moved(&effect, &mut memory, 0.0, 0.1);
        assert!((leading - (0.1 - WIDTH / 2.0)).abs() < 1e-15, "the motor leads by half the gap");
        let inside = moved(&effect, &mut memory, 0.1, 0.1 - 0.75 * WIDTH);
        assert!((inside - leading).abs() < 1e-15, "inside the gap the link stays");
        let back = moved(&effect, &mut memory, 0.1 - 0.75 * WIDTH, 0.05);
        assert!((back - (0.05 + WIDTH / 2.0)).abs() < 1e-15, "beyond it the motor leads again");
    }

    #[test]
    fn a_gap_of_no_width_knows_which_end_it_touches() {
        let effect = Backlash { joint: 1, values: [0.0] };
        let mut memory = Memory::default();
        for (to, slope) in [(0.1, -0.5), (0.05, 0.5)] {
            moved(&effect, &mut memory, 0.07, to);
            let slope_found = with_inputs(&scene().inputs, |s| effect.derivative(0, s, &memory));
            assert_eq!(slope_found, Contribution::Joint { joint: 1, delta: slope });
        }
    }

    #[test]
    fn a_settled_pose_shows_half_the_gap_against_the_last_motion() {
        let effect = gap();
        let mut inputs = scene().inputs;
        for direction in [-1.0, 0.0, 1.0] {
            inputs.direction[1] = direction;
            let mut memory = Memory::default();
            effect.settle(&inputs, &mut memory);
            let contribution = with_inputs(&inputs, |signals| effect.predict(signals, &memory));
            let expected = Contribution::Joint { joint: 1, delta: -0.5 * WIDTH * direction };
            assert_eq!(contribution, expected);
        }
    }
}
