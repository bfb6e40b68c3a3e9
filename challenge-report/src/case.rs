//! A random case of any domain behind one interface: files, truth, and evaluation of a written model.
//!
//! The cases of the position domain do not depend on the other domains. No answer is handled here.

use challenge::case::Tier;
use challenge::score::PredictionErrors;
use challenge::truth::Truth;
use challenge::{case_files, force, generate, torque};

use crate::prediction;

/// Measured and diagnosed quantity.
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
    /// Measured quantity.
    pub domain: Domain,
    drawn: DomainCase,
}

#[derive(Debug)]
enum DomainCase {
    Position(generate::GeneratedCase),
    Torque(torque::generate::GeneratedCase),
    Force(force::generate::GeneratedCase),
}

impl Case {
    /// Generates case `index` of a seed; `tier`: its tier, and its index among the cases of that tier.
    #[must_use]
    pub fn generate(domain: Domain, seed: u64, index: usize, tier: (Tier, usize)) -> Self {
        let generated = match domain {
            Domain::Position => DomainCase::Position(generate::generate_case(seed, index, tier)),
            Domain::Torque => {
                DomainCase::Torque(torque::generate::generate_case(seed, index, tier))
            }
            Domain::Force => DomainCase::Force(force::generate::generate_case(seed, index, tier)),
        };
        Self { domain, drawn: generated }
    }

    /// Files given to the solver: names and texts of the model, the recording and its metadata.
    #[must_use]
    pub fn files(&self) -> [case_files::File; 3] {
        match &self.drawn {
            DomainCase::Position(drawn) => case_files::files(&drawn.case),
            DomainCase::Torque(drawn) => torque::case_files::files(&drawn.case),
            DomainCase::Force(drawn) => force::case_files::files(&drawn.case),
        }
    }

    /// Sealed truth of the case.
    #[must_use]
    pub fn truth(&self, name: &str) -> Truth {
        match &self.drawn {
            DomainCase::Position(drawn) => Truth::of(name, drawn),
            DomainCase::Torque(drawn) => Truth::of(name, drawn),
            DomainCase::Force(drawn) => Truth::of(name, drawn),
        }
    }

    /// Prediction errors of a written model on the unseen motion; `None` without hidden effects, or if the error is not defined (chatter). A model that is
    /// missing or cannot be loaded counts as the given model.
    #[must_use]
    pub fn errors(&self, model: Option<&str>) -> Option<PredictionErrors> {
        match &self.drawn {
            DomainCase::Position(drawn) => prediction::of_positions(&drawn.case, model),
            DomainCase::Torque(drawn) => prediction::of_torques(&drawn.case, model),
            DomainCase::Force(drawn) => prediction::of_forces(&drawn.case, model),
        }
    }
}
