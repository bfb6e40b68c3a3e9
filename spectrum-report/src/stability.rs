//! Stability of a cut: whether it chatters, its distance from the limit, and the nearest stable cuts, as JSON (`trued.stability/1`), text and HTML page.
//!
//! [`read`] takes the file of a cut (`trued.cut/1`) with the results of the tap tests that it names; a mode that cannot be used is an error, never omitted.
//! [`analyse`] computes the limit over spindle speed by the zeroth order and by semi-discretisation, and over the direction of feed. Linear theory: whether
//! a vibration grows, not how large it becomes. Modules in the order in which to read them: `input`, `analysis`, `result`, `text`, `page`.
//!
//! ```no_run
//! use std::fs;
//!
//! use spectrum_report::stability::{analyse, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let analysis = analyse(read("cut.toml")?)?;
//! if let (false, Some(limit)) = (analysis.is_stable, analysis.limit) {
//!     println!("chatters at more than {:.2} mm", 1e3 * limit.depth_m);
//! }
//! if let Some(spindle_rpm) = analysis.nearest.spindle_rpm {
//!     println!("stable at {spindle_rpm:.0} rpm");
//! }
//! println!("{}", analysis.text());
//! fs::write("stability.json", analysis.json()?)?;
//! fs::write("stability.html", analysis.page().render())?;
//! # Ok(())
//! # }
//! ```

mod analysis;
mod input;
mod page;
mod result;
mod text;

pub use analysis::{Analysis, Nearest, analyse};
pub use input::{Cut, SourcedMode, read};
pub use result::Report;
pub use text::nearest_stable;
