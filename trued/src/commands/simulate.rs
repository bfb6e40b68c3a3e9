//! `trued simulate`: simulates tool position and drive torques of a model for a recording's commands, loads and temperatures.
//!
//! The same input and seed give the same bytes; without `--noise` the result is the model's own, to
//! the last digit; the layout remains that of the recording; no input is overwritten. The model is
//! not fitted; only the measuring frame and unknown target positions are estimated, from the
//! recorded data.

use std::path::{Path, PathBuf};

use clap::Args;
use diagnosis_report::simulation::{Settings, simulate};
use recording::model::presets;
use recording::series::{self, Recording};
use report::pluralise;
use tracing::warn;

use crate::exit::{Answer, Outcome};
use crate::input::{Input, InspectedRecording, Reading};
use crate::options::Seed;
use crate::output::Console;
use crate::progress;

/// Simulate the tool position and drive torques of a model for the commands of a recording
///
/// Takes commanded joints, loads, temperatures and process state from INPUT, and replaces the measured values: points, reflectors, orientations, motor-side and link-side
/// joint positions, torques, in the rows in which they were measured. The uncertainties (`sigma`) that INPUT states are kept; otherwise the noise is stated. All effects on
/// positions and torques are simulated, including delays, lags and modes. If motor positions were measured together with torques, a controller (PI velocity loop in a P position
/// loop, with velocity feedforward) closes the loop, so that friction affects the motion; otherwise the motors follow the commands exactly. If the TOML describes a `[cut]`, forces
/// are simulated for its cutter at the recorded spindle speed and feed, with the effects of cutter and sensor in the model; such a recording needs neither joints nor a model.
/// An unknown measuring frame is estimated from the measured values; without any, the tool centre point is given in the base frame.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    #[command(flatten)]
    reading: Reading,
    /// Output recording: NAME.csv and NAME.toml
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
    /// Standard deviation of the normal noise of each measured value, mm (mrad for angles)
    #[arg(long, value_name = "SIGMA", default_value_t = Settings::default().noise_mm, value_parser = not_negative)]
    noise: f64,
    /// Standard deviation of the normal noise of each torque, Nm (N for a linear joint)
    #[arg(long, value_name = "SIGMA", default_value_t = Settings::default().torque_noise_nm, value_parser = not_negative)]
    torque_noise: f64,
    /// Standard deviation of the normal noise of each cutting force, N
    #[arg(long, value_name = "SIGMA", default_value_t = Settings::default().force_noise_n, value_parser = not_negative)]
    force_noise: f64,
    #[command(flatten)]
    seed: Seed,
    /// Recording with the commands to simulate
    #[arg(value_name = "INPUT")]
    input: PathBuf,
}

impl Simulate {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        let (csv, toml) = files(&self.out);
        let mut outputs = console.outputs().file(&csv).file(&toml);
        outputs.check([&self.input].into_iter().chain(self.reading.files()))?;
        let settings = Settings {
            noise_mm: self.noise,
            torque_noise_nm: self.torque_noise,
            force_noise_n: self.force_noise,
            seed: self.seed.resolve(),
        };
        let spinner = progress::stages(console, "reading the recording");
        let (model, mut recording) = match self.reading.inspect(&self.input)? {
            InspectedRecording::WithoutArm(alone) => *alone,
            InspectedRecording::OfArm(read) => {
                let read = read.map(|read| *read);
                let Input { model, recording, .. } = self.reading.path_after(read, &self.input)?;
                (model, recording)
            }
        };
        recording.metadata.model = self.model_name(&recording, &toml);
        spinner.set_message(format!("simulating {}", pluralise(recording.len(), "row")));
        let simulation = simulate(&model, recording, &settings)?;
        simulation.warnings().iter().for_each(|warning| warn!("{warning}"));
        spinner.set_message("table");
        outputs.put(&toml, simulation.about_toml());
        outputs.put(&csv, simulation.readings.recording.to_csv());
        spinner.finish_and_clear();
        console.write(outputs, "trued.simulate/1", &simulation.report(&csv))?;
        console.say_lines(&simulation.text(&csv))?;
        Ok(Answer::Done)
    }

    /// The model's name for the recording's TOML: a preset by name, a file by its path relative to
    /// the TOML.
    fn model_name(&self, recording: &Recording, toml: &Path) -> Option<String> {
        let Some(given) = &self.reading.model else {
            let named = recording.metadata.model.as_ref()?;
            let from = presets::resolve_model_path(&recording.file, Path::new(named));
            return Some(from_folder(&from, toml));
        };
        Some(from_folder(given, toml))
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    let sound = |x: &f64| x.is_finite() && *x >= 0.0;
    text.parse().ok().filter(sound).ok_or_else(|| "expected a number, 0 or above".to_owned())
}

/// `NAME.csv` and `NAME.toml`; a given extension of either kind is kept.
fn files(out: &Path) -> (PathBuf, PathBuf) {
    let has =
        |ending: &str| out.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
    let stem = if has("csv") || has("toml") { out.with_extension("") } else { out.to_owned() };
    let with = |ending: &str| {
        let mut name = stem.clone().into_os_string();
        name.push(ending);
        PathBuf::from(name)
    };
    let csv = with(".csv");
    let toml = series::metadata_path(&csv);
    (csv, toml)
}

fn from_folder(model: &Path, toml: &Path) -> String {
    let is_preset = recording::model::presets::by_path(model).is_some() && !model.exists();
    let folder = toml.parent().unwrap_or(Path::new(""));
    let same = model.parent() == Some(folder);
    let name = match model.canonicalize() {
        Ok(whole) if !is_preset && !same => whole,
        _ if same && !is_preset => PathBuf::from(model.file_name().unwrap_or_default()),
        _ => model.to_owned(),
    };
    name.display().to_string()
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    use diagnosis_report::simulation::SimulationReport;
    crate::schemas::ResultSchema::of::<SimulationReport<'_>>("simulate", "trued.simulate/1")
}
