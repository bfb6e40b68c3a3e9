//! Order of the poses: nearest neighbour, improved by 2-opt (Croes 1958) on the duration of the moves, which the slowest joint determines. Moves are
//! not checked for collisions.

use super::arm_constraints::ArmConstraints;
use physics::{Arm, Joint, Joints};

/// Start of a tour: all joints at zero if allowed, otherwise each as near to zero as its limits permit.
#[must_use]
pub fn home(arm: &Arm, reach: &ArmConstraints) -> Joints {
    let zero = Joints::default();
    if reach.allows(arm, &zero) {
        return zero;
    }
    let mut middle = Joints::default();
    for (i, slot) in middle.iter_mut().enumerate().take(arm.count()) {
        let (low, high) = reach.limits(arm, i);
        *slot = 0.0_f64.clamp(low, high);
    }
    middle
}

/// Duration of a synchronous move, s; joints without a stated speed move at 1 rad/s or 1 m/s.
#[must_use]
pub fn time_s(arm: &Arm, from: &Joints, to: &Joints) -> f64 {
    let each = arm.joints().iter().zip(from.iter().zip(to));
    let speed = |joint: &Joint| if joint.max_speed.is_finite() { joint.max_speed } else { 1.0 };
    each.map(|(joint, (a, b))| (a - b).abs() / speed(joint)).fold(0.0, f64::max)
}

/// An order of `stops` (their indices) with short moves from `start`.
#[must_use]
pub fn visit(arm: &Arm, start: &Joints, stops: &[Joints]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..stops.len()).collect();
    let mut order = Vec::with_capacity(stops.len());
    let mut current = *start;
    while let Some(next) = (0..left.len()).min_by(|a, b| {
        time_s(arm, &current, &stops[left[*a]]).total_cmp(&time_s(arm, &current, &stops[left[*b]]))
    }) {
        let stop = left.remove(next);
        current = stops[stop];
        order.push(stop);
    }
    let stop_at = |order: &[usize], place: usize| {
        place.checked_sub(1).map_or(*start, |before| stops[order[before]])
    };
    let mut shorter = true;
    while shorter {
        shorter = false;
        for i in 0..order.len() {
            for j in i + 1..order.len() {
                let (before, first, last) = (stop_at(&order, i), stops[order[i]], stops[order[j]]);
                let after = order.get(j + 1).map(|stop| stops[*stop]);
                let tail = |end: &Joints| after.map_or(0.0, |after| time_s(arm, end, &after));
                let now = time_s(arm, &before, &first) + tail(&last);
                let turned = time_s(arm, &before, &last) + tail(&first);
                if turned < now - 1e-9 {
                    order[i..=j].reverse();
                    shorter = true;
                }
            }
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};

    #[test]
    fn a_tour_visits_all_and_is_much_shorter_than_chance() {
        let arm = nominal_robot().arm;
        let stops: Vec<Joints> =
            unmeasured_campaign(0, 40).poses.iter().map(|pose| pose.inputs.q).collect();
        let start = home(&arm, &ArmConstraints::of(&arm));
        let order = visit(&arm, &start, &stops);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..40).collect::<Vec<_>>());
        let length = |order: &[usize]| {
            let mut current = start;
            order
                .iter()
                .map(|stop| {
                    time_s(&arm, &std::mem::replace(&mut current, stops[*stop]), &stops[*stop])
                })
                .sum::<f64>()
        };
        let (tour, chance) = (length(&order), length(&(0..40).collect::<Vec<_>>()));
        assert!(tour < 0.65 * chance, "{tour} {chance}");
    }
}
