//! Candidates for existing effects: selected and fitted ones, and changes of the model's effects.
//!
//! Columns are evaluated at the present parameters of the effect.

use super::{Candidate, CandidateParameter, ParameterMapping, loads, wave_candidate};
use physics::{AnyEffect, Arm};

impl Candidate {
    /// The candidate re-linearised at its fitted effect, and the linear parameters there; `stated_values`: the values before a change.
    pub(crate) fn relinearised(
        &self,
        arm: &Arm,
        effect: &AnyEffect,
        stated_values: &[f64],
    ) -> (Self, Vec<f64>) {
        let values = effect.values();
        let part = |amplitude: f64, phase: f64| {
            let (sine, cosine) = libm::sincos(phase);
            (amplitude * cosine, amplitude * sine)
        };
        match (self.mapping, values) {
            (ParameterMapping::Wave { joint, .. }, [amplitude, cycles, phase]) => {
                let (sine, cosine) = part(*amplitude, *phase);
                let same = wave_candidate(arm, joint, *cycles).unwrap_or_else(|| self.clone());
                (same, vec![sine, cosine])
            }
            (ParameterMapping::Masses, [mass, middle @ ..]) => {
                (self.clone(), loads::as_corner_masses(&self.probes, *mass, middle))
            }
            (ParameterMapping::Wobble { .. }, [a1, a2, p1, p2, ..]) => {
                let ((s1, c1), (s2, c2)) = (part(*a1, *p1), part(*a2, *p2));
                (self.clone(), vec![s1, s2, c1, c2])
            }
            _ => {
                let mut same = self.clone();
                same.probes.iter_mut().for_each(|probe| probe.effect = *effect);
                let change = |probe: &CandidateParameter| {
                    values[probe.value] - stated_values.get(probe.value).copied().unwrap_or(0.0)
                };
                let changes = same.probes.iter().map(change).collect();
                (same, changes)
            }
        }
    }

    /// Index of the effect of the model whose parameters it changes; `None` for a new effect.
    pub(crate) fn changes(&self) -> Option<usize> {
        match self.mapping {
            ParameterMapping::Change { place } => Some(place),
            _ => None,
        }
    }

    /// A change of the parameters of an effect that the model has.
    pub(crate) fn change(place: usize, effect: &AnyEffect) -> Self {
        let probes =
            (0..effect.values().len()).map(|value| CandidateParameter { effect: *effect, value });
        Self {
            slot: format!("change {place}"),
            joint: effect.joint(),
            probes: probes.collect(),
            settings: Vec::new(),
            mapping: ParameterMapping::Change { place },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use physics::ParameterValues;
    use recording::model::presets::preset;

    #[test]
    fn what_stands_for_an_effect_is_that_effect_again() {
        let arm = preset("irb120").expect("preset").model().expect("sound").physics.arm;
        let build = |kind: &str, joint, given: &[(&str, &[f64])]| {
            AnyEffect::build(kind, &arm, joint, ParameterValues(given)).expect(kind)
        };
        let wave: &[(&str, &[f64])] =
            &[("amplitude", &[2e-4]), ("cycles", &[3.0]), ("phase", &[0.7])];
        let cases = [
            (
                loads::payload(&arm),
                build("payload", None, &[("mass", &[2.5]), ("com", &[0.4, -0.1, 0.7])]),
            ),
            (wave_candidate(&arm, 2, 3.0), build("transmission_error", Some(2), wave)),
            (
                loads::springs_at(&arm, 1).into_iter().nth(30),
                build(
                    "counterbalance",
                    Some(1),
                    &[
                        ("stiffness", &[9e3]),
                        ("free_length", &[0.2]),
                        ("a", &[0.15]),
                        ("L", &[0.5]),
                        ("angle", &[0.4]),
                    ],
                ),
            ),
        ];
        for (candidate, effect) in cases {
            let candidate = candidate.expect("a candidate");
            let (same, found) = candidate.relinearised(&arm, &effect, &[]);
            let again = same.effect(&arm, &found).expect("an effect");
            for (a, b) in again.values().iter().zip(effect.values()) {
                assert!((a - b).abs() < 1e-9 * b.abs().max(1.0), "{again:?} for {effect:?}");
            }
        }
    }
}
