//! The robot, the instrument and the cutter, run forward: deterministic by seed.

pub mod ik;
pub mod path;
pub mod profile;
pub mod random;
pub mod slots;
#[cfg(test)]
mod test_arm;
