//! `trued plan --iso9283`: five poses of a cube with repeated visits, and accuracy and repeatability of measurements.

use std::collections::BTreeMap;

use diagnosis::from_recording;
use diagnosis::plan::iso::{Cube, Evaluation, VISITS, cube, largest_cube};
use diagnosis_report::iso9283;
use diagnosis_report::positions::{columns, shown};
use glam::DVec3;
use physics::Joints;
use report::{Number, TextTable, count, fixed};
use serde::Serialize;

use super::going::Going;
use super::page::Sheet;
use super::setup::Tuple;
use super::told::{not_checked, written};
use super::{Input, Plan};
use crate::atomic::Outputs;
use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};
use crate::table::on_stdout;
use crate::wrap;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Planned<'a> {
    does: &'static str,
    model: &'a str,
    seed: u64,
    cycles: usize,
    cube_middle_mm: [f64; 3],
    cube_edge_mm: f64,
    poses: Vec<BTreeMap<String, f64>>,
    not_checked: Vec<&'static str>,
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
    let cycles = command.count.map_or(VISITS, usize::from);
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
        poses: found.poses.iter().map(|q| columns(&model.physics.arm, q)).collect(),
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
        table = table.row([format!("P{}", place + 1), shown(&model.physics.arm, q)]);
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
    let arm = &model.physics.arm;
    let mut campaign = from_recording::campaign(arm, &input.recordings).map_err(Failure::input)?;
    command.setup.describe(&mut campaign);
    let evaluation = Evaluation::of(arm, &campaign).map_err(Failure::input)?;
    console.write(outputs, "trued.plan/1", &iso9283::report(model, &evaluation))?;
    let head = console.paint(Paint::Strong, &iso9283::headline(&evaluation));
    let details = iso9283::details(model, &evaluation, wrap::columns_of_stdout());
    console.say(head + &details)?;
    Ok(Answer::Done)
}

/// The schemas of the results.
#[cfg(feature = "schema")]
pub(crate) fn result_schemas() -> Vec<crate::schemas::ResultSchema> {
    use crate::schemas::ResultSchema;
    vec![
        ResultSchema::of::<Planned<'_>>("plan-iso9283", "trued.plan/1"),
        ResultSchema::of::<iso9283::Evaluated<'_>>("plan-iso9283-evaluated", "trued.plan/1"),
    ]
}
