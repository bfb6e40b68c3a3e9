//! `trued challenge`: comparison of two formulations of the physics, the seal, and the score of
//! solvers with known answers.

use ::challenge::arm::Arm;
use ::challenge::case::{PositionCase, Tier};
use ::challenge::effect::{BlindCase, EffectKind};
use ::challenge::generate;
use ::challenge::instrument::{Instrument, Noise};
use ::challenge::kinds::{Effect, Kind, Requirement};
use ::challenge::rng::Rng;
use ::challenge::scene::{Excitation, RecordedInputs, Scene};
use ::challenge::transform::{IDENTITY, translation};
use ::challenge::truth::{HiddenEffect, Truth};
use ::challenge::{case_files, commitment};
use recording::series::{Channel, RequiredData as Wanted, read};
use serde_json::{Value, json};

use crate::program::Place;

fn case(settled: bool, ambient: bool, hidden: Vec<Effect>) -> PositionCase {
    let mut rng = Rng::new(3, 0);
    let arm = Arm::from_table(2, 1.0, &translation([0.02, 0.01, 0.15]), 4.0, true);
    let recorded_inputs =
        RecordedInputs { wrench: true, ambient, joint_temperatures: false, spindle: true };
    let excitation = Excitation::Full;
    let scene = if settled {
        Scene::random_poses(arm, recorded_inputs, 200, excitation, &mut rng)
    } else {
        Scene::random_path(arm, recorded_inputs, (1600, 100.0), excitation, &mut rng)
    };
    let points = vec![[0.0; 3]];
    let instrument = Instrument {
        points,
        measuring_from_base: IDENTITY,
        frame_known: true,
        points_known: true,
        targets: false,
    };
    let noise = Noise {
        sigma: 1e-5,
        autocorrelation: 0.0,
        quantum: 0.0,
        gaps: 0.0,
        outliers: 0.0,
        stated: true,
    };
    PositionCase {
        tier: Tier::Single,
        scene,
        excitation,
        instrument,
        noise,
        modelled: Vec::new(),
        hidden,
        seed: 5,
    }
}

/// A soft joint, so that loads move something.
fn soft() -> Effect {
    Effect { kind: Kind::JointCompliance, joint: 2, other_joint: 2, parameters: vec![4e-6] }
}

fn sizes(kind: Kind) -> Vec<f64> {
    match kind {
        Kind::TransmissionError => vec![3e-4, 2.0, 0.7],
        Kind::LostMotion => vec![4e-4, 60.0],
        Kind::Hysteresis => vec![5e-4, 5e-3],
        Kind::StiffnessHardening => vec![2e-11],
        Kind::GravityCompliance | Kind::LoadCompliance | Kind::JointCompliance => vec![3e-6],
        Kind::BearingCompliance | Kind::BaseCompliance => vec![1e-6],
        Kind::ToolCompliance => vec![2e-6, 1e-6, 3e-6],
        Kind::Counterbalance => vec![2e4, 0.3, 0.15, 0.5, 0.4],
        Kind::AxisShift => vec![4e-4, 0.0, -3e-4],
        Kind::ToolOffset => vec![4e-4, -2e-4, 3e-4],
        Kind::AxisTilt => vec![4e-4, -3e-4],
        Kind::GravityTilt => vec![0.3, -0.2],
        Kind::Payload => vec![3.0, 1.0, 0.05, 1.2],
        Kind::ThermalGrowth | Kind::SpindleGrowth => vec![2e-5],
        Kind::ThermalGrowthLag => vec![2e-5, 900.0],
        Kind::ThermalGrowthWarmUp => vec![2e-4, 900.0],
        Kind::ThermalZero => vec![5e-5],
        Kind::ThermalZeroLag => vec![5e-5, 900.0],
        Kind::ThermalZeroWarmUp => vec![2e-4, 900.0],
        Kind::AxisWobble => vec![2e-4, 3e-4, 0.3, 1.1, 2.0],
        Kind::SpindleGrowthSpeed => vec![3e-9],
        Kind::TimeDelay => vec![6e-3],
        Kind::ServoLag => vec![1.5e-2],
        Kind::FlexibleMode => vec![1.0, 9.0, 0.05],
        Kind::ReversalSpike => vec![3e-4, 0.08],
        Kind::WrenchBias => vec![30.0, -20.0, 10.0, 2.0, -1.0, 3.0],
        Kind::WrenchScale => vec![0.4, -0.3, 0.3, 0.2, 0.3, -0.3],
        Kind::WrenchMisalignment => vec![0.2, -0.15, 0.3],
        _ => vec![5e-4],
    }
}

/// Root mean square of the difference of two lists.
fn rms(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (sum / a.len() as f64).sqrt()
}

fn simulated(case: &PositionCase) -> Vec<f64> {
    let place = Place::new();
    for (name, mut text) in case_files::files(case) {
        if name == "model.toml" {
            case.hidden.iter().for_each(|effect| text.push_str(&case_files::effect(effect, &[])));
        }
        place.file(name, &text);
    }
    place.succeed(&["simulate", "--model", "model.toml", "--out", "seen", "recording.csv", "-q"]);
    let recording = read(&place.path("seen.csv"), None, Wanted::Measurement).expect("a recording");
    let columns = [0, 1, 2].map(|k| recording.column(Channel::Position(k)).expect("there"));
    (0..recording.len()).flat_map(|row| columns.map(|column| column[row])).collect()
}

/// How far the two may be apart, as a share of the effect: where the laws are formulated otherwise on purpose, more.
fn apart(kind: Kind) -> f64 {
    match kind {
        // The first loading of slipping springs differs from that after a reversal.
        Kind::Hysteresis => 0.12,
        // The initial position in the backlash gap is arbitrary.
        Kind::Backlash => 0.25,
        // A surface warms before the core; sidebands.
        Kind::ThermalGrowthLag | Kind::ThermalZeroLag | Kind::TransmissionError => 0.03,
        Kind::FlexibleMode | Kind::ReversalSpike => 0.03,
        _ => 0.01,
    }
}

#[test]
fn every_effect_is_the_same_in_two_formulations_that_share_nothing() {
    let mut faults = Vec::new();
    for kind in Kind::DICTIONARY {
        for settled in [false, true] {
            if kind.needs(if settled { Requirement::Path } else { Requirement::Poses }) {
                continue;
            }
            // Joint 3's pivot and joint 4's coincide: there is no link that could grow.
            let joint = if kind.name() == Some("thermal_growth") { 1 } else { 2 };
            let effect = Effect { kind, joint, other_joint: 4, parameters: sizes(kind) };
            let alone = matches!(
                kind,
                Kind::GravityCompliance | Kind::LoadCompliance | Kind::JointCompliance
            );
            let beside = if alone { Vec::new() } else { vec![soft()] };
            let ambient = !kind.needs(Requirement::NoTemperature);
            let case = case(settled, ambient, beside.iter().cloned().chain([effect]).collect());
            let exact = case.exact_values(&case.scene, &case.true_effects());
            let without = case.exact_values(&case.scene, &beside);
            let (size, difference) = (rms(&exact, &without), rms(&exact, &simulated(&case)));
            // Inertia is a second difference of rounded positions on one side and of places on the other.
            if size < 1e-5 || difference > apart(kind) * size + 4e-7 {
                faults
                    .push(format!("{kind:?}, settled {settled}: {difference:.2e} of {size:.2e} m"));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// A solver with a constant answer.
fn solver(place: &Place, answer: &str) -> String {
    let script = format!(
        "while [ $# -gt 1 ]; do\n  case \"$1\" in --out) out=\"$2\"; shift;; --model) model=\"$2\"; shift;; esac\n  shift\ndone\n\
         cp \"$model\" \"$out/model.toml\"\ncat > \"$out/diagnosis.json\" <<'END'\n{answer}\nEND\n"
    );
    scripted(place, "solver.sh", &script)
}

/// Command of a script in that place; it is not executed there, where execution may be forbidden.
fn scripted(place: &Place, name: &str, script: &str) -> String {
    format!("sh {}", place.file(name, script).display())
}

const CONSISTENT: &str = r#"{"schema": "trued.diagnosis/1", "verdict": "consistent", "domain": "position", "findings": []}"#;
const ALWAYS: &str = r#"{"schema": "trued.diagnosis/1", "verdict": "missing_physics", "domain": "position",
    "findings": [{"effect": "backlash", "joint": 2, "change": "new", "confidence": 0.99, "parameters": {}, "alternatives": []}]}"#;

fn challenge(place: &Place, out: &str, answer: &str, more: &[&str]) -> serde_json::Value {
    let solver = solver(place, answer);
    let mut arguments =
        vec!["challenge", "--seed", "4", "--out", out, "--solver", &solver, "--json", "said.json"];
    arguments.extend(more);
    place.succeed(&arguments);
    place.json("said.json")
}

#[test]
fn a_solver_that_sees_nothing_scores_nothing_and_one_that_always_sees_is_caught() {
    let place = Place::new();
    let blind = challenge(&place, "blind", CONSISTENT, &["--cases", "20"]);
    assert_eq!(blind["schema"], "trued.challenge/1");
    assert_eq!(
        (&blind["first_right"], &blind["false_findings_on_nulls"]),
        (&0.0.into(), &0.0.into())
    );
    let gain = blind["gain_vs_oracle_median"].as_f64().unwrap();
    assert!(gain.abs() < 0.02, "it wrote the model that it got, and gains {gain}");
    let always = challenge(&place, "always", ALWAYS, &["--cases", "6", "--tier", "null"]);
    assert_eq!((&always["false_findings_on_nulls"], &always["nulls"]), (&1.0.into(), &6.into()));
    let outside = challenge(&place, "outside", ALWAYS, &["--cases", "4", "--tier", "outside"]);
    assert_eq!(
        (&outside["named_wrong"], &outside["unknown_recognised"]),
        (&1.0.into(), &0.0.into())
    );
}

#[test]
fn the_same_seed_gives_the_same_cases_on_one_thread_or_two_and_the_truth_fits_its_seal() {
    let place = Place::new();
    for (out, threads) in [("one", "1"), ("two", "2")] {
        challenge(&place, out, CONSISTENT, &["--cases", "8", "--threads", threads]);
    }
    for file in
        ["commitment.json", "truth.json", "cases/00003/recording.csv", "cases/00007/model.toml"]
    {
        assert_eq!(
            place.read(&format!("one/{file}")),
            place.read(&format!("two/{file}")),
            "{file}"
        );
    }
    let truth = place.read("one/truth.json");
    let sealed = place.json("one/commitment.json")["sealed_sha256"].as_str().unwrap().to_owned();
    assert!(commitment::verify(&truth, &sealed).is_ok());
    assert!(commitment::verify(&truth.replacen("\"z\": ", "\"z\":  ", 1), &sealed).is_err());
    assert!(place.read("one/report.html").contains("<svg"));
}

#[test]
fn every_model_and_recording_that_is_handed_out_reads() {
    let place = Place::new();
    challenge(&place, "out", CONSISTENT, &["--cases", "30"]);
    for index in 0..30 {
        let folder = format!("out/cases/{index:05}");
        let recording = format!("{folder}/recording.csv");
        let done = place.run(&["simulate", "--overwrite", "--out", "again", "-q", &recording]);
        assert_eq!(done.code, Some(0), "{folder}: {done:#?}");
    }
}

#[test]
fn a_solver_that_fails_hangs_or_talks_nonsense_is_no_answer() {
    let place = Place::new();
    for (number, script) in ["exit 3\n", "sleep 60\n"].iter().enumerate() {
        let (out, solver) = (format!("bad{number}"), scripted(&place, "bad.sh", script));
        let arguments =
            ["challenge", "--cases", "2", "--seed", "1", "--out", &out, "--solver", &solver];
        place.succeed(&[&arguments[..], &["--limit", "0.2", "--json", "said.json"]].concat());
        assert_eq!(place.json("said.json")["unanswered"], 2);
    }
    let nonsense = challenge(&place, "nonsense", "{\"schema\": 7", &["--cases", "2"]);
    assert_eq!(nonsense["unanswered"], 2);
    let again = place.run(&["challenge", "--cases", "2", "--out", "nonsense"]);
    assert_eq!(again.code, Some(2), "a folder that holds something stays as it is");
}

/// The answer and the model of a solver that knows the truth of a case.
fn perfect(index: usize, seed: u64) -> (String, String) {
    let generated = generate::generate_case(seed, index, Tier::mixed(index));
    let truth = Truth::of("", &generated);
    let findings: Vec<Value> = truth.hidden.iter().filter_map(finding).collect();
    let verdict = match truth.tier {
        Tier::Null => "consistent",
        Tier::Outside => "unknown_structure",
        Tier::Ambiguous => "undetermined",
        _ => "missing_physics",
    };
    let unexplained = json!({"depends_on": truth.depends_on});
    let answer = json!({"schema": "trued.diagnosis/1", "verdict": verdict, "domain": "position", "findings": findings, "unexplained": unexplained});
    let mut case = generated.case;
    case.modelled.iter_mut().for_each(|modelled| modelled.nominal = modelled.true_effect.clone());
    let hidden = case.hidden.iter().filter(|effect| effect.kind.name().is_some());
    let effects: String = hidden.map(|effect| case_files::effect(effect, &[])).collect();
    (answer.to_string(), case_files::model(&case) + &effects)
}

fn finding(hidden: &HiddenEffect) -> Option<Value> {
    let numbers = |list: &Vec<f64>| {
        let pairs: Vec<[f64; 2]> =
            list.iter().map(|x| [x - 1e-9 - 1e-6 * x.abs(), x + 1e-9 + 1e-6 * x.abs()]).collect();
        if list.len() == 1 {
            json!({"value": list[0], "ci95": pairs[0]})
        } else {
            json!({"value": list, "ci95": pairs})
        }
    };
    let parameters: serde_json::Map<String, Value> =
        hidden.parameters.iter().map(|(key, list)| ((*key).to_owned(), numbers(list))).collect();
    Some(
        json!({"effect": hidden.effect?, "joint": hidden.joint, "change": hidden.change, "confidence": 1.0, "parameters": parameters, "alternatives": []}),
    )
}

#[test]
fn a_solver_that_knows_the_truth_scores_all_and_its_model_is_worth_the_oracles() {
    let place = Place::new();
    std::fs::create_dir(place.path("truth")).unwrap();
    for index in 0..20 {
        let (answer, model) = perfect(index, 9);
        place.file(&format!("truth/{index:05}.json"), &answer);
        place.file(&format!("truth/{index:05}.toml"), &model);
    }
    let script = format!(
        "while [ $# -gt 1 ]; do\n  case \"$1\" in --out) out=\"$2\"; shift;; --model) model=\"$2\"; shift;; esac\n  shift\ndone\n\
         case=$(basename $(dirname \"$model\"))\ncp {0}/$case.json \"$out/diagnosis.json\"\ncp {0}/$case.toml \"$out/model.toml\"\n",
        place.path("truth").display()
    );
    let solver = scripted(&place, "knows.sh", &script);
    place.succeed(&[
        "challenge",
        "--seed",
        "9",
        "--cases",
        "20",
        "--out",
        "out",
        "--solver",
        &solver,
        "--json",
        "said.json",
    ]);
    let result = place.json("said.json");
    for (figure, wanted) in [
        ("first_right", 1.0),
        ("first_three_right", 1.0),
        ("joint_right", 1.0),
        ("all_named", 1.0),
        ("coverage95", 1.0),
        ("unknown_recognised", 1.0),
        ("depends_on_right", 1.0),
        ("undetermined_recognised", 1.0),
        ("named_wrong", 0.0),
        ("false_findings_on_nulls", 0.0),
    ] {
        assert_eq!(result[figure], wanted, "{figure} of {result:#}");
    }
    let gain = |figure: &str| result[figure].as_f64().unwrap();
    assert!((gain("gain_vs_oracle_median") - 1.0).abs() < 0.02, "{result:#}");
    assert!(gain("gain_vs_oracle_p10") > 0.9, "{result:#}");
}

#[test]
fn a_solver_that_cannot_be_started_leaves_nothing_that_bars_the_next_run() {
    let place = Place::new();
    let run = ["challenge", "--cases", "2", "--seed", "1", "--out", "c", "--solver", "./none"];
    for _ in 0..2 {
        let done = place.run(&run);
        assert!(done.code == Some(3) && done.err.contains("cannot start ./none"), "{done:#?}");
        assert!(!place.path("c").exists());
    }
    std::fs::create_dir(place.path("c")).unwrap();
    place.file("c/mine.txt", "kept");
    assert_eq!(place.run(&run).code, Some(2));
    assert_eq!(place.read("c/mine.txt"), "kept");
}
