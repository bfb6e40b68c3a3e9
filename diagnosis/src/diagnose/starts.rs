//! Multistart for the stepwise selection, which ends where no single step helps: the best end of several starts is taken.
//!
//! An arm that differs from its drawing in one effect is found from the empty selection; a real arm, with every axis a little off, from a selection of all of its
//! geometry: from the empty one the first effect would be whatever mimics most of it at once.
//!
//! Ends are compared by the criterion of the steps; among equal ends the earlier start is taken.

use super::selection::{Title, title};
use super::stepwise::Stepwise;

/// Where every axis may stand elsewhere, in the order in which they join: zeros before tilts before shifts.
const GEOMETRY: [&str; 4] = ["joint_offset", "axis_tilt", "axis_shift", "tool_offset"];

impl Stepwise<'_> {
    /// Chooses from nothing, from what was named before, and from all of the geometry; keeps the best.
    pub(super) fn make_best(&mut self) {
        let nothing = (self.gram.clone(), Vec::new());
        self.make();
        let mut best = self.cost();
        let mut kept = (self.gram.clone(), self.chosen.clone());
        for start in [self.standing.clone(), self.geometry()] {
            (self.gram, self.chosen) = nothing.clone();
            self.put(start);
            self.make();
            let cost = self.cost();
            if cost < best {
                best = cost;
                kept = (self.gram.clone(), self.chosen.clone());
            }
        }
        (self.gram, self.chosen) = kept;
    }

    /// Chooses from what was named before.
    pub(super) fn make_from(&mut self) {
        self.stand();
        self.make();
    }

    /// One step from what was named before.
    pub(super) fn step_from(&mut self) {
        self.stand();
        self.step();
    }

    /// Kinds and joints of what is chosen, sorted.
    pub(super) fn titles(&self) -> Vec<Option<Title>> {
        let mut titles: Vec<Option<Title>> =
            self.chosen.iter().map(|place| title(&self.entries[*place].candidate)).collect();
        titles.sort_unstable();
        titles
    }

    /// What frame and first joint share, the frame takes: the first joint comes last.
    fn geometry(&self) -> Vec<usize> {
        let rank = |place: &usize| {
            let (kind, joint, changes) = title(&self.entries[*place].candidate)?;
            let rank = GEOMETRY.iter().position(|one| *one == kind).filter(|_| !changes)?;
            Some((joint == Some(0), rank, joint))
        };
        let mut places: Vec<usize> =
            (0..self.entries.len()).filter(|place| rank(place).is_some()).collect();
        places.sort_by_key(rank);
        // Where one of a kind was fitted before, it has two entries.
        places.dedup_by_key(|place| title(&self.entries[*place].candidate));
        places
    }
}
