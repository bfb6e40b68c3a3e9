//! The structs of the C interface.
//!
//! Promise: each begins with its size, has no padding, and only grows at its end while the library is `.so.1`; a test pins
//! every offset. Only the first `joints` entries of a joint array are used; the rest is zero.

mod given;
mod told;

pub use given::*;
pub use told::*;

/// Most joints of one robot.
pub const TRUED_JOINTS_MAX: usize = 16;
/// Most points of one horizon.
pub const TRUED_HORIZON_POINTS_MAX: usize = 128;
const _: () = assert!(TRUED_HORIZON_POINTS_MAX == ::trued_client::HORIZON_POINTS_MAX);
/// Ambient and one per joint.
pub const TRUED_TEMPERATURES_MAX: usize = 17;
/// Size of a message in a struct, including the terminating zero.
pub const TRUED_WORDS_MAX: usize = 520;
/// Size of a name of the robot, including the terminating zero.
pub const TRUED_NAME_MAX: usize = 72;
/// Buckets of the latency histogram in a status.
pub const TRUED_LATENCY_BUCKETS: usize = 17;

/// Which struct, of what size when it was first released, of which types in turn: checked to have no padding.
macro_rules! grows {
    ($($name:ident $size:literal = $($type:ty),*;)*) => { $(
        const _: () = assert!(size_of::<$name>() == 0 $(+ size_of::<$type>())*, "no padding");
        const _: () = assert!(size_of::<$name>() >= $size, "a struct only grows");
        const _: () = assert!(core::mem::offset_of!($name, struct_size) == 0);
        // SAFETY: repr(C), numbers, and pointers that are only pointers; size and first field are asserted above.
        unsafe impl $crate::border::Grows for $name {
            const NAME: &'static str = stringify!($name);
            const SIZE_MIN: usize = $size;
        }
    )* };
}
use grows;

/// The robot's loop: commands out, corrected targets in. One per cell.
pub struct trued_client {
    _opaque: (),
}

/// Monitors a cell and sends requests to its daemon; any number of processes can do so.
pub struct trued_monitor {
    _opaque: (),
}

/// Sends force blocks: one source per cell.
pub struct trued_force {
    _opaque: (),
}

/// Sends measured points of the tool: one instrument per cell.
pub struct trued_instrument {
    _opaque: (),
}
