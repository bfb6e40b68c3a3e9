//! Impact (tap) tests: detection, check and windowing of the hits in a record, and their average as
//! a response function.
//!
//! A hit is detected where the force exceeds its noise and a tenth of the largest force of the
//! record. Invalid hits are rejected with a reason: double hit, overload, truncation, missing
//! samples. Outside the contact the force is noise and is set to zero (force window); a response
//! that has not decayed at the end gets an exponential window, applied to the force too, whose
//! known decay is subtracted from the damping later (Fladung and Brown 1993). Offsets are measured
//! before the hit.

mod clipping;
#[cfg(test)]
mod close_modes_tests;
mod hit_detection;
#[cfg(test)]
mod tests;

use std::ops::Range;

use crate::frf::{Frf, FrfError, Hit, Response, frf};
use hit_detection::HitCandidate;

/// Settings of the evaluation of an impact test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapConfig {
    /// Samples per second of every record, Hz.
    pub rate_hz: f64,
    /// Measured quantity of the response.
    pub response: Response,
    /// Length of each hit's record, s; `None`: as long as the hits allow.
    pub block_s: Option<f64>,
    /// Whether force and exponential windows are applied if needed; otherwise records are used
    /// unchanged.
    pub windows: bool,
}

/// A record with one or several hits.
#[derive(Clone, Copy, Debug)]
pub struct TapRecord<'a> {
    /// Hammer force, N.
    pub force: &'a [f64],
    /// Response, in the unit of its kind.
    pub response: &'a [f64],
}

/// Reason for excluding a hit from the average.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HitRejection {
    /// The hammer struck twice.
    #[error("struck twice: again with {:.0} % of its force after {:.1} ms", 100.0 * part, 1e3 * after_s)]
    DoubleHit {
        /// Time of the second blow, s; negative if the weaker blow came first.
        after_s: f64,
        /// Force relative to the first blow.
        part: f64,
    },
    /// The force sensor or its amplifier was overloaded: number of equal largest samples.
    #[error("the force is overloaded: {0} equal samples at its largest")]
    ForceOverload(usize),
    /// The response sensor or its amplifier was overloaded, likewise.
    #[error("the response is overloaded: {0} equal samples at its largest")]
    ResponseOverload(usize),
    /// The record ends, or the next hit occurs, before the ring-down ends.
    #[error("cut short: {has_s:.3} s to the next hit or the end, where {needs_s:.3} s are taken")]
    Truncated {
        /// Available length, s.
        has_s: f64,
        /// Required length, s.
        needs_s: f64,
    },
    /// Samples are missing.
    #[error("samples are missing in it")]
    MissingSamples,
}

/// A detected hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedHit {
    /// Which record, from 0.
    pub record: usize,
    /// Sample of the first contact, in the record.
    pub at: usize,
    /// Largest force, N, with its sign.
    pub peak_n: f64,
    /// Duration of the contact, s.
    pub contact_s: f64,
    /// Reason for its exclusion; `None` if it is used.
    pub rejection: Option<HitRejection>,
}

/// Records from which no response function can be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TapError {
    /// No hit exceeds the noise of the force.
    #[error(
        "tap test: no hit found in record {record}: the force reaches {largest_n:.3} N over a noise of {noise_n:.3} N, expected \
         at least 20 times the noise; is this the force channel?"
    )]
    NoHit {
        /// Which record, from 1.
        record: usize,
        /// Largest force over its median, N.
        largest_n: f64,
        /// Its noise, N.
        noise_n: f64,
    },
    /// All hits were rejected.
    #[error("tap test: none of {found} hits can be used; the first is {first}. Repeat the test")]
    NoUsableHit {
        /// Number of hits found.
        found: usize,
        /// Reason for the rejection of the first one.
        first: HitRejection,
    },
    /// Force and response differ in length.
    #[error(
        "tap test: record {record} has {force} force and {response} response samples, expected equal numbers"
    )]
    Unequal {
        /// Which record, from 1.
        record: usize,
        /// Force samples.
        force: usize,
        /// Response samples.
        response: usize,
    },
    /// The response function itself.
    #[error(transparent)]
    Frf(#[from] FrfError),
}

/// The windows applied to each hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Windows {
    /// The force is set to zero outside its contact.
    pub force: bool,
    /// Decay of the exponential window, 1/s; 0 for none.
    pub decay_per_s: f64,
    /// Response remaining at the end of the block before windowing, relative to its strongest part.
    pub left_at_end: f64,
}

/// Result of an impact test.
#[derive(Clone, Debug, PartialEq)]
pub struct TapTest {
    /// The response function of all hits used.
    pub frf: Frf,
    /// Every hit found, in order.
    pub hits: Vec<DetectedHit>,
    /// Samples per second, Hz.
    pub rate_hz: f64,
    /// Length of each hit's record, s.
    pub block_s: f64,
    /// The windows.
    pub windows: Windows,
    /// Force (N) and response of each hit used, without offsets, windowed.
    pub blocks: Vec<(Vec<f64>, Vec<f64>)>,
    /// Force spectrum, rms over the hits, N/Hz: where the hammer excites.
    pub force_spectrum: Vec<f64>,
}

/// Detects, checks and averages the hits of all records.
///
/// # Errors
/// A record without a hit, no usable hit, force and response of unequal length, or an invalid rate.
pub fn evaluate_tap_test(
    records: &[TapRecord<'_>],
    config: &TapConfig,
) -> Result<TapTest, TapError> {
    let rate_hz = config.rate_hz;
    if !(rate_hz > 0.0 && rate_hz.is_finite()) {
        return Err(FrfError::Rate { rate_hz }.into());
    }
    let mut strikes: Vec<HitCandidate> = Vec::new();
    for (record, TapRecord { force, response }) in records.iter().enumerate() {
        if force.len() != response.len() {
            let (force, response) = (force.len(), response.len());
            return Err(TapError::Unequal { record: record + 1, force, response });
        }
        strikes.extend(hit_detection::find_candidates(record, force, rate_hz)?);
    }
    let length =
        hit_detection::block_length(&strikes, config.block_s.map(|s| (s * rate_hz) as usize));
    let clips: Vec<_> = records
        .iter()
        .map(|r| [clipping::clipped_extremes(r.force), clipping::clipped_extremes(r.response)])
        .collect();
    for strike in &mut strikes {
        let TapRecord { force, response } = records[strike.record];
        strike.check(length, force, response, &clips[strike.record], rate_hz);
    }
    let hits: Vec<DetectedHit> =
        strikes.iter().map(|strike| strike.to_detected_hit(rate_hz)).collect();
    let used: Vec<&HitCandidate> = strikes.iter().filter(|s| s.rejection.is_none()).collect();
    if let (true, Some(first)) = (used.is_empty(), hits.iter().find_map(|hit| hit.rejection)) {
        return Err(TapError::NoUsableHit { found: hits.len(), first });
    }
    let mut blocks: Vec<(Vec<f64>, Vec<f64>)> =
        used.iter().map(|strike| strike.extract_block(length, &records[strike.record])).collect();
    let windows = apply_windows(&mut blocks, &used, config);
    let pairs: Vec<Hit<'_>> =
        blocks.iter().map(|(force, response)| Hit { force, response }).collect();
    let frf =
        Frf { window_decay_per_s: windows.decay_per_s, ..frf(&pairs, rate_hz, config.response)? };
    let force_spectrum = force_spectrum(&pairs, rate_hz)?;
    Ok(TapTest {
        frf,
        hits,
        rate_hz,
        block_s: length as f64 / rate_hz,
        windows,
        blocks,
        force_spectrum,
    })
}

impl TapTest {
    /// Largest frequency up to which the force spectrum stays within `within_db` of its strongest,
    /// Hz.
    #[must_use]
    pub fn excited_to_hz(&self, within_db: f64) -> f64 {
        let strongest = self.force_spectrum.iter().fold(0.0_f64, |top, f| top.max(*f));
        let minimum = strongest * 10.0_f64.powf(-within_db / 20.0);
        let peak = self.force_spectrum.iter().position(|f| *f == strongest).unwrap_or(0);
        let beyond = self.force_spectrum[peak..].iter().position(|f| *f < minimum);
        let last = beyond.map_or(self.force_spectrum.len(), |n| peak + n).saturating_sub(1);
        self.frf.frequency_hz.get(last).copied().unwrap_or(0.0)
    }

    /// Least time from one used hit of a record to the next, s; `None` if each hit has a separate
    /// record.
    #[must_use]
    pub fn min_hit_interval_s(&self) -> Option<f64> {
        let follows =
            |pair: &&[DetectedHit]| pair[0].record == pair[1].record && pair[1].rejection.is_none();
        let apart = self.hits.windows(2).filter(follows).map(|pair| pair[1].at - pair[0].at);
        apart.min().map(|samples| samples as f64 / self.rate_hz)
    }

    /// The force spectrum at a frequency relative to its maximum, dB.
    #[must_use]
    pub fn force_db(&self, frequency_hz: f64) -> f64 {
        let strongest = self.force_spectrum.iter().fold(0.0_f64, |top, f| top.max(*f));
        let index = self.frf.frequency_hz.partition_point(|f| *f < frequency_hz);
        let force = self.force_spectrum.get(index).or(self.force_spectrum.last()).copied();
        20.0 * (force.unwrap_or(0.0) / strongest).log10()
    }
}

/// Applies equal windows to all blocks, and returns them.
fn apply_windows(
    blocks: &mut [(Vec<f64>, Vec<f64>)],
    used: &[&HitCandidate],
    config: &TapConfig,
) -> Windows {
    let (left_at_end, needs_window) = residual_vibration(blocks);
    if !config.windows {
        return Windows { force: false, decay_per_s: 0.0, left_at_end };
    }
    for ((force, _), strike) in blocks.iter_mut().zip(used) {
        force_window(force, strike.contact_in_block());
    }
    let length = blocks.first().map_or(1, |(force, _)| force.len());
    // A thousandth of the strongest response remains at the end.
    let decay_per_s = if needs_window {
        (left_at_end / WINDOW_END_VALUE).ln() * config.rate_hz / length as f64
    } else {
        0.0
    };
    if decay_per_s > 0.0 {
        for samples in blocks.iter_mut().flat_map(|(force, response)| [force, response]) {
            for (i, x) in samples.iter_mut().enumerate() {
                *x *= (-decay_per_s * i as f64 / config.rate_hz).exp();
            }
        }
    }
    Windows { force: true, decay_per_s, left_at_end }
}

/// Remaining response at the end under an exponential window, relative to the strongest.
const WINDOW_END_VALUE: f64 = 1e-3;
/// A response above this share of its strongest part at the end, and still decaying, needs an
/// exponential window.
const DECAYED_BELOW: f64 = 5e-3;
/// Above this share it does in any case.
const RINGING_ABOVE: f64 = 0.3;
/// Largest ratio of the last tenth of the block to the one before for a decaying response.
const DECAY_PER_TENTH: f64 = 0.93;

/// Response in the last tenth of the blocks relative to the strongest tenth (rms over all hits),
/// and whether an exponential window is needed.
fn residual_vibration(blocks: &[(Vec<f64>, Vec<f64>)]) -> (f64, bool) {
    let length = blocks.first().map_or(0, |(_, response)| response.len());
    let tenth = (length / 10).max(1);
    let rms = |range: Range<usize>| {
        let squares = blocks.iter().flat_map(|(_, response)| response.get(range.clone()));
        squares.flatten().map(|x| x * x).sum::<f64>().sqrt()
    };
    let strongest =
        (0..10).map(|k| rms(k * tenth..((k + 1) * tenth).min(length))).fold(0.0, f64::max);
    let last = rms(length - tenth.min(length)..length);
    let before = rms(length.saturating_sub(2 * tenth)..length - tenth.min(length));
    let part = if strongest > 0.0 { last / strongest } else { 0.0 };
    (part, part > RINGING_ABOVE || (part > DECAYED_BELOW && last < DECAY_PER_TENTH * before))
}

/// Sets the force to zero outside its contact, with half a cosine over half the contact's duration to either side.
fn force_window(force: &mut [f64], contact: Range<usize>) {
    let soft = (contact.len() / 2).max(2);
    for (i, x) in force.iter_mut().enumerate() {
        let away = contact.start.saturating_sub(i).max((i + 1).saturating_sub(contact.end));
        if away >= soft {
            *x = 0.0;
        } else if away > 0 {
            *x *= 0.5 + 0.5 * (std::f64::consts::PI * away as f64 / soft as f64).cos();
        }
    }
}

/// Force over frequency, rms over the hits, N/Hz.
fn force_spectrum(hits: &[Hit<'_>], rate_hz: f64) -> Result<Vec<f64>, FrfError> {
    let mut unit = vec![0.0; hits.first().map_or(0, |hit| hit.force.len())];
    if let Some(first) = unit.first_mut() {
        *first = 1.0;
    }
    // The response function for a unit impulse as the force is the transform itself.
    let mut power: Vec<f64> = Vec::new();
    for hit in hits {
        let impulse = Hit { force: &unit, response: hit.force };
        let spectrum = frf(&[impulse], rate_hz, Response::Displacement)?.h1;
        power.resize(spectrum.len(), 0.0);
        power.iter_mut().zip(&spectrum).for_each(|(sum, x)| *sum += x.norm_sqr());
    }
    let n = hits.len().max(1) as f64;
    Ok(power.iter().map(|sum| (sum / n).sqrt() / rate_hz).collect())
}
