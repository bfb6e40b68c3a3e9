//! A random case of any domain behind one interface: files, truth, and evaluation of a written model.
//!
//! The cases of the position domain do not depend on the other domains. No answer is handled here.

use challenge::case::Tier;
use challenge::score::Errors;
use challenge::truth::Truth;
use challenge::{draw, write};
use challenge::{force, torque};
use clap::ValueEnum;

use super::worth;

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Domain {
    /// Where the tool goes
    Position,
    /// What the motors feel
    Torque,
    /// What a cutter exerts
    Force,
}

impl Domain {
    /// Its name in answers.
    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Torque => "torque",
            Self::Force => "force",
        }
    }

    /// Case `index` of a seed; with a tier, of that tier's kinds only.
    pub(super) fn draw(self, seed: u64, index: usize, tier: (Tier, usize)) -> Drawn {
        match self {
            Self::Position => Drawn::Position(draw::case(seed, index, tier)),
            Self::Torque => Drawn::Torque(torque::draw::case(seed, index, tier)),
            Self::Force => Drawn::Force(force::draw::case(seed, index, tier)),
        }
    }
}

/// A case.
#[derive(Debug)]
pub(super) enum Drawn {
    Position(draw::Drawn),
    Torque(torque::draw::Drawn),
    Force(force::draw::Drawn),
}

impl Drawn {
    pub(super) fn files(&self) -> [write::File; 3] {
        match self {
            Self::Position(drawn) => write::files(&drawn.case),
            Self::Torque(drawn) => torque::write::files(&drawn.case),
            Self::Force(drawn) => force::write::files(&drawn.case),
        }
    }

    pub(super) fn truth(&self, name: &str) -> Truth {
        match self {
            Self::Position(drawn) => Truth::of(name, drawn),
            Self::Torque(drawn) => Truth::of(name, drawn),
            Self::Force(drawn) => Truth::of(name, drawn),
        }
    }

    /// The errors of a written model; `None` for a null case, or if a gain is meaningless.
    pub(super) fn errors(&self, model: Option<&str>) -> Option<Errors> {
        match self {
            Self::Position(drawn) => worth::of(drawn, model),
            Self::Torque(drawn) => worth::of_torques(&drawn.case, model),
            Self::Force(drawn) => worth::of_forces(&drawn.case, model),
        }
    }
}
