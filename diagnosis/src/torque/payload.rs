//! Unmodelled payload: mass and first moment about a point, four linear parameters.
//!
//! A mass away from that point also has inertia about it; the columns are therefore recentred at the fitted centre of mass, about which a point mass
//! is represented to first order.

use glam::DVec3;
use physics::dynamics::INERTIAL_PARAMETERS;

use super::motion::Motion;
use super::rigid_body::shifted_to;
use crate::engine::dictionary::{
    CandidateDictionary, CandidateTerm, CoefficientForm, ParameterBounds,
};
use crate::engine::normal_equations::LeastSquaresSolution;
use crate::engine::regression_data::Regressor;

/// Largest distance of a payload's centre of mass from the tool centre point, m; fits beyond it are ignored, and it is the uncertainty of an
/// unobservable component.
pub(super) const REACH_M: f64 = 2.0;

/// Smallest shift of the centre of mass that recentres the columns, m.
const NEAR_M: f64 = 1e-3;

impl CandidateDictionary {
    /// Adds a payload in all recordings or in one; `of_mass`: columns of mass and first moment about `about`.
    pub(super) fn add_payload(
        &mut self,
        motion: &Motion,
        of_mass: &[Regressor],
        about: DVec3,
        recording: Option<usize>,
    ) {
        let family = CandidateTerm {
            kind: "payload",
            joint: None,
            recording,
            columns: Vec::new(),
            signs: vec![
                ParameterBounds::AtLeast(f64::MIN_POSITIVE),
                ParameterBounds::Any,
                ParameterBounds::Any,
                ParameterBounds::Any,
            ],
            form: CoefficientForm::Payload { about },
            corrects_stated: false,
            settings: Vec::new(),
        };
        let columns = of_mass.iter().map(|column| restricted_to(motion, column, recording));
        self.add(family, without_rounding_errors(columns.collect()));
    }

    /// Recentres the columns of a payload at its fitted centre of mass, and returns whether it moved; `inertia`: the columns of the last body's
    /// inertia.
    pub(super) fn recentre_payload(
        &mut self,
        motion: &Motion,
        name: usize,
        inertia: std::ops::Range<usize>,
        solved: &LeastSquaresSolution,
    ) -> bool {
        let family = &self.terms[name];
        let (CoefficientForm::Payload { about }, &[m, x, y, z]) =
            (family.form, &family.columns[..])
        else {
            return false;
        };
        let number = |column| solved.value(column).unwrap_or(0.0);
        let by = DVec3::new(number(x), number(y), number(z)) / number(m);
        if !(NEAR_M..REACH_M).contains(&by.length()) {
            return false;
        }
        let of_inertia: Vec<Regressor> = self.columns[inertia]
            .iter()
            .map(|column| restricted_to(motion, column, family.recording))
            .collect();
        let places = [m, x, y, z];
        let known = places.map(|place| &self.columns[place]);
        let all: [&Regressor; INERTIAL_PARAMETERS] =
            std::array::from_fn(|k| if k < 4 { known[k] } else { &of_inertia[k - 4] });
        let new = shifted_to(all, by);
        for (place, column) in places.into_iter().zip(without_rounding_errors(new.to_vec())) {
            self.columns[place] = column;
        }
        self.terms[name].form = CoefficientForm::Payload { about: about + by };
        true
    }
}

/// A first-moment column smaller than this share of the mass column is rounding error.
const ROUNDING: f64 = 1e-9;

/// The columns of mass and first moment, with those that affect no drive emptied.
fn without_rounding_errors(mut columns: Vec<Regressor>) -> Vec<Regressor> {
    let square =
        |column: &Regressor| column.parts.iter().flat_map(|(_, x)| x.iter()).map(|x| x * x).sum();
    let squares: Vec<f64> = columns.iter().map(square).collect();
    let negligible = ROUNDING * ROUNDING * squares[0];
    let negligible_columns =
        columns.iter_mut().zip(&squares).filter(|(_, square)| **square < negligible);
    negligible_columns.for_each(|(column, _)| column.parts.clear());
    columns
}

/// The column restricted to the rows of one recording; unchanged if `None`.
fn restricted_to(motion: &Motion, column: &Regressor, recording: Option<usize>) -> Regressor {
    let is_included =
        |run: usize| recording.is_none_or(|wanted| wanted == motion.runs[run].recording);
    let runs = motion.runs.iter().enumerate();
    let rows: Vec<bool> =
        runs.flat_map(|(k, run)| std::iter::repeat_n(is_included(k), run.rows.len())).collect();
    let only = |values: &[f64]| {
        values
            .iter()
            .zip(&rows)
            .map(|(x, is_included)| if *is_included { *x } else { 0.0 })
            .collect()
    };
    Regressor { parts: column.parts.iter().map(|(joint, x)| (*joint, only(x))).collect() }
}
