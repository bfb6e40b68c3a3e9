//! Unmodelled structure in torques: a torque, dry friction or drag whose size varies smoothly with a covariate.
//!
//! Each function is a series of Chebyshev polynomials of one or two covariates times what it scales (a varying-coefficient model: Hastie and Tibshirani 1993). It is
//! tried beside the selected effects and in place of those of its joint, with the AR noise model estimated again once the function is subtracted: slow
//! structure would otherwise be taken for slow noise. It also shows whether the size of a selected effect varies with speed or position: then it is not that effect.
//!
//! The criterion includes penalties for parameters and for the number of functions tried; a function is reported only if it raises the likelihood of the test set.

use std::cell::RefCell;

use super::case::Case;
use super::columns::Law as Sized;
use super::motion::{Motion, span};
use super::unknown::{Law, Word, words};
use super::{prove, refine};
use crate::engine::noise;
use crate::engine::normal_equations::{Products, Solved};
use crate::engine::sums::Sums;
use crate::engine::table::Column;
use crate::engine::table::Table;
use crate::engine::validation::sum;

/// Polynomials of one word; of time, which may swing more often; of each word of a pair.
const DEGREE: usize = 5;
const DEGREE_OF_TIME: usize = 9;
const DEGREE_OF_PAIR: usize = 3;
/// So many laws are shown to held-out rows, the one that is worth most first.
const LIKELY: usize = 6;
/// What a law must bring beyond its penalty, in log-likelihood.
const MARGIN: f64 = 15.0;
/// Beside names a law explains at least this share of what is left, as energy: less may be what the band does to a turn.
const SHARE: f64 = 0.02;
/// Rounds of hearing the noise and asking.
const ROUNDS: usize = 2;

/// A law, with what stands beside it.
pub(super) struct Beyond {
    pub(super) law: Law,
    /// By how much log-likelihood is higher with it than with the names alone.
    gain: f64,
    /// Names in whose place it stands: they were patches on it.
    pub(super) instead_of: Vec<usize>,
}

/// One law: words, and columns of growing degree; the first says that the size is always the same.
struct Asked {
    words: Vec<String>,
    columns: Vec<Column>,
    /// Whether fewer of its columns are a law too.
    nested: bool,
}

/// The law of one joint that is worth most.
struct Best {
    /// Which names stand beside it.
    kept: usize,
    asked: usize,
    count: usize,
    worth: f64,
}

/// What is asked of one joint: columns of names and laws, and the names' prices.
struct Question<'a> {
    case: &'a Case,
    joint: usize,
    columns: Vec<Column>,
    prior: Vec<f64>,
    laws: &'a [Asked],
    /// Places of each law's columns.
    places: Vec<Vec<usize>>,
    /// Names that stand, their columns' places and prices: all, and without the joint's.
    kept: Vec<(Vec<usize>, Vec<usize>, f64)>,
    /// What was summed last, of this joint's question or another's.
    sums: &'a RefCell<Option<Sums>>,
}

/// What a look at a question says.
struct Looked {
    /// Laws that are worth their penalty, the one that is worth most first.
    found: Vec<Best>,
    /// The fit of the names without any.
    bare: Solved,
    products: Products,
}

/// A word in all its Chebyshev polynomials, its values mapped to −1 to 1: row by row, `T_{k+1} = 2 x T_k − T_{k−1}`.
fn series(word: &Word) -> Vec<Vec<f64>> {
    let most = if word.name == "t_s" { DEGREE_OF_TIME } else { DEGREE };
    let [low, high] = span(word.values.iter().copied());
    let half = (0.5 * (high - low)).max(f64::MIN_POSITIVE);
    let x: Vec<f64> =
        word.values.iter().map(|x| ((x - low) / half - 1.0).clamp(-1.0, 1.0)).collect();
    let mut all = vec![vec![1.0; x.len()], x];
    for k in 1..most {
        let both = all[k].iter().zip(&all[k - 1]);
        let next = all[1].iter().zip(both).map(|(x, (one, before))| 2.0 * x * one - before);
        all.push(next.collect());
    }
    all
}

fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// Everything that is asked of a joint.
fn laws(motion: &Motion, joint: usize) -> Vec<Asked> {
    let words = words(motion, joint);
    let series: Vec<Vec<Vec<f64>>> = words.iter().map(series).collect();
    let own = |stem: &str| format!("{stem}{}", joint + 1);
    // A smooth size passes the filter as its carrier does.
    let carrier = |law: Sized| law.column(motion, joint).parts.remove(0).1;
    let column = |values: Vec<f64>| Column { parts: vec![(joint, values.into())] };
    let mut all = Vec::new();
    let mut add = |carrier: &[f64], name: Option<String>, word: usize| {
        let columns = series[word].iter().map(|one| column(times(carrier, one)));
        let mut of = vec![words[word].name.clone()];
        of.extend(name.filter(|name| *name != of[0]));
        all.push(Asked { words: of, columns: columns.collect(), nested: true });
    };
    let one = carrier(Sized::One);
    let [q, v, a, t] = [0, 1, 2, 3];
    // What bends with acceleration is torque and motion that do not quite meet in time.
    (0..words.len()).filter(|word| *word != a).for_each(|word| add(&one, None, word));
    // What rubs or drags by the place of another joint does so by the load: that has a name.
    let sized = [
        // By speed or acceleration friction seems to change where it turns round, as the band does not tell when exactly it does.
        (Sized::Direction, own("direction_"), &[q, t][..]),
        (Sized::Speed, own("v"), &[q, t]),
    ];
    for (law, name, of) in sized {
        let carrier = carrier(law);
        of.iter().for_each(|word| add(&carrier, Some(name.clone()), *word));
    }
    let degrees = (0..=DEGREE_OF_PAIR).flat_map(|i| (0..=DEGREE_OF_PAIR).map(move |k| (i, k)));
    let columns = degrees.map(|(i, k)| column(times(&series[q][i], &series[v][k])));
    let of = vec![words[q].name.clone(), words[v].name.clone()];
    all.push(Asked { words: of, columns: columns.collect(), nested: false });
    all
}

impl<'a> Question<'a> {
    fn new(
        case: &'a Case,
        (always, names): (&[usize], &[usize]),
        penalty: &dyn Fn(usize) -> f64,
        (joint, laws): (usize, &'a [Asked]),
        sums: &'a RefCell<Option<Sums>>,
    ) -> Self {
        let families = &case.library.families;
        let mut of = always.to_vec();
        let columns = names.iter().flat_map(|name| &families[*name].columns);
        columns.for_each(|column| {
            if !of.contains(column) {
                of.push(*column);
            }
        });
        let place = |column: &usize| of.iter().position(|other| other == column);
        let elsewhere = |name: &usize| families[*name].joint.is_some_and(|other| other != joint);
        let beside: Vec<usize> = names.iter().copied().filter(elsewhere).collect();
        let set = |kept: Vec<usize>| {
            let own = kept.iter().flat_map(|name| &families[*name].columns);
            let places = always.iter().chain(own).filter_map(place);
            let penalty = kept.iter().map(|name| penalty(*name)).sum();
            (kept.clone(), places.collect(), penalty)
        };
        let mut kept = vec![set(names.to_vec())];
        if beside.len() < names.len() {
            kept.push(set(beside));
        }
        let mut columns: Vec<Column> =
            of.iter().map(|k| case.library.columns[*k].clone()).collect();
        let mut prior: Vec<f64> = of.iter().map(|k| case.library.prior[*k]).collect();
        let mut places = Vec::new();
        for law in laws {
            places.push((columns.len()..columns.len() + law.columns.len()).collect());
            columns.extend_from_slice(&law.columns);
            prior.resize(columns.len(), 0.0);
        }
        Self { case, joint, columns, prior, laws, places, kept, sums }
    }

    /// The laws by what `table` believes of the noise.
    fn look(&self, table: &Table, used: &[bool]) -> Looked {
        let sums = Sums::taken(self.sums.take(), table, &self.columns, used);
        let products = sums.products(self.prior.clone());
        self.sums.replace(Some(sums));
        let tried = (self.laws.len() * DEGREE) as f64;
        let rows = (products.rows.max(3) as f64).ln();
        let penalty = |count: usize| 0.5 * count as f64 * rows + tried.ln();
        let bare = products.solve(&self.kept[0].1);
        let least = bare.gain - self.kept[0].2 + MARGIN;
        let mut all: Vec<Best> = Vec::new();
        for (kept, (_, places, of_names)) in self.kept.iter().enumerate() {
            let names = products.solve(places);
            for (asked, own) in self.places.iter().enumerate() {
                let (steady, _) = products.more(&names, &own[..1]);
                let fewest = if self.laws[asked].nested { 2 } else { own.len() };
                let mut best: Option<Best> = None;
                for count in fewest..=own.len() {
                    let (gain, _) = products.more(&names, &own[..count]);
                    let worth = names.gain - of_names + gain - penalty(count);
                    // What is always of the same size is no law.
                    let changes = gain - steady > penalty(count - 1);
                    if changes && best.as_ref().is_none_or(|best| worth > best.worth) {
                        best = Some(Best { kept, asked, count, worth });
                    }
                }
                all.extend(best.filter(|best| best.worth > least));
            }
        }
        all.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        Looked { found: all, bare, products }
    }

    /// The fit of a law with the names beside which it stands.
    fn solved(&self, products: &Products, best: &Best) -> Solved {
        let mut places = self.kept[best.kept].1.clone();
        places.extend(&self.places[best.asked][..best.count]);
        products.solve(&places)
    }

    /// What is left of the joint's torque.
    fn left(&self, solved: &Solved) -> Vec<f64> {
        let parts: Vec<(&Column, f64)> = solved
            .columns
            .iter()
            .zip(&solved.values)
            .map(|(k, x)| (&self.columns[*k], *x))
            .collect();
        let model = Column::sum(&parts, self.joint, self.case.table.rows());
        let target = self.case.table.target[self.joint].iter().flatten();
        target.zip(model).map(|(target, model)| target - model).collect()
    }
}

/// Whether rows that took no part bear a law out: freed of the noise's memory, and as they are. Beside autocorrelated noise a level hardly counts, and a law
/// that leaves one makes the torque no better known.
pub(super) fn is_borne_out(
    table: &Table,
    joint: usize,
    left: [&Vec<f64>; 2],
    held: &[bool],
) -> bool {
    let [before, after] = left.map(|left| sum(table, joint, left, held));
    after < before && prove::is_borne_out(table, joint, left, held)
}

/// The law of one joint, where held-out rows bear it out.
fn of_joint(case: &Case, question: &Question<'_>) -> Option<Beyond> {
    let (seen, held, joint) = (&case.rows.seen(), &case.rows.test, question.joint);
    let mut table = case.table.clone();
    let mut looked = question.look(&table, seen);
    for _ in 1..ROUNDS {
        let solved = looked.found.first().map(|best| question.solved(&looked.products, best));
        let left = question.left(solved.as_ref().unwrap_or(&looked.bare));
        table.noise[joint] = noise::of_left(&table, joint, &left, seen, 0.0);
        looked = question.look(&table, seen);
    }
    let Looked { found, bare, products } = looked;
    let before = question.left(&bare);
    let mut fits = found.into_iter().take(LIKELY).map(|best| {
        let solved = question.solved(&products, &best);
        let after = question.left(&solved);
        (best, solved, after)
    });
    let seen_sum = |left: &Vec<f64>| sum(&table, joint, left, seen);
    let unseen = |left: &Vec<f64>| sum(&table, joint, left, held);
    let stands = |(best, _, after): &(Best, Solved, Vec<f64>)| {
        let is_patched = best.kept > 0;
        (is_patched || seen_sum(after) < (1.0 - SHARE) * seen_sum(&before))
            && is_borne_out(&table, joint, [&before, after], held)
    };
    let (best, solved, after) = fits.find(stands)?;
    let kept = &question.kept[best.kept].0;
    let names = &question.kept[0].0;
    Some(Beyond {
        law: Law {
            joint,
            words: question.laws[best.asked].words.clone(),
            held: [&before, &after].map(unseen),
        },
        gain: solved.gain - bare.gain,
        instead_of: names.iter().copied().filter(|name| !kept.contains(name)).collect(),
    })
}

/// The law that brings most, of the joint that it is of.
pub(super) fn law(case: &Case, always: &[usize], names: &[usize]) -> Option<Beyond> {
    let products = case.products(&case.rows.seen());
    let search = refine::search(case, &products, always);
    let penalty = |name: usize| search.penalty(&case.library.families[name]);
    // In the room of the case's sums, which are as large and are computed again where they are needed.
    let sums = RefCell::new(case.sums.take());
    let one = |joint: usize| {
        let laws = laws(&case.motion, joint);
        of_joint(case, &Question::new(case, (always, names), &penalty, (joint, &laws), &sums))
    };
    case.table.joints().filter_map(one).max_by(|a, b| a.gain.total_cmp(&b.gain))
}
