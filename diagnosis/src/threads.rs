//! Number of threads of a diagnosis. Results do not depend on it.

use std::num::NonZeroUsize;

/// A bound that came too late.
#[derive(Debug, thiserror::Error)]
#[error(
    "the number of threads cannot be set to {0}: threads of this process are already running, or the system provides none"
)]
pub struct NotBounded(NonZeroUsize);

/// Lets all diagnoses of this process share so many threads. To be called once, before the first; as many as the machine offers otherwise.
///
/// # Errors
/// [`NotBounded`] where a diagnosis has begun, or the system gives no thread.
pub fn bound_threads(threads: NonZeroUsize) -> Result<(), NotBounded> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.get());
    pool.build_global().map_err(|_| NotBounded(threads))
}
