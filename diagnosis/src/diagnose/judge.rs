//! The verdict, and the posterior probability of each selected effect beside its alternatives.
//!
//! Effects that cannot be distinguished are not claimed. No fit is computed here.

use super::selection::{Rival, Selected};
use crate::candidates::Candidate;
use crate::engine::posterior::posterior;
use crate::engine::verdict::{Verdict, VerdictSettings, Weight, decide_verdict};
use crate::result::Fit;
use physics::AnyEffect;

/// Two effects that differ by less than this in log-likelihood describe the same error in this recording.
const SAME: f64 = 1e-3;
/// Difference in log-likelihood from which a form of a law is reported instead of the preferred form (Kass and Raftery 1995: a Bayes factor below 3
/// is not worth a mention).
const WORD: f64 = 1.0;
/// The same for backlash and hysteresis, which has one parameter more: half of the 95 % quantile of χ² with one degree of freedom.
const DISTANCE: f64 = 1.92;

/// Posterior probability from which an alternative with more parameters makes an effect ambiguous.
const LIKELY: f64 = 0.35;

/// The verdict on the selected effects. `explained`: the share that they explain of the energy above the noise on the test set; `None`: all of it.
pub(super) fn verdict(found: &[Selected], fit: &Fit, explained: Option<f64>) -> Verdict {
    let weight = |one: &Selected| Weight { gain: one.gain, is_ambiguous: is_ambiguous(one, fit) };
    let weights: Vec<Weight> = found.iter().map(weight).collect();
    decide_verdict(&weights, explained, &VerdictSettings::POSITION)
}

/// Whether an alternative explains the error as well. Other forms of the same law do not count; alternatives with more parameters only from the
/// probability [`LIKELY`].
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

/// Whether an alternative describes the same error in this recording (another form of the same law, displacement of a parallel axis, growth in the
/// same direction), so that docs/reference/effects.md decides which of the two is reported.
fn is_same(own: &AnyEffect, rival: &Rival) -> bool {
    if of_one_law(own, &rival.effect) {
        return rival.behind.abs() < word(own);
    }
    let grows = |effect: &AnyEffect| matches!(effect, AnyEffect::SpindleGrowth(_));
    let stretches = |effect: &AnyEffect| matches!(effect, AnyEffect::ThermalGrowth(_));
    let shifts = |effect: &AnyEffect| matches!(effect, AnyEffect::AxisShift(_));
    let kin = |is: &dyn Fn(&AnyEffect) -> bool| is(own) && is(&rival.effect);
    let parallel = kin(&shifts);
    // If the tool axis is parallel to the last link, growth of spindle and link are the same.
    let one_way = kin(&|effect| grows(effect) || stretches(effect));
    let apart = own.joint() != rival.effect.joint() && !grows(own) && !grows(&rival.effect);
    rival.behind.abs() < SAME && (parallel || one_way && !apart)
}

/// Whether two effects of a joint are forms of one law, of which one is a special case of the other: compliance under gravity, wrench or both;
/// backlash and hysteresis.
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

/// Whether two candidates are forms of one law at one joint.
pub(super) fn words(one: &Candidate, other: &Candidate) -> bool {
    let pair = one.probes.first().zip(other.probes.first());
    pair.is_some_and(|(one, other)| of_one_law(&one.effect, &other.effect))
}

/// Penalty, in log-likelihood, of an alternative that is another form of the same law; `None` for any other. It consists of `numbers`, the penalty of
/// its additional parameters, and of a bonus for the preferred form (docs/reference/effects.md); a negative value favours the alternative.
///
/// A form is a special case of the other with some parameters fixed, so the penalty of the parameters counts in full. Between backlash and hysteresis
/// there is a single test, not one of hundreds, so that [`DISTANCE`] replaces it.
pub(super) fn of_word(own: &AnyEffect, rival: &AnyEffect, numbers: f64) -> Option<f64> {
    let is_preferred = |effect: &AnyEffect| {
        matches!(effect, AnyEffect::JointCompliance(_) | AnyEffect::Backlash(_))
    };
    let numbers = if is_play(own) { 0.0 } else { numbers };
    let word = f64::from(i8::from(is_preferred(own)) - i8::from(is_preferred(rival))) * word(own);
    of_one_law(own, rival).then_some(numbers + word)
}

/// Difference in log-likelihood that decides between two forms of this law.
fn word(own: &AnyEffect) -> f64 {
    if is_play(own) { DISTANCE } else { WORD }
}

fn is_play(effect: &AnyEffect) -> bool {
    matches!(effect, AnyEffect::Backlash(_) | AnyEffect::Hysteresis(_))
}

/// Posterior probability of a selected effect, and of each alternative, from likelihoods and penalties; they sum to 1. Alternatives that describe the
/// same error are counted with the selected effect.
pub(super) fn confidence(one: &Selected, fit: &Fit) -> (f64, Vec<f64>) {
    let readings = fit.readings as f64 / fit.design_effect;
    let penalty = readings.max(2.0).ln();
    let own = fit.hypothesis.model.effects().nth(one.effect);
    let loss = |rival: &Rival| rival.behind + one.dearer(rival, penalty);
    let (mut right, mut shares) = posterior(&one.rivals.iter().map(loss).collect::<Vec<f64>>());
    for (rival, share) in one.rivals.iter().zip(&mut shares) {
        if own.is_some_and(|own| is_same(own, rival)) {
            right += std::mem::take(share);
        }
    }
    (right, shares)
}

#[cfg(test)]
mod tests {
    use super::of_word;
    use physics::{AnyEffect, Given};
    use recording::model::presets::preset;

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
