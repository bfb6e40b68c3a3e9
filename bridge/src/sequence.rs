//! Evaluation of sequence numbers: next, repeated, old, or restarted sender.
//!
//! A number slightly ahead is the next one, with some lost in between. One far ahead, or lower, can belong to an old datagram,
//! reordered or replayed, or to another run: it is accepted once several datagrams in a row (five by default) count up from there without any of the old sequence
//! in between. Higher numbers then mean many lost datagrams; lower ones mean a restarted sender. All datagrams of a sender without sequence
//! numbers (always the same number, or none) are accepted. No allocation, no clock.

use recording::files::content_hash;

use crate::settings::SequenceRules;

/// Position of a datagram in its sender's sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SequencePosition {
    /// The next, after a number of lost ones.
    Next {
        /// Number of lost datagrams.
        lost: u32,
    },
    /// The last one, byte for byte.
    Repeated,
    /// Older than one that was already accepted.
    Old,
    /// The first of a sender, or of one that restarted.
    First,
}

/// The sequence of one sender.
#[derive(Debug, Clone, Copy)]
pub struct Sequence {
    rules: SequenceRules,
    last: Option<LastDatagram>,
    /// A second sequence: its newest number, and how many datagrams it has had.
    other_count: Option<(u32, u32)>,
}

#[derive(Debug, Clone, Copy)]
struct LastDatagram {
    number: Option<u32>,
    hash: u64,
}

impl Sequence {
    /// For a sender that counts its datagrams, starting again in each of its runs.
    #[must_use]
    pub const fn counting(rules: SequenceRules) -> Self {
        Self { rules, last: None, other_count: None }
    }

    /// For a sender whose number is a clock that continues from run to run: any number ahead is
    /// accepted, however many were lost.
    #[must_use]
    pub const fn clock(rules: SequenceRules) -> Self {
        Self::counting(SequenceRules { lost_max: u32::MAX / 2, ..rules })
    }

    /// Classifies a datagram, and stores it unless it is old.
    pub fn classify(&mut self, number: Option<u32>, datagram: &[u8]) -> SequencePosition {
        let hash = content_hash(datagram);
        let standing = match self.last {
            None => SequencePosition::First,
            Some(last) if (last.number, last.hash) == (number, hash) => SequencePosition::Repeated,
            Some(last) => match (last.number, number) {
                (Some(before), Some(number)) => self.classify_number(before, number),
                _ => SequencePosition::Next { lost: 0 },
            },
        };
        if standing != SequencePosition::Old {
            (self.last, self.other_count) = (Some(LastDatagram { number, hash }), None);
        }
        standing
    }

    fn classify_number(&mut self, before: u32, number: u32) -> SequencePosition {
        let ahead = number.wrapping_sub(before);
        if ahead == 0 {
            return SequencePosition::Next { lost: 0 };
        } else if ahead <= self.rules.lost_max {
            return SequencePosition::Next { lost: ahead - 1 };
        }
        let counted = match self.other_count {
            Some((newest, counted))
                if (1..=self.rules.ahead_max).contains(&number.wrapping_sub(newest)) =>
            {
                counted + 1
            }
            _ => 1,
        };
        self.other_count = Some((number, counted));
        match counted {
            _ if counted < self.rules.accepted_after => SequencePosition::Old,
            _ if ahead <= u32::MAX / 2 => SequencePosition::Next { lost: ahead - 1 },
            _ => SequencePosition::First,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(numbers: &[(Option<u32>, u8)]) -> Vec<SequencePosition> {
        let mut sequence = Sequence::counting(SequenceRules::default());
        numbers.iter().map(|(number, byte)| sequence.classify(*number, &[*byte])).collect()
    }

    const fn next(lost: u32) -> SequencePosition {
        SequencePosition::Next { lost }
    }

    #[test]
    fn lost_repeated_and_overtaken_datagrams_are_distinguished() {
        let positions = judged(&[
            (Some(7), 1),
            (Some(8), 2),
            (Some(8), 2),
            (Some(11), 3),
            (Some(10), 4),
            (Some(511), 5),
        ]);
        let expected = [
            SequencePosition::First,
            next(0),
            SequencePosition::Repeated,
            next(2),
            SequencePosition::Old,
            next(499),
        ];
        assert_eq!(positions, expected);
    }

    #[test]
    fn replayed_datagrams_are_old_however_far_back_and_however_often() {
        let mut sequence = Sequence::counting(SequenceRules::default());
        for number in 1000..1100 {
            sequence.classify(Some(number), &[0]);
            // Numbers far ahead belong to another run.
            for offset in [-1, -20, -40, -900, 5000, 1 << 20] {
                let old = number.wrapping_add_signed(offset);
                assert_eq!(sequence.classify(Some(old), &[1]), SequencePosition::Old);
            }
        }
    }

    #[test]
    fn a_sender_that_restarts_is_taken_once_five_datagrams_count_up() {
        let positions =
            judged(&[900, 0, 4, 8, 12, 16, 20].map(|number| (Some(number), number as u8)));
        let (first, old) = (SequencePosition::First, SequencePosition::Old);
        assert_eq!(positions, [first, old, old, old, old, first, next(3)]);
        // One of the previous count in between: that sender is still active.
        let positions =
            judged(&[900, 0, 1, 2, 3, 901, 4].map(|number| (Some(number), number as u8)));
        assert_eq!(positions, [first, old, old, old, old, next(0), old]);
    }

    #[test]
    fn a_sender_of_which_very_many_were_lost_is_the_same_once_five_datagrams_count_up() {
        let numbers = [7, 5007, 5008, 5009, 5010, 5011];
        let positions = judged(&numbers.map(|number| (Some(number), number as u8)));
        assert_eq!(positions[4..], [SequencePosition::Old, next(5003)]);
    }

    #[test]
    fn a_sender_that_does_not_count_is_taken_as_it_comes() {
        assert_eq!(judged(&[(Some(0), 1), (Some(0), 2)])[1], next(0));
        assert_eq!(judged(&[(None, 1), (None, 2)])[1], next(0));
    }

    #[test]
    fn numbers_may_run_over() {
        assert_eq!(judged(&[(Some(u32::MAX), 1), (Some(0), 2)])[1], next(0));
    }
}
