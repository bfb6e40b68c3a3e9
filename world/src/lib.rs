//! The robot, the instrument and the cutter, run forward: deterministic by seed.

pub mod cutter;
pub mod draw;
pub mod extras;
pub mod ik;
pub mod joint_path;
pub mod path;
pub mod profile;
pub mod random;
pub mod ringing;
pub mod robot;
pub mod slots;
#[cfg(test)]
mod test_arm;
