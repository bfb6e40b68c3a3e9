//! Signature of an effect compared with alternatives: z, ρ, gains, and its identifiable parameters.
//!
//! All effects are columns of whitened values, of positions, torques or forces. The evaluation does not depend on a solver's answer.

use crate::candidates::Candidate;
use crate::law::{Effect, Law, Trial};
use crate::linear::{Span, dot};

/// If an alternative leaves less than this fraction of an effect's energy, the remainder is rounding: the two are equivalent.
const SAME: f64 = 1e-6;
/// A parameter is identifiable only if at least this fraction of its column remains after projection on the others.
const CLEAR: f64 = 1e-4;
/// Log-likelihood difference below which candidates are indistinguishable (docs/diagnosis.md): half the residual sum of squares.
pub const APART: f64 = 5.0;

/// An effect in answers: kind and joint (1-based).
pub type Name = (&'static str, Option<usize>);

/// Detectability of one hidden effect, known before any answer.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Judged {
    /// Norm of the whitened effect.
    pub z: f64,
    /// `z` per square root of the number of values: effect-to-noise ratio.
    pub rho: f64,
    /// Smallest expected log-likelihood gain over alternatives with no more parameters.
    pub least_gain: f64,
    /// Alternatives with no more parameters that are indistinguishable.
    pub rivals: Vec<Name>,
    /// Equivalent effects, which are accepted as correct answers.
    pub same: Vec<Name>,
    /// Norm of the residual of the best single candidate.
    pub unexplained_z: f64,
    /// Whether each of its parameters is identifiable besides the others and the nuisance parameters.
    pub determined: Vec<bool>,
}

/// One hidden effect to be compared with alternatives.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// Its name; `None` outside the candidate dictionary.
    pub name: Option<Name>,
    /// Number of its free parameters.
    pub numbers: usize,
    /// Columns of the nuisance parameters.
    pub span: &'a Span,
    /// The whitened effect after projection on them.
    pub rest: &'a [f64],
    /// Number of values in use.
    pub values: usize,
}

impl Question<'_> {
    /// Compares it with every candidate; `kin`: whether a candidate of identical signature counts as the same effect.
    #[must_use]
    pub fn weigh<E>(
        &self,
        candidates: &[Candidate<E>],
        column: impl Fn(&E) -> Vec<f64>,
        kin: impl Fn(&str) -> bool,
    ) -> Judged {
        let energy = dot(self.rest, self.rest);
        let mut judged = Judged {
            z: energy.sqrt(),
            rho: (energy / self.values as f64).sqrt(),
            least_gain: 0.5 * energy,
            unexplained_z: energy.sqrt(),
            ..Judged::default()
        };
        for candidate in candidates {
            let name = (candidate.name, candidate.joint);
            if self.name == Some(name) {
                continue;
            }
            let left = self.left(candidate, energy, &column);
            judged.unexplained_z = judged.unexplained_z.min(left.sqrt());
            if candidate.count > self.numbers {
                continue;
            }
            if left < SAME * energy && kin(candidate.name) {
                judged.same.push(name);
                continue;
            }
            judged.least_gain = judged.least_gain.min(0.5 * left);
            if 0.5 * left < APART {
                judged.rivals.push(name);
            }
        }
        judged.rivals.dedup();
        judged.same.dedup();
        judged
    }

    /// Residual energy of the best form of a candidate.
    fn left<E>(
        &self,
        candidate: &Candidate<E>,
        energy: f64,
        column: impl Fn(&E) -> Vec<f64>,
    ) -> f64 {
        let mut least = energy;
        for form in &candidate.forms {
            let mut own = Span::default();
            for effect in form {
                own.take(self.span.rest(&column(effect)));
            }
            let mut left = self.rest.to_vec();
            let shares = own.remove(&mut left);
            let wrong_sign = candidate.not_negative
                && form.len() == 1
                && shares.first().is_some_and(|x| *x < 0.0);
            if !wrong_sign {
                least = least.min(dot(&left, &left));
            }
        }
        least
    }
}

/// Adds the uncertain parameters of a case's model as nuisance columns, each with its prior as one additional value, except those
/// revised by effects in `except`. `column` returns values followed by [`readings`] prior entries.
pub fn take_known<C: Trial>(
    span: &mut Span,
    case: &C,
    except: &[&Effect<C::Kind>],
    column: impl Fn(&Effect<C::Kind>) -> Vec<f64>,
) {
    let readings = readings(case);
    let mut reading = 0;
    for known in case.known() {
        let nominal = &known.nominal;
        let is_revised = except.iter().any(|e| e.kind == nominal.kind && e.joint == nominal.joint);
        for (number, sigma) in known.sigma.iter().enumerate() {
            let place = reading;
            reading += 1;
            if is_revised {
                continue;
            }
            let mut unit = nominal.clone();
            unit.numbers[..known.sigma.len()].fill(0.0);
            unit.numbers[number] = 1.0;
            let mut column = column(&unit);
            let at = column.len() - readings + place;
            column[at] = 1.0 / sigma;
            span.take(column);
        }
    }
}

/// Number of uncertain parameters of a case's model.
#[must_use]
pub fn readings<C: Trial>(case: &C) -> usize {
    case.known().iter().map(|known| known.sigma.len()).sum()
}

/// Whether each parameter of an effect is identifiable besides the nuisance parameters.
#[must_use]
pub fn determined<K: Law>(
    effect: &Effect<K>,
    span: &Span,
    column: impl Fn(&Effect<K>) -> Vec<f64>,
) -> Vec<bool> {
    let here = column(effect);
    let slope = |n: usize| {
        let mut moved = effect.clone();
        moved.numbers[n] += 1e-4 * K::step(effect, n);
        let moved = column(&moved);
        let slope: Vec<f64> = moved.iter().zip(&here).map(|(a, b)| a - b).collect();
        let length = dot(&slope, &slope).sqrt();
        (span.rest(&slope), length)
    };
    own_columns(&(0..effect.numbers.len()).map(slope).collect::<Vec<_>>())
}

/// Whether each column, given with its norm before projection on the nuisance parameters, is linearly independent of the others.
fn own_columns(slopes: &[(Vec<f64>, f64)]) -> Vec<bool> {
    let own = |n: usize| {
        let mut others = Span::default();
        for (k, (column, length)) in slopes.iter().enumerate() {
            if k != n && dot(column, column).sqrt() > CLEAR * length {
                others.take(column.clone());
            }
        }
        let rest = others.rest(&slopes[n].0);
        dot(&rest, &rest).sqrt() > CLEAR * slopes[n].1
    };
    (0..slopes.len()).map(own).collect()
}
