//! Generator of malformed inputs from valid ones, reproducible by seed.
//!
//! An input has at most [`BYTES_MAX`] bytes. The formats are known only through the examples.

use crate::rng::TestRng;

/// Largest input generated.
pub const BYTES_MAX: usize = 64 * 1024;

/// Values that are difficult for parsers of numbers and texts.
const DIFFICULT_VALUES: &[&[u8]] = &[
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1e309",
    b"1e-320",
    b"-0.0",
    b"0",
    b"1",
    b"-1",
    b"18446744073709551616",
    b"-9223372036854775809",
    b"4294967295",
    b"0x7f",
    b"1_000",
    b"1,5",
    b"\"",
    b"'",
    b"[",
    b"]",
    b"[[",
    b"{",
    b"}",
    b"=",
    b"#",
    b",",
    b";",
    b"\t",
    b"\n",
    b"\r\n",
    b"\0",
    b"\x0c",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\xf0\x9f\xa6\xbe",
    b"<",
    b"/>",
    b"&#x0;",
    b"<!--",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\0\0\0\x80",
    b"\x7f\xf0\0\0\0\0\0\0",
    b"\xff\xff\xff\x7f",
];

/// Generates inputs from examples.
#[derive(Debug)]
pub struct Mutator<'e> {
    examples: &'e [Vec<u8>],
    chance: TestRng,
}

impl<'e> Mutator<'e> {
    /// For at least one example.
    #[must_use]
    pub fn new(examples: &'e [Vec<u8>], seed: u64) -> Self {
        Self { examples, chance: TestRng::new(seed) }
    }

    /// The next input.
    pub fn next_input(&mut self) -> Vec<u8> {
        let mut bytes = self.pick_example().to_vec();
        for _ in 0..=self.chance.below(6) {
            self.change(&mut bytes);
        }
        bytes.truncate(BYTES_MAX);
        bytes
    }

    fn pick_example(&mut self) -> &'e [u8] {
        let examples = self.examples;
        &examples[self.chance.below(examples.len() as u64) as usize]
    }

    /// A position in `length` bytes, including their end.
    fn random_position(&mut self, length: usize) -> usize {
        self.chance.below(length as u64 + 1) as usize
    }

    /// A random range of them; short ones are more frequent.
    fn random_range(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.random_position(length);
        let most = [4, 40, 400, length][self.chance.below(4) as usize];
        start..start + self.random_position(most.min(length - start))
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        let stretch = self.random_range(bytes.len());
        match self.chance.below(9) {
            0 => self.change_byte(bytes),
            1 => drop(bytes.drain(stretch)),
            2 => bytes.truncate(stretch.start),
            3 => {
                let value =
                    DIFFICULT_VALUES[self.chance.below(DIFFICULT_VALUES.len() as u64) as usize];
                drop(bytes.splice(stretch, value.iter().copied()));
            }
            4 => self.repeat(bytes, stretch),
            5 => {
                let other = self.pick_example();
                let from = self.random_range(other.len());
                drop(bytes.splice(stretch, other[from].iter().copied()));
            }
            6 => self.move_line(bytes),
            7 => self.replace_number(bytes),
            _ => bytes[stretch].reverse(),
        }
    }

    fn change_byte(&mut self, bytes: &mut [u8]) {
        let position = self.random_position(bytes.len());
        let bits = self.chance.next_u64();
        if let Some(byte) = bytes.get_mut(position) {
            *byte = if bits & 256 == 0 { bits as u8 } else { *byte ^ (1 << (bits & 7)) };
        }
    }

    /// Repeats the range several times: deep nesting, many rows.
    fn repeat(&mut self, bytes: &mut Vec<u8>, stretch: std::ops::Range<usize>) {
        let times = 1 << self.chance.below(10);
        let room = BYTES_MAX.saturating_sub(bytes.len()) / stretch.len().max(1);
        let more = bytes[stretch.clone()].repeat(times.min(room));
        drop(bytes.splice(stretch.start..stretch.start, more));
    }

    fn move_line(&mut self, bytes: &mut Vec<u8>) {
        let position = self.random_position(bytes.len());
        let start = bytes[..position].iter().rposition(|b| *b == b'\n').map_or(0, |p| p + 1);
        let end = bytes[position..]
            .iter()
            .position(|b| *b == b'\n')
            .map_or(bytes.len(), |p| position + p + 1);
        let line: Vec<u8> = bytes.drain(start..end).collect();
        let to = self.random_position(bytes.len());
        let to = bytes[..to].iter().rposition(|b| *b == b'\n').map_or(0, |p| p + 1);
        drop(bytes.splice(to..to, line));
    }

    /// Replaces a number in a text.
    fn replace_number(&mut self, bytes: &mut Vec<u8>) {
        let position = self.random_position(bytes.len());
        let digit = |b: &u8| b.is_ascii_digit() || b".-+eE".contains(b);
        let Some(start) =
            bytes[position..].iter().position(u8::is_ascii_digit).map(|p| position + p)
        else {
            return;
        };
        let length = bytes[start..].iter().position(|b| !digit(b)).unwrap_or(bytes.len() - start);
        let number = match self.chance.below(4) {
            0 => f64::from_bits(self.chance.next_u64()).to_string(),
            1 => (self.chance.next_u64() >> self.chance.below(64)).to_string(),
            2 => format!("{:e}", self.chance.uniform()),
            _ => (self.chance.below(40) as f64 - 20.0).to_string(),
        };
        drop(bytes.splice(start..start + length, number.into_bytes()));
    }
}
