//! Simulated instruments: points or joint angles in a measuring frame, with autocorrelated noise, quantisation, gaps, outliers.
//!
//! Values are ordered row by row; whitened values have unit variance and no autocorrelation.

use crate::arm::JOINTS;
use crate::bent::{Bend, tool};
use crate::chance::Chance;
use crate::scene::Scene;
use crate::space::{T4, V3, mul, point};

/// Measured quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Measured points of the tool, tool frame, m: the TCP or targets; empty if joint angles are measured.
    pub places: Vec<V3>,
    /// Base coordinates to measuring coordinates.
    pub measuring_from_base: T4,
    /// Whether the recording states this transformation.
    pub frame_known: bool,
    /// Whether the recording states the positions of the points on the tool.
    pub places_known: bool,
    /// Whether the points are targets instead of the TCP.
    pub targets: bool,
}

/// Noise of the instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of a value, m or rad.
    pub sigma: f64,
    /// AR(1) coefficient from row to row.
    pub colour: f64,
    /// Quantisation step, m or rad.
    pub digit: f64,
    /// Fraction of missing rows.
    pub gaps: f64,
    /// Fraction of rows with outliers.
    pub outliers: f64,
    /// Whether the recording states the standard deviation.
    pub stated: bool,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// In the order of [`View::values`].
    pub values: Vec<f64>,
    /// Whether each row was recorded.
    pub there: Vec<bool>,
    /// Whether each row was recorded and is not an outlier.
    pub right: Vec<bool>,
}

impl View {
    /// Number of values per row.
    #[must_use]
    pub fn width(&self, scene: &Scene) -> usize {
        if self.places.is_empty() { scene.arm.count() } else { 3 * self.places.len() }
    }

    /// Values without noise: m in measuring axes, or rad.
    #[must_use]
    pub fn values(&self, scene: &Scene, motors: &[[f64; JOINTS]], bends: &[Bend]) -> Vec<f64> {
        let mut values = Vec::with_capacity(motors.len() * self.width(scene));
        for (q, bend) in motors.iter().zip(bends) {
            if self.places.is_empty() {
                values.extend((0..scene.arm.count()).map(|i| q[i] + bend.0[9 * i]));
                continue;
            }
            let seen = mul(&self.measuring_from_base, &tool(&scene.arm, q, bend));
            values.extend(self.places.iter().flat_map(|place| point(&seen, *place)));
        }
        values
    }
}

impl Noise {
    /// Standard deviation of a value: noise and quantisation.
    #[must_use]
    pub fn total(&self) -> f64 {
        (self.sigma * self.sigma + self.digit * self.digit / 12.0).sqrt()
    }

    /// Measured values with noise, gaps and outliers.
    pub fn read(
        &self,
        scene: &Scene,
        exact: &[f64],
        width: usize,
        chance: &mut Chance,
    ) -> Measured {
        let mut measured =
            Measured { values: exact.to_vec(), there: Vec::new(), right: Vec::new() };
        let mut memory = vec![0.0; width];
        let (keep, fresh) = (self.colour, (1.0 - self.colour * self.colour).sqrt());
        let mut missing = 0;
        for (row, values) in scene.rows.iter().zip(measured.values.chunks_mut(width)) {
            let anew = row.t_s == 0.0;
            let outlier = chance.happens(self.outliers);
            let away = self.sigma * chance.between(15.0, 60.0);
            if missing == 0 && chance.happens(self.gaps / 3.0) {
                // A gap has one to five rows, three on average: hence a third of the fraction as probability of its beginning.
                missing = 1 + chance.pick(5);
            }
            for (value, memory) in values.iter_mut().zip(&mut memory) {
                let draw = chance.normal();
                *memory = if anew { draw } else { keep * *memory + fresh * draw };
                let wrong = if outlier { away * chance.sign() } else { 0.0 };
                let read = *value + self.sigma * *memory + wrong;
                *value =
                    if self.digit > 0.0 { (read / self.digit).round() * self.digit } else { read };
            }
            let there = missing == 0;
            missing -= usize::from(!there);
            measured.there.push(there);
            measured.right.push(there && !outlier);
        }
        measured
    }
}

/// Selection and whitening of rows.
#[derive(Clone, Debug)]
pub struct Whitener {
    width: usize,
    sigma: f64,
    colour: f64,
    /// Each kept row, and whether it directly follows the preceding kept row.
    rows: Vec<(usize, bool)>,
}

impl Whitener {
    /// For the rows marked in `right`.
    #[must_use]
    pub fn of(scene: &Scene, noise: &Noise, right: &[bool], width: usize) -> Self {
        let segment = |row: usize| scene.rows[row].segment;
        let follows = |before, row| segment(before) == segment(row);
        let plain = Self::plain(width, noise.colour, right, follows);
        Self { sigma: noise.total(), ..plain }
    }

    /// For values in units of their noise, `width` per row, with AR(1) coefficient `colour`. `right`: rows in use; `follows`: whether the second of
    /// two successive rows continues the first.
    #[must_use]
    pub fn plain(
        width: usize,
        colour: f64,
        right: &[bool],
        follows: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let goes_on = |row: usize| row > 0 && right[row - 1] && follows(row - 1, row);
        let rows = (0..right.len()).filter(|row| right[*row]).map(|row| (row, goes_on(row)));
        Self { width, sigma: 1.0, colour, rows: rows.collect() }
    }

    /// Number of values in use.
    #[must_use]
    pub fn count(&self) -> usize {
        self.rows.len() * self.width
    }

    /// Whitened values of the kept rows.
    #[must_use]
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let fresh = 1.0 / (self.sigma * (1.0 - self.colour * self.colour).sqrt());
        let mut whitened = Vec::with_capacity(self.count());
        for (row, follows) in &self.rows {
            for k in row * self.width..(row + 1) * self.width {
                whitened.push(if *follows {
                    (values[k] - self.colour * values[k - self.width]) * fresh
                } else {
                    values[k] / self.sigma
                });
            }
        }
        whitened
    }

    /// Values of the kept rows, not whitened.
    #[must_use]
    pub fn kept(&self, values: &[f64]) -> Vec<f64> {
        let rows = self.rows.iter();
        rows.flat_map(|(row, _)| &values[row * self.width..(row + 1) * self.width])
            .copied()
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;
    use crate::scene::{Has, Richness};

    #[test]
    fn coloured_noise_whitens_to_unit_variance_without_memory() {
        let mut chance = Chance::new(5, 0);
        let arm = Arm::draw(&mut chance, true);
        let scene = Scene::path(arm, Has::default(), (4000, 100.0), Richness::Full, &mut chance);
        let noise = Noise {
            sigma: 2e-5,
            colour: 0.7,
            digit: 1e-6,
            gaps: 0.02,
            outliers: 0.003,
            stated: true,
        };
        let exact = vec![0.0; 3 * scene.rows.len()];
        let seen = noise.read(&scene, &exact, 3, &mut chance);
        let whitener = Whitener::of(&scene, &noise, &seen.right, 3);
        let white = whitener.apply(&seen.values);
        let n = white.len() as f64;
        let variance = white.iter().map(|x| x * x).sum::<f64>() / n;
        let next: f64 = white.windows(4).map(|w| w[0] * w[3]).sum::<f64>() / n;
        assert!((variance - 1.0).abs() < 0.05 && next.abs() < 0.05, "{variance} {next}");
        let missing = seen.there.iter().filter(|there| !**there).count() as f64;
        assert!((missing / scene.rows.len() as f64 - 0.02).abs() < 0.012, "{missing}");
    }
}
