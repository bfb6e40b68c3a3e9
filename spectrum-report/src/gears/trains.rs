//! The gear trains of a model along a path.

use physics::JOINTS_MAX;
use recording::model::ModelFile;
use spectrum::GearFrequency;

use super::path::{RevolutionsPerMm, TravelledPath};
use crate::error::Error;

/// A joint that turns less counts as stationary, rev/mm.
const STATIONARY_PER_MM: f64 = 1e-9;

/// Shafts and meshes of the joints that turn.
#[derive(Clone, Debug)]
pub struct GearTrain {
    /// The joint, from 1.
    pub joint: u8,
    /// Stages as `[driver, driven]` in teeth, motor side first.
    pub stages: Vec<[u32; 2]>,
    /// Mean revolutions of the joint itself per mm.
    pub turns_per_mm: f64,
    /// Turns of each shaft, then the mesh of each stage, by their means over the whole path.
    pub wheels: Vec<GearFrequency>,
    /// Least and most over the path relative to the mean; the same for all wheels of a joint.
    pub range: [f64; 2],
    /// Mean, least and most of each part of the path relative to the mean.
    pub parts: Vec<[f64; 3]>,
}

impl GearTrain {
    /// Difference of most and least, relative to the mean.
    #[must_use]
    pub fn drift(&self) -> f64 {
        self.range[1] - self.range[0]
    }

    /// Each shaft's turns with the mesh at its stage.
    pub fn shafts(&self) -> impl Iterator<Item = (&GearFrequency, &GearFrequency)> {
        let (turns, meshes) = self.wheels.split_at(self.wheels.len() / 2);
        turns.iter().zip(meshes)
    }
}

/// The trains of the selected joints (all, if none is selected) that turn along the path.
pub(super) fn of(
    model: &ModelFile,
    travelled: &TravelledPath,
    selected: &[u8],
) -> Result<Vec<GearTrain>, Error> {
    let toothed = |joint: &u8| {
        let entry = usize::from(*joint).checked_sub(1).and_then(|index| model.joints.get(index));
        entry.is_some_and(|entry| !entry.gear_teeth.is_empty())
    };
    if let Some(joint) = selected.iter().find(|joint| !toothed(joint)) {
        let name = &model.name;
        let message = format!("--wheels-of {joint}: `{name}` has no gear_teeth for such a joint");
        return Err(Error::input(message));
    }
    if model.joints.iter().all(|joint| joint.gear_teeth.is_empty()) {
        let name = &model.name;
        let message = format!(
            "`{name}` has no gear_teeth; write them into its joints: gear_teeth = [[driver, driven], …], motor side first"
        );
        return Err(Error::input(message));
    }
    let mut trains = Vec::new();
    for (index, (joint, entry)) in (1..=u8::MAX).zip(&model.joints).enumerate() {
        let whole = travelled.whole(index);
        let is_selected = selected.is_empty() || selected.contains(&joint);
        if entry.gear_teeth.is_empty() || !is_selected || whole.mean < STATIONARY_PER_MM {
            continue;
        }
        let mut turning = [0.0; JOINTS_MAX];
        if let Some(turns) = turning.get_mut(index) {
            *turns = whole.mean;
        }
        let part = |turns: &RevolutionsPerMm| {
            [turns.mean, turns.least, turns.most].map(|value| value / whole.mean)
        };
        trains.push(GearTrain {
            joint,
            turns_per_mm: whole.mean,
            stages: entry.gear_teeth.clone(),
            wheels: model.gear_cycles(&turning, GearFrequency::new).collect(),
            range: [whole.least, whole.most].map(|value| value / whole.mean),
            parts: travelled.parts.iter().map(|p| part(&p.turns[index])).collect(),
        });
    }
    Ok(trains)
}
