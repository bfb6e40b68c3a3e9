//! The motions that a smooth function of covariates multiplies, where structure is modelled that no effect of the dictionary explains.

use super::StructureLocation;
use super::local_errors::Bump;
use crate::tool_motion::ToolMotion;
use glam::DVec3;
use physics::{Arm, Chain, Inputs};
use std::rc::Rc;

/// Degree of the polynomials of a single covariate.
pub(super) const DEGREE: usize = 5;
/// Degree of the polynomials by which the size of a selected effect varies.
const SIZE_DEGREE: usize = 3;
/// Standard deviation of the prior of a coefficient of a joint's error, rad or m.
const COEFFICIENT_SIGMA: f64 = 5e-3;

/// The motions that a smooth function multiplies, each with coefficients of its own.
#[derive(Clone, Debug)]
pub(super) enum ModulatedMotion {
    /// An error of a joint's position, rad or m.
    JointError,
    /// Errors of a joint near certain positions of its own, rad or m; with the index of the covariate that is its position. There is no other covariate.
    LocalErrors(Rc<[Bump]>, usize),
    /// The motion by a selected effect: tool displacement at each pose, and index of the covariate that the effect itself depends on.
    EffectSize(Rc<[ToolMotion]>, Option<usize>),
    /// Translations of the measuring frame along the axes of the base, m; with the degree of the polynomials.
    FrameShift(usize),
    /// Translations of the measuring frame along the axes of the base and rotations about them, m and rad; with the degree.
    FrameMotion(usize),
    /// Translations of the measured points along the axes of the tool, m; with the degree.
    ToolShift(usize),
}

impl ModulatedMotion {
    /// Passes the tool displacements at a pose per unit of the smooth function to `take`.
    pub(super) fn units(
        &self,
        arm: &Arm,
        location: StructureLocation,
        inputs: &Inputs,
        pose: usize,
        mut take: impl FnMut(ToolMotion),
    ) {
        let chain = || Chain::nominal(arm, &inputs.q);
        let shift = |shift| ToolMotion { shift, ..ToolMotion::default() };
        match self {
            Self::JointError => {
                if let StructureLocation::Joint(joint) = location {
                    take(ToolMotion::of_joint(arm, &chain(), joint));
                }
            }
            Self::LocalErrors(bumps, _) => {
                if let StructureLocation::Joint(joint) = location {
                    let motion = ToolMotion::of_joint(arm, &chain(), joint);
                    bumps.iter().for_each(|bump| take(motion.scaled(bump.at(inputs.q[joint]))));
                }
            }
            Self::EffectSize(motions, _) => take(motions[pose]),
            Self::FrameShift(_) => DVec3::AXES.into_iter().for_each(|axis| take(shift(axis))),
            Self::FrameMotion(_) => {
                let tcp = chain().base_from_tool.origin;
                DVec3::AXES.into_iter().for_each(|axis| take(shift(axis)));
                DVec3::AXES.into_iter().for_each(|turn| {
                    take(ToolMotion { turn, ..shift(turn.cross(tcp)) });
                });
            }
            Self::ToolShift(_) => {
                let rotation = chain().base_from_tool.rotation;
                DVec3::AXES.into_iter().for_each(|axis| take(shift(rotation * axis)));
            }
        }
    }

    /// Number of these motions.
    pub(super) fn unit_count(&self) -> usize {
        match self {
            Self::JointError | Self::EffectSize(..) => 1,
            Self::LocalErrors(bumps, _) => bumps.len(),
            Self::FrameShift(_) | Self::ToolShift(_) => 3,
            Self::FrameMotion(_) => 6,
        }
    }

    /// Degree of the polynomials of a single covariate.
    pub(super) fn degree(&self) -> usize {
        match self {
            Self::JointError | Self::LocalErrors(..) => DEGREE,
            Self::EffectSize(..) => SIZE_DEGREE,
            Self::FrameShift(degree) | Self::FrameMotion(degree) | Self::ToolShift(degree) => {
                *degree
            }
        }
    }

    /// Standard deviation of the prior of a coefficient: rad or m, relative for the size of a selected effect.
    pub(super) fn coefficient_sigma(&self) -> f64 {
        match self {
            Self::EffectSize(..) => 1.0,
            _ => COEFFICIENT_SIGMA,
        }
    }
}
