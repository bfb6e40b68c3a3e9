//! Nothing under the cycle allocates, apart from the transport's one block per published message,
//! or calls the kernel.
//!
//! A separate program, because its allocator counts by thread. Chosen: `allocation-counter`, since
//! it contains the allocator (no `unsafe` of ours) and counts by thread, so that the daemon's other
//! threads are excluded; `assert_no_alloc` aborts at the first allocation and so cannot show
//! "exactly one", `stats_alloc` counts all threads together.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on fails"
)]
#![expect(clippy::print_stdout, reason = "what was measured is said")]

mod bridge;
mod cycle;
mod kernel;
mod kinds;
mod million;
mod watch;

use allocation_counter::{AllocationInfo, measure};

/// Allocations and deallocations by `work`, in this thread.
fn heap_of(work: impl FnOnce()) -> AllocationInfo {
    measure(work)
}

#[test]
fn the_counter_counts() {
    let one = heap_of(|| drop(std::hint::black_box(Box::new(1_u64))));
    assert_eq!((one.count_total, one.count_current), (1, 0));
    let kept = heap_of(|| std::mem::forget(std::hint::black_box(Box::new(1_u64))));
    assert_eq!((kept.count_total, kept.count_current), (1, 1));
}
