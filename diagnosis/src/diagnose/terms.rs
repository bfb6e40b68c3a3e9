//! Terms of a smooth regression: allowed combinations of covariates, and their polynomials. There is no constant term; the fit contains one already.

use super::covariates::Covariate;

/// Degree of the polynomials of each covariate of a pair.
const DEGREE_OF_PAIR: usize = 3;

/// Every covariate alone.
pub(super) fn singles(words: &[Covariate], _joint: usize) -> Vec<Vec<usize>> {
    (0..words.len()).map(|word| vec![word]).collect()
}

/// Pairs of covariates: any two of the joint; its position or speed with the positions of other joints, on which its load depends; and any of the
/// joint with one of the whole robot, such as temperature.
pub(super) fn pairs(words: &[Covariate], joint: usize) -> Vec<Vec<usize>> {
    let own = |word: &Covariate| word.joint == Some(joint);
    let position = |word: &Covariate| word.name.starts_with('q');
    let moves = |word: &Covariate| own(word) && (position(word) || word.name.starts_with('v'));
    let mut pairs = Vec::new();
    for (a, first) in words.iter().enumerate() {
        for (b, second) in words.iter().enumerate().skip(a + 1) {
            let tied = own(first) && own(second);
            let places = (moves(first) && position(second)) || (position(first) && moves(second));
            let heat = own(first) && second.joint.is_none();
            if tied || places || heat {
                pairs.push(vec![a, b]);
            }
        }
    }
    pairs
}

/// Number of terms of a group of covariates; `alone`: degree for a single covariate.
pub(super) fn count(words: &[Covariate], group: &[usize], alone: usize) -> usize {
    let mut count = 0;
    terms(words, group, (0, alone), |_| count += 1);
    count
}

/// Passes the terms of a group of covariates at a pose to `take`; `alone`: degree for a single covariate.
pub(super) fn terms(
    words: &[Covariate],
    group: &[usize],
    (pose, alone): (usize, usize),
    mut take: impl FnMut(f64),
) {
    let degree =
        |word: &Covariate, most: usize| if word.name.starts_with("dir") { 1 } else { most };
    match *group {
        [one] => words[one].chebyshev(pose, degree(&words[one], alone)).for_each(take),
        [one, two] => {
            let joints = [one, two].map(|w| words[w].joint);
            let sways = joints[0] != joints[1] && !joints.contains(&None);
            let of = |w: usize| {
                // The lag of a joint is proportional to its speed, whatever the positions of the others.
                let straight = sways && words[w].name.starts_with('v');
                let most = if straight { 1 } else { degree(&words[w], DEGREE_OF_PAIR) };
                let mut all = [1.0; DEGREE_OF_PAIR + 1];
                let mut count = 1;
                for (slot, term) in all[1..].iter_mut().zip(words[w].chebyshev(pose, most)) {
                    (*slot, count) = (term, count + 1);
                }
                (all, count)
            };
            let (first, second) = (of(one), of(two));
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
