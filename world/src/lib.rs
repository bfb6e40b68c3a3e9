//! The robot, the instrument and the cutter, run forward: deterministic by seed.
