//! Selection of the recordings of a shard: shard I of N takes every N-th recording, by position in the manifest.
//!
//! Selection by position, so that a process reads only its own files. Neighbours (often of one robot and similar in size) go to different shards.

use std::num::NonZeroUsize;
use std::str::FromStr;

/// One of N shards; written `I/N`, I from 1 to N.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    index: usize,
    count: NonZeroUsize,
}

impl Shard {
    /// The whole manifest as one shard.
    pub const WHOLE: Self = Self { index: 0, count: NonZeroUsize::MIN };

    /// Whether the recording at this position in the manifest, from 0, belongs to this shard.
    #[must_use]
    pub fn has(self, place: usize) -> bool {
        place % self.count == self.index
    }
}

/// A text that is not a shard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected I/N with I from 1 to N, such as 1/8")]
pub struct ParseShardError;

impl FromStr for Shard {
    type Err = ParseShardError;

    fn from_str(text: &str) -> Result<Self, ParseShardError> {
        let (index, count) = text.split_once('/').ok_or(ParseShardError)?;
        let whole = |part: &str| part.parse::<NonZeroUsize>().map_err(|_| ParseShardError);
        let (index, count) = (whole(index)?, whole(count)?);
        if index > count {
            return Err(ParseShardError);
        }
        Ok(Self { index: index.get() - 1, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_recording_is_of_exactly_one_shard() {
        for count in 1..=9 {
            let shards: Vec<Shard> = (1..=count)
                .map(|index| format!("{index}/{count}").parse().expect("a shard"))
                .collect();
            for place in 0..100 {
                assert_eq!(shards.iter().filter(|shard| shard.has(place)).count(), 1);
            }
        }
        assert!((0..100).all(|place| Shard::WHOLE.has(place)));
    }

    #[test]
    fn what_names_no_shard_is_refused() {
        for text in ["", "1", "0/8", "9/8", "1/0", "-1/2", "1/2/3", "a/b"] {
            assert_eq!(text.parse::<Shard>(), Err(ParseShardError), "{text}");
        }
    }
}
