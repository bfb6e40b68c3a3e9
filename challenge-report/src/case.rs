//! A random case of any domain behind one interface: files, truth, and evaluation of a written model.
//!
//! The cases of the position domain do not depend on the other domains. No answer is handled here.

use challenge::case::Tier;
use challenge::score::Errors;
use challenge::truth::Truth;
use challenge::{draw, force, torque, write};

use crate::prediction;

/// What is measured and diagnosed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// The position of the tool.
    Position,
    /// Drive torques.
    Torque,
    /// Forces of a cutter.
    Force,
}

impl Domain {
    /// Its name in answers.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Torque => "torque",
            Self::Force => "force",
        }
    }
}

/// A case.
#[derive(Debug)]
pub struct Case {
    /// What is measured.
    pub domain: Domain,
    drawn: Drawn,
}

#[derive(Debug)]
enum Drawn {
    Position(draw::Drawn),
    Torque(torque::draw::Drawn),
    Force(force::draw::Drawn),
}

impl Case {
    /// Case `index` of a seed; `tier`: the kinds that it may hide, and its place among the cases of that tier.
    #[must_use]
    pub fn draw(domain: Domain, seed: u64, index: usize, tier: (Tier, usize)) -> Self {
        let drawn = match domain {
            Domain::Position => Drawn::Position(draw::case(seed, index, tier)),
            Domain::Torque => Drawn::Torque(torque::draw::case(seed, index, tier)),
            Domain::Force => Drawn::Force(force::draw::case(seed, index, tier)),
        };
        Self { domain, drawn }
    }

    /// What a solver gets: names and texts of model, recording and its description.
    #[must_use]
    pub fn files(&self) -> [write::File; 3] {
        match &self.drawn {
            Drawn::Position(drawn) => write::files(&drawn.case),
            Drawn::Torque(drawn) => torque::write::files(&drawn.case),
            Drawn::Force(drawn) => force::write::files(&drawn.case),
        }
    }

    /// What was hidden.
    #[must_use]
    pub fn truth(&self, name: &str) -> Truth {
        match &self.drawn {
            Drawn::Position(drawn) => Truth::of(name, drawn),
            Drawn::Torque(drawn) => Truth::of(name, drawn),
            Drawn::Force(drawn) => Truth::of(name, drawn),
        }
    }

    /// Errors of a written model on a motion that nobody saw; `None` for a case that hides nothing, or where a gain is meaningless. A model that is missing or
    /// does not load counts as the given one.
    #[must_use]
    pub fn errors(&self, model: Option<&str>) -> Option<Errors> {
        match &self.drawn {
            Drawn::Position(drawn) => prediction::of_positions(&drawn.case, model),
            Drawn::Torque(drawn) => prediction::of_torques(&drawn.case, model),
            Drawn::Force(drawn) => prediction::of_forces(&drawn.case, model),
        }
    }
}
