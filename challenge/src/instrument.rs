//! Simulated instruments: points or joint angles in a measuring frame, with autocorrelated noise, quantisation, gaps, outliers.
//!
//! Values are ordered row by row; whitened values have unit variance and no autocorrelation.

use crate::arm::JOINTS;
use crate::deviation::{Deviation, tool_pose};
use crate::rng::Rng;
use crate::scene::Scene;
use crate::transform::{Transform, Vector3, mul, transform_point};

/// Measured quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Instrument {
    /// Measured points of the tool, tool frame, m: the TCP or targets; empty if joint angles are measured.
    pub points: Vec<Vector3>,
    /// Base coordinates to measuring coordinates.
    pub measuring_from_base: Transform,
    /// Whether the recording states this transformation.
    pub frame_known: bool,
    /// Whether the recording states the positions of the points on the tool.
    pub points_known: bool,
    /// Whether the points are targets instead of the TCP.
    pub targets: bool,
}

/// Noise of the instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of a value, m or rad.
    pub sigma: f64,
    /// AR(1) coefficient from row to row.
    pub autocorrelation: f64,
    /// Quantisation step, m or rad.
    pub quantum: f64,
    /// Fraction of missing rows.
    pub gaps: f64,
    /// Fraction of rows with outliers.
    pub outliers: f64,
    /// Whether the recording states the standard deviation.
    pub stated: bool,
}

/// Simulated measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurements {
    /// In the order of [`Instrument::values`].
    pub values: Vec<f64>,
    /// Whether each row was recorded.
    pub recorded: Vec<bool>,
    /// Whether each row was recorded and is not an outlier.
    pub usable: Vec<bool>,
}

impl Instrument {
    /// Number of values per row.
    #[must_use]
    pub fn values_per_row(&self, scene: &Scene) -> usize {
        if self.points.is_empty() { scene.arm.joint_count() } else { 3 * self.points.len() }
    }

    /// Values without noise: m in measuring axes, or rad.
    #[must_use]
    pub fn values(
        &self,
        scene: &Scene,
        motors: &[[f64; JOINTS]],
        deviations: &[Deviation],
    ) -> Vec<f64> {
        let mut values = Vec::with_capacity(motors.len() * self.values_per_row(scene));
        for (q, bend) in motors.iter().zip(deviations) {
            if self.points.is_empty() {
                values.extend((0..scene.arm.joint_count()).map(|i| q[i] + bend.0[9 * i]));
                continue;
            }
            let measured = mul(&self.measuring_from_base, &tool_pose(&scene.arm, q, bend));
            values.extend(self.points.iter().flat_map(|place| transform_point(&measured, *place)));
        }
        values
    }
}

impl Noise {
    /// Standard deviation of a value: noise and quantisation.
    #[must_use]
    pub fn total_sigma(&self) -> f64 {
        (self.sigma * self.sigma + self.quantum * self.quantum / 12.0).sqrt()
    }

    /// Measured values with noise, gaps and outliers.
    pub fn measure(
        &self,
        scene: &Scene,
        exact: &[f64],
        width: usize,
        rng: &mut Rng,
    ) -> Measurements {
        let mut measured =
            Measurements { values: exact.to_vec(), recorded: Vec::new(), usable: Vec::new() };
        let mut memory = vec![0.0; width];
        let (keep, fresh) =
            (self.autocorrelation, (1.0 - self.autocorrelation * self.autocorrelation).sqrt());
        let mut missing = 0;
        for (row, values) in scene.rows.iter().zip(measured.values.chunks_mut(width)) {
            let is_segment_start = row.t_s == 0.0;
            let outlier = rng.bernoulli(self.outliers);
            let away = self.sigma * rng.uniform_between(15.0, 60.0);
            if missing == 0 && rng.bernoulli(self.gaps / 3.0) {
                // A gap has one to five rows, three on average: hence a third of the fraction as probability of its beginning.
                missing = 1 + rng.uniform_index(5);
            }
            for (value, memory) in values.iter_mut().zip(&mut memory) {
                let draw = rng.normal();
                *memory = if is_segment_start { draw } else { keep * *memory + fresh * draw };
                let wrong = if outlier { away * rng.random_sign() } else { 0.0 };
                let read = *value + self.sigma * *memory + wrong;
                *value = if self.quantum > 0.0 {
                    (read / self.quantum).round() * self.quantum
                } else {
                    read
                };
            }
            let recorded = missing == 0;
            missing -= usize::from(!recorded);
            measured.recorded.push(recorded);
            measured.usable.push(recorded && !outlier);
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
        let plain = Self::unit_variance(width, noise.autocorrelation, right, follows);
        Self { sigma: noise.total_sigma(), ..plain }
    }

    /// For values in units of their noise, `width` per row, with AR(1) coefficient `colour`. `right`: rows in use; `follows`: whether the second of
    /// two successive rows continues the first.
    #[must_use]
    pub fn unit_variance(
        width: usize,
        colour: f64,
        right: &[bool],
        follows: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let is_contiguous = |row: usize| row > 0 && right[row - 1] && follows(row - 1, row);
        let rows = (0..right.len()).filter(|row| right[*row]).map(|row| (row, is_contiguous(row)));
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
    pub fn select(&self, values: &[f64]) -> Vec<f64> {
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
    use crate::scene::{Excitation, RecordedInputs};

    #[test]
    fn coloured_noise_whitens_to_unit_variance_without_memory() {
        let mut rng = Rng::new(5, 0);
        let arm = Arm::random(&mut rng, true);
        let scene = Scene::random_path(
            arm,
            RecordedInputs::default(),
            (4000, 100.0),
            Excitation::Full,
            &mut rng,
        );
        let noise = Noise {
            sigma: 2e-5,
            autocorrelation: 0.7,
            quantum: 1e-6,
            gaps: 0.02,
            outliers: 0.003,
            stated: true,
        };
        let exact = vec![0.0; 3 * scene.rows.len()];
        let measurement = noise.measure(&scene, &exact, 3, &mut rng);
        let whitener = Whitener::of(&scene, &noise, &measurement.usable, 3);
        let white = whitener.apply(&measurement.values);
        let n = white.len() as f64;
        let variance = white.iter().map(|x| x * x).sum::<f64>() / n;
        let next: f64 = white.windows(4).map(|w| w[0] * w[3]).sum::<f64>() / n;
        assert!((variance - 1.0).abs() < 0.05 && next.abs() < 0.05, "{variance} {next}");
        let missing = measurement.recorded.iter().filter(|recorded| !**recorded).count() as f64;
        assert!((missing / scene.rows.len() as f64 - 0.02).abs() < 0.012, "{missing}");
    }
}
