//! Multistart for the stepwise selection, which ends in a local optimum: the best result of several starts is used.
//!
//! An arm with a single missing effect is identified from the empty selection; a real arm, with small errors of every axis, from a selection of the
//! complete geometry: from the empty selection, the first effect would be the one that mimics most of these errors.
//!
//! Results are compared by the criterion of the steps; among equal results the earlier start is used.

use super::selection::{EffectKey, key};
use super::stepwise::StepwiseSelection;

/// Geometric errors of every axis, in the order in which they enter the start selection: zero offsets, tilts, displacements.
const GEOMETRY: [&str; 4] = ["joint_offset", "axis_tilt", "axis_shift", "tool_offset"];

impl StepwiseSelection<'_> {
    /// Stepwise selection from the empty selection, from the current one and from the complete geometry; keeps the best.
    pub(super) fn run_multistart(&mut self) {
        let nothing = (self.gram.clone(), Vec::new());
        self.run();
        let mut best = self.cost();
        let mut kept = (self.gram.clone(), self.selected.clone());
        for start in [self.previous.clone(), self.geometry_start()] {
            (self.gram, self.selected) = nothing.clone();
            self.include(start);
            self.run();
            let cost = self.cost();
            if cost < best {
                best = cost;
                kept = (self.gram.clone(), self.selected.clone());
            }
        }
        (self.gram, self.selected) = kept;
    }

    /// Stepwise selection from the current selection.
    pub(super) fn run_from_previous(&mut self) {
        self.include_previous();
        self.run();
    }

    /// One step from the current selection.
    pub(super) fn step_from_previous(&mut self) {
        self.include_previous();
        self.step();
    }

    /// Kinds and joints of the selected effects, sorted.
    pub(super) fn keys(&self) -> Vec<Option<EffectKey>> {
        let mut titles: Vec<Option<EffectKey>> =
            self.selected.iter().map(|place| key(&self.entries[*place].candidate)).collect();
        titles.sort_unstable();
        titles
    }

    /// The complete geometry as a start selection. The first joint comes last: its error is confounded with the measuring frame, to which it is
    /// attributed.
    fn geometry_start(&self) -> Vec<usize> {
        let rank = |place: &usize| {
            let (kind, joint, changes) = key(&self.entries[*place].candidate)?;
            let rank = GEOMETRY.iter().position(|one| *one == kind).filter(|_| !changes)?;
            Some((joint == Some(0), rank, joint))
        };
        let mut places: Vec<usize> =
            (0..self.entries.len()).filter(|place| rank(place).is_some()).collect();
        places.sort_by_key(rank);
        // An effect that is already in the fit has two entries: the fitted one and that of the dictionary.
        places.dedup_by_key(|place| key(&self.entries[*place].candidate));
        places
    }
}
