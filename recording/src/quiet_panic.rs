//! Catches a panic of a library without its text on standard error.
//!
//! The library for Parquet panics on some damaged files. The panic is caught and reported as a fault of the file; the text of the panic hook before it
//! would name a source file that no user has. Panics of other threads, and of this one at other times, are printed as ever.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether this thread runs code whose panics are caught here.
    static CATCHES: Cell<bool> = const { Cell::new(false) };
}

/// The value of `run`; `None` if it panicked. What it changed must not be used then.
pub fn caught<T>(run: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let printing = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CATCHES.get() {
                printing(info);
            }
        }));
    });
    let before = CATCHES.replace(true);
    let outcome = panic::catch_unwind(AssertUnwindSafe(run));
    CATCHES.set(before);
    outcome.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_caught_and_the_next_one_elsewhere_is_not_silenced() {
        assert_eq!(caught(|| 7), Some(7));
        assert_eq!(caught(|| -> u8 { panic!("of a library") }), None);
        assert!(!CATCHES.get());
    }
}
