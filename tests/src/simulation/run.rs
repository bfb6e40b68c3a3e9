//! The record of a simulated run: its ticks, and the invariant that broke.

/// A run.
#[derive(Debug)]
pub struct Run<T> {
    /// Every tick.
    pub ticks: Vec<T>,
    /// What broke, in words.
    pub broken: Option<String>,
}

impl<T> Default for Run<T> {
    fn default() -> Self {
        Self { ticks: Vec::new(), broken: None }
    }
}
