//! The verdict, and the posterior probability of each selected effect beside its alternatives.
//!
//! Effects that cannot be distinguished are not claimed. Uses figures that other modules computed; computes no fit.

use super::selection::{Rival, Selected};
use crate::candidates::Candidate;
use crate::result::Fit;
use physics::AnyEffect;

/// Names must carry this share of what was found above the noise, as energy; else the structure is unknown.
const CARRIED: f64 = 0.999;
/// Where more than this share of what is named cannot be distinguished, nothing is claimed.
const CLEAR: f64 = 0.5;
/// Beside a name that brings so much log-likelihood and is alike none other, the alike ones are told as sets.
const SURE: f64 = 20.0;
/// Two names that differ by less than this in log-likelihood are one and the same thing in this recording.
const SAME: f64 = 1e-3;
/// Two words for one law differ by less than is worth a mention (Kass and Raftery 1995: a Bayes factor below 3): the preferred one is said.
const WORD: f64 = 1.0;
/// The same of a gap and of what builds up over a distance, which is one number more: half of a squared normal variate, 95 %.
const DISTANCE: f64 = 1.92;

/// A finding is claimed from this probability on (docs/diagnosis.md): it is likelier than all else.
const CLAIMED: f64 = 0.5;
/// A dearer name that is at least as probable as this keeps a cheaper one from being claimed.
const LIKELY: f64 = 0.35;

/// What a recording says of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing above the noise.
    Consistent,
    /// The findings explain the mismatch.
    MissingPhysics,
    /// There is structure that no known effect explains.
    UnknownStructure,
    /// Candidates alike, or too little to say anything.
    Undetermined,
}

impl Verdict {
    /// As in the contract.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::MissingPhysics => "missing_physics",
            Self::UnknownStructure => "unknown_structure",
            Self::Undetermined => "undetermined",
        }
    }
}

/// The verdict on names that carry the share `carried` of what stands above the noise on held-out rows; none: all of it.
pub(super) fn verdict(found: &[Selected], fit: &Fit, carried: Option<f64>) -> Verdict {
    let gains = found.iter().map(|one| (one.gain, is_ambiguous(one, fit)));
    let gains: Vec<(f64, bool)> = gains.collect();
    match found {
        [] if carried.is_none() => Verdict::Consistent,
        [] => Verdict::UnknownStructure,
        _ if carried.is_some_and(|share| share < CARRIED) => Verdict::UnknownStructure,
        _ if !is_clear(&gains) => Verdict::Undetermined,
        _ => Verdict::MissingPhysics,
    }
}

/// Findings that are claimed, and those that are too improbable for that. Where nothing is claimed, all stand as sets of what is alike.
pub(crate) fn claimed<T>(
    verdict: Verdict,
    findings: Vec<T>,
    confidence: impl Fn(&T) -> f64,
) -> (Vec<T>, Vec<T>) {
    findings
        .into_iter()
        .partition(|one| verdict == Verdict::Undetermined || confidence(one) >= CLAIMED)
}

/// Whether names, each with what it brings and whether it is alike another, are clear enough for a claim.
fn is_clear(names: &[(f64, bool)]) -> bool {
    let gain = |of_alike: bool| names.iter().filter(move |(_, alike)| *alike == of_alike);
    let sum = |of_alike: bool| gain(of_alike).map(|(gain, _)| gain).sum::<f64>();
    let surest = gain(false).map(|(gain, _)| *gain).fold(0.0, f64::max);
    sum(true) <= CLEAR * (sum(true) + sum(false)) || surest >= SURE
}

/// Whether another name, one that is not the same thing by another word, explains it as well; one of more numbers only where it is likely.
pub(super) fn is_ambiguous(one: &Selected, fit: &Fit) -> bool {
    let own = fit.hypothesis.model.effects().nth(one.effect);
    let (_, shares) = confidence(one, fit);
    let alike = |(rival, share): (&Rival, f64)| {
        rival.alike
            && (rival.numbers <= one.numbers || share > LIKELY)
            && !own.is_some_and(|own| is_same(own, rival))
    };
    one.rivals.iter().zip(shares).any(alike)
}

/// Whether a rival is the same thing in this recording, and the contract says which word to prefer.
fn is_same(own: &AnyEffect, rival: &Rival) -> bool {
    if of_one_law(own, &rival.effect) {
        return rival.behind.abs() < word(own);
    }
    let grows = |effect: &AnyEffect| matches!(effect, AnyEffect::SpindleGrowth(_));
    let stretches = |effect: &AnyEffect| matches!(effect, AnyEffect::ThermalGrowth(_));
    let shifts = |effect: &AnyEffect| matches!(effect, AnyEffect::AxisShift(_));
    let kin = |is: &dyn Fn(&AnyEffect) -> bool| is(own) && is(&rival.effect);
    let parallel = kin(&shifts);
    // A tool that hangs along its own z grows as the link after the last joint does.
    let one_way = kin(&|effect| grows(effect) || stretches(effect));
    let apart = own.joint() != rival.effect.joint() && !grows(own) && !grows(&rival.effect);
    rival.behind.abs() < SAME && (parallel || one_way && !apart)
}

/// Whether two names of a joint are two words for one law, that differ in what part of it they take.
fn of_one_law(one: &AnyEffect, other: &AnyEffect) -> bool {
    let family = |effect: &AnyEffect| match effect {
        AnyEffect::JointCompliance(_)
        | AnyEffect::GravityCompliance(_)
        | AnyEffect::LoadCompliance(_)
        | AnyEffect::GravitySag(_) => 1,
        play if is_play(play) => 2,
        _ => 0,
    };
    family(one) > 0 && family(one) == family(other) && one.joint() == other.joint()
}

/// The same of two candidates.
pub(super) fn words(one: &Candidate, other: &Candidate) -> bool {
    let pair = one.probes.first().zip(other.probes.first());
    pair.is_some_and(|(one, other)| of_one_law(&one.effect, &other.effect))
}

/// What a rival that is another word for the same law pays, in log-likelihood, for its `numbers` and for not being the word that is preferred (docs/reference/effects.md)
/// ; below zero: what it gains. One word is a case of the other, with as many numbers held: these are paid in full. Whether play builds up over a
/// distance is one question, not one of hundreds, and costs no more than it takes to be told from chance.
pub(super) fn of_word(own: &AnyEffect, rival: &AnyEffect, numbers: f64) -> Option<f64> {
    let is_preferred = |effect: &AnyEffect| {
        matches!(effect, AnyEffect::JointCompliance(_) | AnyEffect::Backlash(_))
    };
    let numbers = if is_play(own) { 0.0 } else { numbers };
    let word = f64::from(i8::from(is_preferred(own)) - i8::from(is_preferred(rival))) * word(own);
    of_one_law(own, rival).then_some(numbers + word)
}

/// By how much two words of this one's law have to differ.
fn word(own: &AnyEffect) -> f64 {
    if is_play(own) { DISTANCE } else { WORD }
}

fn is_play(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::Backlash(_) | AnyEffect::Hysteresis(_))
}

/// The probability that a name is right beside its rivals, by their likelihoods and the numbers that each takes, and that of each rival; together they are 1.
/// Where another word is the same thing, either is right: its share is the name's own.
pub(super) fn confidence(one: &Selected, fit: &Fit) -> (f64, Vec<f64>) {
    let readings = fit.readings as f64 / fit.design_effect;
    let penalty = readings.max(2.0).ln();
    let own = fit.hypothesis.model.effects().nth(one.effect);
    let weight = |rival: &Rival| libm::exp(-(rival.behind + one.dearer(rival, penalty)).max(-20.0));
    let weights: Vec<f64> = one.rivals.iter().map(weight).collect();
    let all = 1.0 + weights.iter().sum::<f64>();
    let same = |rival: &Rival| own.is_some_and(|own| is_same(own, rival));
    let words = one.rivals.iter().zip(&weights).filter(|(rival, _)| same(rival));
    let right = 1.0 + words.map(|(_, weight)| weight).sum::<f64>();
    let share = |(rival, weight): (&Rival, &f64)| if same(rival) { 0.0 } else { weight / all };
    (right / all, one.rivals.iter().zip(&weights).map(share).collect())
}

#[cfg(test)]
mod tests {
    use super::{Verdict, claimed, is_clear, of_word};
    use physics::{AnyEffect, Given};
    use recording::model::presets::preset;

    #[test]
    fn a_finding_is_claimed_from_a_half_on_and_an_undetermined_set_holds_all() {
        let found = vec![0.98, 0.49, 0.5, 0.0];
        let confidence = |one: &f64| *one;
        let (claims, candidates) = claimed(Verdict::MissingPhysics, found.clone(), confidence);
        assert_eq!((claims, candidates), (vec![0.98, 0.5], vec![0.49, 0.0]));
        let (set, candidates) = claimed(Verdict::Undetermined, found.clone(), confidence);
        assert_eq!((set, candidates), (found, Vec::new()));
    }

    #[test]
    fn what_is_alike_takes_no_claim_from_a_name_that_is_sure_by_itself() {
        assert!(!is_clear(&[(400.0, true)]), "nothing but what is alike");
        assert!(is_clear(&[(400.0, true), (60.0, false)]), "a sure one beside it");
        assert!(
            !is_clear(&[(400.0, true), (9.0, false)]),
            "what little else there is carries no claim"
        );
        assert!(is_clear(&[(9.0, true), (12.0, false)]), "most is clear");
    }

    #[test]
    fn a_word_for_a_case_of_a_law_stands_until_evidence_for_the_whole_law_is_there() {
        let arm = preset("irb120").expect("preset").model().expect("sound").physics.arm;
        let of = |kind: &str, joint: usize, given: &[(&str, &[f64])]| {
            AnyEffect::build(kind, &arm, Some(joint), Given(given)).expect(kind)
        };
        let compliance: &[(&str, &[f64])] = &[("compliance", &[1e-5])];
        let gravity = of("gravity_compliance", 2, compliance);
        let sag = of("gravity_sag", 2, &[("sag", &[1e-4; 12])]);
        let (gap, lag) = (
            of("backlash", 2, &[("width", &[1e-4])]),
            of("hysteresis", 2, &[("amplitude", &[1e-4]), ("reversal", &[1e-4])]),
        );
        assert_eq!(of_word(&gravity, &sag, 30.0), Some(30.0), "weights that nobody doubts");
        let penalty = of_word(&gap, &lag, 30.0).expect("one law");
        assert!(penalty > 1.0 && penalty < 5.0, "one number, asked once: {penalty}");
        assert_eq!(of_word(&lag, &gap, -30.0), Some(-penalty));
        let whole = of("joint_compliance", 2, compliance);
        assert!(of_word(&gravity, &whole, 0.0).is_some_and(|penalty| penalty < 0.0), "preferred");
        let elsewhere = of("joint_compliance", 1, compliance);
        assert_eq!(of_word(&gravity, &elsewhere, 0.0), None, "another joint is another law");
    }
}
