//! A search for counterbalances: the spring that explains a joint best in the stead of all that is named there.
//!
//! A spring's shape is three numbers that bend; those of the list are far between, and what they gain is no measure of what their neighbours would. The best
//! of each lever is fitted, and the best fit is told.
//!
//! Promises: sums are compared with the weights and the noise of the fit that stands. Never: a decision; see `name`.

use super::selection::{Search, Selected, Selection, without};
use crate::candidates::{Candidate, is_sound, put, springs_at};
use crate::fit::compare;
use crate::hypothesis::Free;
use crate::motions::is_about_loads;
use crate::score::{Fitted, Score};
use physics::AnyEffect;

/// Gains below this are not looked at closer.
const WORTH_A_LOOK: f64 = 15.0;
/// A lever is fitted where it gains this share of what the best one does.
const NEAR: f64 = 0.5;
/// Where a spring has its lever among its numbers.
const LEVER: usize = 2;

impl Search<'_> {
    /// The best spring of every joint that gives way, in the stead of what is named there.
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
            // While it is missing, what gives way seems stiff, and no spring would bend it: it gives way here as is believed, until the spring is there.
            bare.believe(|effect| is_about_loads(effect.spec()));
            let bare = compare(self.campaign, &bare, &selection.fit, self.settings.used);
            self.spring(&Fitted::new(self.campaign, &bare, &self.settings), joint, &free)
        };
        (0..model.arm.count()).filter(gives_way).filter_map(best).collect()
    }

    /// The best spring of a joint where a fit stands, of the shape that it takes beside all that is `free`.
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
