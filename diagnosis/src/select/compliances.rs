//! The gravity compliances of all drives as one candidate, if no wrench separates them: a single one would absorb the others and part of the geometry.
//!
//! Promises: they are added if they improve the criterion more than the best single effect; each keeps a prior of the drives' tolerance, so that small ones need no
//! separate test. Never: a compliance in addition to an equivalent effect of the model.

use super::{Chosen, Selecting, put};
use crate::candidates::{Candidate, loaded_compliances};
use crate::fit::Effort;
use crate::hypothesis::Belief;
use crate::score::Fitted;

impl Selecting<'_> {
    /// Adds the compliances of all joints that carry a load, if they are worth more than what else is open.
    pub(super) fn join_compliances(&mut self) {
        let model = &self.fit.hypothesis.model;
        let mut group = loaded_compliances(&model.arm, self.campaign);
        group.retain(|one| !model.effects().any(|effect| one.is_rival_of(effect)));
        let Some(whole) = Candidate::of_group(&group) else { return };
        let fitted = Fitted::new(self.campaign, &self.fit, &self.settings);
        let Some(score) = fitted.scores(std::slice::from_ref(&whole)).pop() else { return };
        let worth = score.gain / self.fit.design_effect - self.cost(score.numbers, 1.0);
        let best = self.among_open().first().map_or(0.0, |pick| pick.worth);
        if worth <= best {
            return;
        }
        let mut hypothesis = self.fit.hypothesis.clone();
        for (candidate, found) in group.iter().zip(&score.found) {
            let Some(effect) = put(&mut hypothesis, candidate, &[], &[found.max(0.0)]) else {
                break;
            };
            for free in hypothesis.free.iter_mut().filter(|free| free.effect == effect) {
                (free.mean, free.sigma) = (0.0, self.tolerances.compliance);
                free.belief = Belief::Tolerance;
            }
            self.open.retain(|open| open.slot != candidate.slot);
            let gain = score.gain / group.len() as f64;
            self.chosen.push(Chosen { effect, gain, settings: Vec::new() });
        }
        let joined: Vec<_> = hypothesis.model.effects().skip(model.effects().len()).collect();
        self.open.retain(|open| !joined.iter().any(|effect| open.is_rival_of(effect)));
        self.refit(&hypothesis, Effort::Full);
    }

    /// Whether all free numbers of an effect have a tolerance for their prior, which pays for them.
    pub(super) fn is_tolerated(&self, effect: usize) -> bool {
        let mut own =
            self.fit.hypothesis.free.iter().filter(|free| free.effect == effect).peekable();
        own.peek().is_some() && own.all(|free| free.belief == Belief::Tolerance)
    }
}
