//! Surface profiles as an object: `trued.surface/1`.

use recording::program;
use serde::Serialize;
use spectrum::surface::HeightParameters;

use super::analysis::{Analysis, ExplainedLine, ProfileAnalysis, Segments};
use crate::error::Error;

/// Surface profiles: `trued.surface/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report<'a> {
    unit: &'static str,
    cut_off_mm: f64,
    short_cut_off_um: Option<f64>,
    form_degree: u8,
    feed_mm_s: Option<f64>,
    profiles: Vec<ProfileReport<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ProfileReport<'a> {
    file: String,
    column: &'a str,
    points: usize,
    spacing_um: f64,
    length_mm: f64,
    evaluated_from_mm: f64,
    evaluated_mm: f64,
    /// The profile is too short to leave out its ends, where the filter lacks part of its kernel.
    ends_kept: bool,
    primary: Heights,
    waviness: Heights,
    roughness: Heights,
    #[serde(rename = "Rz_um")]
    rz_um: Option<f64>,
    #[serde(rename = "Rz_sampling_lengths")]
    rz_lengths: usize,
    #[serde(rename = "RSm_um")]
    rsm_um: Option<f64>,
    #[serde(rename = "Rq_by_spectrum_um")]
    rq_by_spectrum_um: f64,
    segments: Vec<SegmentsReport>,
    lines: Vec<LineReport>,
}

/// `Xa`, `Xq`, … of ISO 21920-2, where `X` is P, W or R by the profile.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Heights {
    a_um: f64,
    q_um: f64,
    t_um: f64,
    p_um: f64,
    v_um: f64,
    sk: f64,
    ku: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SegmentsReport {
    length_mm: f64,
    each: Vec<SegmentReport>,
    mean: Option<SegmentReport>,
    spread: Option<SegmentReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "the keys are the standard's names")]
struct SegmentReport {
    #[serde(skip_serializing_if = "Option::is_none")]
    from_mm: Option<f64>,
    Wt_um: f64,
    Wq_um: f64,
    Rt_um: f64,
    Rq_um: f64,
    Ra_um: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct LineReport {
    cycles_per_mm: f64,
    sigma_cycles_per_mm: f64,
    wavelength_um: f64,
    amplitude_um: f64,
    over_floor: f64,
    frequency_Hz: Option<f64>,
    fits: String,
}

pub(super) type Pair = (HeightParameters, HeightParameters);
/// The figures of each segment: waviness first.
pub(super) const OF_SEGMENT: [fn(&Pair) -> f64; 5] = [
    |each| each.0.total_height,
    |each| each.0.rms,
    |each| each.1.total_height,
    |each| each.1.rms,
    |each| each.1.mean_deviation,
];

impl Analysis {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> Report<'_> {
        let settings = &self.settings;
        Report {
            unit: "um",
            cut_off_mm: settings.cut_off_mm,
            short_cut_off_um: settings.short_cut_off_um,
            form_degree: settings.form_degree,
            feed_mm_s: settings.machining.feed_mm_s,
            profiles: self.profiles.iter().map(ProfileReport::of).collect(),
        }
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        let text = program::json("trued.surface/1", &self.report()).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

impl<'a> ProfileReport<'a> {
    fn of(profile: &'a ProfileAnalysis) -> Self {
        let points = profile.source.heights_um.len();
        Self {
            file: profile.source.file.display().to_string(),
            column: &profile.source.column,
            points,
            spacing_um: 1e3 * profile.source.spacing_mm,
            length_mm: points as f64 * profile.source.spacing_mm,
            evaluated_from_mm: profile.start_mm(),
            evaluated_mm: profile.surface.evaluated_mm(),
            ends_kept: profile.surface.ends_kept(),
            primary: Heights::of(&profile.primary),
            waviness: Heights::of(&profile.waviness),
            roughness: Heights::of(&profile.roughness),
            rz_um: profile.rz_um.map(|(rz, _)| rz),
            rz_lengths: profile.rz_um.map_or(0, |(_, lengths)| lengths),
            rsm_um: profile.rsm_mm.map(|mm| 1e3 * mm),
            rq_by_spectrum_um: profile.rq_by_spectrum_um(),
            segments: profile.segments.iter().map(|s| SegmentsReport::of(s, profile)).collect(),
            lines: profile.lines.iter().map(|l| LineReport::of(l, &profile.lines)).collect(),
        }
    }
}

impl Heights {
    fn of(p: &HeightParameters) -> Self {
        Self {
            a_um: p.mean_deviation,
            q_um: p.rms,
            t_um: p.total_height,
            p_um: p.peak,
            v_um: p.valley,
            sk: p.skewness,
            ku: p.kurtosis,
        }
    }
}

impl SegmentReport {
    fn of(from_mm: Option<f64>, [wt, wq, rt, rq, ra]: [f64; 5]) -> Self {
        Self { from_mm, Wt_um: wt, Wq_um: wq, Rt_um: rt, Rq_um: rq, Ra_um: ra }
    }
}

impl SegmentsReport {
    fn of(segments: &Segments, profile: &ProfileAnalysis) -> Self {
        let place = |k: usize| Some(profile.start_mm() + k as f64 * segments.length_mm);
        let each = segments.each.iter().enumerate();
        let each = each.map(|(k, each)| SegmentReport::of(place(k), OF_SEGMENT.map(|f| f(each))));
        let all = OF_SEGMENT.map(|value| segments.of_all(value));
        let spread = all.map(|(_, spread)| spread.unwrap_or(f64::NAN));
        Self {
            length_mm: segments.length_mm,
            each: each.collect(),
            mean: (!segments.each.is_empty())
                .then(|| SegmentReport::of(None, all.map(|(mean, _)| mean))),
            spread: (segments.each.len() > 1).then(|| SegmentReport::of(None, spread)),
        }
    }
}

impl LineReport {
    fn of(line: &ExplainedLine, all: &[ExplainedLine]) -> Self {
        Self {
            cycles_per_mm: line.line.cycles_per_mm,
            sigma_cycles_per_mm: line.line.sigma_cycles_per_mm,
            wavelength_um: line.wavelength_um(),
            amplitude_um: line.line.amplitude,
            over_floor: line.line.over_floor,
            frequency_Hz: line.frequency_hz,
            fits: line.causes_text(all),
        }
    }
}
