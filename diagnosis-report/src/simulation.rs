//! A simulated recording for people and programs: `trued.simulate/1` as JSON, text, table and description. What is simulated:
//! [`diagnosis::recording_simulation`].

use std::path::Path;

use diagnosis::recording_simulation::{self, Readings, SimulationNoise};
use recording::model::RobotModel;
use recording::series::Recording;
use report::{TextLine, pluralise};
use serde::Serialize;

use crate::error::Error;

/// mm per m, mrad per rad.
const MILLI: f64 = 1e3;

/// A simulation: `trued.simulate/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulationReport<'a> {
    seed: u64,
    /// mm, for angles mrad.
    noise: f64,
    /// Nm, for prismatic joints N.
    torque_noise: f64,
    /// N.
    force_noise: f64,
    model: &'a str,
    recording: String,
    rows: usize,
    columns: &'a [String],
    left_out: &'a [String],
    /// RMS difference between recorded values and the model without noise, over scalar values; null if nothing was recorded.
    recorded_rms_mm: Option<f64>,
    rows_beyond_stiffness: usize,
}

/// Settings of a simulation. Standard deviations of normal noise, 0 or above; default 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settings {
    /// For every measured length, mm, and angle, mrad.
    pub noise_mm: f64,
    /// For every torque, Nm (N of a prismatic joint).
    pub torque_noise_nm: f64,
    /// For every cutting force, N.
    pub force_noise_n: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// A simulated recording.
#[derive(Clone, Debug)]
pub struct Simulation {
    settings: Settings,
    model: String,
    /// The simulated measurements.
    pub readings: Readings,
}

/// Replaces the measurements of a recording by those that the model predicts.
///
/// ```
/// use diagnosis_report::simulation::{Settings, simulate};
/// use recording::model::RobotModel;
/// use recording::series::{RequiredData, read_text};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let model = RobotModel::read("irb120".as_ref())?;
/// let text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,0,10,20,0,30,0\n";
/// let commands = read_text("commands.csv", text, None, None, RequiredData::Path)?;
/// let simulation = simulate(&model, commands, &Settings::default())?;
/// let description = simulation.about_toml();
/// assert!(description.starts_with("# simulated: trued simulate --seed 0"));
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Error::Input`] if the recording or the model cannot be used.
pub fn simulate(
    model: &RobotModel,
    recording: Recording,
    settings: &Settings,
) -> Result<Simulation, Error> {
    let noise = SimulationNoise {
        length_m: settings.noise_mm * 1e-3,
        torque_nm: settings.torque_noise_nm,
        force_n: settings.force_noise_n,
    };
    let readings = recording_simulation::simulate(model, recording, &noise, settings.seed)
        .map_err(Error::input)?;
    Ok(Simulation { settings: *settings, model: model.file.name.clone(), readings })
}

impl Simulation {
    /// The result as an object; `file`: the file to which the recording is written.
    #[must_use]
    pub fn report(&self, file: &Path) -> SimulationReport<'_> {
        let Self { settings, model, readings } = self;
        SimulationReport {
            seed: settings.seed,
            noise: settings.noise_mm,
            torque_noise: settings.torque_noise_nm,
            force_noise: settings.force_noise_n,
            model,
            recording: file.display().to_string(),
            rows: readings.recording.len(),
            columns: &readings.columns,
            left_out: &readings.left_out,
            recorded_rms_mm: readings.recorded_rms_m.map(|rms| rms * MILLI),
            rows_beyond_stiffness: readings.rows_beyond,
        }
    }

    /// The result in lines of text.
    #[must_use]
    pub fn text(&self, file: &Path) -> Vec<TextLine> {
        let Self { settings, model, readings } = self;
        let rows = pluralise(readings.recording.len(), "row");
        let mut lines = vec![format!("{model}, {rows}: {}", readings.columns.join(", "))];
        let Settings { noise_mm, seed, .. } = settings;
        lines.push(format!("noise               {noise_mm} mm (mrad), seed {seed}"));
        if let Some(rms_m) = readings.recorded_rms_m {
            lines.push(format!("recorded − model    {:.4} mm rms per value", rms_m * MILLI));
        }
        lines.push(format!("recording           {}", file.display()));
        lines.into_iter().map(TextLine::from).collect()
    }

    /// Limitations of the result, one sentence each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let Readings { understated, left_out, rows_beyond, .. } = &self.readings;
        let mut warnings = Vec::new();
        if !understated.is_empty() {
            let columns = understated.join(", ");
            warnings.push(format!(
                "the noise exceeds the `sigma` of the recording, which is kept: {columns}"
            ));
        }
        if *rows_beyond > 0 {
            let rows = pluralise(*rows_beyond, "row");
            warnings.push(format!(
                "in {rows} a joint is loaded beyond the range of its stiffness_hardening"
            ));
        }
        if !left_out.is_empty() {
            warnings.push(format!("not simulated and left out: {}", left_out.join(", ")));
        }
        warnings
    }

    /// The recording's TOML, with the settings of the simulation.
    #[must_use]
    pub fn about_toml(&self) -> String {
        let Settings { noise_mm, torque_noise_nm, force_noise_n, seed } = self.settings;
        let more = |name: &str, noise: f64| match noise {
            0.0 => String::new(),
            noise => format!(" --{name}-noise {noise}"),
        };
        format!(
            "# simulated: trued simulate --seed {seed} --noise {noise_mm}{}{}\n{}",
            more("torque", torque_noise_nm),
            more("force", force_noise_n),
            self.readings.recording.about_toml()
        )
    }
}
