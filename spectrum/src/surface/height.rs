//! Height parameters of a profile, of its segments and of its sampling lengths; mean width of its
//! elements.
//!
//! ISO 21920-2 (formerly ISO 4287): the same formulas give P, W and R parameters, depending on the
//! profile.

use super::{SurfaceError, check};

/// Number of sampling lengths of the standard's default evaluation.
const SAMPLING_LENGTHS: usize = 5;

/// Parameters of a profile about its mean, in the profile's unit where they have one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightParameters {
    /// Arithmetic mean deviation (Pa, Ra, Wa).
    pub mean_deviation: f64,
    /// Root mean square (Pq, Rq, Wq).
    pub rms: f64,
    /// Highest peak to deepest valley (Pt, Rt, Wt).
    pub total_height: f64,
    /// Highest peak over the mean line (Pp, Rp, Wp).
    pub peak: f64,
    /// Deepest valley below the mean line, positive (Pv, Rv, Wv).
    pub valley: f64,
    /// Skewness (Psk, Rsk, Wsk): negative where plateaus have deep grooves. 0 for a flat profile.
    pub skewness: f64,
    /// Kurtosis (Pku, Rku, Wku): 3 for normally distributed heights. 0 for a flat profile.
    pub kurtosis: f64,
}

/// Parameters of one profile.
#[must_use]
pub fn height_parameters(heights: &[f64]) -> HeightParameters {
    let n = heights.len().max(1) as f64;
    let mean = heights.iter().sum::<f64>() / n;
    let moment = |power: i32| heights.iter().map(|z| (z - mean).powi(power)).sum::<f64>() / n;
    let above = || heights.iter().map(|z| z - mean);
    let (peak, valley) =
        above().fold((0.0_f64, 0.0_f64), |(peak, valley), z| (peak.max(z), valley.max(-z)));
    let rms = moment(2).sqrt();
    let shape = |power: i32| if rms > 0.0 { moment(power) / rms.powi(power) } else { 0.0 };
    HeightParameters {
        mean_deviation: above().map(f64::abs).sum::<f64>() / n,
        rms,
        total_height: peak + valley,
        peak,
        valley,
        skewness: shape(3),
        kurtosis: shape(4),
    }
}

/// Parameters of each whole segment of a profile, as in the thesis' tables 4.1 (2.5 mm, waviness)
/// and 4.2 (0.25 mm, roughness). A remainder shorter than a segment is ignored.
///
/// # Errors
/// An invalid segment length, or one longer than the profile.
pub fn parameters_by_segment(
    heights: &[f64],
    spacing_mm: f64,
    segment_mm: f64,
) -> Result<Vec<HeightParameters>, SurfaceError> {
    check(heights, spacing_mm)?;
    if !(segment_mm > spacing_mm && segment_mm.is_finite()) {
        return Err(SurfaceError::Length { what: "segment", value_mm: segment_mm });
    }
    let points = (segment_mm / spacing_mm).round() as usize;
    if points > heights.len() {
        return Err(SurfaceError::TooShort { points: heights.len(), expected: points });
    }
    Ok(heights.chunks_exact(points).map(height_parameters).collect())
}

/// Rz: the mean total height of the sampling lengths in the middle of the profile, and their
/// number: five if they fit, as in the standards; `None` if the profile is shorter than one.
#[must_use]
pub fn mean_section_height(
    roughness: &[f64],
    spacing_mm: f64,
    cut_off_mm: f64,
) -> Option<(f64, usize)> {
    let points = (cut_off_mm / spacing_mm).round() as usize;
    let sections = roughness.len().checked_div(points)?.min(SAMPLING_LENGTHS);
    if sections == 0 {
        return None;
    }
    let start = (roughness.len() - sections * points) / 2;
    let inner = &roughness[start..start + sections * points];
    let heights = inner.chunks_exact(points).map(|section| height_parameters(section).total_height);
    Some((heights.sum::<f64>() / sections as f64, sections))
}

/// `RSm`: the mean width of a profile's elements (a peak and the adjacent valley), mm, from one
/// upward crossing of the mean line to the next. An element must reach `least_height` above and
/// below the mean line. `None` for fewer than two crossings.
#[must_use]
pub fn element_width_mm(heights: &[f64], spacing_mm: f64, least_height: f64) -> Option<f64> {
    let mean = heights.iter().sum::<f64>() / heights.len().max(1) as f64;
    let mut below = false;
    let mut crossing = None;
    let mut upward = Vec::new();
    for (i, pair) in heights.windows(2).enumerate() {
        let [from, to] = [pair[0] - mean, pair[1] - mean];
        below |= from < -least_height;
        if below && from < 0.0 && to >= 0.0 {
            crossing = Some(i as f64 + from / (from - to));
        }
        if below && to > least_height {
            upward.extend(crossing.take());
            below = false;
        }
    }
    let (first, last) = (upward.first()?, upward.last()?);
    let elements = upward.len() - 1;
    (elements > 0).then(|| (last - first) * spacing_mm / elements as f64)
}
