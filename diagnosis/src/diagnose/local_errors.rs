//! Errors of a joint near certain positions of its own: a worn tooth, a dent in a guide, a damaged spot of an encoder. They are too narrow for polynomials
//! over the joint's range.
//!
//! The error is modelled as a sum of Gaussian bumps over the position, added one at a time (matching pursuit, Mallat and Zhang 1993). Sums over bins of the
//! position screen centres and widths; the best few are evaluated by the score test beside the fit.

use crate::score_test::{ColumnGroups, ScoreTest};
use crate::tool_motion::ToolMotion;
use physics::Chain;
use std::cell::Cell;

/// Which bumps are tried.
struct Settings {
    /// Standard deviations of a bump as shares of the joint's range in the recording; above 0, below ½. Default: octaves from 1/8, above which polynomials of
    /// the fifth degree describe the error, to 1/256.
    width_shares: [f64; 6],
    /// Distance of the centres of a width, in standard deviations; above 0. Default 0.5: between two centres the gain is at least 0.98 of that at the best.
    centre_step_sigmas: f64,
    /// Least number of values within a standard deviation of the centre; 1 or more. Default 6: fewer may be gross errors.
    values_min: usize,
    /// Largest number of bumps of a joint; 1 or more. Default 6: as many parameters as a polynomial.
    bumps_max: usize,
    /// Standard deviation of the prior of the height of a bump, rad or m; above 0. Default 5e-3, as of the coefficients of polynomials.
    height_sigma: f64,
}

const SETTINGS: Settings = Settings {
    width_shares: [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0, 1.0 / 128.0, 1.0 / 256.0],
    centre_step_sigmas: 0.5,
    values_min: 6,
    bumps_max: 6,
    height_sigma: 5e-3,
};

/// Bins of a joint's range: four per standard deviation of the narrowest bump.
const BINS: usize = 1024;
/// A bump is evaluated up to this many standard deviations, where it is below 1/2000.
const REACH_SIGMAS: f64 = 4.0;
/// Distance from the centre at which a bump is a tenth of its height, in standard deviations.
const TENTH_SIGMAS: f64 = 2.146;
/// Refined centres, in standard deviations from the best of the screening, and widths as multiples of its width.
const CENTRES: [f64; 5] = [-0.5, -0.25, 0.0, 0.25, 0.5];
const WIDTHS: [f64; 3] = [0.7, 1.0, 1.4];
/// Refinements, each by steps half as large as the one before: the last changes centre and width by a few per cent.
const REFINEMENTS: i32 = 4;

/// A Gaussian bump over the position of a joint, of height one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bump {
    /// Position of the joint at its centre, rad or m.
    pub(super) centre: f64,
    /// Its standard deviation, rad or m.
    pub(super) width: f64,
}

impl Bump {
    /// Its value at a position of the joint, 0 to 1.
    pub(super) fn at(&self, position: f64) -> f64 {
        let deviate = (position - self.centre) / self.width;
        if deviate.abs() > REACH_SIGMAS { 0.0 } else { (-0.5 * deviate * deviate).exp() }
    }
}

/// Limits of the section of the joint's range in which a sum of bumps is more than a tenth of its peaks, and the largest error at their centres.
pub(super) fn extent(bumps: &[Bump], heights: &[f64]) -> ([f64; 2], f64) {
    let reach = |bump: &Bump| TENTH_SIGMAS * bump.width;
    let low = bumps.iter().map(|bump| bump.centre - reach(bump)).fold(f64::INFINITY, f64::min);
    let high = bumps.iter().map(|bump| bump.centre + reach(bump)).fold(f64::NEG_INFINITY, f64::max);
    let at = |q: f64| -> f64 {
        bumps.iter().zip(heights).map(|(bump, height)| height * bump.at(q)).sum()
    };
    let largest = bumps.iter().map(|bump| at(bump.centre).abs()).fold(0.0, f64::max);
    ([low, high], largest)
}

/// A sum of bumps of one joint.
#[derive(Clone, Debug)]
pub(super) struct LocalErrors {
    /// The joint, from 0.
    pub(super) joint: usize,
    pub(super) bumps: Vec<Bump>,
    /// Height of each bump, rad or m.
    pub(super) heights: Vec<f64>,
    /// Reduction of the sum of squares less the penalty.
    pub(super) improvement: f64,
}

/// The sum of bumps with the best criterion. `penalty`: of the sum of squares, by the number of bumps tried at each step and the number of bumps chosen.
pub(super) fn best(
    fitted: &ScoreTest<'_>,
    penalty: impl Fn(usize, usize) -> f64,
) -> Option<LocalErrors> {
    let ranges = joint_ranges(fitted);
    let (starts, tried) = screen(fitted, &ranges, None);
    let first: Vec<(usize, Vec<Bump>)> =
        starts.into_iter().map(|(joint, bump)| (joint, vec![bump])).collect();
    let penalty = |count| penalty(tried, count);
    let mut best = refined(fitted, best_of(fitted, &first, penalty)?, penalty);
    while best.bumps.len() < SETTINGS.bumps_max {
        let (starts, _) = screen(fitted, &ranges, Some(&best));
        let further = starts.into_iter().map(|(joint, bump)| {
            let bumps = best.bumps.iter().copied().chain([bump]).collect();
            (joint, bumps)
        });
        let Some(next) = best_of(fitted, &further.collect::<Vec<_>>(), penalty) else { break };
        let next = refined(fitted, next, penalty);
        if next.improvement <= best.improvement {
            break;
        }
        best = next;
    }
    Some(best)
}

/// Lowest and highest position of each joint on the poses used, rad or m; `None` for joints that do not move.
fn joint_ranges(fitted: &ScoreTest<'_>) -> Vec<Option<[f64; 2]>> {
    let poses = fitted.campaign.poses.iter().zip(&fitted.weighing.used);
    let positions = |joint: usize| {
        let used = poses.clone().filter(|(_, used)| **used).map(|(pose, _)| pose.inputs.q[joint]);
        used.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| [low.min(q), high.max(q)])
    };
    let joints = fitted.state.hypothesis.model.arm.count();
    (0..joints).map(positions).map(|range| Some(range).filter(|[low, high]| high > low)).collect()
}

/// Sums over the rows whose joint position is in one bin: of squared derivatives by the joint, and of their products with the residual.
#[derive(Clone, Copy, Default)]
struct Bin {
    squares: f64,
    products: f64,
    values: usize,
}

/// The best bump of each width for each joint, or for the joint of `beside`, whose bumps are subtracted from the residual; and the number of bumps tried.
fn screen(
    fitted: &ScoreTest<'_>,
    ranges: &[Option<[f64; 2]>],
    beside: Option<&LocalErrors>,
) -> (Vec<(usize, Bump)>, usize) {
    let joints: Vec<(usize, [f64; 2])> = ranges
        .iter()
        .enumerate()
        .filter(|(joint, _)| beside.is_none_or(|beside| beside.joint == *joint))
        .filter_map(|(joint, range)| Some((joint, (*range)?)))
        .collect();
    let bins = binned(fitted, &joints, beside);
    let (mut best, mut tried) = (Vec::new(), 0);
    for ((joint, [low, high]), bins) in joints.iter().zip(&bins) {
        let range = high - low;
        for share in SETTINGS.width_shares {
            let width = share * range;
            let count = (1.0 / (SETTINGS.centre_step_sigmas * share)) as usize;
            let bump = |k: usize| Bump {
                centre: low + k as f64 * SETTINGS.centre_step_sigmas * width,
                width,
            };
            let gains = (0..=count).filter_map(|k| Some((k, gain(&bump(k), *low, range, bins)?)));
            tried += count + 1;
            if let Some((k, _)) = gains.max_by(|a, b| a.1.total_cmp(&b.1)) {
                best.push((*joint, bump(k)));
            }
        }
    }
    (best, tried)
}

/// The sums of each bin of each joint, given with its range.
fn binned(
    fitted: &ScoreTest<'_>,
    joints: &[(usize, [f64; 2])],
    beside: Option<&LocalErrors>,
) -> Vec<Vec<Bin>> {
    let mut bins = vec![vec![Bin::default(); BINS]; joints.len()];
    let arm = &fitted.state.hypothesis.model.arm;
    let poses = &fitted.campaign.poses;
    let now = Cell::new(0);
    let motions = |pose: usize, into: &mut Vec<ToolMotion>| {
        now.set(pose);
        let chain = Chain::nominal(arm, &poses[pose].inputs.q);
        into.extend(joints.iter().map(|(joint, _)| ToolMotion::of_joint(arm, &chain, *joint)));
    };
    fitted.rows(joints.len(), motions, |_, along, left| {
        let q = &poses[now.get()].inputs.q;
        let mut left = left;
        if let Some(beside) = beside {
            let error = beside.bumps.iter().zip(&beside.heights);
            let error: f64 = error.map(|(bump, height)| height * bump.at(q[beside.joint])).sum();
            left -= error * along[0];
        }
        for (((joint, [low, high]), bins), along) in joints.iter().zip(&mut bins).zip(along) {
            let place = (q[*joint] - low) / (high - low) * BINS as f64;
            let bin = &mut bins[(place as usize).min(BINS - 1)];
            bin.squares += along * along;
            bin.products += along * left;
            bin.values += usize::from(*along != 0.0);
        }
    });
    bins
}

/// Reduction of the sum of squares by a bump alone; `None` if too few values are near it. `low`, `range`: of the joint's position.
fn gain(bump: &Bump, low: f64, range: f64, bins: &[Bin]) -> Option<f64> {
    let bin_width = range / BINS as f64;
    let reach = |sigmas: f64| {
        let bin = |offset: f64| ((bump.centre + offset - low) / bin_width).max(0.0) as usize;
        bin(-sigmas * bump.width).min(BINS)..(bin(sigmas * bump.width) + 1).min(BINS)
    };
    let near: usize = bins[reach(1.0)].iter().map(|bin| bin.values).sum();
    if near < SETTINGS.values_min {
        return None;
    }
    let (mut squares, mut products) = (0.0, 0.0);
    for k in reach(REACH_SIGMAS) {
        let height = bump.at(low + (k as f64 + 0.5) * bin_width);
        squares += height * height * bins[k].squares;
        products += height * bins[k].products;
    }
    Some(products * products / (squares + SETTINGS.height_sigma.powi(-2)))
}

/// The sum with better centre and width of its last bump.
fn refined(
    fitted: &ScoreTest<'_>,
    sum: LocalErrors,
    penalty: impl Fn(usize) -> f64 + Copy,
) -> LocalErrors {
    (0..REFINEMENTS).fold(sum, |sum, round| {
        let variants = variants(&sum, 0.5_f64.powi(round));
        best_of(fitted, &variants, penalty)
            .filter(|best| best.improvement > sum.improvement)
            .unwrap_or(sum)
    })
}

/// The sums with other centres and widths of the last bump; `step`: size of the change, 0 to 1.
fn variants(sum: &LocalErrors, step: f64) -> Vec<(usize, Vec<Bump>)> {
    let Some((last, others)) = sum.bumps.split_last() else { return Vec::new() };
    let variants =
        CENTRES.iter().flat_map(|centre| WIDTHS.iter().map(move |width| (centre, width)));
    let bump = |(centre, width): (&f64, &f64)| Bump {
        centre: last.centre + step * centre * last.width,
        width: width.powf(step) * last.width,
    };
    let with = |bump: Bump| (sum.joint, others.iter().copied().chain([bump]).collect());
    variants.map(bump).map(with).collect()
}

/// The best of some sums of bumps, each of one joint, by the score test.
fn best_of(
    fitted: &ScoreTest<'_>,
    sums: &[(usize, Vec<Bump>)],
    penalty: impl Fn(usize) -> f64,
) -> Option<LocalErrors> {
    let column_counts: Vec<usize> = sums.iter().map(|(_, bumps)| bumps.len()).collect();
    let columns = column_counts.iter().sum();
    let groups = ColumnGroups { column_counts, sigmas: vec![SETTINGS.height_sigma; columns] };
    let (arm, poses) = (&fitted.state.hypothesis.model.arm, &fitted.campaign.poses);
    let (mut now, mut motions) = (usize::MAX, Vec::new());
    let scores = fitted.scores_along(&groups, |reading, into| {
        let q = &poses[reading.pose].inputs.q;
        if now != reading.pose {
            now = reading.pose;
            let chain = Chain::nominal(arm, q);
            motions.clear();
            motions.extend((0..arm.count()).map(|joint| ToolMotion::of_joint(arm, &chain, joint)));
        }
        for (joint, bumps) in sums {
            let along = reading.rows.derivative_along(&motions[*joint]);
            into.extend(bumps.iter().map(|bump| bump.at(q[*joint]) * along));
        }
    });
    let improvement = |gain: f64, count: usize| gain / fitted.fit.design_effect - penalty(count);
    let best = scores.into_iter().map(|score| {
        let (joint, bumps) = &sums[score.candidate];
        LocalErrors {
            joint: *joint,
            bumps: bumps.clone(),
            improvement: improvement(score.gain, bumps.len()),
            heights: score.values,
        }
    });
    best.max_by(|a, b| a.improvement.total_cmp(&b.improvement))
}
