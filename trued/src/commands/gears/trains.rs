//! The gear trains of a model along a path.

use daemon::travel::wheels;
use physics::JOINTS_MAX;
use recording::model::ModelFile;
use spectrum::Wheel;

use super::path::Travelled;
use crate::exit::Failure;

/// A joint that turns less counts as stationary, rev/mm.
const STANDS_PER_MM: f64 = 1e-9;

/// Shafts and meshes of the joints that turn.
#[derive(Clone, Debug)]
pub(super) struct Train {
    /// From 1.
    pub(super) joint: u8,
    /// Stages as the model has them.
    pub(super) stages: Vec<[u32; 2]>,
    /// Mean revolutions of the joint itself per mm.
    pub(super) turns_per_mm: f64,
    /// Turns of each shaft, then the mesh of each stage, by their means over the whole path.
    pub(super) wheels: Vec<Wheel>,
    /// Least and most over the path as parts of the mean; all wheels of a joint alike.
    pub(super) range: [f64; 2],
    /// Mean, least, most of each part of the path as parts of the mean.
    pub(super) parts: Vec<[f64; 3]>,
}

impl Train {
    /// From least to most, as a part of the mean.
    pub(super) fn drift(&self) -> f64 {
        self.range[1] - self.range[0]
    }

    /// Each shaft's turns with the mesh at its stage.
    pub(super) fn shafts(&self) -> impl Iterator<Item = (&Wheel, &Wheel)> {
        let (turns, meshes) = self.wheels.split_at(self.wheels.len() / 2);
        turns.iter().zip(meshes)
    }
}

/// The trains of the selected joints (all, if none is selected) that turn along the path.
pub(super) fn of(
    model: &ModelFile,
    travelled: &Travelled,
    asked: &[u8],
) -> Result<Vec<Train>, Failure> {
    let toothed = |joint: &u8| {
        let entry = usize::from(*joint).checked_sub(1).and_then(|at| model.joints.get(at));
        entry.is_some_and(|entry| !entry.gear_teeth.is_empty())
    };
    if let Some(joint) = asked.iter().find(|joint| !toothed(joint)) {
        let name = &model.name;
        let words = format!("--wheels-of {joint}: `{name}` has no gear_teeth for such a joint");
        return Err(Failure::input(words));
    }
    if model.joints.iter().all(|joint| joint.gear_teeth.is_empty()) {
        let name = &model.name;
        let words = format!(
            "`{name}` has no gear_teeth; write them into its joints: gear_teeth = [[driver, driven], …], motor side first"
        );
        return Err(Failure::input(words));
    }
    let mut trains = Vec::new();
    for (at, (joint, entry)) in (1..=u8::MAX).zip(&model.joints).enumerate() {
        let whole = travelled.whole(at);
        let wanted = asked.is_empty() || asked.contains(&joint);
        if entry.gear_teeth.is_empty() || !wanted || whole.mean < STANDS_PER_MM {
            continue;
        }
        let mut turning = [0.0; JOINTS_MAX];
        if let Some(turns) = turning.get_mut(at) {
            *turns = whole.mean;
        }
        let part = |turns: &super::path::Turns| {
            [turns.mean, turns.least, turns.most].map(|value| value / whole.mean)
        };
        trains.push(Train {
            joint,
            turns_per_mm: whole.mean,
            stages: entry.gear_teeth.clone(),
            wheels: wheels(model, &turning),
            range: [whole.least, whole.most].map(|value| value / whole.mean),
            parts: travelled.parts.iter().map(|p| part(&p.turns[at])).collect(),
        });
    }
    Ok(trains)
}
