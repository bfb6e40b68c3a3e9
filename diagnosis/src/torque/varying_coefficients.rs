//! Unmodelled structure in torques: a torque, dry friction or drag whose size varies smoothly with a covariate.
//!
//! Each law is a torque, a sign of the velocity or a velocity, multiplied by a series of Chebyshev polynomials in one or two covariates (a
//! varying-coefficient model: Hastie and Tibshirani 1993). It is fitted with the selected effects, and in place of those of its joint, with the AR
//! noise model estimated again from the residual of the law: slowly varying structure would otherwise be taken for autocorrelated noise. The
//! comparison also shows whether the size of a selected effect varies with its covariates, in which case the effect is refuted.
//!
//! The criterion includes penalties for parameters and for the number of laws tried; a law is reported only if it raises the likelihood of the test set.

use std::cell::RefCell;

use super::case::Case;
use super::covariates::{Covariate, UnexplainedTorque, covariates};
use super::motion::{Motion, span};
use super::regressors::TorqueTerm;
use super::{fit_quality, nonlinear_parameters};
use crate::engine::noise;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::product_cache::ProductCache;
use crate::engine::regression_data::RegressionData;
use crate::engine::regression_data::Regressor;
use crate::engine::validation::sum_of_squares;

/// Polynomial degree for one covariate; for time, which may vary faster; for each covariate of a pair.
const DEGREE: usize = 5;
const DEGREE_OF_TIME: usize = 9;
const DEGREE_OF_PAIR: usize = 3;
/// Number of laws tested on the test set at most, in order of decreasing score.
const TESTED_MOST: usize = 6;
/// Minimum gain of a law beyond its penalty, in log-likelihood.
const MARGIN: f64 = 15.0;
/// Minimum share of the residual energy that a law explains in addition to the selected effects; less may be an artefact of the filter at reversals.
const SHARE: f64 = 0.02;
/// Number of passes, each estimating the noise and then evaluating the laws.
const ROUNDS: usize = 2;

/// A smooth law of a joint's residual.
pub(super) struct SmoothLaw {
    pub(super) law: UnexplainedTorque,
    /// Gain in log-likelihood compared with the selected effects alone.
    gain: f64,
    /// Selected effects that it replaces: they had only approximated it.
    pub(super) replaced: Vec<usize>,
}

/// A candidate law: covariates, and columns of increasing degree, the first of which is constant in the covariate.
struct CandidateLaw {
    covariates: Vec<String>,
    columns: Vec<Regressor>,
    /// Whether the first few columns alone are a valid law too.
    nested: bool,
}

/// The best-scoring degree of one law.
struct ScoredLaw {
    /// Index of the set of effects fitted with it, in `Question::kept`.
    effect_set: usize,
    law: usize,
    count: usize,
    worth: f64,
}

/// Regression problem of one joint: columns of effects and laws, and the effects' penalties.
struct JointRegression<'a> {
    case: &'a Case,
    joint: usize,
    columns: Vec<Regressor>,
    prior: Vec<f64>,
    laws: &'a [CandidateLaw],
    /// Indices of each law's columns.
    law_columns: Vec<Vec<usize>>,
    /// Sets of effects (indices, their columns, total penalty): all of them, and those without this joint's.
    effect_sets: Vec<(Vec<usize>, Vec<usize>, f64)>,
    /// Buffer of sums of products, shared between joints.
    sums: &'a RefCell<Option<ProductCache>>,
}

/// Result of evaluating all laws.
struct LawEvaluation {
    /// Laws that exceed their penalty by the margin, best first.
    found: Vec<ScoredLaw>,
    /// Fit of the effects without a law.
    without_law: LeastSquaresSolution,
    products: NormalEquations,
}

/// Chebyshev polynomials of a covariate scaled to −1 to 1, by the recurrence `T_{k+1} = 2 x T_k − T_{k−1}`.
fn chebyshev(covariate: &Covariate) -> Vec<Vec<f64>> {
    let most = if covariate.name == "t_s" { DEGREE_OF_TIME } else { DEGREE };
    let [low, high] = span(covariate.values.iter().copied());
    let half = (0.5 * (high - low)).max(f64::MIN_POSITIVE);
    let x: Vec<f64> =
        covariate.values.iter().map(|x| ((x - low) / half - 1.0).clamp(-1.0, 1.0)).collect();
    let mut all = vec![vec![1.0; x.len()], x];
    for k in 1..most {
        let both = all[k].iter().zip(&all[k - 1]);
        let next = all[1].iter().zip(both).map(|(x, (one, before))| 2.0 * x * one - before);
        all.push(next.collect());
    }
    all
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// All candidate laws of a joint.
fn candidate_laws(motion: &Motion, joint: usize) -> Vec<CandidateLaw> {
    let all_covariates = covariates(motion, joint);
    let series: Vec<Vec<Vec<f64>>> = all_covariates.iter().map(chebyshev).collect();
    let own_name = |stem: &str| format!("{stem}{}", joint + 1);
    // A slowly varying factor passes the filter practically unchanged, so filtered columns are multiplied.
    let carrier = |law: TorqueTerm| law.column(motion, joint).parts.remove(0).1;
    let column = |values: Vec<f64>| Regressor { parts: vec![(joint, values.into())] };
    let mut all = Vec::new();
    let mut add = |carrier: &[f64], name: Option<String>, index: usize| {
        let columns = series[index].iter().map(|one| column(product(carrier, one)));
        let mut names = vec![all_covariates[index].name.clone()];
        names.extend(name.filter(|name| *name != names[0]));
        all.push(CandidateLaw { covariates: names, columns: columns.collect(), nested: true });
    };
    let one = carrier(TorqueTerm::Constant);
    let [q, v, a, t] = [0, 1, 2, 3];
    // Acceleration is excluded: a dependence on it may be a small time offset between torque and motion.
    (0..all_covariates.len()).filter(|index| *index != a).for_each(|index| add(&one, None, index));
    // Friction that depends on another joint's position does so through the load, which is a candidate effect of its own.
    let sized = [
        // Speed and acceleration are excluded: the band limits the knowledge of the instant of reversal, which would look like such a dependence.
        (TorqueTerm::VelocitySign, own_name("direction_"), &[q, t][..]),
        (TorqueTerm::Velocity, own_name("v"), &[q, t]),
    ];
    for (law, name, factors) in sized {
        let carrier = carrier(law);
        factors.iter().for_each(|index| add(&carrier, Some(name.clone()), *index));
    }
    let degrees = (0..=DEGREE_OF_PAIR).flat_map(|i| (0..=DEGREE_OF_PAIR).map(move |k| (i, k)));
    let columns = degrees.map(|(i, k)| column(product(&series[q][i], &series[v][k])));
    let names = vec![all_covariates[q].name.clone(), all_covariates[v].name.clone()];
    all.push(CandidateLaw { covariates: names, columns: columns.collect(), nested: false });
    all
}

impl<'a> JointRegression<'a> {
    fn new(
        case: &'a Case,
        (always, names): (&[usize], &[usize]),
        penalty: &dyn Fn(usize) -> f64,
        (joint, laws): (usize, &'a [CandidateLaw]),
        sums: &'a RefCell<Option<ProductCache>>,
    ) -> Self {
        let families = &case.library.terms;
        let mut columns_used = always.to_vec();
        let columns = names.iter().flat_map(|name| &families[*name].columns);
        columns.for_each(|column| {
            if !columns_used.contains(column) {
                columns_used.push(*column);
            }
        });
        let place = |column: &usize| columns_used.iter().position(|other| other == column);
        let elsewhere = |name: &usize| families[*name].joint.is_some_and(|other| other != joint);
        let beside: Vec<usize> = names.iter().copied().filter(elsewhere).collect();
        let set = |kept: Vec<usize>| {
            let of_effects = kept.iter().flat_map(|name| &families[*name].columns);
            let places = always.iter().chain(of_effects).filter_map(place);
            let penalty = kept.iter().map(|name| penalty(*name)).sum();
            (kept.clone(), places.collect(), penalty)
        };
        let mut effect_sets = vec![set(names.to_vec())];
        if beside.len() < names.len() {
            effect_sets.push(set(beside));
        }
        let mut columns: Vec<Regressor> =
            columns_used.iter().map(|k| case.library.columns[*k].clone()).collect();
        let mut prior: Vec<f64> = columns_used.iter().map(|k| case.library.prior[*k]).collect();
        let mut law_columns = Vec::new();
        for law in laws {
            law_columns.push((columns.len()..columns.len() + law.columns.len()).collect());
            columns.extend_from_slice(&law.columns);
            prior.resize(columns.len(), 0.0);
        }
        Self { case, joint, columns, prior, laws, law_columns, effect_sets, sums }
    }

    /// Scores all laws with the noise model of `table`.
    fn evaluate(&self, table: &RegressionData, used: &[bool]) -> LawEvaluation {
        let sums = ProductCache::updated(self.sums.take(), table, &self.columns, used);
        let products = sums.products(self.prior.clone());
        self.sums.replace(Some(sums));
        let tried = (self.laws.len() * DEGREE) as f64;
        let rows = (products.rows.max(3) as f64).ln();
        let penalty = |count: usize| 0.5 * count as f64 * rows + tried.ln();
        let without_law = products.solve(&self.effect_sets[0].1);
        let worth_min = without_law.gain - self.effect_sets[0].2 + MARGIN;
        let mut all: Vec<ScoredLaw> = Vec::new();
        for (effect_set, (_, places, of_names)) in self.effect_sets.iter().enumerate() {
            let names = products.solve(places);
            for (law, own_columns) in self.law_columns.iter().enumerate() {
                let (steady, _) = products.gain_of_further(&names, &own_columns[..1]);
                let fewest = if self.laws[law].nested { 2 } else { own_columns.len() };
                let mut best: Option<ScoredLaw> = None;
                for count in fewest..=own_columns.len() {
                    let (gain, _) = products.gain_of_further(&names, &own_columns[..count]);
                    let worth = names.gain - of_names + gain - penalty(count);
                    // A law whose size does not vary with its covariate is not reported.
                    let changes = gain - steady > penalty(count - 1);
                    if changes && best.as_ref().is_none_or(|best| worth > best.worth) {
                        best = Some(ScoredLaw { effect_set, law, count, worth });
                    }
                }
                all.extend(best.filter(|best| best.worth > worth_min));
            }
        }
        all.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        LawEvaluation { found: all, without_law, products }
    }

    /// The fit of a law together with its set of effects.
    fn solved(&self, products: &NormalEquations, best: &ScoredLaw) -> LeastSquaresSolution {
        let mut places = self.effect_sets[best.effect_set].1.clone();
        places.extend(&self.law_columns[best.law][..best.count]);
        products.solve(&places)
    }

    /// Residual torque of the joint.
    fn residual(&self, solved: &LeastSquaresSolution) -> Vec<f64> {
        let parts: Vec<(&Regressor, f64)> = solved
            .columns
            .iter()
            .zip(&solved.values)
            .map(|(k, x)| (&self.columns[*k], *x))
            .collect();
        let model = Regressor::linear_combination(&parts, self.joint, self.case.table.rows());
        let target = self.case.table.target[self.joint].iter().flatten();
        target.zip(model).map(|(target, model)| target - model).collect()
    }
}

/// Whether test rows support a law, by the whitened residual and by the residual itself. Autocorrelated noise gives a constant offset little weight,
/// and a law that introduces one does not improve the prediction.
pub(super) fn is_supported(
    table: &RegressionData,
    joint: usize,
    left: [&Vec<f64>; 2],
    held: &[bool],
) -> bool {
    let [before, after] = left.map(|left| sum_of_squares(table, joint, left, held));
    after < before && fit_quality::is_supported(table, joint, left, held)
}

/// The best law of one joint that the test set supports.
fn best_law_of_joint(case: &Case, question: &JointRegression<'_>) -> Option<SmoothLaw> {
    let (training, held, joint) = (&case.row_sets.fitted(), &case.row_sets.test, question.joint);
    let mut table = case.table.clone();
    let mut evaluation = question.evaluate(&table, training);
    for _ in 1..ROUNDS {
        let solved =
            evaluation.found.first().map(|best| question.solved(&evaluation.products, best));
        let left = question.residual(solved.as_ref().unwrap_or(&evaluation.without_law));
        table.noise[joint] = noise::estimate_from_residual(&table, joint, &left, training, 0.0);
        evaluation = question.evaluate(&table, training);
    }
    let LawEvaluation { found, without_law, products } = evaluation;
    let before = question.residual(&without_law);
    let mut fits = found.into_iter().take(TESTED_MOST).map(|best| {
        let solved = question.solved(&products, &best);
        let after = question.residual(&solved);
        (best, solved, after)
    });
    let seen_sum = |left: &Vec<f64>| sum_of_squares(&table, joint, left, training);
    let unseen = |left: &Vec<f64>| sum_of_squares(&table, joint, left, held);
    let supported = |(best, _, after): &(ScoredLaw, LeastSquaresSolution, Vec<f64>)| {
        let is_patched = best.effect_set > 0;
        (is_patched || seen_sum(after) < (1.0 - SHARE) * seen_sum(&before))
            && is_supported(&table, joint, [&before, after], held)
    };
    let (best, solved, after) = fits.find(supported)?;
    let kept = &question.effect_sets[best.effect_set].0;
    let names = &question.effect_sets[0].0;
    Some(SmoothLaw {
        law: UnexplainedTorque {
            joint,
            depends_on: question.laws[best.law].covariates.clone(),
            heldout_squares: [&before, &after].map(unseen),
        },
        gain: solved.gain - without_law.gain,
        replaced: names.iter().copied().filter(|name| !kept.contains(name)).collect(),
    })
}

/// The law with the largest gain over all joints.
pub(super) fn best_law(case: &Case, always: &[usize], names: &[usize]) -> Option<SmoothLaw> {
    let products = case.products(&case.row_sets.fitted());
    let search = nonlinear_parameters::search(case, &products, always);
    let penalty = |name: usize| search.penalty(&case.library.terms[name]);
    // Reuses the buffer of the case's sums, which are recomputed when next needed.
    let sums = RefCell::new(case.sums.take());
    let one = |joint: usize| {
        let laws = candidate_laws(&case.motion, joint);
        best_law_of_joint(
            case,
            &JointRegression::new(case, (always, names), &penalty, (joint, &laws), &sums),
        )
    };
    case.table.joints().filter_map(one).max_by(|a, b| a.gain.total_cmp(&b.gain))
}
