//! Cutting forces: the law of the teeth, and contributions of effects to the law and to the sensor's reading.
//!
//! A tooth at angle φ (from the normal axis, with the rotation), `φ_entry ≤ φ ≤ φ_exit`, chip `h = f_t sin φ`, depth `a`:
//! `F_t = (K_tc h + K_te) a`, and so radial and axial; on the tool `F_x = −F_t cos φ − F_r sin φ`, `F_y = F_t sin φ − F_r cos φ`, `F_z = F_a`.
//! Cut axes: x along the feed, z up out of the work, y = z × x. A turning tool is at φ = 90° and always cuts.
//! Source: thesis 4.7; Altintas, Manufacturing Automation, 2012, 2.8 (edges); Kline, 1983 (runout).
//!
//! Promises: the law is linear in its coefficients; [`Cutter::mean`] is exact; no force outside the cut.
//! Never: regeneration, or a tooth that runout lifts out of the cut.

use crate::deviation::Contribution;
use crate::frame::rotation_from_vector;
use crate::{AnyEffect, Effect, Inputs, Memories, Model, Wrench};
use core::f64::consts::TAU;
use glam::{DMat3, DVec3};

/// A tooth that lags by less than this from tip to top is straight, rad.
const STRAIGHT_RAD: f64 = 1e-6;
/// A tool that gives way along its axis never cuts deeper than so many times what was set.
const DEEPEST: f64 = 20.0;

/// How an effect changes the force on the tool, or what is read of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ForceTerm {
    /// More edge force: tangential, radial, axial, N/m of depth.
    Edge(DVec3),
    /// More cutting force: tangential, radial, axial, N/m² of chip.
    Chip(DVec3),
    /// The share by which edge forces grow per metre of cut.
    Wear(f64),
    /// The tool's axis stands off the spindle's: towards tooth 0, and a quarter of a turn from there against the rotation, m.
    Runout([f64; 2]),
    /// A force across the feed that swings by itself while the tool cuts, N.
    Ring(f64),
    /// What each channel of the sensor reads of each axis besides its own: rows are channels.
    Leak(DMat3),
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
            Self::Ring(x) => Self::Ring(x * factor),
            Self::Leak(x) => Self::Leak(x * factor),
        }
    }

    /// The difference of two terms of one kind; of other kinds there is none, and it is this term.
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        match (self, other) {
            (Self::Edge(a), Self::Edge(b)) => Self::Edge(a - b),
            (Self::Chip(a), Self::Chip(b)) => Self::Chip(a - b),
            (Self::Wear(a), Self::Wear(b)) => Self::Wear(a - b),
            (Self::Runout([a, b]), Self::Runout([c, d])) => Self::Runout([a - c, b - d]),
            (Self::Ring(a), Self::Ring(b)) => Self::Ring(a - b),
            (Self::Leak(a), Self::Leak(b)) => Self::Leak(a - b),
            (one, _) => one,
        }
    }
}

/// How tangential, radial and axial forces of teeth (columns) stand in cut axes, with their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Teeth {
    /// Per N of edge force.
    pub edge: DMat3,
    /// The same, each tooth times the sine of its angle: per N of a chip of the whole feed.
    pub chip: DMat3,
}

impl Teeth {
    fn times(self, factor: f64) -> Self {
        Self { edge: self.edge * factor, chip: self.chip * factor }
    }
}

/// A tooth that stands at one angle over its whole depth.
fn straight(angle: f64) -> Teeth {
    let (sin, cos) = libm::sincos(angle);
    let edge = DMat3::from_cols(DVec3::new(-cos, sin, 0.0), DVec3::new(-sin, -cos, 0.0), DVec3::Z);
    Teeth { edge, chip: edge * sin }
}

/// The integral of [`Teeth`] of one tooth over its angle, N rad.
pub fn swept(from_rad: f64, to_rad: f64) -> Teeth {
    let (high, low) = (antiderivative(to_rad), antiderivative(from_rad));
    Teeth { edge: high.edge - low.edge, chip: high.chip - low.chip }
}

fn antiderivative(angle: f64) -> Teeth {
    let (sin, cos) = libm::sincos(angle);
    let (sin_cos, sin_sin) = (0.5 * sin * sin, 0.5 * (angle - sin * cos));
    let axis = |radial: f64| DVec3::Z * radial;
    Teeth {
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

/// A cutter in its work. SI; angles in rad from the normal axis, with the rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutter {
    /// Number of teeth.
    pub teeth: u32,
    /// m.
    pub diameter_m: f64,
    /// rad.
    pub helix_rad: f64,
    /// m.
    pub axial_depth_m: f64,
    /// Where a tooth enters the work.
    pub entry_rad: f64,
    /// Where it leaves, above `entry_rad`.
    pub exit_rad: f64,
    /// The work turns, and the tool stands.
    pub turning: bool,
    /// `K_tc, K_rc, K_ac`, N/m².
    pub chip_n_m2: DVec3,
    /// `K_te, K_re, K_ae`, N/m.
    pub edge_n_m: DVec3,
}

/// What the teeth do at one instant, or on average: forces per unit of each coefficient, cut axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bite {
    /// N per N/m of edge coefficient.
    pub edge: DMat3,
    /// N per N/m² of cutting coefficient.
    pub chip: DMat3,
    /// The same per m of runout: towards tooth 0, and a quarter of a turn from there against the rotation.
    pub runout: [DMat3; 2],
    /// How much of a tooth cuts; 0 out of the cut.
    pub engaged: f64,
}

impl Bite {
    /// Nothing is cut.
    pub const NONE: Self =
        Self { edge: DMat3::ZERO, chip: DMat3::ZERO, runout: [DMat3::ZERO; 2], engaged: 0.0 };

    fn add(&mut self, teeth: Teeth, engaged: f64, leads: [f64; 2]) {
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

    /// With tooth 0 at this angle; helical teeth lag the higher up they are.
    pub fn bite(&self, angle_rad: f64, feed_per_tooth_m: f64) -> Bite {
        if self.turning {
            return self.standing(feed_per_tooth_m);
        }
        let mut bite = Bite::NONE;
        let lag = self.axial_depth_m * libm::tan(self.helix_rad) / (0.5 * self.diameter_m);
        let span = self.exit_rad - self.entry_rad;
        for tooth in 0..self.teeth {
            let place = TAU * f64::from(tooth) / f64::from(self.teeth);
            let leads = self.leads(place);
            let angle = angle_rad + place;
            if libm::fabs(lag) < STRAIGHT_RAD {
                if turn_part(angle - self.entry_rad) <= span {
                    bite.add(straight(angle), 1.0, leads);
                }
                continue;
            }
            // From tip to top the tooth stands at all angles between these: each turn's window of engagement takes its part.
            let (low, high) = (angle.min(angle - lag), angle.max(angle - lag));
            let mut entry = self.entry_rad + TAU * libm::floor((low - self.entry_rad) / TAU);
            while entry < high {
                let (from, to) = (entry.max(low), (entry + span).min(high));
                if to > from {
                    let size = high - low;
                    bite.add(swept(from, to).times(1.0 / size), (to - from) / size, leads);
                }
                entry += TAU;
            }
        }
        bite.edge *= self.axial_depth_m;
        bite.chip *= self.axial_depth_m * feed_per_tooth_m;
        bite.runout = bite.runout.map(|part| part * self.axial_depth_m);
        bite
    }

    /// On average over whole turns: helix and runout play no part.
    pub fn mean(&self, feed_per_tooth_m: f64) -> Bite {
        if self.turning {
            return self.standing(feed_per_tooth_m);
        }
        let share = f64::from(self.teeth) / TAU;
        let depth = self.axial_depth_m * share;
        let Teeth { edge, chip } = swept(self.entry_rad, self.exit_rad);
        Bite {
            edge: edge * depth,
            chip: chip * (depth * feed_per_tooth_m),
            runout: [DMat3::ZERO; 2],
            engaged: share * (self.exit_rad - self.entry_rad),
        }
    }

    /// A turning tool: the limit of one tooth that stays where the chip is thickest.
    fn standing(&self, feed_m: f64) -> Bite {
        let along = DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z) * self.axial_depth_m;
        Bite { edge: along, chip: along * feed_m, runout: [DMat3::ZERO; 2], engaged: 1.0 }
    }

    /// How much more a tooth at this place of the tool takes, per m of runout: it stands out, and the tooth before it left more or less.
    fn leads(&self, place_rad: f64) -> [f64; 2] {
        let before = place_rad + TAU / f64::from(self.teeth);
        let ((sin, cos), (sin_before, cos_before)) =
            (libm::sincos(place_rad), libm::sincos(before));
        [cos - cos_before, sin - sin_before]
    }
}

/// An angle in one turn, from 0.
fn turn_part(angle: f64) -> f64 {
    angle - TAU * libm::floor(angle / TAU)
}

/// What effects change of the force that a cutter exerts, and of what is read of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutForce {
    edge: DVec3,
    chip: DVec3,
    /// 1/m.
    wear: f64,
    /// m.
    runout: [f64; 2],
    /// N.
    ring: f64,
    leak: DMat3,
    bias: Wrench,
    scale: Wrench,
    turn: DVec3,
    /// How far the tool gives way along its axis, m/N.
    give: f64,
}

impl Default for CutForce {
    fn default() -> Self {
        Self {
            edge: DVec3::ZERO,
            chip: DVec3::ZERO,
            wear: 0.0,
            runout: [0.0; 2],
            ring: 0.0,
            leak: DMat3::ZERO,
            bias: Wrench::ZERO,
            scale: Wrench::ZERO,
            turn: DVec3::ZERO,
            give: 0.0,
        }
    }
}

impl CutForce {
    /// With what one more effect says.
    pub fn add(&mut self, contribution: &Contribution) {
        match *contribution {
            Contribution::ToolForce(term) => match term {
                ForceTerm::Edge(more) => self.edge += more,
                ForceTerm::Chip(more) => self.chip += more,
                ForceTerm::Wear(more) => self.wear += more,
                ForceTerm::Runout([a, b]) => {
                    self.runout = [self.runout[0] + a, self.runout[1] + b];
                }
                ForceTerm::Ring(force) => self.ring += force,
                ForceTerm::Leak(more) => self.leak += more,
            },
            Contribution::Sensor { bias, scale, turn } => {
                self.bias = self.bias.plus(&bias);
                self.scale = self.scale.plus(&scale);
                self.turn += turn;
            }
            _ => {}
        }
    }

    /// Edge coefficients of a cutter after so many metres of cut, N/m.
    pub fn edge(&self, cutter: &Cutter, cut_m: f64) -> DVec3 {
        (cutter.edge_n_m + self.edge) * (1.0 + self.wear * cut_m)
    }

    /// Cutting coefficients of a cutter, N/m².
    pub fn chip(&self, cutter: &Cutter) -> DVec3 {
        cutter.chip_n_m2 + self.chip
    }

    /// What acts on the tool, cut axes, N, after so many metres of cut.
    pub fn acting(&self, cutter: &Cutter, bite: &Bite, cut_m: f64) -> DVec3 {
        if bite.engaged <= 0.0 {
            return DVec3::ZERO;
        }
        let chip = self.chip(cutter);
        let lead = bite.runout[0] * self.runout[0] + bite.runout[1] * self.runout[1];
        let force = bite.edge * self.edge(cutter, cut_m) + (bite.chip + lead) * chip;
        // Pushed out of the work the tool cuts less deep, and force goes with depth.
        let shallower = 1.0 + self.give * force.z / cutter.axial_depth_m;
        force / shallower.max(1.0 / DEEPEST) + DVec3::Y * self.ring
    }

    /// What the sensor reads of it, N; its axes are those of the cut as the model believes.
    pub fn read(&self, acting: DVec3) -> DVec3 {
        let felt = rotation_from_vector(self.turn).transpose() * acting;
        self.bias.force + (DVec3::ONE + self.scale.force) * (felt + self.leak * felt)
    }
}

impl Model {
    /// What the effects change of a cutter's force at one sample.
    pub fn cut_force(&self, inputs: &Inputs, memories: &Memories) -> CutForce {
        let mut force = CutForce::default();
        self.contributions(inputs, memories, |_, contribution| force.add(contribution));
        for effect in self.effects() {
            if let AnyEffect::ToolCompliance(tool) = effect {
                force.give += tool.values()[2];
            }
        }
        force
    }
}
