//! `trued surface`: stylus profiles, separated into waviness and roughness, with parameters and lines.
//!
//! A profile with a gap, an uneven step or an unknown unit is rejected, never repaired; every
//! figure states the length it was taken over.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, ValueEnum};
use physics::JOINTS_MAX;
use recording::model::RobotModel;
use spectrum::surface::{FORM_MAX, MachiningConditions};
use spectrum::{GearFrequency, Mode};
use spectrum_report::surface::{self, Format, Profile, Settings, analyse};
use tracing::warn;

use crate::exit::{Answer, Failure, Outcome};
use crate::output::Console;
use crate::wrap;

/// Analyse stylus profiles: waviness, roughness, feed marks
///
/// Removes the form (a line), separates waviness from roughness by the Gaussian filter of ISO 16610-21, and computes W, R and
/// P parameters over the whole profile and over segments, the spectrum in cycles per mm, and its lines. Several profiles
/// are compared in one table. A profile is a table with columns such as `x_um` and `z_um`, or one of heights alone
/// with --spacing-um.
#[derive(Debug, Args)]
pub(crate) struct Surface {
    #[command(flatten)]
    heights: Heights,
    /// Cut-off wavelength between roughness and waviness, mm
    #[arg(long, value_name = "MM", default_value_t = Settings::default().cut_off_mm)]
    cut_off_mm: f64,
    /// Cut-off wavelength below which the profile is treated as noise of the instrument, µm
    #[arg(long, value_name = "UM")]
    short_cut_off_um: Option<f64>,
    /// Degree of the polynomial that is removed as form: 0 the mean, 1 a line, 2 a parabola, …
    #[arg(long, value_name = "DEGREE", default_value_t = Settings::default().form_degree, value_parser = clap::value_parser!(u8).range(0..=FORM_MAX as i64))]
    form: u8,
    /// Length of the segments for which parameters are also computed, mm
    #[arg(long, value_name = "MM,…", value_delimiter = ',', default_values_t = Settings::default().segments_mm)]
    segment_mm: Vec<f64>,
    /// Speed of the tool along the profile, mm/s: gives each line its frequency in time
    #[arg(long, value_name = "MM_S")]
    feed_mm_s: Option<f64>,
    /// Spindle speed, rev/min: identifies lines of its revolutions and teeth; needs --feed-mm-s
    #[arg(long, value_name = "RPM", requires = "feed_mm_s")]
    spindle_rpm: Option<f64>,
    /// Number of teeth of the tool
    #[arg(long, value_name = "N", requires = "spindle_rpm", value_parser = clap::value_parser!(u32).range(1..))]
    teeth: Option<u32>,
    /// Model of the robot: identifies lines at its natural frequencies; needs --feed-mm-s
    #[arg(long, value_name = "MODEL", requires = "feed_mm_s")]
    model: Option<PathBuf>,
    /// Gear shaft by its revolutions per mm along the profile (printed by `trued gears`), or tooth mesh (`x` number of teeth)
    /// by its cycles per mm, e.g. 2:1x10=0.186: identifies its lines. May be repeated
    #[arg(long, value_name = "JOINT:SHAFT[xTEETH]=CYCLES_PER_MM")]
    wheel: Vec<WheelArg>,
    /// Write an HTML page with the profiles, their spectra and tables
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Profiles to analyse
    #[arg(value_name = "PROFILE", required = true)]
    profiles: Vec<PathBuf>,
}

/// How a profile's table is read.
#[derive(Debug, Args)]
pub(super) struct Heights {
    /// Column of the heights, by name or by number from 1; required if there are several
    #[arg(long, value_name = "C")]
    column: Option<String>,
    /// Distance between two points, µm, if no column states it
    #[arg(long, value_name = "UM")]
    spacing_um: Option<f64>,
    /// Unit of the heights, if the column's name does not state it
    #[arg(long, value_name = "um|mm|nm", value_enum, hide_possible_values = true)]
    unit: Option<HeightUnit>,
}

/// A unit of heights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HeightUnit {
    Um,
    Mm,
    Nm,
}

impl HeightUnit {
    fn micrometres(self) -> f64 {
        match self {
            Self::Um => 1.0,
            Self::Mm => 1e3,
            Self::Nm => 1e-3,
        }
    }
}

/// Reads a profile, and logs the remarks on its file.
pub(super) fn read_profile(heights: &Heights, path: &Path) -> Result<Profile, Failure> {
    let format = Format {
        column: heights.column.clone(),
        spacing_um: heights.spacing_um,
        unit_um: heights.unit.map(HeightUnit::micrometres),
    };
    let profile = surface::read(path, &format)?;
    profile.notes.iter().for_each(|note| warn!("{}: {note}", path.display()));
    Ok(profile)
}

/// `JOINT:SHAFT[xTEETH]=CYCLES_PER_MM`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct WheelArg(GearFrequency);

impl FromStr for WheelArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (place, cycles) = text.split_once('=')?;
            let (joint, shaft) = place.split_once(':')?;
            let (shaft, teeth) = shaft.split_once('x').unwrap_or((shaft, "1"));
            let [joint, shaft] = [joint, shaft].map(|n| n.trim().parse::<u8>().ok());
            let teeth = teeth.trim().parse::<u32>().ok().filter(|n| *n > 0)?;
            let cycles_per_mm: f64 = cycles.trim().parse().ok()?;
            let (joint, shaft) = (joint.filter(|n| *n > 0)?, shaft.filter(|n| *n > 0)?);
            let usable = cycles_per_mm > 0.0 && cycles_per_mm.is_finite();
            usable.then_some(Self(GearFrequency { joint, shaft, teeth, cycles_per_mm }))
        };
        let expected = "expected JOINT:SHAFT=CYCLES_PER_MM, e.g. 2:1x10=0.186 for the 10 teeth of joint 2's motor shaft";
        let wheel = read().ok_or_else(|| expected.to_owned())?;
        let joint = wheel.0.joint;
        if usize::from(joint) > JOINTS_MAX {
            return Err(format!(
                "joint {joint} does not exist, expected a joint from 1 to {JOINTS_MAX}"
            ));
        }
        Ok(wheel)
    }
}

/// A number that is not positive.
#[derive(Debug, thiserror::Error)]
#[error("{option} is {value}, expected a finite number above 0")]
struct NotPositive {
    option: &'static str,
    value: f64,
}

impl Surface {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.check()?;
        let mut outputs = console.outputs().pages(&self.report);
        outputs.check(&self.profiles)?;
        let model = self.model.as_deref().map(crate::input::model).transpose()?;
        self.check_wheels(model.as_ref())?;
        let settings = self.settings(model.as_ref());
        let profiles = self.profiles.iter().map(|path| read_profile(&self.heights, path));
        let analysis = analyse(profiles.collect::<Result<_, _>>()?, &settings)?;
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page());
        }
        console.write(outputs, "trued.surface/1", &analysis.report())?;
        console.say(analysis.text(wrap::columns_of_stdout()))?;
        Ok(Answer::Done)
    }

    fn check(&self) -> Result<(), Failure> {
        let given = [
            ("--spacing-um", self.heights.spacing_um),
            ("--cut-off-mm", Some(self.cut_off_mm)),
            ("--short-cut-off-um", self.short_cut_off_um),
            ("--feed-mm-s", self.feed_mm_s),
            ("--spindle-rpm", self.spindle_rpm),
        ];
        let segments = self.segment_mm.iter().map(|mm| ("--segment-mm", Some(*mm)));
        for (option, value) in given.into_iter().chain(segments) {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return Err(Failure::input(NotPositive { option, value }));
            }
        }
        Ok(())
    }

    /// Rejects gear trains of joints that the robot does not have.
    fn check_wheels(&self, model: Option<&RobotModel>) -> Result<(), Failure> {
        let Some(count) = model.map(|model| model.physics.arm.count()) else { return Ok(()) };
        let absent = self.wheel.iter().find(|wheel| usize::from(wheel.0.joint) > count);
        absent.map_or(Ok(()), |wheel| {
            let joint = wheel.0.joint;
            Err(Failure::input(format!(
                "--wheel: joint {joint} does not exist, expected a joint from 1 to {count}, the joints of the model"
            )))
        })
    }

    fn settings(&self, model: Option<&RobotModel>) -> Settings {
        let modes = model.iter().flat_map(|model| &model.file.modes);
        Settings {
            cut_off_mm: self.cut_off_mm,
            short_cut_off_um: self.short_cut_off_um,
            form_degree: self.form,
            segments_mm: self.segment_mm.clone(),
            machining: MachiningConditions {
                feed_mm_s: self.feed_mm_s,
                spindle_rpm: self.spindle_rpm,
                teeth: self.teeth.unwrap_or(0),
                modes: modes.map(|mode| Mode::at_hz(mode.frequency_hz)).collect(),
                gear_frequencies: self.wheel.iter().map(|wheel| wheel.0).collect(),
            },
        }
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<surface::Report<'_>>("surface", "trued.surface/1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wheel_is_joint_shaft_and_turns_and_nothing_else() {
        let wheel = |text: &str| text.parse::<WheelArg>().expect("a wheel").0;
        let turns = GearFrequency { joint: 2, shaft: 1, teeth: 1, cycles_per_mm: 0.0186 };
        assert_eq!(wheel("2:1=0.0186"), turns);
        assert_eq!(
            wheel("2:1x10=0.186"),
            GearFrequency { teeth: 10, cycles_per_mm: 0.186, ..turns }
        );
        for bad in
            ["2=6.69", "0:1=1", "1:1=0", "1:1=nan", "1:1", "a:1=1", "1:300=1", "1:1x0=1", "17:1=1"]
        {
            assert!(bad.parse::<WheelArg>().is_err(), "{bad}");
        }
    }
}
