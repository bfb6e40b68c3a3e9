//! Effects that exclude each other.
//!
//! Invariant: a model with effects allowed by these rules can be loaded.

use physics::{AnyEffect, Effect};

/// Slot of an effect: effects of one slot describe the same phenomenon and exclude each other.
pub(super) fn slot(effect: &AnyEffect) -> String {
    let joint = effect.joint().map_or(-1, |joint| joint as i64);
    let what = match effect {
        AnyEffect::GravitySag(_)
        | AnyEffect::JointCompliance(_)
        | AnyEffect::GravityCompliance(_) => "weight".to_owned(),
        AnyEffect::Backlash(_) | AnyEffect::Hysteresis(_) => "reversal".to_owned(),
        AnyEffect::TransmissionError(wave) => return format!("wave {joint} {}", wave.values()[1]),
        AnyEffect::AxisWobble(wobble) => return format!("wobble {joint} {}", wobble.values()[4]),
        AnyEffect::JointCoupling(_) => {
            // The joint it couples from is a setting that only the effect itself knows.
            let mut coupling = *effect;
            coupling.values_mut().fill(0.0);
            format!("{coupling:?}")
        }
        _ => effect.spec().kind.to_owned(),
    };
    format!("{what} {joint}")
}

/// `joint_compliance` covers gravity and wrench with one parameter, so it excludes effects for either of them on the same joint.
pub(super) fn are_incompatible(one: &AnyEffect, other: &AnyEffect) -> bool {
    let whole = |effect: &AnyEffect| matches!(effect, AnyEffect::JointCompliance(_));
    let half = |effect: &AnyEffect| matches!(effect, AnyEffect::LoadCompliance(_));
    one.joint() == other.joint() && (whole(one) && half(other) || half(one) && whole(other))
}

impl super::Candidate {
    /// Whether a model that has this effect already covers the candidate. Backlash and hysteresis exclude each other as new effects; but if a model
    /// states one of them, the other may still be missing.
    pub(crate) fn is_covered_by(&self, effect: &AnyEffect) -> bool {
        use AnyEffect::{Backlash, Hysteresis};
        let own_effect = self.probes.first().map(|probe| &probe.effect);
        let is_the_other_half = matches!(
            (own_effect, effect),
            (Some(Backlash(_)), Hysteresis(_)) | (Some(Hysteresis(_)), Backlash(_))
        );
        self.excludes_effect(effect) && !is_the_other_half
    }
}
