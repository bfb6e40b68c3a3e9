//! Terms of a smooth regression: allowed combinations of covariates, and their polynomials. There is no constant term beside others; the fit contains one
//! already.

use super::covariates::Covariate;

/// Degree of the polynomials of each covariate of a pair.
const DEGREE_OF_PAIR: usize = 3;

/// Every covariate alone.
pub(super) fn singles(covariates: &[Covariate], _joint: usize) -> Vec<Vec<usize>> {
    (0..covariates.len()).map(|index| vec![index]).collect()
}

/// Pairs of covariates: any two of the joint; its position or speed with the positions of other joints, on which its load depends; and any of the
/// joint with one of the whole robot, such as temperature.
pub(super) fn pairs(covariates: &[Covariate], joint: usize) -> Vec<Vec<usize>> {
    let is_of_joint = |covariate: &Covariate| covariate.joint == Some(joint);
    let position = |covariate: &Covariate| covariate.name.starts_with('q');
    let moves = |covariate: &Covariate| {
        is_of_joint(covariate) && (position(covariate) || covariate.name.starts_with('v'))
    };
    let mut pairs = Vec::new();
    for (a, first) in covariates.iter().enumerate() {
        for (b, second) in covariates.iter().enumerate().skip(a + 1) {
            let tied = is_of_joint(first) && is_of_joint(second);
            let places = (moves(first) && position(second)) || (position(first) && moves(second));
            let heat = is_of_joint(first) && second.joint.is_none();
            if tied || places || heat {
                pairs.push(vec![a, b]);
            }
        }
    }
    pairs
}

/// Number of terms of a group of covariates; `alone`: degree for a single covariate.
pub(super) fn count(covariates: &[Covariate], group: &[usize], alone: usize) -> usize {
    let mut count = 0;
    terms(covariates, group, (0, alone), |_| count += 1);
    count
}

/// Passes the terms of a group of covariates at a pose to `take`; `alone`: degree for a single covariate. An empty group has one constant term.
pub(super) fn terms(
    covariates: &[Covariate],
    group: &[usize],
    (pose, alone): (usize, usize),
    mut take: impl FnMut(f64),
) {
    let degree = |covariate: &Covariate, most: usize| {
        if covariate.name.starts_with("dir") { 1 } else { most }
    };
    match *group {
        [] => take(1.0),
        [one] => covariates[one].chebyshev(pose, degree(&covariates[one], alone)).for_each(take),
        [one, two] => {
            let joints = [one, two].map(|w| covariates[w].joint);
            let sways = joints[0] != joints[1] && !joints.contains(&None);
            let basis_of = |w: usize| {
                // The lag of a joint is proportional to its speed, whatever the positions of the others.
                let straight = sways && covariates[w].name.starts_with('v');
                let most = if straight { 1 } else { degree(&covariates[w], DEGREE_OF_PAIR) };
                let mut all = [1.0; DEGREE_OF_PAIR + 1];
                let mut count = 1;
                for (slot, term) in all[1..].iter_mut().zip(covariates[w].chebyshev(pose, most)) {
                    (*slot, count) = (term, count + 1);
                }
                (all, count)
            };
            let (first, second) = (basis_of(one), basis_of(two));
            for (i, x) in first.0[..first.1].iter().enumerate() {
                for (k, y) in second.0[..second.1].iter().enumerate() {
                    if i + k > 0 {
                        take(x * y);
                    }
                }
            }
        }
        _ => {}
    }
}
