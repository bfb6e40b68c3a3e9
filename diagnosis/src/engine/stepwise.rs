//! Forward stepwise selection for torques and forces by the extended Bayesian information criterion, with backward elimination and exchange after
//! each step, and with sign constraints.
//!
//! A candidate with a parameter of the wrong sign is rejected; an effect that a later one makes superfluous is removed. Invariant: the same products
//! give the same selection.

use super::criterion::Ebic;
use super::dictionary::{CandidateDictionary, CandidateTerm, CoefficientForm};
use super::normal_equations::{LeastSquaresSolution, NormalEquations};

/// Least gain of a candidate beyond its penalty, in log-likelihood.
pub(crate) const MARGIN: f64 = 5.0;
/// Largest number of selected candidates.
const MOST: usize = 80;
/// Largest number of successive exchanges.
const EXCHANGES: usize = 3;
/// Number of alternatives that are tried in place of a selected candidate.
const LIKELY: usize = 3;

/// Selected candidates, with the solution for their columns and the columns that are always included.
#[derive(Clone, Debug)]
pub(crate) struct TermSelection {
    /// Indices in the library's families.
    pub(crate) terms: Vec<usize>,
    pub(crate) solved: LeastSquaresSolution,
}

/// The indices `names` without `name`.
pub(crate) fn without_term(names: &[usize], name: usize) -> Vec<usize> {
    names.iter().copied().filter(|other| *other != name).collect()
}

/// Inputs of a selection run: the products from which the criterion is computed.
pub(crate) struct TermSearch<'a> {
    pub(crate) library: &'a CandidateDictionary,
    pub(crate) products: &'a NormalEquations,
    /// Columns that are always included: parameters with a stated uncertainty.
    pub(crate) always: &'a [usize],
}

impl TermSearch<'_> {
    /// The columns of these candidates and those that are always included.
    pub(crate) fn columns(&self, names: &[usize]) -> Vec<usize> {
        let mut all = self.always.to_vec();
        for name in names {
            for column in &self.library.terms[*name].columns {
                if !all.contains(column) {
                    all.push(*column);
                }
            }
        }
        all
    }

    /// The least-squares solution for these candidates.
    pub(crate) fn solve(&self, names: &[usize]) -> TermSelection {
        TermSelection { terms: names.to_vec(), solved: self.products.solve(&self.columns(names)) }
    }

    /// Number of a candidate's parameters, including searched ones; linearly dependent columns count once.
    pub(crate) fn parameter_count(&self, family: &CandidateTerm) -> f64 {
        (self.products.rank(&family.columns) + family.settings.len()) as f64
    }

    /// The criterion of this run.
    pub(crate) fn criterion(&self) -> Ebic {
        Ebic { rows: self.products.rows as f64, candidates: self.library.terms.len() }
    }

    /// Penalty of a candidate for its parameters and for the number of candidates, in log-likelihood.
    pub(crate) fn penalty(&self, family: &CandidateTerm) -> f64 {
        self.criterion().penalty(self.parameter_count(family))
    }

    /// The gain of an alternative. Signs of a spring are not constrained here: beyond its dead centre a spring acts away from its rest position.
    pub(crate) fn alternative_gain(&self, selection: &TermSelection, name: usize) -> f64 {
        let family = &self.library.terms[name];
        match family.form {
            CoefficientForm::Spring => {
                self.products.gain_of_further(&selection.solved, &family.columns).0
            }
            _ => self.gain_beside(selection, name),
        }
    }

    /// Gain in log-likelihood of a candidate beside a selection; 0 if it violates a sign constraint.
    pub(crate) fn gain_beside(&self, selection: &TermSelection, name: usize) -> f64 {
        let family = &self.library.terms[name];
        let (gain, values) = self.products.gain_of_further(&selection.solved, &family.columns);
        let inside = |k: usize| selection.solved.value(family.columns[k]).unwrap_or(0.0);
        let wrong =
            family.signs.iter().enumerate().any(|(k, sign)| !sign.admits(values[k] + inside(k)));
        if wrong { 0.0 } else { gain }
    }

    /// Removes, one after the other, candidates that violate a sign constraint.
    pub(crate) fn admissible(&self, mut names: Vec<usize>) -> Vec<usize> {
        loop {
            let selection = self.solve(&names);
            let wrong = names.iter().find(|name| !self.is_admissible(&selection, **name)).copied();
            let Some(wrong) = wrong else { return names };
            names.retain(|name| *name != wrong);
        }
    }

    /// Whether the parameters of a candidate satisfy its sign constraints.
    pub(crate) fn is_admissible(&self, selection: &TermSelection, name: usize) -> bool {
        let family = &self.library.terms[name];
        let mut numbers = family.signs.iter().zip(&family.columns);
        numbers.all(|(sign, column)| sign.admits(selection.solved.value(*column).unwrap_or(0.0)))
    }

    /// Gain in log-likelihood of a selected candidate beside the others.
    pub(crate) fn gain_of(&self, selection: &TermSelection, name: usize) -> f64 {
        selection.solved.gain_of(&self.own_columns(selection, name))
    }

    /// The columns of a selected candidate that no other one shares.
    pub(crate) fn own_columns(&self, selection: &TermSelection, name: usize) -> Vec<usize> {
        let families = &self.library.terms;
        let shared = |column: &usize| {
            self.always.contains(column)
                || selection
                    .terms
                    .iter()
                    .any(|n| *n != name && families[*n].columns.contains(column))
        };
        families[name].columns.iter().copied().filter(|column| !shared(column)).collect()
    }

    fn penalty_of(&self, name: usize) -> f64 {
        self.penalty(&self.library.terms[name])
    }

    /// Selection that starts from the candidates `start`.
    pub(crate) fn select(&self, start: &[usize]) -> TermSelection {
        self.select_excluding(start, &[])
    }

    /// The same, without the candidates `never`.
    pub(crate) fn select_excluding(&self, start: &[usize], never: &[usize]) -> TermSelection {
        let mut selection = self.pruned(self.solve(start));
        let mut barred = never.to_vec();
        while selection.terms.len() < MOST {
            let Some((name, _)) = self.best(&selection, &barred) else { break };
            let mut names = selection.terms.clone();
            names.push(name);
            let mut next = self.pruned(self.solve(&names));
            if !next.terms.contains(&name) {
                barred.push(name);
                continue;
            }
            next = self.with_single_payload(self.exchanged(
                next,
                never,
                self.library.terms[name].joint,
            ));
            // A step without improvement would be taken back and repeated forever.
            if self.score(&next) <= self.score(&selection) + 1e-9 {
                barred.push(name);
                continue;
            }
            selection = next;
            barred = never.to_vec();
        }
        selection
    }

    /// Gain in log-likelihood less the penalties of the selected candidates.
    pub(crate) fn score(&self, selection: &TermSelection) -> f64 {
        selection.solved.gain
            - selection.terms.iter().map(|name| self.penalty_of(*name)).sum::<f64>()
    }

    /// Candidates that are not selected, with their gain less penalty beside a selection.
    fn unselected<'a>(
        &'a self,
        selection: &'a TermSelection,
        barred: &'a [usize],
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let families = &self.library.terms;
        let is_selected = move |name: usize| {
            selection
                .terms
                .iter()
                .any(|in_| *in_ == name || families[*in_].is_same_effect(&families[name]))
        };
        (0..families.len())
            .filter(move |name| !barred.contains(name) && !is_selected(*name))
            .map(|name| (name, self.gain_beside(selection, name) - self.penalty_of(name)))
    }

    /// The candidate with the largest gain less penalty, if that exceeds [`MARGIN`].
    fn best(&self, selection: &TermSelection, barred: &[usize]) -> Option<(usize, f64)> {
        let best = self
            .unselected(selection, barred)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        best.filter(|best| best.1 > MARGIN)
    }

    /// Removes selected candidates that are superfluous or violate a sign constraint.
    fn pruned(&self, mut selection: TermSelection) -> TermSelection {
        loop {
            let weakest = selection
                .terms
                .iter()
                .map(|name| (*name, self.gain_of(&selection, *name) - self.penalty_of(*name)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((name, worth)) = weakest else { return selection };
            let wrong =
                || selection.terms.iter().find(|name| !self.is_admissible(&selection, **name));
            let drop = if worth < 0.0 {
                name
            } else if let Some(wrong) = wrong() {
                *wrong
            } else {
                return selection;
            };
            let names: Vec<usize> =
                selection.terms.iter().copied().filter(|n| *n != drop).collect();
            selection = self.solve(&names);
        }
    }

    /// Exchanges candidates of a joint for others if that improves the score, directly or because a third candidate becomes superfluous.
    fn exchanged(
        &self,
        selection: TermSelection,
        never: &[usize],
        joint: Option<usize>,
    ) -> TermSelection {
        self.exchanged_where(selection, never, |name| self.library.terms[*name].joint == joint)
    }

    /// Exchanges candidates of all joints: the best candidate beside a removed one may not be the best without it.
    pub(crate) fn exchanged_everywhere(&self, selection: TermSelection) -> TermSelection {
        self.exchanged_where(selection, &[], |_| true)
    }

    fn exchanged_where(
        &self,
        mut selection: TermSelection,
        never: &[usize],
        wanted: impl Fn(&usize) -> bool,
    ) -> TermSelection {
        for _ in 0..EXCHANGES {
            let better = |name: &usize| self.exchange(&selection, never, *name);
            let mut wanted_terms = selection.terms.iter().filter(|name| wanted(name));
            let Some(next) = wanted_terms.find_map(better) else { break };
            selection = next;
        }
        selection
    }

    /// Replaces the effects `inertia` and `gravity_torque` of all joints by a single payload if that improves the score.
    fn with_single_payload(&self, selection: TermSelection) -> TermSelection {
        let families = &self.library.terms;
        let is_mass = |name: &usize| matches!(families[*name].kind, "inertia" | "gravity_torque");
        if !selection.terms.iter().any(is_mass) {
            return selection;
        }
        let payloads = (0..families.len()).filter(|name| families[*name].kind == "payload");
        let with = |name: usize| {
            let kept = selection.terms.iter().copied().filter(|n| !is_mass(n) && *n != name);
            self.pruned(self.solve(&kept.chain([name]).collect::<Vec<usize>>()))
        };
        let best = payloads.map(with).max_by(|a, b| self.score(a).total_cmp(&self.score(b)));
        best.filter(|best| self.score(best) > self.score(&selection) + 1.0).unwrap_or(selection)
    }

    /// A better selection with an alternative in place of one candidate.
    fn exchange(
        &self,
        selection: &TermSelection,
        never: &[usize],
        name: usize,
    ) -> Option<TermSelection> {
        let others = without_term(&selection.terms, name);
        let without = self.solve(&others);
        let mut open: Vec<(usize, f64)> =
            self.unselected(&without, never).filter(|(other, _)| *other != name).collect();
        open.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let with = |(other, _): &(usize, f64)| {
            let names: Vec<usize> = others.iter().copied().chain([*other]).collect();
            self.pruned(self.solve(&names))
        };
        let likely = open.iter().take(LIKELY).filter(|(_, worth)| *worth > MARGIN);
        likely.map(with).find(|next| self.score(next) > self.score(selection) + 1.0)
    }
}
