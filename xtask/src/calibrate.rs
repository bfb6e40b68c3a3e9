//! The calibration's figures with their limits: the thesis' virtual robot, coverage of intervals,
//! outliers, time. Simulated by `diagnosis/examples/calibrate_figures` and
//! `diagnosis/examples/speed`.

use report::{Axis, Column, Histogram, Page, Svg, Table};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// The thesis' held-out means, mm: name of the test, limit.
const THESIS_MM: [(&str, f64); 2] = [("planar", 0.09), ("spatial", 0.36)];
const MODELS: [&str; 5] = ["nominal", "calibrated", "advanced", "oracle", "truth"];

/// Runs everything, prints it, writes `calibration.html` and `calibration.json` into a folder;
/// returns whether the limits are met.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let mut numbers = arguments.iter().filter(|argument| !argument.starts_with("--"));
    let campaigns: u64 = match numbers.next() {
        Some(argument) => {
            argument.parse().map_err(|_| format!("{argument} is not a number of campaigns"))?
        }
        None => 1000,
    };
    let parts = [
        format!("coverage={campaigns}"),
        format!("selected={}", (campaigns / 5).max(1)),
        "robot".to_owned(),
        "outliers".to_owned(),
    ];
    let results = figures("calibrate_figures", &parts)?;
    let speed = figures("speed", &[])?;
    let mut all_met = true;
    let mut report_criterion = |text: String, met: bool| {
        all_met &= met;
        println!("{text}: {}", if met { "met" } else { "MISSED" });
    };
    robot(&results["robot"], &mut report_criterion);
    coverage(&results, &mut report_criterion);
    outliers(&results["outliers"], &mut report_criterion);
    let seconds = number(&speed["seconds"]);
    let text = format!(
        "{} poses, {} numbers: {seconds:.2} s (bar 2)",
        speed["poses"], speed["numbers_fitted"]
    );
    report_criterion(text, seconds < 2.0);
    write(arguments, &results)?;
    Ok(all_met)
}

fn robot(result: &Value, reported: &mut impl FnMut(String, bool)) {
    for (test, bar) in THESIS_MM {
        let results = &result[test];
        for model in MODELS {
            let one = &results["models"][model];
            let of = |key: &str| number(&one[key]);
            println!(
                "{test}, {model}: mean {:.3}, median {:.3}, 95 % {:.3}, largest {:.3} mm",
                of("mean"),
                of("median"),
                of("p95"),
                of("max")
            );
        }
        for way in ["rising", "falling"] {
            let one = &results[format!("advanced_joint_2_{way}")];
            let (mean, p95) = (number(&one["mean"]), number(&one["p95"]));
            println!("{test}, advanced, joint 2 {way}: mean {mean:.3}, 95 % {p95:.3} mm");
        }
        let worst = number(&results["advanced_worst_mean"]);
        reported(
            format!(
                "{test}: worst mean of {} campaigns {worst:.3} mm (bar {bar})",
                results["campaigns"]
            ),
            worst <= bar,
        );
        let ratio = number(&results["advanced_over_oracle"]);
        let largest = number(&results["advanced_over_oracle_worst"]);
        let text =
            format!("{test}: over the best possible {ratio:.2}, at worst {largest:.2} (bar 1.3)");
        reported(text, largest <= 1.3);
        let (converged, campaigns) = (&results["converged"], &results["campaigns"]);
        reported(
            format!("{test}: {converged} of {campaigns} fits converged"),
            converged == campaigns,
        );
    }
}

fn coverage(result: &Value, reported: &mut impl FnMut(String, bool)) {
    for (name, one) in result["coverage"].as_object().into_iter().flatten() {
        let pooled = number(&one["pooled"]);
        let share = number(&one["share_of_numbers_within_93_to_97"]);
        let text = format!(
            "coverage of 95 % intervals, {name}, {} campaigns: {:.1} % pooled (bar 94 to 96), {:.0} % of {} numbers within 93 to 97 (bar 95)",
            one["campaigns"],
            100.0 * pooled,
            100.0 * share,
            one["numbers"]
        );
        reported(text, (0.94..=0.96).contains(&pooled) && share >= 0.95);
    }
    let one = &result["selected"];
    println!(
        "coverage after the data chose the effects, {} campaigns: {:.1} % pooled; tool error over expected {:.2}: no bar",
        one["campaigns"],
        100.0 * number(&one["pooled"]),
        number(&one["tool_error_over_expected"])
    );
}

fn outliers(result: &Value, reported: &mut impl FnMut(String, bool)) {
    let ratio = number(&result["advanced_ratio"]);
    let text = format!(
        "{} of {} training poses grossly wrong: held-out mean {ratio:.2} times as large, at worst of {} campaigns {:.2} (bar 1.1 in the median)",
        result["spoilt_poses"],
        result["training_poses"],
        result["campaigns"],
        number(&result["advanced_ratio_worst"])
    );
    reported(text, ratio <= 1.1);
    let text = format!(
        "of them listed {} of {}; of clean poses {} of {}",
        result["listed"], result["of"], result["falsely_listed"], result["of_clean"]
    );
    reported(text, result["listed"] == result["of"]);
}

fn figures(example: &str, parts: &[String]) -> Result<Value, String> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    let arguments = ["run", "--release", "--quiet", "-p", "diagnosis", "--example", example, "--"];
    cargo.args(arguments).args(parts);
    let ran = cargo.stderr(Stdio::inherit()).output().map_err(|e| e.to_string())?;
    if !ran.status.success() {
        return Err(format!("the example {example} ended with {}", ran.status));
    }
    serde_json::from_slice(&ran.stdout).map_err(|e| e.to_string())
}

fn write(arguments: &[&str], result: &Value) -> Result<(), String> {
    let out = arguments.iter().find_map(|argument| argument.strip_prefix("--out="));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."));
    let out = out.map_or(root.join("target").join("figures"), Into::into);
    let mut page = Page::new("Calibration of the thesis' virtual robot").lead(
        "Held-out poses of simulated campaigns with a C-Track's noise: the model as it is, with geometry, with the effects that the data ask for; \
         beside them the best possible, and the truth itself, where the noise alone is left.",
    );
    for (test, _) in THESIS_MM {
        page = page.section(test).table(&table(&result["robot"][test])).figure(
            "Held-out errors of the first campaign, at the middles of the bins.",
            &histogram(&result["robot"][test]),
        );
    }
    let files = [
        ("calibration.html", page.footer("cargo xtask calibrate").render()),
        ("calibration.json", format!("{result:#}")),
    ];
    std::fs::create_dir_all(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    for (name, text) in files {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}

fn table(result: &Value) -> Table {
    let heads = ["Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)"].map(Column::new);
    let table = Table::new("Errors on held-out poses, median of the campaigns", heads);
    MODELS.iter().fold(table, |table, model| {
        let cells = ["mean", "median", "p95", "max"]
            .map(|key| number(&result["models"][model][key]).into());
        table.row(std::iter::once((*model).into()).chain(cells))
    })
}

fn histogram(result: &Value) -> Svg {
    let plot = Histogram::new("Held-out errors", Axis::new("Error", "mm").log());
    let of = |model: &str| {
        let one = &result["models"][model]["histogram"];
        let bin_mm = number(&one["bin_mm"]);
        let counts = one["counts"].as_array().into_iter().flatten().enumerate();
        let each = counts.map(move |(bin, count)| {
            std::iter::repeat_n((bin as f64 + 0.5) * bin_mm, number(count) as usize)
        });
        each.flatten().collect::<Vec<f64>>()
    };
    let models = MODELS.iter().take(3);
    models.fold(plot, |plot, model| plot.values(*model, of(model))).render()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
