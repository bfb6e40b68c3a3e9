//! Merges the modes of several response functions of one structure into one list.

use super::FittedMode;

/// Tolerance for equal modes: relative difference of the frequency, or number of standard
/// uncertainties.
const SAME_MODE_TOLERANCE: (f64, f64) = (0.01, 3.0);

/// A mode identified in one or several response functions.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedMode {
    /// Natural frequency, Hz: mean weighted by the uncertainties.
    pub frequency_hz: f64,
    /// Its standard uncertainty, Hz: includes the scatter between the functions, and is at least
    /// that of the most accurate one.
    pub frequency_sigma_hz: f64,
    /// Damping ratio, likewise.
    pub damping: f64,
    /// Standard uncertainty of it.
    pub damping_sigma: f64,
    /// Whether it meets the three criteria in at least one function.
    pub meets_all_criteria: bool,
    /// The mode as identified in each function, with the index of the function.
    pub observations: Vec<(usize, FittedMode)>,
}

/// Merges the modes of several response functions of one structure, lowest first.
#[must_use]
pub fn merge_modes(lists: &[Vec<FittedMode>]) -> Vec<MergedMode> {
    let all = lists.iter().enumerate().flat_map(|(k, list)| list.iter().map(move |m| (k, *m)));
    let mut all: Vec<(usize, FittedMode)> = all.collect();
    all.sort_by(|a, b| a.1.frequency_hz.total_cmp(&b.1.frequency_hz));
    let mut groups: Vec<Vec<(usize, FittedMode)>> = Vec::new();
    for (k, mode) in all {
        let is_same_mode = |(_, other): &(usize, FittedMode)| {
            let apart = mode.frequency_hz - other.frequency_hz;
            let sigma = mode.frequency_sigma_hz.hypot(other.frequency_sigma_hz);
            apart <= (SAME_MODE_TOLERANCE.0 * mode.frequency_hz).max(SAME_MODE_TOLERANCE.1 * sigma)
        };
        match groups.last_mut() {
            Some(group)
                if group.first().is_some_and(is_same_mode)
                    && group.iter().all(|(index, _)| *index != k) =>
            {
                group.push((k, mode));
            }
            _ => groups.push(vec![(k, mode)]),
        }
    }
    groups.into_iter().map(merge_group).collect()
}

fn merge_group(observations: Vec<(usize, FittedMode)>) -> MergedMode {
    let mean_of = |value: fn(&FittedMode) -> (f64, f64)| {
        random_effects_mean(observations.iter().map(|(_, m)| value(m)))
    };
    let (frequency_hz, frequency_sigma_hz) = mean_of(|m| (m.frequency_hz, m.frequency_sigma_hz));
    let (damping, damping_sigma) = mean_of(|m| (m.damping, m.damping_sigma));
    let meets_all_criteria = observations.iter().any(|(_, mode)| mode.meets_all_criteria);
    MergedMode {
        frequency_hz,
        frequency_sigma_hz,
        damping,
        damping_sigma,
        meets_all_criteria,
        observations,
    }
}

/// The weighted mean of values with standard uncertainties, and its standard uncertainty. Scatter
/// beyond the uncertainties is added to each (random-effects model; DerSimonian and Laird 1986).
/// The uncertainty of the mean is at least the smallest of the values, because a misfit is common
/// to the functions.
fn random_effects_mean(values: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let weighted = |between: f64| {
        let weight = |sigma: f64| (sigma * sigma + between).max(f64::MIN_POSITIVE.sqrt()).recip();
        let sum =
            |power: i32| values.clone().map(|(_, sigma)| weight(sigma).powi(power)).sum::<f64>();
        let mean = values.clone().map(|(x, sigma)| x * weight(sigma)).sum::<f64>() / sum(1);
        let chi_squared: f64 =
            values.clone().map(|(x, sigma)| (x - mean).powi(2) * weight(sigma)).sum();
        (mean, chi_squared, sum(1), sum(2))
    };
    let (_, chi, first, second) = weighted(0.0);
    let excess = chi - (values.clone().count() as f64 - 1.0);
    let scale = first - second / first;
    let between = if excess > 0.0 && scale > 0.0 { excess / scale } else { 0.0 };
    let (mean, _, weights, _) = weighted(between);
    let best = values.map(|(_, sigma)| sigma).fold(f64::INFINITY, f64::min);
    (mean, weights.sqrt().recip().max(best))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(frequency_hz: f64, sigma_hz: f64) -> FittedMode {
        FittedMode {
            frequency_hz,
            frequency_sigma_hz: sigma_hz,
            damping: 0.03,
            damping_sigma: 0.001,
            damping_half_power: None,
            mass_kg: 1.0,
            mass_sigma_kg: 0.1,
            phase_rad: 0.0,
            coherence: None,
            carry_over: 0.0,
            meets_all_criteria: true,
            residual: 0.01,
        }
    }

    #[test]
    fn one_mode_seen_twice_is_one_and_its_uncertainty_holds_the_difference() {
        let lists = [vec![mode(100.0, 0.1), mode(200.0, 0.5)], vec![mode(100.8, 0.1)]];
        let all = merge_modes(&lists);
        assert_eq!(all.len(), 2);
        assert!((all[0].frequency_hz - 100.4).abs() < 1e-9);
        assert!((all[0].frequency_sigma_hz - 0.4).abs() < 1e-9, "{}", all[0].frequency_sigma_hz);
        assert_eq!(all[0].observations.iter().map(|(k, _)| *k).collect::<Vec<_>>(), [0, 1]);
        assert!((all[1].frequency_sigma_hz - 0.5).abs() < 1e-12);
        assert!((all[0].damping - 0.03).abs() < 1e-12);
        assert!((all[0].damping_sigma - 0.001).abs() < 1e-9, "what they share is not averaged out");
    }

    #[test]
    fn two_modes_of_one_function_stay_two() {
        let all = merge_modes(&[vec![mode(70.0, 0.5), mode(70.5, 0.5)]]);
        assert_eq!(all.len(), 2);
    }
}
