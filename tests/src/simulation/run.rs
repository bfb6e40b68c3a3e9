//! The record of a simulated run: its ticks, and the violated invariant.

/// A run.
#[derive(Debug)]
pub struct Run<T> {
    /// Every tick.
    pub ticks: Vec<T>,
    /// The violation, as text.
    pub broken: Option<String>,
}

impl<T> Default for Run<T> {
    fn default() -> Self {
        Self { ticks: Vec::new(), broken: None }
    }
}
