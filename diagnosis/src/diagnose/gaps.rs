//! Gaps that were named, as what builds up over a distance instead.
//!
//! Promises: the distance is the gap's width, where both words say nearly the same. Never: a decision; see `name`.

use super::name::{Asking, Naming};
use crate::candidates::{Candidate, List};
use physics::AnyEffect;

impl Asking<'_> {
    /// Every gap that is named, as hysteresis: a fit does not find so short a distance from those of the library.
    pub(super) fn gaps(&self, naming: &Naming) -> Vec<Candidate> {
        let model = &naming.fit.hypothesis.model;
        let new = naming.named.iter().filter(|one| one.stated.is_none());
        let mut list = List::new(&model.arm, self.campaign);
        for effect in new.filter_map(|one| model.effects().nth(one.effect)) {
            if let (AnyEffect::Backlash(_), [width]) = (effect, effect.values()) {
                let from: &[(&str, &[f64])] = &[("amplitude", &[0.0]), ("reversal", &[*width])];
                list.values("hysteresis", effect.joint(), from);
            }
        }
        list.found
    }
}
