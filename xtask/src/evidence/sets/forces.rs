//! Forces and vibration of real cuts, and of a beam whose tone changes at a known time.

use serde_json::Value;

use super::super::case::{Case, LimitCheck, Reference, outcome_text};
use super::super::diagnosis_result::DiagnosisResult;
use super::super::set_runner::{RunOutcome, SetRunner, json};
use super::Set;

const TURNED: &str = include_str!("../../../../deploy/mappings/turning-force.mapping.toml");
const MILLED: &str = include_str!("../../../../deploy/mappings/milling-chatter.mapping.toml");

pub(super) const TURNING: Set = Set {
    name: "turning-force",
    description: "Turning of steel, three forces and a tacho at 10 kHz, 6.5 s: air, entry, cut, exit. A stable cut according to its authors.",
    source: "github.com/mati-paredes/Turning-Cutting-Forces",
    given_model: "depth, feed and the authors' cutting coefficient, in the mapping; no model.",
    files: &["f416_a100.csv"],
    not_run_reason: None,
    run: turning,
};

pub(super) const MILLING: Set = Set {
    name: "milling-chatter",
    description: "Milling, one accelerometer at 10 kHz, 8 s, 4 teeth at 5000 rev/min; the file has the single label \"chatter\". Its largest line is an electrical tone at 150 Hz.",
    source: "github.com/mhrahimi/Real-time-chatter-detection-using-AutoML-CNN, MIT licence",
    given_model: "the spindle's speed; no model.",
    files: &["N255_S5000_accY.csv"],
    not_run_reason: None,
    run: milling,
};

pub(super) const BEAM: Set = Set {
    name: "beam-tone",
    description: "A steel beam on a shaker, force and acceleration at 3200 Hz; the tones change at a known time, 9.75 s into test 3.",
    source: "github.com/PujaChowdhury/Dataset-4-Univariate-signal-with-non-stationarity, CC BY-SA 4.0",
    given_model: "nothing but the samples.",
    files: &["test_2_ds16.lvm", "test_3_ds16.lvm"],
    not_run_reason: None,
    run: beam,
};

fn turning(bench: &SetRunner) -> Result<Vec<Case>, String> {
    bench.copy(&["f416_a100.csv"])?;
    bench.write("f416_a100.mapping.toml", TURNED)?;
    let arguments = ["diagnose", "--seed", "1", "--out", "OUT", "f416_a100.csv"];
    let answer = bench.run_trued("cut", &arguments)?;
    let (mut case, result) = Case::from_diagnosis(
        "phases and chatter",
        "when the tool cuts; whether it chatters; the offset of the sensor",
        &arguments,
        &answer,
        "force",
    );
    if let (Some(result), RunOutcome::Done(folder)) = (result, &answer) {
        bench.offer_figure(
            &folder.join("report.html"),
            "Distance of the signal",
            "Distance of the signal from its mean at rest: the phases of the cut.",
        );
        case.set_heldout_errors(&result, "N");
        case.reference = Some(Reference {
            value: None,
            text: "means of the cut 250.9, 287.8, 725.6 N and K_s of 1609.5 N/mm² (the authors' tables)",
        });
        phases(&result, &mut case);
        let chatter = result.finding("chatter", None).is_some();
        case.checks.push(LimitCheck::new(
            "chatter",
            if chatter { "named" } else { "none" },
            "none",
            !chatter,
        ));
    }
    let arguments =
        ["spectrum", "--json", "OUT/said.json", "--report", "OUT/report.html", "f416_a100.csv"];
    let watch = bench.run_trued("watch", &arguments)?;
    let mut watched =
        spectrum_case("the vibration monitor", "whether it chatters", &arguments, &watch);
    if let RunOutcome::Done(folder) = &watch {
        let alarms = alarms(&json(&folder.join("said.json")));
        let listed = lines(&alarms);
        watched.checks.push(LimitCheck::new("alarms", listed, "none", alarms.is_empty()));
    }
    Ok(vec![case, watched])
}

/// Air, cut and exit, and the forces of the cut.
fn phases(result: &DiagnosisResult, case: &mut Case) {
    let all = result.list("phases");
    let states: Vec<&str> = all.iter().filter_map(|one| one["state"].as_str()).collect();
    let apart = ["air", "cut", "exit"].iter().all(|state| states.contains(state));
    case.checks.push(LimitCheck::new(
        "phases",
        states.join(", "),
        "air, cut and exit distinguished",
        apart,
    ));
    for one in all {
        let number = |key: &str| report::significant(one[key].as_f64().unwrap_or(f64::NAN), 3);
        let mean: Vec<String> = one["mean"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|x| report::significant(x.as_f64().unwrap_or(f64::NAN), 3))
            .collect();
        let state = one["state"].as_str().unwrap_or("");
        case.statements.push(format!(
            "{state} from {} to {} s: {} {} in the mean",
            number("from_s"),
            number("to_s"),
            mean.join(", "),
            result.text("unit")
        ));
    }
    case.statements.extend(
        result
            .list("notes")
            .iter()
            .filter_map(|note| note.as_str())
            .map(super::super::case::sentence),
    );
}

fn milling(bench: &SetRunner) -> Result<Vec<Case>, String> {
    bench.copy(&["N255_S5000_accY.csv"])?;
    bench.write("N255_S5000_accY.mapping.toml", MILLED)?;
    let arguments = ["diagnose", "--seed", "1", "--out", "OUT", "N255_S5000_accY.csv"];
    let answer = bench.run_trued("cut", &arguments)?;
    let concealed = "when the tool cuts; whether it chatters, and where";
    let (mut case, result) =
        Case::from_diagnosis("chatter", concealed, &arguments, &answer, "force");
    let reference = || {
        Some(Reference {
            value: None,
            text: "684 Hz from 4.0 to 5.0 s (our own reading, set's note); the authors' label covers the whole file",
        })
    };
    if let Some(result) = result {
        case.reference = reference();
        let tone = result.finding("chatter", None).and_then(|one| one.value("frequency_Hz"));
        let (frequency, right) = tone.map_or(("not named".to_owned(), false), |hz| {
            (format!("{hz:.1} Hz"), (hz - 684.0).abs() < 2.0)
        });
        case.checks.push(LimitCheck::new("chatter", frequency, "684 Hz within 2", right));
    }
    let arguments = [
        "spectrum",
        "--teeth",
        "4",
        "--json",
        "OUT/said.json",
        "--report",
        "OUT/report.html",
        "N255_S5000_accY.csv",
    ];
    let watch = bench.run_trued("watch", &arguments)?;
    let mut watched = spectrum_case("the vibration monitor", concealed, &arguments, &watch);
    watched.reference = reference();
    if let RunOutcome::Done(folder) = &watch {
        bench.offer_figure(
            &folder.join("report.html"),
            "Power density",
            "Power density of the whole recording, and where the spindle's multiples are.",
        );
        let alarms = alarms(&json(&folder.join("said.json")));
        let has_alarm_at = |hz: f64| alarms.iter().any(|one| (one.1 - hz).abs() < 2.0);
        let listed = lines(&alarms);
        watched.checks.push(LimitCheck::new(
            "alarms near 684 Hz",
            listed.clone(),
            "one",
            has_alarm_at(684.0),
        ));
        let mains = has_alarm_at(150.0);
        watched.checks.push(LimitCheck::new(
            "alarm of the electrical tone at 150 Hz",
            if mains { "alarmed" } else { "none" },
            "none",
            !mains,
        ));
    }
    Ok(vec![case, watched])
}

fn beam(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let mut cases = Vec::new();
    for (name, file) in [("test 2", "test_2_ds16.lvm"), ("test 3", "test_3_ds16.lvm")] {
        bench.copy(&[file])?;
        let arguments =
            ["spectrum", "--json", "OUT/said.json", "--report", "OUT/report.html", file];
        let run = file.trim_end_matches(".lvm");
        let answer = bench.run_trued(run, &arguments)?;
        let mut case =
            spectrum_case(name, "which tones, and when they change", &arguments, &answer);
        if let RunOutcome::Done(folder) = &answer {
            if name == "test 3" {
                bench.offer_figure(
                    &folder.join("report.html"),
                    "Power density",
                    "Test 3: power density of the whole recording.",
                );
                let spectrum = json(&folder.join("said.json"));
                let first = spectrum["events"]
                    .as_array()
                    .into_iter()
                    .flatten()
                    .filter(|one| one["channel"] == "Acceleration")
                    .filter_map(|one| one["t_s"].as_f64())
                    .filter(|t| *t > 9.75)
                    .fold(f64::INFINITY, f64::min);
                case.checks.push(LimitCheck::at_most(
                    "from the change at 9.75 s to the first event on the accelerometer",
                    first - 9.75,
                    0.5,
                    "s",
                ));
            }
            let spectrum = json(&folder.join("said.json"));
            let chatter = spectrum["episodes"]
                .as_array()
                .into_iter()
                .flatten()
                .any(|one| one["alarm_s"].is_number() && one["class"] == "chatter");
            let finding = if chatter { "said" } else { "not said" };
            case.checks.push(LimitCheck::new(
                "chatter, where nothing cuts",
                finding,
                "not said",
                !chatter,
            ));
            case.reference = Some(Reference {
                value: None,
                text: "tones of 100, 120, 150 Hz and the change as the set's readme has them",
            });
        }
        cases.push(case);
    }
    Ok(cases)
}

/// Result of `trued spectrum`: its alarms as text.
fn spectrum_case(name: &str, concealed: &str, arguments: &[&str], answer: &RunOutcome) -> Case {
    let mut case = Case {
        name: name.to_owned(),
        concealed: concealed.to_owned(),
        command: super::super::case::command_text(arguments),
        verdict: outcome_text(answer),
        ..Case::default()
    };
    case.short.clone_from(&case.verdict);
    case.was_run = !matches!(answer, RunOutcome::NotRun);
    let RunOutcome::Done(folder) = answer else { return case };
    let spectrum = json(&folder.join("said.json"));
    let alarms = alarms(&spectrum);
    case.verdict = if alarms.is_empty() {
        "no alarm".to_owned()
    } else {
        format!("alarms at {}", lines(&alarms))
    };
    case.short.clone_from(&case.verdict);
    let known = spectrum["episodes"].as_array().into_iter().flatten();
    let mut statements: Vec<String> =
        known.filter(|one| one["alarm_s"].is_number()).map(event).collect();
    let more = statements.len().saturating_sub(8);
    statements.truncate(8);
    statements.extend((more > 0).then(|| format!("and {more} more")));
    case.statements = statements;
    case
}

/// `684.2 Hz on ay_m_s2 at 4.36 s: chatter (or structural)`.
fn event(one: &Value) -> String {
    let number = |key: &str, digits: usize| {
        report::significant(one[key].as_f64().unwrap_or(f64::NAN), digits)
    };
    let rivals: Vec<&str> =
        one["rivals"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let rivals =
        if rivals.is_empty() { String::new() } else { format!(" (or {})", rivals.join(", ")) };
    format!(
        "Alarm at {} s: {} Hz on {}, {}{rivals}.",
        number("alarm_s", 3),
        number("frequency_Hz", 4),
        one["channel"].as_str().unwrap_or(""),
        one["class"].as_str().unwrap_or("").replace('_', " ")
    )
}

/// Lines with an alarm: number and frequency, Hz, the strongest first as in the program's list.
fn alarms(result: &Value) -> Vec<(u64, f64)> {
    let all = result["episodes"].as_array().into_iter().flatten();
    let alarmed = all.filter(|one| one["alarm_s"].is_number());
    alarmed.filter_map(|one| Some((one["line"].as_u64()?, one["frequency_Hz"].as_f64()?))).collect()
}

fn lines(alarms: &[(u64, f64)]) -> String {
    let mut all: Vec<String> =
        alarms.iter().map(|(_, hz)| format!("{} Hz", report::significant(*hz, 4))).collect();
    all.dedup();
    if all.is_empty() { "none".to_owned() } else { all.join(", ") }
}
