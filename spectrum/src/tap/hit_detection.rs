//! Detection and check of hits.

use super::clipping::runs;
use super::{DetectedHit, HitRejection, TapError, TapRecord};
use crate::floor::median;
use std::ops::Range;

/// Least ratio of the largest force of a record to its noise.
const NOISE_FACTOR_MIN: f64 = 20.0;
/// Trigger level of a hit, relative to the largest force of the record.
const TRIGGER_PART: f64 = 0.1;
/// Least force of a second blow relative to the first.
const SECOND_HIT_PART: f64 = 0.05;
/// Least force of a blow, in standard deviations of the noise.
const NOISE_SIGMAS: f64 = 6.0;
/// Force at the begin and end of the contact, relative to the peak.
const CONTACT_PART: f64 = 0.01;
/// A blow within this time after another is a bounce of the hammer, s; later it is the next hit.
const BOUNCE_S: f64 = 0.1;
/// Least number of samples of the block before the contact.
const LEAD_SAMPLES_MIN: usize = 16;
/// Quiet samples before a hit for the offset: longest duration, s, and least number.
const OFFSET_WINDOW: (f64, usize) = (0.1, 50);
/// Length below which a hit is truncated, relative to the median length.
const TRUNCATED_BELOW: f64 = 0.5;

/// A detected hit before its block is extracted.
pub(super) struct HitCandidate {
    pub(super) record: usize,
    pub(super) rejection: Option<HitRejection>,
    contact: Range<usize>,
    peak: usize,
    peak_n: f64,
    sign: f64,
    offset_n: f64,
    noise_n: f64,
    /// First sample of its block.
    start: usize,
    /// Samples from there to the block of the next hit, or to the end of the record.
    available_samples: usize,
    offset_samples: usize,
}

/// The hits of one record, in order.
pub(super) fn find_candidates(
    record: usize,
    force: &[f64],
    rate_hz: f64,
) -> Result<Vec<HitCandidate>, TapError> {
    let mut finite: Vec<f64> = force.iter().copied().filter(|f| f.is_finite()).collect();
    let offset_n = median(&mut finite);
    let largest = |sign: f64| finite.iter().map(|f| sign * (f - offset_n)).fold(0.0, f64::max);
    let sign = if largest(-1.0) > largest(1.0) { -1.0 } else { 1.0 };
    let largest_n = largest(sign);
    let mut apart: Vec<f64> = finite.iter().map(|f| (f - offset_n).abs()).collect();
    let noise_n = 1.4826 * median(&mut apart);
    if largest_n <= NOISE_FACTOR_MIN * noise_n {
        return Err(TapError::NoHit { record: record + 1, largest_n, noise_n });
    }
    // NaN counts as no force.
    let blow = |i: usize| {
        let f = sign * (force[i] - offset_n);
        if f.is_finite() { f } else { 0.0 }
    };
    let trigger = (TRIGGER_PART * largest_n).max(NOISE_SIGMAS * noise_n);
    let bounce = (BOUNCE_S * rate_hz) as usize;
    let mut found: Vec<HitCandidate> = Vec::new();
    let mut i = 0;
    while i < force.len() {
        if blow(i) <= trigger {
            i += 1;
            continue;
        }
        // The peak of this blow: until the force has fallen to a tenth of it.
        let mut peak = i;
        while i < force.len() && blow(i) > (TRIGGER_PART * blow(peak)).max(NOISE_SIGMAS * noise_n) {
            peak = if blow(i) > blow(peak) { i } else { peak };
            i += 1;
        }
        if found.last().is_some_and(|last| i - last.contact.start < bounce.max(1)) {
            continue;
        }
        let threshold_n = (CONTACT_PART * blow(peak)).max(0.5 * NOISE_SIGMAS * noise_n);
        let mut first = peak;
        while first > 0 && blow(first - 1) > threshold_n {
            first -= 1;
        }
        let mut end = peak + 1;
        while end < force.len() && blow(end) > threshold_n {
            end += 1;
        }
        let before = (2 * (end - first)).max(LEAD_SAMPLES_MIN);
        found.push(HitCandidate {
            record,
            rejection: None,
            contact: first..end,
            peak,
            peak_n: blow(peak),
            sign,
            offset_n,
            noise_n,
            start: first.saturating_sub(before),
            available_samples: 0,
            offset_samples: (OFFSET_WINDOW.0 * rate_hz) as usize,
        });
    }
    let mut next = force.len();
    for strike in found.iter_mut().rev() {
        strike.available_samples = next - strike.start;
        next = strike.start;
    }
    Ok(found)
}

/// Samples per block: as requested, otherwise the shortest available length of the hits that are
/// not truncated.
pub(super) fn block_length(strikes: &[HitCandidate], requested: Option<usize>) -> usize {
    let mut rooms: Vec<f64> =
        strikes.iter().map(|strike| strike.available_samples as f64).collect();
    let samples_min = TRUNCATED_BELOW * median(&mut rooms);
    let common = strikes
        .iter()
        .map(|s| s.available_samples)
        .filter(|room| *room as f64 >= samples_min)
        .min();
    requested.or(common).unwrap_or(0).max(2)
}

impl HitCandidate {
    /// Checks whether it can be used in blocks of this length, and sets the reason for rejection.
    pub(super) fn check(
        &mut self,
        length: usize,
        force: &[f64],
        response: &[f64],
        clips: &[[Option<f64>; 2]; 2],
        rate_hz: f64,
    ) {
        let block = self.start..(self.start + length).min(force.len());
        let cut = |samples: &[f64], ends: &[Option<f64>; 2]| {
            let longest = |end: &f64| runs(&samples[block.clone()], *end).map(|run| run.1).max();
            ends.iter().flatten().filter_map(longest).max().filter(|length| *length > 1)
        };
        let hole = |samples: &[f64]| samples[block.clone()].iter().any(|x| !x.is_finite());
        self.rejection = if self.available_samples < length {
            let [has_s, needs_s] = [self.available_samples, length].map(|n| n as f64 / rate_hz);
            Some(HitRejection::Truncated { has_s, needs_s })
        } else if hole(force) || hole(response) {
            Some(HitRejection::MissingSamples)
        } else if let Some(equal) = cut(force, &clips[0]) {
            Some(HitRejection::ForceOverload(equal))
        } else if let Some(equal) = cut(response, &clips[1]) {
            Some(HitRejection::ResponseOverload(equal))
        } else {
            self.second_hit(&force[block.clone()]).map(|(i, blow)| HitRejection::DoubleHit {
                after_s: (i as f64 - (self.peak - self.start) as f64) / rate_hz,
                part: blow / self.peak_n,
            })
        };
    }

    /// A second rise of the force after or before the peak: index in the block and height of the
    /// rise.
    fn second_hit(&self, block: &[f64]) -> Option<(usize, f64)> {
        let blow = |i: usize| self.sign * (block[i] - self.offset_n);
        let rise_min = (SECOND_HIT_PART * self.peak_n).max(NOISE_SIGMAS * self.noise_n);
        let peak = self.peak - self.start;
        let rises = |places: &mut dyn Iterator<Item = usize>| {
            let (mut lowest, mut highest) = (self.peak_n, None::<(usize, f64)>);
            for i in places {
                lowest = lowest.min(blow(i).max(0.0));
                let rise = blow(i) - lowest;
                if rise > rise_min && highest.is_none_or(|(_, most)| rise > most) {
                    highest = Some((i, rise));
                }
            }
            highest
        };
        rises(&mut (peak + 1..block.len())).or_else(|| rises(&mut (0..peak).rev()))
    }

    /// Force and response of its block, with offsets removed.
    pub(super) fn extract_block(
        &self,
        length: usize,
        record: &TapRecord<'_>,
    ) -> (Vec<f64>, Vec<f64>) {
        let block = self.start..self.start + length;
        // Excludes the samples next to the contact, which non-causal filters affect.
        let quiet_end = self.contact.start.saturating_sub(self.contact.len());
        let quiet = &record.response[quiet_end.saturating_sub(self.offset_samples)..quiet_end];
        let enough = quiet.len() >= OFFSET_WINDOW.1 && quiet.iter().all(|x| x.is_finite());
        let offset = if enough { quiet.iter().sum::<f64>() / quiet.len() as f64 } else { 0.0 };
        (
            record.force[block.clone()].iter().map(|f| f - self.offset_n).collect(),
            record.response[block].iter().map(|x| x - offset).collect(),
        )
    }

    /// The contact, relative to the start of the block.
    pub(super) fn contact_in_block(&self) -> Range<usize> {
        self.contact.start - self.start..self.contact.end - self.start
    }

    pub(super) fn to_detected_hit(&self, rate_hz: f64) -> DetectedHit {
        DetectedHit {
            record: self.record,
            at: self.contact.start,
            peak_n: self.sign * self.peak_n,
            contact_s: self.contact.len() as f64 / rate_hz,
            rejection: self.rejection,
        }
    }
}
