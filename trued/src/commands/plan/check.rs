//! `trued plan --check`: poses that reveal damage, and whether a model still holds for measurements there.

use std::collections::BTreeMap;

use diagnosis::from_recording;
use diagnosis::plan::check::{
    Checkup, Damage, Detectable, Judgement, Suspect, Terms, judge, poses,
};
use diagnosis_report::positions::{columns, shown};
use physics::Model;
use recording::model::RobotModel;
use report::{TextTable, count, fixed, significant};
use serde::Serialize;
use tracing::warn;

use super::page::{Sheet, numbered};
use super::told::{not_checked, written};
use super::{Input, Plan};
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};
use crate::table::on_stdout;

/// Probability with which the stated minimum damage is detected.
const POWER: f64 = 0.9;
/// Default number of poses of a check.
const POSES: usize = 10;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Planned<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    alarm: f64,
    power: f64,
    poses: Vec<BTreeMap<String, f64>>,
    detectable: Vec<DetectableReport>,
    not_checked: Vec<&'static str>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Judged<'a> {
    does: &'static str,
    model: &'a str,
    alarm: f64,
    holds: bool,
    poses: usize,
    sum: f64,
    freedom: usize,
    p: f64,
    scatter: Option<f64>,
    unseen: Vec<String>,
    suspects: Vec<SuspectReport>,
    is_explained: bool,
    power: f64,
    detectable: Vec<DetectableReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct DetectableReport {
    damage: String,
    unit: &'static str,
    least: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SuspectReport {
    damage: String,
    unit: &'static str,
    size: Vec<f64>,
    sigma: f64,
    gain: f64,
}

impl DetectableReport {
    fn of(model: &Model, found: &Detectable) -> Self {
        let least = found.least.map(|least| 1e3 * least);
        Self { damage: found.damage.says(), unit: unit(model, &found.damage), least }
    }
}

fn unit(model: &Model, damage: &Damage) -> &'static str {
    if damage.is_angle(model) { "mrad" } else { "mm" }
}

pub(super) fn run(
    command: &Plan,
    console: &mut Console,
    outputs: Outputs,
    input: &Input,
) -> Outcome {
    let terms = Terms { alarm: command.alarm, power: POWER };
    if input.recordings.is_empty() {
        chosen(command, console, outputs, input, &terms)
    } else {
        judged(command, console, outputs, input, &terms)
    }
}

fn chosen(
    command: &Plan,
    console: &mut Console,
    mut outputs: Outputs,
    input: &Input,
    terms: &Terms,
) -> Outcome {
    let seed = command.seed.settle();
    let model = &input.model;
    let mut going = command.set_up(input)?;
    going.task.hypothesis = diagnosis::Hypothesis::fixed(model.physics);
    let wish = command.wish(POSES, seed);
    let found = poses(&going.task, &model.sigma, &wish, terms).map_err(Failure::input)?;
    command.files.put(&mut outputs, model, &going.task, &found.poses)?;
    let not_checked = not_checked(command, &going);
    let report = Planned {
        does: "check",
        model: &model.file.name,
        seed,
        alarm: terms.alarm,
        power: terms.power,
        poses: found.poses.iter().map(|q| columns(&model.physics.arm, q)).collect(),
        detectable: found
            .detectable
            .iter()
            .map(|d| DetectableReport::of(&model.physics, d))
            .collect(),
        not_checked: not_checked.clone(),
    };
    let sheet = sheet(command, model, &found, terms, &not_checked);
    command.files.put_page(&mut outputs, input, &sheet);
    console.write(outputs, "trued.plan/1", &report)?;
    let head = console.paint(Paint::Strong, &count(found.poses.len(), "pose"));
    console.say(format!("{head} for a check (seed {seed})"))?;
    let mut table = TextTable::new(["pose", "joints, deg (mm)"]);
    for (place, q) in found.poses.iter().enumerate() {
        table = table.row([(place + 1).to_string(), shown(&model.physics.arm, q)]);
    }
    console.say(on_stdout(&table))?;
    console.say(format!(
        "seen in {} of 100 cases where it is at least this large, {} false alarms in 1000 sound robots:",
        fixed(100.0 * terms.power, 0),
        significant(1e3 * terms.alarm, 2)
    ))?;
    console.say(shows(&model.physics, &found.detectable))?;
    unstated(input).iter().try_for_each(|warning| console.say(format!("note: {warning}")))?;
    not_checked.iter().try_for_each(|open| console.say(format!("not checked: {open}")))?;
    written(command, console)?;
    Ok(Answer::Done)
}

/// The page of a check's poses.
fn sheet<'a>(
    command: &Plan,
    model: &RobotModel,
    found: &Checkup,
    terms: &Terms,
    not_checked: &[&str],
) -> Sheet<'a> {
    let heads = ["Damage", "Minimum detectable change"];
    let shown = found
        .detectable
        .iter()
        .fold(report::Table::new("What the poses can show", heads), |table, one| {
            table.row([one.damage.says().into(), least(&model.physics, one).into()])
        });
    Sheet {
        word: format!("{} for a check", count(found.poses.len(), "pose")),
        sentence: format!(
            "Damage of the size in the table is seen in {} of 100 cases, with {} false alarms in 1000 sound robots.",
            fixed(100.0 * terms.power, 0),
            significant(1e3 * terms.alarm, 2)
        ),
        numbers: vec![report::Number::text("Poses", found.poses.len().to_string())],
        poses: numbered(&found.poses),
        details: vec![shown],
        open: not_checked.iter().map(|open| format!("not checked: {open}")).collect(),
        next: (
            "Load the program and run it slowly first; measure, fill the readings into poses.csv, and have them judged.",
            command.measured_by("plan --check", ""),
        ),
    }
}

/// What no reading of these poses can show, however large.
fn unseen(detectable: &[Detectable]) -> Vec<String> {
    let unseen = detectable.iter().filter(|found| found.least.is_none());
    unseen.map(|found| found.damage.says()).collect()
}

fn overstated(scatter: f64) -> String {
    format!(
        "the readings scatter less than is stated, which hides damage: {} of the stated `sigma` explains them",
        significant(scatter, 2)
    )
}

fn shows(model: &Model, detectable: &[Detectable]) -> String {
    let mut table = TextTable::new(["damage", "minimum detectable change"]);
    for found in detectable {
        table = table.row([found.damage.says(), least(model, found)]);
    }
    on_stdout(&table)
}

/// The minimum detectable change in words.
fn least(model: &Model, found: &Detectable) -> String {
    found.least.map_or("not detectable: absorbed by the fitted parameters".to_owned(), |least| {
        format!("{} {}", significant(1e3 * least, 2), unit(model, &found.damage))
    })
}

/// The assumptions made where nothing was stated.
fn unstated(input: &Input) -> Vec<String> {
    let mut said = Vec::new();
    if !input.model.sigma.iter().flatten().any(|sigma| *sigma > 0.0) {
        said.push(format!("{} states no uncertainty: it is taken as exact", input.model.file.name));
    }
    for recording in &input.recordings {
        if recording.about.sigma.is_empty() {
            said.push(format!(
                "{}: no `sigma` is stated: 0.05 mm is taken",
                recording.file.display()
            ));
        }
    }
    said
}

fn judged(
    command: &Plan,
    console: &mut Console,
    outputs: Outputs,
    input: &Input,
    terms: &Terms,
) -> Outcome {
    command.setup.check()?;
    let model = &input.model;
    let mut campaign =
        from_recording::campaign(&model.physics.arm, &input.recordings).map_err(Failure::input)?;
    command.setup.describe(&mut campaign);
    let mut warnings = unstated(input);
    if campaign.surroundings.targets.iter().any(|target| target.free) {
        warnings.push(
            "a target's place on the tool is fitted, so that a bent tool does not show: say where it was before (`target1_mm` in the recording's TOML, or --target with --targets-known)".to_owned(),
        );
    }
    let found = judge(&campaign, &model.physics, &model.sigma, terms);
    warnings.extend(found.scatter.map(overstated));
    warnings.iter().for_each(|warning| warn!("{warning}"));
    let suspect = |found: &Suspect| SuspectReport {
        damage: found.damage.says(),
        unit: unit(&model.physics, &found.damage),
        size: found.size.iter().map(|size| 1e3 * size).collect(),
        sigma: 1e3 * found.sigma,
        gain: found.gain,
    };
    let report = Judged {
        does: "check",
        model: &model.file.name,
        alarm: terms.alarm,
        holds: found.holds,
        poses: campaign.poses.iter().filter(|pose| !pose.seen.is_empty()).count(),
        sum: found.sum,
        freedom: found.freedom,
        p: found.p,
        scatter: found.scatter,
        unseen: unseen(&found.detectable),
        suspects: found.suspects.iter().map(suspect).collect(),
        is_explained: found.is_explained,
        power: terms.power,
        detectable: found
            .detectable
            .iter()
            .map(|d| DetectableReport::of(&model.physics, d))
            .collect(),
        warnings,
    };
    console.write(outputs, "trued.plan/1", &report)?;
    told(console, &model.physics, &found, report.poses)?;
    Ok(if found.holds { Answer::Done } else { Answer::No })
}

fn told(
    console: &mut Console,
    model: &Model,
    found: &Judgement,
    poses: usize,
) -> Result<(), Failure> {
    let sum = format!(
        "{}: sum of squares {} for {} expected (p {})",
        count(poses, "pose"),
        fixed(found.sum, 0),
        found.freedom,
        significant(found.p, 2)
    );
    if found.holds {
        let head = console.paint(Paint::Good, "the model still holds");
        console.say(format!("{head}; {sum}"))?;
        let unseen = unseen(&found.detectable);
        if !unseen.is_empty() {
            let head = console.paint(Paint::Caution, "not seen by this check");
            let unseen = unseen.join("; ");
            console.say(format!(
                "{head}: {unseen} (absorbed by the fitted targets or measuring frame)"
            ))?;
        }
        if let Some(scatter) = found.scatter {
            let head = console.paint(Paint::Caution, "noise overstated");
            console.say(format!("{head}: {}", overstated(scatter)))?;
        }
        console.say("damage that these poses would have shown:")?;
        return console.say(shows(model, &found.detectable));
    }
    let head = console.paint(Paint::Bad, "the model does not hold");
    console.say(format!("{head}; {sum}"))?;
    if found.suspects.is_empty() {
        console.say("no single joint or tool explains it: calibrate anew")?;
    }
    for (place, suspect) in found.suspects.iter().enumerate() {
        let size = suspect.size.iter().map(|size| size * size).sum::<f64>().sqrt();
        let or = if place == 0 { "" } else { "or: " };
        console.say(format!(
            "{or}{} by {} ± {} {}",
            suspect.damage.says(),
            significant(1e3 * size, 3),
            significant(1e3 * suspect.sigma, 2),
            unit(model, &suspect.damage)
        ))?;
    }
    if !found.suspects.is_empty() && !found.is_explained {
        console.say("that does not explain all of it: there is more than one thing")?;
    }
    Ok(())
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<Planned<'_>>("plan-check", "trued.plan/1"),
        ResultSchema::of::<Judged<'_>>("plan-check-judged", "trued.plan/1"),
    ]
}
