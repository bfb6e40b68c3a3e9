//! Number of threads of a diagnosis. Results do not depend on it.

use std::num::NonZeroUsize;

/// The limit was set after threads had been started.
#[derive(Debug, thiserror::Error)]
#[error(
    "the number of threads cannot be set to {0}: threads of this process are already running, or the system provides none"
)]
pub struct ThreadLimitError(NonZeroUsize);

/// Limits the number of threads that all diagnoses of this process share. To be called once, before the first diagnosis; default: as many as the
/// machine offers.
///
/// # Errors
/// [`ThreadLimitError`] if a diagnosis has begun, or the system provides no thread.
pub fn limit_threads(threads: NonZeroUsize) -> Result<(), ThreadLimitError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.get());
    pool.build_global().map_err(|_| ThreadLimitError(threads))
}
