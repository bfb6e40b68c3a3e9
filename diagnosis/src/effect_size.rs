//! Size of an effect: change of the values of a recording by this effect alone.

/// Over scalar values: lengths in m, angles in rad, torques in N m, forces in N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EffectSize {
    /// Root mean square.
    pub rms: f64,
    /// Largest absolute value.
    pub largest: f64,
}

impl EffectSize {
    /// Size over these values; zero if there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut sum, mut count, mut largest) = (0.0, 0_usize, 0.0_f64);
        for value in values {
            sum += value * value;
            count += 1;
            largest = largest.max(value.abs());
        }
        Self { rms: (sum / count.max(1) as f64).sqrt(), largest }
    }
}

#[cfg(test)]
mod tests {
    use super::EffectSize;

    #[test]
    fn a_size_is_the_root_mean_square_and_the_largest_without_sign() {
        let size = EffectSize::of([3.0, -4.0, 0.0, 0.0]);
        assert!((size.rms - 2.5).abs() < 1e-12 && size.largest == 4.0, "{size:?}");
        assert_eq!(EffectSize::of([]), EffectSize::default());
    }
}
