//! What the number of a datagram says: the next one, one again, one too old, or a sender that began anew.
//!
//! Promises: no allocation, no clock. A sender that does not count (always the same number, or none) is taken as it comes.

use recording::files::content_hash;

/// So far back a number is an old datagram's, and further back a sender's that began anew.
const OLD_MAX: u32 = 16;
/// So far ahead numbers were lost on the way; further ahead a sender began anew.
const LOST_MAX: u32 = 1000;
/// Datagrams overtake each other within so long, ns; a sender that begins anew takes longer.
const OVERTAKE_NS: u64 = 50_000_000;

/// Where a datagram stands among those of its sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// The next; so many before it were lost.
    Next {
        /// Numbers left out.
        lost: u32,
    },
    /// The last one again, byte for byte.
    Repeated,
    /// Overtaken by one that was taken already.
    Old,
    /// The first of a sender, or of one that began anew.
    First,
}

/// The datagrams of one sender.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sequence {
    last: Option<Last>,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    number: Option<u32>,
    hash: u64,
    at_ns: u64,
}

impl Sequence {
    /// Judges a datagram that came at `now_ns`, and remembers it unless it is old.
    pub fn judge(&mut self, number: Option<u32>, datagram: &[u8], now_ns: u64) -> Standing {
        let hash = content_hash(datagram);
        let standing = match self.last {
            None => Standing::First,
            Some(last) if (last.number, last.hash) == (number, hash) => Standing::Repeated,
            Some(last) => match (last.number, number) {
                (Some(before), Some(number)) => {
                    let soon = now_ns.saturating_sub(last.at_ns) < OVERTAKE_NS;
                    by_number(before, number, soon)
                }
                _ => Standing::Next { lost: 0 },
            },
        };
        if standing != Standing::Old {
            self.last = Some(Last { number, hash, at_ns: now_ns });
        }
        standing
    }
}

fn by_number(before: u32, number: u32, soon: bool) -> Standing {
    let (ahead, back) = (number.wrapping_sub(before), before.wrapping_sub(number));
    if ahead == 0 {
        Standing::Next { lost: 0 }
    } else if ahead <= LOST_MAX {
        Standing::Next { lost: ahead - 1 }
    } else if back <= OLD_MAX && soon {
        Standing::Old
    } else {
        Standing::First
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn judged(numbers: &[(Option<u32>, u8, u64)]) -> Vec<Standing> {
        let mut sequence = Sequence::default();
        numbers.iter().map(|(n, byte, ms)| sequence.judge(*n, &[*byte], ms * MS)).collect()
    }

    #[test]
    fn lost_repeated_and_overtaken_datagrams_are_told_apart() {
        let said = judged(&[
            (Some(7), 1, 0),
            (Some(8), 2, 4),
            (Some(8), 2, 5),
            (Some(11), 3, 8),
            (Some(10), 4, 9),
        ]);
        let next = |lost| Standing::Next { lost };
        assert_eq!(said, [Standing::First, next(0), Standing::Repeated, next(2), Standing::Old]);
    }

    #[test]
    fn a_sender_that_begins_anew_is_taken_and_its_first_numbers_are_not_old() {
        let said = judged(&[
            (Some(9), 1, 0),
            (Some(0), 2, 100),
            (Some(90_000), 3, 104),
            (Some(2), 4, 108),
        ]);
        assert_eq!(said, [Standing::First; 4]);
    }

    #[test]
    fn a_sender_that_does_not_count_is_taken_as_it_comes() {
        let next = Standing::Next { lost: 0 };
        assert_eq!(judged(&[(Some(0), 1, 0), (Some(0), 2, 4)])[1], next);
        assert_eq!(judged(&[(None, 1, 0), (None, 2, 4)])[1], next);
    }

    #[test]
    fn numbers_may_run_over() {
        let said = judged(&[(Some(u32::MAX), 1, 0), (Some(0), 2, 4)]);
        assert_eq!(said[1], Standing::Next { lost: 0 });
    }
}
