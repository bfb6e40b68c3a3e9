//! The candidate dictionary of a linear search: columns (regressors), and the candidates that consist of them. Candidates may share columns.

use glam::DVec3;

use super::regression_data::Regressor;

/// Range of a parameter that is physically possible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ParameterBounds {
    Any,
    /// At least this: 0, or minus the value that the model states.
    AtLeast(f64),
    /// Between these limits.
    Within([f64; 2]),
}

impl ParameterBounds {
    pub(crate) fn admits(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::AtLeast(least) => value >= least,
            Self::Within([least, most]) => (least..=most).contains(&value),
        }
    }
}

/// How the coefficients of the columns are converted to the parameters of the effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CoefficientForm {
    /// Each coefficient is a parameter of the effect; their stems, in the order of the columns.
    Plain(&'static [&'static str]),
    /// The coefficient is half the height of a hysteresis loop.
    Loop,
    /// The coefficient is minus viscous friction times its relative decrease per kelvin.
    Warmth,
    /// `K q + c`: stiffness, and the rest position from both.
    Spring,
    /// Coefficients of sine and cosine: amplitude and phase.
    Wave,
    /// The three components of a first moment of mass.
    Moment,
    /// Mass, and its first moment about this point of the zero configuration, m.
    Payload { about: DVec3 },
}

/// A candidate: one effect at one joint.
#[derive(Clone, Debug)]
pub(crate) struct CandidateTerm {
    pub(crate) kind: &'static str,
    pub(crate) joint: Option<usize>,
    /// Index of the only recording in which it acts; `None`: all.
    pub(crate) recording: Option<usize>,
    pub(crate) columns: Vec<usize>,
    pub(crate) signs: Vec<ParameterBounds>,
    pub(crate) form: CoefficientForm,
    /// Whether it corrects a parameter that the model states with an uncertainty. The fit includes that parameter anyway, within its prior, so that
    /// only the prior decides on the correction.
    pub(crate) corrects_stated: bool,
    /// Parameters that the columns do not estimate, such as searched ones: stem and value, SI.
    pub(crate) settings: Vec<(&'static str, f64)>,
}

/// All columns and candidates.
#[derive(Clone)]
pub(crate) struct CandidateDictionary {
    pub(crate) columns: Vec<Regressor>,
    /// Prior precision of each column's coefficient: 1/σ², 0 without a prior.
    pub(crate) prior: Vec<f64>,
    pub(crate) terms: Vec<CandidateTerm>,
    /// Effects that these recordings cannot show: effect, joint, reason.
    pub(crate) untested: Vec<(&'static str, Option<usize>, &'static str)>,
}

impl CandidateTerm {
    /// Number of parameters, including searched ones.
    pub(crate) fn count(&self) -> usize {
        self.columns.len() + self.settings.len()
    }

    /// Whether the other candidate is the same effect at the same joint in another form.
    pub(crate) fn is_same_effect(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.joint == other.joint
            && self.recording == other.recording
            && self.kind != "torque_ripple"
    }
}

impl CandidateDictionary {
    /// Adds a candidate with columns of its own.
    pub(crate) fn add(&mut self, family: CandidateTerm, columns: Vec<Regressor>) {
        let from = self.columns.len();
        let places = (from..from + columns.len()).collect();
        self.prior.resize(from + columns.len(), 0.0);
        self.columns.extend(columns);
        self.terms.push(CandidateTerm { columns: places, ..family });
    }

    /// Adds a column that several candidates share; returns its index.
    pub(crate) fn column(&mut self, column: Regressor) -> usize {
        self.columns.push(column);
        self.prior.push(0.0);
        self.columns.len() - 1
    }
}
