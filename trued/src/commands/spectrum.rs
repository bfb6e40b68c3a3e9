//! `trued spectrum`: vibrations in a recording, with time and cause.
//!
//! The monitor is the daemon's own, with the same settings by default; information missing in a
//! recording is stated, not guessed; amplitudes are in the channels' own units.

use std::path::PathBuf;

use clap::Args;
use spectrum::{ConfigError, MonitorConfig};
use spectrum_report::vibration::{Inputs, Settings, analyse, read};

use crate::exit::{Answer, Failure, Outcome};
use crate::options::in_unit;
use crate::output::{Console, Emphasis};
use crate::{progress, wrap};

/// One percent.
const PERCENT: f64 = 0.01;
/// Largest spindle speed, rev/min; as in the file of a cut.
const RPM_MAX: f64 = 1e6;

/// Find vibrations in a recording, with time, cause and remedy
///
/// Runs the daemon's vibration monitor over the samples, and computes spectra over time and over the tool's path. Reads
/// recordings, CSV and other tables, .lvm, UFF 58 and WAV. Without a spindle speed, forced vibration cannot be
/// distinguished from chatter; without a model, no natural frequencies and gears are known.
#[derive(Debug, Args)]
pub(crate) struct Spectrum {
    /// Column to analyse, by name or by number from 1; may be repeated; by default all waveforms
    #[arg(long = "column", value_name = "C", value_delimiter = ',')]
    columns: Vec<String>,
    /// Sampling rate, Hz; overrides that of the file
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    #[arg(long, value_name = "N", help = format!("Spindle speed, rev/min, at most {RPM_MAX}; by default from the columns `spindle_rpm` or `tacho`"))]
    spindle_rpm: Option<f64>,
    /// Number of teeth of the cutter, with a spindle speed; by default from `[cut]` in the accompanying TOML
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    teeth: Option<u32>,
    /// Feed along the path, mm/s; by default from the columns `feed_mm_s`, `x_mm` … or `q1_deg` …
    #[arg(long, value_name = "N")]
    feed_mm_s: Option<f64>,
    /// Model of the robot, for its modes and gears: a file or a preset; by default the one named in the recording's TOML
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Cut in the format of `trued stability`; if it chatters, the nearest stable cuts are computed
    #[arg(long, value_name = "CUT.toml")]
    cut: Option<PathBuf>,
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2)]
    #[arg(help = format!("Frequency range in which lines are reported, Hz, up to half the sampling rate [default: {} {}]", Settings::default().band_hz[0], Settings::default().band_hz[1]))]
    band: Vec<f64>,
    /// Window length of the averaged spectrum, s, at most the recording; by default chosen by the length of the recording
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    #[arg(long, value_name = "A", help = least_help())]
    least: Option<f64>,
    /// Factor on the detection thresholds, 0.25 to 10: above 1 only stronger lines are reported, below 1 weaker ones too
    #[arg(long, value_name = "N", default_value_t = Settings::default().threshold)]
    threshold: f64,
    /// Mains frequency, Hz; by default both 50 and 60 are considered
    #[arg(long, value_name = "HZ")]
    mains: Option<f64>,
    /// Value of a WAV file's full scale, in the channel's unit
    #[arg(long, value_name = "A")]
    scale: Option<f64>,
    /// Mapping for another program's table; by default `NAME.mapping.toml` beside it
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Write an HTML page with plots
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Recording to analyse
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// A setting of the monitor under the name of its option.
fn by_option(error: spectrum_report::Error) -> Failure {
    let spectrum_report::Error::Input(error) = error else { return error.into() };
    match error.downcast_ref() {
        Some(ConfigError::OutOfRange { key: "threshold", value, expected }) => {
            Failure::input(format!("--threshold is {value}, expected {expected}"))
        }
        Some(ConfigError::OutOfRange { key: "mains_hz", value, expected }) => {
            Failure::input(format!("--mains is {value}, expected {expected}"))
        }
        Some(ConfigError::Band { low_hz, high_hz, rate_hz }) => Failure::input(format!(
            "--band is {low_hz} {high_hz}, expected the lower frequency first, from 5 Hz to below 0.45 of the rate, {rate_hz} Hz"
        )),
        _ => Failure::Input(error),
    }
}

fn least_help() -> String {
    let monitor = MonitorConfig::default();
    format!(
        "Smallest amplitude that the monitor reports, in the channels' unit; by default {} N and {} Nm, as in the daemon, for other units {} % of the RMS of the signal",
        monitor.least_amplitude_n,
        monitor.least_amplitude_nm,
        in_unit(Settings::default().amplitude_least_part, PERCENT)
    )
}

impl Spectrum {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.check()?;
        let mut outputs = console.outputs().pages(&self.report);
        let inputs = [&self.file].into_iter().chain(&self.model).chain(&self.mapping);
        outputs.check(inputs.chain(&self.cut))?;
        let spinner = progress::stages(console, "spectra, vibration events");
        let source = read(&self.file, &self.inputs())?;
        self.check_band(source.rate_hz)?;
        let mut analysis = analyse(source, &self.settings()).map_err(by_option)?;
        if let Some(cut) = &self.cut {
            analysis.add_nearest_stable(cut)?;
        }
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page()?);
        }
        spinner.finish_and_clear();
        console.write(outputs, "trued.spectrum/1", &analysis.report())?;
        let paint = if analysis.has_alarm() { Emphasis::Bad } else { Emphasis::Good };
        let text = analysis.text(wrap::columns_of_stdout(), |text| console.paint(paint, text));
        console.say(text)?;
        Ok(Answer::Done)
    }

    /// Rejects impossible numbers; those of a file's reading and of the monitor are rejected there.
    fn check(&self) -> Result<(), Failure> {
        let given = [
            ("--spindle-rpm", self.spindle_rpm),
            ("--feed-mm-s", self.feed_mm_s),
            ("--least", self.least),
        ];
        let wrong = |value: &f64| !(value.is_finite() && *value > 0.0);
        if let Some((key, value)) =
            given.into_iter().find_map(|(key, value)| Some((key, value.filter(wrong)?)))
        {
            return Err(Failure::input(format!(
                "{key} is {value}, expected a finite number above 0"
            )));
        }
        match self.spindle_rpm.filter(|rpm| *rpm > RPM_MAX) {
            Some(rpm) => Err(Failure::input(format!(
                "--spindle-rpm is {rpm}, expected at most {RPM_MAX} rev/min"
            ))),
            None => Ok(()),
        }
    }

    /// Rejects a given band in which no line of this recording can be.
    fn check_band(&self, rate_hz: f64) -> Result<(), Failure> {
        match self.band.as_slice() {
            [low, high] if *high > 0.5 * rate_hz => Err(Failure::input(format!(
                "--band is {low} to {high} Hz, and at {rate_hz} samples per second no frequency above {} Hz can be measured: lower its upper end",
                0.5 * rate_hz
            ))),
            _ => Ok(()),
        }
    }

    fn inputs(&self) -> Inputs {
        Inputs {
            columns: self.columns.clone(),
            rate_hz: self.rate,
            full_scale: self.scale,
            mapping: self.mapping.clone(),
            model: self.model.clone(),
            spindle_rpm: self.spindle_rpm,
            teeth: self.teeth,
            feed_mm_s: self.feed_mm_s,
        }
    }

    fn settings(&self) -> Settings {
        let usual = Settings::default();
        Settings {
            band_hz: self.band.as_slice().try_into().unwrap_or(usual.band_hz),
            window_s: self.window,
            amplitude_least: self.least,
            threshold: self.threshold,
            mains_hz: self.mains,
            ..usual
        }
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<spectrum_report::vibration::Report>(
        "spectrum",
        "trued.spectrum/1",
    )
}
