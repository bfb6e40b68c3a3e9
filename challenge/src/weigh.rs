//! Signature of an effect compared with alternatives: z, ρ, gains, and its identifiable parameters.
//!
//! Everything is a column of whitened values here, of positions or of torques.
//!
//! Promises: no answer of a solver is looked at. Never: a law.

use crate::candidates::Candidate;
use crate::law::{Effect, Law, Trial};
use crate::linear::{Span, dot};

/// Below this share of an effect's energy what a rival leaves is rounding: the two are one thing under two names.
const SAME: f64 = 1e-6;
/// Share of a number's own column that must be left for it to be told at all.
const CLEAR: f64 = 1e-4;
/// Half of the energy below which candidates cannot be distinguished (docs/diagnosis.md).
pub const APART: f64 = 5.0;

/// A name in answers: kind and joint (from 1).
pub type Name = (&'static str, Option<usize>);

/// What can be said of one hidden effect before anyone answers.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Judged {
    /// Length of the whitened effect.
    pub z: f64,
    /// Per value.
    pub rho: f64,
    /// Least expected gain over rivals with no more numbers.
    pub least_gain: f64,
    /// Rivals with no more numbers that cannot be told apart.
    pub rivals: Vec<Name>,
    /// Names that mean the same here.
    pub same: Vec<Name>,
    /// Length of what the best single candidate leaves.
    pub unexplained_z: f64,
    /// Which of its numbers can be told at all beside the others and what is fitted anyway.
    pub determined: Vec<bool>,
}

/// What is asked about one hidden effect.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// Its name; none outside the library.
    pub name: Option<Name>,
    /// How many free numbers it has.
    pub numbers: usize,
    /// What is fitted anyway.
    pub span: &'a Span,
    /// What the effect shows beside that, whitened.
    pub rest: &'a [f64],
    /// How many values count.
    pub values: usize,
}

impl Question<'_> {
    /// Against every candidate; `kin`: whether a name means the same where it shows the same.
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

    /// The energy that the best form of a candidate leaves.
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

/// Takes what a case's model knows, each uncertain number with one reading of its uncertainty behind the values; not what `except` revises.
/// `column` gives values with [`readings`] places behind them.
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

/// How many numbers of a case's model are uncertain.
#[must_use]
pub fn readings<C: Trial>(case: &C) -> usize {
    case.known().iter().map(|known| known.sigma.len()).sum()
}

/// Which numbers of an effect have a column of their own beside what is fitted anyway.
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

/// Which columns, each with its length before what is fitted anyway was taken out, say something that the others do not.
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
