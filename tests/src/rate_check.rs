//! Check of the rate limit of a correction in real time.
//!
//! A leaky bucket: it is filled by the motion and leaks at the rate limit. Its size is the motion
//! that the daemon may make up for after a pause (20 ms of real time), so that a late thread is
//! accepted and a step is not.

/// Time that the daemon may make up for at once, s.
const BURST_S: f64 = 0.021;
/// Rounding, rad.
const ROUNDING: f64 = 1e-9;

/// Checks all joints of one correction.
#[derive(Clone, Debug)]
pub struct RateCheck {
    rate: Vec<f64>,
    level: Vec<f64>,
    before: Option<(u64, Vec<f64>)>,
    /// Largest fill of a bucket so far, relative to its size.
    pub fullest: f64,
}

impl RateCheck {
    /// Allows `rate` (rad/s) per joint.
    #[must_use]
    pub fn new(rate: &[f64]) -> Self {
        Self { rate: rate.to_vec(), level: vec![0.0; rate.len()], before: None, fullest: 0.0 }
    }

    /// Adds the correction at that time.
    ///
    /// # Errors
    /// A description, if it moved faster than allowed.
    pub fn take(&mut self, t_ns: u64, correction: &[f64]) -> Result<(), String> {
        let Some((before_ns, before)) = self.before.replace((t_ns, correction.to_vec())) else {
            return Ok(());
        };
        let dt_s = t_ns.saturating_sub(before_ns) as f64 * 1e-9;
        let mut broken = Ok(());
        for i in 0..self.rate.len() {
            let moved = (correction[i] - before[i]).abs();
            let leaked = (self.level[i] + moved - self.rate[i] * dt_s).max(0.0);
            let size = self.rate[i] * BURST_S + ROUNDING;
            self.level[i] = leaked;
            self.fullest = self.fullest.max(leaked / size);
            if !moved.is_finite() || leaked > size {
                self.level[i] = 0.0;
                broken = Err(format!("joint {i} moved by {moved:.3e} in {dt_s:.6} s"));
            }
        }
        broken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_breaks_and_a_ramp_with_jitter_does_not() {
        let mut gauge = RateCheck::new(&[0.05]);
        for k in 0..1000_u64 {
            let late_ns = (k % 7) * 1_000_000;
            assert_eq!(gauge.take(k * 1_000_000 + late_ns, &[5e-5 * k as f64]), Ok(()), "{k}");
        }
        assert!(gauge.take(1_001_000_000, &[0.06]).is_err());
        assert!(gauge.take(1_002_000_000, &[f64::NAN]).is_err());
    }
}
