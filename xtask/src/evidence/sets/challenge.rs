//! The blind challenge, and effects added to real recordings of torque.
//!
//! Cases are not selected; seeds are fixed.

use serde_json::Value;

use super::super::case::{Case, LimitCheck};
use super::super::set_runner::{RunOutcome, SetRunner, json};
use super::Set;

/// Required share of correct first answers for z of at least this value: of drawn cases, of
/// injected ones.
const DRAWN_SHARES: [(f64, f64); 3] = [(20.0, 0.90), (40.0, 0.97), (80.0, 0.98)];
const INJECTED_SHARES: [(f64, f64); 3] = [(10.0, 0.70), (20.0, 0.90), (40.0, 0.97)];

pub(super) const SET: Set = Set {
    name: "challenge",
    description: "The blind challenge of the project ([challenge.md](challenge.md)): sealed cases of a generator that shares no physics with the program; answers are hashed before the truth is disclosed.",
    source: "`trued challenge`",
    given_model: "a model and a recording per case.",
    files: &[],
    not_run_reason: None,
    run,
};

fn run(bench: &SetRunner) -> Result<Vec<Case>, String> {
    let Some(count) = bench.challenge else {
        return Ok(vec![not_requested("blind cases", "an effect, or none, in every case")]);
    };
    let count = count.to_string();
    let mut cases = Vec::new();
    for domain in ["position", "torque"] {
        for (tier, concealed) in [
            ("", "an effect or several, or none"),
            ("null", "nothing is missing: any finding is wrong"),
        ] {
            let run = if tier.is_empty() { domain.to_owned() } else { format!("{domain}-{tier}") };
            let mut arguments = vec![
                "challenge",
                "--domain",
                domain,
                "--cases",
                &count,
                "--seed",
                "1",
                "--threads",
                "2",
                "--out",
                "OUT/all",
                "--json",
                "OUT/said.json",
            ];
            if !tier.is_empty() {
                arguments.extend(["--tier", tier]);
            }
            let answer = bench.run_trued(&run, &arguments)?;
            let name = if tier.is_empty() {
                format!("{domain}, all tiers")
            } else {
                format!("{domain}, nothing missing")
            };
            let mut case = Case::from_outcome(&name, concealed, &arguments, &answer);
            if let RunOutcome::Done(folder) = &answer {
                check_scores(&mut case, &json(&folder.join("said.json")), &count);
            }
            cases.push(case);
        }
    }
    Ok(cases)
}

fn not_requested(name: &str, concealed: &str) -> Case {
    Case {
        name: name.to_owned(),
        concealed: concealed.to_owned(),
        command: "cargo xtask evidence --challenge CASES".to_owned(),
        verdict: "not run".to_owned(),
        short: "not run".to_owned(),
        ..Case::default()
    }
}

/// The figures with a limit; those based on too few cases are omitted.
fn check_scores(case: &mut Case, result: &Value, count: &str) {
    case.verdict =
        format!("{count} cases, sealed {}", result["sealed_sha256"].as_str().unwrap_or("?"));
    case.short = format!("{count} cases");
    let share = |value: f64| format!("{:.1} %", 100.0 * value);
    for (z, bar) in DRAWN_SHARES {
        let bins = result["first_right_at_z"].as_array().into_iter().flatten();
        let Some(bin) = bins.into_iter().find(|bin| bin["from"] == z) else { continue };
        let Some(right) = bin["first_right"].as_f64() else { continue };
        let what = format!("first answer right, z at least {z} ({} cases)", bin["cases"]);
        case.checks.push(LimitCheck::new(
            what,
            share(right),
            format!("at least {}", share(bar)),
            right >= bar,
        ));
    }
    let limits = [
        ("joint_right", "joint right, given the effect", 0.99),
        ("unknown_recognised", "unknown physics reported as unknown", 0.95),
        ("undetermined_recognised", "indistinguishable effects reported as such", 0.95),
        ("gain_vs_oracle_median", "share of the oracle's gain, median", 0.95),
        ("gain_vs_oracle_p10", "share of the oracle's gain, worst tenth", 0.85),
    ];
    for (key, what, bar) in limits {
        if let Some(value) = result[key].as_f64() {
            case.checks.push(LimitCheck::new(
                what,
                share(value),
                format!("at least {}", share(bar)),
                value >= bar,
            ));
        }
    }
    for (key, what, bar) in [
        ("false_findings_on_nulls", "false findings where nothing is missing", 0.01),
        ("named_wrong", "wrong findings among all findings", 0.03),
    ] {
        if let Some(value) = result[key].as_f64() {
            case.checks.push(LimitCheck::new(
                what,
                share(value),
                format!("at most {}", share(bar)),
                value <= bar,
            ));
        }
    }
    if let Some(value) = result["coverage95"].as_f64() {
        case.checks.push(LimitCheck::new(
            "coverage of 95 % intervals",
            share(value),
            "93 to 97 %",
            (0.93..=0.97).contains(&value),
        ));
    }
}

/// Effects of torque added to real recordings of the set.
pub(super) fn injected(
    bench: &SetRunner,
    model: &str,
    mapping: &str,
    recordings: &[&str],
) -> Result<Case, String> {
    let (name, concealed) = (
        "effects added to the real recording",
        "each effect of the torque table in turn, at z of 10, 20 and 40, random joints",
    );
    if bench.challenge.is_none() {
        return Ok(not_requested(name, concealed));
    }
    let mut arguments = vec![
        "challenge",
        "--model",
        model,
        "--mapping",
        mapping,
        "--seed",
        "1",
        "--threads",
        "2",
        "--out",
        "OUT/all",
        "--json",
        "OUT/said.json",
        "--inject",
    ];
    arguments.extend(recordings);
    let answer = bench.run_trued("injected", &arguments)?;
    let mut case = Case::from_outcome(name, concealed, &arguments, &answer);
    let RunOutcome::Done(folder) = &answer else { return Ok(case) };
    let answers = json(&folder.join("said.json"));
    for (z, bar) in INJECTED_SHARES {
        let share = answers["at_z"].as_array().into_iter().flatten().find(|one| one["z"] == z);
        if let Some((one, right)) = share.and_then(|one| Some((one, one["share"].as_f64()?))) {
            let measured = format!("{right:.2} ({} of {})", one["right"], one["cases"]);
            case.checks.push(LimitCheck::new(
                format!("first answer right at z of {z}"),
                measured,
                format!("at least {bar:.2}"),
                right >= bar,
            ));
        }
    }
    add_unanswered(&mut case, &answers);
    case.verdict = "answered".to_owned();
    case.short = "see the section".to_owned();
    Ok(case)
}

/// Effects that were added and not found, and those that could not be added.
fn add_unanswered(case: &mut Case, result: &Value) {
    let wrong = result["cases"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|one| one["counts"] == true && one["right"] == false);
    for one in wrong {
        let joint = one["joint"].as_u64().map_or(String::new(), |joint| format!(" {joint}"));
        let instead = one["first_new"].as_str().unwrap_or("nothing");
        case.shortfall_notes.push(format!(
            "Added {}{joint} at z of {}: result {}.",
            one["effect"].as_str().unwrap_or("").replace('_', " "),
            report::significant(one["z"].as_f64().unwrap_or(f64::NAN), 2),
            instead.replace('_', " ")
        ));
    }
    let mut barred: Vec<String> = result["cannot_be_added"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|one| Some(spaced_words(one.as_str()?.split(' ').next()?)))
        .collect();
    barred.dedup();
    if !barred.is_empty() {
        case.shortfall_notes.push(format!(
            "Cannot be added, since no realistic size is observable next to the fitted parameters: {}.",
            barred.join(", ")
        ));
    }
}

/// `SpringHardening` as `spring hardening`.
fn spaced_words(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push(' ');
        }
        text.extend(letter.to_lowercase());
    }
    text
}
