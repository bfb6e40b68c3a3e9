//! Where joints turned round between rows of a path.
//!
//! A joint goes on a little after the last row before it turns; play and hysteresis remember how far. A row in between, which nobody read, says it.
//!
//! Promises: what was recorded stays as it is, readings, rows and order. Never: a turn where the recording shows none.

use physics::Inputs;

use crate::campaign::{Arrival, Campaign, Pose};
use crate::rides::paths;
use world::turn::turned;

/// Puts a pose where a joint turned round between two rows of a path. Gives which poses are held out then: the new ones with those that they come after.
pub(super) fn put_between(
    campaign: &mut Campaign,
    joints: usize,
    held_out: Option<Vec<bool>>,
) -> Option<Vec<bool>> {
    let mut turns: Vec<(usize, Pose)> = Vec::new();
    for path in paths(campaign).collect::<Vec<_>>() {
        for k in path.start + 1..path.end.saturating_sub(1) {
            let three = [k - 1, k, k + 1].map(|k| &campaign.poses[k]);
            let mut found: Vec<(usize, Pose)> = (0..joints)
                .filter(|joint| reverses(three[1], three[2], *joint))
                .filter_map(|joint| turned(three.map(|pose| &pose.inputs), joint))
                .map(|inputs| {
                    let before = if inputs.time_s < three[1].inputs.time_s { k - 1 } else { k };
                    let Pose { recording, row, .. } = campaign.poses[before];
                    let seen = Vec::new();
                    (before, Pose { inputs, arrival: Arrival::FromBefore, recording, row, seen })
                })
                .collect();
            turns.append(&mut found);
        }
    }
    turns.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.inputs.time_s.total_cmp(&b.1.inputs.time_s)));
    turns.dedup_by(|next, one| next.0 == one.0 && next.1.inputs.time_s <= one.1.inputs.time_s);
    let mut turns = turns.into_iter().peekable();
    let mut poses: Vec<Pose> = Vec::with_capacity(campaign.poses.len());
    let mut from = Vec::with_capacity(campaign.poses.len());
    let mut beside_turn = false;
    for (k, mut pose) in std::mem::take(&mut campaign.poses).into_iter().enumerate() {
        if let Some(turn) = poses.last().filter(|_| beside_turn) {
            come_from(&mut pose.inputs, &turn.inputs);
        }
        poses.push(pose);
        from.push(k);
        beside_turn = false;
        while let Some((_, mut turn)) = turns.next_if(|(before, _)| *before == k) {
            if let Some(before) = poses.last() {
                come_from(&mut turn.inputs, &before.inputs);
            }
            poses.push(turn);
            from.push(k);
            beside_turn = true;
        }
    }
    campaign.poses = poses;
    held_out.map(|held| from.into_iter().map(|k| held[k]).collect())
}

/// Whether a joint is told to turn round between two rows: what only jitters does not.
fn reverses(at: &Pose, after: &Pose, joint: usize) -> bool {
    at.inputs.direction[joint] * after.inputs.direction[joint] < 0.0
}

fn come_from(now: &mut Inputs, before: &Inputs) {
    now.q_before = before.q;
    now.dt_s = now.time_s - before.time_s;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    /// A path of 20 ms rows whose first joint swings about at these times' middles, as `arm.q0 = sin(t)`.
    fn swing(rows: usize) -> Campaign {
        let mut campaign = made::empty(0, 1);
        let first = campaign.poses[0].clone();
        campaign.recordings[0].is_path = true;
        campaign.poses = (0..rows)
            .map(|row| {
                let mut pose = first.clone();
                let t = row as f64 * 0.02;
                pose.inputs.q[0] = libm::sin(t);
                pose.inputs.direction[0] = (libm::sin(t) - libm::sin(t - 0.02)).signum();
                (pose.inputs.time_s, pose.inputs.dt_s) = (t, 0.02);
                pose.inputs.q_before[0] = libm::sin(t - 0.02);
                (pose.row, pose.arrival) = (row, Arrival::FromBefore);
                pose
            })
            .collect();
        campaign
    }

    #[test]
    fn a_swing_turns_at_its_height_though_no_row_stands_there() {
        let mut campaign = swing(500);
        let whole = campaign.clone();
        let late: Vec<bool> = (0..500).map(|row| row >= 250).collect();
        let held = put_between(&mut campaign, 6, Some(late)).unwrap_or_default();
        let new: Vec<&Pose> = campaign.poses.iter().filter(|pose| pose.seen.is_empty()).collect();
        let (first, heights) = (&whole.poses[0], new.iter().map(|pose| pose.inputs.q[0].abs()));
        assert!(first.seen.is_empty() || new.len() == 3, "three turns in 10 s: {}", new.len());
        let highest = heights.fold(0.0, f64::max);
        assert!((highest - 1.0).abs() < 1e-7, "{highest}");
        assert_eq!(campaign.poses.len(), 503);
        assert!(campaign.poses.iter().map(|pose| pose.row >= 250).eq(held));
        let way = |campaign: &Campaign| -> f64 {
            let went = |pose: &Pose| (pose.inputs.q[0] - pose.inputs.q_before[0]).abs();
            campaign.poses.iter().map(went).sum()
        };
        // Three turns, each gone up to and back from.
        assert!(way(&campaign) > way(&whole) && way(&campaign) < way(&whole) + 6.0 * 5e-5);
        let time: f64 = campaign.poses.iter().map(|pose| pose.inputs.dt_s).sum();
        assert!((time - 500.0 * 0.02).abs() < 1e-9, "{time}");
        let times = campaign.poses.windows(2);
        assert!(times.into_iter().all(|pair| pair[0].inputs.time_s < pair[1].inputs.time_s));
        assert!(campaign.poses.is_sorted_by_key(|pose| pose.row));
    }

    #[test]
    fn a_joint_that_stands_or_goes_on_turns_nowhere() {
        let mut campaign = swing(70);
        put_between(&mut campaign, 6, None);
        assert_eq!(campaign.poses.len(), 70, "up to its first height alone");
        let mut still = swing(500);
        still.poses.iter_mut().for_each(|pose| pose.inputs.direction[0] = 0.0);
        put_between(&mut still, 6, None);
        assert_eq!(still.poses.len(), 500);
    }
}
