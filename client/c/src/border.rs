//! Conversion of C arguments: structs by size, numbers, texts. All dereferencing of foreign pointers in this crate is here.
//!
//! Promise: null, a wrong size, a misaligned address and an unterminated text are errors; nothing is read or written beyond
//! the stated size. The program's statements about its own memory cannot be verified and are trusted.

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::time::Duration;
use std::path::Path;

use crate::code::Fault;

/// Longest time limit of a call, ns: one hour.
pub const TRUED_LIMIT_NS_MAX: u64 = 3_600_000_000_000;
/// No struct comes near this; a size beyond it is a struct that was not set up.
const STRUCT_BYTES_MAX: usize = 1 << 16;
/// Longest text taken.
const TEXT_BYTES_MAX: usize = 4096;

/// A struct that may grow at its end.
///
/// # Safety
/// `repr(C)`, numbers only, without padding, the first field `struct_size: u32`.
pub(crate) unsafe trait Grows: Copy {
    /// Its name.
    const NAME: &'static str;
    /// Its size when it was first released; smaller ones never were.
    const SIZE_MIN: usize;
}

/// Reads the size that stands first.
///
/// # Safety
/// `pointer` is null or points to four readable bytes.
unsafe fn claimed<T: Grows>(pointer: *const T) -> Result<usize, Fault> {
    if pointer.is_null() {
        return Err(Fault::Null(T::NAME));
    }
    // SAFETY: not null, so four bytes are readable there; whatever their address.
    let size = unsafe { pointer.cast::<u32>().read_unaligned() } as usize;
    if (T::SIZE_MIN..=STRUCT_BYTES_MAX).contains(&size) {
        return Ok(size);
    }
    let (what, min, max) = (T::NAME, T::SIZE_MIN, size_of::<T>());
    Err(Fault::StructSize { what, size, min, max })
}

/// A struct that the program gives. What an older program does not have is zero.
///
/// # Safety
/// `pointer` is null or points to as many readable bytes as its first field says.
pub(crate) unsafe fn given<T: Grows>(pointer: *const T) -> Result<T, Fault> {
    // SAFETY: the caller's promise.
    let size = unsafe { claimed(pointer) }?;
    let (known, from) = (size_of::<T>(), pointer.cast::<u8>());
    for byte in known..size {
        // SAFETY: within `size`, which the program says is there.
        if unsafe { from.add(byte).read() } != 0 {
            return Err(Fault::Newer { what: T::NAME, size, known });
        }
    }
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: both sides hold that many bytes, and `value` is our own.
    unsafe { from.copy_to_nonoverlapping(value.as_mut_ptr().cast(), size.min(known)) };
    // SAFETY: all bytes are written, and `Grows` promises that all bytes make a value.
    Ok(unsafe { value.assume_init() })
}

/// A struct of the program that is to be filled in.
pub(crate) struct Place<T> {
    pointer: *mut T,
    size: usize,
}

/// Checks where an answer shall go, before anything is done for it.
///
/// # Safety
/// `pointer` is null or points to as many writable bytes as its first field says, until the place is gone.
pub(crate) unsafe fn place<T: Grows>(pointer: *mut T) -> Result<Place<T>, Fault> {
    // SAFETY: the caller's promise.
    let size = unsafe { claimed(pointer) }?;
    Ok(Place { pointer, size })
}

/// The same where NULL means that nobody wants to know.
///
/// # Safety
/// As [`place`].
pub(crate) unsafe fn place_if_any<T: Grows>(pointer: *mut T) -> Result<Option<Place<T>>, Fault> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { place(pointer) }.map(Some)
}

impl<T: Grows> Place<T> {
    /// Fills it in; `struct_size` stays as it is, and what this library does not know becomes zero.
    pub(crate) fn put(self, value: &T) {
        let (first, known) = (size_of::<u32>(), size_of::<T>());
        let (to, from) = (self.pointer.cast::<u8>(), (&raw const *value).cast::<u8>());
        let end = self.size.min(known);
        // SAFETY: `place` was promised that `size` bytes are writable; `value` has `known` bytes; ours and theirs are apart.
        unsafe { to.add(first).copy_from_nonoverlapping(from.add(first), end - first) };
        // SAFETY: the same promise; from `end` to `size`.
        unsafe { to.add(end).write_bytes(0, self.size - end) };
    }
}

/// Writes one number, where somebody wants it.
///
/// # Safety
/// `pointer` is null or writable.
pub(crate) unsafe fn put_if_any<T>(pointer: *mut T, value: T) {
    if !pointer.is_null() {
        // SAFETY: the caller's promise; whatever its address.
        unsafe { pointer.write_unaligned(value) };
    }
}

/// Numbers of the program.
///
/// # Safety
/// `pointer` is null or points to `count` readable numbers that do not change until the slice is gone.
pub(crate) unsafe fn numbers<'a, T>(
    what: &'static str,
    pointer: *const T,
    count: usize,
) -> Result<&'a [T], Fault> {
    if pointer.is_null() {
        return Err(Fault::Null(what));
    }
    if !pointer.is_aligned() {
        return Err(Fault::Malformed { what, expected: "aligned for its type" });
    }
    // SAFETY: not null, aligned, and as long as the caller promises; callers bound `count`.
    Ok(unsafe { core::slice::from_raw_parts(pointer, count) })
}

/// A text of the program, UTF-8.
///
/// # Safety
/// `pointer` is null or points to a text that ends with zero and does not change until the slice is gone.
pub(crate) unsafe fn text<'a>(
    what: &'static str,
    pointer: *const c_char,
) -> Result<&'a str, Fault> {
    if pointer.is_null() {
        return Err(Fault::Null(what));
    }
    // SAFETY: each byte up to the first zero is readable, and none is read beyond.
    let length = (0..TEXT_BYTES_MAX).find(|i| unsafe { pointer.add(*i).read() } == 0);
    let length =
        length.ok_or(Fault::Malformed { what, expected: "terminated within 4096 bytes" })?;
    // SAFETY: so many bytes were just read there.
    let bytes = unsafe { core::slice::from_raw_parts(pointer.cast::<u8>(), length) };
    core::str::from_utf8(bytes).map_err(|_| Fault::Malformed { what, expected: "a UTF-8 string" })
}

/// A file's path; NULL names none.
///
/// # Safety
/// As [`text`].
pub(crate) unsafe fn path_given<'a>(pointer: *const c_char) -> Result<Option<&'a Path>, Fault> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { text("path", pointer) }.map(|text| Some(Path::new(text)))
}

/// A time limit, which every wait has.
pub(crate) fn limit(ns: u64) -> Result<Duration, Fault> {
    if ns > TRUED_LIMIT_NS_MAX {
        let expected = "at most TRUED_LIMIT_NS_MAX, an hour";
        return Err(Fault::Argument { what: "the time limit in ns", value: ns, expected });
    }
    Ok(Duration::from_nanos(ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trued_target;

    /// A target as another version of the program knows it: so many bytes, and what stands behind them.
    #[repr(C, align(8))]
    struct Foreign {
        bytes: [u8; 256],
    }

    fn foreign(size: u32, fill: u8) -> Foreign {
        let mut bytes = [fill; 256];
        bytes[..4].copy_from_slice(&size.to_ne_bytes());
        Foreign { bytes }
    }

    fn target() -> trued_target {
        trued_target {
            struct_size: 0,
            joints: 6,
            source: 1,
            reserved: 0,
            q: [0.5; 16],
            feed_override: 0.25,
        }
    }

    #[test]
    fn a_larger_struct_of_a_newer_program_is_filled_in_and_its_rest_is_zero() {
        let mut foreign = foreign(200, 0xff);
        // SAFETY: 256 bytes are there, 200 are claimed.
        let place = unsafe { place((&raw mut foreign).cast::<trued_target>()) };
        place.ok().unwrap().put(&target());
        assert_eq!(foreign.bytes[..4], 200_u32.to_ne_bytes());
        assert_eq!(foreign.bytes[4..8], 6_u32.to_ne_bytes());
        assert_eq!(foreign.bytes[152..200], [0; 48]);
        assert_eq!(foreign.bytes[200..], [0xff; 56], "nothing is written beyond the claim");
    }

    #[test]
    fn a_struct_given_by_a_newer_program_is_read_where_its_rest_says_nothing() {
        let mut newer = foreign(200, 0);
        newer.bytes[4] = 6;
        // SAFETY: 256 bytes are there, 200 are claimed.
        let read = unsafe { given((&raw const newer).cast::<trued_target>()) };
        assert_eq!(read.ok().unwrap().joints, 6);
        newer.bytes[199] = 1;
        // SAFETY: the same.
        let refused = unsafe { given((&raw const newer).cast::<trued_target>()) };
        assert!(matches!(refused, Err(Fault::Newer { size: 200, known: 152, .. })));
        newer.bytes[199] = 0;
        newer.bytes[200] = 1;
        // SAFETY: the same.
        assert!(unsafe { given((&raw const newer).cast::<trued_target>()) }.is_ok());
    }

    #[test]
    fn a_size_that_never_was_is_refused_and_nothing_is_touched() {
        for size in [0, 4, 143, u32::MAX] {
            let mut wrong = foreign(size, 7);
            // SAFETY: a size that is refused is all that is read.
            let place = unsafe { place((&raw mut wrong).cast::<trued_target>()) };
            assert!(matches!(place, Err(Fault::StructSize { .. })), "{size}");
            assert_eq!(wrong.bytes[4..], [7; 252]);
        }
    }

    #[test]
    fn an_address_that_no_number_may_have_is_refused() {
        let numbers_there = [0.0_f64; 4];
        let crooked = numbers_there.as_ptr().cast::<u8>().wrapping_add(1).cast::<f64>();
        // SAFETY: nothing is read there.
        let read = unsafe { numbers("q", crooked, 2) };
        assert!(matches!(read, Err(Fault::Malformed { .. })));
    }

    #[test]
    fn a_text_without_end_or_of_other_bytes_is_refused() {
        let endless = [b'a'; TEXT_BYTES_MAX + 1];
        // SAFETY: as many bytes are there as are looked at.
        assert!(unsafe { text("cell", endless.as_ptr().cast()) }.is_err());
        // SAFETY: a text that ends.
        assert!(unsafe { text("cell", c"\xff".as_ptr()) }.is_err());
        // SAFETY: a text that ends.
        assert_eq!(unsafe { text("cell", c"cell-1".as_ptr()) }.ok(), Some("cell-1"));
    }

    #[test]
    fn no_wait_is_without_end() {
        assert!(limit(u64::MAX).is_err());
        assert!(limit(TRUED_LIMIT_NS_MAX).is_ok());
    }
}
