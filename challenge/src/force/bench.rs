//! Detectability of a hidden force effect, and whether another effect would have the same signature: z, ρ and gains as in the other domains
//! ([`crate::weigh`]).
//!
//! Nuisance parameters: the unrecorded spindle angle at the beginning of each pass; amplifier drift and the model's uncertain parameters, each with
//! its prior as one additional value.
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::law::{Law, Trial};
use crate::linear::{Span, dot};
use crate::space::V3;
use crate::view::Whitener;
use crate::weigh::{Judged, Question, determined, readings, take_known};

use super::candidates::{candidates, free_numbers};
use super::case::{Case, along};
use super::kinds::{Effect, Kind};
use super::laws::Ride;
use super::scene::{Phase, Row};
use super::teeth::Shape;

/// Step of the spindle angle for its derivative, rad.
const TURNED: f64 = 0.01;

/// Values of a case, linearised about the model and the other hidden effects.
pub struct Bench<'a> {
    case: &'a Case,
    ride: &'a Ride<'a>,
    whitener: Whitener,
    base: Vec<Effect>,
    still: Vec<V3>,
    drifts: usize,
}

/// Whitening of the rows in use.
#[must_use]
pub fn whitener(case: &Case, ride: &Ride<'_>, counts: &[bool]) -> Whitener {
    let follows = |before: usize, row: usize| ride.rows[before].pass == ride.rows[row].pass;
    Whitener::plain(3, case.noise.colour, counts, follows)
}

/// Values of all axes in units of their noise, row by row.
#[must_use]
pub fn in_noise(case: &Case, forces: &[V3]) -> Vec<f64> {
    let of_row = |force: &V3| -> V3 { std::array::from_fn(|k| force[k] / case.noise.total(k)) };
    forces.iter().flat_map(of_row).collect()
}

impl<'a> Bench<'a> {
    /// The columns of recorded rows for which the force laws are defined; `asked`: index of the hidden effect under evaluation.
    #[must_use]
    pub fn of(case: &'a Case, ride: &'a Ride<'a>, there: &[bool], asked: Option<usize>) -> Self {
        let others = case.hidden.iter().enumerate().filter(|(k, _)| Some(*k) != asked);
        let base: Vec<Effect> =
            case.nominal().into_iter().chain(others.map(|(_, effect)| effect.clone())).collect();
        let still = ride.read(&base);
        let rows = ride.rows.iter().zip(there);
        let counts: Vec<bool> =
            rows.map(|(row, there)| *there && row.phase != Phase::Between).collect();
        let drifts = if case.noise.drift > 0.0 { 3 * ride.scene.passes.len() } else { 0 };
        Self { case, ride, whitener: whitener(case, ride, &counts), base, still, drifts }
    }

    /// Whitened values, followed by the prior entries: those of drifts, then those of the model's parameters.
    fn whiten(&self, forces: &[V3]) -> Vec<f64> {
        let mut whitened = self.whitener.apply(&in_noise(self.case, forces));
        whitened.resize(whitened.len() + self.drifts + readings(self.case), 0.0);
        whitened
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        let mut all = self.base.clone();
        all.push(effect.clone());
        self.whiten(&minus(&self.ride.read(&all), &self.still))
    }

    /// Nuisance columns; the model's parameters except those that `except` revises.
    #[must_use]
    pub fn nuisances(&self, except: &Effect) -> Span {
        let mut span = Span::default();
        let of_pass = |number: usize, value: &dyn Fn(&Row, usize) -> V3| -> Vec<V3> {
            let rows = self.ride.rows.iter().enumerate();
            rows.map(|(k, row)| if row.pass == number { value(row, k) } else { [0.0; 3] }).collect()
        };
        let passes = self.ride.scene.passes.len();
        if !self.case.cut.turning {
            let shape = Shape { turned: TURNED, ..Shape::default() };
            let turned = minus(&self.ride.read_by(&self.base, shape), &self.still);
            for number in 0..passes {
                span.take(self.whiten(&of_pass(number, &|_, k| turned[k])));
            }
        }
        for drift in 0..self.drifts {
            let (number, axis) = (drift / 3, drift % 3);
            let ramp = |row: &Row, _: usize| {
                let mut force = [0.0; 3];
                force[axis] = along(self.ride.scene, row);
                force
            };
            let mut column = self.whiten(&of_pass(number, &ramp));
            let at = column.len() - readings(self.case) - self.drifts + drift;
            column[at] = 1.0 / (self.case.noise.drift * self.case.noise.sigma[axis]);
            span.take(column);
        }
        take_known(&mut span, self.case, &[except], |effect| self.column(effect));
        span
    }

    /// Norm of a hidden effect after projection on the nuisance columns.
    #[must_use]
    pub fn strength(&self, effect: &Effect, span: &Span) -> f64 {
        let rest = span.rest(&self.column(effect));
        dot(&rest, &rest).sqrt()
    }

    /// Detectability of hidden effect `which`, for which the columns were prepared.
    #[must_use]
    pub fn judge(&self, which: usize) -> Judged {
        let truth = &self.case.hidden[which];
        let mut span = self.nuisances(truth);
        for (k, other) in self.case.hidden.iter().enumerate() {
            if k != which {
                span.take(self.column(other));
            }
        }
        let all = self.ride.read(&self.case.real());
        let mut without = self.case.real();
        without.remove(self.case.known.len() + which);
        let rest = span.rest(&self.whiten(&minus(&all, &self.ride.read(&without))));
        let question = Question {
            name: truth.kind.name().map(|name| (name, None)),
            numbers: free_numbers(&self.case.cut, truth.kind),
            span: &span,
            rest: &rest,
            values: self.whitener.count(),
        };
        let candidates = candidates(&self.case.cut, self.ride.scene);
        let mut judged = question.weigh(&candidates, |effect| self.column(effect), |_| false);
        judged.determined = determined(truth, &span, |effect| self.column(effect));
        match truth.kind {
            // Zero cross-talk coefficients are not parameters of the truth.
            Kind::CrossTalk => {
                let leaks = truth.numbers.iter().map(|x| *x != 0.0);
                judged.determined.iter_mut().zip(leaks).for_each(|(told, leaks)| *told &= leaks);
            }
            // With two teeth only the cosine of a runout is observable.
            Kind::Runout if self.case.cut.teeth == 2 => judged.determined.fill(false),
            _ => {}
        }
        judged
    }
}

fn minus(a: &[V3], b: &[V3]) -> Vec<V3> {
    a.iter().zip(b).map(|(a, b)| crate::space::sub(*a, *b)).collect()
}
