//! URDF: `trued model import`, `trued model export`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use recording::urdf::{self, ChainEnds, Import as Imported};
use report::pluralise;
use serde::Serialize;

use crate::exit::{Answer, Outcome};
use crate::input;
use crate::output::{Console, Emphasis};

/// Create a model from the arm in a URDF
///
/// Imports the chain from a base link to a tip link: axes, limits, speeds and masses with all joints at zero, in the base link's
/// frame. Fixed joints are merged; the tip is the tool. Expand a xacro first.
#[derive(Debug, Args)]
pub(super) struct Import {
    /// The URDF file
    #[arg(value_name = "FILE.urdf")]
    file: PathBuf,
    /// Output file for the model
    #[arg(long, value_name = "MODEL.toml")]
    out: PathBuf,
    /// Base link of the chain, which may be a fixed leaf such as the controller's `base`; if not given, the root link
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Tip link, which is the tool; if not given, the only moving end of the tree, or `tool0` if several links are fixed to each other
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
}

/// Export a model's calibrated geometry as a URDF
///
/// Offsets, tilts and shifts of axes and of the tool are included in the frames. Effects that depend on load, position or direction
/// cannot be expressed in a URDF; they are left out and listed.
#[derive(Debug, Args)]
pub(super) struct Export {
    /// A model file, or the name of a preset
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Output file for the URDF
    #[arg(long, value_name = "FILE.urdf")]
    urdf: PathBuf,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ImportReport<'a> {
    name: &'a str,
    hash: String,
    base: &'a str,
    tip: &'a str,
    joints: Vec<&'a str>,
    bodies: usize,
    notes: &'a [String],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ExportReport<'a> {
    name: &'a str,
    carried: &'a [String],
    left_out: Vec<Part<'a>>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Part<'a> {
    what: &'a str,
    why: &'a str,
}

impl Import {
    pub(super) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().file(&self.out);
        outputs.check([&self.file])?;
        let ends = ChainEnds { base: self.base.as_deref(), tip: self.tip.as_deref() };
        let found = urdf::read(&self.file, &ends).map_err(input::unusable)?;
        let Imported { model, base, tip, notes } = &found;
        let joints = model.file.joints.iter().map(|joint| joint.name.as_str()).collect();
        outputs.put(&self.out, model.file.to_toml());
        let bodies = model.physics.arm.bodies().count();
        let report = ImportReport {
            name: &model.file.name,
            hash: format!("{:016x}", model.hash),
            base,
            tip,
            joints,
            bodies,
            notes,
        };
        console.write(outputs, "trued.model/1", &report)?;
        console.say(console.paint(Emphasis::Strong, report.name))?;
        let (joints, masses) = (pluralise(report.joints.len(), "joint"), bodies_in_words(bodies));
        console
            .say(format!("{base} to {tip}: {joints}: {}; {masses}", report.joints.join(", ")))?;
        for note in notes {
            console.say(format!("note: {note}"))?;
        }
        written(console, &self.out)
    }
}

fn bodies_in_words(bodies: usize) -> String {
    match bodies {
        0 => "no masses; gravity loads require them".to_owned(),
        bodies => format!("{} with a mass", pluralise(bodies, "link")),
    }
}

impl Export {
    pub(super) fn run(&self, console: &mut Console) -> Outcome {
        let mut outputs = console.outputs().file(&self.urdf);
        outputs.check([&self.model])?;
        let model = input::model(&self.model)?;
        let found = urdf::export(&model);
        outputs.put(&self.urdf, found.text.as_str());
        let parts = found.left_out.iter().map(|part| Part { what: &part.what, why: part.why });
        let report = ExportReport {
            name: &model.file.name,
            carried: &found.carried,
            left_out: parts.collect(),
        };
        console.write(outputs, "trued.model/1", &report)?;
        console.say(console.paint(Emphasis::Strong, report.name))?;
        if !report.carried.is_empty() {
            console.say(format!("included in the frames: {}", report.carried.join(", ")))?;
        }
        for (why, parts) in by_reason(&report.left_out) {
            console.say(format!("left out ({why}): {}", parts.join(", ")))?;
        }
        written(console, &self.urdf)
    }
}

fn by_reason<'a>(left_out: &[Part<'a>]) -> BTreeMap<&'a str, Vec<&'a str>> {
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for Part { what, why } in left_out {
        reasons.entry(why).or_default().push(what);
    }
    reasons
}

fn written(console: &mut Console, path: &Path) -> Outcome {
    console.say(format!("wrote {}", path.display()))?;
    Ok(Answer::Done)
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<ImportReport<'_>>("model-import", "trued.model/1"),
        ResultSchema::of::<ExportReport<'_>>("model-export", "trued.model/1"),
    ]
}
