//! Adds measured natural frequencies to a model: replaced, new and unchanged ones.

use super::{ModeEntry, ModelFile};

/// A measured mode replaces a known one if their frequencies differ by at most this share.
const SAME: f64 = 0.05;
/// Two directions with a smaller cosine than this are different modes, however close their
/// frequencies.
const ALONG: f64 = 0.5;

/// How a measured mode changed the list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeChange {
    /// It replaced this mode.
    Replaced(ModeEntry),
    /// It is new.
    Added,
}

impl ModelFile {
    /// The model with measured modes: each replaces the nearest known one within 5 %, unless their
    /// directions differ, or is added; everything else is unchanged. A direction that was not
    /// measured is kept. Also returns a description of each change.
    #[must_use]
    pub fn with_modes(&self, measured: &[ModeEntry]) -> (Self, Vec<ModeChange>) {
        let mut model = self.clone();
        let mut taken = vec![false; self.modes.len()];
        let change = |mode: &ModeEntry| {
            let is_candidate = |index: &usize| same(mode, &self.modes[*index]) && !taken[*index];
            let frequency_distance =
                |index: usize| (self.modes[index].frequency_hz - mode.frequency_hz).abs();
            let found = (0..self.modes.len())
                .filter(is_candidate)
                .min_by(|a, b| frequency_distance(*a).total_cmp(&frequency_distance(*b)));
            let Some(index) = found else {
                model.modes.push(*mode);
                return ModeChange::Added;
            };
            taken[index] = true;
            let before = self.modes[index];
            model.modes[index] =
                ModeEntry { direction: mode.direction.or(before.direction), ..*mode };
            ModeChange::Replaced(before)
        };
        let changes = measured.iter().map(change).collect();
        (model, changes)
    }
}

fn same(a: &ModeEntry, b: &ModeEntry) -> bool {
    let along = match (a.direction, b.direction) {
        (Some(a), Some(b)) => {
            let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(&b).map(|(x, y)| x * y).sum::<f64>();
            let lengths = (dot(a, a) * dot(b, b)).sqrt();
            lengths == 0.0 || dot(a, b).abs() >= ALONG * lengths
        }
        _ => true,
    };
    along && (a.frequency_hz - b.frequency_hz).abs() <= SAME * b.frequency_hz
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{RobotModel, presets};

    fn mode(frequency_hz: f64, direction: Option<[f64; 3]>) -> ModeEntry {
        ModeEntry { frequency_hz, damping_ratio: Some(0.03), direction }
    }

    fn thesis() -> ModelFile {
        presets::preset("irb1600-6-145-thesis").unwrap().model().unwrap().file
    }

    #[test]
    fn a_measured_mode_takes_the_nearest_ones_place_and_a_new_one_is_added() {
        let mut model = thesis();
        model.modes = vec![mode(20.0, None), mode(67.0, Some([0.0, 1.0, 0.0])), mode(70.0, None)];
        let (changed, changes) =
            model.with_modes(&[mode(66.1, None), mode(69.3, None), mode(120.0, None)]);
        assert_eq!(changes[0], ModeChange::Replaced(model.modes[1]));
        assert_eq!(changes[1], ModeChange::Replaced(model.modes[2]));
        assert_eq!(changes[2], ModeChange::Added);
        let hz: Vec<f64> = changed.modes.iter().map(|m| m.frequency_hz).collect();
        assert_eq!(hz, [20.0, 66.1, 69.3, 120.0]);
        assert_eq!(changed.modes[1].direction, Some([0.0, 1.0, 0.0]), "not measured, so kept");
    }

    #[test]
    fn modes_that_move_across_each_other_are_two() {
        let mut model = thesis();
        model.modes = vec![mode(67.0, Some([0.0, 1.0, 0.0]))];
        let (changed, changes) = model.with_modes(&[mode(67.5, Some([2.0, 0.0, 0.0]))]);
        assert_eq!((changes, changed.modes.len()), (vec![ModeChange::Added], 2));
    }

    #[test]
    fn the_rest_of_the_model_stays_bit_for_bit_and_reads_back() {
        let model = thesis();
        let (changed, _) = model.with_modes(&[mode(31.234_567_890_123_4, Some([0.6, 0.8, 0.0]))]);
        let back = RobotModel::parse("back.toml", &changed.to_toml()).unwrap().file;
        assert_eq!(back, changed);
        assert_eq!(ModelFile { modes: model.modes.clone(), ..back }, model);
    }
}
