//! URDF: `trued model import`, `trued model export`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use recording::urdf::{self, Ends, Import as Imported};
use report::count;
use serde::Serialize;

use crate::exit::{Answer, Outcome};
use crate::input;
use crate::output::{Console, Paint};

/// Make a model of the arm in a URDF
///
/// The chain from a base link to a tip link: axes, limits, speeds and masses with all joints at zero, in the base link's
/// frame; fixed joints are folded in, the tip is the tool. A xacro is expanded first.
#[derive(Debug, Args)]
pub(super) struct Import {
    /// The URDF
    #[arg(value_name = "FILE.urdf")]
    file: PathBuf,
    /// Where the model goes
    #[arg(long, value_name = "MODEL.toml")]
    out: PathBuf,
    /// The link that stays, also a fixed leaf such as the controller's `base`; if not given, the one at the root
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// The link that is the tool; if not given, the only end that moves, or `tool0` of several fixed to each other
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
}

/// Write a model's geometry as a URDF, with what was calibrated in its frames
///
/// Offsets, tilts and shifts of axes and of the tool go into the frames. What depends on load, position or direction has
/// no place in a URDF; it is left out and listed.
#[derive(Debug, Args)]
pub(super) struct Export {
    /// A model file, or the name of a preset
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// Where the URDF goes
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
        let ends = Ends { base: self.base.as_deref(), tip: self.tip.as_deref() };
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
        console.say(console.paint(Paint::Strong, report.name))?;
        let (joints, masses) = (count(report.joints.len(), "joint"), bodies_in_words(bodies));
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
        0 => "no masses: loads of gravity need them".to_owned(),
        bodies => format!("{} with a mass", count(bodies, "link")),
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
        console.say(console.paint(Paint::Strong, report.name))?;
        if !report.carried.is_empty() {
            console.say(format!("in the frames: {}", report.carried.join(", ")))?;
        }
        for (why, parts) in by_reason(&report.left_out) {
            console.say(format!("left out, as {why}: {}", parts.join(", ")))?;
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
