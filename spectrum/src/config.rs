//! Configuration of the monitor, validated once.

use crate::rules::Rules;

/// A known natural frequency of the machine, from the model's modal list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, 0 to 1; 0 if unknown.
    pub damping: f64,
    /// Direction of the motion in the axes of the force channels; zero if unknown. Informative
    /// only: lines are matched by frequency.
    pub direction: [f64; 3],
}

impl Mode {
    /// A mode of which only the frequency is known.
    #[must_use]
    pub fn at_hz(frequency_hz: f64) -> Self {
        Self { frequency_hz, damping: 0.0, direction: [0.0; 3] }
    }

    /// Whether frequency, damping and direction are in their valid ranges.
    pub(crate) fn is_valid(&self) -> bool {
        let directed = self.direction.iter().all(|d| d.is_finite());
        let rings = self.frequency_hz > 0.0 && self.frequency_hz.is_finite();
        rings && directed && (0.0..1.0).contains(&self.damping)
    }
}

/// Spatial frequency of a gear train along the tool path: of the rotation of a shaft, or of a tooth
/// mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearFrequency {
    /// Joint, from 1.
    pub joint: u8,
    /// Shaft, from 1, motor side first.
    pub shaft: u8,
    /// Cycles per revolution of the shaft: 1 for its rotation, otherwise the number of meshing
    /// teeth.
    pub teeth: u32,
    /// Cycles (revolutions, or teeth) per mm of tool path, for the present path.
    pub cycles_per_mm: f64,
}

impl GearFrequency {
    /// From the fields in their order.
    #[must_use]
    pub const fn new(joint: u8, shaft: u8, teeth: u32, cycles_per_mm: f64) -> Self {
        Self { joint, shaft, teeth, cycles_per_mm }
    }
}

/// `joint 1, shaft 2`; `joint 1, 10 teeth of shaft 1`.
impl std::fmt::Display for GearFrequency {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { joint, shaft, teeth, .. } = self;
        match teeth {
            1 => write!(f, "joint {joint}, shaft {shaft}"),
            teeth => write!(f, "joint {joint}, {teeth} teeth of shaft {shaft}"),
        }
    }
}

impl GearFrequency {
    /// Whether the number of cycles is finite and above 0.
    pub(crate) fn is_valid(&self) -> bool {
        self.cycles_per_mm > 0.0 && self.cycles_per_mm.is_finite()
    }
}

/// Largest sampling rate of the monitor, Hz.
pub const RATE_MAX_HZ: f64 = 200_000.0;
/// Limit on the number of modes.
pub const MODES_MAX: usize = 32;
/// Limit on the number of gear shafts and meshes.
pub const GEAR_FREQUENCIES_MAX: usize = 64;

/// Settings of the vibration monitor.
#[derive(Clone, Debug, PartialEq)]
pub struct MonitorConfig {
    /// Sampling rate of every channel, Hz, 240 (a controller's own force; ABB: every 4.032 ms) to
    /// 200 000.
    pub rate_hz: f64,
    /// Channels, 1 to 6, in the order x, y, z, mx, my, mz: a sensor with fewer axes omits the last
    /// ones.
    pub channels: usize,
    /// Band in which lines are searched, Hz; its upper end is limited to 0.45 of the rate.
    pub band_hz: [f64; 2],
    /// Known natural frequencies.
    pub modes: Vec<Mode>,
    /// Known frequencies of the gear trains.
    pub gear_frequencies: Vec<GearFrequency>,
    /// Smallest amplitude of a reported force line, N.
    pub least_amplitude_n: f64,
    /// Smallest amplitude of a reported moment line, Nm.
    pub least_amplitude_nm: f64,
    /// The sensor's full scale, N, for forces; infinite if unknown.
    pub full_scale_n: f64,
    /// The sensor's full scale, Nm, for moments; infinite if unknown.
    pub full_scale_nm: f64,
    /// Mains frequency, Hz; `None`: 50 or 60 Hz.
    pub mains_hz: Option<f64>,
    /// Factor on the detection threshold (power over floor), 0.25 to 10: 1 is the value of the
    /// published figures; lower values find weaker lines and raise more false alarms.
    pub threshold: f64,
    /// Duration of learning the noise floor before anything is reported, s, 0.5 to 60, including
    /// the first window. Default 0.9: one second of air is enough, with a margin of 0.1 s for the
    /// delay of the filters and for a cut that begins early. At least seven windows of the low
    /// branch (0.9 s) are used in any case.
    pub learn_s: f64,
    /// Thresholds of the evaluation of lines.
    pub rules: Rules,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        Self {
            rate_hz: 10_000.0,
            channels: 3,
            band_hz: [10.0, 1000.0],
            modes: Vec::new(),
            gear_frequencies: Vec::new(),
            least_amplitude_n: 0.1,
            least_amplitude_nm: 0.01,
            full_scale_n: f64::INFINITY,
            full_scale_nm: f64::INFINITY,
            mains_hz: None,
            threshold: 1.0,
            learn_s: 0.9,
            rules: Rules::default(),
        }
    }
}

/// An invalid setting.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A number is not finite or out of its range.
    #[error(
        "vibration monitor: {key} is {value}, expected {expected}; correct it in the configuration"
    )]
    OutOfRange {
        /// Name of the setting.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range, as text.
        expected: &'static str,
    },
    /// The band is empty, reversed, or above the limit of the rate.
    #[error(
        "vibration monitor: band_hz is {low_hz} to {high_hz} Hz, expected low < high and low < 0.45 of the rate {rate_hz} Hz; \
         lower the band or sample faster"
    )]
    Band {
        /// Lower edge, Hz.
        low_hz: f64,
        /// Upper edge, Hz.
        high_hz: f64,
        /// Sampling rate, Hz.
        rate_hz: f64,
    },
    /// A mode with an invalid frequency, damping or direction.
    #[error(
        "vibration monitor: mode {index} has frequency {frequency_hz} Hz and damping {damping}, expected a frequency above 0 \
         and damping from 0 to below 1; correct [[mode]] in the model"
    )]
    Mode {
        /// Place in the list, from 0.
        index: usize,
        /// Natural frequency, Hz.
        frequency_hz: f64,
        /// Damping ratio.
        damping: f64,
    },
    /// A gear frequency that is not finite or not above 0.
    #[error(
        "vibration monitor: wheel {index} turns {cycles_per_mm} times per mm, expected a finite number above 0"
    )]
    GearFrequency {
        /// Place in the list, from 0.
        index: usize,
        /// Cycles per mm.
        cycles_per_mm: f64,
    },
}

impl MonitorConfig {
    /// Checks every setting.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub fn check(&self) -> Result<(), ConfigError> {
        in_range("rate_hz", self.rate_hz, 240.0..=RATE_MAX_HZ, "240 to 200000 Hz")?;
        #[expect(clippy::cast_precision_loss, reason = "a channel count is small")]
        in_range("channels", self.channels as f64, 1.0..=6.0, "1 to 6")?;
        in_range("least_amplitude_n", self.least_amplitude_n, 0.0..=1e9, "0 or more, finite")?;
        in_range("least_amplitude_nm", self.least_amplitude_nm, 0.0..=1e9, "0 or more, finite")?;
        in_range("full_scale_n", self.full_scale_n, 1e-9..=f64::INFINITY, "above 0")?;
        in_range("full_scale_nm", self.full_scale_nm, 1e-9..=f64::INFINITY, "above 0")?;
        in_range("threshold", self.threshold, 0.25..=10.0, "0.25 to 10")?;
        in_range("learn_s", self.learn_s, 0.5..=60.0, "0.5 to 60 s")?;
        if let Some(mains_hz) = self.mains_hz {
            in_range("mains_hz", mains_hz, 10.0..=500.0, "10 to 500 Hz")?;
        }
        let [low_hz, high_hz] = self.band_hz;
        if !(low_hz >= 5.0 && high_hz.is_finite() && low_hz < high_hz.min(0.45 * self.rate_hz)) {
            return Err(ConfigError::Band { low_hz, high_hz, rate_hz: self.rate_hz });
        }
        self.rules.check()?;
        self.check_lists()
    }

    fn check_lists(&self) -> Result<(), ConfigError> {
        let impossible = self.modes.iter().enumerate().find(|(_, mode)| !mode.is_valid());
        if let Some((index, &Mode { frequency_hz, damping, .. })) = impossible {
            return Err(ConfigError::Mode { index, frequency_hz, damping });
        }
        let impossible =
            self.gear_frequencies.iter().enumerate().find(|(_, wheel)| !wheel.is_valid());
        if let Some((index, wheel)) = impossible {
            return Err(ConfigError::GearFrequency { index, cycles_per_mm: wheel.cycles_per_mm });
        }
        Ok(())
    }

    /// Upper edge of the monitored band, Hz, limited to 0.45 of the sampling rate.
    #[must_use]
    pub fn band_top_hz(&self) -> f64 {
        self.band_hz[1].min(0.45 * self.rate_hz)
    }
}

pub(crate) fn in_range(
    key: &'static str,
    value: f64,
    range: std::ops::RangeInclusive<f64>,
    expected: &'static str,
) -> Result<(), ConfigError> {
    if range.contains(&value) {
        Ok(())
    } else {
        Err(ConfigError::OutOfRange { key, value, expected })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_usable() {
        assert_eq!(MonitorConfig::default().check(), Ok(()));
    }

    #[test]
    fn every_impossible_setting_is_refused_with_the_reason() {
        let good = MonitorConfig::default;
        let bad = [
            MonitorConfig { rate_hz: f64::NAN, ..good() },
            MonitorConfig { rate_hz: 10.0, ..good() },
            MonitorConfig { channels: 0, ..good() },
            MonitorConfig { channels: 7, ..good() },
            MonitorConfig { band_hz: [100.0, 50.0], ..good() },
            MonitorConfig { band_hz: [f64::NAN, 50.0], ..good() },
            MonitorConfig { band_hz: [600.0, 900.0], rate_hz: 1000.0, ..good() },
            MonitorConfig { modes: vec![Mode::at_hz(-1.0)], ..good() },
            MonitorConfig { modes: vec![Mode { damping: 1.0, ..Mode::at_hz(70.0) }], ..good() },
            MonitorConfig { least_amplitude_n: -1.0, ..good() },
            MonitorConfig { full_scale_n: 0.0, ..good() },
            MonitorConfig { threshold: 0.0, ..good() },
            MonitorConfig { learn_s: 0.0, ..good() },
            MonitorConfig { rules: Rules { least_share: f64::NAN, ..Rules::default() }, ..good() },
            MonitorConfig { rules: Rules { heard_part: 0.0, ..Rules::default() }, ..good() },
            MonitorConfig { mains_hz: Some(f64::NAN), ..good() },
            MonitorConfig {
                gear_frequencies: vec![GearFrequency {
                    joint: 1,
                    shaft: 1,
                    teeth: 1,
                    cycles_per_mm: 0.0,
                }],
                ..good()
            },
        ];
        for config in bad {
            let message = config.check().expect_err("must be refused").to_string();
            assert!(message.starts_with("vibration monitor: "), "{message}");
        }
    }

    #[test]
    fn the_band_ends_below_nyquist() {
        let config = MonitorConfig { rate_hz: 1000.0, ..MonitorConfig::default() };
        assert!((config.band_top_hz() - 450.0).abs() < 1e-12);
    }
}
