//! Multistart for the stepwise selection, which ends in a local optimum: the best result of several starts is used.
//!
//! An arm with a single missing effect is identified from the empty selection; a real arm, with small errors of every axis, from a selection of the
//! complete geometry: from the empty selection, the first effect would be the one that mimics most of these errors.
//!
//! Results are compared by the criterion of the steps; among equal results the earlier start is used.

use super::selection::{Title, title};
use super::stepwise::Stepwise;

/// Geometric errors of every axis, in the order in which they enter the start selection: zero offsets, tilts, displacements.
const GEOMETRY: [&str; 4] = ["joint_offset", "axis_tilt", "axis_shift", "tool_offset"];

impl Stepwise<'_> {
    /// Stepwise selection from the empty selection, from the current one and from the complete geometry; keeps the best.
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

    /// Stepwise selection from the current selection.
    pub(super) fn make_from(&mut self) {
        self.stand();
        self.make();
    }

    /// One step from the current selection.
    pub(super) fn step_from(&mut self) {
        self.stand();
        self.step();
    }

    /// Kinds and joints of the selected effects, sorted.
    pub(super) fn titles(&self) -> Vec<Option<Title>> {
        let mut titles: Vec<Option<Title>> =
            self.chosen.iter().map(|place| title(&self.entries[*place].candidate)).collect();
        titles.sort_unstable();
        titles
    }

    /// The complete geometry as a start selection. The first joint comes last: its error is confounded with the measuring frame, to which it is
    /// attributed.
    fn geometry(&self) -> Vec<usize> {
        let rank = |place: &usize| {
            let (kind, joint, changes) = title(&self.entries[*place].candidate)?;
            let rank = GEOMETRY.iter().position(|one| *one == kind).filter(|_| !changes)?;
            Some((joint == Some(0), rank, joint))
        };
        let mut places: Vec<usize> =
            (0..self.entries.len()).filter(|place| rank(place).is_some()).collect();
        places.sort_by_key(rank);
        // An effect that is already in the fit has two entries: the fitted and the library's.
        places.dedup_by_key(|place| title(&self.entries[*place].candidate));
        places
    }
}
