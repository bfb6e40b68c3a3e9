//! The candidate dictionary of a linear search: columns, and the candidates (names) that are made of them.
//!
//! Promises: candidates may share columns. Never: data of a domain.

use glam::DVec3;

use super::table::Column;

/// What a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sign {
    Any,
    /// At least this: 0, or what takes away all that the model states.
    AtLeast(f64),
    /// From and to.
    Within([f64; 2]),
}

impl Sign {
    pub(crate) fn admits(self, value: f64) -> bool {
        match self {
            Self::Any => true,
            Self::AtLeast(least) => value >= least,
            Self::Within([least, most]) => (least..=most).contains(&value),
        }
    }
}

/// How the numbers of columns become the numbers of the effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Form {
    /// One column each, in this order of stems.
    Plain(&'static [&'static str]),
    /// Half the height of a loop.
    Loop,
    /// Minus viscous friction times what a kelvin takes of it.
    Warmth,
    /// `K q + c`: stiffness and rest position.
    Spring,
    /// Sine and cosine: amplitude and phase.
    Wave,
    /// Three numbers of one first moment.
    Moment,
    /// Mass and first moment about this point of the zero configuration, m.
    Payload { about: DVec3 },
}

/// One name at one place.
#[derive(Clone, Debug)]
pub(crate) struct Family {
    pub(crate) kind: &'static str,
    pub(crate) joint: Option<usize>,
    /// The one recording in which it acts; none: all.
    pub(crate) recording: Option<usize>,
    pub(crate) columns: Vec<usize>,
    pub(crate) signs: Vec<Sign>,
    pub(crate) form: Form,
    /// A change of a number that the model states with an uncertainty: what is fitted along within it explains as much, so that belief alone speaks for the name.
    pub(crate) revises: bool,
    /// Numbers that columns do not give: stem and value, SI.
    pub(crate) settings: Vec<(&'static str, f64)>,
}

/// All columns and names.
#[derive(Clone)]
pub(crate) struct Library {
    pub(crate) columns: Vec<Column>,
    /// One over the square of what is believed of each column's number.
    pub(crate) prior: Vec<f64>,
    pub(crate) families: Vec<Family>,
    /// What cannot show in these recordings: effect, joint, why.
    pub(crate) untested: Vec<(&'static str, Option<usize>, &'static str)>,
}

impl Family {
    /// How many numbers it takes, searched ones included.
    pub(crate) fn count(&self) -> usize {
        self.columns.len() + self.settings.len()
    }

    /// Whether the other is the same name at the same place in another form.
    pub(crate) fn is_kin(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.joint == other.joint
            && self.recording == other.recording
            && self.kind != "torque_ripple"
    }
}

impl Library {
    /// Columns of laws of their own, with every name that they make.
    pub(crate) fn add(&mut self, family: Family, columns: Vec<Column>) {
        let from = self.columns.len();
        let own = (from..from + columns.len()).collect();
        self.prior.resize(from + columns.len(), 0.0);
        self.columns.extend(columns);
        self.families.push(Family { columns: own, ..family });
    }

    /// A column that several names share.
    pub(crate) fn column(&mut self, column: Column) -> usize {
        self.columns.push(column);
        self.prior.push(0.0);
        self.columns.len() - 1
    }
}
