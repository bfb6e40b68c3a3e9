//! Merges the modes of several response functions of one structure into one list.

use super::FittedMode;

/// Modes nearer than this part of their frequency, or than this many standard uncertainties, are one.
const SAME: (f64, f64) = (0.01, 3.0);

/// A mode as several response functions show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// Natural frequency, Hz: the mean, weighed by the uncertainties.
    pub frequency_hz: f64,
    /// Its standard uncertainty, Hz: at least the scatter between the functions, and that of the
    /// best of them.
    pub frequency_sigma_hz: f64,
    /// Damping ratio, likewise.
    pub damping: f64,
    /// Standard uncertainty of it.
    pub damping_sigma: f64,
    /// The three signs show it in at least one function.
    pub by_signs: bool,
    /// Place of the function in the list, and the mode as it shows it.
    pub seen: Vec<(usize, FittedMode)>,
}

/// Puts together the modes of several response functions of one structure, lowest first.
#[must_use]
pub fn merged(lists: &[Vec<FittedMode>]) -> Vec<Merged> {
    let all = lists.iter().enumerate().flat_map(|(k, list)| list.iter().map(move |m| (k, *m)));
    let mut all: Vec<(usize, FittedMode)> = all.collect();
    all.sort_by(|a, b| a.1.frequency_hz.total_cmp(&b.1.frequency_hz));
    let mut groups: Vec<Vec<(usize, FittedMode)>> = Vec::new();
    for (k, mode) in all {
        let near = |(_, other): &(usize, FittedMode)| {
            let apart = mode.frequency_hz - other.frequency_hz;
            let sigma = mode.frequency_sigma_hz.hypot(other.frequency_sigma_hz);
            apart <= (SAME.0 * mode.frequency_hz).max(SAME.1 * sigma)
        };
        match groups.last_mut() {
            Some(group)
                if group.first().is_some_and(near) && group.iter().all(|(of, _)| *of != k) =>
            {
                group.push((k, mode));
            }
            _ => groups.push(vec![(k, mode)]),
        }
    }
    groups.into_iter().map(one).collect()
}

fn one(seen: Vec<(usize, FittedMode)>) -> Merged {
    let of = |value: fn(&FittedMode) -> (f64, f64)| mean(seen.iter().map(|(_, m)| value(m)));
    let (frequency_hz, frequency_sigma_hz) = of(|m| (m.frequency_hz, m.frequency_sigma_hz));
    let (damping, damping_sigma) = of(|m| (m.damping, m.damping_sigma));
    let by_signs = seen.iter().any(|(_, mode)| mode.by_signs);
    Merged { frequency_hz, frequency_sigma_hz, damping, damping_sigma, by_signs, seen }
}

/// The weighted mean of values with standard uncertainties, and its own. Scatter beyond the
/// uncertainties is added to each (random effects; Laird and others 1986); and the mean is not more
/// accurate than the best of them, because a misfit is common to the functions.
fn mean(values: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let weighted = |between: f64| {
        let weight = |sigma: f64| (sigma * sigma + between).max(f64::MIN_POSITIVE.sqrt()).recip();
        let sum =
            |power: i32| values.clone().map(|(_, sigma)| weight(sigma).powi(power)).sum::<f64>();
        let mean = values.clone().map(|(x, sigma)| x * weight(sigma)).sum::<f64>() / sum(1);
        let chi: f64 = values.clone().map(|(x, sigma)| (x - mean).powi(2) * weight(sigma)).sum();
        (mean, chi, sum(1), sum(2))
    };
    let (_, chi, first, second) = weighted(0.0);
    let beyond = chi - (values.clone().count() as f64 - 1.0);
    let freedom = first - second / first;
    let between = if beyond > 0.0 && freedom > 0.0 { beyond / freedom } else { 0.0 };
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
            carried: 0.0,
            by_signs: true,
            residual: 0.01,
        }
    }

    #[test]
    fn one_mode_seen_twice_is_one_and_its_uncertainty_holds_the_difference() {
        let lists = [vec![mode(100.0, 0.1), mode(200.0, 0.5)], vec![mode(100.8, 0.1)]];
        let all = merged(&lists);
        assert_eq!(all.len(), 2);
        assert!((all[0].frequency_hz - 100.4).abs() < 1e-9);
        assert!((all[0].frequency_sigma_hz - 0.4).abs() < 1e-9, "{}", all[0].frequency_sigma_hz);
        assert_eq!(all[0].seen.iter().map(|(k, _)| *k).collect::<Vec<_>>(), [0, 1]);
        assert!((all[1].frequency_sigma_hz - 0.5).abs() < 1e-12);
        assert!((all[0].damping - 0.03).abs() < 1e-12);
        assert!((all[0].damping_sigma - 0.001).abs() < 1e-9, "what they share is not averaged out");
    }

    #[test]
    fn two_modes_of_one_function_stay_two() {
        let all = merged(&[vec![mode(70.0, 0.5), mode(70.5, 0.5)]]);
        assert_eq!(all.len(), 2);
    }
}
