//! Return codes and error messages: one code per call, one message per thread.
//!
//! Promise: a number keeps its meaning for as long as the library is `.so.1`; new ones are added. No panic crosses the
//! C interface, and every error has a message.

use core::fmt::{self, Write};
use std::any::Any;
use std::cell::RefCell;
use std::ffi::c_char;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use ::trued_client::{ConnectError, ErrorKind, InvalidTarget, RequestError, Response, SendError};

/// Return value of every function. Negative: an error, whose message is in trued_last_error().
///
/// cbindgen:rename-all=None
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum trued_code {
    /// Done.
    TRUED_OK = 0,
    /// No error: there is nothing new, or nothing yet.
    TRUED_NOTHING = 1,
    /// A pointer is NULL that may not be.
    TRUED_ERROR_NULL = -1,
    /// A struct_size is not that of any version of the struct.
    TRUED_ERROR_STRUCT_SIZE = -2,
    /// Invalid argument; the message says which.
    TRUED_ERROR_ARGUMENT = -3,
    /// The handle has been closed, or never was one.
    TRUED_ERROR_CLOSED = -4,
    /// Another thread is in a call with this handle.
    TRUED_ERROR_BUSY = -5,
    /// Too many handles are open.
    TRUED_ERROR_TOO_MANY = -6,
    /// Internal error of the library. Close the handle and reconnect.
    TRUED_ERROR_INTERNAL = -7,
    /// Connecting: no daemon announced itself in time.
    TRUED_ERROR_NO_DAEMON = -10,
    /// The daemon is gone; the library reconnects when it returns.
    TRUED_ERROR_DAEMON_LOST = -11,
    /// The library has connected to a new daemon. Reported once, and nothing was sent: call again.
    TRUED_ERROR_DAEMON_RESTARTED = -12,
    /// Daemon and library are of different versions.
    TRUED_ERROR_VERSION_MISMATCH = -13,
    /// The cell belongs to another user.
    TRUED_ERROR_WRONG_USER = -14,
    /// Another process has this role.
    TRUED_ERROR_ROLE_TAKEN = -15,
    /// Connected, but the daemon does not respond.
    TRUED_ERROR_DAEMON_SILENT = -16,
    /// No answer in time.
    TRUED_ERROR_TIMED_OUT = -17,
    /// The daemon does not read messages fast enough: this one is lost, and counted.
    TRUED_ERROR_MESSAGE_LOST = -18,
    /// Error of the shared memory.
    TRUED_ERROR_TRANSPORT = -19,
    /// Error of the operating system.
    TRUED_ERROR_SYSTEM = -20,
    /// The daemon refused the request; the message is the daemon's.
    TRUED_ERROR_REFUSED = -21,
    /// The daemon failed to execute the request; the message is the daemon's.
    TRUED_ERROR_FAILED = -22,
}

impl From<ErrorKind> for trued_code {
    fn from(kind: ErrorKind) -> Self {
        match kind {
            ErrorKind::Argument => Self::TRUED_ERROR_ARGUMENT,
            ErrorKind::NoDaemon => Self::TRUED_ERROR_NO_DAEMON,
            ErrorKind::DaemonLost => Self::TRUED_ERROR_DAEMON_LOST,
            ErrorKind::DaemonRestarted => Self::TRUED_ERROR_DAEMON_RESTARTED,
            ErrorKind::VersionMismatch => Self::TRUED_ERROR_VERSION_MISMATCH,
            ErrorKind::WrongUser => Self::TRUED_ERROR_WRONG_USER,
            ErrorKind::RoleTaken => Self::TRUED_ERROR_ROLE_TAKEN,
            ErrorKind::DaemonSilent => Self::TRUED_ERROR_DAEMON_SILENT,
            ErrorKind::TimedOut => Self::TRUED_ERROR_TIMED_OUT,
            ErrorKind::MessageLost => Self::TRUED_ERROR_MESSAGE_LOST,
            ErrorKind::Transport => Self::TRUED_ERROR_TRANSPORT,
            ErrorKind::System => Self::TRUED_ERROR_SYSTEM,
        }
    }
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    #[error("`{0}` is NULL; give a pointer")]
    Null(&'static str),
    #[error(
        "`{what}`: struct_size is {size}, expected {min} to {max}; set it to sizeof the struct before the call"
    )]
    StructSize { what: &'static str, size: usize, min: usize, max: usize },
    #[error(
        "`{what}`: struct_size is {size}, this library knows {known} bytes, and the bytes beyond them are not zero; \
         the program was built for a newer library; install that one"
    )]
    Newer { what: &'static str, size: usize, known: usize },
    #[error("{what} is {value}, expected {expected}")]
    Argument { what: &'static str, value: u64, expected: &'static str },
    #[error("`{what}` is not {expected}")]
    Malformed { what: &'static str, expected: &'static str },
    #[error("this handle is closed or invalid; connect again")]
    Closed,
    #[error("another thread is in a call with this handle; use a handle from one thread at a time")]
    Busy,
    #[error("{0} handles of this kind are open, the maximum; close some")]
    TooMany(usize),
    #[error(
        "an earlier call with this handle failed inside the library; close it and connect again"
    )]
    Broken,
    #[error("the library failed: {0}; please report this, close the handle and connect again")]
    Panic(String),
    #[error("no answer within {0:?}; publish the result of trued_client_target()")]
    TimedOut(Duration),
    #[error("the daemon rejected the request: {}", .0.message)]
    Refused(Box<Response>),
    #[error("the daemon failed: {}", .0.message)]
    Failed(Box<Response>),
    #[error(transparent)]
    Connect(#[from] ConnectError),
    #[error(transparent)]
    NotSent(#[from] SendError),
    #[error(transparent)]
    NotATarget(#[from] InvalidTarget),
    #[error(transparent)]
    Ask(#[from] RequestError),
}

impl Fault {
    fn code(&self) -> trued_code {
        match self {
            Self::Null(_) => trued_code::TRUED_ERROR_NULL,
            Self::StructSize { .. } | Self::Newer { .. } => trued_code::TRUED_ERROR_STRUCT_SIZE,
            Self::Argument { .. } | Self::Malformed { .. } => trued_code::TRUED_ERROR_ARGUMENT,
            Self::Closed => trued_code::TRUED_ERROR_CLOSED,
            Self::Busy => trued_code::TRUED_ERROR_BUSY,
            Self::TooMany(_) => trued_code::TRUED_ERROR_TOO_MANY,
            Self::Broken | Self::Panic(_) => trued_code::TRUED_ERROR_INTERNAL,
            Self::TimedOut(_) => trued_code::TRUED_ERROR_TIMED_OUT,
            Self::Refused(_) => trued_code::TRUED_ERROR_REFUSED,
            Self::Failed(_) => trued_code::TRUED_ERROR_FAILED,
            Self::Connect(e) => e.kind().into(),
            Self::NotSent(e) => e.kind().into(),
            Self::NotATarget(e) => e.kind().into(),
            Self::Ask(e) => e.kind().into(),
        }
    }
}

const WORDS_BYTES: usize = 1024;

/// A thread's last words. Of fixed size, so that a loop that fails each cycle does not allocate each cycle.
struct Words {
    bytes: [u8; WORDS_BYTES],
    end: usize,
}

impl Write for Words {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars().filter(|c| *c != '\0') {
            let end = self.end + character.len_utf8();
            // One byte stays zero: C's end of a text.
            let Some(place) = self.bytes[..WORDS_BYTES - 1].get_mut(self.end..end) else {
                return Ok(());
            };
            character.encode_utf8(place);
            self.end = end;
        }
        Ok(())
    }
}

thread_local! {
    static WORDS: RefCell<Words> = const { RefCell::new(Words { bytes: [0; WORDS_BYTES], end: 0 }) };
}

fn remember(fault: &Fault) {
    WORDS.with_borrow_mut(|message| {
        message.bytes.fill(0);
        message.end = 0;
        let _ = write!(message, "{fault}");
    });
}

/// Runs what stands behind the border: a fault becomes its code and its words, a panic too.
pub(crate) fn guard(run: impl FnOnce() -> Result<trued_code, Fault>) -> trued_code {
    // What a panic leaves half done stands in a handle, which is broken from then on.
    let done = catch_unwind(AssertUnwindSafe(run));
    match done.unwrap_or_else(|panic| Err(Fault::Panic(panic_text(panic.as_ref())))) {
        Ok(code) => code,
        Err(fault) => {
            remember(&fault);
            fault.code()
        }
    }
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default()
}

/// The message of this thread's last error, empty if there was none: never NULL, UTF-8. It stays valid until the next error of
/// this thread.
#[unsafe(no_mangle)]
pub extern "C" fn trued_last_error() -> *const c_char {
    WORDS.with_borrow(|message| message.bytes.as_ptr().cast())
}

/// The name of a code, such as "TRUED_OK"; "TRUED_UNKNOWN" for any other number. Never NULL; do not free.
#[unsafe(no_mangle)]
pub extern "C" fn trued_code_name(code: i32) -> *const c_char {
    let name = match code {
        0 => c"TRUED_OK",
        1 => c"TRUED_NOTHING",
        -1 => c"TRUED_ERROR_NULL",
        -2 => c"TRUED_ERROR_STRUCT_SIZE",
        -3 => c"TRUED_ERROR_ARGUMENT",
        -4 => c"TRUED_ERROR_CLOSED",
        -5 => c"TRUED_ERROR_BUSY",
        -6 => c"TRUED_ERROR_TOO_MANY",
        -7 => c"TRUED_ERROR_INTERNAL",
        -10 => c"TRUED_ERROR_NO_DAEMON",
        -11 => c"TRUED_ERROR_DAEMON_LOST",
        -12 => c"TRUED_ERROR_DAEMON_RESTARTED",
        -13 => c"TRUED_ERROR_VERSION_MISMATCH",
        -14 => c"TRUED_ERROR_WRONG_USER",
        -15 => c"TRUED_ERROR_ROLE_TAKEN",
        -16 => c"TRUED_ERROR_DAEMON_SILENT",
        -17 => c"TRUED_ERROR_TIMED_OUT",
        -18 => c"TRUED_ERROR_MESSAGE_LOST",
        -19 => c"TRUED_ERROR_TRANSPORT",
        -20 => c"TRUED_ERROR_SYSTEM",
        -21 => c"TRUED_ERROR_REFUSED",
        -22 => c"TRUED_ERROR_FAILED",
        _ => c"TRUED_UNKNOWN",
    };
    name.as_ptr()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    fn last_error() -> String {
        // SAFETY: the function's own promise: a text of this thread that ends with zero.
        unsafe { CStr::from_ptr(trued_last_error()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_becomes_a_code_with_words() {
        let code = guard(|| panic!("of its own accord"));
        assert_eq!(code, trued_code::TRUED_ERROR_INTERNAL);
        assert!(last_error().contains("of its own accord"), "{}", last_error());
    }

    #[test]
    fn words_that_are_too_long_end_with_a_whole_character() {
        for shift in ["", "a"] {
            let what = shift.to_owned() + &"ü".repeat(WORDS_BYTES);
            assert_eq!(guard(|| Err(Fault::Panic(what))), trued_code::TRUED_ERROR_INTERNAL);
            let length = last_error().len();
            assert!((WORDS_BYTES - 2..WORDS_BYTES).contains(&length), "{length} bytes of UTF-8");
        }
    }

    #[test]
    fn another_threads_error_leaves_this_ones_words() {
        assert_eq!(guard(|| Err(Fault::Closed)), trued_code::TRUED_ERROR_CLOSED);
        let other = std::thread::spawn(|| (guard(|| Err(Fault::Busy)), last_error()));
        assert!(other.join().unwrap().1.contains("another thread"));
        assert!(last_error().contains("is closed or invalid"));
    }
}
