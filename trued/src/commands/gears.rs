//! `trued gears`: revolutions of gear shafts and tooth meshes per millimetre of path, and assignment of measured lines to them.
//!
//! Revolutions, teeth and degrees per mm have separate columns (decision 0010); every wheel that
//! fits a line is listed, with the probability of a random match. A wheel whose speed varies too
//! much to produce a line is not matched.

use std::path::{Path, PathBuf};

use clap::Args;
use recording::model::RobotModel;
use spectrum_report::gears::{self, Lines, Settings, TravelledPath, analyse};
use spectrum_report::vibration;

use super::surface::{Heights, read_profile};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::Reading;
use crate::output::Console;
use crate::wrap;

/// Gear shafts along a path: revolutions and teeth per millimetre, matched with lines
///
/// The path is a recording with joint positions, or a straight cut from a pose. The model needs `gear_teeth`. Lines are taken
/// from stylus profiles, from the columns of a recording over its path, or from `--lines`. An eccentric shaft causes as many
/// cycles per mm as it has revolutions per mm, a mesh as many as teeth mesh; what the reference thesis calls cycles per mm are degrees per mm.
#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("measured").args(["profile", "force", "lines"]).multiple(true)))]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "column" | "spacing_um" | "unit" => arg.requires("profile"),
    "mapping" => arg.conflicts_with("from"),
    _ => arg,
}))]
pub(crate) struct Gears {
    #[command(flatten)]
    reading: Reading,
    /// Only the gears of this joint, from 1; may be repeated
    #[arg(long, value_name = "JOINT", value_delimiter = ',')]
    wheels_of: Vec<u8>,
    /// Pose at which a straight cut begins, instead of a recording, deg (mm for linear joints)
    #[arg(long, value_name = "Q1,Q2,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(requires = "cut", conflicts_with = "path")]
    from: Vec<f64>,
    /// Displacement of the cut, base frame, mm; the tool keeps its orientation
    #[arg(long, value_name = "DX,DY,DZ", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(requires = "from", conflicts_with_all = ["path", "mapping"])]
    cut: Vec<f64>,
    /// Number of sections of the path that are listed separately
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=1000))]
    parts: u16,
    /// Stylus profile whose lines are matched; may be repeated
    #[arg(long, value_name = "PROFILE")]
    profile: Vec<PathBuf>,
    #[command(flatten)]
    heights: Heights,
    /// Recording whose lines over the path are matched: forces, or measured positions with `--signal x_mm,y_mm`
    #[arg(long, value_name = "RECORDING")]
    force: Option<PathBuf>,
    /// Columns of that recording; by default all waveforms
    #[arg(long, value_name = "C,…", value_delimiter = ',', requires = "force")]
    signal: Vec<String>,
    /// Lines to match, cycles per mm
    #[arg(long, value_name = "L,…", value_delimiter = ',')]
    lines: Vec<f64>,
    /// Tolerance of a match, percent of the line, in addition to the uncertainty of the line itself
    #[arg(long, value_name = "PERCENT", default_value_t = Settings::default().tolerance_percent, requires = "measured")]
    tolerance: f64,
    /// Write an HTML page with tables and a plot
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Recording with joint positions along the path; by default that of --force
    #[arg(value_name = "PATH")]
    path: Option<PathBuf>,
}

impl Gears {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        self.check()?;
        let mut outputs = console.outputs().pages(&self.report);
        let inputs = self.path.iter().chain(&self.force).chain(&self.profile);
        outputs.check(inputs.chain(self.reading.files()))?;
        let (model, travelled) = self.travelled()?;
        let settings = Settings {
            joints: self.wheels_of.clone(),
            tolerance_percent: self.tolerance,
            ..Settings::default()
        };
        let mut analysis = analyse(model, travelled, &settings)?;
        analysis.match_lines(self.lines()?);
        if let Some(report) = &self.report {
            outputs.put_page(report, analysis.page());
        }
        console.write(outputs, "trued.gears/1", &analysis.report())?;
        console.say(analysis.text(wrap::columns_of_stdout()))?;
        Ok(Answer::Done)
    }

    fn check(&self) -> Result<(), Failure> {
        let wrong = |value: &f64| !(value.is_finite() && *value > 0.0);
        if let Some(line) = self.lines.iter().find(|line| wrong(line)) {
            let message = format!("--lines holds {line}, expected cycles per mm above 0");
            return Err(Failure::input(message));
        }
        if wrong(&self.tolerance) || self.tolerance > 50.0 {
            let message = format!("--tolerance is {}, expected 0 to 50 percent", self.tolerance);
            return Err(Failure::input(message));
        }
        Ok(())
    }

    fn travelled(&self) -> Result<(RobotModel, TravelledPath), Failure> {
        let parts = usize::from(self.parts);
        if !self.from.is_empty() {
            let name = self.reading.model.as_deref();
            let name =
                name.ok_or_else(|| Failure::input("--from needs the robot: --model MODEL"))?;
            let model = crate::input::model(name)?;
            let travelled = gears::straight(&model.physics.arm, &self.from, &self.cut, parts)?;
            return Ok((model, travelled));
        }
        let path: &Path = self.path.as_deref().or(self.force.as_deref()).ok_or_else(|| {
            Failure::input(
                "no path: give a recording with q1_deg …, or --from Q1,… --cut DX,DY,DZ for a straight cut",
            )
        })?;
        let input = self.reading.read(path, None)?;
        let travelled = gears::recorded(&input.model.physics.arm, &input.recording, parts)?;
        Ok((input.model, travelled))
    }

    fn lines(&self) -> Result<Lines, Failure> {
        let mut lines = Lines::given(&self.lines);
        for path in &self.profile {
            lines.add_profile(&read_profile(&self.heights, path)?)?;
        }
        if let Some(path) = &self.force {
            let inputs = vibration::Inputs {
                columns: self.signal.clone(),
                model: self.reading.model.clone(),
                ..vibration::Inputs::default()
            };
            lines.add_recording(&vibration::read(path, &inputs)?)?;
        }
        Ok(lines)
    }
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<gears::Report<'_>>("gears", "trued.gears/1")
}
