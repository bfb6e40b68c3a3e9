//! Detectability of a hidden torque effect, and whether another effect would have the same signature: z, ρ and gains as in the position domain
//! ([`crate::weigh`]), with masses that the model does not state as nuisance parameters instead of the registration.
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::arm::Joints;
use crate::law::{Law, Trial};
use crate::linear::{Span, dot};
use crate::view::Whitener;
use crate::weigh::{Judged, Question, determined, readings, take_known};

use super::candidates::candidates;
use super::case::Case;
use super::kinds::Effect;
use super::laws::{Ride, recorded};
use super::motion::Motion;
use super::rig::Rig;

/// Values of a case, linearised about the model and the other hidden effects.
pub struct Bench<'a> {
    case: &'a Case,
    motion: &'a Motion,
    ride: &'a Ride,
    whitener: Whitener,
    base: Vec<Effect>,
    still: Vec<Joints>,
}

/// Whitening of the recorded rows.
#[must_use]
pub fn whitener(case: &Case, ride: &Ride, there: &[bool]) -> Whitener {
    let follows = |before: usize, row: usize| ride.at[before].0 == ride.at[row].0;
    Whitener::plain(case.rig.count(), case.noise.colour, there, follows)
}

/// Values of all joints in units of their noise, row by row.
#[must_use]
pub fn in_noise(case: &Case, torques: &[Joints]) -> Vec<f64> {
    let count = case.rig.count();
    torques
        .iter()
        .flat_map(|torques| (0..count).map(|i| torques[i] / case.noise.total(i)))
        .collect()
}

/// Torques of unit masses that the model does not state: nuisance columns.
#[must_use]
pub fn unsaid(rig: &Rig, ride: &Ride) -> Vec<Vec<Joints>> {
    if rig.told {
        return Vec::new();
    }
    let probes = (0..rig.count()).flat_map(Rig::probes);
    probes.map(|probe| ride.held(rig, &[probe])).collect()
}

impl<'a> Bench<'a> {
    /// The columns of the recorded rows. `asked`: index of the hidden effect under evaluation, which is excluded from the base point; `None`: all
    /// hidden effects are included.
    #[must_use]
    pub fn of(
        case: &'a Case,
        (motion, ride): (&'a Motion, &'a Ride),
        there: &[bool],
        asked: Option<usize>,
    ) -> Self {
        let others = case.hidden.iter().enumerate().filter(|(k, _)| Some(*k) != asked);
        let base: Vec<Effect> =
            case.nominal().into_iter().chain(others.map(|(_, effect)| effect.clone())).collect();
        let still = recorded(&case.rig, motion, ride, &base);
        Self { case, motion, ride, whitener: whitener(case, ride, there), base, still }
    }

    fn whiten(&self, torques: &[Joints]) -> Vec<f64> {
        let mut whitened = self.whitener.apply(&in_noise(self.case, torques));
        whitened.resize(whitened.len() + readings(self.case), 0.0);
        whitened
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        let mut all = self.base.clone();
        all.push(effect.clone());
        let moved = recorded(&self.case.rig, self.motion, self.ride, &all);
        self.whiten(&minus(&moved, &self.still))
    }

    /// Nuisance columns: unstated masses, and the model's parameters with their priors, except those that `except` revises.
    #[must_use]
    pub fn nuisances(&self, except: &Effect) -> Span {
        let mut span = Span::default();
        for torques in unsaid(&self.case.rig, self.ride) {
            span.take(self.whiten(&torques));
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
        let all = recorded(&self.case.rig, self.motion, self.ride, &self.case.real());
        let mut without = self.case.real();
        without.remove(self.case.known.len() + which);
        let without = recorded(&self.case.rig, self.motion, self.ride, &without);
        let rest = span.rest(&self.whiten(&minus(&all, &without)));
        let question = Question {
            name: truth.kind.name().map(|name| (name, truth.joint_said())),
            numbers: truth.kind.count(),
            span: &span,
            rest: &rest,
            values: self.whitener.count(),
        };
        let kin = |name: &str| truth.kind.name().is_some_and(|own| are_masses(own, name));
        let mut judged = question.weigh(&candidates(self.case), |effect| self.column(effect), kin);
        judged.determined = determined(truth, &span, |effect| self.column(effect));
        judged
    }
}

pub(super) fn minus(a: &[Joints], b: &[Joints]) -> Vec<Joints> {
    let each = |(a, b): (&Joints, &Joints)| std::array::from_fn(|i| a[i] - b[i]);
    a.iter().zip(b).map(each).collect()
}

/// Whether both effects are masses: if their signatures agree, either is right.
pub(super) fn are_masses(one: &str, other: &str) -> bool {
    let is = |name: &str| matches!(name, "inertia" | "payload" | "gravity_torque");
    is(one) && is(other)
}
