//! Assignment of lines to wheels, and the probability of a random match.

use spectrum::GearFrequency;
use spectrum::spatial::{MULTIPLES, match_gears};

use super::Settings;
use super::lines::Line;
use super::trains::GearTrain;

/// A wheel that fits a line.
#[derive(Clone, Copy, Debug)]
pub struct MatchingGear {
    /// Shaft or mesh.
    pub wheel: GearFrequency,
    /// The line is this multiple of it.
    pub multiple: u32,
    /// Distance of the multiple from the line, relative to the line.
    pub distance: f64,
    /// Difference of most and least along the path, relative to the mean.
    pub drift: f64,
}

impl MatchingGear {
    /// `2 × joint 1, 10 teeth of shaft 1 (+0.8 %)`.
    pub(super) fn text(&self) -> String {
        let times =
            if self.multiple > 1 { format!("{} × ", self.multiple) } else { String::new() };
        format!("{times}{} ({:+.1} %)", self.wheel, 100.0 * self.distance)
    }
}

/// A line and its matches, the nearest first.
#[derive(Clone, Debug)]
pub struct MatchedLine {
    /// The line.
    pub line: Line,
    /// What fits it.
    pub fits: Vec<MatchingGear>,
    /// The part of the octave around the line in which any line would fit a wheel; 0 to 1.
    pub by_chance: f64,
}

impl MatchedLine {
    pub(super) fn of(line: Line, trains: &[GearTrain], settings: &Settings) -> Self {
        let tolerance = 0.01 * settings.tolerance_percent;
        let even = || trains.iter().filter(|train| train.drift() <= settings.drift_max);
        let within = |train: &GearTrain| tolerance + line.uncertainty + 0.5 * train.drift();
        let wheels: Vec<GearFrequency> =
            even().flat_map(|train| train.wheels.iter().copied()).collect();
        let widest = even().map(within).fold(0.0, f64::max);
        let fit = |(wheel, multiple): (GearFrequency, u32)| {
            let train = trains.iter().find(|train| train.joint == wheel.joint)?;
            let distance = f64::from(multiple) * wheel.cycles_per_mm / line.cycles_per_mm - 1.0;
            let fit = MatchingGear { wheel, multiple, distance, drift: train.drift() };
            (distance.abs() <= within(train)).then_some(fit)
        };
        let fits =
            match_gears(line.cycles_per_mm, &wheels, widest).into_iter().filter_map(fit).collect();
        let windows = even().flat_map(|train| {
            let within = within(train).min(0.9);
            let multiples = train.wheels.iter().flat_map(|wheel| {
                (1..=MULTIPLES).map(|order| f64::from(order) * wheel.cycles_per_mm)
            });
            let octaves = |cycles: f64| (cycles / line.cycles_per_mm).log2();
            multiples.map(move |c| [c / (1.0 + within), c / (1.0 - within)].map(octaves))
        });
        let by_chance = covered(windows.collect());
        Self { fits, by_chance, line }
    }
}

/// How much of the octave from −½ to ½ some windows cover together.
fn covered(mut windows: Vec<[f64; 2]>) -> f64 {
    windows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut reached, mut sum) = (-0.5_f64, 0.0);
    for [from, to] in windows {
        let (from, to) = (from.max(reached), to.min(0.5));
        if to > from {
            sum += to - from;
            reached = to;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_that_overlap_count_once_and_beyond_the_octave_not_at_all() {
        let sum = covered(vec![[0.1, 0.3], [-0.2, -0.1], [0.2, 0.35], [0.4, 9.0], [-3.0, -0.6]]);
        assert!((sum - 0.45).abs() < 1e-12, "{sum}");
        assert_eq!(covered(Vec::new()), 0.0);
        assert!((covered(vec![[-9.0, 9.0]]) - 1.0).abs() < 1e-12);
    }
}
