//! The model's compliance at the TCP along a direction, by central difference.
//!
//! Where compliance depends on the force (a stiffening joint, lost motion), the result is the secant between `±`[`PROBE_N`] about the given wrench.

use glam::DVec3;
use physics::{Evaluation, Inputs, Memories, Model};

/// The force of the central difference, N. Range: above 0. Origin: the order of a cutting force, so that the secant is that of a cut.
const PROBE_N: f64 = 100.0;

/// Displacement of the TCP per force along an axis.
pub(crate) struct Compliance {
    /// Base axes, m/N.
    pub(crate) per_newton: DVec3,
    /// Whether every effect was within the range of its law.
    pub(crate) is_valid: bool,
}

/// The compliance along the unit vector `axis`, base axes, about the wrench of `inputs`: two evaluations in `scratch`.
pub(crate) fn compliance_along(
    axis: DVec3,
    model: &Model,
    inputs: &Inputs,
    memories: &Memories,
    scratch: &mut Evaluation,
) -> Compliance {
    let (mut pushed, mut is_valid) = (*inputs, true);
    let [pushed_along, back] = [PROBE_N, -PROBE_N].map(|newtons| {
        pushed.wrench_base.force = inputs.wrench_base.force + axis * newtons;
        model.evaluate_into(&pushed, memories, scratch);
        is_valid &= scratch.out_of_range.is_none();
        scratch.real.base_from_tool.origin
    });
    Compliance { per_newton: (pushed_along - back) / (2.0 * PROBE_N), is_valid }
}
