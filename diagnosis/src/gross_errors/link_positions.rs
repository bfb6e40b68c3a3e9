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
        .filter(|(_, off)| *off > UNEXPLAINED_FRACTION)
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (joint, before) = worst;
    let n = joint + 1;
    let others = (0..arm.count()).filter(|other| *other != joint);
    let mut remedies: Vec<(String, Option<f64>)> = others
        .map(|other| {
            let says = format!("ql{n} follows joint {}: columns are swapped", other + 1);
            (says, median_deviation(campaign, joint, other, 1.0))
        })
        .collect();
    let turned = "has the opposite sign: invert its column";
    remedies.push((
        format!("ql{n} of joint {n} {turned}"),
        median_deviation(campaign, joint, joint, -1.0),
    ));
    let units = [(PI / 180.0, "radians, but degrees"), (180.0 / PI, "degrees, but radians")];
    remedies.extend(units.map(|(factor, says)| {
        let says = format!("ql{n} of joint {n} is in {says} are stated");
        (says, median_deviation(campaign, joint, joint, factor))
    }));
    let best = remedies.into_iter().filter_map(|(says, off)| Some((says, off?)));
    let best = best.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|best| best.1 < REMEDY * before);
    let slides = arm.joints()[joint].kind == JointKind::Prismatic;
    let (size, unit) = if slides { (before * 1e3, "mm") } else { (before.to_degrees(), "degrees") };
    let (message, after) = best.unwrap_or_else(|| {
        let says = format!(
            "joint {n} was measured {size:.1} {unit} from its command, apart from its zero, and no single swapped column, unit or sign explains it: check that ql{n} belongs to it"
        );
        (says, before)
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
    let mut off: Vec<f64> = Vec::new();
    for pose in &campaign.poses {
        off.extend(pose.seen.iter().filter_map(|seen| match seen.reading {
            Reading::JointPosition { joint: own, position } if own == joint => {
                Some(position - factor * pose.inputs.q[followed])
            }
            _ => None,
        }));
    }
    if off.is_empty() {
        return None;
    }
    let level = median(off.clone());
    off.iter_mut().for_each(|x| *x = (*x - level).abs());
    Some(median(off))
}
