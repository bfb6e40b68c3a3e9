//! Output of a plan: table and JSON.

use std::collections::BTreeMap;
use std::path::PathBuf;

use diagnosis::plan::next::AHEAD;
use diagnosis::plan::{Added, Criterion, Falls, Next, Plan as Planned, Sees};
use diagnosis_report::positions::{columns, shown};
use physics::Joints;
use recording::model::RobotModel;
use report::{Number, Table, TextTable, count, significant};
use serde::Serialize;

use super::going::Going;
use super::page::{Sheet, numbered};
use super::{Input, Plan};
use crate::atomic::Outputs;
use crate::exit::Failure;
use crate::output::{Console, Paint};
use crate::table::on_stdout;

/// Number of open questions on the console.
const OPEN: usize = 3;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    criterion: &'static str,
    candidates: usize,
    measured_poses: usize,
    poses: Vec<PoseReport>,
    numbers: Vec<FallsReport>,
    undetermined: &'a [String],
    not_checked: Vec<&'static str>,
    out: Option<PathBuf>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct NextReport<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    measured_poses: usize,
    enough: bool,
    tool_mm: f64,
    tool_with_ten_more_mm: f64,
    worth_mm: f64,
    pose: PoseReport,
    not_checked: Vec<&'static str>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PoseReport {
    #[serde(flatten)]
    q: BTreeMap<String, f64>,
    readings: usize,
    log_det_gain: f64,
    o1: Option<f64>,
    tool_before_mm: f64,
    tool_after_mm: f64,
    surer: Vec<FallsReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct FallsReport {
    what: String,
    unit: &'static str,
    sigma_before: f64,
    sigma_after: f64,
}

impl PoseReport {
    fn of(model: &RobotModel, pose: &Added) -> Self {
        Self {
            q: columns(&model.physics.arm, &pose.q),
            readings: pose.readings,
            log_det_gain: pose.log_det_gain,
            o1: pose.o1,
            tool_before_mm: 1e3 * pose.tool_m[0],
            tool_after_mm: 1e3 * pose.tool_m[1],
            surer: pose.falls.iter().map(FallsReport::of).collect(),
        }
    }
}

impl FallsReport {
    fn of(falls: &Falls) -> Self {
        let (suffix, si) = falls.unit;
        Self {
            what: falls.what.clone(),
            unit: suffix.trim_start_matches('_'),
            sigma_before: falls.from / si,
            sigma_after: falls.to / si,
        }
    }
}

/// What no constraint checked, as sentences.
pub(super) fn not_checked(command: &Plan, going: &Going) -> Vec<&'static str> {
    let mut open = vec![
        "the way between two poses: try the program slowly first",
        "fixtures, cables and the tool's body, unless boxes (--keep-out) stand for them",
    ];
    if matches!(going.task.sees, Sees::Points { .. }) && !command.setup.is_seen_from_somewhere() {
        open.push("whether the instrument sees the target: say where it stands with --instrument");
    }
    open
}

fn mm(metres: f64) -> String {
    significant(1e3 * metres, 3)
}

/// `joint 4's offset (joint_offset) 0.42 → 0.11 mrad`.
fn surer(falls: &Falls) -> String {
    let (suffix, si) = falls.unit;
    let number = |sigma: f64| significant(sigma / si, 2);
    let unit = suffix.trim_start_matches('_').replace("_per_", "/");
    format!("{} {} → {} {unit}", falls.what, number(falls.from), number(falls.to))
}

/// The page of a plan.
fn sheet<'a>(
    command: &Plan,
    planned: &Planned,
    criterion: &str,
    not_checked: &[&str],
) -> Sheet<'a> {
    let whereabouts = command.whereabouts();
    let expected = planned.poses.first().zip(planned.poses.last());
    let [before, after] = expected
        .map_or([f64::NAN; 2], |(first, last)| [1e3 * first.tool_m[0], 1e3 * last.tool_m[1]]);
    let heads = ["Number", "Unit", "Uncertain by now", "Then"];
    let surer = planned.numbers.iter().map(FallsReport::of).fold(
        Table::new("Standard uncertainty of what becomes known", heads),
        |table, falls| {
            let unit = falls.unit.replace("_per_", "/");
            table.row([
                falls.what.into(),
                unit.into(),
                significant(falls.sigma_before, 2).into(),
                significant(falls.sigma_after, 2).into(),
            ])
        },
    );
    let open = planned
        .undetermined
        .iter()
        .map(|open| format!("not identifiable from these poses: {open}"));
    let open = open.chain(not_checked.iter().map(|open| format!("not checked: {open}")));
    let poses: Vec<Joints> = planned.poses.iter().map(|pose| pose.q).collect();
    Sheet {
        word: format!("{} to measure", count(planned.poses.len(), "pose")),
        sentence: format!(
            "{} of {} that pass, {}. With them the tool's expected error {whereabouts} falls from {} to {} mm.",
            count(planned.poses.len(), "pose"),
            planned.candidates,
            words(command, criterion),
            significant(before, 2),
            significant(after, 2)
        ),
        numbers: vec![
            Number::text("Poses", planned.poses.len().to_string()),
            Number::new("Expected error now", before, "mm").note(whereabouts),
            Number::new("Expected error then", after, "mm").note(whereabouts),
        ],
        poses: numbered(&poses),
        details: vec![surer],
        open: open.collect(),
        next: command.to_calibrate(),
    }
}

pub(super) fn plan(
    command: &Plan,
    console: &mut Console,
    mut outputs: Outputs,
    input: &Input,
    going: &Going,
    planned: &Planned,
    seed: u64,
) -> Result<(), Failure> {
    let criterion = word(command.wish(0, seed).criterion);
    let model = &input.model;
    let not_checked = not_checked(command, going);
    let report = Report {
        does: "plan",
        model: &model.file.name,
        seed,
        criterion,
        candidates: planned.candidates,
        measured_poses: measured(going),
        poses: planned.poses.iter().map(|pose| PoseReport::of(model, pose)).collect(),
        numbers: planned.numbers.iter().map(FallsReport::of).collect(),
        undetermined: &planned.undetermined,
        not_checked: not_checked.clone(),
        out: command.files.out().map(Into::into),
    };
    let sheet = sheet(command, planned, criterion, &not_checked);
    command.files.put_page(&mut outputs, input, &sheet);
    console.write(outputs, "trued.plan/1", &report)?;
    let head = console.paint(Paint::Strong, &count(planned.poses.len(), "pose"));
    console.say(format!(
        "{head} of {} that pass (seed {seed}), {}; measured so far: {}",
        planned.candidates,
        words(command, criterion),
        measured(going)
    ))?;
    console.say(table_of_poses(model, planned))?;
    if let (Some(first), Some(last)) = (planned.poses.first(), planned.poses.last()) {
        console.say(format!(
            "expected error of the tool {}: {} mm before, {} mm after",
            command.whereabouts(),
            mm(first.tool_m[0]),
            mm(last.tool_m[1])
        ))?;
    }
    for open in planned.undetermined.iter().take(OPEN) {
        console.say(format!("stays open: {open}"))?;
    }
    if planned.undetermined.len() > OPEN {
        console
            .say(format!("stays open: {} more, in --json", planned.undetermined.len() - OPEN))?;
    }
    not_checked.iter().try_for_each(|open| console.say(format!("not checked: {open}")))?;
    written(command, console)
}

/// Each pose in a line, followed by the parameters that it improves.
fn table_of_poses(model: &RobotModel, planned: &Planned) -> String {
    let start = TextTable::new(["pose", "joints, deg (mm)", "tool, mm"]);
    let table = planned.poses.iter().enumerate().fold(start, |table, (place, pose)| {
        let tool = format!("{} → {}", mm(pose.tool_m[0]), mm(pose.tool_m[1]));
        table.row([(place + 1).to_string(), shown(&model.physics.arm, &pose.q), tool])
    });
    let table = on_stdout(&table);
    let surer = planned.poses.iter().map(|pose| pose.falls.first().map(surer));
    let lines = table.lines().zip(std::iter::once(None).chain(surer));
    lines.fold(String::new(), |text, (line, surer)| match surer {
        Some(surer) => format!("{text}{line}\n      {surer}\n"),
        None => format!("{text}{line}\n"),
    })
}

fn word(criterion: Criterion) -> &'static str {
    match criterion {
        Criterion::D => "d",
        Criterion::O1 => "o1",
        Criterion::Zone => "zone",
        Criterion::Random => "random",
    }
}

fn words(command: &Plan, criterion: &str) -> String {
    match criterion {
        "d" => "best for all numbers together (D)".to_owned(),
        "o1" => "best for what each reading brings (O1)".to_owned(),
        "random" => "drawn by chance".to_owned(),
        _ => format!("best for the tool {}", command.whereabouts()),
    }
}

pub(super) fn written(command: &Plan, console: &mut Console) -> Result<(), Failure> {
    let Some(out) = command.files.out() else { return Ok(()) };
    let out = out.display();
    console.say(format!("written: {out}/poses.csv with poses.toml (fill in what is measured), poses.mod, poses.src, poses.dat"))
}

fn measured(going: &Going) -> usize {
    going
        .known
        .as_ref()
        .map_or(0, |(campaign, _)| campaign.poses.iter().filter(|p| !p.seen.is_empty()).count())
}

pub(super) fn next(
    command: &Plan,
    console: &mut Console,
    mut outputs: Outputs,
    input: &Input,
    going: &Going,
    found: &Next,
    seed: u64,
) -> Result<(), Failure> {
    let not_checked = not_checked(command, going);
    let [now, later] = found.tool_m;
    let report = NextReport {
        does: "next",
        model: &input.model.file.name,
        seed,
        measured_poses: measured(going),
        enough: found.enough,
        tool_mm: 1e3 * now,
        tool_with_ten_more_mm: 1e3 * later,
        worth_mm: command.worth_mm,
        pose: PoseReport::of(&input.model, &found.pose),
        not_checked: not_checked.clone(),
    };
    let whereabouts = command.whereabouts();
    let brings = format!(
        "{} measured; the tool is known to {} mm {whereabouts}; {AHEAD} more poses would bring {} mm",
        count(measured(going), "pose"),
        mm(now),
        mm(now - later)
    );
    let surer: Vec<String> = found.pose.falls.iter().map(surer).collect();
    let mut open: Vec<String> = surer.iter().map(|one| format!("becomes surer: {one}")).collect();
    open.extend(not_checked.iter().map(|open| format!("not checked: {open}")));
    let sheet = Sheet {
        word: if found.enough { "enough measured" } else { "go on with this pose" }.to_owned(),
        sentence: format!("{brings}."),
        numbers: vec![
            Number::new("Expected error now", 1e3 * found.pose.tool_m[0], "mm").note(whereabouts),
            Number::new("With this pose", 1e3 * found.pose.tool_m[1], "mm").note(whereabouts),
            Number::new("Worth measuring", command.worth_mm, "mm").note("for ten more poses"),
        ],
        poses: vec![("next".to_owned(), found.pose.q)],
        details: Vec::new(),
        open,
        next: command.to_calibrate(),
    };
    command.files.put_page(&mut outputs, input, &sheet);
    console.write(outputs, "trued.plan/1", &report)?;
    if found.enough {
        let head = console.paint(Paint::Good, "enough");
        console
            .say(format!("{head}: {brings} (worth measuring: {} mm): stop", command.worth_mm))?;
    } else {
        let head = console.paint(Paint::Strong, "go on");
        console.say(format!("{head}: {brings}"))?;
    }
    let q = shown(&input.model.physics.arm, &found.pose.q);
    console.say(format!("next: {q}  (joints, deg; mm where one slides)"))?;
    console.say(format!(
        "why: the tool goes from {} to {} mm with it; {}",
        mm(found.pose.tool_m[0]),
        mm(found.pose.tool_m[1]),
        surer.join("; ")
    ))?;
    not_checked.iter().try_for_each(|open| console.say(format!("not checked: {open}")))?;
    written(command, console)
}

impl Plan {
    fn whereabouts(&self) -> &'static str {
        if self.zone.is_some() { "in the zone" } else { "over the workspace" }
    }
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<Report<'_>>("plan-poses", "trued.plan/1"),
        ResultSchema::of::<NextReport<'_>>("plan-next", "trued.plan/1"),
    ]
}
