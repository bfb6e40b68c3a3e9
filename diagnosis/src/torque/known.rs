//! What the model already knows of the drives: its torque, and how far its numbers may be off by their stated uncertainty.
//!
//! Promises: a number within its stated uncertainty is no finding, since it is fitted along, held by what is believed of it. Never: a new name.

use physics::Arm;

use super::columns::{Column, Law};
use super::motion::Motion;

/// One number that the model states of an effect in the torque domain.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// A name of the contract's torque table.
    pub kind: String,
    /// The joint, from 0; none for the whole robot.
    pub joint: Option<usize>,
    /// The effect's numbers by the stems of their keys, SI, with their standard uncertainties (0: exact).
    pub numbers: Vec<(String, f64, f64)>,
}

/// A column with the number that the model states and its standard uncertainty.
pub(super) struct Term {
    pub(super) column: Column,
    pub(super) number: f64,
    pub(super) sigma: f64,
}

impl Stated {
    fn number(&self, stem: &str) -> Option<(f64, f64)> {
        self.numbers
            .iter()
            .find(|(name, ..)| name == stem)
            .map(|(_, value, sigma)| (*value, *sigma))
    }

    /// The columns of its linear numbers; none of what is not of the torque domain, or goes with torques that the rows alone give.
    pub(super) fn terms(&self, arm: &Arm, motion: &Motion, rigid: &[Vec<f64>]) -> Vec<Term> {
        let Some(joint) = self.joint.filter(|joint| *joint < arm.count()) else {
            return Vec::new();
        };
        let mut terms = Vec::new();
        let mut put = |law: Law, stem: &str| {
            if let Some((number, sigma)) = self.number(stem) {
                terms.push(Term { column: law.column(motion, joint), number, sigma });
            }
        };
        let value = |stem| self.number(stem).map_or(0.0, |(value, _)| value);
        match self.kind.as_str() {
            "coulomb_friction" => put(Law::Direction, "level"),
            "viscous_friction" => put(Law::Speed, "coefficient"),
            "stribeck_friction" => {
                put(Law::Stribeck { speed: value("stribeck_speed") }, "level");
            }
            "friction_asymmetry" => {
                put(Law::One, "offset");
                put(Law::AbsoluteSpeed, "coefficient");
            }
            "inertia" => {
                put(Law::Acceleration, "inertia");
                put(Law::Acceleration, "mass");
            }
            "gravity_torque" => {
                put(Law::Cosine, "cos");
                put(Law::Sine, "sin");
            }
            "spring_hardening" => {
                put(Law::Cube { rest: value("rest_position") }, "cubic_stiffness");
            }
            "spring" => {
                put(Law::Position, "stiffness");
                let rest = -value("stiffness") * value("rest_position");
                let column = Law::One.column(motion, joint);
                terms.push(Term { column, number: rest, sigma: 0.0 });
            }
            "hysteresis" => terms.extend(self.memory(motion, joint)),
            "torque_ripple" => terms.extend(self.ripple(motion, joint)),
            "load_friction" => {
                if let Some((number, sigma)) = self.number("coefficient") {
                    let column = load_column(motion, joint, &rigid[joint]);
                    terms.push(Term { column, number, sigma });
                }
            }
            "drive_gain" => {
                if let Some((number, sigma)) = self.number("gain") {
                    let column = Column { parts: vec![(joint, rigid[joint].clone())] };
                    terms.push(Term { column, number, sigma });
                }
            }
            _ => {}
        }
        terms
    }

    /// The amplitude is the loop's whole height, the law's unit half of it.
    fn memory(&self, motion: &Motion, joint: usize) -> Option<Term> {
        let (height, sigma) = self.number("amplitude_N")?;
        let (distance, _) = self.number("reversal")?;
        let column = Law::Memory { distance }.column(motion, joint);
        Some(Term { column, number: 0.5 * height, sigma: 0.5 * sigma })
    }

    /// `A sin(n q + φ)` by its sine and cosine.
    fn ripple(&self, motion: &Motion, joint: usize) -> Vec<Term> {
        let numbers = ["amplitude", "cycles", "phase"].map(|stem| self.number(stem));
        let [Some((amplitude, sigma)), Some((cycles, _)), Some((phase, _))] = numbers else {
            return Vec::new();
        };
        let parts = [(true, libm::cos(phase)), (false, libm::sin(phase))];
        let part = |(is_sine, share): (bool, f64)| Term {
            column: Law::Wave { cycles, is_sine }.column(motion, joint),
            number: amplitude * share,
            sigma: sigma * share.abs(),
        };
        parts.map(part).into()
    }
}

/// `|τ| sign(v)`, the rigid body's torque given row by row.
pub(super) fn load_column(motion: &Motion, joint: usize, load: &[f64]) -> Column {
    let direction = Law::Direction.column(motion, joint);
    let times = |(joint, sign): &(usize, Vec<f64>)| {
        (*joint, sign.iter().zip(load).map(|(sign, load)| sign * load.abs()).collect())
    };
    Column { parts: direction.parts.iter().map(times).collect() }
}
