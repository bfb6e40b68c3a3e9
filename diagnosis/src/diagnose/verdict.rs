//! The verdict, and the posterior probability of each selected effect beside its alternatives.
//!
//! Effects that cannot be distinguished are not claimed. No fit is computed here.

use super::selection::{AlternativeEffect, SelectedEffect};
use crate::candidates::Candidate;
use crate::engine::posterior::posterior;
use crate::engine::verdict::{FindingEvidence, Verdict, VerdictSettings, decide_verdict};
use crate::fit_result::Fit;
use physics::AnyEffect;

/// Two effects that differ by less than this in log-likelihood describe the same error in this recording.
const SAME_ERROR_LOSS: f64 = 1e-3;
/// Difference in log-likelihood from which a form of a law is reported instead of the preferred form (Kass and Raftery 1995: a Bayes factor below 3
/// is not worth a mention).
const FORM_THRESHOLD: f64 = 1.0;
/// The same for backlash and hysteresis, which has one parameter more: half of the 95 % quantile of χ² with one degree of freedom.
const BACKLASH_FORM_THRESHOLD: f64 = 1.92;

/// Posterior probability from which an alternative with more parameters makes an effect ambiguous.
const AMBIGUOUS_PROBABILITY: f64 = 0.35;

/// The verdict on the selected effects. `explained`: the share that they explain of the energy above the noise on the test set; `None`: all of it.
pub(super) fn decide(found: &[SelectedEffect], fit: &Fit, explained: Option<f64>) -> Verdict {
    let weight = |one: &SelectedEffect| FindingEvidence {
        gain: one.gain,
        is_ambiguous: is_ambiguous(one, fit),
    };
    let weights: Vec<FindingEvidence> = found.iter().map(weight).collect();
    decide_verdict(&weights, explained, &VerdictSettings::POSITION)
}

/// Whether an alternative explains the error as well. Other forms of the same law do not count; alternatives with more parameters only from the
/// probability [`AMBIGUOUS_PROBABILITY`].
pub(super) fn is_ambiguous(one: &SelectedEffect, fit: &Fit) -> bool {
    let effect = fit.hypothesis.model.effects().nth(one.effect);
    let (_, shares) = confidence(one, fit);
    let is_equivalent = |(rival, share): (&AlternativeEffect, f64)| {
        rival.is_indistinguishable
            && (rival.numbers <= one.parameter_count || share > AMBIGUOUS_PROBABILITY)
            && !effect.is_some_and(|effect| is_same_error(effect, rival))
    };
    one.alternatives.iter().zip(shares).any(is_equivalent)
}

/// Whether an alternative describes the same error in this recording (another form of the same law, displacement of a parallel axis, growth in the
/// same direction), so that docs/reference/effects.md decides which of the two is reported.
fn is_same_error(effect: &AnyEffect, rival: &AlternativeEffect) -> bool {
    if are_of_one_law(effect, &rival.effect) {
        return rival.likelihood_loss.abs() < form_threshold(effect);
    }
    let grows = |effect: &AnyEffect| matches!(effect, AnyEffect::SpindleGrowth(_));
    let stretches = |effect: &AnyEffect| matches!(effect, AnyEffect::ThermalGrowth(_));
    let shifts = |effect: &AnyEffect| matches!(effect, AnyEffect::AxisShift(_));
    let both = |is: &dyn Fn(&AnyEffect) -> bool| is(effect) && is(&rival.effect);
    let parallel = both(&shifts);
    // If the tool axis is parallel to the last link, growth of spindle and link are the same.
    let one_way = both(&|effect| grows(effect) || stretches(effect));
    let apart = effect.joint() != rival.effect.joint() && !grows(effect) && !grows(&rival.effect);
    rival.likelihood_loss.abs() < SAME_ERROR_LOSS && (parallel || one_way && !apart)
}

/// Whether two effects of a joint are forms of one law, of which one is a special case of the other: compliance under gravity, wrench or both;
/// backlash and hysteresis.
fn are_of_one_law(one: &AnyEffect, other: &AnyEffect) -> bool {
    let family = |effect: &AnyEffect| match effect {
        AnyEffect::JointCompliance(_)
        | AnyEffect::GravityCompliance(_)
        | AnyEffect::LoadCompliance(_)
        | AnyEffect::GravitySag(_) => 1,
        play if is_backlash_or_hysteresis(play) => 2,
        _ => 0,
    };
    family(one) > 0 && family(one) == family(other) && one.joint() == other.joint()
}

/// Whether two candidates are forms of one law at one joint.
pub(super) fn are_forms_of_one_law(one: &Candidate, other: &Candidate) -> bool {
    let pair = one.probes.first().zip(other.probes.first());
    pair.is_some_and(|(one, other)| are_of_one_law(&one.effect, &other.effect))
}

/// Penalty, in log-likelihood, of an alternative that is another form of the same law; `None` for any other. It consists of `numbers`, the penalty of
/// its additional parameters, and of a bonus for the preferred form (docs/reference/effects.md); a negative value favours the alternative.
///
/// A form is a special case of the other with some parameters fixed, so the penalty of the parameters counts in full. Between backlash and hysteresis
/// there is a single test, not one of hundreds, so that [`BACKLASH_FORM_THRESHOLD`] replaces it.
pub(super) fn form_penalty(effect: &AnyEffect, rival: &AnyEffect, numbers: f64) -> Option<f64> {
    let is_preferred = |effect: &AnyEffect| {
        matches!(effect, AnyEffect::JointCompliance(_) | AnyEffect::Backlash(_))
    };
    let numbers = if is_backlash_or_hysteresis(effect) { 0.0 } else { numbers };
    let form_term = f64::from(i8::from(is_preferred(effect)) - i8::from(is_preferred(rival)))
        * form_threshold(effect);
    are_of_one_law(effect, rival).then_some(numbers + form_term)
}

/// Difference in log-likelihood that decides between two forms of this law.
fn form_threshold(effect: &AnyEffect) -> f64 {
    if is_backlash_or_hysteresis(effect) { BACKLASH_FORM_THRESHOLD } else { FORM_THRESHOLD }
}

fn is_backlash_or_hysteresis(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::Backlash(_) | AnyEffect::Hysteresis(_))
}

/// Posterior probability of a selected effect, and of each alternative, from likelihoods and penalties; they sum to 1. Alternatives that describe the
/// same error are counted with the selected effect.
pub(super) fn confidence(one: &SelectedEffect, fit: &Fit) -> (f64, Vec<f64>) {
    let readings = fit.readings as f64 / fit.design_effect;
    let penalty = readings.max(2.0).ln();
    let effect = fit.hypothesis.model.effects().nth(one.effect);
    let loss =
        |rival: &AlternativeEffect| rival.likelihood_loss + one.penalty_difference(rival, penalty);
    let (mut right, mut shares) =
        posterior(&one.alternatives.iter().map(loss).collect::<Vec<f64>>());
    for (rival, share) in one.alternatives.iter().zip(&mut shares) {
        if effect.is_some_and(|effect| is_same_error(effect, rival)) {
            right += std::mem::take(share);
        }
    }
    (right, shares)
}

#[cfg(test)]
mod tests {
    use super::form_penalty;
    use physics::{AnyEffect, ParameterValues};
    use recording::model::presets::preset;

    #[test]
    fn a_word_for_a_case_of_a_law_stands_until_evidence_for_the_whole_law_is_there() {
        let arm = preset("irb120").expect("preset").model().expect("sound").physics.arm;
        let effect = |kind: &str, joint: usize, given: &[(&str, &[f64])]| {
            AnyEffect::build(kind, &arm, Some(joint), ParameterValues(given)).expect(kind)
        };
        let compliance: &[(&str, &[f64])] = &[("compliance", &[1e-5])];
        let gravity = effect("gravity_compliance", 2, compliance);
        let sag = effect("gravity_sag", 2, &[("sag", &[1e-4; 12])]);
        let (gap, lag) = (
            effect("backlash", 2, &[("width", &[1e-4])]),
            effect("hysteresis", 2, &[("amplitude", &[1e-4]), ("reversal", &[1e-4])]),
        );
        assert_eq!(form_penalty(&gravity, &sag, 30.0), Some(30.0), "weights that nobody doubts");
        let penalty = form_penalty(&gap, &lag, 30.0).expect("one law");
        assert!(penalty > 1.0 && penalty < 5.0, "one number, asked once: {penalty}");
        assert_eq!(form_penalty(&lag, &gap, -30.0), Some(-penalty));
        let whole = effect("joint_compliance", 2, compliance);
        assert!(
            form_penalty(&gravity, &whole, 0.0).is_some_and(|penalty| penalty < 0.0),
            "preferred"
        );
        let elsewhere = effect("joint_compliance", 1, compliance);
        assert_eq!(form_penalty(&gravity, &elsewhere, 0.0), None, "another joint is another law");
    }
}
