//! `trued plan --iso9283`: five poses of a cube with repeated visits, and accuracy and repeatability of measurements.

use diagnosis::from_recording;
use diagnosis::iso9283::{self, DistanceFigures, Placement, PoseFigures};
use diagnosis::plan::iso::{Cube, Visits, cube, largest_cube, visits};
use glam::DVec3;
use physics::Joints;
use report::{Number, TextTable, count, fixed};
use serde::Serialize;
use serde_json::{Map, Value};

use super::going::Going;
use super::page::Sheet;
use super::setup::Tuple;
use super::told::{joints, not_checked, shown, written};
use super::{Input, Plan};
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};
use crate::table::on_stdout;

/// Cycles that the standard asks for.
const CYCLES: usize = 30;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Planned<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    cycles: usize,
    cube_middle_mm: [f64; 3],
    cube_edge_mm: f64,
    poses: Vec<Map<String, Value>>,
    not_checked: Vec<&'static str>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Evaluated<'a> {
    does: &'static str,
    model: &'a str,
    is_frame_known: bool,
    poses: Vec<PoseReport>,
    distance: Option<DistanceReport>,
    notes: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PoseReport {
    #[serde(flatten)]
    q: Map<String, Value>,
    visits: usize,
    accuracy_mm: Option<f64>,
    accuracy_xyz_mm: Option<[f64; 3]>,
    accuracy_abc_mrad: Option<[f64; 3]>,
    repeatability_mm: f64,
    repeatability_abc_mrad: Option<[f64; 3]>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct DistanceReport {
    visits: usize,
    accuracy_mm: f64,
    repeatability_mm: f64,
}

pub(super) fn run(
    command: &Plan,
    console: &mut Console,
    outputs: Outputs,
    input: &Input,
) -> Outcome {
    if input.recordings.is_empty() {
        planned(command, console, outputs, input)
    } else {
        evaluated(command, console, outputs, input)
    }
}

fn planned(command: &Plan, console: &mut Console, mut outputs: Outputs, input: &Input) -> Outcome {
    let seed = command.seed.settle();
    let going = command.set_up(input)?;
    let model = &input.model;
    let found = the_cube(command, input, &going, seed)?;
    let cycles = command.count.map_or(CYCLES, usize::from);
    // Always from the same side: P5 to P1, and so on round.
    let cycle = [4, 3, 2, 1, 0].map(|place| found.poses[place]);
    let stops: Vec<Joints> = (0..cycles).flat_map(|_| cycle).collect();
    command.files.put_direct(&mut outputs, model, &going.task, &stops)?;
    let middle = 1e3 * found.middle;
    let not_checked = not_checked(command, &going);
    let report = Planned {
        does: "iso9283",
        model: &model.file.name,
        seed,
        cycles,
        cube_middle_mm: middle.to_array(),
        cube_edge_mm: 1e3 * found.edge_m,
        poses: found.poses.iter().map(|q| joints(model, q)).collect(),
        not_checked: not_checked.clone(),
    };
    let names = (1..).map(|place| format!("P{place}"));
    let sheet = Sheet {
        word: format!("five poses, {}", count(cycles, "cycle")),
        sentence: format!(
            "A cube of {} mm about {} {} {} mm (base frame): the tool goes through P5, P4, P3, P2, P1, {}.",
            fixed(1e3 * found.edge_m, 0),
            fixed(middle.x, 0),
            fixed(middle.y, 0),
            fixed(middle.z, 0),
            count(cycles, "time")
        ),
        numbers: vec![
            Number::new("Edge of the cube", 1e3 * found.edge_m, "mm"),
            Number::text("Cycles", cycles.to_string()),
        ],
        poses: names.zip(found.poses).collect(),
        details: Vec::new(),
        open: not_checked.iter().map(|open| format!("not checked: {open}")).collect(),
        next: (
            "Set rated load and rated speed, warm the robot up, run the program slowly first; then measure and evaluate.",
            command.measured_by("plan --iso9283", ""),
        ),
    };
    command.files.put_page(&mut outputs, input, &sheet);
    console.write(outputs, "trued.plan/1", &report)?;
    console.say(format!(
        "a cube of {} mm about {} {} {} mm; {} of P5, P4, P3, P2, P1",
        fixed(1e3 * found.edge_m, 0),
        fixed(middle.x, 0),
        fixed(middle.y, 0),
        fixed(middle.z, 0),
        count(cycles, "cycle")
    ))?;
    let mut table = TextTable::new(["pose", "joints, deg (mm)"]);
    for (place, q) in found.poses.iter().enumerate() {
        table = table.row([format!("P{}", place + 1), shown(model, q)]);
    }
    console.say(on_stdout(&table))?;
    console.say(
        "the standard asks for rated load, rated speed, a warm robot: set them on the controller",
    )?;
    not_checked.iter().try_for_each(|open| console.say(format!("not checked: {open}")))?;
    written(command, console)?;
    Ok(Answer::Done)
}

fn the_cube(command: &Plan, input: &Input, going: &Going, seed: u64) -> Result<Cube, Failure> {
    let (arm, reach) = (&input.model.physics.arm, &going.task.reach);
    let directions = command.directions()?;
    let along = directions.first().copied().unwrap_or(DVec3::NEG_Z);
    let found = match command.zone {
        None => largest_cube(arm, reach, along, seed),
        Some(Tuple([a, b, c, d, e, f])) => {
            let (one, other) = (1e-3 * DVec3::new(a, b, c), 1e-3 * DVec3::new(d, e, f));
            let edges = (other - one).abs();
            if edges.max_element() - edges.min_element() > 1e-6 {
                return Err(Failure::input("--zone: the standard's cube has edges of one length"));
            }
            cube(arm, reach, 0.5 * (one + other), edges.x, along, seed)
        }
    };
    found.ok_or_else(|| {
        Failure::input("the arm cannot stand at all five poses with the tool in this direction: give another cube (--zone) or --direction")
    })
}

fn evaluated(command: &Plan, console: &mut Console, outputs: Outputs, input: &Input) -> Outcome {
    let model = &input.model;
    let mut campaign =
        from_recording::campaign(&model.physics.arm, &input.recordings).map_err(Failure::input)?;
    command.setup.describe(&mut campaign);
    let around = &campaign.surroundings;
    let is_frame_known = around.frames.iter().all(|frame| !frame.free);
    let is_point_known = around.targets.iter().all(|target| !target.free);
    let found = visits(&model.physics.arm, &campaign);
    if found.is_empty() {
        return Err(Failure::input(
            "no pose was visited twice with its place measured: nothing to evaluate",
        ));
    }
    let mut notes = Vec::new();
    if !(is_frame_known && is_point_known) {
        notes.push("no accuracy: it needs the measuring frame brought to the base (`measuring_frame = \"base\"`, --frame-known) and the target's place on the tool (`target1_mm`); a frame fitted here would hide it".to_owned());
    }
    if found.iter().any(|pose| pose.attained.len() < CYCLES) {
        notes.push(format!("the standard asks for {CYCLES} visits of each pose"));
    }
    let mut rows = Vec::new();
    for pose in &found {
        let figures = iso9283::pose(&pose.command, &pose.attained).map_err(Failure::input)?;
        rows.push((pose, figures));
    }
    let distance = distance(&found, is_point_known);
    let with_accuracy = is_frame_known && is_point_known;
    let report = Evaluated {
        does: "iso9283",
        model: &model.file.name,
        is_frame_known,
        poses: rows
            .iter()
            .map(|(pose, figures)| row(input, pose, figures, with_accuracy))
            .collect(),
        distance: distance.map(|d| DistanceReport {
            visits: d.visits,
            accuracy_mm: 1e3 * d.accuracy_m,
            repeatability_mm: 1e3 * d.repeatability_m,
        }),
        notes: notes.clone(),
    };
    console.write(outputs, "trued.plan/1", &report)?;
    told(console, input, &rows, with_accuracy)?;
    if let Some(found) = distance {
        console.say(format!(
            "distance between the two poses farthest apart: accuracy {} mm, repeatability ±{} mm",
            fixed(1e3 * found.accuracy_m, 3),
            fixed(1e3 * found.repeatability_m, 3)
        ))?;
    }
    notes.iter().try_for_each(|note| console.say(format!("note: {note}")))?;
    Ok(Answer::Done)
}

fn told(
    console: &mut Console,
    input: &Input,
    rows: &[(&Visits, PoseFigures)],
    with_accuracy: bool,
) -> Result<(), Failure> {
    let worst = rows.iter().map(|(_, figures)| figures.repeatability_m).fold(0.0, f64::max);
    let accuracy = rows.iter().map(|(_, figures)| figures.accuracy_m).fold(0.0, f64::max);
    let head = console.paint(Paint::Strong, &format!("repeatability {} mm", fixed(1e3 * worst, 3)));
    let beside = if with_accuracy {
        format!(", accuracy {} mm", fixed(1e3 * accuracy, 3))
    } else {
        String::new()
    };
    console.say(format!("{head}{beside} (worst of {})", count(rows.len(), "pose")))?;
    let mut table = TextTable::new(["joints, deg (mm)", "visits", "AP, mm", "RP, mm"]);
    for (pose, figures) in rows {
        let accuracy =
            if with_accuracy { fixed(1e3 * figures.accuracy_m, 3) } else { "–".to_owned() };
        table = table.row([
            shown(&input.model, &pose.q),
            figures.visits.to_string(),
            accuracy,
            fixed(1e3 * figures.repeatability_m, 3),
        ]);
    }
    console.say(on_stdout(&table))
}

fn row(input: &Input, pose: &Visits, figures: &PoseFigures, with_accuracy: bool) -> PoseReport {
    let milli = |v: DVec3| (1e3 * v).to_array();
    PoseReport {
        q: joints(&input.model, &pose.q),
        visits: figures.visits,
        accuracy_mm: with_accuracy.then_some(1e3 * figures.accuracy_m),
        accuracy_xyz_mm: with_accuracy.then(|| milli(figures.accuracy_xyz_m)),
        accuracy_abc_mrad: figures.accuracy_abc_rad.filter(|_| with_accuracy).map(milli),
        repeatability_mm: 1e3 * figures.repeatability_m,
        repeatability_abc_mrad: figures.repeatability_abc_rad.map(milli),
    }
}

/// Of the two poses farthest apart; it needs no frame.
fn distance(found: &[Visits], is_point_known: bool) -> Option<DistanceFigures> {
    let place = |pose: &Visits| Placement::point(pose.command.position_m);
    let pairs = (0..found.len()).flat_map(|i| (i + 1..found.len()).map(move |j| (i, j)));
    let length = |(i, j): &(usize, usize)| {
        found[*i].command.position_m.distance(found[*j].command.position_m)
    };
    let (i, j) = pairs.filter(|_| is_point_known).max_by(|a, b| length(a).total_cmp(&length(b)))?;
    let visits = found[i].attained.iter().zip(&found[j].attained);
    let visits: Vec<[Placement; 2]> = visits
        .map(|(a, b)| [Placement::point(a.position_m), Placement::point(b.position_m)])
        .collect();
    iso9283::distance([place(&found[i]), place(&found[j])], &visits).ok()
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<Planned<'_>>("plan-iso9283", "trued.plan/1"),
        ResultSchema::of::<Evaluated<'_>>("plan-iso9283-evaluated", "trued.plan/1"),
    ]
}
