//! Enumerations transmitted as `u32`: values of another process are checked before conversion to an enum.
//!
//! Invariants: a code never changes its number; new codes are appended. An unknown number is
//! an error that names the list, never undefined behaviour.

/// A code that this version does not know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{list}: unknown code {code}, expected 0 to {last}; use the same version on both sides")]
pub struct UnknownCode {
    /// Name of the enumeration.
    pub list: &'static str,
    /// The number received.
    pub code: u32,
    /// The largest number known.
    pub last: u32,
}

macro_rules! codes {
    ($(#[$meta:meta])* pub enum $name:ident {
        $($(#[$variant_meta:meta])* $variant:ident = $code:literal $text:literal,)*
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $($(#[$variant_meta])* $variant = $code,)* }

        impl $name {
            /// All codes in the order of their numbers.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// The transmitted number.
            #[must_use]
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The name used in recordings, reports and JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl TryFrom<u32> for $name {
            type Error = $crate::codes::UnknownCode;
            fn try_from(code: u32) -> Result<Self, Self::Error> {
                match code {
                    $($code => Ok(Self::$variant),)*
                    _ => Err($crate::codes::UnknownCode {
                        list: stringify!($name),
                        code,
                        last: Self::ALL.len() as u32 - 1,
                    }),
                }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}
pub(crate) use codes;
