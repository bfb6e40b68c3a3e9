//! Detection of the cut by the level of the forces: tool in air or in the cut.
//!
//! Used if the cell does not report it. Mean and variance of the force channels over 64 ms are
//! compared with the quietest values so far: a variance 8 dB higher, or a mean six standard
//! deviations away, is a cut. A cut ends at the quiet level, or 14 dB below its own level, where
//! the tool only rubs. A stream that begins in the cut is taken as air until it becomes quieter.

use crate::config::MonitorConfig;

const PERIOD_S: f64 = 0.064;
const FORCES: usize = 3;
/// Energy below which the tool only rubs, relative to that of the cut.
const RUBBING_PART: f64 = 0.04;
/// Decay of the stored cut energy per period in air: by half in 1.5 s.
const CUT_ENERGY_DECAY: f64 = 0.03;

/// State of the tool; each state has a separate noise floor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum CutState {
    #[default]
    Air,
    Cut,
}

/// Detector of the cut: sums over the present period, and level of the quietest period so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForceLevel {
    period: u32,
    count: u32,
    sums: [(f64, f64); FORCES],
    variance_min: f64,
    quiet: Option<(f64, [f64; FORCES])>,
    present: CutState,
    cut_energy: f64,
    cut_seen: bool,
    energy: f64,
}

impl ForceLevel {
    pub(crate) fn new(config: &MonitorConfig) -> Self {
        Self {
            period: (PERIOD_S * config.rate_hz) as u32,
            count: 0,
            sums: [(0.0, 0.0); FORCES],
            variance_min: config.least_amplitude_n.powi(2).max(1e-12),
            quiet: None,
            present: CutState::Air,
            cut_energy: 0.0,
            cut_seen: false,
            energy: 0.0,
        }
    }

    /// Adds one sample of a channel; moments are ignored.
    #[inline]
    pub(crate) fn add_sample(&mut self, channel: usize, sample: f64) {
        if let Some((sum, squares)) = self.sums.get_mut(channel) {
            // Relative to the quiet mean, so that a large offset does not reduce the accuracy of
            // the variance.
            let x = sample - self.quiet.map_or(0.0, |(_, means)| means[channel]);
            *sum += x;
            *squares += x * x;
        }
    }

    /// Advances by `run` samples per channel.
    pub(crate) fn advance(&mut self, run: usize) {
        self.count += run as u32;
        if self.count >= self.period {
            self.end_period();
        }
    }

    fn end_period(&mut self) {
        let n = f64::from(self.count);
        let around = self.quiet.map_or([0.0; FORCES], |(_, means)| means);
        let deviations = self.sums.map(|(sum, _)| sum / n);
        let variance: f64 =
            self.sums.iter().map(|(sum, squares)| (squares - sum * sum / n).max(0.0) / n).sum();
        let distance: f64 = deviations.iter().map(|d| d * d).sum();
        let means: [f64; FORCES] = std::array::from_fn(|c| around[c] + deviations[c]);
        self.sums = [(0.0, 0.0); FORCES];
        self.count = 0;
        let Some((quiet, quiet_means)) = &mut self.quiet else {
            self.quiet = Some((variance, means));
            return;
        };
        let spread = *quiet + self.variance_min;
        let (variance_ratio, distance_ratio) = match self.present {
            CutState::Air => (6.0, 36.0),
            CutState::Cut => (3.0, 16.0),
        };
        let above = variance > variance_ratio * spread || distance > distance_ratio * spread;
        let energy = variance + distance;
        self.energy = energy;
        let cuts = above && energy > RUBBING_PART * self.cut_energy;
        self.present = if cuts { CutState::Cut } else { CutState::Air };
        // The level of a cut decays over a few seconds, so that a lighter cut is detected again.
        let follow = if cuts { 0.1 } else { CUT_ENERGY_DECAY };
        let level = if cuts { energy } else { 0.0 };
        self.cut_energy += follow * (level - self.cut_energy);
        self.cut_seen |= cuts;
        // Much quieter than before: the stream began in the cut.
        let quieter = variance < 0.25 * *quiet;
        if !above || quieter {
            let follow = if quieter { 1.0 } else { 0.05 };
            *quiet += follow * (variance - *quiet);
            for (mean, new) in quiet_means.iter_mut().zip(means) {
                *mean += follow * (new - *mean);
            }
        }
    }

    /// Mean square of the forces relative to those in air over the newest whole period, all force
    /// channels together, N²: variance plus squared mean. For a sensor without a static response
    /// (piezoelectric, acceleration) the variance.
    pub(crate) fn energy(&self) -> f64 {
        self.energy
    }

    /// The present state of the tool.
    pub(crate) fn cut_state(&self) -> CutState {
        self.present
    }

    /// Whether a cut was detected at least once; before, the state `Air` is an assumption.
    pub(crate) fn has_seen_cut(&self) -> bool {
        self.cut_seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(level: &mut ForceLevel, seconds: f64, mean: f64, swing: f64) {
        for i in 0..(seconds * 1000.0) as usize {
            level.add_sample(0, mean + swing * (1.1 * i as f64).sin());
            level.add_sample(1, 5000.0 + 0.5 * (1.7 * i as f64).sin());
            level.advance(1);
        }
    }

    #[test]
    fn a_cut_is_detected_by_mean_or_variance() {
        for (mean, swing) in [(30.0, 0.5), (0.0, 10.0)] {
            let config = MonitorConfig { rate_hz: 1000.0, ..MonitorConfig::default() };
            let mut level = ForceLevel::new(&config);
            run(&mut level, 1.0, 0.0, 0.5);
            assert_eq!((level.cut_state(), level.has_seen_cut()), (CutState::Air, false));
            run(&mut level, 1.0, mean, swing);
            assert_eq!(level.cut_state(), CutState::Cut);
            run(&mut level, 1.0, 0.0, 0.5);
            assert_eq!((level.cut_state(), level.has_seen_cut()), (CutState::Air, true));
        }
    }
}
