//! Replacement of several selected effects by one: an error of the weight can be absorbed by compliances and waves.
//!
//! In forward selection, an effect that acts only through others is tested too late if other effects have already absorbed it.
//! Here a spring, then a mass, is tried in place of the effects that can absorb it.
//!
//! Promises: the replacement improves the same criterion. Never: removal of an effect of the model.

use super::{Chosen, Pick, Selecting, is_sound, joined};
use crate::candidates::Candidate;
use crate::fit::Effort;
use crate::result::Fit;
use crate::score::Fitted;
use physics::{AnyEffect, Given};

/// What changes the weight alone and is looked for.
const WEIGHS: [&str; 2] = ["counterbalance", "payload"];
/// What may hide it.
const STAND_INS: [&str; 6] = [
    "gravity_sag",
    "gravity_compliance",
    "load_compliance",
    "joint_compliance",
    "transmission_error",
    "joint_polynomial",
];
/// Those of them that a compliance would have to be in the place of.
const WEIGHT: [&str; 4] =
    ["gravity_sag", "gravity_compliance", "load_compliance", "joint_compliance"];
/// Where the search for a compliance starts, rad/Nm.
const COMPLIANCE: f64 = 1e-6;

impl Selecting<'_> {
    /// Tries what changes the weight in the place of what it may hide behind.
    pub(super) fn replace(&mut self) {
        for kind in WEIGHS {
            let of_kind = self.open.iter().filter(|candidate| kind_of(candidate) == kind);
            let tried: Vec<Candidate> = of_kind.cloned().collect();
            let before = (self.fit.clone(), self.chosen.clone(), self.open.clone());
            let better =
                self.instead(&tried).is_some() && self.measure(&self.fit) < self.measure(&before.0);
            if !better {
                (self.fit, self.chosen, self.open) = before;
                self.is_finished = true;
            }
        }
    }

    /// The best of `tried`, each joint with one compliance, instead of what may hide it; none where it is not worth its numbers.
    fn instead(&mut self, tried: &[Candidate]) -> Option<()> {
        let joint = tried.first()?.joint;
        // Compliances within tolerance stay beside what replaces the others.
        let stays = |one: &Chosen| self.is_tolerated(one.effect) && self.stands_in(one, joint);
        let staying = self.chosen.iter().filter(|one| stays(one)).count();
        let (mut replaced, mut weighed) = (0, Vec::new());
        let goes = |this: &Self, one: &Chosen| {
            !this.is_tolerated(one.effect) && this.stands_in(one, joint)
        };
        while let Some(k) = self.chosen.iter().position(|chosen| goes(self, chosen)) {
            let effect = self.fit.hypothesis.model.effects().nth(self.chosen[k].effect);
            let weighs = effect.filter(|effect| WEIGHT.contains(&effect.spec().kind));
            weighed.extend(weighs.and_then(AnyEffect::joint));
            self.drop(k);
            replaced += 1;
        }
        if replaced == 0 || replaced + staying < 2 {
            return None;
        }
        weighed.sort_unstable();
        weighed.dedup();
        for joint in weighed {
            self.give_way(joint)?;
        }
        let hypothesis = self.fit.hypothesis.clone();
        self.refit(&hypothesis, Effort::Sketch);
        let scores = Fitted::new(self.campaign, &self.fit, &self.settings).scores(tried);
        let sound = scores.into_iter().filter(|s| is_sound(&tried[s.candidate], &s.found));
        let best = sound.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let candidate = tried[best.candidate].clone();
        let cost = self.cost(best.numbers + candidate.tried_numbers(), self.rivals as f64);
        let worth = best.gain / self.fit.design_effect - cost;
        let kept = candidate.kept();
        let pick = Pick { candidate, found: best.found, gain: best.gain, worth, kept };
        (worth > 0.0).then_some(())?;
        self.join(vec![pick]);
        self.grow();
        self.finish();
        Some(())
    }

    /// Whether it may hide a spring at `joint`, or a mass anywhere.
    fn stands_in(&self, chosen: &Chosen, joint: Option<usize>) -> bool {
        let effect = self.fit.hypothesis.model.effects().nth(chosen.effect);
        let fits = |effect: &AnyEffect| {
            (joint.is_none() || effect.joint() == joint) && STAND_INS.contains(&effect.spec().kind)
        };
        effect.is_some_and(fits)
    }

    /// Gives a joint one compliance, where the model states none.
    fn give_way(&mut self, joint: usize) -> Option<()> {
        let mut hypothesis = self.fit.hypothesis.clone();
        let given: &[(&str, &[f64])] = &[("compliance", &[COMPLIANCE])];
        let arm = hypothesis.model.arm;
        let effect = AnyEffect::build("joint_compliance", &arm, Some(joint), Given(given)).ok()?;
        let candidate = Candidate::of_values(&effect);
        if hypothesis.model.effects().any(|there| candidate.is_rival_of(there)) {
            return Some(());
        }
        let pick = Pick { candidate, found: vec![COMPLIANCE], gain: 0.0, worth: 0.0, kept: &[] };
        let chosen = joined(&mut hypothesis, &pick)?;
        self.chosen.push(chosen);
        self.fit.hypothesis = hypothesis;
        Some(())
    }

    /// Twice the negative log-likelihood, but for a constant, and what the numbers cost.
    fn measure(&self, fit: &Fit) -> f64 {
        let readings = fit.readings as f64 / fit.design_effect;
        let mut noise = 0.0;
        let used = self.campaign.poses.iter().zip(self.settings.used).filter(|(_, used)| **used);
        for seen in used.flat_map(|(pose, _)| &pose.seen) {
            noise += 2.0 * seen.reading.count() as f64 * fit.factors[seen.instrument].ln();
        }
        let numbers = fit.columns().len() as f64 * readings.max(2.0).ln();
        (fit.sum + noise) / fit.design_effect + numbers
    }
}

fn kind_of(candidate: &Candidate) -> &'static str {
    candidate.probes.first().map_or("", |probe| probe.effect.spec().kind)
}
