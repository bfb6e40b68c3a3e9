//! `trued spectrum`: vibrations in a recording, with time and cause.
//!
//! The monitor is the daemon's own, with the same settings by default; information missing in a
//! recording is stated, not guessed; amplitudes are in the channels' own units.

use std::path::PathBuf;

use clap::Args;
use spectrum_report::vibration::{Inputs, Settings, analyse, read};

use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};
use crate::wrap;

/// Look for vibration in a recording: what rings, when, why, and what to do
///
/// Runs the daemon's vibration monitor over the samples, and gives spectra over time and over the tool's path. Reads
/// recordings, CSV and other tables of numbers, .lvm, UFF 58 and WAV. Without a spindle speed forced vibration is
/// not told from chatter; without a model no mode and no gear is known.
#[derive(Debug, Args)]
pub(crate) struct Spectrum {
    /// A column to look at, by name or by number from 1; again for more; if not given, all that are waveforms
    #[arg(long = "column", value_name = "C", value_delimiter = ',')]
    columns: Vec<String>,
    /// Samples per second, where the file does not tell; wins over what it tells
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Spindle speed, rev/min; if not given, from the columns `spindle_rpm` or `tacho`
    #[arg(long, value_name = "N")]
    spindle_rpm: Option<f64>,
    /// Teeth of the cutter; if not given, from `[cut]` of the TOML beside the recording
    #[arg(long, value_name = "N")]
    teeth: Option<u32>,
    /// Feed along the path, mm/s; if not given, from the columns `feed_mm_s`, `x_mm` … or `q1_deg` …
    #[arg(long, value_name = "N")]
    feed_mm_s: Option<f64>,
    /// The robot's model, for its modes and gears: a file or a preset; if not given, the one that the recording's TOML names
    #[arg(long, value_name = "MODEL")]
    model: Option<PathBuf>,
    /// The cut as `trued stability` takes it: where it chatters, the nearest stable cuts are computed
    #[arg(long, value_name = "CUT.toml")]
    cut: Option<PathBuf>,
    /// Look for lines between these frequencies, Hz
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2, default_values_t = [10.0, 1000.0])]
    band: Vec<f64>,
    /// Length of the windows that the spectrum of the whole is averaged over, s; if not given, by the recording's length
    #[arg(long, value_name = "S")]
    window: Option<f64>,
    /// The watch reports no line below this amplitude, in the channels' unit; if not given, 0.1 N and 0.01 Nm as the
    /// daemon, else 2 % of the signal's own rms
    #[arg(long, value_name = "A")]
    least: Option<f64>,
    /// How far a line must stand above the noise, 0.25 to 10: above 1 it takes more, below 1 weaker lines are found
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    threshold: f64,
    /// Mains frequency, Hz; if not given, 50 and 60 are both possible
    #[arg(long, value_name = "HZ")]
    mains: Option<f64>,
    /// What a WAV file's full scale stands for; 1 if not given
    #[arg(long, value_name = "A")]
    scale: Option<f64>,
    /// How another program's table becomes a recording; if not given, `NAME.mapping.toml` beside it
    #[arg(long, value_name = "FILE")]
    mapping: Option<PathBuf>,
    /// Write a page with plots
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// The recording
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

impl Spectrum {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.check()?;
        let mut outputs = console.outputs().pages(&self.report);
        let inputs = [&self.file].into_iter().chain(&self.model).chain(&self.mapping);
        outputs.check(inputs.chain(&self.cut))?;
        let mut analysis = analyse(read(&self.file, &self.inputs())?, &self.settings())?;
        if let Some(cut) = &self.cut {
            analysis.add_nearest_stable(cut)?;
        }
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page()?);
        }
        console.write(outputs, "trued.spectrum/1", &analysis.report())?;
        let paint = if analysis.has_alarm() { Paint::Bad } else { Paint::Good };
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
        match given.into_iter().find_map(|(key, value)| Some((key, value.filter(wrong)?))) {
            Some((key, value)) => {
                Err(Failure::input(format!("{key} is {value}, expected a finite number above 0")))
            }
            None => Ok(()),
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
