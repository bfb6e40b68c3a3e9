//! Structure that no effect of the library explains: whether there is any above the noise, and on which covariates it depends.
//!
//! Each joint's error is modelled as a smooth function of each covariate (Chebyshev polynomials), and of pairs of covariates that belong together physically; the
//! function with the best criterion is reported (an additive model with few terms, Hastie and Tibshirani 1990). The size of each selected effect, too, may vary with a
//! covariate (a varying-coefficient model, Hastie and Tibshirani 1993): then it is not that effect.
//!
//! The criterion includes penalties for the parameters and for the number of functions tried.

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

/// Polynomials of one word.
const DEGREE: usize = 5;
/// The same where a name's size changes with it.
const DEGREE_OF_SIZE: usize = 3;
/// Readings further off, in units of the noise, are outliers.
const FAR: f64 = 12.0;
/// By which share of what names are worth a law has to be worth more than they are: names are simplified physics too.
const CLEARLY: f64 = 0.02;
/// The same where names are not settled yet, and how many they are at least.
const FAR_AHEAD: f64 = 0.1;
pub(super) const PATCHES: usize = 4;
/// Of what is named, a name that brings less than this share is one of the others.
const CARRIES: f64 = 0.1;
/// And what a law has to be worth there, in the sum of squares: how the noise remembers itself is not known well yet.
const PLAIN: f64 = 200.0;
/// How large a coefficient of a joint's error may be, rad or m.
const LARGE: f64 = 5e-3;

/// What a law gives its size to.
#[derive(Clone, Debug)]
enum Carrier {
    /// The joint's error, rad or m.
    Joint,
    /// What was named there: how the tool moves with it, pose by pose; and the word that the name itself follows.
    Selected(Rc<[Motion]>, Option<usize>),
}

impl Carrier {
    /// How the tool moves with one of it at a pose.
    fn unit(&self, arm: &Arm, joint: usize, inputs: &Inputs, pose: usize) -> Motion {
        match self {
            Self::Joint => Motion::of_joint(arm, &Chain::nominal(arm, &inputs.q), joint),
            Self::Selected(motions, _) => motions[pose],
        }
    }

    /// Polynomials of a word by itself.
    fn degree(&self) -> usize {
        match self {
            Self::Joint => DEGREE,
            Self::Selected(..) => DEGREE_OF_SIZE,
        }
    }

    /// How large a coefficient may be: a joint's error, rad or m; of what was named, as often again.
    fn large(&self) -> f64 {
        match self {
            Self::Joint => LARGE,
            Self::Selected(..) => 1.0,
        }
    }
}

/// A smooth law of a joint's error, or of the size of what was named there.
#[derive(Clone, Debug)]
pub(super) struct Law {
    /// The joint that errs, from 0.
    pub(super) joint: usize,
    carrier: Carrier,
    /// Places among the words: one or two.
    words: Vec<usize>,
    /// One coefficient per term, rad or m; of what was named, as shares.
    found: Vec<f64>,
    /// By how much the sum of squares falls, less what its numbers cost; above zero: it is there.
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

fn borne_out_by(fitted: &Fitted<'_>, words: &[Word], kept: &[bool], law: Law) -> Option<Law> {
    if !kept.contains(&true) {
        return Some(law);
    }
    let [without, with] = law.on(fitted, words, kept);
    let gain = 0.5 * (without - with) / fitted.fit.design_effect;
    (validation_margin(0.5 * law.worth, gain) > 0.0).then_some(law)
}

/// A smooth law of one joint that says more than all names do, or than all but the few that carry most, with these alone: the others are patches on something
/// that is none of them.
pub(super) fn instead_of_names(
    search: &Search<'_>,
    selection: &Selection,
    words: &[Word],
    kept: &[bool],
) -> Option<(Selection, Law)> {
    ahead(search, selection, words, kept, CLEARLY)
}

/// The same at the first glimpse of names that are many and far behind: no more of them would catch up, and to look for them takes long.
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

/// The law that is ahead of all names by a share of what they are worth, or beside those that carry most ahead of the others, if they are many.
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

/// The law that, beside the others, is ahead of the names `gone`, and of those that carry most of these alone.
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
        // Where neither was fitted, it must leave less than the names do.
        let named = Fitted::new(campaign, &selection.fit, settings);
        if law.on(&fitted, words, kept)[1] >= law.on(&named, words, kept)[0] {
            return None;
        }
    }
    (law.worth > (1.0 + share) * names).then_some((few, law))
}

/// The law that is worth most; none where nothing is left to explain.
pub(super) fn law(fitted: &Fitted<'_>, words: &[Word]) -> Option<Law> {
    let joints = fitted.state.hypothesis.model.arm.count();
    let mut best = better(fitted, words, |joint| singles(words, joint), None);
    best = better(fitted, words, |joint| pairs(words, joint), best);
    // What the best law follows may bend with any other word.
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

/// The best of `groups` (per joint) and of what was found before.
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

/// The best law by which a name's size changes, and of what was found before.
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

/// The best of the laws by which groups of words size a carrier, and of what was found before.
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

/// The word that an effect follows by its nature.
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

fn penalty(fitted: &Fitted<'_>, numbers: usize, tried: usize) -> f64 {
    let readings = fitted.fit.readings as f64 / fitted.fit.design_effect;
    numbers as f64 * readings.max(2.0).ln() + 2.0 * (tried.max(1) as f64).ln()
}

impl Law {
    /// The contract's words that it follows, each once.
    pub(super) fn depends_on(&self, words: &[Word]) -> Vec<String> {
        let own = if let Carrier::Selected(_, own) = &self.carrier { *own } else { None };
        let all = own.iter().chain(&self.words);
        let mut names: Vec<String> = all.map(|word| words[*word].name.clone()).collect();
        names.dedup();
        names
    }

    /// How the tool moves with it at a pose.
    fn motion(&self, arm: &Arm, inputs: &Inputs, words: &[Word], pose: usize) -> Motion {
        let mut sum = 0.0;
        let mut found = self.found.iter();
        let degree = self.carrier.degree();
        terms(words, &self.words, (pose, degree), |term| {
            sum += term * found.next().unwrap_or(&0.0);
        });
        self.carrier.unit(arm, self.joint, inputs, pose).times(sum)
    }

    /// Sums of squares of the rows `held`, whitened, without the law and with it; what is fitted anyway follows the law as it does on the rows of the fit.
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
