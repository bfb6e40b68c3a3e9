//! Gross errors of single targets: swapped, mirrored or wrongly scaled columns of one reflector while the others are correct.
//!
//! Requires at least two targets; errors common to all points are handled in the parent module.

use super::{GROSS, LEAST_M, workspace_radius};
use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::engine::statistics::median;
use crate::fit::{FitEffort, FitSettings, fit};
use crate::hypothesis::Hypothesis;
use crate::robust_weights::Influence;
use glam::DVec3;
use physics::Model;
use std::collections::BTreeMap;

/// Least number of measurements for a median: more than needed to locate a target.
const READINGS_LEAST: usize = 5;

/// Median error of the measurements of each target, m, with only the extrinsic parameters fitted; key `None`: tool centre point, distances and
/// touches.
pub(super) fn medians(campaign: &Campaign, model: &Model) -> BTreeMap<Option<usize>, f64> {
    let used = vec![true; campaign.poses.len()];
    let settings = FitSettings {
        used: &used,
        influence: Influence::Huber,
        from: None,
        effort: FitEffort::Sketch,
    };
    let found = fit(campaign, &Hypothesis::fixed(*model), &settings);
    let observations: Vec<_> = campaign.poses.iter().flat_map(|pose| &pose.seen).collect();
    let mut errors: BTreeMap<Option<usize>, Vec<f64>> = BTreeMap::new();
    for residual in found.residuals(campaign).iter().filter(|residual| residual.is_length) {
        let target = target_of(&observations[residual.reading].reading);
        errors.entry(target).or_default().push(residual.residual.length());
    }
    // If all targets have few measurements, they are evaluated together.
    if errors.values().all(|errors| errors.len() < READINGS_LEAST) {
        errors = BTreeMap::from([(None, errors.into_values().flatten().collect())]);
    }
    errors.retain(|_, errors| !errors.is_empty());
    let several = errors.len() > 1;
    errors.retain(|_, errors| !several || errors.len() >= READINGS_LEAST);
    errors.into_iter().map(|(target, errors)| (target, median(errors))).collect()
}

fn target_of(reading: &Reading) -> Option<usize> {
    match reading {
        Reading::Point { place: ToolPoint::Target(target), .. } => Some(*target),
        _ => None,
    }
}

/// The target with the largest median error, for users.
pub(super) fn worst(campaign: &Campaign, model: &Model) -> String {
    let medians = medians(campaign, model);
    let worst = medians.iter().max_by(|a, b| a.1.total_cmp(b.1));
    match worst {
        Some((Some(target), _)) if medians.len() > 1 => format!("target {}", target + 1),
        _ => "the tool".to_owned(),
    }
}

/// Inverse of an error in one point's columns.
type PointTransform = fn(DVec3) -> DVec3;

/// Changes of one target's columns that may correct a recording, with their descriptions.
pub(super) fn remedies(campaign: &Campaign, model: &Model) -> Vec<(String, Campaign)> {
    let medians = medians(campaign, model);
    if medians.len() < 2 {
        return Vec::new();
    }
    let gross_m = LEAST_M.max(GROSS * workspace_radius(campaign));
    let suspects = medians.into_iter().filter(|(_, deviation)| *deviation > gross_m);
    let changes: [(&str, PointTransform); 8] = [
        ("its columns x and y are swapped", |p| DVec3::new(p.y, p.x, p.z)),
        ("its columns y and z are swapped", |p| DVec3::new(p.x, p.z, p.y)),
        ("its columns x and z are swapped", |p| DVec3::new(p.z, p.y, p.x)),
        ("its x has the wrong sign", |p| DVec3::new(-p.x, p.y, p.z)),
        ("its y has the wrong sign", |p| DVec3::new(p.x, -p.y, p.z)),
        ("its z has the wrong sign", |p| DVec3::new(p.x, p.y, -p.z)),
        ("its columns are in m, but mm is stated", |p| p * 1e3),
        ("its columns are in mm, but m is stated", |p| p * 1e-3),
    ];
    let changes_of = |target: usize| {
        changes.map(|(message, change)| {
            let message = format!("only target {} has a gross error: {message}", target + 1);
            (message, with_target(campaign, target, change))
        })
    };
    suspects.filter_map(|(target, _)| target).flat_map(changes_of).collect()
}

pub(super) fn with_target(campaign: &Campaign, target: usize, change: PointTransform) -> Campaign {
    let mut changed = campaign.clone();
    for observation in changed.poses.iter_mut().flat_map(|pose| &mut pose.seen) {
        if target_of(&observation.reading) == Some(target)
            && let Reading::Point { at, .. } = &mut observation.reading
        {
            *at = change(*at);
        }
    }
    changed
}
