//! The geometry of every joint as free parameters, with manufacturing tolerances as priors.
//!
//! Offsets, directions and positions of all axes are more parameters than measurements can determine: with an unknown measuring frame and unknown
//! targets a third of the directions of the parameter space are gauge freedoms. No parameter is omitted: the priors select the smallest errors that
//! explain the measurements, independent of the order of parameters.
//!
//! The priors are too wide to affect directions that the data determine.

use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::hypothesis::{Hypothesis, PriorSource};
use physics::{AnyEffect, JointKind, Model, ParameterValues};

/// Manufacturing and mastering tolerances of a robot's geometry: standard deviations of the priors that [`geometry_with_tolerances`] puts on each parameter.
/// With an unknown measuring frame and unknown targets a third of these parameters are gauge freedoms, for which the priors select the smallest
/// values; they are too wide to move what the data determine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Joint offset, rad; above 0 to 0.1. Default 0.02: mastering by eye or after a motor change is off by up to a degree, with the maker's gauge by
    /// 1 mrad.
    pub offset_rad: f64,
    /// Offset of a prismatic joint, m; above 0 to 0.1. Default 0.02, as for an angle at a radius of one metre.
    pub offset_m: f64,
    /// Direction of an axis, rad, about each of its two normals; above 0 to 0.05. Default 0.005: ten times the usual tolerance of bearing seats (0.5
    /// mrad).
    pub tilt_rad: f64,
    /// Position of an axis, m, along each base axis; above 0 to 0.05. Default 0.005: ten times the usual error of a link's length (0.1 mm to 0.6 mm).
    pub shift_m: f64,
    /// Position of the tool on the flange, m, along each base axis at the zero position; above 0 to 0.05. Default 0.005: a TCP taught by touching a
    /// tip is off by up to some millimetres.
    pub tool_shift_m: f64,
    /// Orientation of the tool on the flange, rad, about each base axis at the zero position; above 0 to 0.1. Default 0.02: the dowel pin of a flange
    /// leaves about a degree.
    pub tool_turn_rad: f64,
    /// Compliance of a drive, rad/Nm (m/N of a prismatic joint); above 0 to 1e-3. Default 5e-5: far above any robot gear, from 1e-7 rad/Nm (300 kg
    /// payload) to 2e-5 rad/Nm (wrists of small arms).
    pub compliance: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            offset_rad: 0.02,
            offset_m: 0.02,
            tilt_rad: 5e-3,
            shift_m: 5e-3,
            tool_shift_m: 5e-3,
            tool_turn_rad: 0.02,
            compliance: 5e-5,
        }
    }
}

impl Tolerances {
    /// Standard deviation of parameter `value` of a geometric effect, SI; `None` for other effects.
    fn of(&self, effect: &AnyEffect, value: usize, kind: JointKind) -> Option<f64> {
        match (effect.spec().kind, kind) {
            ("tool_offset", _) => {
                Some(if value < 3 { self.tool_shift_m } else { self.tool_turn_rad })
            }
            ("joint_offset", JointKind::Revolute) => Some(self.offset_rad),
            ("joint_offset", JointKind::Prismatic) => Some(self.offset_m),
            ("axis_tilt", _) => Some(self.tilt_rad),
            ("axis_shift", _) => Some(self.shift_m),
            _ => None,
        }
    }
}

/// Hypothesis with the geometry of every joint free, in addition to the effects of `model`. `sigma` holds the stated standard uncertainties of the
/// model's parameters (one list per effect, SI, zero if unstated) and becomes their priors. A fit leaves out parameters that the data do not
/// distinguish from earlier ones; `plan` uses this form to choose poses that determine them.
#[must_use]
pub fn geometry(model: &Model, sigma: &[Vec<f64>]) -> Hypothesis {
    let mut hypothesis = Hypothesis::fixed(*model);
    let given = model.effects().len();
    let zeros = [0.0; 3];
    // Where a frame or two joints share a direction, the earlier column is kept: offsets before tilts before shifts. The first joint's axis,
    // confounded with an unknown frame, comes last.
    let kinds =
        [("joint_offset", "offset", 1), ("axis_tilt", "tilt", 2), ("axis_shift", "shift", 3)];
    let joints = 0..model.arm.count();
    let each = kinds.iter().flat_map(|kind| joints.clone().map(move |joint| (kind, joint)));
    let (first, rest): (Vec<_>, Vec<_>) = each.partition(|(_, joint)| *joint == 0);
    for ((kind, stem, count), joint) in rest.into_iter().chain(first) {
        let numbers: &[(&str, &[f64])] = &[(*stem, &zeros[..*count])];
        let is_stated = model.effects().any(|e| e.spec().kind == *kind && e.joint() == Some(joint));
        if !is_stated
            && let Ok(e) = AnyEffect::build(kind, &model.arm, Some(joint), ParameterValues(numbers))
        {
            hypothesis.add(e, &[]).unwrap_or_default();
        }
    }
    for effect in 0..given {
        hypothesis.free_all(effect, &["cycles"], sigma.get(effect).map_or(&[], Vec::as_slice));
    }
    hypothesis
}

/// As [`geometry`], with tolerances as priors: every geometric parameter is fitted, and the priors fix gauge freedoms. Includes the tool's pose on
/// the flange if the measurements of `campaign` depend on it; otherwise errors of the last axes would be confounded with it.
#[must_use]
pub fn geometry_with_tolerances(
    model: &Model,
    sigma: &[Vec<f64>],
    tolerances: &Tolerances,
    campaign: &Campaign,
) -> Hypothesis {
    let mut hypothesis = geometry(model, sigma);
    let has_tool = model.effects().any(|effect| effect.spec().kind == "tool_offset");
    if !has_tool && depends_on_tool(campaign) {
        let given: &[(&str, &[f64])] = &[("shift", &[0.0; 3]), ("turn", &[0.0; 3])];
        if let Ok(tool) = AnyEffect::build("tool_offset", &model.arm, None, ParameterValues(given))
        {
            hypothesis.add(tool, &[]).unwrap_or_default();
        }
    }
    let Hypothesis { model, free } = &mut hypothesis;
    let effects: Vec<&AnyEffect> = model.effects().collect();
    for free in free.iter_mut().filter(|free| free.prior_source == PriorSource::WideDefault) {
        let effect = effects[free.effect];
        let kind = effect.joint().map_or(JointKind::Revolute, |j| model.arm.joints()[j].kind);
        if let Some(sigma) = tolerances.of(effect, free.value, kind) {
            (free.sigma, free.prior_source) = (sigma, PriorSource::Tolerance);
        }
    }
    hypothesis
}

/// Whether any measurement depends on a point of known position on the tool, or on the tool's orientation.
fn depends_on_tool(campaign: &Campaign) -> bool {
    let is_known = |place: &ToolPoint| match place {
        ToolPoint::Tcp => true,
        ToolPoint::Target(target) => !campaign.surroundings.targets[*target].free,
    };
    campaign.poses.iter().flat_map(|pose| &pose.seen).any(|observation| {
        match &observation.reading {
            Reading::Orientation { .. } => true,
            Reading::JointPosition { .. } => false,
            Reading::Point { place, .. }
            | Reading::Distance { place, .. }
            | Reading::Plane { place, .. }
            | Reading::Sphere { place, .. } => is_known(place),
        }
    })
}
