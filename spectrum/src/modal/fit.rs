//! Poles of a response function within a narrow band.
//!
//! `H(ω) = Σ A_r/(ω − p_r) + c_0 + c_1 ω + …`: each mode a complex pole `p = ω_d + jσ`, the contribution outside the band a
//! polynomial. Linear initial values (Levy 1959); then Gauss-Newton steps on all unknowns. The function
//! is analytic in its unknowns, so that the steps are least squares in complex numbers. The covariance of the unknowns
//! follows from the residual, which includes noise and misfit; it is increased if the residual is not white (correlated neighbouring
//! bins).

use super::least_squares::solve;
use realfft::num_complex::Complex;

const STEPS: usize = 30;
const HALVINGS: usize = 8;
/// Steps smaller than this, as a part of the band's half width, end the search.
const STILL: f64 = 1e-12;
const LEVY_ROUNDS: usize = 3;

/// A band of a response function, in units that suit it: frequency from −1 to 1, largest value 1.
#[derive(Clone, Debug)]
pub(super) struct Band {
    points: Vec<(f64, Complex<f64>)>,
    centre_hz: f64,
    half_hz: f64,
    size: f64,
}

/// A pole in Hz: natural turn and decay over 2π, its residue, and their standard uncertainties.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pole {
    /// Damped frequency (real) and decay over 2π (imaginary), Hz.
    pub(super) at_hz: Complex<f64>,
    /// Standard uncertainty of each of the two parts, Hz.
    pub(super) sigma_hz: f64,
    /// Residue over frequency in Hz: the response's unit times Hz.
    pub(super) residue: Complex<f64>,
    /// Standard uncertainty of the residue as a part of it.
    pub(super) residue_sigma: f64,
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) poles: Vec<Pole>,
    /// Root mean square residual relative to that of the band.
    pub(super) residual: f64,
    /// Frequency of the largest residual within the band, Hz.
    pub(super) worst_hz: f64,
}

struct Unknowns {
    poles: Vec<Complex<f64>>,
    residues: Vec<Complex<f64>>,
    smooth: Vec<Complex<f64>>,
}

impl Band {
    /// The points between two frequencies; `None` if there are too few.
    pub(super) fn of(
        frequency_hz: &[f64],
        response: &[Complex<f64>],
        from_hz: f64,
        to_hz: f64,
    ) -> Option<Self> {
        let start = frequency_hz.partition_point(|f| *f < from_hz);
        let end = frequency_hz.partition_point(|f| *f <= to_hz).min(response.len());
        let (frequency_hz, response) = (frequency_hz.get(start..end)?, response.get(start..end)?);
        let (first, last) = (frequency_hz.first()?, frequency_hz.last()?);
        let (centre_hz, half_hz) = (0.5 * (first + last), 0.5 * (last - first));
        let size = response.iter().map(|h| h.norm()).fold(0.0, f64::max);
        let usable = half_hz > 0.0 && size > 0.0 && size.is_finite();
        let points = frequency_hz.iter().zip(response);
        let points = points.map(|(f, h)| ((f - centre_hz) / half_hz, h / size)).collect();
        usable.then_some(Self { points, centre_hz, half_hz, size })
    }

    /// Fits one pole without a start value, with a polynomial of this degree.
    pub(super) fn one_pole(&self, degree: usize) -> Option<Fit> {
        let start = self.levy(degree)?;
        self.refined(vec![start], degree)
    }

    /// Fits one pole per start value (Hz), with a polynomial of this degree.
    pub(super) fn poles_from(&self, starts_hz: &[Complex<f64>], degree: usize) -> Option<Fit> {
        let own = |p: &Complex<f64>| (p - self.centre_hz) / self.half_hz;
        self.refined(starts_hz.iter().map(own).collect(), degree)
    }

    /// `H (v − p) = N(v)` is linear in `p` and the polynomial; divided by the last round's `v − p` it weighs all
    /// points alike (Sanathanan and Koerner 1963).
    fn levy(&self, degree: usize) -> Option<Complex<f64>> {
        let mut pole = None;
        for _ in 0..LEVY_ROUNDS {
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

    fn refined(&self, poles: Vec<Complex<f64>>, degree: usize) -> Option<Fit> {
        let count = poles.len();
        if self.points.len() < 2 * (2 * count + degree + 1) {
            return None;
        }
        let mut now = self.linear(poles, degree)?;
        let mut left = self.squares(&now);
        let mut variance = Vec::new();
        for _ in 0..STEPS {
            let solution = solve(&self.derivatives(&now), &self.rest(&now))?;
            variance = solution.variance;
            let mut part = 1.0;
            let mut next = None;
            for _ in 0..HALVINGS {
                let tried = now.moved(&solution.unknowns, part);
                let squares = self.squares(&tried);
                if squares < left && tried.poles.iter().all(|p| p.im > 0.0) {
                    next = Some((tried, squares));
                    break;
                }
                part *= 0.5;
            }
            let Some((tried, squares)) = next else { break };
            let moved = solution.unknowns.iter().take(count).map(|x| x.norm()).fold(0.0, f64::max);
            (now, left) = (tried, squares);
            if moved * part < STILL {
                break;
            }
        }
        Some(self.told(&now, left, &variance))
    }

    fn told(&self, now: &Unknowns, left: f64, variance: &[f64]) -> Fit {
        let count = now.poles.len();
        let unknowns = 2 * count + now.smooth.len();
        let rest = self.rest(now);
        let noise = left / (self.points.len() - unknowns) as f64 * neighbourly(&rest);
        let pole = |k: usize| Pole {
            at_hz: self.centre_hz + now.poles[k] * self.half_hz,
            // Half of a complex number's variance is in each of its parts.
            sigma_hz: (0.5 * noise * variance[k]).sqrt() * self.half_hz,
            residue: now.residues[k] * self.size * self.half_hz,
            residue_sigma: (0.5 * noise * variance[count + k]).sqrt() / now.residues[k].norm(),
        };
        let whole: f64 = self.points.iter().map(|(_, h)| h.norm_sqr()).sum();
        let worst = (0..rest.len()).max_by(|a, b| rest[*a].norm().total_cmp(&rest[*b].norm()));
        Fit {
            poles: (0..count).map(pole).collect(),
            residual: (left / whole).sqrt(),
            worst_hz: self.centre_hz + self.half_hz * worst.map_or(0.0, |i| self.points[i].0),
        }
    }

    /// Residues and polynomial for given poles.
    fn linear(&self, poles: Vec<Complex<f64>>, degree: usize) -> Option<Unknowns> {
        let mut columns: Vec<Vec<Complex<f64>>> = Vec::new();
        for p in &poles {
            columns.push(self.points.iter().map(|(v, _)| (v - p).inv()).collect());
        }
        columns.extend(self.powers(degree));
        let right: Vec<_> = self.points.iter().map(|(_, h)| *h).collect();
        let mut residues = solve(&columns, &right)?.unknowns;
        let smooth = residues.split_off(poles.len());
        Some(Unknowns { poles, residues, smooth })
    }

    fn powers(&self, degree: usize) -> impl Iterator<Item = Vec<Complex<f64>>> + '_ {
        (0..=degree as i32)
            .map(|k| self.points.iter().map(|(v, _)| Complex::from(v.powi(k))).collect())
    }

    /// By each unknown in the order of [`Unknowns::moved`].
    fn derivatives(&self, at: &Unknowns) -> Vec<Vec<Complex<f64>>> {
        let over = |p: Complex<f64>, power: u32| {
            self.points.iter().map(move |(v, _)| (v - p).inv().powu(power))
        };
        let mut columns: Vec<Vec<_>> = Vec::new();
        for (p, a) in at.poles.iter().zip(&at.residues) {
            columns.push(over(*p, 2).map(|x| a * x).collect());
        }
        columns.extend(at.poles.iter().map(|p| over(*p, 1).collect()));
        columns.extend(self.powers(at.smooth.len() - 1));
        columns
    }

    fn rest(&self, at: &Unknowns) -> Vec<Complex<f64>> {
        self.points.iter().map(|(v, h)| h - at.value(*v)).collect()
    }

    fn squares(&self, at: &Unknowns) -> f64 {
        self.rest(at).iter().map(Complex::norm_sqr).sum()
    }
}

impl Unknowns {
    fn value(&self, v: f64) -> Complex<f64> {
        let modes = self.poles.iter().zip(&self.residues).map(|(p, a)| a / (v - p));
        let smooth = self.smooth.iter().rev().fold(Complex::default(), |sum, c| sum * v + c);
        modes.sum::<Complex<f64>>() + smooth
    }

    fn moved(&self, by: &[Complex<f64>], part: f64) -> Self {
        let count = self.poles.len();
        let moved = |from: &[Complex<f64>], by: &[Complex<f64>]| {
            from.iter().zip(by).map(|(x, d)| x + d * part).collect::<Vec<_>>()
        };
        Self {
            poles: moved(&self.poles, &by[..count]),
            residues: moved(&self.residues, &by[count..2 * count]),
            smooth: moved(&self.smooth, &by[2 * count..]),
        }
    }
}

/// How many times wider than for white noise the scatter is, by the correlation of neighbours in the rest: 1 to 20.
fn neighbourly(rest: &[Complex<f64>]) -> f64 {
    let own: f64 = rest.iter().map(Complex::norm_sqr).sum();
    let beside: Complex<f64> = rest.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
    let together = if own > 0.0 { (beside.re / own).clamp(0.0, 0.9) } else { 0.0 };
    (1.0 + together) / (1.0 - together)
}
