//! `trued tap`: impact tests; natural frequencies, damping and modal masses, and the modal list of a model.
//!
//! Unused hits are named with the reason; what a single hit cannot verify is stated as unverified;
//! an input model is never overwritten, and everything but its modes is copied bit for bit.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use recording::faults::Setting;
use recording::files::FileError;
use spectrum::frf::{Estimator, Response};
use spectrum_report::tap::{self, Channels, Settings, analyse};
use tracing::warn;

use crate::exit::{Answer, Failure, Outcome};
use crate::input::{FaultyFile, option};
use crate::options::value_name;
use crate::output::Console;
use crate::wrap;

/// Analyse impact (tap) tests: natural frequencies and damping, optionally written into a model
///
/// Each FILE contains the force of an instrumented hammer and the response, of one or several hits, or frequency response functions
/// measured with another program (UFF 58, or tables with --frf). Hits are detected by their force; double hits, overloads and
/// truncated hits are rejected and listed. Coherence requires three or more hits; modes from fewer are marked unverified.
/// Exit 1 if no mode is found; then no model is written.
#[derive(Debug, Args)]
pub(crate) struct Tap {
    /// Column of the hammer's force, by name or by number from 1; required if the units do not identify it
    #[arg(long, value_name = "C", requires = "response")]
    force: Option<String>,
    /// Column of the response, by name or by number from 1
    #[arg(long, value_name = "C", requires = "force")]
    response: Option<String>,
    /// Quantity of the response, if its unit does not identify it; the values are then SI
    #[arg(long, value_name = "KIND", value_enum)]
    response_kind: Option<Kind>,
    /// Scale factor of the force, N per unit of the file, e.g. the inverse of the hammer's sensitivity
    #[arg(long, value_name = "N")]
    force_scale: Option<f64>,
    /// Scale factor of the response, SI per unit of the file; requires --response-kind
    #[arg(long, value_name = "SI", requires = "response_kind")]
    response_scale: Option<f64>,
    /// Sampling rate, Hz; overrides that of the file
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Files are tables of a frequency response function: frequency in Hz, real part, imaginary part
    #[arg(long, requires = "response_kind", conflicts_with_all = ["force", "response", "rate", "block_s", "windows", "estimator", "coherence_least"])]
    frf: bool,
    #[arg(long, value_name = "h1|h2", value_enum, hide_possible_values = true)]
    #[arg(help = format!("Estimator of the response function. h1: unbiased by noise of the response; h2: by noise of the force [default: {}]", value_name(&Estimate::of(Settings::default().estimator))))]
    estimator: Option<Estimate>,
    #[arg(long, value_name = "0..1")]
    #[arg(help = format!("Minimum coherence at a mode, 0 to 1 [default: {}]", Settings::default().coherence_least))]
    coherence_least: Option<f64>,
    /// Frequency range of the modes, Hz; if not given, the range that the hammer excites
    #[arg(long, value_names = ["LOW", "HIGH"], num_args = 2)]
    band: Option<Vec<f64>>,
    /// Length of the block for each hit, s; if not given, the longest that the hits allow
    #[arg(long, value_name = "S")]
    block_s: Option<f64>,
    #[arg(long, value_name = "auto|none", value_enum, hide_possible_values = true)]
    #[arg(help = format!("auto: set the force to zero outside the contact, and apply an exponential window if the response has not decayed; none: no windows [default: {}]", value_name(&Windowing::of(Settings::default().windows))))]
    windows: Option<Windowing>,
    /// Direction of hit and response in the base frame, for the modes of the model
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    direction: Option<Direction>,
    /// Robot model whose modes are replaced: a file, or the name of a preset
    #[arg(long, value_name = "MODEL", requires = "out")]
    model: Option<PathBuf>,
    /// Output file for the model with the measured modes
    #[arg(long, value_name = "MODEL2", requires = "model")]
    out: Option<PathBuf>,
    /// Write a page with hits, frequency response function, mode indicators and coherence
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Recordings of hits, or frequency response functions
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

/// Quantity of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// m/s²
    Acceleration,
    /// m/s
    Velocity,
    /// m
    Displacement,
}

impl Kind {
    fn response(self) -> Response {
        match self {
            Self::Acceleration => Response::Acceleration,
            Self::Velocity => Response::Velocity,
            Self::Displacement => Response::Displacement,
        }
    }
}

/// How the response function is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Estimate {
    H1,
    H2,
}

impl Estimate {
    fn of(estimator: Estimator) -> Self {
        match estimator {
            Estimator::H1 => Self::H1,
            Estimator::H2 => Self::H2,
        }
    }

    fn estimator(self) -> Estimator {
        match self {
            Self::H1 => Estimator::H1,
            Self::H2 => Estimator::H2,
        }
    }
}

/// Whether windows are laid over the hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Windowing {
    Auto,
    None,
}

impl Windowing {
    fn of(windows: bool) -> Self {
        if windows { Self::Auto } else { Self::None }
    }
}

/// A direction of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Direction([f64; 3]);

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Option<Vec<f64>> =
            text.split(',').map(|part| part.trim().parse().ok()).collect();
        let vector = parts.and_then(|parts| <[f64; 3]>::try_from(parts).ok());
        let length = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let usable = |v: &[f64; 3]| length(v) > 0.0 && length(v).is_finite();
        let vector =
            vector.filter(usable).ok_or("expected three numbers X,Y,Z, not all 0, e.g. 0,1,0")?;
        Ok(Self(vector.map(|x| x / length(&vector))))
    }
}

/// An option that cannot be.
#[derive(Debug, thiserror::Error)]
#[error("{option} is {value}, expected {expected}")]
struct Unusable {
    option: &'static str,
    value: String,
    expected: &'static str,
}

/// Faults of a file with the options of this command: its columns are force and response.
fn by_option(error: spectrum_report::Error) -> Failure {
    let spectrum_report::Error::File(FileError::Content(faults)) = error else {
        return error.into();
    };
    Failure::input(FaultyFile::with(faults, |setting| match setting {
        Setting::Columns => "--force C, --response C",
        setting => option(setting),
    }))
}

impl Tap {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.check()?;
        let mut outputs = console.outputs().pages(&self.report);
        if let Some(out) = &self.out {
            outputs = outputs.file(out);
        }
        outputs.check(self.model.iter().chain(&self.files))?;
        let base = self.model.as_deref().map(crate::input::model).transpose()?;
        let source = tap::read(&self.files, &self.channels()).map_err(by_option)?;
        if source.has_functions() {
            self.check_used_by_functions()?;
        }
        source.notes.iter().for_each(|note| warn!("{note}"));
        let analysis = analyse(source, &self.settings())?;
        let renewed = base.as_ref().zip(self.out.as_deref());
        let renewed = renewed.map(|(base, out)| analysis.updated_model(base, out)).transpose()?;
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page(renewed.as_ref()));
        }
        let is_found = !analysis.modes.is_empty();
        if let (Some(renewed), true) = (&renewed, is_found) {
            outputs.put(&renewed.path, renewed.text.as_str());
        }
        console.write(outputs, "trued.tap/1", &analysis.report(renewed.as_ref()))?;
        for warning in &analysis.warnings {
            warn!("{warning}");
        }
        console.say(analysis.text(renewed.as_ref(), wrap::columns_of_stdout()))?;
        if let Some(model) = self.out.as_ref().filter(|_| is_found) {
            console.say(format!("model         {}", model.display()))?;
        }
        Ok(if is_found { Answer::Done } else { Answer::No })
    }

    fn check(&self) -> Result<(), Failure> {
        let positive = [
            ("--rate", self.rate),
            ("--block-s", self.block_s),
            ("--force-scale", self.force_scale.map(f64::abs)),
            ("--response-scale", self.response_scale.map(f64::abs)),
        ];
        let unusable = |option, value: String, expected| {
            Err(Failure::input(Unusable { option, value, expected }))
        };
        for (option, value) in positive {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return unusable(option, value.to_string(), "a finite number above 0");
            }
        }
        if let Some(value) = self.coherence_least.filter(|value| !(0.0..=1.0).contains(value)) {
            return unusable("--coherence-least", value.to_string(), "a number from 0 to 1");
        }
        if let Some([low, high]) = self.band_hz()
            && !(low >= 0.0 && high > low && high.is_finite())
        {
            return unusable("--band", format!("{low} {high}"), "two frequencies, the lower first");
        }
        Ok(())
    }

    /// Response functions are taken as they are: options of the analysis of hits would do nothing.
    fn check_used_by_functions(&self) -> Result<(), Failure> {
        let given = [
            ("--force, --response", self.force.is_some()),
            ("--rate", self.rate.is_some()),
            ("--estimator", self.estimator.is_some()),
            ("--coherence-least", self.coherence_least.is_some()),
            ("--block-s", self.block_s.is_some()),
            ("--windows", self.windows.is_some()),
        ];
        let idle: Vec<&str> =
            given.into_iter().filter_map(|(name, is_given)| is_given.then_some(name)).collect();
        if idle.is_empty() {
            return Ok(());
        }
        Err(Failure::input(format!(
            "the files contain response functions, and {} would have no effect: that is for records of hits; leave it out",
            idle.join(", ")
        )))
    }

    fn channels(&self) -> Channels {
        Channels {
            columns: self.force.clone().zip(self.response.clone()).map(|(f, r)| [f, r]),
            response: self.response_kind.map(Kind::response),
            force_scale: self.force_scale,
            response_scale: self.response_scale,
            rate_hz: self.rate,
            are_functions: self.frf,
        }
    }

    fn settings(&self) -> Settings {
        let usual = Settings::default();
        Settings {
            estimator: self.estimator.map_or(usual.estimator, Estimate::estimator),
            coherence_least: self.coherence_least.unwrap_or(usual.coherence_least),
            band_hz: self.band_hz(),
            block_s: self.block_s,
            windows: self.windows.map_or(usual.windows, |windows| windows == Windowing::Auto),
            direction: self.direction.map(|direction| direction.0),
            ..usual
        }
    }

    fn band_hz(&self) -> Option<[f64; 2]> {
        self.band.as_deref().and_then(|band| band.try_into().ok())
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<tap::Report>("tap", "trued.tap/1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_is_made_unit_length_and_none_is_refused() {
        assert_eq!("0, -2,0".parse::<Direction>(), Ok(Direction([0.0, -1.0, 0.0])));
        for bad in ["0,0,0", "1,2", "1,2,3,4", "x,y,z", "nan,0,1", "inf,0,0", ""] {
            assert!(bad.parse::<Direction>().is_err(), "{bad}");
        }
    }
}
