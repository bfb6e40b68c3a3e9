//! Link-side joint positions assigned to the wrong joint.
//!
//! Errors of a gear are milliradians; another joint, unit or sign gives degrees. A constant offset is not an error, because encoders have their own
//! zeros. Tool measurements are not used.

use super::{REMEDY, SuspectedError, UNEXPLAINED_FRACTION};
use crate::campaign::{Campaign, Reading};
use crate::engine::statistics::median;
use physics::{Arm, JointKind};
use std::f64::consts::PI;

/// A gross error of link-side joint positions.
#[must_use]
pub fn detect_link_position_error(campaign: &Campaign, arm: &Arm) -> Option<SuspectedError> {
    let joints = 0..arm.count();
    let worst = joints
        .filter_map(|joint| Some((joint, median_deviation(campaign, joint, joint, 1.0)?)))
        .filter(|(_, deviation)| *deviation > UNEXPLAINED_FRACTION)
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (joint, before) = worst;
    let n = joint + 1;
    let others = (0..arm.count()).filter(|other| *other != joint);
    let mut remedies: Vec<(String, Option<f64>)> = others
        .map(|other| {
            let message = format!("ql{n} follows joint {}: columns are swapped", other + 1);
            (message, median_deviation(campaign, joint, other, 1.0))
        })
        .collect();
    let turned = "has the opposite sign: invert its column";
    remedies.push((
        format!("ql{n} of joint {n} {turned}"),
        median_deviation(campaign, joint, joint, -1.0),
    ));
    let units = [(PI / 180.0, "radians, but degrees"), (180.0 / PI, "degrees, but radians")];
    remedies.extend(units.map(|(factor, units)| {
        let message = format!("ql{n} of joint {n} is in {units} are stated");
        (message, median_deviation(campaign, joint, joint, factor))
    }));
    let best = remedies.into_iter().filter_map(|(message, deviation)| Some((message, deviation?)));
    let best = best.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|best| best.1 < REMEDY * before);
    let slides = arm.joints()[joint].kind == JointKind::Prismatic;
    let (size, unit) = if slides { (before * 1e3, "mm") } else { (before.to_degrees(), "degrees") };
    let (message, after) = best.unwrap_or_else(|| {
        let message = format!(
            "joint {n} was measured {size:.1} {unit} from its command, apart from its zero, and no single swapped column, unit or sign explains it: check that ql{n} belongs to it"
        );
        (message, before)
    });
    Some(SuspectedError { message, before_m: before, after_m: after })
}

/// Median absolute deviation of a joint's measurements from `factor` times the position of `followed`, after removal of the median offset, rad or m.
fn median_deviation(
    campaign: &Campaign,
    joint: usize,
    followed: usize,
    factor: f64,
) -> Option<f64> {
    let mut deviations: Vec<f64> = Vec::new();
    for pose in &campaign.poses {
        deviations.extend(pose.seen.iter().filter_map(|observation| match observation.reading {
            Reading::JointPosition { joint: measured_joint, position }
                if measured_joint == joint =>
            {
                Some(position - factor * pose.inputs.q[followed])
            }
            _ => None,
        }));
    }
    if deviations.is_empty() {
        return None;
    }
    let level = median(deviations.clone());
    deviations.iter_mut().for_each(|x| *x = (*x - level).abs());
    Some(median(deviations))
}
