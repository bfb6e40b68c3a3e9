//! Surface profiles: form removal, Gaussian filter, waviness and roughness, their parameters and
//! lines.
//!
//! Form is a least-squares polynomial (a line by default); the filter is that of ISO 16610-21.
//! Parameters are those of ISO 21920-2 (formerly ISO 4287), about the mean line, over an evaluated
//! range without half a cut-off at each end, where the filter lacks half its kernel. The root mean
//! square also follows from the one-sided power spectrum (Parseval), as in thesis 4.6. Profiles are
//! not resampled, and gaps are not filled.

mod cause;
mod filter;
mod height;
mod line;
#[cfg(test)]
mod tests;

use std::ops::Range;

pub use cause::{Cause, MachiningConditions};
pub use filter::{GAUSS_ALPHA, gaussian, gaussian_transmission, remove_form};
pub use height::{
    HeightParameters, element_width_mm, height_parameters, mean_section_height,
    parameters_by_segment,
};
pub use line::{Line, lines, power_spectrum};

/// The highest degree of a form.
pub const FORM_MAX: usize = 5;

/// A profile that cannot be analysed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// An invalid spacing, cut-off or segment length.
    #[error(
        "surface: {what} is {value_mm} mm, expected a finite length above 0, and a cut-off or segment above the \
         spacing"
    )]
    Length {
        /// Which length.
        what: &'static str,
        /// Its value, mm.
        value_mm: f64,
    },
    /// The two cut-offs are in the wrong order.
    #[error(
        "surface: the short cut-off is {short_mm} mm and the cut-off {cut_off_mm} mm, expected the short one to be shorter"
    )]
    CutOffs {
        /// The short cut-off, mm.
        short_mm: f64,
        /// The cut-off between roughness and waviness, mm.
        cut_off_mm: f64,
    },
    /// An invalid degree of the form.
    #[error("surface: a form of degree {degree}, expected 0 (mean) to {FORM_MAX}; 1 is a line")]
    Form {
        /// The requested degree.
        degree: usize,
    },
    /// Too few points.
    #[error(
        "surface: the profile has {points} points, expected at least {expected}; give a longer profile or shorter segments"
    )]
    TooShort {
        /// The number of points.
        points: usize,
        /// Points needed.
        expected: usize,
    },
    /// A height that is not a number.
    #[error("surface: height {index} is not finite; repair or cut the profile there")]
    NotFinite {
        /// Place in the profile, from 0.
        index: usize,
    },
}

/// Settings of the separation of form, waviness and roughness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparationSettings {
    /// Degree of the least-squares polynomial removed as form: 0 the mean, 1 a line.
    pub form_degree: usize,
    /// Short-wave cut-off (`λ_s`), mm: shorter wavelengths are instrument noise; `None`: not
    /// filtered.
    pub short_cut_off_mm: Option<f64>,
    /// Cut-off between roughness and waviness (`λ_c`), mm.
    pub cut_off_mm: f64,
}

impl SeparationSettings {
    /// Removal of a line as form, and this cut-off.
    #[must_use]
    pub fn at_mm(cut_off_mm: f64) -> Self {
        Self { form_degree: 1, short_cut_off_mm: None, cut_off_mm }
    }
}

/// A separated profile.
#[derive(Clone, Debug, PartialEq)]
pub struct SeparatedProfile {
    /// Distance between points, mm.
    pub spacing_mm: f64,
    /// The profile without its form, and without wavelengths below the short cut-off.
    pub primary: Vec<f64>,
    /// Wavelengths above the cut-off, passed by the filter.
    pub waviness: Vec<f64>,
    /// Wavelengths below the cut-off.
    pub roughness: Vec<f64>,
    /// The evaluated points: without half a cut-off at each end if at least one cut-off remains
    /// between; otherwise all.
    pub evaluated: Range<usize>,
}

impl SeparatedProfile {
    /// Whether the ends are evaluated too, although the filter lacks part of its kernel there.
    #[must_use]
    pub fn ends_kept(&self) -> bool {
        self.evaluated.len() == self.primary.len()
    }

    /// Evaluated length, mm.
    #[must_use]
    pub fn evaluated_mm(&self) -> f64 {
        self.evaluated.len() as f64 * self.spacing_mm
    }
}

/// Removes the form and separates waviness from roughness at the cut-off.
///
/// # Errors
/// Invalid lengths or degree, heights that are not finite.
pub fn separate(
    heights: &[f64],
    spacing_mm: f64,
    parting: &SeparationSettings,
) -> Result<SeparatedProfile, SurfaceError> {
    check(heights, spacing_mm)?;
    let SeparationSettings { form_degree, short_cut_off_mm, cut_off_mm } = *parting;
    let level = remove_form(heights, form_degree)?;
    let primary = match short_cut_off_mm {
        Some(short_mm) if short_mm >= cut_off_mm => {
            return Err(SurfaceError::CutOffs { short_mm, cut_off_mm });
        }
        Some(short_mm) => gaussian(&level, spacing_mm, short_mm)?,
        None => level,
    };
    let waviness = gaussian(&primary, spacing_mm, cut_off_mm)?;
    let roughness = primary.iter().zip(&waviness).map(|(z, w)| z - w).collect();
    let margin = (0.5 * cut_off_mm / spacing_mm).ceil() as usize;
    let length_min = 2 * margin + (cut_off_mm / spacing_mm).floor() as usize;
    let evaluated =
        if heights.len() >= length_min { margin..heights.len() - margin } else { 0..heights.len() };
    Ok(SeparatedProfile { spacing_mm, primary, waviness, roughness, evaluated })
}

fn check(heights: &[f64], spacing_mm: f64) -> Result<(), SurfaceError> {
    if !(spacing_mm > 0.0 && spacing_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "spacing", value_mm: spacing_mm });
    }
    if heights.len() < 8 {
        return Err(SurfaceError::TooShort { points: heights.len(), expected: 8 });
    }
    heights
        .iter()
        .position(|z| !z.is_finite())
        .map_or(Ok(()), |index| Err(SurfaceError::NotFinite { index }))
}
