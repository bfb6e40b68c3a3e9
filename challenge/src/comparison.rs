//! Signature of an effect compared with alternatives: z, ρ, gains, and its identifiable parameters.
//!
//! All effects are columns of whitened values, of positions, torques or forces. The evaluation does not depend on a solver's answer.

use crate::candidates::Candidate;
use crate::effect::{BlindCase, Effect, EffectKind};
use crate::least_squares::{OrthonormalBasis, dot};

/// If an alternative leaves less than this fraction of an effect's energy, the remainder is rounding: the two are equivalent.
const EQUIVALENT_FRACTION: f64 = 1e-6;
/// A parameter is identifiable only if at least this fraction of its column remains after projection on the others.
const INDEPENDENT_FRACTION: f64 = 1e-4;
/// Log-likelihood difference below which candidates are indistinguishable (docs/diagnosis.md): half the residual sum of squares.
pub const DISTINGUISHABLE_GAIN: f64 = 5.0;

/// An effect in answers: kind and joint (1-based).
pub type EffectName = (&'static str, Option<usize>);

/// Detectability of one hidden effect, known before any answer.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Detectability {
    /// Norm of the whitened effect.
    pub z: f64,
    /// `z` per square root of the number of values: effect-to-noise ratio.
    pub rho: f64,
    /// Smallest expected log-likelihood gain over alternatives with no more parameters.
    pub least_gain: f64,
    /// Alternatives with no more parameters that are indistinguishable.
    pub rivals: Vec<EffectName>,
    /// Equivalent effects, which are accepted as correct answers.
    pub same: Vec<EffectName>,
    /// Norm of the residual of the best single candidate.
    pub unexplained_z: f64,
    /// Whether each of its parameters is identifiable besides the others and the nuisance parameters.
    pub determined: Vec<bool>,
}

/// One hidden effect to be compared with alternatives.
#[derive(Clone, Copy, Debug)]
pub struct EffectComparison<'a> {
    /// Its name; `None` outside the candidate dictionary.
    pub name: Option<EffectName>,
    /// Number of its free parameters.
    pub parameter_count: usize,
    /// Columns of the nuisance parameters.
    pub nuisances: &'a OrthonormalBasis,
    /// The whitened effect after projection on them.
    pub effect: &'a [f64],
    /// Number of values in use.
    pub value_count: usize,
}

impl EffectComparison<'_> {
    /// Compares it with every candidate; `is_related`: whether a candidate of identical signature counts as the same effect.
    #[must_use]
    pub fn compare<E>(
        &self,
        candidates: &[Candidate<E>],
        column: impl Fn(&E) -> Vec<f64>,
        is_related: impl Fn(&str) -> bool,
    ) -> Detectability {
        let energy = dot(self.effect, self.effect);
        let mut detectability = Detectability {
            z: energy.sqrt(),
            rho: (energy / self.value_count as f64).sqrt(),
            least_gain: 0.5 * energy,
            unexplained_z: energy.sqrt(),
            ..Detectability::default()
        };
        for candidate in candidates {
            let name = (candidate.name, candidate.joint);
            if self.name == Some(name) {
                continue;
            }
            let left = self.residual_energy(candidate, energy, &column);
            detectability.unexplained_z = detectability.unexplained_z.min(left.sqrt());
            if candidate.parameter_count > self.parameter_count {
                continue;
            }
            if left < EQUIVALENT_FRACTION * energy && is_related(candidate.name) {
                detectability.same.push(name);
                continue;
            }
            detectability.least_gain = detectability.least_gain.min(0.5 * left);
            if 0.5 * left < DISTINGUISHABLE_GAIN {
                detectability.rivals.push(name);
            }
        }
        detectability.rivals.dedup();
        detectability.same.dedup();
        detectability
    }

    /// Residual energy of the best form of a candidate.
    fn residual_energy<E>(
        &self,
        candidate: &Candidate<E>,
        energy: f64,
        column: impl Fn(&E) -> Vec<f64>,
    ) -> f64 {
        let mut minimum = energy;
        for form in &candidate.forms {
            let mut basis = OrthonormalBasis::default();
            for effect in form {
                basis.add_column(self.nuisances.residual(&column(effect)));
            }
            let mut left = self.effect.to_vec();
            let shares = basis.project_out(&mut left);
            let wrong_sign = candidate.non_negative
                && form.len() == 1
                && shares.first().is_some_and(|x| *x < 0.0);
            if !wrong_sign {
                minimum = minimum.min(dot(&left, &left));
            }
        }
        minimum
    }
}

/// Adds the uncertain parameters of a case's model as nuisance columns, each with its prior as one additional value, except those
/// revised by effects in `except`. `column` returns values followed by [`prior_count`] prior entries.
pub fn add_model_nuisances<C: BlindCase>(
    basis: &mut OrthonormalBasis,
    case: &C,
    except: &[&Effect<C::Kind>],
    column: impl Fn(&Effect<C::Kind>) -> Vec<f64>,
) {
    let readings = prior_count(case);
    let mut reading = 0;
    for modelled in case.modelled() {
        let nominal = &modelled.nominal;
        let is_revised = except.iter().any(|e| e.kind == nominal.kind && e.joint == nominal.joint);
        for (number, sigma) in modelled.sigma.iter().enumerate() {
            let place = reading;
            reading += 1;
            if is_revised {
                continue;
            }
            let mut unit = nominal.clone();
            unit.parameters[..modelled.sigma.len()].fill(0.0);
            unit.parameters[number] = 1.0;
            let mut column = column(&unit);
            let row = column.len() - readings + place;
            column[row] = 1.0 / sigma;
            basis.add_column(column);
        }
    }
}

/// Number of uncertain parameters of a case's model.
#[must_use]
pub fn prior_count<C: BlindCase>(case: &C) -> usize {
    case.modelled().iter().map(|modelled| modelled.sigma.len()).sum()
}

/// Whether each parameter of an effect is identifiable besides the nuisance parameters.
#[must_use]
pub fn identifiable_parameters<K: EffectKind>(
    effect: &Effect<K>,
    basis: &OrthonormalBasis,
    column: impl Fn(&Effect<K>) -> Vec<f64>,
) -> Vec<bool> {
    let unshifted = column(effect);
    let slope = |n: usize| {
        let mut moved = effect.clone();
        moved.parameters[n] += 1e-4 * K::step(effect, n);
        let moved = column(&moved);
        let slope: Vec<f64> = moved.iter().zip(&unshifted).map(|(a, b)| a - b).collect();
        let length = dot(&slope, &slope).sqrt();
        (basis.residual(&slope), length)
    };
    independent_columns(&(0..effect.parameters.len()).map(slope).collect::<Vec<_>>())
}

/// Whether each column, given with its norm before projection on the nuisance parameters, is linearly independent of the others.
fn independent_columns(slopes: &[(Vec<f64>, f64)]) -> Vec<bool> {
    let is_independent = |n: usize| {
        let mut others = OrthonormalBasis::default();
        for (k, (column, length)) in slopes.iter().enumerate() {
            if k != n && dot(column, column).sqrt() > INDEPENDENT_FRACTION * length {
                others.add_column(column.clone());
            }
        }
        let rest = others.residual(&slopes[n].0);
        dot(&rest, &rest).sqrt() > INDEPENDENT_FRACTION * slopes[n].1
    };
    (0..slopes.len()).map(is_independent).collect()
}
