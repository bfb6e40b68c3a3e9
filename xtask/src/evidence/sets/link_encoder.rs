//! A heavy KUKA with link-side encoders: deviations between motor and link.

use super::super::case::{Case, LimitCheck, Reference};
use super::super::csv_table::with_recording_line;
use super::super::diagnosis_result::DiagnosisResult;
use super::super::set_runner::{RunOutcome, SetRunner};
use super::Set;

const MAPPING: &str = include_str!("../../../../deploy/mappings/kuka-link-encoder.mapping.toml");

pub(super) const SET: Set = Set {
    name: "kuka-link-encoder",
    description: "A heavy KUKA arm with second encoders on the link side of axes 1 to 3, 250 Hz, two trajectories of 10 s, torque recorded.",
    source: "github.com/JonasWeigand/Robot_Identification, MIT licence",
    given_model: "the preset `kuka-kr240` (geometry of the same series, estimated masses): rigid joints, no delay, no backlash. The set does not state the robot.",
    files: &["traj_A.csv", "traj_B.csv"],
    not_run_reason: None,
    run,
};

fn run(bench: &SetRunner) -> Result<Vec<Case>, String> {
    bench.copy(&["traj_A.csv", "traj_B.csv"])?;
    bench.write("traj_A.mapping.toml", MAPPING)?;
    bench.write("traj_B.mapping.toml", MAPPING)?;
    let unseen = bench.data("traj_B.csv")?;
    bench.write("unseen_B.csv", unseen)?;
    bench.write("unseen_B.mapping.toml", with_recording_line(MAPPING, "heldout = \"all\""))?;
    let runs: [(&str, &str, &[&str]); 3] = [
        ("A to B", "a-to-b", &["traj_A.csv", "unseen_B.csv"]),
        ("A alone", "a", &["traj_A.csv"]),
        ("B alone", "b", &["traj_B.csv"]),
    ];
    let mut cases = Vec::new();
    for (name, run, files) in runs {
        let mut arguments =
            vec!["diagnose", "--model", "kuka-kr240", "--seed", "1", "--out", "OUT"];
        arguments.extend(files);
        let answer = bench.run_trued(run, &arguments)?;
        if let RunOutcome::Done(folder) = &answer {
            bench.offer_figure(
                &folder.join("report.html"),
                "Errors of the readings, before and after",
                "Link-side minus predicted angle over time, with the given model and with the findings.",
            );
        }
        let concealed = "all effects between motor encoder and link";
        let (mut case, result) =
            Case::from_diagnosis(name, concealed, &arguments, &answer, "position");
        if let Some(result) = result {
            case.set_heldout_errors(&result, "mrad");
            case.reference = Some(Reference {
                value: None,
                text: "least squares of the set's note, fitted on A: axes 1 to 3 of B 0.030, 0.032, 0.034 deg as they are, 0.0037, 0.0045, 0.0039 deg with delay and compliance",
            });
            check_joints(&mut case, &result);
        }
        cases.push(case);
    }
    Ok(cases)
}

fn check_joints(case: &mut Case, result: &DiagnosisResult) {
    let first = result.findings().next();
    let is_delay = first.as_ref().is_some_and(|one| one.effect() == "time_delay");
    let name = first.map_or("nothing".to_owned(), |one| one.name());
    case.checks.push(LimitCheck::new("first finding", name, "time delay", is_delay));
    let delay = result.finding("time_delay", None).and_then(|one| one.parameter("delay_ms"));
    let (delay_text, right) = delay.map_or(("not named".to_owned(), false), |(ms, _)| {
        (format!("{ms:.2} ms"), (2.5..=3.5).contains(&ms.abs()))
    });
    case.checks.push(LimitCheck::new("its size", delay_text, "2.5 to 3.5 ms, either sign", right));
    let soft = |joint: u64| {
        let names = ["joint_compliance", "gravity_compliance", "gravity_sag", "load_compliance"];
        names.iter().any(|name| result.finding(name, Some(joint)).is_some())
    };
    let found: Vec<String> = (2..=3).filter(|joint| soft(*joint)).map(|j| j.to_string()).collect();
    let joints = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
    case.checks.push(LimitCheck::new("compliance of joints", joints, "2, 3", found.len() == 2));
    let play = [1, 2].iter().any(|joint| result.finding("backlash", Some(*joint)).is_some());
    let finding = if play { "named" } else { "none" };
    case.checks.push(LimitCheck::new("backlash of joints 1 and 2", finding, "none", !play));
}
