//! Search for counterbalances: the spring that best explains a joint in place of all effects selected there.
//!
//! The force of a spring depends nonlinearly on three parameters. The grid of the library is coarse, and the gain at a grid point says little about
//! its neighbours: the best spring of each lever length is therefore fitted. Fits are compared under the weights and noise of the present one. The
//! result is a further candidate; `selection` decides.

use super::selection::{Search, Selected, Selection, without};
use crate::candidates::{Candidate, is_sound, put, springs_at};
use crate::fit::compare;
use crate::hypothesis::Free;
use crate::motions::is_about_loads;
use crate::score::{Fitted, Score};
use physics::AnyEffect;

/// Gain in the sum of squares below which no spring is fitted.
const WORTH_A_LOOK: f64 = 15.0;
/// Share of the largest gain from which a lever length is fitted.
const NEAR: f64 = 0.5;
/// Index of the lever length among the parameters of a spring.
const LEVER: usize = 2;

impl Search<'_> {
    /// The best spring of every joint with a compliance or a load effect, in place of all effects selected there.
    pub(super) fn springs(&self, fitted: &Fitted<'_>, selection: &Selection) -> Vec<Candidate> {
        let model = &selection.fit.hypothesis.model;
        let here = |effect: &AnyEffect, joint| effect.joint() == Some(joint);
        let gives_way = |joint: &usize| {
            model.effects().any(|effect| is_about_loads(effect.spec()) && here(effect, *joint))
        };
        let best = |joint| {
            let named = selection.named.iter().filter(|one| one.candidate.joint == Some(joint));
            let named: Vec<&Selected> = named.collect();
            if named.is_empty() {
                return self.spring(fitted, joint, &fitted.state.hypothesis.free);
            }
            let mut bare = without(&selection.fit, &self.known.model, &named);
            let free = bare.free.clone();
            // Without the spring, the fitted compliance would be too small and hide it: compliances keep their stated values during the search.
            bare.believe(|effect| is_about_loads(effect.spec()));
            let bare = compare(self.campaign, &bare, &selection.fit, self.settings.used);
            self.spring(&Fitted::new(self.campaign, &bare, &self.settings), joint, &free)
        };
        (0..model.arm.count()).filter(gives_way).filter_map(best).collect()
    }

    /// The best spring of a joint beside the effects of `fitted`, with its shape fitted together with the parameters `free`.
    fn spring(&self, fitted: &Fitted<'_>, joint: usize, free: &[Free]) -> Option<Candidate> {
        let arm = &fitted.state.hypothesis.model.arm;
        let all = springs_at(arm, joint);
        let mut scores = fitted.scores(&all);
        scores.retain(|score| is_sound(&all[score.candidate], &score.found));
        scores.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let best = scores.first()?;
        if best.gain < WORTH_A_LOOK * fitted.fit.design_effect {
            return Some(all[best.candidate].clone());
        }
        let lever =
            |score: &Score| Some(all[score.candidate].probes.first()?.effect.values()[LEVER]);
        let mut levers = Vec::new();
        let mut is_first = |score: &&Score| {
            let own = lever(score);
            let is_new = !levers.contains(&own);
            levers.push(own);
            is_new
        };
        let near = scores.iter().take_while(|score| score.gain >= NEAR * best.gain);
        let shaped = near.filter(|score| is_first(score)).filter_map(|score| {
            let candidate = &all[score.candidate];
            let mut hypothesis = fitted.fit.hypothesis.clone();
            hypothesis.free = free.to_vec();
            let at = put(&mut hypothesis, candidate, candidate.kept(), &score.found)?;
            let shaped = compare(self.campaign, &hypothesis, fitted.fit, self.settings.used);
            let effect = shaped.hypothesis.model.effects().nth(at)?;
            Some((shaped.sum, candidate.standing(arm, effect, &[]).0))
        });
        let best = shaped.min_by(|a, b| a.0.total_cmp(&b.0));
        best.map(|(_, candidate)| candidate)
    }
}
