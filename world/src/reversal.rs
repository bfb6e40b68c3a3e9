//! Reversals of a joint between two rows of a path.
//!
//! A joint continues a little after the last row before it reverses; backlash and hysteresis depend
//! on how far. A reversal lies within the rows from which it was found; where positions show none,
//! there is none.

use physics::{Inputs, Memories, Model};
use std::ops::Range;

/// A reversal closer to its row than this, rad or m, counts as at the row.
const MIN_OVERSHOOT: f64 = 1e-6;
/// The same for a distance below this share of the step there: rounding of the rows would dominate.
const MIN_STEP_FRACTION: f64 = 0.1;

/// Advances memories from one row to the next through the positions at which joints reversed in
/// between. `about`: the row before both, both, and the row after, as far as they belong to one
/// path.
pub fn advance(model: &Model, about: [Option<&Inputs>; 4], memories: &mut Memories) {
    let [_, before, Some(now), _] = about else { return };
    let mut now = *now;
    let remembers = || model.effects().any(|effect| effect.spec().has_memory);
    if let Some(before) = before.filter(|_| remembers()) {
        for mut turn in reversals(model.arm.count(), about, before.time_s..now.time_s) {
            turn.dt_s = now.dt_s - (now.time_s - turn.time_s);
            turn.q_before = now.q_before;
            model.advance(&turn, memories);
            (now.dt_s, now.q_before) = (now.dt_s - turn.dt_s, turn.q);
        }
    }
    model.advance(&now, memories);
}

/// Reversals of joints within this time, in order, without jitter.
fn reversals(joints: usize, about: [Option<&Inputs>; 4], between_s: Range<f64>) -> Vec<Inputs> {
    let mut turns = Vec::new();
    for three in about.windows(3) {
        let [Some(before), Some(middle), Some(after)] = *three else { continue };
        let reverses = |joint: &usize| middle.direction[*joint] * after.direction[*joint] < 0.0;
        let found =
            (0..joints).filter(reverses).filter_map(|k| reversal_at([before, middle, after], k));
        turns.extend(found.filter(|turn| between_s.contains(&turn.time_s)));
    }
    turns.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    turns
}

/// The inputs at a reversal of a joint about the middle of three rows, by the parabola through
/// them; `None` if it did not reverse, or did so at the row.
#[must_use]
fn reversal_at([before, middle, after]: [&Inputs; 3], joint: usize) -> Option<Inputs> {
    let [before_turn, back] = [before, after].map(|other| other.q[joint] - middle.q[joint]);
    if before_turn * back <= 0.0 {
        return None;
    }
    let [from_s, to_s] = [before, after].map(|other| other.time_s - middle.time_s);
    let along = |[before_turn, back]: [f64; 2]| {
        let bend = (back / to_s - before_turn / from_s) / (to_s - from_s);
        [before_turn / from_s - bend * from_s, bend]
    };
    let [slope, bend] = along([before_turn, back]);
    let by_s = -0.5 * slope / bend;
    let share = by_s / if by_s < 0.0 { from_s } else { to_s };
    if !(MIN_STEP_FRACTION..=1.0 - MIN_STEP_FRACTION).contains(&share)
        || (0.5 * slope * by_s).abs() < MIN_OVERSHOOT
    {
        return None;
    }
    let value = |quantity: &dyn Fn(&Inputs) -> f64| {
        let [slope, bend] = along([before, after].map(|other| quantity(other) - quantity(middle)));
        quantity(middle) + (slope + bend * by_s) * by_s
    };
    let mut turned = *middle;
    turned.time_s = middle.time_s + by_s;
    for k in 0..turned.q.len() {
        turned.q[k] = value(&|inputs| inputs.q[k]);
        turned.velocity[k] = value(&|inputs| inputs.velocity[k]);
        turned.acceleration[k] = value(&|inputs| inputs.acceleration[k]);
    }
    Some(turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::JOINTS_MAX;

    /// Rows of `q = 1 − (t − turn)²/2`, whose speed is the distance to the reversal.
    fn rows(turn_s: f64) -> [Inputs; 3] {
        [0.0, 0.02, 0.05].map(|time_s: f64| {
            let away = time_s - turn_s;
            let mut inputs = Inputs::at_rest([1.0 - 0.5 * away * away; JOINTS_MAX]);
            (inputs.time_s, inputs.velocity) = (time_s, [-away; JOINTS_MAX]);
            inputs
        })
    }

    #[test]
    fn a_parabola_turns_at_its_height_and_stands_there() {
        for turn_s in [0.012, 0.03] {
            let rows = rows(turn_s);
            let turned = reversal_at(rows.each_ref(), 2).expect("it turns between rows");
            assert!((turned.time_s - turn_s).abs() < 1e-12 && (turned.q[2] - 1.0).abs() < 1e-12);
            assert!(turned.velocity[0].abs() < 1e-12, "{}", turned.velocity[0]);
        }
    }

    #[test]
    fn no_reversal_is_found_at_a_row_or_in_monotonic_motion_or_at_rest() {
        for turn_s in [0.0201, 0.0, 0.2] {
            assert_eq!(reversal_at(rows(turn_s).each_ref(), 0), None, "{turn_s}");
        }
        let still = rows(0.012).map(|row| Inputs { q: [0.3; JOINTS_MAX], ..row });
        assert_eq!(reversal_at(still.each_ref(), 0), None);
    }
}
