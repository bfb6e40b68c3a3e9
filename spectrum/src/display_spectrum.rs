//! Force spectrum for displays: one window, bins of equal width over the whole band.
//!
//! Separate from [`crate::VibrationMonitor`], whose windows differ below and above 160 Hz, with the
//! spindle harmonics removed below: a display shows the forces as measured, also without a monitor.
//! [`DisplaySpectrum::new`] plans and allocates; [`DisplaySpectrum::push`] and
//! [`DisplaySpectrum::amplitudes`] neither allocate nor panic.
//!
//! Amplitudes are peak values of tones. Between two bins the Hann window reads up to 15 % too low;
//! maxima are therefore interpolated by a parabola through the logarithms of three bins, as in the
//! monitor.

use crate::block::Block;
use crate::config::MonitorConfig;
use crate::history::History;
use crate::peak::Grid;
use crate::transform::Transform;
use realfft::RealFftPlanner;

/// Number of force channels; moments follow.
const FORCES: usize = 3;
/// Length of the window, s, before it is rounded to a power of two of samples: bins of 5 Hz; at ten
/// spectra per second, consecutive windows overlap by half, so that short events are not missed.
const WINDOW_S: f64 = 0.2;

/// The bins of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinLayout {
    /// Centre of the first bin, Hz.
    pub first_hz: f64,
    /// Width of a bin, Hz.
    pub bin_hz: f64,
    /// Number of bins.
    pub count: usize,
    /// Length of the window, s.
    pub window_s: f64,
}

/// The newest force samples, and the transform over them.
pub struct DisplaySpectrum {
    channels: usize,
    samples: usize,
    rate_hz: f64,
    transform: Transform,
    histories: Vec<History>,
    power: Vec<f64>,
    /// The first bin of the transform that is used, and the number of its bins per bin of the
    /// spectrum.
    first: usize,
    group: usize,
    count: usize,
    /// Session and number of samples before the next block if it is consecutive; otherwise the
    /// window is cleared.
    expected_block: Option<(u64, u64)>,
    end_ns: u64,
}

impl DisplaySpectrum {
    /// Plans for a validated configuration, with at most `bins_max` bins.
    #[must_use]
    pub fn new(config: &MonitorConfig, bins_max: usize) -> Self {
        let exponent = (WINDOW_S * config.rate_hz).log2().round() as u32;
        let samples = 1_usize << exponent.clamp(5, 16);
        let transform = Transform::new(&mut RealFftPlanner::new(), samples, 1, true);
        let step_hz = config.rate_hz / samples as f64;
        let first = ((config.band_hz[0] / step_hz).round() as usize).clamp(1, samples / 2);
        let last = ((config.band_top_hz() / step_hz).round() as usize).clamp(first, samples / 2);
        let used = last - first + 1;
        let group = used.div_ceil(bins_max.max(1));
        let forces = config.channels.min(FORCES);
        Self {
            channels: config.channels,
            samples,
            rate_hz: config.rate_hz,
            transform,
            histories: (0..forces).map(|_| History::new(samples)).collect(),
            power: vec![0.0; samples / 2 + 1],
            first,
            group,
            count: used.div_ceil(group),
            expected_block: None,
            end_ns: 0,
        }
    }

    /// The layout of the bins.
    #[must_use]
    pub fn bins(&self) -> BinLayout {
        let step_hz = self.rate_hz / self.samples as f64;
        BinLayout {
            first_hz: (self.first as f64 + 0.5 * (self.group - 1) as f64) * step_hz,
            bin_hz: self.group as f64 * step_hz,
            count: self.count,
            window_s: self.samples as f64 / self.rate_hz,
        }
    }

    /// Time of the last sample taken.
    #[must_use]
    pub fn end_ns(&self) -> u64 {
        self.end_ns
    }

    /// Removes all samples.
    pub fn clear(&mut self) {
        self.histories.iter_mut().for_each(History::clear);
        self.expected_block = None;
    }

    /// Adds a block that the sensor checks have accepted. A gap clears the window; samples that are
    /// not finite are replaced by zero.
    pub fn push(&mut self, block: &Block<'_>) {
        if block.channels != self.channels {
            return;
        }
        let frames = block.samples.len() / self.channels;
        let before = block.samples_before.unwrap_or(0);
        if block.samples_before.is_some() && self.expected_block != Some((block.session, before)) {
            self.clear();
        }
        self.expected_block = Some((block.session, before.saturating_add(frames as u64)));
        let length_ns = 1e9 * frames as f64 / self.rate_hz;
        self.end_ns = block.t_ns.saturating_add(length_ns as u64);
        for (channel, history) in self.histories.iter_mut().enumerate() {
            for frame in block.samples.chunks_exact(self.channels) {
                let sample = frame[channel];
                history.push(if sample.is_finite() { sample } else { 0.0 });
            }
        }
    }

    /// Writes the amplitude of each bin, N, over the newest window: the largest of the force
    /// channels and of the frequencies in the bin. Returns false, and writes nothing, until there
    /// are enough samples.
    pub fn amplitudes(&mut self, to: &mut [f64]) -> bool {
        if self.histories.iter().any(|history| history.newest(self.samples).is_none()) {
            return false;
        }
        to.fill(0.0);
        let grid =
            Grid { bin_hz: self.rate_hz / self.samples as f64, bins_per_cell: 1.0, first: 0 };
        for history in &self.histories {
            let Some(samples) = history.newest(self.samples) else { continue };
            let spectrum = self.transform.run(samples);
            for (power, bin) in self.power.iter_mut().zip(spectrum) {
                *power = bin.norm_sqr();
            }
            let last = (self.first + self.count * self.group).min(spectrum.len());
            for index in self.first..last {
                let is_peak = index > 0
                    && self.power[index - 1] < self.power[index]
                    && self.power.get(index + 1).is_some_and(|next| *next <= self.power[index]);
                let power = if is_peak {
                    grid.measure(&self.power, spectrum, index).power
                } else {
                    self.power[index]
                };
                if let Some(bin) = to.get_mut((index - self.first) / self.group) {
                    *bin = bin.max(power);
                }
            }
        }
        to.iter_mut().for_each(|amplitude| *amplitude = amplitude.sqrt());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const BINS_MAX: usize = 256;

    fn overview(rate_hz: f64, top_hz: f64) -> DisplaySpectrum {
        let config = MonitorConfig { rate_hz, band_hz: [10.0, top_hz], ..MonitorConfig::default() };
        DisplaySpectrum::new(&config, BINS_MAX)
    }

    /// Half a second in blocks of 100 samples: a load of 200 N on all channels, and `tone` on y.
    fn feed(overview: &mut DisplaySpectrum, rate_hz: f64, tone: impl Fn(f64) -> f64) {
        for seq in 0..(rate_hz / 200.0) as u64 {
            let frame = |i: u64| {
                let t_s = (100 * seq + i) as f64 / rate_hz;
                [200.0, 200.0 + tone(t_s), 200.0]
            };
            let samples: Vec<f64> = (0..100).flat_map(frame).collect();
            overview.push(&Block {
                session: 1,
                seq,
                samples_before: Some(100 * seq),
                t_ns: (1e9 * 100.0 * seq as f64 / rate_hz) as u64,
                rate_hz,
                channels: 3,
                samples: &samples,
            });
        }
    }

    fn spectrum(rate_hz: f64, top_hz: f64, tone: impl Fn(f64) -> f64) -> (BinLayout, Vec<f64>) {
        let mut overview = overview(rate_hz, top_hz);
        feed(&mut overview, rate_hz, tone);
        let mut amplitudes = vec![f64::NAN; BINS_MAX];
        assert!(overview.amplitudes(&mut amplitudes));
        (overview.bins(), amplitudes)
    }

    fn bin_of(bins: BinLayout, hz: f64) -> usize {
        ((hz - bins.first_hz) / bins.bin_hz).round() as usize
    }

    #[test]
    fn a_tone_stands_in_its_bin_with_its_amplitude_wherever_it_is_between_two() {
        for (rate_hz, top_hz) in [(1000.0, 450.0), (10_000.0, 1000.0), (10_000.0, 4500.0)] {
            for tenth in 0..30 {
                let hz = 173.0 + 0.37 * f64::from(tenth);
                let (bins, found) = spectrum(rate_hz, top_hz, |t_s| 3.5 * (TAU * hz * t_s).sin());
                let tone_bin = bin_of(bins, hz);
                assert!(
                    (found[tone_bin] / 3.5 - 1.0).abs() < 0.02,
                    "{hz} Hz of {rate_hz}: {}",
                    found[tone_bin]
                );
                let is_distant = |(bin, _): &(usize, &f64)| bin.abs_diff(tone_bin) > 4;
                let leakage = found
                    .iter()
                    .enumerate()
                    .filter(is_distant)
                    .map(|(_, n)| *n)
                    .fold(0.0, f64::max);
                assert!(leakage < 0.02, "{leakage} N beside a tone of {hz} Hz of {rate_hz}");
            }
        }
    }

    #[test]
    fn bins_are_as_many_as_there_is_room_for_and_reach_to_the_top_of_the_band() {
        for (rate_hz, top_hz) in [(240.0, 1000.0), (10_000.0, 1000.0), (200_000.0, 80_000.0)] {
            let bins = overview(rate_hz, top_hz).bins();
            let top = bins.first_hz + (bins.count as f64 - 0.5) * bins.bin_hz;
            assert!((1..=BINS_MAX).contains(&bins.count), "{bins:?}");
            assert!(top > top_hz.min(0.45 * rate_hz) - bins.bin_hz, "{bins:?}");
            assert!((bins.first_hz - 0.5 * bins.bin_hz - 10.0).abs() < 10.0, "{bins:?}");
        }
    }

    #[test]
    fn a_window_is_whole_and_starts_anew_after_a_gap() {
        let mut overview = overview(10_000.0, 1000.0);
        let mut amplitudes = [0.0; BINS_MAX];
        assert!(!overview.amplitudes(&mut amplitudes), "before any sample");
        feed(&mut overview, 10_000.0, |_| 0.0);
        assert!(overview.amplitudes(&mut amplitudes));
        let samples = [0.0; 300];
        let after_a_gap = Block {
            session: 1,
            seq: 99,
            samples_before: Some(9900),
            t_ns: 1_000_000_000,
            rate_hz: 10_000.0,
            channels: 3,
            samples: &samples,
        };
        overview.push(&after_a_gap);
        assert!(!overview.amplitudes(&mut amplitudes), "half of the window is older than the gap");
        assert_eq!(overview.end_ns(), 1_010_000_000);
    }

    #[test]
    fn samples_that_are_not_numbers_leave_numbers() {
        let (_, found) = spectrum(10_000.0, 1000.0, |t_s| if t_s < 0.4 { f64::NAN } else { 1e300 });
        assert!(found.iter().all(|n| !n.is_nan()));
    }
}
