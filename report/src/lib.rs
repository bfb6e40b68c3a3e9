//! HTML pages, SVG plots and text tables in one style.
//!
//! The same input gives the same bytes; every text is escaped; drawings contain finite values only;
//! a page is one file without network access; long series are decimated to a bounded size. No
//! physics, no files, no clock.
//!
//! ```
//! use report::{Axis, Number, Page, Plot, Series};
//!
//! let error_mm = (0..500).map(|i| (f64::from(i) * 0.01, f64::from(i).sin().abs()));
//! let plot = Plot::new("Tool error over time", Axis::new("Time", "s"), Axis::new("Tool error", "mm"))
//!     .series(Series::line("with correction", error_mm))
//!     .render();
//! let html = Page::new("Correction run")
//!     .numbers([Number::new("Mean tool error", 0.12, "mm")])
//!     .figure("The tool's distance from the commanded path.", &plot)
//!     .render();
//! assert!(html.starts_with("<!DOCTYPE html>"));
//! ```

mod arm;
mod arm_poses;
mod axis;
mod bars;
mod canvas;
mod decimation;
mod escape;
mod frame;
mod heat;
mod histogram;
mod labelled;
mod legend;
mod multiples;
mod number;
mod page;
mod plot;
mod printable;
mod provenance;
mod role;
mod scale;
mod series;
mod shell;
mod table;
mod text_line;
mod text_table;

/// The comment in the head of every page and every separate plot.
pub const MADE_BY: &str = "<!-- made by trued -->";

pub use arm::{ArmPicture, Point, ToolError};
pub use arm_poses::ArmPoses;
pub use axis::Axis;
pub use bars::{Bar, Bars};
pub use canvas::Svg;
pub use heat::HeatMap;
pub use histogram::Histogram;
pub use labelled::labelled;
pub use multiples::Multiples;
pub use number::{
    beside, capitalised, duration, fixed, pluralise, probability, quantity, significant,
};
pub use page::{Number, Page, Tone};
pub use plot::Plot;
pub use printable::printable;
pub use provenance::{InputFile, Provenance};
pub use role::Role;
pub use series::Series;
pub use shell::shell_word;
pub use table::{Cell, Column, Table};
pub use text_line::TextLine;
pub use text_table::TextTable;
