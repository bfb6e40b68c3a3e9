//! Settings that decide when a change is reported, with unit, range, default and origin.

/// Settings of the search for changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Recordings in which an effect must be claimed before it is a series, at least. 4 to 1000; default 6. Origin: below it, the scatter between recordings cannot
    /// be distinguished from a change.
    pub least_found: usize,
    /// Recordings that must lie after a change. 2 to 100; default 3. Origin: fewer may be outliers.
    pub least_after: usize,
    /// Changed series that are expected in a whole fleet, before its results are seen. Above 0 to 10; default 0.1. Origin: measured, `cargo run --example
    /// false_alarms`.
    pub expected_changes: f64,
    /// Probability of a change from which on it is reported. 0.5 to 1; default 0.95. Origin: at most one of twenty reported changes is none, where the model of scatter
    /// holds.
    pub reported_probability: f64,
    /// Least value that a diagnosis finds, in standard uncertainties of the value. 1 to 20; default 5. Origin: claimed findings of `trued diagnose` have 4.3 and
    /// more (smallest of 200 recordings of the tests' fleet).
    pub detectable_sigmas: f64,
    /// Share of recordings in which a diagnosis misses an effect that is there, or gives it another name. Above 0 to 0.5; default 0.05. Origin: zero offsets of
    /// the tests' fleet far above the noise are not named in 4 to 10 % of recordings.
    pub missed_share: f64,
    /// Share of an effect's own recordings in which another effect may stand beside it and still count as named in its place elsewhere. 0 to 1; default 0.2.
    /// Origin: names that exclude each other were together in at most 8 % of the recordings of the tests' fleet.
    pub beside_share: f64,
    /// Range of ambient temperatures from which on the temperature is a covariate, K. Above 0; default 1. Origin: below it, its coefficient is a guess.
    pub temperature_range_k: f64,
    /// Tool error that is allowed, mm; none: no date is computed.
    pub tolerance_mm: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            least_found: 6,
            least_after: 3,
            expected_changes: 0.1,
            reported_probability: 0.95,
            detectable_sigmas: 5.0,
            missed_share: 0.05,
            beside_share: 0.2,
            temperature_range_k: 1.0,
            tolerance_mm: None,
        }
    }
}
