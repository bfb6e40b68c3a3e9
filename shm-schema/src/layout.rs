//! Requirements for a payload struct: fixed layout, no padding, a hash that identifies the layout.
//!
//! Invariant: two programs whose hashes agree read the same number at the same byte. The hash is
//! computed at compile time from names, offsets and types of all fields, so it cannot be forgotten.
//! Payloads contain plain numbers only.

use core::fmt;

/// One message of a service: plain numbers, `repr(C)`, without padding.
pub trait Payload:
    Copy + fmt::Debug + iceoryx2::prelude::ZeroCopySend + Send + Sync + 'static
{
    /// Name of the type on the wire, with its layout version.
    const NAME: &'static str;
    /// Layout version; it is written into each message as `layout`.
    const LAYOUT: u32;
    /// FNV-1a over the names, offsets and types of all fields.
    const LAYOUT_HASH: u64;

    /// The message with these bytes, as written by another process; any bytes of the right number are accepted. [`check`](Self::check) decides
    /// whether it is valid. `None` if the number of bytes is wrong.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;

    /// Checks whether the message is readable: its layout version and its counts.
    ///
    /// Messages of other processes are not trusted. Physical ranges are not checked here.
    ///
    /// # Errors
    /// [`Malformed`] names the first invalid field.
    fn check(&self) -> Result<(), Malformed>;
}

/// A message with an invalid layout version, count or code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{payload}: field `{field}` is {value}, expected {expected}; \
     the sender is broken or was built against another layout"
)]
pub struct Malformed {
    /// Wire name of the payload.
    pub payload: &'static str,
    /// The invalid field.
    pub field: &'static str,
    /// Its value.
    pub value: u64,
    /// The permitted values.
    pub expected: &'static str,
}

/// A type of a payload's field.
pub(crate) trait Field: Copy {
    /// All bytes zero.
    const ZERO: Self;
    /// Identity of the type for the layout hash.
    const TYPE_HASH: u64;
    /// Reads a value from the first bytes and advances behind them; `None` if there are too few.
    fn take(bytes: &mut &[u8]) -> Option<Self>;
}

const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// FNV-1a of a text.
pub(crate) const fn hash_text(text: &str) -> u64 {
    mix_bytes(FNV_OFFSET, text.as_bytes())
}

/// Continues a hash with a number (little endian).
pub(crate) const fn mix(hash: u64, number: u64) -> u64 {
    mix_bytes(hash, &number.to_le_bytes())
}

const fn mix_bytes(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(FNV_PRIME);
        i += 1;
    }
    hash
}

macro_rules! plain_fields {
    ($($t:ident = $zero:expr),*) => { $(
        impl Field for $t {
            const ZERO: Self = $zero;
            const TYPE_HASH: u64 = hash_text(stringify!($t));
            fn take(bytes: &mut &[u8]) -> Option<Self> {
                let (first, rest) = bytes.split_first_chunk()?;
                *bytes = rest;
                Some(Self::from_ne_bytes(*first))
            }
        }
    )* };
}
plain_fields!(u8 = 0, i8 = 0, u32 = 0, u64 = 0, f64 = 0.0);

impl<T: Field, const N: usize> Field for [T; N] {
    const ZERO: Self = [T::ZERO; N];
    const TYPE_HASH: u64 = mix(T::TYPE_HASH, N as u64);
    fn take(bytes: &mut &[u8]) -> Option<Self> {
        let mut all = Self::ZERO;
        for one in &mut all {
            *one = T::take(bytes)?;
        }
        Some(all)
    }
}

/// Declares a payload or a part of one: struct, hash, zero value, and the proof that no byte is padding.
macro_rules! plain_struct {
    ($(#[$meta:meta])* pub struct $name:ident = $wire:tt {
        $($(#[$field_meta:meta])* pub $field:ident: $type:ty,)*
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
        #[type_name($wire)]
        #[repr(C)]
        pub struct $name { $($(#[$field_meta])* pub $field: $type,)* }

        impl $crate::layout::Field for $name {
            const ZERO: Self = Self { $($field: <$type as $crate::layout::Field>::ZERO,)* };
            const TYPE_HASH: u64 = {
                let hash = $crate::layout::hash_text($wire);
                $(
                    let hash = $crate::layout::mix(hash, $crate::layout::hash_text(stringify!($field)));
                    let hash = $crate::layout::mix(hash, core::mem::offset_of!($name, $field) as u64);
                    let hash = $crate::layout::mix(hash, <$type as $crate::layout::Field>::TYPE_HASH);
                )*
                hash
            };
            // Without padding, the fields are adjacent in memory.
            fn take(bytes: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: <$type as $crate::layout::Field>::take(bytes)?,)* })
            }
        }

        const _: () = assert!(
            core::mem::size_of::<$name>() == 0 $(+ core::mem::size_of::<$type>())*,
            "a payload has no padding: order its fields by size"
        );
    };
}
pub(crate) use plain_struct;

/// Implements [`Payload`] for a [`plain_struct`] with a field `layout`; the closure checks everything except the layout version.
macro_rules! payload {
    ($name:ident = $wire:literal, layout $layout:literal, check $check:expr) => {
        impl $crate::layout::Payload for $name {
            const NAME: &'static str = $wire;
            const LAYOUT: u32 = $layout;
            const LAYOUT_HASH: u64 = <$name as $crate::layout::Field>::TYPE_HASH;

            fn from_bytes(mut bytes: &[u8]) -> Option<Self> {
                let message = <$name as $crate::layout::Field>::take(&mut bytes)?;
                bytes.is_empty().then_some(message)
            }

            fn check(&self) -> Result<(), $crate::layout::Malformed> {
                $crate::layout::check_range::<Self>(
                    "layout",
                    u64::from(self.layout),
                    $layout..=$layout,
                    concat!("layout version ", stringify!($layout)),
                )?;
                let check: fn(&$name) -> Result<(), $crate::layout::Malformed> = $check;
                check(self)
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self { layout: $layout, ..<Self as $crate::layout::Field>::ZERO }
            }
        }
    };
}
pub(crate) use payload;

/// Checks one count of a payload against its range.
pub(crate) fn check_range<P: Payload>(
    field: &'static str,
    value: u64,
    range: core::ops::RangeInclusive<u64>,
    expected: &'static str,
) -> Result<(), Malformed> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Malformed { payload: P::NAME, field, value, expected })
}
