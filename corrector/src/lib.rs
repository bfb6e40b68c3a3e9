//! One cycle without I/O: predict, solve, bound, judge health.
