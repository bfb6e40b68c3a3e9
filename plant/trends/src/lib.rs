//! Evaluates all results of a fleet: which effect grows on which robot, how fast, since when, and when it reaches the tolerance.
//!
//! Read in this order: [`results`] (Parquet files as one table, and the queries on it), [`series`] (one effect of one robot over its recordings, with what was not
//! found), [`likelihood`] (a mean over time fitted to values and bounds), [`change`] (constant, step or growth), [`fleet`] (the answer over all series), then
//! [`text`] and [`page`] (how it is presented). Promises: the same results give the same bytes; a recording in which an effect was not found counts as a bound only
//! where nothing else was named in its place. Never: a diagnosis of its own, a network, a clock in an answer.

pub mod change;
pub mod error;
pub mod fleet;
pub mod likelihood;
pub mod page;
pub mod results;
pub mod series;
pub mod settings;
pub mod text;
pub mod time;

pub use error::TrendsError;
pub use fleet::{Alert, Answer, evaluate};
pub use results::{Results, is_result_name, read};
pub use settings::Settings;
