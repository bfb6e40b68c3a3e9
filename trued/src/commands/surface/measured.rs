//! One profile with all its results, for text, JSON and page.

use spectrum::surface::{
    Cause, Line, Machining, Parameters, Parting, SurfaceError, by_segments, element_width_mm,
    lines, parameters, part, power_spectrum, section_height,
};
use spectrum::welch::Spectrum;

use super::input::Profile;
use crate::exit::Failure;

/// Lines kept, the strongest first.
const LINES_MAX: usize = 20;
/// Elements reach this part of Rz above and below the mean line together (ISO 21920-3, the default).
const ELEMENT_PART: f64 = 0.1;

/// A profile separated and evaluated; heights in µm.
pub(super) struct Measured {
    pub(super) name: String,
    pub(super) profile: Profile,
    pub(super) surface: spectrum::surface::Surface,
    pub(super) p: Parameters,
    pub(super) w: Parameters,
    pub(super) r: Parameters,
    /// Rz and its number of sampling lengths.
    pub(super) rz: Option<(f64, usize)>,
    pub(super) rsm_mm: Option<f64>,
    pub(super) spectra: Spectra,
    pub(super) segments: Vec<Segments>,
    pub(super) lines: Vec<Told>,
}

/// Power over cycles per mm, µm², over the evaluated length.
pub(super) struct Spectra {
    pub(super) waviness: Spectrum,
    pub(super) roughness: Spectrum,
}

/// Parameters of every whole segment of one length.
pub(super) struct Segments {
    pub(super) length_mm: f64,
    /// Waviness and roughness of each.
    pub(super) each: Vec<(Parameters, Parameters)>,
}

/// A line and its possible cause.
pub(super) struct Told {
    pub(super) line: Line,
    pub(super) frequency_hz: Option<f64>,
    pub(super) causes: Vec<Cause>,
}

impl Measured {
    pub(super) fn of(
        profile: Profile,
        parting: &Parting,
        segments_mm: &[f64],
        machining: &Machining,
    ) -> Result<Self, Failure> {
        let named = |error: &dyn std::fmt::Display| {
            Failure::input(format!("{}: {error}", profile.file.display()))
        };
        let surface = part(&profile.heights_um, profile.spacing_mm, parting)
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
        let segments = segments_mm.iter().map(|length_mm| {
            Segments::of(waviness, roughness, spacing_mm, *length_mm).map_err(|error| named(&error))
        });
        let segments = segments.collect::<Result<Vec<_>, Failure>>()?;
        let length_mm = surface.evaluated_mm();
        let found = lines(primary, spacing_mm).map_err(|error| named(&error))?;
        let told = |line: Line| Told {
            frequency_hz: machining.frequency_hz(&line),
            causes: machining.causes(&line, length_mm),
            line,
        };
        let (r, rz) =
            (parameters(roughness), section_height(roughness, spacing_mm, parting.cut_off_mm));
        let least = 0.5 * ELEMENT_PART * rz.map_or(r.total_height, |(rz, _)| rz);
        let stem = profile.file.file_stem().unwrap_or_default();
        Ok(Self {
            name: stem.to_string_lossy().into_owned(),
            p: parameters(&surface.primary),
            w: parameters(waviness),
            r,
            rz,
            rsm_mm: element_width_mm(roughness, spacing_mm, least),
            spectra,
            segments,
            lines: found.into_iter().take(LINES_MAX).map(told).collect(),
            surface,
            profile,
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
        if self.r.rms > 0.0 { (self.rq_by_spectrum_um() / self.r.rms - 1.0).abs() } else { 0.0 }
    }
}

impl Segments {
    fn of(
        waviness: &[f64],
        roughness: &[f64],
        spacing_mm: f64,
        length_mm: f64,
    ) -> Result<Self, SurfaceError> {
        let each = |heights: &[f64]| match by_segments(heights, spacing_mm, length_mm) {
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
        value: impl Fn(&(Parameters, Parameters)) -> f64,
    ) -> (f64, Option<f64>) {
        let n = self.each.len() as f64;
        let mean = self.each.iter().map(&value).sum::<f64>() / n;
        let squares = self.each.iter().map(|each| (value(each) - mean).powi(2)).sum::<f64>();
        (mean, (self.each.len() > 1).then(|| (squares / (n - 1.0)).sqrt()))
    }
}

impl Told {
    pub(super) fn wavelength_um(&self) -> f64 {
        1e3 * self.line.wavelength_mm()
    }

    /// The line's cause, in words; `lines` are all of its profile.
    pub(super) fn words(&self, lines: &[Self]) -> String {
        let times = |order: u32| if order == 1 { String::new() } else { format!("{order} × ") };
        let mut words: Vec<String> = self
            .causes
            .iter()
            .map(|cause| match cause {
                Cause::Wheel(wheel, order) => format!("{}{wheel}", times(*order)),
                Cause::Tooth(order) => format!("{}tooth passing", times(*order)),
                Cause::Spindle(order) => format!("{}spindle turn", times(*order)),
                Cause::Mode(hz) => format!("mode at {} Hz", report::significant(*hz, 3)),
            })
            .collect();
        if let Some((of, order)) = self.line.multiple_of
            && let Some(of) = lines.get(of)
        {
            words.push(format!(
                "multiple {order} of {} µm",
                report::significant(of.wavelength_um(), 3)
            ));
        }
        words.join(" or ")
    }
}
