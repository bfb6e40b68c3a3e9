//! Detection and check of hits.

use super::clip::runs;
use super::{FoundHit, Refused, TapError, TapRecord};
use crate::floor::middle;
use std::ops::Range;

/// A record contains a hit if its force exceeds its noise by this factor.
const OVER_NOISE: f64 = 20.0;
/// A hit exceeds this part of the record's strongest.
const TRIGGER: f64 = 0.1;
/// A second blow is one from this part of the first on.
const SECOND_BLOW: f64 = 0.05;
/// So many standard deviations of noise are no blow, and no contact.
const NOISE: f64 = 6.0;
/// Contact begins and ends at this part of the peak.
const CONTACT: f64 = 0.01;
/// A blow so soon after another is the hammer's bounce, s; later it is the next hit.
const BOUNCE_S: f64 = 0.1;
/// Samples before the contact that belong to the block, at least.
const BEFORE_LEAST: usize = 16;
/// Quiet samples before a hit for the offsets: at most this long, s, and at least this many.
const QUIET: (f64, usize) = (0.1, 50);
/// A hit with less than this share of the common length is truncated.
const SHORT: f64 = 0.5;

/// A hit in the making.
pub(super) struct Strike {
    pub(super) record: usize,
    pub(super) refused: Option<Refused>,
    contact: Range<usize>,
    peak: usize,
    peak_n: f64,
    sign: f64,
    offset_n: f64,
    noise_n: f64,
    /// First sample of its block.
    start: usize,
    /// Samples from there to the next hit's block, or the record's end.
    room: usize,
    quiet: usize,
}

/// The hits of one record, in order.
pub(super) fn strikes(record: usize, force: &[f64], rate_hz: f64) -> Result<Vec<Strike>, TapError> {
    let mut finite: Vec<f64> = force.iter().copied().filter(|f| f.is_finite()).collect();
    let offset_n = middle(&mut finite);
    let largest = |sign: f64| finite.iter().map(|f| sign * (f - offset_n)).fold(0.0, f64::max);
    let sign = if largest(-1.0) > largest(1.0) { -1.0 } else { 1.0 };
    let largest_n = largest(sign);
    let mut apart: Vec<f64> = finite.iter().map(|f| (f - offset_n).abs()).collect();
    let noise_n = 1.4826 * middle(&mut apart);
    if largest_n <= OVER_NOISE * noise_n {
        return Err(TapError::NoHit { record: record + 1, largest_n, noise_n });
    }
    // NaN is not a blow.
    let blow = |i: usize| {
        let f = sign * (force[i] - offset_n);
        if f.is_finite() { f } else { 0.0 }
    };
    let trigger = (TRIGGER * largest_n).max(NOISE * noise_n);
    let bounce = (BOUNCE_S * rate_hz) as usize;
    let mut found: Vec<Strike> = Vec::new();
    let mut i = 0;
    while i < force.len() {
        if blow(i) <= trigger {
            i += 1;
            continue;
        }
        // The blow's own peak: until the force has fallen to a tenth of it.
        let mut peak = i;
        while i < force.len() && blow(i) > (TRIGGER * blow(peak)).max(NOISE * noise_n) {
            peak = if blow(i) > blow(peak) { i } else { peak };
            i += 1;
        }
        if found.last().is_some_and(|last| i - last.contact.start < bounce.max(1)) {
            continue;
        }
        let least = (CONTACT * blow(peak)).max(0.5 * NOISE * noise_n);
        let mut first = peak;
        while first > 0 && blow(first - 1) > least {
            first -= 1;
        }
        let mut end = peak + 1;
        while end < force.len() && blow(end) > least {
            end += 1;
        }
        let before = (2 * (end - first)).max(BEFORE_LEAST);
        found.push(Strike {
            record,
            refused: None,
            contact: first..end,
            peak,
            peak_n: blow(peak),
            sign,
            offset_n,
            noise_n,
            start: first.saturating_sub(before),
            room: 0,
            quiet: (QUIET.0 * rate_hz) as usize,
        });
    }
    let mut next = force.len();
    for strike in found.iter_mut().rev() {
        strike.room = next - strike.start;
        next = strike.start;
    }
    Ok(found)
}

/// Samples per block: as requested, otherwise the common length of the hits, except truncated ones.
pub(super) fn block_length(strikes: &[Strike], asked: Option<usize>) -> usize {
    let mut rooms: Vec<f64> = strikes.iter().map(|strike| strike.room as f64).collect();
    let least = SHORT * middle(&mut rooms);
    let common = strikes.iter().map(|s| s.room).filter(|room| *room as f64 >= least).min();
    asked.or(common).unwrap_or(0).max(2)
}

impl Strike {
    /// Says whether it may be used in blocks of this length.
    pub(super) fn judge(
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
        self.refused = if self.room < length {
            let [has_s, needs_s] = [self.room, length].map(|n| n as f64 / rate_hz);
            Some(Refused::Short { has_s, needs_s })
        } else if hole(force) || hole(response) {
            Some(Refused::Hole)
        } else if let Some(equal) = cut(force, &clips[0]) {
            Some(Refused::ForceOverload(equal))
        } else if let Some(equal) = cut(response, &clips[1]) {
            Some(Refused::ResponseOverload(equal))
        } else {
            self.second_blow(&force[block.clone()]).map(|(i, blow)| Refused::Double {
                after_s: (i as f64 - (self.peak - self.start) as f64) / rate_hz,
                part: blow / self.peak_n,
            })
        };
    }

    /// Where the force rises again after it has fallen, or rose before: place in the block and height of the rise.
    fn second_blow(&self, block: &[f64]) -> Option<(usize, f64)> {
        let blow = |i: usize| self.sign * (block[i] - self.offset_n);
        let least = (SECOND_BLOW * self.peak_n).max(NOISE * self.noise_n);
        let peak = self.peak - self.start;
        let rises = |places: &mut dyn Iterator<Item = usize>| {
            let (mut lowest, mut highest) = (self.peak_n, None::<(usize, f64)>);
            for i in places {
                lowest = lowest.min(blow(i).max(0.0));
                let rise = blow(i) - lowest;
                if rise > least && highest.is_none_or(|(_, most)| rise > most) {
                    highest = Some((i, rise));
                }
            }
            highest
        };
        rises(&mut (peak + 1..block.len())).or_else(|| rises(&mut (0..peak).rev()))
    }

    /// Force and response of its block, without offsets.
    pub(super) fn cut(&self, length: usize, record: &TapRecord<'_>) -> (Vec<f64>, Vec<f64>) {
        let block = self.start..self.start + length;
        // Not the samples next to the contact, where filters already respond to it.
        let quiet_end = self.contact.start.saturating_sub(self.contact.len());
        let quiet = &record.response[quiet_end.saturating_sub(self.quiet)..quiet_end];
        let enough = quiet.len() >= QUIET.1 && quiet.iter().all(|x| x.is_finite());
        let offset = if enough { quiet.iter().sum::<f64>() / quiet.len() as f64 } else { 0.0 };
        (
            record.force[block.clone()].iter().map(|f| f - self.offset_n).collect(),
            record.response[block].iter().map(|x| x - offset).collect(),
        )
    }

    /// The contact, counted from its block's start.
    pub(super) fn contact_in_block(&self) -> Range<usize> {
        self.contact.start - self.start..self.contact.end - self.start
    }

    pub(super) fn told(&self, rate_hz: f64) -> FoundHit {
        FoundHit {
            record: self.record,
            at: self.contact.start,
            peak_n: self.sign * self.peak_n,
            contact_s: self.contact.len() as f64 / rate_hz,
            refused: self.refused,
        }
    }
}
