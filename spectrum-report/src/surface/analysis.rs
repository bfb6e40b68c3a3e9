//! From profiles to waviness, roughness, their parameters and the lines of their spectrum.

use std::fmt::Display;

use spectrum::surface::{
    Cause, HeightParameters, Line, SurfaceError, element_width_mm, height_parameters, lines,
    mean_section_height, parameters_by_segment, power_spectrum, separate,
};
use spectrum::welch::Spectrum;

use super::Settings;
use super::input::Profile;
use crate::error::Error;

/// Lines kept, the strongest first.
const LINES_MAX: usize = 20;
/// Elements reach this part of Rz above and below the mean line together (ISO 21920-3, the default).
const ELEMENT_PART: f64 = 0.1;

/// Profiles, evaluated alike.
pub struct Analysis {
    /// The profiles.
    pub profiles: Vec<ProfileAnalysis>,
    pub(super) settings: Settings,
}

/// A profile, separated and evaluated; heights in µm.
pub struct ProfileAnalysis {
    /// Name of its file, without folder and ending.
    pub name: String,
    /// The profile as it was read.
    pub source: Profile,
    /// The profile without its form, its waviness and its roughness.
    pub surface: spectrum::surface::SeparatedProfile,
    /// Parameters of the profile without its form.
    pub primary: HeightParameters,
    /// Parameters of the waviness.
    pub waviness: HeightParameters,
    /// Parameters of the roughness.
    pub roughness: HeightParameters,
    /// Rz in µm, and its number of sampling lengths.
    pub rz_um: Option<(f64, usize)>,
    /// Mean width of the elements of the roughness, mm.
    pub rsm_mm: Option<f64>,
    /// Spectra over the evaluated length.
    pub spectra: Spectra,
    /// Parameters of segments, for each of the segments' lengths.
    pub segments: Vec<Segments>,
    /// Lines of the spectrum, the strongest first.
    pub lines: Vec<ExplainedLine>,
}

/// Power over cycles per mm, µm², over the evaluated length.
pub struct Spectra {
    /// Of the waviness.
    pub waviness: Spectrum,
    /// Of the roughness.
    pub roughness: Spectrum,
}

/// Parameters of every whole segment of one length.
pub struct Segments {
    /// Length of a segment, mm.
    pub length_mm: f64,
    /// Waviness and roughness of each.
    pub each: Vec<(HeightParameters, HeightParameters)>,
}

/// A line and its possible causes.
pub struct ExplainedLine {
    /// The line.
    pub line: Line,
    /// Its frequency in time at the feed of the cut, Hz.
    pub frequency_hz: Option<f64>,
    /// What may have caused it.
    pub causes: Vec<Cause>,
}

/// The lines of a profile without its form.
pub(crate) struct ProfileLines {
    /// Evaluated length, mm.
    pub(crate) length_mm: f64,
    /// The strongest first.
    pub(crate) lines: Vec<Line>,
}

/// Separates profiles into waviness and roughness and evaluates them.
///
/// # Errors
/// [`Error::Input`] if a profile is too short for the settings, or contains a value that is not finite.
pub fn analyse(profiles: Vec<Profile>, settings: &Settings) -> Result<Analysis, Error> {
    let profiles = profiles.into_iter().map(|profile| ProfileAnalysis::of(profile, settings));
    let profiles = profiles.collect::<Result<Vec<_>, Error>>()?;
    Ok(Analysis { profiles, settings: settings.clone() })
}

/// The lines of a profile, with the default settings.
pub(crate) fn lines_of(profile: &Profile) -> Result<ProfileLines, Error> {
    let named = |error: &dyn Display| Error::input(format!("{}: {error}", profile.file.display()));
    let surface = separate(&profile.heights_um, profile.spacing_mm, &Settings::default().parting())
        .map_err(|error| named(&error))?;
    let primary = &surface.primary[surface.evaluated.clone()];
    let lines = lines(primary, profile.spacing_mm).map_err(|error| named(&error))?;
    Ok(ProfileLines { length_mm: surface.evaluated_mm(), lines })
}

impl ProfileAnalysis {
    fn of(profile: Profile, settings: &Settings) -> Result<Self, Error> {
        let named =
            |error: &dyn Display| Error::input(format!("{}: {error}", profile.file.display()));
        let machining = &settings.machining;
        let surface = separate(&profile.heights_um, profile.spacing_mm, &settings.parting())
            .map_err(|error| named(&error))?;
        let spacing_mm = profile.spacing_mm;
        let range = surface.evaluated.clone();
        let (primary, waviness, roughness) = (
            &surface.primary[range.clone()],
            &surface.waviness[range.clone()],
            &surface.roughness[range],
        );
        let spectrum =
            |heights: &[f64]| power_spectrum(heights, spacing_mm).map_err(|error| named(&error));
        let spectra = Spectra { waviness: spectrum(waviness)?, roughness: spectrum(roughness)? };
        let segments = settings.segments_mm.iter().map(|length_mm| {
            Segments::of(waviness, roughness, spacing_mm, *length_mm).map_err(|error| named(&error))
        });
        let segments = segments.collect::<Result<Vec<_>, Error>>()?;
        let length_mm = surface.evaluated_mm();
        let found = lines(primary, spacing_mm).map_err(|error| named(&error))?;
        let explained = |line: Line| ExplainedLine {
            frequency_hz: machining.frequency_hz(&line),
            causes: machining.causes(&line, length_mm),
            line,
        };
        let r = height_parameters(roughness);
        let rz_um = mean_section_height(roughness, spacing_mm, settings.cut_off_mm);
        let least_um = 0.5 * ELEMENT_PART * rz_um.map_or(r.total_height, |(rz_um, _)| rz_um);
        let stem = profile.file.file_stem().unwrap_or_default();
        Ok(Self {
            name: stem.to_string_lossy().into_owned(),
            primary: height_parameters(&surface.primary),
            waviness: height_parameters(waviness),
            roughness: r,
            rz_um,
            rsm_mm: element_width_mm(roughness, spacing_mm, least_um),
            spectra,
            segments,
            lines: found.into_iter().take(LINES_MAX).map(explained).collect(),
            surface,
            source: profile,
        })
    }

    /// Place of the first evaluated point, mm.
    pub(super) fn start_mm(&self) -> f64 {
        self.surface.evaluated.start as f64 * self.surface.spacing_mm
    }

    /// Rq by Parseval: the root of the sum of its spectrum, µm.
    pub(super) fn rq_by_spectrum_um(&self) -> f64 {
        self.spectra.roughness.power.iter().sum::<f64>().sqrt()
    }

    /// Relative difference between the two ways to compute Rq.
    pub(super) fn parseval_gap(&self) -> f64 {
        let rq_um = self.roughness.rms;
        if rq_um > 0.0 { (self.rq_by_spectrum_um() / rq_um - 1.0).abs() } else { 0.0 }
    }
}

impl Segments {
    fn of(
        waviness: &[f64],
        roughness: &[f64],
        spacing_mm: f64,
        length_mm: f64,
    ) -> Result<Self, SurfaceError> {
        let each = |heights: &[f64]| match parameters_by_segment(heights, spacing_mm, length_mm) {
            // A profile shorter than a segment has none.
            Err(SurfaceError::TooShort { .. }) => Ok(Vec::new()),
            each => each,
        };
        let each = each(waviness)?.into_iter().zip(each(roughness)?).collect();
        Ok(Self { length_mm, each })
    }

    /// Mean and standard deviation over the segments; no deviation for fewer than two.
    pub(super) fn of_all(
        &self,
        value: impl Fn(&(HeightParameters, HeightParameters)) -> f64,
    ) -> (f64, Option<f64>) {
        let n = self.each.len() as f64;
        let mean = self.each.iter().map(&value).sum::<f64>() / n;
        let squares = self.each.iter().map(|each| (value(each) - mean).powi(2)).sum::<f64>();
        (mean, (self.each.len() > 1).then(|| (squares / (n - 1.0)).sqrt()))
    }
}

impl ExplainedLine {
    /// Its wavelength, µm.
    #[must_use]
    pub fn wavelength_um(&self) -> f64 {
        1e3 * self.line.wavelength_mm()
    }

    /// Its possible causes, as text; `lines` are all of its profile.
    pub(super) fn causes_text(&self, lines: &[Self]) -> String {
        let times = |order: u32| if order == 1 { String::new() } else { format!("{order} × ") };
        let mut causes: Vec<String> = self
            .causes
            .iter()
            .map(|cause| match cause {
                Cause::Gear(wheel, order) => format!("{}{wheel}", times(*order)),
                Cause::Tooth(order) => format!("{}tooth passing", times(*order)),
                Cause::Spindle(order) => format!("{}spindle turn", times(*order)),
                Cause::Mode(hz) => format!("mode at {} Hz", report::significant(*hz, 3)),
            })
            .collect();
        if let Some((of, order)) = self.line.multiple_of
            && let Some(of) = lines.get(of)
        {
            causes.push(format!(
                "multiple {order} of {} µm",
                report::significant(of.wavelength_um(), 3)
            ));
        }
        causes.join(" or ")
    }
}
