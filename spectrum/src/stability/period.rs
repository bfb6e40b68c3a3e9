//! From one tooth to the next as a linear map, and its largest eigenvalue: first-order semi-discretisation.
//!
//! State: the modes, `(q, q̇/ω)`, and the tip's motion at the nodes of the last tooth passing. Over a step h W is its mean, the motion one
//! passing ago a straight line between nodes; then `x' = φ₀ x + φ₁ g₀ + φ₂ (g₁ − g₀)` is exact, `φ_j = Σ Z^n/(n + j)!`, Z: h times the system with the
//! teeth's present stiffness. While no tooth cuts the modes ring freely, in one step. Nodes stand where teeth enter and leave.
//! The eigenvalue of largest modulus by Arnoldi's method after some passings, which let all die out that decays fast.
//! Source: Insperger and Stépán, Int. J. Numer. Meth. Engng 55 (2002) and 61 (2004); Semi-Discretization for Time-Delay Systems, 2011.

use super::bite::Bite;
use super::{Cutter, Swing, in_plane};
use crate::Complex;
use nalgebra::{DMatrix, DVector, Schur, Vector2};
use std::f64::consts::TAU;

/// Steps for each wave of the highest mode.
const STEPS_PER_WAVE: f64 = 60.0;
/// Steps turn no further than this, rad.
const STEP_RAD: f64 = 0.04;
/// A span of angle below this part of the pitch is none.
const NOTHING: f64 = 1e-9;
/// Tooth periods before Arnoldi's method, and number of its vectors: this many, and one more for
/// each wave of the highest mode per period.
const PASSINGS: usize = 10;
const VECTORS: usize = 12;
/// Limit on the terms of a matrix series, and size of the last one.
const TERMS: usize = 120;
const LAST_TERM: f64 = 1e-12;

/// The eigenvalue of largest modulus of the map from tooth to tooth; infinite on overflow.
pub(super) fn multiplier(
    swings: &[Swing],
    cutter: &Cutter,
    spindle_rpm: f64,
    depth_m: f64,
) -> Complex<f64> {
    Passing::new(swings, cutter, spindle_rpm, depth_m).multiplier()
}

/// One step of time, row by row: the state after it from the state before and the delayed motion at its two nodes.
struct Step {
    state: DMatrix<f64>,
    delayed: [DMatrix<f64>; 2],
}

/// A mode that rings freely for a while: the state `(q, q̇/ω)` after it.
struct Free {
    from_position: [f64; 2],
    from_speed: [f64; 2],
}

/// The map over one tooth passing.
struct Passing {
    modes: usize,
    /// Waves of the highest mode in a passing.
    waves: f64,
    /// In-plane direction of each mode.
    directions: Vec<Vector2<f64>>,
    steps: Vec<Step>,
    free: Vec<Free>,
}

impl Passing {
    fn new(swings: &[Swing], cutter: &Cutter, spindle_rpm: f64, depth_m: f64) -> Self {
        let spindle_rad_s = TAU / 60.0 * spindle_rpm;
        let pitch_rad = TAU / f64::from(cutter.teeth);
        let bite = Bite::new(cutter, depth_m);
        let [low, high] = bite.window_rad();
        let beyond = (high - low) % pitch_rad;
        let is_whole = cutter.turning || beyond < NOTHING || beyond > pitch_rad - NOTHING;
        let is_interrupted = !is_whole && high - low < pitch_rad;
        let spans = match (is_whole, is_interrupted) {
            (true, _) => vec![[low, low + pitch_rad]],
            (false, true) => vec![[low, high]],
            (false, false) => vec![[low, low + beyond], [low + beyond, low + pitch_rad]],
        };
        let highest_rad_s = swings.iter().map(|swing| swing.omega_rad_s).fold(0.0, f64::max);
        let per_rad = (STEPS_PER_WAVE * highest_rad_s / (TAU * spindle_rad_s)).max(1.0 / STEP_RAD);
        let mut steps = Vec::new();
        for [from, to] in spans {
            let count = (per_rad * (to - from)).ceil().max(1.0);
            let step_rad = (to - from) / count;
            for k in 0..count as usize {
                let stiffness = bite.of_all_teeth(from + k as f64 * step_rad, step_rad) * depth_m;
                steps.push(Step::new(swings, &stiffness, step_rad / spindle_rad_s));
            }
        }
        let free_s = if is_interrupted { (pitch_rad - (high - low)) / spindle_rad_s } else { 0.0 };
        Self {
            modes: swings.len(),
            waves: highest_rad_s / TAU * cutter.delay_s(spindle_rpm),
            directions: swings.iter().map(|swing| in_plane() * swing.direction).collect(),
            steps,
            free: swings.iter().map(|swing| Free::new(swing, free_s)).collect(),
        }
    }

    /// Modes, then the motion at each node, first along the feed, then across it.
    fn size(&self) -> usize {
        2 * self.modes + 2 * (self.steps.len() + 1)
    }

    fn motion(&self, state: &[f64]) -> Vector2<f64> {
        self.directions.iter().zip(state).map(|(direction, q)| direction * *q).sum()
    }

    /// One passing on.
    fn apply(&self, before: &DVector<f64>, after: &mut DVector<f64>) {
        let n = 2 * self.modes;
        let (state, delayed) = before.as_slice().split_at(n);
        let (mut now, mut next) = (state.to_vec(), vec![0.0; n]);
        let (end, nodes) = after.as_mut_slice().split_at_mut(n);
        let first = self.motion(&now);
        nodes[..2].copy_from_slice(first.as_slice());
        for (k, step) in self.steps.iter().enumerate() {
            next.fill(0.0);
            add(&mut next, &step.state, &now);
            add(&mut next, &step.delayed[0], &delayed[2 * k..2 * k + 2]);
            add(&mut next, &step.delayed[1], &delayed[2 * k + 2..2 * k + 4]);
            std::mem::swap(&mut now, &mut next);
            nodes[2 * k + 2..2 * k + 4].copy_from_slice(self.motion(&now).as_slice());
        }
        for (i, free) in self.free.iter().enumerate() {
            let (q, v) = (now[i], now[self.modes + i]);
            end[i] = free.from_position[0] * q + free.from_speed[0] * v;
            end[self.modes + i] = free.from_position[1] * q + free.from_speed[1] * v;
        }
    }

    fn multiplier(&self) -> Complex<f64> {
        let size = self.size();
        let mut now = DVector::from_iterator(size, (0..size).map(scattered));
        let mut next = DVector::zeros(size);
        let mut growth = 0.0;
        for _ in 0..PASSINGS {
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
        let reduced = self.reduced(&now);
        let schur = Schur::try_new(reduced, 1e-13, 10_000);
        let largest = schur.and_then(|schur| {
            let all = schur.complex_eigenvalues();
            all.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()))
        });
        largest.filter(|value| value.norm().is_finite()).unwrap_or(Complex::new(growth, 0.0))
    }

    /// The map within the space that a vector spans with its images (Arnoldi, modified Gram-Schmidt, twice).
    fn reduced(&self, start: &DVector<f64>) -> DMatrix<f64> {
        let vectors = (VECTORS + self.waves as usize).min(self.size());
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

/// Repeatable numbers from −1 to 1 without a pattern in common with any vibration (fractional parts
/// of multiples of the golden section).
fn scattered(k: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    2.0 * ((k + 1) as f64 * GOLDEN).fract() - 1.0
}

/// `sum += matrix · vector`.
fn add(sum: &mut [f64], matrix: &DMatrix<f64>, vector: &[f64]) {
    for (column, x) in matrix.as_slice().chunks_exact(sum.len()).zip(vector) {
        for (to, m) in sum.iter_mut().zip(column) {
            *to += m * x;
        }
    }
}

impl Step {
    /// Of a stiffness of the teeth in N/m of displacement, and a time in s.
    fn new(swings: &[Swing], stiffness: &nalgebra::Matrix3x2<f64>, step_s: f64) -> Self {
        let n = swings.len();
        let mut system = DMatrix::zeros(2 * n, 2 * n);
        let mut delayed = DMatrix::zeros(2 * n, 2);
        for (i, swing) in swings.iter().enumerate() {
            let turned = step_s * swing.omega_rad_s;
            // Force per displacement of the tip that reaches this mode, over the mode's stiffness.
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
        let phi_2 = series(&system);
        let phi_1 = one_and(&system, &phi_2);
        let state = one_and(&system, &phi_1);
        let (late, early) = (times(&phi_2, &delayed), times(&phi_1, &delayed));
        Self { state, delayed: [early - &late, late] }
    }
}

/// `Σ Z^n/(n + 2)!`.
fn series(z: &DMatrix<f64>) -> DMatrix<f64> {
    let mut term = DMatrix::identity(z.nrows(), z.ncols()) * 0.5;
    let mut sum = term.clone();
    for n in 1..TERMS {
        term = times(&term, z);
        term /= (n + 2) as f64;
        sum += &term;
        if term.amax() <= LAST_TERM {
            break;
        }
    }
    sum
}

/// `1 + Z φ`: from one of the series to the one before it.
fn one_and(z: &DMatrix<f64>, phi: &DMatrix<f64>) -> DMatrix<f64> {
    let mut sum = times(z, phi);
    for i in 0..sum.nrows() {
        sum[(i, i)] += 1.0;
    }
    sum
}

/// A product of matrices so small that a plain loop is the fastest.
fn times(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(left.nrows(), right.ncols());
    let columns = product.as_mut_slice().chunks_exact_mut(left.nrows());
    for (to, from) in columns.zip(right.as_slice().chunks_exact(right.nrows())) {
        add(to, left, from);
    }
    product
}

impl Free {
    fn new(swing: &Swing, time_s: f64) -> Self {
        let zeta = swing.damping_ratio;
        let damped = (1.0 - zeta * zeta).sqrt();
        let fade = (-zeta * swing.omega_rad_s * time_s).exp();
        let (sin, cos) = (damped * swing.omega_rad_s * time_s).sin_cos();
        let (even, odd) = (fade * cos, fade * sin / damped);
        Self { from_position: [even + zeta * odd, -odd], from_speed: [odd, even - zeta * odd] }
    }
}
