//! Attribution of the reduction of an error to several effects: the Shapley value, a mean over all orders in which they can be added.
//!
//! With fixed parameters the error energy is a quadratic form of the effects' contributions, and the Shapley value is half of what an effect removes
//! alone plus half of what it removes beside all others (Shapley 1953; for quadratic games the two-point formula is exact). Effects that partly
//! explain the same share it equally, whichever was added first.

/// Remaining error energy with some of the effects, in any unit of energy.
pub(crate) struct ErrorEnergies {
    pub(crate) with_none: f64,
    /// With a single effect, for each of them.
    pub(crate) with_one: Vec<f64>,
    /// With all effects but one, for each of them.
    pub(crate) without_one: Vec<f64>,
    pub(crate) with_all: f64,
}

impl ErrorEnergies {
    /// The Shapley value of each effect; they sum to the reduction by all effects.
    pub(crate) fn shapley_values(&self) -> Vec<f64> {
        let share =
            |(with, without): (&f64, &f64)| 0.5 * (self.with_none - with + without - self.with_all);
        self.with_one.iter().zip(&self.without_one).map(share).collect()
    }

    /// Indices of the effects, the one with the largest Shapley value first.
    pub(crate) fn order(&self) -> Vec<usize> {
        let shares = self.shapley_values();
        let mut places: Vec<usize> = (0..shares.len()).collect();
        places.sort_by(|a, b| shares[*b].total_cmp(&shares[*a]));
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contributions of three effects, and the error to explain.
    const MOVED: [[f64; 3]; 3] = [[3.0, 1.0, 0.0], [2.5, -1.0, 0.5], [0.0, 0.4, 2.0]];
    const ERROR: [f64; 3] = [5.7, 0.3, 2.3];

    fn left(removed: &[usize]) -> f64 {
        let remaining = (0..3).filter(|k| !removed.contains(k));
        let rest = remaining.fold(ERROR, |rest, k| std::array::from_fn(|i| rest[i] - MOVED[k][i]));
        rest.iter().map(|x| x * x).sum()
    }

    #[test]
    fn a_share_is_the_mean_of_what_an_effect_removes_over_all_orders() {
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let mut mean = [0.0; 3];
        for order in orders {
            for position in 0..3 {
                mean[order[position]] +=
                    (left(&order[position..]) - left(&order[position + 1..])) / 6.0;
            }
        }
        let energies = ErrorEnergies {
            with_none: left(&[0, 1, 2]),
            with_one: vec![left(&[1, 2]), left(&[0, 2]), left(&[0, 1])],
            without_one: vec![left(&[0]), left(&[1]), left(&[2])],
            with_all: left(&[]),
        };
        let shares = energies.shapley_values();
        for (share, mean) in shares.iter().zip(mean) {
            assert!((share - mean).abs() < 1e-9, "{shares:?} beside {mean:?}");
        }
        let all: f64 = shares.iter().sum();
        assert!((all - (left(&[0, 1, 2]) - left(&[]))).abs() < 1e-9, "they are all that is gained");
        assert!(
            shares.windows(2).count() > 0
                && shares[energies.order()[0]] >= shares[energies.order()[2]]
        );
    }
}
