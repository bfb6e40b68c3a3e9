//! Frequency-domain solution: zeroth-order lobes, and mode coupling without regeneration.
//!
//! With W replaced by its mean W₀ a vibration at ω persists where `det(I − a (1 − e^(−iωτ)) Φ) =
//! 0`, `Φ(iω) = G(iω) W₀` in the plane of the cut, G: receptance of the tip, `Σ u uᵀ / (k (1 −
//! (ω/ω_n)² + 2iζω/ω_n))`. For an eigenvalue λ of Φ with positive real part this is `a = 1/(2 Re
//! λ)`, at `ωτ = ψ + 2πj`, `ψ = 2 atan2(Re λ, −Im λ)`, j = 0, 1, … (Altintas and Budak 1995; `Λ`
//! there is a multiple of 1/λ). Exact for constant W (turning), accurate if many teeth cut at once;
//! flip lobes at small radial immersion are not predicted.
//!
//! Mode coupling: where a tooth does not cut a surface with vibration marks (a new surface, a
//! thread), the chip thickness depends on the displacement itself, `F = a W₀ r`, and the modal
//! stiffness becomes `K − a UᵀW₀U`, which is not symmetric. A vibration persists where `det(I − a
//! Φ) = 0`: `a = 1/λ` at an ω where λ is real and positive; at ω = 0 the instability is static (the
//! tool is pulled into the workpiece). For two modes without damping, `A_ij = u_iᵀ W₀ u_j`, `m_i =
//! k_i/ω_i²`, the squared frequencies are the eigenvalues of `diag(ω²) − a [A_ij/m_i]`, complex
//! where `(ω₁² − ω₂² − a (A₁₁/m₁ − A₂₂/m₂))² + 4 a² A₁₂ A₂₁/(m₁ m₂) < 0`: only where `A₁₂ A₂₁ < 0`,
//! and from the depth `a = (ω₁² − ω₂²)/(A₁₁/m₁ − A₂₂/m₂ ± 2 sqrt(−A₁₂ A₂₁/(m₁ m₂)))` on, the
//! smaller positive one. Rotating the feed direction rotates W₀ relative to the modes and thereby
//! changes all four `A_ij` (Tlusty; Pan, Zhang, Zhu and Wang 2006 for one direction of force; here
//! for any cut, with damping).

use super::{Cutter, Limit, TipMode, in_plane};
use crate::Complex;
use nalgebra::{Matrix2, Matrix3x2};
use std::f64::consts::TAU;

/// Number of frequencies from a twentieth of the lowest mode to the upper limit, logarithmically
/// spaced.
const SWEEP_FREQUENCIES: u32 = 1500;
/// Additional frequencies around each mode: number of half widths (ζ times the frequency) on either
/// side, and frequencies per half width.
const HALF_WIDTHS: i32 = 30;
const PER_HALF_WIDTH: i32 = 12;
/// Bisection steps between two frequencies.
const HALVINGS: usize = 40;
/// Between two frequencies of the sweep the argument of an eigenvalue changes by at most this, rad:
/// otherwise the interval is halved, at most [`SUBDIVISIONS`] times. The phase of a lobe is twice
/// the argument, so that within an interval it is nearly a straight line.
const ARGUMENT_STEP_RAD: f64 = 0.1;
const SUBDIVISIONS: u32 = 20;

/// Eigenvalues of Φ at a frequency, in the order of continuous branches.
#[derive(Clone, Copy, Debug)]
struct Sample {
    omega_rad_s: f64,
    eigenvalues: [Complex<f64>; 2],
}

/// The loop gain from displacement to force and back, swept over frequency.
#[derive(Clone, Debug)]
pub struct Lobes {
    /// Each mode with its contribution to Φ at unit receptance.
    parts: Vec<(TipMode, Matrix2<f64>)>,
    cutter: Cutter,
    depth_max_m: f64,
    sweep: Vec<Sample>,
}

impl Lobes {
    pub(super) fn new(
        swings: &[TipMode],
        mean: &Matrix3x2<f64>,
        cutter: Cutter,
        depth_max_m: f64,
    ) -> Self {
        let part = |swing: &TipMode| {
            (*swing, in_plane() * swing.direction * (swing.direction.transpose() * mean))
        };
        let parts = swings.iter().map(part).collect();
        let mut lobes = Self { parts, cutter, depth_max_m, sweep: Vec::new() };
        let mut sweep = vec![Sample { omega_rad_s: 0.0, eigenvalues: lobes.eigenvalues(0.0) }];
        for omega_rad_s in lobes.frequencies_rad_s() {
            lobes.extend_to(&mut sweep, omega_rad_s, SUBDIVISIONS);
        }
        lobes.sweep = sweep;
        lobes
    }

    /// Extends a sweep to a frequency, with intermediate ones where an eigenvalue turns.
    fn extend_to(&self, sweep: &mut Vec<Sample>, omega_rad_s: f64, subdivisions: u32) {
        let Some(last) = sweep.last().copied() else { return };
        let next = self.following(&last, omega_rad_s);
        // An eigenvalue that is too small for a limit below the largest depth, as rounding is for a single mode, need not be followed.
        let is_relevant = |a: &Complex<f64>, b: &Complex<f64>| {
            (a.re > 0.0 || b.re > 0.0) && 2.2 * a.norm().max(b.norm()) * self.depth_max_m > 1.0
        };
        let turns = last
            .eigenvalues
            .iter()
            .zip(&next.eigenvalues)
            .any(|(a, b)| is_relevant(a, b) && (b * a.conj()).arg().abs() > ARGUMENT_STEP_RAD);
        if turns && subdivisions > 0 {
            self.extend_to(sweep, 0.5 * (last.omega_rad_s + omega_rad_s), subdivisions - 1);
            self.extend_to(sweep, omega_rad_s, subdivisions - 1);
        } else {
            sweep.push(next);
        }
    }

    /// The sample at a frequency, its eigenvalues in the order of those of the sample before.
    fn following(&self, before: &Sample, omega_rad_s: f64) -> Sample {
        let eigenvalues = match_eigenvalues(before.eigenvalues, self.eigenvalues(omega_rad_s));
        Sample { omega_rad_s, eigenvalues }
    }

    /// The limit at a spindle speed: the lowest of all lobes; `None` if all are above the largest
    /// depth.
    #[must_use]
    pub fn limit(&self, spindle_rpm: f64) -> Option<Limit> {
        let delay_s = self.cutter.delay_s(spindle_rpm);
        let lobe = |omega_rad_s: f64, value: Complex<f64>| {
            let phase = 2.0 * value.re.atan2(-value.im);
            (omega_rad_s * delay_s - phase) / TAU
        };
        let mut best = Limit { depth_m: self.depth_max_m, frequency_hz: f64::NAN };
        for (low, high, branch) in self.intervals() {
            let (a, b) = (low.eigenvalues[branch], high.eigenvalues[branch]);
            // Skips intervals without a lobe below the lowest limit so far: a = 1/(2 Re λ), with a
            // margin for the curvature between the two samples.
            if a.re.max(b.re) <= 0.0 || 2.2 * a.re.max(b.re) * best.depth_m < 1.0 {
                continue;
            }
            let (low, high) = self.part_with_limit(low, high, branch);
            let (a, b) = (low.eigenvalues[branch], high.eigenvalues[branch]);
            let (from, to) = (lobe(low.omega_rad_s, a), lobe(high.omega_rad_s, b));
            let first = from.min(to).ceil().max(0.0) as i64;
            for number in first..=from.max(to).floor() as i64 {
                let number = number as f64;
                let (omega_rad_s, value) =
                    self.refine_crossing(low, high, branch, |omega, value| {
                        lobe(omega, value) - number
                    });
                let depth_m = 0.5 / value.re;
                if depth_m < best.depth_m && depth_m > 0.0 {
                    best = Limit { depth_m, frequency_hz: omega_rad_s / TAU };
                }
            }
        }
        best.frequency_hz.is_finite().then_some(best)
    }

    /// The limit of mode coupling without regeneration, for any spindle speed: the smallest depth
    /// of a coupled vibration, or (at 0 Hz) of a static instability; `None` if it is above the
    /// largest depth.
    #[must_use]
    pub fn mode_coupling(&self) -> Option<Limit> {
        let mut best = Limit { depth_m: self.depth_max_m, frequency_hz: f64::NAN };
        let mut keep = |value: Complex<f64>, omega_rad_s: f64| {
            let depth_m = 1.0 / value.re;
            if value.re > 0.0 && depth_m < best.depth_m {
                best = Limit { depth_m, frequency_hz: omega_rad_s / TAU };
            }
        };
        for value in self.eigenvalues(0.0).into_iter().filter(|value| value.im == 0.0) {
            keep(value, 0.0);
        }
        for (low, high, branch) in self.intervals().filter(|(low, ..)| low.omega_rad_s > 0.0) {
            let (a, b) = (low.eigenvalues[branch], high.eigenvalues[branch]);
            if a.im * b.im < 0.0 && 2.2 * a.norm().max(b.norm()) * self.depth_max_m > 1.0 {
                let (omega, value) = self.refine_crossing(low, high, branch, |_, value| value.im);
                keep(value, omega);
            }
        }
        best.frequency_hz.is_finite().then_some(best)
    }

    /// The smallest limit of all spindle speeds, m; infinite if there is none.
    pub(super) fn min_depth_m(&self) -> f64 {
        let all = self.sweep.iter().flat_map(|sample| sample.eigenvalues);
        0.5 / all.map(|value| value.re).fold(0.0, f64::max)
    }

    /// Pairs of consecutive samples of the sweep, for each of the two eigenvalues.
    fn intervals(&self) -> impl Iterator<Item = (Sample, Sample, usize)> {
        let pairs = self.sweep.windows(2).filter_map(|pair| Some((*pair.first()?, *pair.get(1)?)));
        pairs.flat_map(|(low, high)| [(low, high, 0), (low, high, 1)])
    }

    /// The part of an interval in which the real part of the eigenvalue is positive: beyond its
    /// change of sign, where the limit goes to infinity, there is none.
    fn part_with_limit(&self, low: Sample, high: Sample, branch: usize) -> (Sample, Sample) {
        let is_positive = |sample: &Sample| sample.eigenvalues[branch].re > 0.0;
        let (mut from, mut to) = (low, high);
        if is_positive(&low) == is_positive(&high) {
            return (low, high);
        }
        for _ in 0..HALVINGS {
            let middle = self.following(&from, 0.5 * (from.omega_rad_s + to.omega_rad_s));
            if is_positive(&middle) == is_positive(&low) { from = middle } else { to = middle }
        }
        if is_positive(&low) { (low, from) } else { (to, high) }
    }

    /// Zero of a function of frequency and eigenvalue between two samples, by bisection.
    fn refine_crossing(
        &self,
        low: Sample,
        high: Sample,
        branch: usize,
        value: impl Fn(f64, Complex<f64>) -> f64,
    ) -> (f64, Complex<f64>) {
        let (mut low, mut high) = (low, high);
        let value_at = |sample: &Sample| value(sample.omega_rad_s, sample.eigenvalues[branch]);
        let rises = value_at(&high) > value_at(&low);
        for _ in 0..HALVINGS {
            let middle = self.following(&low, 0.5 * (low.omega_rad_s + high.omega_rad_s));
            if (value_at(&middle) > 0.0) == rises { high = middle } else { low = middle }
        }
        (low.omega_rad_s, low.eigenvalues[branch])
    }

    fn eigenvalues(&self, omega_rad_s: f64) -> [Complex<f64>; 2] {
        let zero = Matrix2::from_element(Complex::new(0.0, 0.0));
        let loop_gain = self.parts.iter().fold(zero, |sum, (swing, part)| {
            let receptance = swing.receptance(omega_rad_s);
            sum + part.map(|x| receptance * x)
        });
        let half = 0.5 * (loop_gain.m11 + loop_gain.m22);
        let apart = 0.5 * (loop_gain.m11 - loop_gain.m22);
        let root = (apart * apart + loop_gain.m12 * loop_gain.m21).sqrt();
        [half + root, half - root]
    }

    /// Frequencies of the sweep; beyond the last one, no lobe is below the largest depth.
    fn frequencies_rad_s(&self) -> Vec<f64> {
        let all = || self.parts.iter().map(|(swing, _)| swing.omega_rad_s);
        let (lowest, highest) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        let gain = |omega: f64| -> f64 {
            self.parts
                .iter()
                .map(|(swing, part)| swing.receptance(omega).norm() * part.norm())
                .sum()
        };
        // The modulus of an eigenvalue does not exceed the norm; a = 1/(2 Re λ).
        let mut top = 3.0 * highest;
        while 2.0 * gain(top) * self.depth_max_m > 1.0 {
            top *= 1.5;
        }
        let bottom = 0.05 * lowest;
        let step = (top / bottom).ln() / f64::from(SWEEP_FREQUENCIES);
        let even = (0..=SWEEP_FREQUENCIES).map(|k| bottom * (step * f64::from(k)).exp());
        let about = self.parts.iter().flat_map(|(swing, _)| {
            let half_width = swing.damping_ratio * swing.omega_rad_s / f64::from(PER_HALF_WIDTH);
            let reach = HALF_WIDTHS * PER_HALF_WIDTH;
            (-reach..=reach).map(move |k| swing.omega_rad_s + f64::from(k) * half_width)
        });
        let mut all: Vec<f64> = even.chain(about).filter(|omega| *omega > 0.0).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }
}

/// Two eigenvalues, ordered such that each is the continuation of the previous one of its branch.
fn match_eigenvalues(before: [Complex<f64>; 2], [a, b]: [Complex<f64>; 2]) -> [Complex<f64>; 2] {
    let straight = (a - before[0]).norm() + (b - before[1]).norm();
    let crossed = (b - before[0]).norm() + (a - before[1]).norm();
    if crossed < straight { [b, a] } else { [a, b] }
}
