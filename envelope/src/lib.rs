//! How a correction may change in time: angle, rate and jerk, the same rule on both sides of the shared memory.
