//! What crosses the border: structs by their size, numbers, texts. All of this crate's looks through a foreign pointer.
//!
//! Promise: null, a wrong size, a crooked address, a text without end are errors; nothing is read or written beyond what
//! the program said is there. What it says of its own memory is believed: nothing else is possible.

use core::ffi::c_char;
use core::mem::MaybeUninit;
use core::time::Duration;

use crate::code::Fault;

/// Longest wait that may be asked for, ns: an hour.
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
/// `at` is null or points to four readable bytes.
unsafe fn claimed<T: Grows>(at: *const T) -> Result<usize, Fault> {
    if at.is_null() {
        return Err(Fault::Null(T::NAME));
    }
    // SAFETY: not null, so four bytes are readable there; whatever their address.
    let size = unsafe { at.cast::<u32>().read_unaligned() } as usize;
    if (T::SIZE_MIN..=STRUCT_BYTES_MAX).contains(&size) {
        return Ok(size);
    }
    let (what, min, max) = (T::NAME, T::SIZE_MIN, size_of::<T>());
    Err(Fault::StructSize { what, size, min, max })
}

/// A struct that the program gives. What an older program does not have is zero.
///
/// # Safety
/// `at` is null or points to as many readable bytes as its first field says.
pub(crate) unsafe fn given<T: Grows>(at: *const T) -> Result<T, Fault> {
    // SAFETY: the caller's promise.
    let size = unsafe { claimed(at) }?;
    let (known, from) = (size_of::<T>(), at.cast::<u8>());
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
    at: *mut T,
    size: usize,
}

/// Checks where an answer shall go, before anything is done for it.
///
/// # Safety
/// `at` is null or points to as many writable bytes as its first field says, until the place is gone.
pub(crate) unsafe fn place<T: Grows>(at: *mut T) -> Result<Place<T>, Fault> {
    // SAFETY: the caller's promise.
    let size = unsafe { claimed(at) }?;
    Ok(Place { at, size })
}

/// The same where NULL means that nobody wants to know.
///
/// # Safety
/// As [`place`].
pub(crate) unsafe fn place_if_any<T: Grows>(at: *mut T) -> Result<Option<Place<T>>, Fault> {
    if at.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { place(at) }.map(Some)
}

impl<T: Grows> Place<T> {
    /// Fills it in; `struct_size` stays as it is, and what this library does not know becomes zero.
    pub(crate) fn put(self, value: &T) {
        let (first, known) = (size_of::<u32>(), size_of::<T>());
        let (to, from) = (self.at.cast::<u8>(), (&raw const *value).cast::<u8>());
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
/// `at` is null or writable.
pub(crate) unsafe fn put_if_any<T>(at: *mut T, value: T) {
    if !at.is_null() {
        // SAFETY: the caller's promise; whatever its address.
        unsafe { at.write_unaligned(value) };
    }
}

/// Numbers of the program.
///
/// # Safety
/// `at` is null or points to `count` readable numbers that do not change until the slice is gone.
pub(crate) unsafe fn numbers<'a, T>(
    what: &'static str,
    at: *const T,
    count: usize,
) -> Result<&'a [T], Fault> {
    if at.is_null() {
        return Err(Fault::Null(what));
    }
    if !at.is_aligned() {
        return Err(Fault::Malformed { what, expected: "at an address that its numbers may have" });
    }
    // SAFETY: not null, aligned, and as long as the caller promises; callers bound `count`.
    Ok(unsafe { core::slice::from_raw_parts(at, count) })
}

/// A text of the program, UTF-8.
///
/// # Safety
/// `at` is null or points to a text that ends with zero and does not change until the slice is gone.
pub(crate) unsafe fn text<'a>(what: &'static str, at: *const c_char) -> Result<&'a str, Fault> {
    if at.is_null() {
        return Err(Fault::Null(what));
    }
    // SAFETY: each byte up to the first zero is readable, and none is read beyond.
    let length = (0..TEXT_BYTES_MAX).find(|i| unsafe { at.add(*i).read() } == 0);
    let length = length.ok_or(Fault::Malformed { what, expected: "ended within 4096 bytes" })?;
    // SAFETY: so many bytes were just read there.
    let bytes = unsafe { core::slice::from_raw_parts(at.cast::<u8>(), length) };
    core::str::from_utf8(bytes).map_err(|_| Fault::Malformed { what, expected: "UTF-8" })
}

/// A time limit, which every wait has.
pub(crate) fn limit(ns: u64) -> Result<Duration, Fault> {
    if ns > TRUED_LIMIT_NS_MAX {
        let expected = "at most TRUED_LIMIT_NS_MAX, an hour";
        return Err(Fault::Argument { what: "the time limit in ns", value: ns, expected });
    }
    Ok(Duration::from_nanos(ns))
}
