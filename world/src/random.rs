//! Random numbers by seed: one stream per purpose.
//!
//! The same seed gives the same bits; an additional draw for one purpose, or an additional purpose,
//! changes no other stream. The system's randomness and clock are not used.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

/// Purpose of a stream. The discriminants are part of every seed's meaning: add, never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// The true robot's parameters; the index identifies effect and value.
    Parameters = 1,
    /// Which effects the calibrated model lacks, and how large they are.
    HiddenEffects = 2,
    /// The ambient temperature.
    Climate = 3,
    /// Noise of the force sensor.
    ForceNoise = 4,
    /// Noise of the tracker.
    Tracker = 5,
    /// Noise of recorded torques.
    Torque = 6,
    /// Noise of recorded forces.
    Force = 7,
    /// A milling cut on a flexible tool, and its noise.
    Regeneration = 8,
}

/// The stream of `seed` for `purpose`; `index` distinguishes streams of one purpose.
pub fn stream(seed: u64, purpose: Purpose, index: u32) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((u64::from(purpose as u32) << 32) | u64::from(index));
    rng
}

/// Standard normal numbers from a stream.
pub fn normals(seed: u64, purpose: Purpose, index: u32) -> impl FnMut() -> f64 {
    let mut rng = stream(seed, purpose, index);
    move || rng.sample(StandardNormal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn streams_are_repeatable_and_apart() {
        let first = |seed, purpose, index| stream(seed, purpose, index).next_u64();
        let reference = first(7, Purpose::Parameters, 0);
        assert_eq!(reference, first(7, Purpose::Parameters, 0));
        assert_ne!(reference, first(8, Purpose::Parameters, 0));
        assert_ne!(reference, first(7, Purpose::Parameters, 1));
        assert_ne!(reference, first(7, Purpose::HiddenEffects, 0));
    }
}
