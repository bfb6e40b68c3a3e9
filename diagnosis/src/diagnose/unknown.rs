//! Structure that no effect of the library explains: whether there is any above the noise, and on which covariates it depends.
//!
//! The error of each joint is modelled as a smooth function (Chebyshev polynomials) of each covariate, and of pairs of covariates that are physically
//! related; the function with the best criterion is reported (an additive model with few terms, Hastie and Tibshirani 1990). The size of each
//! selected effect is also modelled as a function of a covariate (a varying-coefficient model, Hastie and Tibshirani 1993): if it varies, the
//! selected effect is not the cause.
//!
//! The criterion includes penalties for the coefficients and for the number of functions tried.

use super::features::Word;
use super::locate::moved;
use super::prove::validation_margin;
use super::selection::{Search, Selected, Selection, without};
use super::terms::{count, pairs, singles, terms};
use crate::fit::compare;
use crate::motion::Motion;
use crate::score::{Asked, Fitted};
use crate::wide::dot;
use physics::spec::Need;
use physics::{AnyEffect, Arm, Chain, Inputs};
use std::rc::Rc;

/// Degree of the polynomials of a single covariate.
const DEGREE: usize = 5;
/// Degree of the polynomials by which the size of a selected effect varies.
const DEGREE_OF_SIZE: usize = 3;
/// Whitened residuals beyond this are outliers, in standard deviations.
const FAR: f64 = 12.0;
/// Relative margin by which the improvement of a smooth function has to exceed that of the selected effects that it replaces: their equations are
/// simplified, too.
const CLEARLY: f64 = 0.02;
/// The same before the selection is complete, for selections of at least [`PATCHES`] effects.
const FAR_AHEAD: f64 = 0.1;
/// Least number of selected effects that together may imitate an error of another kind.
pub(super) const PATCHES: usize = 4;
/// Share of the total gain below which a selected effect is a minor one.
const CARRIES: f64 = 0.1;
/// Least improvement of a smooth function before the selection is complete, in the sum of squares: the AR noise model is still uncertain then.
const PLAIN: f64 = 200.0;
/// Standard deviation of the prior of a coefficient of a joint's error, rad or m.
const LARGE: f64 = 5e-3;

/// The motion that a smooth function multiplies.
#[derive(Clone, Debug)]
enum Carrier {
    /// An error of the joint's position, rad or m.
    Joint,
    /// The motion by a selected effect: tool displacement at each pose, and index of the covariate that the effect itself depends on.
    Selected(Rc<[Motion]>, Option<usize>),
}

impl Carrier {
    /// Tool displacement at a pose per unit of the smooth function.
    fn unit(&self, arm: &Arm, joint: usize, inputs: &Inputs, pose: usize) -> Motion {
        match self {
            Self::Joint => Motion::of_joint(arm, &Chain::nominal(arm, &inputs.q), joint),
            Self::Selected(motions, _) => motions[pose],
        }
    }

    /// Degree of the polynomials of a single covariate.
    fn degree(&self) -> usize {
        match self {
            Self::Joint => DEGREE,
            Self::Selected(..) => DEGREE_OF_SIZE,
        }
    }

    /// Standard deviation of the prior of a coefficient: rad or m for an error of the joint, relative for the size of a selected effect.
    fn large(&self) -> f64 {
        match self {
            Self::Joint => LARGE,
            Self::Selected(..) => 1.0,
        }
    }
}

/// A smooth function that models the error of a joint, or the size of an effect selected there.
#[derive(Clone, Debug)]
pub(super) struct Law {
    /// Index of the joint, from 0.
    pub(super) joint: usize,
    carrier: Carrier,
    /// Indices of its covariates: one or two.
    words: Vec<usize>,
    /// Coefficients of the terms: rad or m for an error of the joint, relative for the size of a selected effect.
    found: Vec<f64>,
    /// Reduction of the sum of squares less the penalty; a function above zero is significant.
    pub(super) worth: f64,
}

/// The function with the best criterion beside the selected effects, if the validation set supports it.
pub(super) fn confirmed(
    search: &Search<'_>,
    selection: &Selection,
    words: &[Word],
    kept: &[bool],
) -> Option<Law> {
    let fitted = Fitted::new(search.campaign, &selection.fit, &search.settings);
    let best = unsteady(&fitted, words, search, selection, law(&fitted, words));
    borne_out_by(&fitted, words, kept, best.filter(|law| law.worth > 0.0)?)
}

/// The function if the validation set supports it, or if there is no validation set.
fn borne_out_by(fitted: &Fitted<'_>, words: &[Word], kept: &[bool], law: Law) -> Option<Law> {
    if !kept.contains(&true) {
        return Some(law);
    }
    let sums = law.on(fitted, words, kept);
    law.is_supported(fitted.fit.design_effect, sums).then_some(law)
}

/// A smooth function that improves the criterion more than all selected effects do, or more than the minor ones do beside the others. In the first
/// case the major effects alone must not be better either. Returns the remaining selection with the function: the effects that it replaces only
/// imitated it together.
pub(super) fn instead_of_names(
    search: &Search<'_>,
    selection: &Selection,
    words: &[Word],
    kept: &[bool],
) -> Option<(Selection, Law)> {
    ahead(search, selection, words, kept, CLEARLY)
}

/// The same after the preselection, for many effects far behind the smooth function: further selection would take long and not catch up.
pub(super) fn ahead_at_once(
    search: &Search<'_>,
    selection: &Selection,
    words: &[Word],
    kept: &[bool],
) -> Option<(Selection, Law)> {
    let many = selection.named.len() >= PATCHES;
    let (few, law) = many.then(|| ahead(search, selection, words, kept, FAR_AHEAD))??;
    (law.worth > PLAIN).then_some((few, law))
}

/// The smooth function that exceeds all selected effects by the relative margin `share`, or, if the minor effects are many, exceeds these beside the
/// others.
fn ahead(
    search: &Search<'_>,
    selection: &Selection,
    words: &[Word],
    kept: &[bool],
    share: f64,
) -> Option<(Selection, Law)> {
    let all: f64 = selection.named.iter().map(|one| one.gain).sum();
    let carries = |one: &&Selected| one.gain >= CARRIES * all;
    let (few, gone): (Vec<&Selected>, Vec<&Selected>) = selection.named.iter().partition(carries);
    let every: Vec<&Selected> = selection.named.iter().collect();
    ahead_of(search, selection, [&every, &few], share, (words, kept)).or_else(|| {
        let are_patches = gone.len() >= PATCHES && gone.len() < every.len();
        are_patches.then(|| ahead_of(search, selection, [&gone, &gone], share, (words, kept)))?
    })
}

/// The smooth function that exceeds the effects `gone`, and the effects `few` among them alone, beside the remaining ones.
fn ahead_of(
    search: &Search<'_>,
    selection: &Selection,
    [gone, few]: [&[&Selected]; 2],
    share: f64,
    (words, kept): (&[Word], &[bool]),
) -> Option<(Selection, Law)> {
    if gone.is_empty() {
        return None;
    }
    let Search { campaign, known, settings, library, .. } = search;
    let beside = |gone: &[&Selected]| {
        let left = without(&selection.fit, &known.model, gone);
        compare(campaign, &left, &selection.fit, settings.used)
    };
    let bare = beside(gone);
    let fitted = Fitted::new(campaign, &bare, settings);
    let worth = |sum: f64, names: &[&Selected]| {
        let numbers: usize = names.iter().map(|one| one.numbers).sum();
        let names = names.len() as f64 * penalty(&fitted, 0, library.len());
        (bare.sum - sum) / bare.design_effect - penalty(&fitted, numbers, 1) - names
    };
    let mut names = worth(selection.fit.sum, gone);
    if few.len() < gone.len() {
        let is_few = |one: &&Selected| few.iter().any(|few| std::ptr::eq(*few, *one));
        let others: Vec<&Selected> = gone.iter().copied().filter(|one| !is_few(one)).collect();
        names = names.max(worth(beside(&others).sum, few));
    }
    let few = selection.without(gone, bare.clone());
    let best = unsteady(&fitted, words, search, &few, law(&fitted, words));
    let law = borne_out_by(&fitted, words, kept, best.filter(|law| law.worth > 0.0)?)?;
    if kept.contains(&true) {
        // On the validation set the function must leave a smaller residual than the effects that it replaces.
        let named = Fitted::new(campaign, &selection.fit, settings);
        if law.on(&fitted, words, kept)[1] >= law.on(&named, words, kept)[0] {
            return None;
        }
    }
    (law.worth > (1.0 + share) * names).then_some((few, law))
}

/// The function with the best criterion; `None` if none is significant.
pub(super) fn law(fitted: &Fitted<'_>, words: &[Word]) -> Option<Law> {
    let joints = fitted.state.hypothesis.model.arm.count();
    let mut best = better(fitted, words, |joint| singles(words, joint), None);
    best = better(fitted, words, |joint| pairs(words, joint), best);
    // The covariate of the best function may interact with any other covariate.
    if let Some(one) = best.clone() {
        let with = |joint: usize| {
            let all = (0..words.len()).filter(|_| joint == one.joint);
            all.filter(|w| !one.words.contains(w)).map(|w| vec![one.words[0], w]).collect()
        };
        best = better(fitted, words, with, best);
    }
    debug_assert!(best.as_ref().is_none_or(|law| law.joint < joints));
    best.filter(|law| law.worth > 0.0)
}

/// The best function of `groups` of covariates (per joint), or `before` if that is better.
fn better(
    fitted: &Fitted<'_>,
    words: &[Word],
    groups: impl Fn(usize) -> Vec<Vec<usize>>,
    before: Option<Law>,
) -> Option<Law> {
    let joints = fitted.state.hypothesis.model.arm.count();
    let groups: Vec<Vec<Vec<usize>>> = (0..joints).map(groups).collect();
    let tried = groups.iter().map(Vec::len).sum();
    groups.iter().enumerate().fold(before, |best, (joint, groups)| {
        best_of(fitted, words, (joint, &Carrier::Joint), (groups, tried), best)
    })
}

/// The best function by which the size of a selected effect varies, or `before` if that is better.
fn unsteady(
    fitted: &Fitted<'_>,
    words: &[Word],
    search: &Search<'_>,
    selection: &Selection,
    before: Option<Law>,
) -> Option<Law> {
    let whole = &selection.fit.hypothesis.model;
    let tried = selection.named.len() * words.len();
    selection.named.iter().fold(before, |best, one| {
        let effect = whole.effects().nth(one.effect);
        let Some((effect, joint)) = effect.and_then(|e| Some((e, e.joint()?))) else { return best };
        let bare = without(&selection.fit, &search.known.model, &[one]).model;
        let own = follows(effect, joint, words);
        let groups: Vec<Vec<usize>> =
            (0..words.len()).filter(|w| Some(*w) != own).map(|w| vec![w]).collect();
        let carrier = Carrier::Selected(moved(search.campaign, &bare, whole).into(), own);
        best_of(fitted, words, (joint, &carrier), (&groups, tried), best)
    })
}

/// The best function of `groups` of covariates that multiplies `carrier`, or `before` if that is better.
fn best_of(
    fitted: &Fitted<'_>,
    words: &[Word],
    (joint, carrier): (usize, &Carrier),
    (groups, tried): (&[Vec<usize>], usize),
    before: Option<Law>,
) -> Option<Law> {
    let arm = &fitted.state.hypothesis.model.arm;
    let numbers: Vec<usize> =
        groups.iter().map(|group| count(words, group, carrier.degree())).collect();
    let asked = Asked { sigmas: vec![carrier.large(); numbers.iter().sum()], numbers };
    let unit = |pose: usize| carrier.unit(arm, joint, &fitted.campaign.poses[pose].inputs, pose);
    let scores = fitted.scores_of_multiples(&asked, unit, |pose, into| {
        groups.iter().for_each(|group| {
            terms(words, group, (pose, carrier.degree()), |term| into.push(term));
        });
    });
    let mut best = before;
    for score in scores {
        let worth = score.gain / fitted.fit.design_effect - penalty(fitted, score.numbers, tried);
        if best.as_ref().is_none_or(|best| worth > best.worth) {
            let (carrier, words) = (carrier.clone(), groups[score.candidate].clone());
            best = Some(Law { joint, carrier, words, found: score.found, worth });
        }
    }
    best
}

/// Index of the covariate that an effect depends on by its equation.
fn follows(effect: &AnyEffect, joint: usize, words: &[Word]) -> Option<usize> {
    let needs = |need: Need| effect.spec().needs.contains(&need);
    let n = joint + 1;
    let name = match effect {
        AnyEffect::OverPath(_) => format!("v{n}"),
        _ if needs(Need::Direction) => format!("direction_{n}"),
        _ if needs(Need::Temperature) => format!("temp{n}_C"),
        _ if needs(Need::Time) => "t_s".to_owned(),
        _ if needs(Need::Masses) => format!("tau{n}"),
        _ if needs(Need::Wrench) => "wrench".to_owned(),
        _ => format!("q{n}"),
    };
    words.iter().position(|word| word.name == name)
}

/// Penalty in the sum of squares: of `numbers` coefficients, and of the choice among `tried` functions.
fn penalty(fitted: &Fitted<'_>, numbers: usize, tried: usize) -> f64 {
    let readings = fitted.fit.readings as f64 / fitted.fit.design_effect;
    numbers as f64 * readings.max(2.0).ln() + 2.0 * (tried.max(1) as f64).ln()
}

impl Law {
    /// Names of the covariates that it depends on (docs/reference/results.md), each once.
    pub(super) fn depends_on(&self, words: &[Word]) -> Vec<String> {
        let own = if let Carrier::Selected(_, own) = &self.carrier { *own } else { None };
        let all = own.iter().chain(&self.words);
        let mut names: Vec<String> = all.map(|word| words[*word].name.clone()).collect();
        names.dedup();
        names
    }

    /// Whether rows outside the fit support it: the gain in log-likelihood there, from their sums of squares without it and with it, must be what selection
    /// and validation together require.
    pub(super) fn is_supported(&self, design_effect: f64, [without, with]: [f64; 2]) -> bool {
        let gain = 0.5 * (without - with) / design_effect;
        validation_margin(0.5 * self.worth, gain) > 0.0
    }

    /// Tool displacement by it at a pose.
    fn motion(&self, arm: &Arm, inputs: &Inputs, words: &[Word], pose: usize) -> Motion {
        let mut sum = 0.0;
        let mut found = self.found.iter();
        let degree = self.carrier.degree();
        terms(words, &self.words, (pose, degree), |term| {
            sum += term * found.next().unwrap_or(&0.0);
        });
        self.carrier.unit(arm, self.joint, inputs, pose).times(sum)
    }

    /// Sums of squares of the whitened residuals on the poses `held`, without and with the function. The fitted parameters respond to the function as
    /// they do on the training rows.
    pub(super) fn on(&self, fitted: &Fitted<'_>, words: &[Word], held: &[bool]) -> [f64; 2] {
        let arm = &fitted.state.hypothesis.model.arm;
        let motion = |pose: usize, into: &mut Vec<Motion>| {
            let inputs = &fitted.campaign.poses[pose].inputs;
            *into = vec![self.motion(arm, inputs, words, pose)];
        };
        let mut pull = vec![0.0; fitted.fit.columns().len()];
        fitted.rows(1, motion, |row, law, _| {
            pull.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * law[0]);
        });
        let triangle = &fitted.fit.triangle;
        let follows = triangle.back(triangle.forward(pull));
        let there = fitted.among(held);
        let mut sums = [0.0; 2];
        there.rows(1, motion, |row, law, left| {
            if left.abs() < FAR {
                let with = left - law[0] + dot(row, &follows);
                sums[0] += left * left;
                sums[1] += with * with;
            }
        });
        sums
    }
}
