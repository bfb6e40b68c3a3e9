//! The vibration monitor's figures: detection, false alarms, transients, cost, each with its limit,
//! and the curve of detection against false alarms as numbers and as a plot. Simulated by
//! `spectrum/examples/watch_figures`.

use report::{Axis, Column, Page, Plot, Series, Svg, Table};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// Limits of the time to `warn`, ms, by amplitude over noise; those of `alarm` are twice as long.
const LIMITS_MS: [(f64, f64); 3] = [(4.0, 60.0), (2.0, 70.0), (1.0, 150.0)];
/// Transients of which at most 1 % may raise an alarm.
const LIMITED_TRANSIENTS: [&str; 5] =
    ["step", "entry_and_exit", "single_shock", "ramp", "speed_change"];

/// Runs everything, prints it, writes `vibration.html`, `vibration-curve.svg` and `vibration.json`
/// into a folder; returns whether the limits are met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let mut numbers = arguments.iter().filter(|argument| !argument.starts_with("--"));
    let hours: f64 = match numbers.next() {
        Some(argument) => {
            argument.parse().map_err(|_| format!("{argument} is not a number of hours"))?
        }
        None => 10.0,
    };
    let results = match arguments.iter().find_map(|argument| argument.strip_prefix("--from=")) {
        Some(file) => read(file)?,
        None => figures(hours)?,
    };
    let mut bars = LimitChecks { all_met: true };
    detection(&results, &mut bars);
    transients(&results, &mut bars);
    noise(&results, &mut bars);
    cost(&results, &mut bars);
    write(arguments, &results)?;
    Ok(bars.all_met)
}

/// Records whether all limits so far are met.
struct LimitChecks {
    all_met: bool,
}

impl LimitChecks {
    fn record(&mut self, met: bool) -> &'static str {
        self.all_met &= met;
        if met { "met" } else { "MISSED" }
    }
}

fn detection(result: &Value, bars: &mut LimitChecks) {
    for row in rows(result, "detection") {
        let over_noise = number(row, "amplitude_over_noise");
        let warn_ms = number(&row["warn_ms"], "p50");
        let alarm_ms = number(&row["alarm_ms"], "p50");
        let bar_ms = LIMITS_MS.iter().find(|(a, _)| *a == over_noise).map_or(0.0, |(_, ms)| *ms);
        println!(
            "{:6} Hz, amplitude/noise {over_noise}: warn {warn_ms:.0} ms (bar {bar_ms}), alarm {alarm_ms:.0} ms (bar {}): {}",
            number(row, "rate_Hz"),
            2.0 * bar_ms,
            bars.record(warn_ms <= bar_ms && alarm_ms <= 2.0 * bar_ms)
        );
    }
}

fn transients(result: &Value, bars: &mut LimitChecks) {
    for row in rows(result, "transients") {
        let kind = row["kind"].as_str().unwrap_or("");
        let count = |key: &str| {
            row[key]
                .as_f64()
                .or_else(|| row[format!("{key}_not_forced")].as_f64())
                .unwrap_or(f64::NAN)
        };
        let (warned, alarmed, trials) = (count("warned"), count("alarmed"), number(row, "trials"));
        let judged = LIMITED_TRANSIENTS.contains(&kind);
        let verdict = if judged { bars.record(alarmed <= 0.01 * trials) } else { "no bar" };
        println!(
            "{:6} Hz, {kind}: {warned} warned, {alarmed} alarmed of {trials}: {verdict}",
            number(row, "rate_Hz")
        );
    }
}

fn noise(result: &Value, bars: &mut LimitChecks) {
    let row_text = |row: &Value| {
        let of = |key: &str| number(row, key);
        let name = row["noise"].as_str().unwrap_or("");
        let (rate_hz, warned, alarmed) = (of("rate_Hz"), of("warned"), of("alarmed"));
        format!("{rate_hz:6} Hz, noise {name}: {warned} warned, {alarmed} alarmed")
    };
    for row in rows(result, "noise") {
        println!(
            "{} in {} h on each of {} axes: {}",
            row_text(row),
            number(row, "hours_per_axis"),
            number(row, "axes"),
            bars.record(number(row, "alarmed") == 0.0)
        );
    }
    for row in rows(result, "starts") {
        let (seconds, starts) = (number(row, "seconds"), number(row, "starts"));
        println!("{} in the first {seconds} s of {starts} starts, 3 axes: no bar", row_text(row));
    }
}

fn cost(result: &Value, bars: &mut LimitChecks) {
    let (share, ratio) =
        (number(&result["cost"]["share_of_core"], "p50"), number(&result["cost"]["ratio"], "p50"));
    let verdict = bars.record(share < 0.03);
    println!("6 channels at 50 kHz: {:.2} % of a core (bar 3): {verdict}", 100.0 * share);
    let verdict = bars.record(ratio <= 1.6);
    println!("a hop of 4096 over six plain transforms: {ratio:.2} (bar 1.6): {verdict}");
}

/// Results written by an earlier run.
fn read(file: &str) -> Result<Value, String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{file}: {e}"))?;
    serde_json::from_str(&text).map_err(|e| format!("{file}: {e}"))
}

fn figures(hours: f64) -> Result<Value, String> {
    let parts = ["detection", "transients", "starts", "cost"].map(str::to_owned).into_iter();
    let parts = parts.chain([format!("curve={}", 0.2 * hours), format!("noise={hours}")]);
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    cargo.args([
        "run",
        "--release",
        "--quiet",
        "-p",
        "spectrum",
        "--example",
        "watch_figures",
        "--",
    ]);
    let ran = cargo.args(parts).stderr(Stdio::inherit()).output().map_err(|e| e.to_string())?;
    if !ran.status.success() {
        return Err(format!("the example watch_figures ended with {}", ran.status));
    }
    serde_json::from_slice(&ran.stdout).map_err(|e| e.to_string())
}

fn write(arguments: &[&str], result: &Value) -> Result<(), String> {
    let out = arguments.iter().find_map(|argument| argument.strip_prefix("--out="));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let out = out.map_or(root.join("target").join("figures"), Into::into);
    let curve = curve(result);
    let page = Page::new("Vibration watch: detection against false alarms")
        .lead("How often the watch finds a tone in white noise, and how often it raises a line where there is none, as its threshold moves.")
        .figure("Share of tones found within 0.5 s over false warnings per axis and hour; each dot is a threshold, 1 is the default.", &curve)
        .table(&curve_table(result))
        .footer("cargo xtask watch");
    let files = [
        ("vibration.html", page.render()),
        ("vibration-curve.svg", curve.file()),
        ("vibration.json", format!("{result:#}")),
    ];
    std::fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    for (name, text) in files {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}

/// False warnings on the x axis, detected tones on the y axis; one line per amplitude.
fn curve(result: &Value) -> Svg {
    let x = Axis::new("False warnings per axis and hour", "").log();
    let y = Axis::new("Tones warned of within 0.5 s", "").range(0.0, 1.0);
    let mut plot = Plot::new("Detection against false alarms", x, y);
    for (place, over_noise) in amplitudes(result).into_iter().enumerate() {
        let points: Vec<(f64, f64)> = rows(result, "curve")
            .map(|row| {
                // None in this many hours: drawn at the 63 % upper limit, one in those hours.
                let smallest_rate = 1.0 / number(row, "axis_hours");
                let false_warns = number(row, "false_warns_per_axis_hour").max(smallest_rate);
                (false_warns, number(&row["found"][place], "warned"))
            })
            .collect();
        plot = plot.series(Series::line(format!("amplitude/noise {over_noise}"), points));
    }
    plot.render()
}

fn curve_table(result: &Value) -> Table {
    let heads =
        ["Threshold", "False warnings /h", "False alarms /h"].map(str::to_owned).into_iter();
    let found = amplitudes(result).into_iter();
    let heads = heads.chain(
        found.flat_map(|a| [format!("warned, A/noise {a}"), format!("alarmed, A/noise {a}")]),
    );
    let caption = "False ones per axis and hour; tones found within 0.5 s, as a share.";
    let mut table = Table::new(caption, heads.map(Column::new));
    for row in rows(result, "curve") {
        let keys = ["threshold", "false_warns_per_axis_hour", "false_alarms_per_axis_hour"];
        let found = rows(row, "found");
        let found = found.flat_map(|f| [number(f, "warned"), number(f, "alarmed")]);
        let cells = keys.map(|key| number(row, key)).into_iter().chain(found);
        table = table.row(cells.map(Into::into));
    }
    table
}

fn amplitudes(result: &Value) -> Vec<f64> {
    rows(&result["curve"][0], "found").map(|found| number(found, "amplitude_over_noise")).collect()
}

fn rows<'a>(result: &'a Value, key: &str) -> impl Iterator<Item = &'a Value> {
    result[key].as_array().into_iter().flatten()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or(f64::NAN)
}
