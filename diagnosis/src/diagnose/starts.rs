//! Multistart for the stepwise selection, which ends in a local optimum: the best result of several starts is used.
//!
//! An arm with a single missing effect is found from the empty selection; a real arm, with small errors of every axis, from a selection of the complete
//! geometry: from the empty one, the first effect would be the one that mimics most of these errors.
//!
//! Results are compared by the criterion of the steps; among equal results the earlier start is used.

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
