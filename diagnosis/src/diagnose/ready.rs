//! What is done to a campaign and a model before anything is asked of them.
//!
//! Promises: what is left out is said. Never: a reading changed.

use crate::campaign::Campaign;
use crate::hypothesis::Hypothesis;
use crate::rides::paths;
use physics::{Inputs, Model};

/// Readings that are looked at, at most; of more, every so manieth.
const POSES_MAX: usize = 6000;

/// Speeds and accelerations along paths: an arm that moves is bent by its own inertia too.
pub(super) fn set_moving(campaign: &mut Campaign, joints: usize) {
    let paths: Vec<_> = paths(campaign).collect();
    for path in paths {
        let poses = &mut campaign.poses[path];
        let mut rows: Vec<Inputs> = poses.iter().map(|pose| pose.inputs).collect();
        world::forward::moving(&mut rows, joints);
        poses.iter_mut().zip(rows).for_each(|(pose, inputs)| pose.inputs = inputs);
    }
}

/// The model with what it says of its own uncertainty free so far.
pub(super) fn known(model: &Model, sigma: &[Vec<f64>]) -> Hypothesis {
    let mut known = Hypothesis::fixed(*model);
    for (effect, sigma) in sigma.iter().enumerate().filter(|(_, s)| s.iter().any(|s| *s > 0.0)) {
        let first = known.free.len();
        known.free_all(effect, &[], sigma);
        let stated = |value: usize| sigma.get(value).is_some_and(|sigma| *sigma > 0.0);
        let mut at = 0;
        known.free.retain(|free| {
            at += 1;
            at <= first || stated(free.value)
        });
    }
    known
}

/// Leaves the readings of every so manieth pose where there are very many; gives the distance of those that stay.
pub(super) fn thin(campaign: &mut Campaign, notes: &mut Vec<String>) -> usize {
    let measured = campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
    let stride = measured.div_ceil(POSES_MAX).max(1);
    if stride > 1 {
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            if k % stride > 0 {
                pose.seen.clear();
            }
        }
        notes.push(format!(
            "of {measured} rows every {stride}th was looked at; what remembers followed all of them"
        ));
    }
    stride
}
