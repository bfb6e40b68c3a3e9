//! Smooth laws for unmodelled structure: a force on one axis, or the cutting, chip or edge force, whose size varies with a covariate.
//!
//! Each is the force times a linear or piecewise linear function of the covariate (a varying-coefficient model: Hastie and Tibshirani 1993). It is
//! fitted together with all nuisance parameters on all axes concerned: otherwise the amplifier drift would absorb part of a step, and time would seem
//! to explain what depends on the feed. Among equivalent laws the one with fewer parameters is preferred: with three feeds and three speeds, a linear
//! function of one can be reproduced by a piecewise linear function of the other.
//!
//! The criterion includes penalties for parameters and for the number of laws tried; a law is selected on the training set and kept if validation and
//! test set support it.

use std::f64::consts::TAU;

use super::case::{Case, Estimates};
use super::cut_model::{CHIP, EDGE};
use super::unexplained::UnexplainedForce;
use crate::engine::normal_equations::{LeastSquaresSolution, NormalEquations};
use crate::engine::product_cache::ProductCache;
use crate::engine::regression_data::Regressor;
use crate::engine::regression_data::residual;
use crate::engine::validation::sum_of_squares;

/// Number of knots of a covariate; for the spindle angle, per tooth.
const KNOTS: usize = 8;
const KNOTS_OF_TOOTH: usize = 4;
/// Minimum gain of a law beyond its penalty, in log-likelihood.
const MARGIN: f64 = 10.0;
/// Minimum share of the residual energy on its axes that a law explains on held-out rows.
const SHARE: f64 = 5e-3;

/// A covariate and its value per row.
struct Covariate {
    name: &'static str,
    values: Vec<f64>,
    knots: usize,
}

/// A candidate law: its covariates and columns. The first column is constant in the covariate, the second linear.
struct CandidateLaw {
    covariates: Vec<&'static str>,
    columns: Vec<Regressor>,
}

/// A law that held-out rows support.
pub(super) struct ConfirmedLaw {
    pub(super) structure: UnexplainedForce,
    /// Its residual per axis, N.
    pub(super) residual: [Vec<f64>; 3],
    /// Gain in log-likelihood on training rows, less its penalty.
    pub(super) score: f64,
}

/// A law whose gain exceeds its penalty.
struct ScoredLaw {
    law: usize,
    columns: usize,
    score: f64,
}

/// The best law in addition to the given library columns, for given parameters.
pub(super) fn best_confirmed_law(
    case: &Case,
    beside: &[usize],
    estimates: &Estimates,
) -> Option<ConfirmedLaw> {
    let laws = laws(case, estimates);
    let mut found = laws_above_penalty(case, beside, &laws);
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found.iter().find_map(|one| confirmed_law(case, beside, &laws[one.law], one))
}

/// All candidate laws: a force on each axis, then the cutting force, its chip part and its edge part, each as a function of each covariate.
fn laws(case: &Case, estimates: &Estimates) -> Vec<CandidateLaw> {
    let read = case.readings(estimates);
    let mut all = Vec::new();
    let mut add =
        |carrier: &[(usize, Vec<f64>)], covariate: &Covariate, beside: Option<&'static str>| {
            let counts = |value: &f64| *value != covariate.values[0];
            if covariate.values.iter().any(counts) {
                let covariates = [Some(covariate.name), beside].into_iter().flatten().collect();
                all.push(CandidateLaw { covariates, columns: carrier_columns(carrier, covariate) });
            }
        };
    let all_covariates = covariates(case, estimates);
    for axis in case.table.joints() {
        let push = [(axis, vec![1.0; case.model.rows.len()])];
        let of_axis = Covariate { name: "wrench", values: read[axis].clone(), knots: KNOTS };
        all_covariates
            .iter()
            .chain([&feed_covariate(case), &of_axis])
            .for_each(|covariate| add(&push, covariate, None));
    }
    for carrier in force_carriers(case, estimates, &read) {
        all_covariates.iter().for_each(|covariate| add(&carrier, covariate, Some("wrench")));
    }
    all
}

/// Covariates of every row.
fn covariates(case: &Case, estimates: &Estimates) -> Vec<Covariate> {
    let rows = &case.model.rows;
    let teeth = case.model.cutter.teeth.max(1);
    let turn = |row: usize, by: f64| estimates.spindle.angle(&rows[row]).rem_euclid(by);
    let speeds = speeds(case);
    let covariate = |name, knots, value: &dyn Fn(usize) -> f64| Covariate {
        name,
        values: (0..rows.len()).map(value).collect(),
        knots,
    };
    let mut covariates = vec![
        covariate("spindle_rpm", KNOTS, &|row| speeds[rows[row].segment]),
        covariate("spindle_rpm", KNOTS, &|row| turn(row, TAU / f64::from(teeth))),
        covariate("feed_mm_s", KNOTS, &|row| rows[row].feed_per_tooth_m),
        covariate("t_s", KNOTS, &|row| rows[row].time_s),
        covariate("t_s", KNOTS, &|row| rows[row].relative_time),
    ];
    if teeth > 1 {
        let knots = KNOTS.max(KNOTS_OF_TOOTH * teeth as usize);
        covariates.push(covariate("spindle_rpm", knots, &|row| turn(row, TAU)));
    }
    covariates
}

/// Whether the tool is fed.
fn feed_covariate(case: &Case) -> Covariate {
    let is_fed =
        case.model.rows.iter().map(|state| f64::from(u8::from(state.feed_per_tooth_m > 0.0)));
    Covariate { name: "feed_mm_s", values: is_fed.collect(), knots: 2 }
}

/// Spindle speed in each segment, rad/s.
fn speeds(case: &Case) -> Vec<f64> {
    let mut speeds = vec![0.0; case.estimates.spindle.phases.len()];
    for state in case.model.rows.iter().filter(|state| state.time_s > 0.0) {
        speeds[state.segment] = state.angle_rad / state.time_s;
    }
    speeds
}

/// The predicted force, its chip part and its edge part: axes and their values, N.
fn force_carriers(
    case: &Case,
    estimates: &Estimates,
    read: &[Vec<f64>; 3],
) -> [Vec<(usize, Vec<f64>)>; 3] {
    let air = case.model.reading_model(&estimates.parameters).reading_in_air();
    let axes = || case.table.joints();
    let whole = axes().map(|axis| (axis, read[axis].iter().map(|x| x - air[axis]).collect()));
    let bites = case.model.all_tooth_forces(&estimates.spindle);
    let coefficients = case.coefficients();
    let part = |which: usize| {
        let (from, stated) = coefficients[which];
        let wanted: Vec<usize> = (from..from + 3).collect();
        let slopes = case.model.derivatives(&bites, &estimates.parameters, &wanted);
        let sizes: Vec<f64> = (0..3).map(|k| stated[k] + estimates.parameters[from + k]).collect();
        let value = |axis: usize, row: usize| -> f64 {
            sizes.iter().zip(&slopes).map(|(size, slope)| size * slope[axis][row]).sum()
        };
        let part_of_axis = |axis| (axis, (0..bites.len()).map(|row| value(axis, row)).collect());
        axes().map(part_of_axis).collect()
    };
    debug_assert_eq!([coefficients[0].0, coefficients[1].0], [CHIP.from, EDGE.from]);
    [whole.collect(), part(0), part(1)]
}

/// The carrier force times 1, times the covariate scaled to −1 to 1, and times a hat function at each inner knot.
fn carrier_columns(carrier: &[(usize, Vec<f64>)], covariate: &Covariate) -> Vec<Regressor> {
    let mut knots = knots(&covariate.values, covariate.knots);
    if knots.len() < 2 {
        knots = vec![covariate.values[0], covariate.values[0] + 1.0];
    }
    let (low, high) = (knots[0], knots[knots.len() - 1]);
    let column = |size: &dyn Fn(f64) -> f64| {
        let part = |(axis, values): &(usize, Vec<f64>)| {
            let rows = values.iter().zip(&covariate.values).map(|(x, value)| x * size(*value));
            (*axis, rows.collect::<Vec<f64>>().into())
        };
        Regressor { parts: carrier.iter().map(part).collect() }
    };
    let mut all = vec![column(&|_| 1.0), column(&|value| 2.0 * (value - low) / (high - low) - 1.0)];
    for three in knots.windows(3) {
        let rises = |value: f64| (value - three[0]) / (three[1] - three[0]);
        let falls = |value: f64| (three[2] - value) / (three[2] - three[1]);
        all.push(column(&|value| rises(value).min(falls(value)).max(0.0)));
    }
    all
}

/// Knots at even quantiles of the covariate.
fn knots(values: &[f64], count: usize) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quantile = |k: usize| sorted[(k * (sorted.len() - 1)) / (count - 1)];
    let mut knots: Vec<f64> = (0..count).map(quantile).collect();
    knots.dedup_by(|a, b| *a <= *b);
    knots
}

/// The laws whose gain on training rows exceeds their penalty.
fn laws_above_penalty(case: &Case, beside: &[usize], laws: &[CandidateLaw]) -> Vec<ScoredLaw> {
    let mut kept = None;
    let mut found = Vec::new();
    for (law, candidate) in laws.iter().enumerate() {
        let (sums, products) = products(case, beside, candidate, &case.row_sets.train, kept.take());
        kept = Some(sums);
        let gain = |columns: usize| fit_with_law(&products, beside, columns).gain;
        let rows = 0.5 * (products.rows.max(3) as f64).ln();
        let penalty = |columns: usize| rows * columns as f64 + (laws.len() as f64).ln();
        let (without_law, steady) = (gain(0), gain(1));
        for columns in [2, candidate.columns.len()] {
            let whole = gain(columns);
            let score = whole - without_law - penalty(columns);
            // A law whose size does not vary with its covariate is not reported.
            if score > MARGIN && whole - steady > MARGIN + penalty(columns - 1) {
                found.push(ScoredLaw { law, columns, score });
            }
        }
    }
    found
}

/// Normal equations of the library columns `beside`, followed by those of a law.
fn products(
    case: &Case,
    beside: &[usize],
    law: &CandidateLaw,
    used: &[bool],
    kept: Option<ProductCache>,
) -> (ProductCache, NormalEquations) {
    let library = beside.iter().map(|k| case.library.columns[*k].clone());
    let columns: Vec<Regressor> = library.chain(law.columns.iter().cloned()).collect();
    let mut prior: Vec<f64> = beside.iter().map(|k| case.library.prior[*k]).collect();
    prior.resize(columns.len(), 0.0);
    let sums = ProductCache::updated(kept, &case.table, &columns, used);
    let products = sums.products(prior);
    (sums, products)
}

/// The fit with the first `columns` columns of a law.
fn fit_with_law(
    products: &NormalEquations,
    beside: &[usize],
    columns: usize,
) -> LeastSquaresSolution {
    products.solve(&(0..beside.len() + columns).collect::<Vec<usize>>())
}

/// A law with its residual, if validation and test rows support it.
fn confirmed_law(
    case: &Case,
    beside: &[usize],
    law: &CandidateLaw,
    found: &ScoredLaw,
) -> Option<ConfirmedLaw> {
    let library = beside.iter().map(|k| case.library.columns[*k].clone());
    let all: Vec<Regressor> = library.chain(law.columns.iter().cloned()).collect();
    // Residuals without and with the law.
    let lefts = |used: &[bool]| {
        let (_, products) = products(case, beside, law, used, None);
        [0, found.columns].map(|columns| {
            let solved = fit_with_law(&products, beside, columns);
            let left = |axis| residual(&case.table, &all, &solved, axis);
            std::array::from_fn(|axis| {
                case.measured[axis].as_ref().map_or(Vec::new(), |_| left(axis))
            })
        })
    };
    let axes: Vec<usize> = law.columns[0].parts.iter().map(|(axis, _)| *axis).collect();
    // Energy of the residual, in units of the innovation variance.
    let energy = |left: &[Vec<f64>; 3], used: &[bool]| -> f64 {
        let white = |axis: &usize| case.table.whitened(*axis, &left[*axis]);
        axes.iter().map(|axis| sum_of_squares(&case.table, *axis, &white(axis), used)).sum()
    };
    let explains = |[without, with]: &[[Vec<f64>; 3]; 2], used: &[bool]| {
        energy(with, used) < (1.0 - SHARE) * energy(without, used)
    };
    if !explains(&lefts(&case.row_sets.train), &case.row_sets.validation) {
        return None;
    }
    let held = &case.row_sets.test;
    let both = lefts(&case.row_sets.fitted());
    if !explains(&both, held) {
        return None;
    }
    let energy_explained = energy(&both[0], held) - energy(&both[1], held);
    let rms = |axis: usize, left: &[Vec<f64>; 3]| {
        let ones = vec![1.0; left[axis].len()];
        let rows = sum_of_squares(&case.table, axis, &ones, held).max(1.0);
        libm::sqrt(sum_of_squares(&case.table, axis, &left[axis], held) / rows)
    };
    let each = axes.iter().map(|axis| (*axis, [rms(*axis, &both[0]), rms(*axis, &both[1])]));
    let (axis, rms) = each.max_by(|a, b| (a.1[0] / a.1[1]).total_cmp(&(b.1[0] / b.1[1])))?;
    let mut depends_on: Vec<String> =
        law.covariates.iter().map(|covariate| (*covariate).to_owned()).collect();
    depends_on.dedup();
    let structure =
        UnexplainedForce { axis, depends_on, heldout: rms, tone_hz: None, energy_explained };
    let [_, residual] = both;
    Some(ConfirmedLaw { structure, residual, score: found.score })
}
