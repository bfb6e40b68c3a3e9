//! `trued plan --for DIR`: the experiment proposed by a diagnosis, as a path to be run and measured.
//!
//! The motion is the one that the diagnosis has evaluated, within the limits and speeds of its
//! model; both files are written or none. The robot's surroundings are not considered; this is
//! stated.

use std::path::Path;

use diagnosis::diagnose::experiment::{Experiment, Measured};
use recording::series::about_path;
use report::significant;
use serde::Serialize;

use crate::asked::Asked;
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::input;
use crate::output::Console;

/// What is not checked.
const NOT_CHECKED: &str = "what stands around the robot, and whether the tool meets floor, base or cables: run it slowly first, with a hand on the stop";

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    does: &'static str,
    experiment: &'a str,
    says: &'a str,
    expected_separation: f64,
    takes_s: f64,
    rows: usize,
    files: [String; 2],
    not_checked: [&'static str; 1],
}

/// Writes the requested experiment to `out`, or beside the diagnosis.
pub(super) fn run(diagnosed: &Path, out: Option<&Path>, console: &mut Console) -> Outcome {
    let found = read(&diagnosed.join("diagnosis.json"))?;
    let model = input::model(&diagnosed.join("model.toml"))?;
    let Some(asked) = found else {
        return Err(Failure::input(format!(
            "{}: this diagnosis asks for no experiment: nothing in it is ambiguous, or nothing was measured that an experiment could show",
            diagnosed.display()
        )));
    };
    let experiment = asked.experiment(&model.physics.arm).ok_or_else(|| {
        Failure::input(format!(
            "{}: asks for the experiment `{}`, which this version does not know: diagnose again",
            diagnosed.display(),
            asked.name
        ))
    })?;
    let out = out.unwrap_or(diagnosed);
    let mut outputs = console.outputs().in_folder(out);
    let files = put(&mut outputs, &experiment, &asked.measured, out);
    console.write(
        outputs,
        "trued.plan/1",
        &Report {
            does: "experiment",
            experiment: &experiment.name,
            says: &asked.says,
            expected_separation: asked.expected_separation,
            takes_s: experiment.takes_s(),
            rows: experiment.rows.len(),
            files: files.clone(),
            not_checked: [NOT_CHECKED],
        },
    )?;
    console.say(&asked.says)?;
    console.say(format!(
        "{} rows over {} s, written to {} and {}",
        experiment.rows.len(),
        significant(experiment.takes_s(), 3),
        files[0],
        files[1]
    ))?;
    console.say(format!("not looked at: {NOT_CHECKED}"))?;
    console.say("record it, fill the empty columns, and give it to trued diagnose beside the first recording")?;
    Ok(Answer::Done)
}

fn read(path: &Path) -> Result<Option<Asked>, Failure> {
    let shown = path.display();
    let text = std::fs::read_to_string(path).map_err(|error| {
        Failure::input(format!(
            "{shown}: cannot be read: {error}; expected what `trued diagnose` wrote"
        ))
    })?;
    Asked::parse(&text).map_err(|error| Failure::input(format!("{shown}: {error}")))
}

fn put(
    outputs: &mut Outputs,
    experiment: &Experiment,
    measured: &Measured,
    out: &Path,
) -> [String; 2] {
    let recording = experiment.recording(measured, f64::NAN);
    let list = out.join("experiment.csv");
    let about = about_path(&list);
    outputs.put(&about, recording.about_toml());
    outputs.put(&list, recording.to_csv());
    [list, about].map(|path| path.display().to_string())
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(crate) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report<'_>>("plan-experiment", "trued.plan/1")
}
