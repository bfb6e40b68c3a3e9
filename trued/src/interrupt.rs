//! Ctrl-C and SIGTERM as a flag that long commands check, so that they end cleanly.
//!
//! The first signal only sets the flag; a second Ctrl-C ends the program at once with 130, in case
//! a command hangs. The daemon and the bridges always end in order ([`flag_of_service`]): a second Ctrl-C,
//! as two quick ones of a person, would leave a recording unclosed. `signal-hook` was chosen because it sets an atomic from the handler itself;
//! `ctrlc` starts a thread for it, which is undesirable in a program with real-time threads.
//!
//! iceoryx2 would install handlers of its own: create its nodes with `SignalHandlingMode::Disabled`.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;

use crate::exit::Failure;

/// The exit code after an interruption.
pub const EXIT_CODE: u8 = 130;

/// The flag that a signal sets. The first call installs the handlers: without it a signal ends the
/// program as usual.
///
/// # Errors
///
/// [`Failure::System`] if the system rejects a handler.
pub fn flag() -> Result<Arc<AtomicBool>, Failure> {
    flag_with(install)
}

/// The same for a program that must end in order: no number of signals ends it at once, except those
/// that no program can handle.
///
/// # Errors
///
/// As [`flag()`].
pub fn flag_of_service() -> Result<Arc<AtomicBool>, Failure> {
    flag_with(install_flag)
}

fn flag_with(
    install: fn(&Arc<AtomicBool>) -> std::io::Result<()>,
) -> Result<Arc<AtomicBool>, Failure> {
    static FLAG: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    if let Some(flag) = FLAG.get() {
        return Ok(Arc::clone(flag));
    }
    let flag = FLAG.get_or_init(Arc::default);
    install(flag).map_err(Failure::system)?;
    Ok(Arc::clone(flag))
}

/// Lets a write beyond the limit of the file size fail, as on a full disk, instead of ending the program: then temporary files are removed and the
/// reason is reported.
///
/// # Errors
///
/// [`Failure::System`] if the system rejects the handler.
pub fn continue_at_file_size_limit() -> Result<(), Failure> {
    flag::register(SIGXFSZ, Arc::default()).map_err(Failure::system)?;
    Ok(())
}

/// For `?` inside a loop: an error once the flag is set.
///
/// # Errors
///
/// [`Failure::Interrupted`] once the flag is set.
pub fn check(flag: &AtomicBool) -> Result<(), Failure> {
    if flag.load(Ordering::Relaxed) { Err(Failure::Interrupted) } else { Ok(()) }
}

fn install(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    // The order matters: the first handler checks whether an earlier signal has set the flag.
    flag::register_conditional_shutdown(SIGINT, i32::from(EXIT_CODE), Arc::clone(stop))?;
    install_flag(stop)
}

fn install_flag(stop: &Arc<AtomicBool>) -> std::io::Result<()> {
    flag::register(SIGINT, Arc::clone(stop))?;
    flag::register(SIGTERM, Arc::clone(stop))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_sets_the_flag_and_the_program_continues() {
        let flag = flag().expect("handlers");
        assert!(check(&flag).is_ok());
        signal_hook::low_level::raise(SIGTERM).expect("raised");
        assert!(matches!(check(&flag), Err(Failure::Interrupted)));
    }
}
