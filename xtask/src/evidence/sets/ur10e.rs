//! UR10e, motor currents: friction, a concealed payload, load-dependent friction.
//!
//! The masses of the links are not given.

use super::super::case::{Case, Errors, LimitCheck, Reference};
use super::super::csv_table::{CsvTable, with_recording_line};
use super::super::diagnosis_result::{DiagnosisResult, FindingView};
use super::super::set_runner::{RunOutcome, SetRunner};
use super::Set;
use super::challenge::injected;
use super::tracker::check_several_mismatches;

const PRESET: &str = include_str!("../../../../deploy/presets/ur10e.toml");
const MAPPING: &str = include_str!("../../../../deploy/mappings/ur10e.mapping.toml");
const THIRTY: &str = "ur-20_02_10-30sec_12harm.csv";
const FIFTY: &str = "ur-20_02_12-50sec_12harm.csv";
const FREE: &str = "ur-20_02_19_14harm50sec.csv";
const LOADED: &str = "ur-20_02_19_14harm50secLoad.csv";
const RUNS: [&str; 8] = [
    THIRTY,
    FIFTY,
    FREE,
    LOADED,
    "ur-20_01_17-ptp_10_points.csv",
    "ur-20_01_22-joint_1.csv",
    "ur-20_01_22-joint_2.csv",
    "ur-20_01_22-joint_3.csv",
];
/// Weighed mass of the payload, kg.
const PAYLOAD_KG: f64 = 2.805;
const WEIGHED: &str = "2.805 kg, weighed (the set's note)";

pub(super) const SET: Set = Set {
    name: "ur10e",
    description: "UR10e, joints and motor currents at about 95 Hz with uneven stamps: harmonic motions, point to point, single joints; one run with a payload of 2.805 kg.",
    source: "github.com/shamilmamedov/dynamic_calibration",
    given_model: "the preset `ur10e` without its masses: the published geometry, the drive gains that the authors identified (`torque_per_ampere`), no friction, no payload.",
    files: &RUNS,
    not_run_reason: None,
    run,
};

fn run(bench: &SetRunner) -> Result<Vec<Case>, String> {
    bench.copy(&RUNS)?;
    let lines = PRESET.lines().filter(|line| !line.starts_with("link = "));
    bench.write("ur10e-bare.toml", lines.flat_map(|line| [line, "\n"]).collect::<String>())?;
    for name in RUNS {
        bench.write(&name.replace(".csv", ".mapping.toml"), MAPPING)?;
    }
    Ok(vec![
        all_runs(bench)?,
        each_run(bench)?,
        payload(bench)?,
        load_friction(bench)?,
        other_robot(bench)?,
        injected(bench, "ur10e-bare.toml", "ur-20_02_12-50sec_12harm.mapping.toml", &[FIFTY])?,
    ])
}

fn diagnose_arguments<'a>(model: &'a str, files: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["diagnose", "--model", model, "--seed", "1", "--out", "OUT"];
    arguments.extend(files);
    arguments
}

/// Findings of a payload: recording and mass.
fn payloads(result: &DiagnosisResult) -> Vec<String> {
    let of = result.findings().filter(|one| one.effect() == "payload");
    of.map(|one| one.condition().split_once(", in ").map_or("all", |(_, only)| only).to_owned())
        .collect()
}

fn mass(result: &DiagnosisResult) -> Option<(f64, [f64; 2])> {
    result.finding("payload", None)?.parameter("mass_kg")
}

fn load_shares(result: &DiagnosisResult, case: &mut Case) {
    for joint in [2, 3] {
        let found = result.finding("load_friction", Some(joint));
        let parameters = found.as_ref().map_or("not named".to_owned(), FindingView::parameters);
        let what = format!("load friction of joint {joint}");
        case.checks.push(LimitCheck::new(what, parameters, "named", found.is_some()));
    }
}

/// Four harmonic runs at once, of which one carries something.
fn all_runs(bench: &SetRunner) -> Result<Case, String> {
    let arguments = diagnose_arguments("ur10e-bare.toml", &[THIRTY, FIFTY, FREE, LOADED]);
    let answer = bench.run_trued("together", &arguments)?;
    if let RunOutcome::Done(folder) = &answer {
        bench.offer_figure(
            &folder.join("report.html"),
            "Torque error over time",
            "Torque errors over time, four runs at once: recorded minus model, with the given model and with the findings.",
        );
    }
    let (mut case, result) = Case::from_diagnosis(
        "four runs at once",
        "masses, all friction, the payload of one run",
        &arguments,
        &answer,
        "torque",
    );
    let Some(result) = result else { return Ok(case) };
    case.set_heldout_errors(&result, "Nm");
    case.reference = Some(Reference { value: None, text: WEIGHED });
    let named = payloads(&result);
    let only = named == [format!("{LOADED} only")];
    let files = if named.is_empty() { "none".to_owned() } else { named.join("; ") };
    case.checks.push(LimitCheck::new("payload found in", files, format!("{LOADED} only"), only));
    case.checks.push(LimitCheck::contains("its mass, 95 %, kg", mass(&result), PAYLOAD_KG));
    load_shares(&result, &mut case);
    Ok(case)
}

/// Each run separately: an effect that none of them has must not be found.
fn each_run(bench: &SetRunner) -> Result<Case, String> {
    let mut case = Case {
        name: "each run alone".to_owned(),
        concealed: "masses, all friction, the payload of one run".to_owned(),
        command: "trued diagnose --model ur10e-bare.toml --seed 1 --out OUT RUN".to_owned(),
        was_run: true,
        ..Case::default()
    };
    let (mut verdicts, mut carried, mut silent) = (Vec::new(), Vec::new(), Vec::new());
    for name in RUNS {
        let stem = name.trim_end_matches(".csv");
        let answer = bench.run_trued(stem, &diagnose_arguments("ur10e-bare.toml", &[name]))?;
        let (one, result) = Case::from_diagnosis(stem, "", &[], &answer, "torque");
        case.was_run &= one.was_run;
        verdicts.push(one.verdict.clone());
        let Some(result) = result else {
            case.statements.push(format!("{stem}: {}", one.verdict));
            continue;
        };
        let count = result.findings().count();
        let [before, after] = ["heldout_rms_before", "heldout_rms_after"]
            .map(|key| report::significant(result.number(key), 3));
        case.statements.push(format!(
            "{stem}: {count} named ({}); held out {before} to {after} Nm",
            result.names(3)
        ));
        if result.finding("payload", None).is_some() && name != LOADED {
            carried.push(stem);
        }
        if result.not_tested().iter().any(|one| one.contains("payload")) {
            silent.push(stem);
        }
    }
    verdicts.sort();
    verdicts.dedup();
    case.verdict = verdicts.join(", ");
    case.short = format!("{}: see the section", case.verdict);
    if case.was_run {
        let carried_by = if carried.is_empty() { "none".to_owned() } else { carried.join(", ") };
        case.checks.push(LimitCheck::new(
            "payload in runs without one",
            carried_by,
            "none",
            carried.is_empty(),
        ));
    }
    if !silent.is_empty() {
        case.shortfall_notes.push(format!("The payload was not testable in {} of {} single runs, since the masses are unknown there too.", silent.len(), RUNS.len()));
    }
    Ok(case)
}

/// Share of the payload's residual on the held-out half that its finding explains.
fn payload(bench: &SetRunner) -> Result<Case, String> {
    let name = "payload, first half of its run to the second";
    let friction = bench
        .run_trued("friction", &diagnose_arguments("ur10e-bare.toml", &[THIRTY, FIFTY, FREE]))?;
    let RunOutcome::Done(folder) = &friction else {
        return Ok(Case::from_diagnosis(
            name,
            "the payload",
            &diagnose_arguments("ur10e-bare.toml", &[THIRTY, FIFTY, FREE]),
            &friction,
            "torque",
        )
        .0);
    };
    let model =
        std::fs::read_to_string(folder.join("model.toml")).map_err(|why| why.to_string())?;
    bench.write("with-friction.toml", model)?;
    let sheet = CsvTable::read(&bench.data(LOADED)?);
    let half = sheet.len() / 2;
    bench.write(
        "loaded-halves.csv",
        sheet.with_column("half", |k| u8::from(k >= half).to_string()).text(),
    )?;
    let segment = "[columns]\nsegment = { from = \"half\" }\n";
    let mapping =
        with_recording_line(&MAPPING.replacen("[columns]\n", segment, 1), "heldout = [1]");
    bench.write("loaded-halves.mapping.toml", mapping)?;
    let arguments =
        diagnose_arguments("with-friction.toml", &[THIRTY, FIFTY, FREE, "loaded-halves.csv"]);
    let answer = bench.run_trued("payload", &arguments)?;
    let concealed =
        "the payload and the masses; friction is as identified on the three runs without it";
    let (mut case, result) = Case::from_diagnosis(name, concealed, &arguments, &answer, "torque");
    let Some(result) = result else { return Ok(case) };
    case.reference = Some(Reference { value: None, text: WEIGHED });
    let found = result.finding("payload", None);
    let errors = found
        .as_ref()
        .map(|one| ["heldout_rms_before", "heldout_rms_after"].map(|key| one.number(key)));
    let [before, after] = errors.unwrap_or([f64::NAN; 2]);
    case.errors = Some(Errors {
        before,
        after,
        unit: "Nm",
        quantity: "root mean square, unseen half, without and with the payload",
    });
    let share = 100.0 * (1.0 - (after / before).powi(2));
    case.checks.push(LimitCheck::at_least(
        "residual energy of the unseen half that the payload explains",
        share,
        95.0,
        "%",
    ));
    case.checks.push(LimitCheck::contains("its mass, 95 %, kg", mass(&result), PAYLOAD_KG));
    Ok(case)
}

/// The program's findings without load-dependent friction; other runs are held out.
fn load_friction(bench: &SetRunner) -> Result<Case, String> {
    let name = "load friction of joints 2 and 3";
    for run in [THIRTY, FREE] {
        let stem = format!("unseen-{}", run.trim_end_matches(".csv"));
        bench.write(&format!("{stem}.csv"), bench.data(run)?)?;
        bench.write(
            &format!("{stem}.mapping.toml"),
            with_recording_line(MAPPING, "heldout = \"all\""),
        )?;
    }
    let [thirty, free] = [THIRTY, FREE].map(|run| format!("unseen-{run}"));
    let files = [FIFTY, thirty.as_str(), free.as_str()];
    let whole = bench.run_trued("from-fifty", &diagnose_arguments("ur10e-bare.toml", &files))?;
    let RunOutcome::Done(folder) = &whole else {
        return Ok(Case::from_diagnosis(
            name,
            "load friction",
            &diagnose_arguments("ur10e-bare.toml", &files),
            &whole,
            "torque",
        )
        .0);
    };
    let model =
        std::fs::read_to_string(folder.join("model.toml")).map_err(|why| why.to_string())?;
    let kept = model.split("[[effect]]").filter(|part| !part.contains("\"load_friction\""));
    bench.write("without-load-friction.toml", kept.collect::<Vec<_>>().join("[[effect]]"))?;
    let arguments = diagnose_arguments("without-load-friction.toml", &files);
    let answer = bench.run_trued("load-friction", &arguments)?;
    let concealed = "masses and load friction; all other friction is as identified on the 50 s run. Held out: the runs of 30 s and of 14 harmonics";
    let (mut case, result) = Case::from_diagnosis(name, concealed, &arguments, &answer, "torque");
    let Some(result) = result else { return Ok(case) };
    let joint = |key: &str| result.joint(2).and_then(|one| one[key].as_f64()).unwrap_or(f64::NAN);
    let [before, after] = ["heldout_rms_before", "heldout_rms_after"].map(joint);
    case.errors = Some(Errors {
        before,
        after,
        unit: "Nm",
        quantity: "root mean square of joint 2, unseen runs",
    });
    case.reference = Some(Reference {
        value: Some(2.4),
        text: "3.6 to 4.0 Nm without, 2.3 to 2.4 Nm with load friction (our own least-squares fit of these runs)",
    });
    load_shares(&result, &mut case);
    case.checks.push(LimitCheck::at_most("joint 2 on unseen runs", after, 2.4, "Nm"));
    Ok(case)
}

/// Another robot's model.
fn other_robot(bench: &SetRunner) -> Result<Case, String> {
    let arguments = diagnose_arguments("kuka-kr240", &[FIFTY]);
    let answer = bench.run_trued("other-robot", &arguments)?;
    let concealed =
        "that the recording is of another robot: the model is of the KUKA KR 240, with masses";
    let (mut case, result) =
        Case::from_diagnosis("a model of another robot", concealed, &arguments, &answer, "torque");
    if let Some(result) = result {
        case.checks.push(check_several_mismatches(&result));
    }
    Ok(case)
}
