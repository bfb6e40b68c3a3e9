//! Text of bounded length inside a payload: UTF-8, the rest filled with zeros.
//!
//! Never allocates, never fails: a text that is too long is cut at a character boundary; invalid UTF-8 is read up to the first error.

use iceoryx2::prelude::ZeroCopySend;

use crate::layout::{Field, hash_text, mix};

/// At most `N` bytes of UTF-8, terminated by the first zero byte or the end of the array.
#[derive(Clone, Copy, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct Text<const N: usize> {
    bytes: [u8; N],
}

impl<const N: usize> Text<N> {
    /// The text, cut at the last whole character that fits.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(N);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self { bytes }
    }

    /// The text; `None` if it does not fit completely or contains a zero byte.
    #[must_use]
    pub fn whole(text: &str) -> Option<Self> {
        (text.len() <= N && !text.contains('\0')).then(|| Self::new(text))
    }

    /// The text, up to the first invalid byte.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let end = self.bytes.iter().position(|b| *b == 0).unwrap_or(N);
        let bytes = &self.bytes[..end];
        match core::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(e) => core::str::from_utf8(&bytes[..e.valid_up_to()]).unwrap_or(""),
        }
    }

    /// Whether there is no text.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.as_str().is_empty()
    }
}

impl<const N: usize> Field for Text<N> {
    const ZERO: Self = Self { bytes: [0; N] };
    const TYPE_HASH: u64 = mix(hash_text("text"), N as u64);
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        Some(Self { bytes: Field::take(bytes)? })
    }
}

impl<const N: usize> core::fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        core::fmt::Debug::fmt(self.as_str(), f)
    }
}

impl<const N: usize> core::fmt::Display for Text<N> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_at_a_whole_character() {
        assert_eq!(Text::<4>::new("aä€").as_str(), "aä");
        assert_eq!(Text::<4>::new("abcd").as_str(), "abcd");
        assert!(Text::<4>::whole("abcde").is_none());
    }

    #[test]
    fn bytes_that_are_no_text_read_as_far_as_they_are() {
        let text = Text::<4> { bytes: [b'a', 0xff, b'b', 0] };
        assert_eq!(text.as_str(), "a");
    }
}
