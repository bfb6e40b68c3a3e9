//! Cutting forces: the law of the teeth, and contributions of effects to the law and to the sensor's output.
//!
//! A tooth at angle φ (from the normal axis, with the rotation), `φ_entry ≤ φ ≤ φ_exit`, chip `h = f_t sin φ`, depth `a`:
//! `F_t = (K_tc h + K_te) a`, and so radial and axial; on the tool `F_x = −F_t cos φ − F_r sin φ`, `F_y = F_t sin φ − F_r cos φ`, `F_z = F_a`.
//! Cut axes: x along the feed, z up out of the work, y = z × x. A turning tool is at φ = 90° and always cuts.
//! Source: thesis 4.7; Altintas, Manufacturing Automation, 2012, 2.8 (edges); Kline, 1983 (runout).
//!
//! Invariants: the law is linear in its coefficients; [`Cutter::mean`] is exact; there is no force
//! outside the cut. Not modelled: regeneration, and teeth that runout lifts out of the cut.

use crate::deviation::Contribution;
use crate::frame::rotation_from_vector;
use crate::{AnyEffect, Effect, Inputs, Memories, Model, Wrench};
use core::f64::consts::TAU;
use glam::{DMat3, DVec3};

/// A tooth with less lag than this from tip to top counts as straight, rad.
const STRAIGHT_RAD: f64 = 1e-6;
/// Limit on the depth of cut of a tool that is compliant along its axis, as a multiple of the set
/// depth.
const DEEPEST: f64 = 20.0;

/// Change of the force on the tool, or of the measured force, by an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ForceTerm {
    /// Additional edge force: tangential, radial, axial, N/m of depth.
    Edge(DVec3),
    /// Additional cutting force: tangential, radial, axial, N/m² of chip.
    Chip(DVec3),
    /// Relative growth of edge forces per metre of cut.
    Wear(f64),
    /// Offset of the tool's axis from the spindle's: towards tooth 0, and a quarter of a turn from
    /// there against the rotation, m.
    Runout([f64; 2]),
    /// An oscillating force across the feed while the tool cuts, N.
    Oscillation(f64),
    /// Cross-talk: output of each channel per force along each axis, in addition to its own; rows are channels.
    CrossTalk(DMat3),
}

impl ForceTerm {
    /// This term times a number.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        match self {
            Self::Edge(x) => Self::Edge(x * factor),
            Self::Chip(x) => Self::Chip(x * factor),
            Self::Wear(x) => Self::Wear(x * factor),
            Self::Runout(x) => Self::Runout(x.map(|x| x * factor)),
            Self::Oscillation(x) => Self::Oscillation(x * factor),
            Self::CrossTalk(x) => Self::CrossTalk(x * factor),
        }
    }

    /// The difference of two terms of one kind; for terms of different kinds, this term.
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Edge(a), Self::Edge(b)) => Self::Edge(a - b),
            (Self::Chip(a), Self::Chip(b)) => Self::Chip(a - b),
            (Self::Wear(a), Self::Wear(b)) => Self::Wear(a - b),
            (Self::Runout([a, b]), Self::Runout([c, d])) => Self::Runout([a - c, b - d]),
            (Self::Oscillation(a), Self::Oscillation(b)) => Self::Oscillation(a - b),
            (Self::CrossTalk(a), Self::CrossTalk(b)) => Self::CrossTalk(a - b),
            (one, _) => one,
        }
    }
}

/// Directions of tangential, radial and axial forces of teeth (columns) in cut axes, with their
/// weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceDirections {
    /// Per N of edge force.
    pub edge: DMat3,
    /// The same, each tooth times the sine of its angle: per N of force by a chip of full feed.
    pub chip: DMat3,
}

impl ForceDirections {
    fn times(self, factor: f64) -> Self {
        Self { edge: self.edge * factor, chip: self.chip * factor }
    }
}

/// A tooth at one angle over its whole depth.
fn straight_tooth(angle: f64) -> ForceDirections {
    let (sin, cos) = libm::sincos(angle);
    let edge = DMat3::from_cols(DVec3::new(-cos, sin, 0.0), DVec3::new(-sin, -cos, 0.0), DVec3::Z);
    ForceDirections { edge, chip: edge * sin }
}

/// The integral of [`ForceDirections`] of one tooth over its angle, N rad.
pub fn swept_tooth_forces(from_rad: f64, to_rad: f64) -> ForceDirections {
    let (high, low) = (antiderivative(to_rad), antiderivative(from_rad));
    ForceDirections { edge: high.edge - low.edge, chip: high.chip - low.chip }
}

fn antiderivative(angle: f64) -> ForceDirections {
    let (sin, cos) = libm::sincos(angle);
    let (sin_cos, sin_sin) = (0.5 * sin * sin, 0.5 * (angle - sin * cos));
    let axis = |radial: f64| DVec3::Z * radial;
    ForceDirections {
        edge: DMat3::from_cols(
            DVec3::new(-sin, -cos, 0.0),
            DVec3::new(cos, -sin, 0.0),
            axis(angle),
        ),
        chip: DMat3::from_cols(
            DVec3::new(-sin_cos, sin_sin, 0.0),
            DVec3::new(-sin_sin, -sin_cos, 0.0),
            axis(-cos),
        ),
    }
}

/// A cutter and its engagement. SI; angles in rad from the normal axis, with the rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Number of teeth.
    pub teeth: u32,
    /// Diameter, m.
    pub diameter_m: f64,
    /// Helix angle, rad.
    pub helix_rad: f64,
    /// Axial depth of cut, m.
    pub axial_depth_m: f64,
    /// Angle at which a tooth enters the workpiece.
    pub entry_rad: f64,
    /// Angle at which it exits, above `entry_rad`.
    pub exit_rad: f64,
    /// Turning: the workpiece rotates, and the tool does not.
    pub turning: bool,
    /// Cutting force coefficients `K_tc, K_rc, K_ac`, N/m².
    pub chip_n_m2: DVec3,
    /// Edge force coefficients `K_te, K_re, K_ae`, N/m.
    pub edge_n_m: DVec3,
}

/// Forces of the teeth at one instant, or on average, per unit of each coefficient, cut axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToothForces {
    /// N per N/m of edge coefficient.
    pub edge: DMat3,
    /// N per N/m² of cutting coefficient.
    pub chip: DMat3,
    /// The same per m of runout: towards tooth 0, and a quarter of a turn from there against the rotation.
    pub runout: [DMat3; 2],
    /// Engaged fraction of a tooth; 0 outside the cut.
    pub engaged: f64,
}

impl ToothForces {
    /// Outside the cut.
    pub const NONE: Self =
        Self { edge: DMat3::ZERO, chip: DMat3::ZERO, runout: [DMat3::ZERO; 2], engaged: 0.0 };

    fn add(&mut self, teeth: ForceDirections, engaged: f64, leads: [f64; 2]) {
        self.edge += teeth.edge;
        self.chip += teeth.chip;
        self.runout[0] += teeth.edge * leads[0];
        self.runout[1] += teeth.edge * leads[1];
        self.engaged += engaged;
    }
}

impl Cutter {
    /// The feed per tooth, m, at a feed in m/s and a spindle speed in rev/s.
    pub fn feed_per_tooth_m(&self, feed_m_s: f64, spindle_hz: f64) -> f64 {
        feed_m_s / (spindle_hz * f64::from(self.teeth.max(1)))
    }

    /// Forces with tooth 0 at this angle; helical teeth lag with increasing height.
    pub fn tooth_forces(&self, angle_rad: f64, feed_per_tooth_m: f64) -> ToothForces {
        if self.turning {
            return self.turning_forces(feed_per_tooth_m);
        }
        let mut bite = ToothForces::NONE;
        let lag = self.axial_depth_m * libm::tan(self.helix_rad) / (0.5 * self.diameter_m);
        let span = self.exit_rad - self.entry_rad;
        for tooth in 0..self.teeth {
            let place = TAU * f64::from(tooth) / f64::from(self.teeth);
            let leads = self.runout_chip(place);
            let angle = angle_rad + place;
            if libm::fabs(lag) < STRAIGHT_RAD {
                if within_turn(angle - self.entry_rad) <= span {
                    bite.add(straight_tooth(angle), 1.0, leads);
                }
                continue;
            }
            // From tip to top the tooth covers all angles between these: each turn's window of
            // engagement takes its part.
            let (low, high) = (angle.min(angle - lag), angle.max(angle - lag));
            let mut entry = self.entry_rad + TAU * libm::floor((low - self.entry_rad) / TAU);
            while entry < high {
                let (from, to) = (entry.max(low), (entry + span).min(high));
                if to > from {
                    let size = high - low;
                    bite.add(
                        swept_tooth_forces(from, to).times(1.0 / size),
                        (to - from) / size,
                        leads,
                    );
                }
                entry += TAU;
            }
        }
        bite.edge *= self.axial_depth_m;
        bite.chip *= self.axial_depth_m * feed_per_tooth_m;
        bite.runout = bite.runout.map(|part| part * self.axial_depth_m);
        bite
    }

    /// The average over whole turns, which does not depend on helix and runout.
    pub fn mean(&self, feed_per_tooth_m: f64) -> ToothForces {
        if self.turning {
            return self.turning_forces(feed_per_tooth_m);
        }
        let share = f64::from(self.teeth) / TAU;
        let depth = self.axial_depth_m * share;
        let ForceDirections { edge, chip } = swept_tooth_forces(self.entry_rad, self.exit_rad);
        ToothForces {
            edge: edge * depth,
            chip: chip * (depth * feed_per_tooth_m),
            runout: [DMat3::ZERO; 2],
            engaged: share * (self.exit_rad - self.entry_rad),
        }
    }

    /// A turning tool: the limit of one tooth that remains at the thickest chip.
    fn turning_forces(&self, feed_m: f64) -> ToothForces {
        let along = DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z) * self.axial_depth_m;
        ToothForces { edge: along, chip: along * feed_m, runout: [DMat3::ZERO; 2], engaged: 1.0 }
    }

    /// Additional chip thickness of a tooth at this angular position of the tool, per m of runout:
    /// it protrudes, and the previous tooth left more or less material.
    fn runout_chip(&self, place_rad: f64) -> [f64; 2] {
        let before = place_rad + TAU / f64::from(self.teeth);
        let ((sin, cos), (sin_before, cos_before)) =
            (libm::sincos(place_rad), libm::sincos(before));
        [cos - cos_before, sin - sin_before]
    }
}

/// An angle reduced to one turn, from 0.
fn within_turn(angle: f64) -> f64 {
    angle - TAU * libm::floor(angle / TAU)
}

/// Sum of the changes of a cutter's force, and of the measured force, by effects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutForce {
    edge: DVec3,
    chip: DVec3,
    /// Relative growth of the edge force per length of cut, 1/m.
    wear: f64,
    /// Tool offset along two directions, m (see [`ForceTerm::Runout`]).
    runout: [f64; 2],
    /// Oscillating force, N.
    ring: f64,
    cross_talk: DMat3,
    bias: Wrench,
    scale: Wrench,
    turn: DVec3,
    /// Compliance of the tool along its axis, m/N.
    axial_compliance: f64,
}

impl Default for CutForce {
    fn default() -> Self {
        Self {
            edge: DVec3::ZERO,
            chip: DVec3::ZERO,
            wear: 0.0,
            runout: [0.0; 2],
            ring: 0.0,
            cross_talk: DMat3::ZERO,
            bias: Wrench::ZERO,
            scale: Wrench::ZERO,
            turn: DVec3::ZERO,
            axial_compliance: 0.0,
        }
    }
}

impl CutForce {
    /// Adds the contribution of an effect.
    pub fn add(&mut self, contribution: &Contribution) {
        match *contribution {
            Contribution::ToolForce(term) => match term {
                ForceTerm::Edge(more) => self.edge += more,
                ForceTerm::Chip(more) => self.chip += more,
                ForceTerm::Wear(more) => self.wear += more,
                ForceTerm::Runout([a, b]) => {
                    self.runout = [self.runout[0] + a, self.runout[1] + b];
                }
                ForceTerm::Oscillation(force) => self.ring += force,
                ForceTerm::CrossTalk(more) => self.cross_talk += more,
            },
            Contribution::Sensor { bias, scale, turn } => {
                self.bias = self.bias.plus(&bias);
                self.scale = self.scale.plus(&scale);
                self.turn += turn;
            }
            _ => {}
        }
    }

    /// Edge coefficients of a cutter after `cut_m` metres of cut, N/m.
    pub fn edge(&self, cutter: &Cutter, cut_m: f64) -> DVec3 {
        (cutter.edge_n_m + self.edge) * (1.0 + self.wear * cut_m)
    }

    /// Cutting coefficients of a cutter, N/m².
    pub fn chip(&self, cutter: &Cutter) -> DVec3 {
        cutter.chip_n_m2 + self.chip
    }

    /// Force on the tool, cut axes, N, after `cut_m` metres of cut.
    pub fn acting(&self, cutter: &Cutter, bite: &ToothForces, cut_m: f64) -> DVec3 {
        if bite.engaged <= 0.0 {
            return DVec3::ZERO;
        }
        let chip = self.chip(cutter);
        let lead = bite.runout[0] * self.runout[0] + bite.runout[1] * self.runout[1];
        let force = bite.edge * self.edge(cutter, cut_m) + (bite.chip + lead) * chip;
        // An axial deflection reduces the depth of cut, which the force is proportional to.
        let shallower = 1.0 + self.axial_compliance * force.z / cutter.axial_depth_m;
        force / shallower.max(1.0 / DEEPEST) + DVec3::Y * self.ring
    }

    /// Measured force, N, in the axes of the model's cut.
    pub fn measured_force(&self, acting: DVec3) -> DVec3 {
        let turned = rotation_from_vector(self.turn).transpose() * acting;
        self.bias.force + (DVec3::ONE + self.scale.force) * (turned + self.cross_talk * turned)
    }
}

impl Model {
    /// Changes of a cutter's force by all effects at one sample.
    pub fn cut_force(&self, inputs: &Inputs, memories: &Memories) -> CutForce {
        let mut force = CutForce::default();
        self.contributions(inputs, memories, |_, contribution| force.add(contribution));
        for effect in self.effects() {
            if let AnyEffect::ToolCompliance(tool) = effect {
                force.axial_compliance += tool.values()[2];
            }
        }
        force
    }
}
