//! Detectability of a hidden torque effect, and whether another effect would have the same signature: z, ρ and gains as in the position domain
//! ([`crate::comparison`]), with masses that the model does not state as nuisance parameters instead of the registration.
//!
//! Expected values are computed without drawing noise. The evaluation does not depend on a solver's answer.

use crate::arm::Joints;
use crate::comparison::{
    Detectability, EffectComparison, add_model_nuisances, identifiable_parameters, prior_count,
};
use crate::effect::{BlindCase, EffectKind};
use crate::instrument::Whitener;
use crate::least_squares::{OrthonormalBasis, dot};

use super::candidates::candidates;
use super::case::TorqueCase;
use super::kinds::Effect;
use super::laws::{SampledMotion, recorded_torques};
use super::motion::Motion;
use super::rig::Rig;

/// Values of a case, linearised about the model and the other hidden effects.
pub struct LinearisedCase<'a> {
    case: &'a TorqueCase,
    motion: &'a Motion,
    sampled: &'a SampledMotion,
    whitener: Whitener,
    base_effects: Vec<Effect>,
    base_torques: Vec<Joints>,
}

/// Whitening of the recorded rows.
#[must_use]
pub fn whitener(case: &TorqueCase, ride: &SampledMotion, recorded: &[bool]) -> Whitener {
    let follows = |before: usize, row: usize| ride.times[before].0 == ride.times[row].0;
    Whitener::unit_variance(case.rig.count(), case.noise.autocorrelation, recorded, follows)
}

/// Values of all joints in units of their noise, row by row.
#[must_use]
pub fn noise_scaled(case: &TorqueCase, torques: &[Joints]) -> Vec<f64> {
    let count = case.rig.count();
    torques
        .iter()
        .flat_map(|torques| (0..count).map(|i| torques[i] / case.noise.total_sigma(i)))
        .collect()
}

/// Torques of unit masses that the model does not state: nuisance columns.
#[must_use]
pub fn unit_mass_torques(rig: &Rig, ride: &SampledMotion) -> Vec<Vec<Joints>> {
    if rig.masses_stated {
        return Vec::new();
    }
    let probes = (0..rig.count()).flat_map(Rig::unit_masses);
    probes.map(|probe| ride.torques_of_masses(rig, &[probe])).collect()
}

impl<'a> LinearisedCase<'a> {
    /// The columns of the recorded rows. `examined`: index of the hidden effect under evaluation, which is excluded from the base point; `None`: all
    /// hidden effects are included.
    #[must_use]
    pub fn of(
        case: &'a TorqueCase,
        (motion, sampled): (&'a Motion, &'a SampledMotion),
        recorded: &[bool],
        examined: Option<usize>,
    ) -> Self {
        let others = case.hidden.iter().enumerate().filter(|(k, _)| Some(*k) != examined);
        let base_effects: Vec<Effect> =
            case.nominal().into_iter().chain(others.map(|(_, effect)| effect.clone())).collect();
        let base_torques = recorded_torques(&case.rig, motion, sampled, &base_effects);
        Self {
            case,
            motion,
            sampled,
            whitener: whitener(case, sampled, recorded),
            base_effects,
            base_torques,
        }
    }

    fn whiten(&self, torques: &[Joints]) -> Vec<f64> {
        let mut whitened = self.whitener.apply(&noise_scaled(self.case, torques));
        whitened.resize(whitened.len() + prior_count(self.case), 0.0);
        whitened
    }

    /// Whitened column of an effect.
    #[must_use]
    pub fn column(&self, effect: &Effect) -> Vec<f64> {
        let mut all = self.base_effects.clone();
        all.push(effect.clone());
        let moved = recorded_torques(&self.case.rig, self.motion, self.sampled, &all);
        self.whiten(&difference(&moved, &self.base_torques))
    }

    /// Nuisance columns: unstated masses, and the model's parameters with their priors, except those that `except` revises.
    #[must_use]
    pub fn nuisances(&self, except: &Effect) -> OrthonormalBasis {
        let mut basis = OrthonormalBasis::default();
        for torques in unit_mass_torques(&self.case.rig, self.sampled) {
            basis.add_column(self.whiten(&torques));
        }
        add_model_nuisances(&mut basis, self.case, &[except], |effect| self.column(effect));
        basis
    }

    /// Norm of a hidden effect after projection on the nuisance columns.
    #[must_use]
    pub fn strength(&self, effect: &Effect, basis: &OrthonormalBasis) -> f64 {
        let rest = basis.residual(&self.column(effect));
        dot(&rest, &rest).sqrt()
    }

    /// Detectability of hidden effect `which`, for which the columns were prepared.
    #[must_use]
    pub fn evaluate(&self, which: usize) -> Detectability {
        let truth = &self.case.hidden[which];
        let mut basis = self.nuisances(truth);
        for (k, other) in self.case.hidden.iter().enumerate() {
            if k != which {
                basis.add_column(self.column(other));
            }
        }
        let all =
            recorded_torques(&self.case.rig, self.motion, self.sampled, &self.case.true_effects());
        let mut without = self.case.true_effects();
        without.remove(self.case.modelled.len() + which);
        let without = recorded_torques(&self.case.rig, self.motion, self.sampled, &without);
        let rest = basis.residual(&self.whiten(&difference(&all, &without)));
        let question = EffectComparison {
            name: truth.kind.name().map(|name| (name, truth.joint_number())),
            parameter_count: truth.kind.count(),
            nuisances: &basis,
            effect: &rest,
            value_count: self.whitener.count(),
        };
        let is_related = |name: &str| {
            truth.kind.name().is_some_and(|true_name| are_mass_effects(true_name, name))
        };
        let mut detectability =
            question.compare(&candidates(self.case), |effect| self.column(effect), is_related);
        detectability.determined =
            identifiable_parameters(truth, &basis, |effect| self.column(effect));
        detectability
    }
}

pub(super) fn difference(a: &[Joints], b: &[Joints]) -> Vec<Joints> {
    let each = |(a, b): (&Joints, &Joints)| std::array::from_fn(|i| a[i] - b[i]);
    a.iter().zip(b).map(each).collect()
}

/// Whether both effects are masses: if their signatures agree, either is right.
pub(super) fn are_mass_effects(one: &str, other: &str) -> bool {
    let is = |name: &str| matches!(name, "inertia" | "payload" | "gravity_torque");
    is(one) && is(other)
}
