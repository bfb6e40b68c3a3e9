//! First-order semi-discretisation: the linear map over one tooth period, and its largest
//! eigenvalue.
//!
//! State: the modes, `(q, q̇/ω)`, and the tip displacement at the nodes of the last tooth period.
//! In a step of duration h, W is replaced by its mean and the displacement one tooth period ago by
//! a straight line between nodes; then `x' = φ₀ x + φ₁ g₀ + φ₂ (g₁ − g₀)` is exact, with
//! `φ_j = Σ Z^n/(n + j)!` and Z: h times the system matrix with the present stiffness of the teeth. While no tooth
//! cuts, the modes vibrate freely, in one step. Entry and exit angles are nodes. The eigenvalue of
//! largest modulus is found by Arnoldi's method after some power iterations, which remove
//! fast-decaying components. Source: Insperger and Stépán, Int. J. Numer. Meth. Engng 55 (2002) and
//! 61 (2004); Semi-Discretization for Time-Delay Systems, 2011.

use super::directional_coefficients::DirectionalCoefficients;
use super::{Cutter, TipMode, in_plane};
use crate::Complex;
use nalgebra::{DMatrix, DVector, Schur, Vector2};
use std::f64::consts::TAU;

/// Steps per wave of the highest mode.
const STEPS_PER_WAVE: f64 = 60.0;
/// Largest rotation angle of a step, rad.
const STEP_MAX_RAD: f64 = 0.04;
/// Smallest span of angles, relative to the pitch; shorter ones are ignored.
const MIN_SPAN_PART: f64 = 1e-9;
/// Power iterations before Arnoldi's method, and number of its vectors, to which one is added for
/// each wave of the highest mode per tooth period.
const POWER_ITERATIONS: usize = 10;
const ARNOLDI_VECTORS: usize = 12;
/// Largest number of terms of a matrix series, and size of the last one.
const SERIES_TERMS_MAX: usize = 120;
const SERIES_TOLERANCE: f64 = 1e-12;

/// The eigenvalue of largest modulus of the map over one tooth period; infinite on overflow.
pub(super) fn multiplier(
    swings: &[TipMode],
    cutter: &Cutter,
    spindle_rpm: f64,
    depth_m: f64,
) -> Complex<f64> {
    ToothPeriodMap::new(swings, cutter, spindle_rpm, depth_m).multiplier()
}

/// One time step: the matrices from the state before and from the delayed displacement at its two
/// nodes to the state after it.
struct Step {
    state: DMatrix<f64>,
    delayed: [DMatrix<f64>; 2],
}

/// Free vibration of a mode for a given time: coefficients of the state `(q, q̇/ω)` after it.
struct FreeVibration {
    from_position: [f64; 2],
    from_speed: [f64; 2],
}

/// The linear map over one tooth period.
struct ToothPeriodMap {
    modes: usize,
    /// Waves of the highest mode per tooth period.
    waves: f64,
    /// In-plane direction of each mode.
    directions: Vec<Vector2<f64>>,
    steps: Vec<Step>,
    free: Vec<FreeVibration>,
}

impl ToothPeriodMap {
    fn new(swings: &[TipMode], cutter: &Cutter, spindle_rpm: f64, depth_m: f64) -> Self {
        let spindle_rad_s = TAU / 60.0 * spindle_rpm;
        let pitch_rad = TAU / f64::from(cutter.teeth);
        let bite = DirectionalCoefficients::new(cutter, depth_m);
        let [low, high] = bite.engaged_range_rad();
        let beyond = (high - low) % pitch_rad;
        let is_whole =
            cutter.turning || beyond < MIN_SPAN_PART || beyond > pitch_rad - MIN_SPAN_PART;
        let is_interrupted = !is_whole && high - low < pitch_rad;
        let spans = match (is_whole, is_interrupted) {
            (true, _) => vec![[low, low + pitch_rad]],
            (false, true) => vec![[low, high]],
            (false, false) => vec![[low, low + beyond], [low + beyond, low + pitch_rad]],
        };
        let highest_rad_s = swings.iter().map(|swing| swing.omega_rad_s).fold(0.0, f64::max);
        let per_rad =
            (STEPS_PER_WAVE * highest_rad_s / (TAU * spindle_rad_s)).max(1.0 / STEP_MAX_RAD);
        let mut steps = Vec::new();
        for [from, to] in spans {
            let count = (per_rad * (to - from)).ceil().max(1.0);
            let step_rad = (to - from) / count;
            for k in 0..count as usize {
                let stiffness =
                    bite.mean_over_teeth(from + k as f64 * step_rad, step_rad) * depth_m;
                steps.push(Step::new(swings, &stiffness, step_rad / spindle_rad_s));
            }
        }
        let free_s = if is_interrupted { (pitch_rad - (high - low)) / spindle_rad_s } else { 0.0 };
        Self {
            modes: swings.len(),
            waves: highest_rad_s / TAU * cutter.delay_s(spindle_rpm),
            directions: swings.iter().map(|swing| in_plane() * swing.direction).collect(),
            steps,
            free: swings.iter().map(|swing| FreeVibration::new(swing, free_s)).collect(),
        }
    }

    /// Dimension: two per mode, then the tip displacement at each node, along and across the feed.
    fn size(&self) -> usize {
        2 * self.modes + 2 * (self.steps.len() + 1)
    }

    fn tip_displacement(&self, state: &[f64]) -> Vector2<f64> {
        self.directions.iter().zip(state).map(|(direction, q)| direction * *q).sum()
    }

    /// Applies the map to a state.
    fn apply(&self, before: &DVector<f64>, after: &mut DVector<f64>) {
        let n = 2 * self.modes;
        let (state, delayed) = before.as_slice().split_at(n);
        let (mut now, mut next) = (state.to_vec(), vec![0.0; n]);
        let (end, nodes) = after.as_mut_slice().split_at_mut(n);
        let first = self.tip_displacement(&now);
        nodes[..2].copy_from_slice(first.as_slice());
        for (k, step) in self.steps.iter().enumerate() {
            next.fill(0.0);
            add_product(&mut next, &step.state, &now);
            add_product(&mut next, &step.delayed[0], &delayed[2 * k..2 * k + 2]);
            add_product(&mut next, &step.delayed[1], &delayed[2 * k + 2..2 * k + 4]);
            std::mem::swap(&mut now, &mut next);
            nodes[2 * k + 2..2 * k + 4].copy_from_slice(self.tip_displacement(&now).as_slice());
        }
        for (i, free) in self.free.iter().enumerate() {
            let (q, v) = (now[i], now[self.modes + i]);
            end[i] = free.from_position[0] * q + free.from_speed[0] * v;
            end[self.modes + i] = free.from_position[1] * q + free.from_speed[1] * v;
        }
    }

    fn multiplier(&self) -> Complex<f64> {
        let size = self.size();
        let mut now = DVector::from_iterator(size, (0..size).map(quasi_random));
        let mut next = DVector::zeros(size);
        let mut growth = 0.0;
        for _ in 0..POWER_ITERATIONS {
            now.normalize_mut();
            self.apply(&now, &mut next);
            growth = next.norm();
            std::mem::swap(&mut now, &mut next);
        }
        if !growth.is_finite() {
            return Complex::new(f64::INFINITY, 0.0);
        }
        if growth < f64::MIN_POSITIVE {
            return Complex::new(0.0, 0.0);
        }
        let reduced = self.arnoldi_reduction(&now);
        let schur = Schur::try_new(reduced, 1e-13, 10_000);
        let largest = schur.and_then(|schur| {
            let all = schur.complex_eigenvalues();
            all.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()))
        });
        largest.filter(|value| value.norm().is_finite()).unwrap_or(Complex::new(growth, 0.0))
    }

    /// Hessenberg matrix of the map in the Krylov space of a vector (Arnoldi, modified
    /// Gram-Schmidt, twice).
    fn arnoldi_reduction(&self, start: &DVector<f64>) -> DMatrix<f64> {
        let vectors = (ARNOLDI_VECTORS + self.waves as usize).min(self.size());
        let mut reduced = DMatrix::zeros(vectors, vectors);
        let mut basis = vec![start.normalize()];
        let mut image = DVector::zeros(start.len());
        for k in 0..vectors {
            let Some(last) = basis.get(k) else { break };
            self.apply(last, &mut image);
            let size = image.norm();
            for _ in 0..2 {
                for (i, vector) in basis.iter().enumerate() {
                    let part = vector.dot(&image);
                    reduced[(i, k)] += part;
                    image.axpy(-part, vector, 1.0);
                }
            }
            let left = image.norm();
            if k + 1 < vectors && left > 1e-14 * size {
                reduced[(k + 1, k)] = left;
                basis.push(&image / left);
            }
        }
        reduced
    }
}

/// Deterministic start vector with values from −1 to 1, not orthogonal to any vibration (fractional
/// parts of multiples of the golden ratio).
fn quasi_random(k: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    2.0 * ((k + 1) as f64 * GOLDEN).fract() - 1.0
}

/// `sum += matrix · vector`.
fn add_product(sum: &mut [f64], matrix: &DMatrix<f64>, vector: &[f64]) {
    for (column, x) in matrix.as_slice().chunks_exact(sum.len()).zip(vector) {
        for (to, m) in sum.iter_mut().zip(column) {
            *to += m * x;
        }
    }
}

impl Step {
    /// From the stiffness of the teeth, N/m, and the duration in s.
    fn new(swings: &[TipMode], stiffness: &nalgebra::Matrix3x2<f64>, step_s: f64) -> Self {
        let n = swings.len();
        let mut system = DMatrix::zeros(2 * n, 2 * n);
        let mut delayed = DMatrix::zeros(2 * n, 2);
        for (i, swing) in swings.iter().enumerate() {
            let turned = step_s * swing.omega_rad_s;
            // Modal force per displacement of the tip, over the mode's stiffness.
            let reached =
                swing.direction.transpose() * stiffness * (turned / swing.stiffness_n_per_m);
            system[(i, n + i)] = turned;
            system[(n + i, i)] = -turned;
            system[(n + i, n + i)] = -2.0 * swing.damping_ratio * turned;
            for (j, other) in swings.iter().enumerate() {
                system[(n + i, j)] += (reached * (in_plane() * other.direction))[(0, 0)];
            }
            for axis in 0..2 {
                delayed[(n + i, axis)] = -reached[(0, axis)];
            }
        }
        let phi_2 = phi_2_series(&system);
        let phi_1 = identity_plus_product(&system, &phi_2);
        let state = identity_plus_product(&system, &phi_1);
        let (late, early) = (multiply(&phi_2, &delayed), multiply(&phi_1, &delayed));
        Self { state, delayed: [early - &late, late] }
    }
}

/// `Σ Z^n/(n + 2)!`.
fn phi_2_series(z: &DMatrix<f64>) -> DMatrix<f64> {
    let mut term = DMatrix::identity(z.nrows(), z.ncols()) * 0.5;
    let mut sum = term.clone();
    for n in 1..SERIES_TERMS_MAX {
        term = multiply(&term, z);
        term /= (n + 2) as f64;
        sum += &term;
        if term.amax() <= SERIES_TOLERANCE {
            break;
        }
    }
    sum
}

/// `1 + Z φ_j`, which is `φ_{j−1}`.
fn identity_plus_product(z: &DMatrix<f64>, phi: &DMatrix<f64>) -> DMatrix<f64> {
    let mut sum = multiply(z, phi);
    for i in 0..sum.nrows() {
        sum[(i, i)] += 1.0;
    }
    sum
}

/// Matrix product by a plain loop, which is fastest for small matrices.
fn multiply(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(left.nrows(), right.ncols());
    let columns = product.as_mut_slice().chunks_exact_mut(left.nrows());
    for (to, from) in columns.zip(right.as_slice().chunks_exact(right.nrows())) {
        add_product(to, left, from);
    }
    product
}

impl FreeVibration {
    fn new(swing: &TipMode, time_s: f64) -> Self {
        let zeta = swing.damping_ratio;
        let damped = (1.0 - zeta * zeta).sqrt();
        let fade = (-zeta * swing.omega_rad_s * time_s).exp();
        let (sin, cos) = (damped * swing.omega_rad_s * time_s).sin_cos();
        let (even, odd) = (fade * cos, fade * sin / damped);
        Self { from_position: [even + zeta * odd, -odd], from_speed: [odd, even - zeta * odd] }
    }
}
