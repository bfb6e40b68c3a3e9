//! `trued model`: presets, content of a model, import and export of URDF.

mod show;
mod urdf;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use recording::faults::Faults;
use recording::files::{FileError, read_text};
use recording::model::presets::{self, PRESETS};
use report::TextTable;
use serde::Serialize;

use crate::exit::{Answer, Failure, Outcome};
use crate::input;
use crate::output::Console;
use crate::table::on_stdout;

/// List and show robot models; import a model from a URDF or export it as one
#[derive(Debug, Args)]
pub(crate) struct Model {
    #[command(subcommand)]
    what: ModelAction,
}

#[derive(Debug, Subcommand)]
enum ModelAction {
    /// List the built-in robot models (presets)
    Presets,
    /// Show a model: joints, limits, masses, effects with their uncertainties, and which effects are not compensated
    Show {
        /// A model file, or the name of a preset
        #[arg(value_name = "MODEL")]
        model: PathBuf,
        /// Print the model file, as a template for your own: `trued model show ur10e --toml > robot.toml`
        #[arg(long)]
        toml: bool,
    },
    Import(urdf::Import),
    Export(urdf::Export),
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Presets {
    presets: Vec<PresetLine>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PresetLine {
    preset: &'static str,
    name: String,
    joints: usize,
    effects: usize,
    hash: String,
}

impl Model {
    pub(crate) fn run(&self, console: &mut Console) -> Outcome {
        match &self.what {
            ModelAction::Presets => list(console),
            ModelAction::Show { model, toml: true } => {
                if console.common().json.is_some() {
                    let why = "--toml prints the model file itself: leave out --json, or --toml";
                    return Err(Failure::input(why));
                }
                // Read as a model first, so that an invalid file is not printed.
                input::model(model)?;
                let text = match (read_text(model), presets::by_path(model)) {
                    (Err(FileError::Io { .. }), Some(preset)) => preset.text.to_owned(),
                    (text, _) => text.map_err(input::unusable)?,
                };
                console.verbatim(&text)?;
                Ok(Answer::Done)
            }
            ModelAction::Show { model, toml: false } => {
                show::run(console, model, &input::model(model)?)
            }
            ModelAction::Import(import) => import.run(console),
            ModelAction::Export(export) => export.run(console),
        }
    }
}

fn list(console: &mut Console) -> Outcome {
    let broken = |faults: Faults| Failure::system(faults);
    let mut lines = Vec::new();
    for preset in PRESETS {
        let model = preset.model().map_err(broken)?;
        lines.push(PresetLine {
            preset: preset.name,
            name: model.file.name.clone(),
            joints: model.file.joints.len(),
            effects: model.file.effects.len(),
            hash: format!("{:016x}", model.hash),
        });
    }
    // One line per robot in 80 columns; the rest of each is in the JSON and in `trued model show`.
    let table = lines.iter().fold(TextTable::new(["preset", "effects", "robot"]), |table, line| {
        table.row([line.preset.to_owned(), line.effects.to_string(), line.name.clone()])
    });
    console.json("trued.model/1", &Presets { presets: lines })?;
    console.say(on_stdout(&table))?;
    Ok(Answer::Done)
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    let presets = crate::schemas::ResultSchema::of::<Presets>("model-presets", "trued.model/1");
    urdf::result_schemas().into_iter().chain([presets, show::result_schema()]).collect()
}
