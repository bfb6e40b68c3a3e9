//! Rotation of the gear trains of a model along a path, for matching with spectral lines.

use recording::model::{GearCycles, ModelFile};
use spectrum::Wheel;

/// Shafts and meshes of the joints that turn; `turns_per_mm` are those of the joints.
pub(crate) fn of(model: &ModelFile, turns_per_mm: &[f64]) -> Vec<Wheel> {
    let wheel = |cycles: GearCycles| Wheel {
        joint: cycles.joint,
        shaft: cycles.shaft,
        teeth: cycles.teeth,
        cycles_per_mm: cycles.per_mm,
    };
    model.gear_cycles(turns_per_mm).map(wheel).collect()
}
