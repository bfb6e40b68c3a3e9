//! Live view of a cell: its status as JSON, metrics for Prometheus, a page for a browser, a stream for Foxglove and PlotJuggler.
//!
//! A separate process that connects to the cell as a [`trued_client::Monitor`], like `trued status`: the daemon opens no socket, and is not affected
//! if this process hangs or dies. Nothing received over the network reaches the daemon. [`top`] shows the same on a terminal, with keys for
//! requests to the daemon.
//!
//! | served | by | at |
//! | --- | --- | --- |
//! | `/` | `page.html` | the page |
//! | `/status` | [`report`] | the status as JSON, schema `trued.status/1` |
//! | `/events` | `web` | the same with each change, what is drawn of the robot, and the last five minutes (`history`), as server-sent events |
//! | `/report` | `snapshot` | the present state as a page to save |
//! | `/metrics` | [`metrics_text`] | OpenMetrics text |
//! | WebSocket | `foxglove` | topics and schemas of the recordings, protocol `foxglove.sdk.v1` |

#[cfg(feature = "views")]
mod access;
#[cfg(feature = "views")]
mod cell_watch;
#[cfg(feature = "views")]
mod changes;
#[cfg(feature = "views")]
mod foxglove;
#[cfg(feature = "views")]
mod history;
#[cfg(feature = "views")]
mod http;
#[cfg(feature = "views")]
mod metrics;
pub mod report;
#[cfg(feature = "views")]
mod robot;
#[cfg(feature = "views")]
mod serve;
#[cfg(feature = "views")]
mod snapshot;
#[cfg(feature = "views")]
pub mod top;
#[cfg(feature = "views")]
mod web;

#[cfg(feature = "views")]
pub use access::Access;
#[cfg(feature = "views")]
pub use metrics::metrics_text;
#[cfg(feature = "views")]
pub use serve::{Live, LiveError, Settings};
