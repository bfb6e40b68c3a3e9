//! Polarisation of the force in the x-y plane at one frequency: line, ellipse, sense of rotation.
//!
//! Averages the Stokes parameters of the complex pair (X, Y):
//! s0 = |X|² + |Y|², s1 = |X|² − |Y|², s2 = 2 Re XY*, s3 = 2 Im XY*.
//! |s3|/s0 is 0 for a line and 1 for a circle; its sign is the sense of rotation, so that it averages to 0 if the sense changes. Coherence |⟨XY*⟩|² / (⟨|X|²⟩⟨|Y|²⟩) is meaningful only over several disjoint windows. Source: Born and Wolf, section 1.4; limits: research note, section 2.6.

use realfft::num_complex::Complex;

/// Length of the average, in disjoint windows.
const WINDOWS: f64 = 5.0;

/// Averaged Stokes parameters.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ellipse {
    stokes: [f64; 4],
    windows: f64,
}

impl Ellipse {
    /// Adds one pair, `windows` (a fraction of one) after the previous one.
    pub(crate) fn add(&mut self, x: Complex<f64>, y: Complex<f64>, windows: f64) {
        let cross = x * y.conj();
        let (xx, yy) = (x.norm_sqr(), y.norm_sqr());
        let new = [xx + yy, xx - yy, 2.0 * cross.re, 2.0 * cross.im];
        // An arithmetic mean at first, exponential forgetting later.
        self.windows += windows;
        let follow = (windows / self.windows.min(WINDOWS)).min(1.0);
        for (mean, new) in self.stokes.iter_mut().zip(new) {
            *mean += follow * (new - *mean);
        }
    }

    /// Whether enough disjoint windows were averaged.
    pub(crate) fn is_known(&self) -> bool {
        self.windows >= WINDOWS
    }

    /// Coherence of x and y, 0 to 1.
    pub(crate) fn coherence(&self) -> f64 {
        let [s0, s1, s2, s3] = self.stokes;
        let product = (s0 + s1) * (s0 - s1);
        if product > 0.0 { ((s2 * s2 + s3 * s3) / product).min(1.0) } else { 0.0 }
    }

    /// Ellipticity, −1 to 1: 0 a line, ±1 a circle; the sign is the sense of rotation.
    pub(crate) fn roundness(&self) -> f64 {
        if self.stokes[0] > 0.0 { self.stokes[3] / self.stokes[0] } else { 0.0 }
    }

    /// Whether the force vector rotates on an ellipse in a constant sense.
    pub(crate) fn rotates(&self) -> bool {
        self.is_known() && self.coherence() > 0.8 && self.roundness().abs() > 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn averaged(pair: impl Fn(u32) -> (Complex<f64>, Complex<f64>)) -> Ellipse {
        let mut ellipse = Ellipse::default();
        for k in 0..80 {
            let (x, y) = pair(k);
            ellipse.add(x, y, 0.125);
        }
        ellipse
    }

    #[test]
    fn circle_line_and_wandering_pair_are_distinguished() {
        let turn = |angle: f64| Complex::from_polar(2.0, angle);
        let circle = averaged(|k| (turn(f64::from(k)), turn(f64::from(k) - FRAC_PI_2)));
        assert!(circle.rotates() && circle.roundness().abs() > 0.99);
        let line = averaged(|k| (turn(f64::from(k)), turn(f64::from(k))));
        assert!(!line.rotates() && line.coherence() > 0.99 && line.roundness().abs() < 1e-9);
        let wandering = averaged(|k| (turn(f64::from(k)), turn(2.7 * f64::from(k * k))));
        assert!(!wandering.rotates() && wandering.coherence() < 0.5, "{}", wandering.coherence());
    }
}
