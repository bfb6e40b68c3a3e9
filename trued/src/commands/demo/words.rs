//! Text output of the demo, in order.
//!
//! The hidden effect is reported last. Every number was measured.

use report::TextTable;
use std::path::Path;

use super::act::FOLDER;
use super::outcome::{Milled, Report, Spread, Swap};
use super::scene::{Scene, TRACKER_M};
use crate::exit::Failure;
use crate::output::{Console, Paint};
use crate::table::on_stdout;

type Said = Result<(), Failure>;

/// Who plays.
pub(super) fn introduce(console: &mut Console, scene: &Scene) -> Said {
    let robot = console.paint(Paint::Strong, &scene.model.file.name);
    let (what, duration_s, seed) = (scene.what(), scene.work.duration_s(), scene.seed);
    console.say(format!("{robot} mills {what} in {duration_s:.0} s, seed {seed}"))?;
    console.say("The daemon uses the calibrated model. In the simulated robot, every parameter deviates randomly within its stated")?;
    console.say("uncertainty, and there is one hidden effect that the model lacks, drawn at random with the seed.")?;
    head(console, "1  Milling without and with correction")
}

/// The result of milling.
pub(super) fn milled(console: &mut Console, milled: &Milled) -> Said {
    let errors = &milled.tool_error_mm;
    console
        .say(table([("without correction", errors.without), ("with correction", errors.with)]))?;
    let us = |ns: u64| format!("{:.1}", ns as f64 * 1e-3);
    let l = &milled.latency_ns;
    let latency =
        TextTable::new(["command to corrected target, µs", "median", "99 %", "99.9 %", "worst"])
            .row([
                "round trip between two processes".to_owned(),
                us(l.p50),
                us(l.p99),
                us(l.p999),
                us(l.max),
            ]);
    console.say(on_stdout(&latency))?;
    console.say(format!("vibration: simulated chatter {}", milled.ringing.words))?;
    for event in milled.vibration.iter().filter(|event| event.state == "alarm") {
        let since = event.after_onset_ms.filter(|ms| *ms >= 0.0);
        let since = since.map_or_else(String::new, |ms| format!(", {ms:.0} ms after its onset"));
        console.say(format!("  detected at {:.2} s{since}: {}", event.t_s, event.says))?;
    }
    Ok(())
}

/// How it is measured.
pub(super) fn measures(console: &mut Console, scene: &Scene) -> Said {
    head(console, "2  Measurement and diagnosis")?;
    let rows = &scene.survey;
    let minutes = rows.last().map_or(0.0, |row| row.time_s / 60.0);
    let celsius = rows.iter().map(|row| row.ambient_celsius);
    let (cold, warm) = celsius.fold((f64::MAX, f64::MIN), |(c, w), t| (c.min(t), w.max(t)));
    console.say(format!(
        "Measuring program (simulated faster than real time): {minutes:.0} min, all joints in both directions, loads in many directions, air from {cold:.0} to {warm:.0} °C."
    ))?;
    console.say(format!(
        "A tracker measures three reflectors on the tool, noise {:.3} mm: {} rows. The correction continues at 1 kHz meanwhile.",
        1e3 * TRACKER_M,
        rows.len()
    ))
}

/// Milling again, the truth, and where everything is.
pub(super) fn end(console: &mut Console, report: &Report, out: &Path) -> Said {
    let (milled, told) = (&report.milled, &report.told);
    if let (Some(after), Some(swap)) = (report.tool_error_after_diagnosis_mm, report.swap) {
        console.say(swapped(&swap))?;
        head(console, "3  The same path with the new model")?;
        let errors = &milled.tool_error_mm;
        console.say(table([
            ("without correction", errors.without),
            ("with correction, as calibrated", errors.with),
            ("after the diagnosis", after),
        ]))?;
    }
    head(console, "True effect")?;
    console.say(format!(
        "{} It moved the tool by {:.3} mm RMS on this path.",
        told.truth, told.hidden_effect_mm
    ))?;
    let (paint, judged) = match (&told.said, told.named_right) {
        (Some(_), true) => (Paint::Good, "correctly identified".to_owned()),
        (Some(said), false) => {
            let whose = said.joint.map_or(String::new(), |joint| format!(" of joint {joint}"));
            (
                Paint::Bad,
                format!("NOT CORRECT: {}{whose} was reported", said.effect.replace('_', " ")),
            )
        }
        (None, _) => {
            let verdict = told.verdict.replace('_', " ");
            (
                Paint::Bad,
                format!("NOT IDENTIFIED: the verdict was {verdict}, and the model was not changed"),
            )
        }
    };
    let judged = console.paint(paint, &judged);
    console.say(format!("{judged}, in {:.1} s", told.diagnosis_s))?;
    console.say(format!(
        "{} cycles at 1 kHz; {} missed, {} commands rejected, {} invariants broken",
        milled.counts.cycles,
        milled.counts.missed_cycles,
        milled.counts.rejected_commands,
        milled.counts.invariants_broken
    ))?;
    console.say("")?;
    console.say(format!("diagnosis  {}", out.join(FOLDER).join("report.html").display()))?;
    console.say(format!(
        "recordings {} and {}",
        out.join("recording.csv").display(),
        out.join("measured.csv").display()
    ))?;
    console
        .say(format!("MCAP       {} (recorded by the daemon)", out.join("blackbox").display()))?;
    console.say(format!("page: {}", out.join("report.html").display()))
}

/// The effect of the model's replacement, compared with the cycles before it.
fn swapped(swap: &Swap) -> String {
    let between = format!("new model loaded between two of {} cycles", swap.cycles);
    if swap.missed_about == 0 {
        return format!("{between}; no missed cycle within the second around it");
    }
    let share = 100.0 * swap.missed as f64 / swap.cycles.max(1) as f64;
    let about = 0.1 * swap.missed_about as f64;
    format!(
        "{between}; {about:.1} % of the cycles missed in the second around it, {share:.1} % overall: this computer is busy"
    )
}

fn head(console: &mut Console, text: &str) -> Said {
    let text = console.paint(Paint::Strong, text);
    console.say(format!("\n{text}"))
}

fn table<const N: usize>(rows: [(&str, Spread); N]) -> String {
    let mm = |value: f64| format!("{value:.3}");
    let table = TextTable::new(["tool error, mm", "mean", "95 %", "largest"]);
    let table = rows.into_iter().fold(table, |table, (name, spread)| {
        table.row([name.to_owned(), mm(spread.mean), mm(spread.p95), mm(spread.max)])
    });
    on_stdout(&table)
}
