//! Fit of the poles of a response function within a narrow band.
//!
//! `H(ω) = Σ A_r/(ω − p_r) + c_0 + c_1 ω + …`: each mode a complex pole `p = ω_d + jσ`, the
//! contribution outside the band a polynomial. Linear initial values (Levy 1959); then Gauss-Newton
//! steps on all unknowns. The function is analytic in its unknowns, so that each step is a complex
//! linear least-squares problem. The covariance of the unknowns follows from the residual, which
//! includes noise and misfit; it is increased if the residual is not white (correlated neighbouring
//! bins).

use super::least_squares::solve;
use realfft::num_complex::Complex;

const ITERATIONS_MAX: usize = 30;
const STEP_HALVINGS_MAX: usize = 8;
/// Convergence: step size relative to the half width of the band.
const STEP_TOLERANCE: f64 = 1e-12;
const LEVY_ITERATIONS: usize = 3;

/// A band of a response function, normalised: frequency from −1 to 1, largest value 1.
#[derive(Clone, Debug)]
pub(super) struct Band {
    points: Vec<(f64, Complex<f64>)>,
    centre_hz: f64,
    half_width_hz: f64,
    scale: f64,
}

/// A pole in Hz, its residue, and their standard uncertainties.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pole {
    /// Damped frequency (real) and decay over 2π (imaginary), Hz.
    pub(super) at_hz: Complex<f64>,
    /// Standard uncertainty of each of the two parts, Hz.
    pub(super) sigma_hz: f64,
    /// Residue with respect to frequency in Hz: unit of the response times Hz.
    pub(super) residue: Complex<f64>,
    /// Relative standard uncertainty of the residue.
    pub(super) residue_sigma: f64,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) poles: Vec<Pole>,
    /// Root mean square residual relative to the root mean square response in the band.
    pub(super) residual: f64,
    /// Frequency of the largest residual within the band, Hz.
    pub(super) worst_hz: f64,
}

struct Unknowns {
    poles: Vec<Complex<f64>>,
    residues: Vec<Complex<f64>>,
    background: Vec<Complex<f64>>,
}

impl Band {
    /// The points between two frequencies; `None` if there are too few.
    pub(super) fn between(
        frequency_hz: &[f64],
        response: &[Complex<f64>],
        from_hz: f64,
        to_hz: f64,
    ) -> Option<Self> {
        let start = frequency_hz.partition_point(|f| *f < from_hz);
        let end = frequency_hz.partition_point(|f| *f <= to_hz).min(response.len());
        let (frequency_hz, response) = (frequency_hz.get(start..end)?, response.get(start..end)?);
        let (first, last) = (frequency_hz.first()?, frequency_hz.last()?);
        let (centre_hz, half_width_hz) = (0.5 * (first + last), 0.5 * (last - first));
        let scale = response.iter().map(|h| h.norm()).fold(0.0, f64::max);
        let usable = half_width_hz > 0.0 && scale > 0.0 && scale.is_finite();
        let points = frequency_hz.iter().zip(response);
        let points = points.map(|(f, h)| ((f - centre_hz) / half_width_hz, h / scale)).collect();
        usable.then_some(Self { points, centre_hz, half_width_hz, scale })
    }

    /// Fits one pole without a start value, with a polynomial of this degree.
    pub(super) fn fit_one_pole(&self, degree: usize) -> Option<Fit> {
        let start = self.levy(degree)?;
        self.gauss_newton(vec![start], degree)
    }

    /// Fits one pole per start value (Hz), with a polynomial of this degree.
    pub(super) fn fit_poles(&self, starts_hz: &[Complex<f64>], degree: usize) -> Option<Fit> {
        let normalised = |p: &Complex<f64>| (p - self.centre_hz) / self.half_width_hz;
        self.gauss_newton(starts_hz.iter().map(normalised).collect(), degree)
    }

    /// `H (v − p) = N(v)` is linear in `p` and the polynomial; division by the previous iteration's
    /// `v − p` weights all points equally (Sanathanan and Koerner 1963).
    fn levy(&self, degree: usize) -> Option<Complex<f64>> {
        let mut pole = None;
        for _ in 0..LEVY_ITERATIONS {
            let weight =
                |v: f64| pole.map_or(1.0, |p: Complex<f64>| 1.0 / (v - p).norm().max(1e-6));
            let mut columns = vec![self.points.iter().map(|(v, h)| h * weight(*v)).collect()];
            for k in 0..=degree as i32 + 1 {
                let power = |(v, _): &(f64, _)| Complex::from(v.powi(k) * weight(*v));
                columns.push(self.points.iter().map(power).collect());
            }
            let right: Vec<_> = self.points.iter().map(|(v, h)| h * (v * weight(*v))).collect();
            pole = Some(solve(&columns, &right)?.unknowns[0]);
        }
        pole.filter(|p| p.im > 0.0 && p.re.abs() < 1.0)
    }

    fn gauss_newton(&self, poles: Vec<Complex<f64>>, degree: usize) -> Option<Fit> {
        let count = poles.len();
        if self.points.len() < 2 * (2 * count + degree + 1) {
            return None;
        }
        let mut current = self.solve_residues(poles, degree)?;
        let mut sum_squares = self.sum_of_squares(&current);
        let mut variance = Vec::new();
        for _ in 0..ITERATIONS_MAX {
            let solution = solve(&self.derivatives(&current), &self.residual(&current))?;
            variance = solution.variance;
            let mut part = 1.0;
            let mut next = None;
            for _ in 0..STEP_HALVINGS_MAX {
                let candidate = current.stepped(&solution.unknowns, part);
                let squares = self.sum_of_squares(&candidate);
                if squares < sum_squares && candidate.poles.iter().all(|p| p.im > 0.0) {
                    next = Some((candidate, squares));
                    break;
                }
                part *= 0.5;
            }
            let Some((tried, squares)) = next else { break };
            let moved = solution.unknowns.iter().take(count).map(|x| x.norm()).fold(0.0, f64::max);
            (current, sum_squares) = (tried, squares);
            if moved * part < STEP_TOLERANCE {
                break;
            }
        }
        Some(self.fit_result(&current, sum_squares, &variance))
    }

    fn fit_result(&self, unknowns: &Unknowns, sum_squares: f64, variance: &[f64]) -> Fit {
        let count = unknowns.poles.len();
        let parameters = 2 * count + unknowns.background.len();
        let residuals = self.residual(unknowns);
        let noise = sum_squares / (self.points.len() - parameters) as f64
            * autocorrelation_factor(&residuals);
        let pole = |k: usize| Pole {
            at_hz: self.centre_hz + unknowns.poles[k] * self.half_width_hz,
            // Half of the variance is in each part of the complex number.
            sigma_hz: (0.5 * noise * variance[k]).sqrt() * self.half_width_hz,
            residue: unknowns.residues[k] * self.scale * self.half_width_hz,
            residue_sigma: (0.5 * noise * variance[count + k]).sqrt() / unknowns.residues[k].norm(),
        };
        let whole: f64 = self.points.iter().map(|(_, h)| h.norm_sqr()).sum();
        let worst = (0..residuals.len())
            .max_by(|a, b| residuals[*a].norm().total_cmp(&residuals[*b].norm()));
        Fit {
            poles: (0..count).map(pole).collect(),
            residual: (sum_squares / whole).sqrt(),
            worst_hz: self.centre_hz + self.half_width_hz * worst.map_or(0.0, |i| self.points[i].0),
        }
    }

    /// Residues and background polynomial for given poles.
    fn solve_residues(&self, poles: Vec<Complex<f64>>, degree: usize) -> Option<Unknowns> {
        let mut columns: Vec<Vec<Complex<f64>>> = Vec::new();
        for p in &poles {
            columns.push(self.points.iter().map(|(v, _)| (v - p).inv()).collect());
        }
        columns.extend(self.powers(degree));
        let right: Vec<_> = self.points.iter().map(|(_, h)| *h).collect();
        let mut residues = solve(&columns, &right)?.unknowns;
        let background = residues.split_off(poles.len());
        Some(Unknowns { poles, residues, background })
    }

    fn powers(&self, degree: usize) -> impl Iterator<Item = Vec<Complex<f64>>> + '_ {
        (0..=degree as i32)
            .map(|k| self.points.iter().map(|(v, _)| Complex::from(v.powi(k))).collect())
    }

    /// Derivatives with respect to the unknowns, in the order of [`Unknowns::stepped`].
    fn derivatives(&self, unknowns: &Unknowns) -> Vec<Vec<Complex<f64>>> {
        let over = |p: Complex<f64>, power: u32| {
            self.points.iter().map(move |(v, _)| (v - p).inv().powu(power))
        };
        let mut columns: Vec<Vec<_>> = Vec::new();
        for (p, a) in unknowns.poles.iter().zip(&unknowns.residues) {
            columns.push(over(*p, 2).map(|x| a * x).collect());
        }
        columns.extend(unknowns.poles.iter().map(|p| over(*p, 1).collect()));
        columns.extend(self.powers(unknowns.background.len() - 1));
        columns
    }

    fn residual(&self, unknowns: &Unknowns) -> Vec<Complex<f64>> {
        self.points.iter().map(|(v, h)| h - unknowns.value(*v)).collect()
    }

    fn sum_of_squares(&self, unknowns: &Unknowns) -> f64 {
        self.residual(unknowns).iter().map(Complex::norm_sqr).sum()
    }
}

impl Unknowns {
    fn value(&self, v: f64) -> Complex<f64> {
        let modes = self.poles.iter().zip(&self.residues).map(|(p, a)| a / (v - p));
        let smooth = self.background.iter().rev().fold(Complex::default(), |sum, c| sum * v + c);
        modes.sum::<Complex<f64>>() + smooth
    }

    fn stepped(&self, step: &[Complex<f64>], fraction: f64) -> Self {
        let count = self.poles.len();
        let moved = |from: &[Complex<f64>], by: &[Complex<f64>]| {
            from.iter().zip(by).map(|(x, d)| x + d * fraction).collect::<Vec<_>>()
        };
        Self {
            poles: moved(&self.poles, &step[..count]),
            residues: moved(&self.residues, &step[count..2 * count]),
            background: moved(&self.background, &step[2 * count..]),
        }
    }
}

/// Variance relative to white noise for residuals with this correlation between neighbouring bins,
/// 1 to 19: `(1 + ρ)/(1 − ρ)`.
fn autocorrelation_factor(residuals: &[Complex<f64>]) -> f64 {
    let variance: f64 = residuals.iter().map(Complex::norm_sqr).sum();
    let covariance: Complex<f64> = residuals.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
    let correlation = if variance > 0.0 { (covariance.re / variance).clamp(0.0, 0.9) } else { 0.0 };
    (1.0 + correlation) / (1.0 - correlation)
}
