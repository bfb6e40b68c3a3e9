//! How much a hidden effect of torques shows, and whether another name would show the same: z, ρ and gains as in the position domain
//! ([`crate::weigh`]), with masses that the model does not say in the place of registration.
//!
//! Promises: no answer of a solver is looked at. Never: noise drawn; expected values alone.

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

/// A case's columns, linear about the model and the hidden effects that are not asked for.
pub struct Bench<'a> {
    case: &'a Case,
    motion: &'a Motion,
    ride: &'a Ride,
    whitener: Whitener,
    base: Vec<Effect>,
    still: Vec<Joints>,
}

/// Whitens the rows that are there.
#[must_use]
pub fn whitener(case: &Case, ride: &Ride, there: &[bool]) -> Whitener {
    let follows = |before: usize, row: usize| ride.at[before].0 == ride.at[row].0;
    Whitener::plain(case.rig.count(), case.noise.colour, there, follows)
}

/// All joints' values in units of their noise, row by row.
#[must_use]
pub fn in_noise(case: &Case, torques: &[Joints]) -> Vec<f64> {
    let count = case.rig.count();
    torques
        .iter()
        .flat_map(|torques| (0..count).map(|i| torques[i] / case.noise.total(i)))
        .collect()
}

/// What masses ask that the model says nothing of, mass by mass: fitted anyway.
#[must_use]
pub fn unsaid(rig: &Rig, ride: &Ride) -> Vec<Vec<Joints>> {
    if rig.told {
        return Vec::new();
    }
    let probes = (0..rig.count()).flat_map(Rig::probes);
    probes.map(|probe| ride.held(rig, &[probe])).collect()
}

impl<'a> Bench<'a> {
    /// The columns of the rows that are there; `asked`: the hidden effect that they are about, none: all hidden effects are there.
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

    /// The whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        let mut all = self.base.clone();
        all.push(effect.clone());
        let moved = recorded(&self.case.rig, self.motion, self.ride, &all);
        self.whiten(&minus(&moved, &self.still))
    }

    /// What is fitted anyway: masses that are not said, the model's numbers with one reading each of their uncertainty; not those that `except` revises.
    #[must_use]
    pub fn nuisances(&self, except: &Effect) -> Span {
        let mut span = Span::default();
        for torques in unsaid(&self.case.rig, self.ride) {
            span.take(self.whiten(&torques));
        }
        take_known(&mut span, self.case, &[except], |effect| self.column(effect));
        span
    }

    /// How far a hidden effect shows beside what is fitted anyway.
    #[must_use]
    pub fn strength(&self, effect: &Effect, span: &Span) -> f64 {
        let rest = span.rest(&self.column(effect));
        dot(&rest, &rest).sqrt()
    }

    /// What can be said of hidden effect `which`, the one that was asked for.
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

/// Names of masses: where they show the same, either is right.
pub(super) fn are_masses(one: &str, other: &str) -> bool {
    let is = |name: &str| matches!(name, "inertia" | "payload" | "gravity_torque");
    is(one) && is(other)
}
