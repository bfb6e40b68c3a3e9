//! Replaces a selected effect by an alternative. Alternatives are proposed by linearised sums of squares; a nonlinear fit decides.

use super::gram::Entry;
use super::selection::{ALIKE, Rival, Search, Selected, Selection, close_up, without};
use crate::fit::{compare, fit};
use crate::hypothesis::Hypothesis;

/// Largest number of rounds in which alternatives may replace selected effects.
pub(super) const SUBSTITUTION_ROUNDS: usize = 3;
/// Least gain in penalised log-likelihood for a replacement.
const CLEARLY: f64 = 0.25;
/// Number of alternatives of an effect that are refitted to verify that they are as good as the linearisation predicts.
const FITTED: usize = 3;

/// Determines the alternatives of each selected effect on the rows that `search` uses, and replaces effects by better alternatives. The number of
/// effects stays the same.
pub(super) fn with_rivals(search: &Search<'_>, mut selection: Selection) -> Selection {
    for round in 0..=SUBSTITUTION_ROUNDS {
        let also = search.searched(&selection);
        let penalty = search.compare(&mut selection, &also);
        if round == SUBSTITUTION_ROUNDS || !search.substitute(&mut selection, penalty) {
            search.refute(&mut selection, penalty);
            break;
        }
        selection.fit = fit(search.campaign, &selection.fit.hypothesis, &search.settings);
    }
    selection
}

impl Selected {
    /// Loss in penalised log-likelihood of an alternative compared with the selected effect.
    fn loss(&self, rival: &Rival, penalty: f64) -> f64 {
        rival.behind + self.dearer(rival, penalty)
    }

    /// Index of the best alternative if it is better than the selected effect.
    fn better(&self, penalty: f64) -> Option<usize> {
        let losses = self.rivals.iter().map(|rival| self.loss(rival, penalty)).enumerate();
        let (best, loss) = losses.min_by(|a, b| a.1.total_cmp(&b.1))?;
        (loss < -CLEARLY).then_some(best)
    }
}

/// Whether an alternative of effect `k` is compatible with the other selected effects: two of them must not be replaced by the same effect.
fn stands_beside(selection: &Selection, k: usize, rival: &Rival) -> bool {
    let effects = &selection.fit.hypothesis.model;
    let new =
        selection.named.iter().enumerate().filter(|(at, one)| *at != k && one.stated.is_none());
    let mut others = new.filter_map(|(_, one)| effects.effects().nth(one.effect));
    !others.any(|effect| rival.candidate.is_rival_of(effect))
}

impl Search<'_> {
    /// Replaces effects by alternatives that are better after a nonlinear fit; returns whether any was replaced.
    pub(super) fn substitute(&self, selection: &mut Selection, penalty: f64) -> bool {
        let mut any = false;
        for k in 0..selection.named.len() {
            let one = &selection.named[k];
            let better = one.better(penalty).map(|place| &one.rivals[place]);
            let better = better.filter(|rival| stands_beside(selection, k, rival));
            let renamed = better.and_then(|rival| self.in_place_of(selection, k, rival, penalty));
            if let Some((renamed, _)) = renamed.filter(|(_, loss)| *loss < -CLEARLY) {
                (*selection, any) = (renamed, true);
            }
        }
        any
    }

    /// Refits alternatives that appear better and corrects their loss in log-likelihood. Alternatives that are incompatible with the other effects
    /// are removed.
    fn refute(&self, selection: &mut Selection, penalty: f64) {
        for k in 0..selection.named.len() {
            for _ in 0..FITTED {
                let one = &selection.named[k];
                let Some(place) = one.better(penalty) else { break };
                let rival = &one.rivals[place];
                if !stands_beside(selection, k, rival) {
                    selection.named[k].rivals.remove(place);
                    continue;
                }
                let behind = self
                    .in_place_of(selection, k, rival, penalty)
                    .map(|(_, loss)| loss - one.dearer(rival, penalty));
                let Some(behind) = behind.filter(|behind| *behind > rival.behind) else { break };
                let rival = &mut selection.named[k].rivals[place];
                rival.behind = behind;
                rival.alike = behind < ALIKE * self.share();
            }
            selection.named[k].rivals.sort_by(|a, b| a.behind.total_cmp(&b.behind));
        }
    }

    /// The selection with `rival` in place of effect `k`, and the loss in penalised log-likelihood.
    fn in_place_of(
        &self,
        selection: &Selection,
        k: usize,
        rival: &Rival,
        penalty: f64,
    ) -> Option<(Selection, f64)> {
        let mut named = selection.named.clone();
        let gone = &selection.named[k];
        let mut hypothesis = without(&selection.fit, &self.known.model, &[gone]);
        let entry = Entry::open(rival.kept, rival.candidate.clone());
        let (effect, stated) = Self::joined(&mut hypothesis, &entry, &rival.found)?;
        close_up(&mut named, gone);
        let compared = |hypothesis: &Hypothesis| {
            compare(self.campaign, hypothesis, &selection.fit, self.settings.used)
        };
        let fit = compared(&hypothesis);
        // Compared with the present fit, since other effects may have been replaced after the alternatives were determined.
        let before = compared(&selection.fit.hypothesis).sum;
        let behind = 0.5 * (fit.sum - before) / selection.fit.design_effect;
        let loss = behind + gone.dearer(rival, penalty);
        let more = rival.numbers.saturating_sub(gone.numbers) as f64;
        named[k] = Selected {
            candidate: entry.candidate,
            effect,
            stated,
            kept: rival.kept,
            spared: gone.spared.max(penalty * more),
            gain: gone.gain - behind,
            margin: gone.margin - loss,
            numbers: rival.numbers,
            share: gone.share,
            rivals: Vec::new(),
            variants: Vec::new(),
        };
        Some((Selection { fit, named }, loss))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::jacobian_cache::JacobianCache;
    use crate::diagnose::judge::confidence;
    use crate::diagnose::library::library;
    use crate::diagnose::selection::{preselected, title};
    use crate::fit::{Effort, Settings};
    use crate::made::{empty, nominal};
    use crate::robust::Influence;
    use crate::simulate;
    use physics::{AnyEffect, Given};

    #[test]
    fn a_rival_that_sums_call_better_counts_as_far_behind_as_its_fit_is() {
        let model = nominal();
        let mut truth = model;
        let given: &[(&str, &[f64])] = &[("offset", &[2e-3])];
        let zero = AnyEffect::build("joint_offset", &model.arm, Some(2), Given(given));
        truth.push(zero.expect("an effect")).expect("room");
        let bare = empty(3, 60);
        let campaign = simulate::readings(&bare, &truth, &bare.surroundings, 1.0, 5);
        let known = Hypothesis::fixed(model);
        let used = vec![true; 60];
        let (influence, effort) = (Influence::Equal, Effort::Full);
        let settings = Settings { used: &used, influence, from: None, effort };
        let base = fit(&campaign, &known, &settings);
        let (library, cache) = (library(&model, &campaign), JacobianCache::default());
        let search = Search {
            campaign: &campaign,
            known: &known,
            settings,
            library: &library,
            cache: &cache,
        };
        let (mut selection, also) = preselected(&search, &base, 10);
        let penalty = search.compare(&mut selection, &also);
        let kinds: Vec<_> = selection.named.iter().map(|one| title(&one.candidate)).collect();
        assert_eq!(kinds, [Some(("joint_offset", Some(2), false))]);
        // A scale error of the last joint, which explains nothing of a zero offset.
        let wrong = |candidate: &&crate::candidates::Candidate| {
            title(candidate) == Some(("joint_ratio", Some(5), false))
        };
        let candidate = library.iter().find(wrong).expect("in the library").clone();
        let effect = candidate.effect(&model.arm, &[1e-6]).expect("an effect");
        let rival = Rival {
            effect,
            changes: false,
            behind: -40.0,
            numbers: 1,
            alike: true,
            candidate,
            found: vec![1e-6],
            kept: &[],
        };
        selection.named[0].rivals = vec![rival];
        assert!(confidence(&selection.named[0], &selection.fit).0 < 0.01, "by the sums");
        search.refute(&mut selection, penalty);
        let rival = &selection.named[0].rivals[0];
        assert!(rival.behind > 20.0 && !rival.alike, "{}", rival.behind);
        assert!(confidence(&selection.named[0], &selection.fit).0 > 0.99, "by the fit");
    }
}
