//! Which names the recording asks for: the one that brings most first, each weighed against all that were asked, with the signs that its physics has.
//!
//! Promises: a name with a number of the wrong sign is not that name; what a later name makes needless goes out again; the same sums give the same choice.
//! Never: a look at rows that were set apart.

use super::library::{Family, Library, Sign};
use super::table::{Products, Solved};

/// What a name must bring beyond its price, in log-likelihood.
const MARGIN: f64 = 5.0;
/// Names at most.
const MOST: usize = 80;

/// Names that stand together, with the columns that are in whatever is named.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    /// Places in the library's families.
    pub(super) names: Vec<usize>,
    pub(super) solved: Solved,
}

/// What is asked, of which sums.
pub(super) struct Asking<'a> {
    pub(super) library: &'a Library,
    pub(super) products: &'a Products,
    /// Columns that are always in: what is believed with doubt.
    pub(super) always: &'a [usize],
}

impl Asking<'_> {
    fn columns(&self, names: &[usize]) -> Vec<usize> {
        let mut all = self.always.to_vec();
        for name in names {
            for column in &self.library.families[*name].columns {
                if !all.contains(column) {
                    all.push(*column);
                }
            }
        }
        all
    }

    pub(super) fn solve(&self, names: &[usize]) -> Choice {
        Choice { names: names.to_vec(), solved: self.products.solve(&self.columns(names)) }
    }

    /// What a name costs: its numbers, and that so many names were asked.
    pub(super) fn price(&self, family: &Family) -> f64 {
        let rows = (self.products.rows.max(3) as f64).ln();
        0.5 * family.numbers() * rows + (self.library.families.len().max(1) as f64).ln()
    }

    /// What a name would bring beside a choice; nothing where its signs are wrong.
    pub(super) fn brings(&self, choice: &Choice, name: usize) -> f64 {
        let family = &self.library.families[name];
        let (gain, values) = self.products.more(&choice.solved, &family.columns);
        let inside = |k: usize| choice.solved.value(family.columns[k]).unwrap_or(0.0);
        let wrong = family
            .signs
            .iter()
            .enumerate()
            .any(|(k, sign)| *sign == Sign::NotNegative && values[k] + inside(k) < 0.0);
        if wrong { 0.0 } else { gain }
    }

    fn is_admissible(&self, choice: &Choice) -> bool {
        choice.names.iter().all(|name| {
            let family = &self.library.families[*name];
            family.signs.iter().zip(&family.columns).all(|(sign, column)| {
                *sign == Sign::Any || choice.solved.value(*column).unwrap_or(0.0) >= 0.0
            })
        })
    }

    /// What a name that stands brings beside the others.
    pub(super) fn worth(&self, choice: &Choice, name: usize) -> f64 {
        let families = &self.library.families;
        let shared = |column: &usize| {
            self.always.contains(column)
                || choice.names.iter().any(|n| *n != name && families[*n].columns.contains(column))
        };
        let own = families[name].columns.iter().copied().filter(|column| !shared(column));
        choice.solved.worth(&own.collect::<Vec<usize>>())
    }

    fn price_of(&self, name: usize) -> f64 {
        self.price(&self.library.families[name])
    }

    /// The names to choose, from those that stand.
    pub(super) fn choose(&self, start: &[usize]) -> Choice {
        let mut choice = self.solve(start);
        let mut barred: Vec<usize> = Vec::new();
        while choice.names.len() < MOST {
            let Some((name, _)) = self.best(&choice, &barred) else { break };
            let mut names = choice.names.clone();
            names.push(name);
            let mut next = self.pruned(self.solve(&names));
            if !next.names.contains(&name) {
                barred.push(name);
                continue;
            }
            next = self.exchanged(next, self.library.families[name].joint);
            // A step that was taken back would be taken again.
            if self.score(&next) <= self.score(&choice) + 1e-9 {
                barred.push(name);
                continue;
            }
            choice = next;
            barred.clear();
        }
        choice
    }

    /// Log-likelihood less what the names cost.
    pub(super) fn score(&self, choice: &Choice) -> f64 {
        choice.solved.gain - choice.names.iter().map(|name| self.price_of(*name)).sum::<f64>()
    }

    /// The name that brings most beyond its price.
    fn best(&self, choice: &Choice, barred: &[usize]) -> Option<(usize, f64)> {
        let open = (0..self.library.families.len()).filter(|name| {
            let family = &self.library.families[*name];
            !barred.contains(name)
                && !choice
                    .names
                    .iter()
                    .any(|in_| in_ == name || self.library.families[*in_].is_kin(family))
        });
        let worth = |name| (name, self.brings(choice, name) - self.price_of(name));
        let best = open.map(worth).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        (best.1 > MARGIN).then_some(best)
    }

    /// Without the names that others make needless, or that took a sign which is not theirs.
    fn pruned(&self, mut choice: Choice) -> Choice {
        loop {
            let weakest = choice
                .names
                .iter()
                .map(|name| (*name, self.worth(&choice, *name) - self.price_of(*name)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((name, worth)) = weakest else { return choice };
            let drop = if worth < 0.0 {
                name
            } else if self.is_admissible(&choice) {
                return choice;
            } else {
                let wrong = choice.names.iter().copied().find(|name| {
                    let family = &self.library.families[*name];
                    family.signs.iter().zip(&family.columns).any(|(sign, column)| {
                        *sign == Sign::NotNegative
                            && choice.solved.value(*column).unwrap_or(0.0) < 0.0
                    })
                });
                wrong.unwrap_or(name)
            };
            let names: Vec<usize> = choice.names.iter().copied().filter(|n| *n != drop).collect();
            choice = self.solve(&names);
        }
    }

    /// With another name or form in the place of one of a joint, where that explains more for its price.
    fn exchanged(&self, mut choice: Choice, joint: Option<usize>) -> Choice {
        for _ in 0..3 {
            let mut changed = false;
            let beside = |name: &usize| self.library.families[*name].joint == joint;
            for name in choice.names.clone().into_iter().filter(beside) {
                let others: Vec<usize> =
                    choice.names.iter().copied().filter(|n| *n != name).collect();
                let without = self.solve(&others);
                let Some((other, _)) = self.best(&without, &[]) else { continue };
                if other == name {
                    continue;
                }
                let mut names = others.clone();
                names.push(other);
                let next = self.pruned(self.solve(&names));
                if self.score(&next) > self.score(&choice) + 1.0 {
                    choice = next;
                    changed = true;
                    break;
                }
            }
            if !changed {
                break;
            }
        }
        choice
    }
}
