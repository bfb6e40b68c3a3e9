//! Alternatives to a hidden force effect: every effect that could explain this recording. Nonlinear parameters are taken from a grid, one form per
//! grid point; effects whose inputs were not recorded are excluded.

use crate::candidates::Candidate;
use crate::effect::EffectKind;
use crate::scene::Excitation;

use super::cut::Cut;
use super::kinds::{Effect, Kind, Requirement};
use super::passes::Passes;

/// Whether a kind is observable with this cut on these passes.
#[must_use]
pub fn is_observable(cut: &Cut, scene: &Passes, kind: Kind) -> bool {
    kind.spec().needs.iter().all(|need| match need {
        Requirement::Teeth => !cut.turning && cut.teeth > 1,
        Requirement::ManyTeeth => !cut.turning && cut.teeth > 3,
        Requirement::Mill => !cut.turning,
        Requirement::Speeds => scene.excitation == Excitation::Full,
        Requirement::Air => scene.has_air,
    })
}

/// All candidates.
#[must_use]
pub fn candidates(cut: &Cut, scene: &Passes) -> Vec<Candidate<Effect>> {
    let kinds = Kind::DICTIONARY.into_iter().filter(|kind| is_observable(cut, scene, *kind));
    let one = |kind: Kind| {
        let spec = kind.spec();
        Some(Candidate {
            name: spec.name?,
            joint: None,
            parameter_count: free_parameter_count(cut, kind),
            non_negative: spec.non_negative,
            forms: forms(scene, kind),
        })
    };
    kinds.filter_map(one).collect()
}

/// Number of free parameters if only forces are measured; cross-talk into the same channel is a scale, and with two teeth only one parameter of a
/// runout is observable.
#[must_use]
pub fn free_parameter_count(cut: &Cut, kind: Kind) -> usize {
    match kind {
        Kind::CrossTalk => 6,
        Kind::WrenchBias | Kind::WrenchScale => 3,
        Kind::Runout if cut.teeth == 2 => 1,
        _ => kind.count(),
    }
}

fn forms(scene: &Passes, kind: Kind) -> Vec<Vec<Effect>> {
    let one = |parameters: &[f64]| Effect::of(kind, 0, parameters);
    let unit = |place: usize, size: f64| {
        let mut parameters = vec![0.0; kind.count()];
        parameters[place] = size;
        one(&parameters)
    };
    let units = |places: &[usize], size: f64| {
        vec![places.iter().map(|place| unit(*place, size)).collect::<Vec<_>>()]
    };
    match kind {
        Kind::Runout => {
            let little = 1e-3 * scene.feed_m;
            vec![vec![one(&[little, 0.0]), one(&[little, std::f64::consts::FRAC_PI_2])]]
        }
        Kind::Chatter => {
            let hz = [0.1, 0.2, 0.35].map(|share| share * scene.rate_hz);
            hz.iter().map(|hz| vec![one(&[1.0, *hz])]).collect()
        }
        Kind::CrossTalk => units(&[1, 2, 3, 5, 6, 7], 1e-3),
        Kind::WrenchScale | Kind::WrenchMisalignment => units(&[0, 1, 2], 1e-3),
        Kind::ToolWear => units(&[0], 1.0),
        _ => units(&[0, 1, 2], 1.0),
    }
}
