//! The demo over many seeds: reduction of the tool error, whether the hidden effect was identified
//! correctly, and whether any published target broke an invariant.
//!
//! Limits: the ratio of the mean tool error with correction to that without is at most 1/4 in the
//! median and 1/3 at worst; correct identification in 9 of 10.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// Runs the demo and prints a row per seed and the summary; returns whether the limits are met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let full = arguments.contains(&"--full");
    let profile = if arguments.contains(&"--debug") { "dev" } else { "release" };
    let count = match arguments.iter().find(|argument| !argument.starts_with("--")) {
        Some(argument) => {
            argument.parse().map_err(|_| format!("{argument} is not a number of seeds"))?
        }
        None => 20_u64,
    };
    cargo(&["build", "--profile", profile, "--quiet", "--package", "trued"])?;
    println!(
        "seed  without mm  with mm  ratio  after mm   p50 us  p99 us  missed  at swap  broken  ringing flagged  seconds  hidden, said"
    );
    let program = program(profile);
    let rows: Result<Vec<SeedResult>, String> =
        (1..=count).map(|seed| demo(&program, seed, full)).collect();
    let rows = rows?;
    let ratios = sorted(rows.iter().map(|row| row.with / row.without));
    let (median, worst) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
    let broken: u64 = rows.iter().map(|row| row.broken).sum();
    let flagged = rows.iter().filter(|row| row.flagged).count();
    let right = rows.iter().filter(|row| row.right).count();
    println!("ratio: median {median:.3} (bar 0.250), worst {worst:.3} (bar 0.333); ");
    println!("invariants broken: {broken} (bar 0); ringing flagged in {flagged} of {}", rows.len());
    let swapped: Vec<&SeedResult> = rows.iter().filter(|row| row.after.is_some()).collect();
    if !swapped.is_empty() {
        let before = sorted(swapped.iter().map(|row| row.with));
        let after = sorted(swapped.iter().filter_map(|row| row.after));
        let (median, end) = (before.len() / 2, before.len() - 1);
        println!(
            "mean tool error where the model was swapped, {} of {}: before {:.3} mm in the median, {:.3} at worst; after {:.3} and {:.3}",
            swapped.len(),
            rows.len(),
            before[median],
            before[end],
            after[median],
            after[end]
        );
    }
    println!("named right: {right} of {} (bar 9 of 10)", rows.len());
    let named = 10 * right >= 9 * rows.len();
    Ok(median <= 0.25 && worst <= 1.0 / 3.0 && broken == 0 && named)
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

struct SeedResult {
    without: f64,
    with: f64,
    /// `None` without a claim.
    after: Option<f64>,
    broken: u64,
    flagged: bool,
    right: bool,
}

fn demo(program: &Path, seed: u64, full: bool) -> Result<SeedResult, String> {
    let out = std::env::temp_dir().join(format!("trued-seeds-{}-{seed}", std::process::id()));
    let json = out.join("demo.json");
    let mut command = Command::new(program);
    command.args(["demo", "--quiet", "--seed", &seed.to_string()]).arg("--out").arg(&out);
    command.arg("--json").arg(&json).stdout(Stdio::null());
    if !full {
        command.arg("--quick");
    }
    let status = command.status().map_err(|e| format!("the demo did not start: {e}"))?;
    if !status.success() {
        return Err(format!("the demo with seed {seed} ended with {status}"));
    }
    let text = std::fs::read_to_string(&json).map_err(|e| format!("{}: {e}", json.display()))?;
    let result: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let _ = std::fs::remove_dir_all(&out);
    row(seed, &result)
}

fn row(seed: u64, result: &Value) -> Result<SeedResult, String> {
    let number = |pointer: &str| {
        result
            .pointer(pointer)
            .and_then(Value::as_f64)
            .ok_or(format!("no {pointer} in the demo's JSON"))
    };
    let without = number("/tool_error_mm/without/mean")?;
    let with = number("/tool_error_mm/with/mean")?;
    let after = number("/tool_error_after_diagnosis_mm/mean").ok();
    let (p50, p99) = (number("/latency_ns/p50")? / 1e3, number("/latency_ns/p99")? / 1e3);
    let (missed, seconds) = (number("/missed_cycles")?, number("/diagnosis_s")?);
    let at_swap = number("/swap/missed_about").map_or("-".to_owned(), |count| count.to_string());
    let broken = number("/invariants_broken")? as u64;
    let flagged =
        result["vibration"].as_array().is_some_and(|events| events.iter().any(is_resonance_alarm));
    let right = result["named_right"].as_bool().unwrap_or(false);
    let ratio = with / without;
    let shown = after.map_or("-".to_owned(), |after| format!("{after:.3}"));
    let (hidden, named) = (name(&result["hidden_effect"]), name(&result["said"]));
    let judged = if right { "right" } else { "WRONG" };
    println!(
        "{seed:4}  {without:10.3}  {with:7.3}  {ratio:5.3}  {shown:>8}  {p50:7.1}  {p99:6.1}  {missed:6}  {at_swap:>7}  {broken:6}  {flagged:15}  {seconds:7.1}  {judged}: {hidden}, {named}"
    );
    Ok(SeedResult { without, with, after, broken, flagged, right })
}

/// `backlash 3`, or the effect that was not identified.
fn name(effect: &Value) -> String {
    match (effect["effect"].as_str(), effect["joint"].as_u64()) {
        (Some(kind), Some(joint)) => format!("{kind} {joint}"),
        (Some(kind), None) => kind.to_owned(),
        _ => "nothing".to_owned(),
    }
}

/// An alarm within 2 Hz of the 72 Hz at which the demo's robot rings.
fn is_resonance_alarm(event: &Value) -> bool {
    let is_near = event["frequency_Hz"].as_f64().is_some_and(|hz| (hz - 72.0).abs() < 2.0);
    is_near && event["state"].as_str().is_some_and(|state| state == "alarm" || state == "confirmed")
}

fn program(profile: &str) -> std::path::PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or(root.join("target"), Into::into);
    target.join(if profile == "dev" { "debug" } else { profile }).join("trued")
}

fn cargo(arguments: &[&str]) -> Result<(), String> {
    let cargo = std::env::var_os("CARGO").unwrap_or("cargo".into());
    let status = Command::new(cargo).args(arguments).status().map_err(|e| e.to_string())?;
    if status.success() { Ok(()) } else { Err(format!("cargo {} failed", arguments.join(" "))) }
}
