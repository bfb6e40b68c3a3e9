//! The samples of a piece: in memory, or read from the file in parts, so that long recordings fit into memory.

use std::ops::Range;

use recording::waves::Stored;

use crate::error::Error;

/// Samples of one time that are handed over at once.
const FRAMES: usize = 1 << 14;

/// How missing samples are replaced.
#[derive(Clone, Copy, Debug)]
pub(super) enum GapHandling {
    /// NaN.
    Missing,
    /// A straight line across them.
    Bridged,
}

/// Each channel's samples.
#[derive(Debug)]
pub(super) enum Samples {
    /// In memory.
    Held {
        /// NaN for missing samples.
        taken: Vec<Vec<f64>>,
        /// The same with linear interpolation over missing samples, if there are any.
        bridged: Vec<Option<Vec<f64>>>,
    },
    /// In the file; none is missing.
    Stored(Box<Stored>),
}

impl Samples {
    pub(super) fn held(taken: Vec<Vec<f64>>) -> Self {
        let bridged = taken.iter().map(|samples| interpolate_gaps(samples)).collect();
        Self::Held { taken, bridged }
    }

    /// Number of samples of each channel.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Held { taken, .. } => taken.first().map_or(0, Vec::len),
            Self::Stored(stored) => stored.len(),
        }
    }

    /// Number of missing samples of a channel.
    pub(super) fn missing(&self, channel: usize) -> usize {
        match self {
            Self::Held { taken, .. } => taken
                .get(channel)
                .map_or(0, |samples| samples.iter().filter(|x| x.is_nan()).count()),
            Self::Stored(_) => 0,
        }
    }

    /// Passes the samples of some channels to `each`, part by part, interleaved by time.
    pub(super) fn parts(
        &self,
        gaps: GapHandling,
        channels: &[usize],
        range: Range<usize>,
        each: impl FnMut(&[f64]),
    ) -> Result<(), Error> {
        match self {
            Self::Held { taken, bridged } => {
                let channel = |index: &usize| match gaps {
                    GapHandling::Missing => taken[*index].as_slice(),
                    GapHandling::Bridged => bridged[*index].as_deref().unwrap_or(&taken[*index]),
                };
                let chosen: Vec<&[f64]> = channels.iter().map(channel).collect();
                interleave(&chosen, range, each);
                Ok(())
            }
            Self::Stored(stored) => Ok(stored.parts(channels, range, each)?),
        }
    }
}

fn interleave(channels: &[&[f64]], range: Range<usize>, mut each: impl FnMut(&[f64])) {
    if let [channel] = channels {
        channel[range].chunks(FRAMES).for_each(each);
        return;
    }
    let mut part = Vec::new();
    for from in range.clone().step_by(FRAMES) {
        part.clear();
        let to = (from + FRAMES).min(range.end);
        part.extend(
            (from..to).flat_map(|frame| channels.iter().map(move |channel| channel[frame])),
        );
        each(&part);
    }
}

/// Linear interpolation over missing samples; `None` if there are none.
fn interpolate_gaps(samples: &[f64]) -> Option<Vec<f64>> {
    samples.iter().any(|x| x.is_nan()).then(|| {
        let mut even = samples.to_vec();
        let mut last: Option<usize> = None;
        for index in 0..samples.len() {
            if samples[index].is_nan() {
                continue;
            }
            let from = last.map_or(samples[index], |last| samples[last]);
            let begin = last.map_or(0, |last| last + 1);
            let steps = (index + 1 - begin) as f64;
            for (step, value) in (1..).zip(&mut even[begin..index]) {
                *value = from + (samples[index] - from) * f64::from(step) / steps;
            }
            last = Some(index);
        }
        let end = last.map_or(0.0, |last| samples[last]);
        even[last.map_or(0, |last| last + 1)..].fill(end);
        even
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_bridged_by_straight_lines_and_ends_are_held() {
        let nan = f64::NAN;
        assert_eq!(interpolate_gaps(&[1.0, 2.0]), None);
        let even = interpolate_gaps(&[nan, 1.0, nan, nan, 4.0, nan]);
        assert_eq!(even, Some(vec![1.0, 1.0, 2.0, 3.0, 4.0, 4.0]));
        assert_eq!(interpolate_gaps(&[nan, nan]), Some(vec![0.0, 0.0]));
    }
}
