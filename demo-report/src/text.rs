//! Text output of the demo, in order.
//!
//! The hidden effect is reported last. Every number was measured.

use std::path::Path;

use report::{TextLine, TextTable, Tone};

use crate::PAGE;
use crate::diagnosis::FOLDER;
use crate::outcome::{DiagnosisOutcome, ErrorStatistics, MillingResult, ModelChange, Report};
use crate::scene::{Scene, TRACKER_M};

/// Who plays.
pub(crate) fn introduction(scene: &Scene) -> Vec<TextLine> {
    let (what, duration_s, seed) = (scene.description(), scene.work.duration_s(), scene.seed);
    let robot = scene.model.file.name.as_str();
    let mills = format!(" mills {what} in {duration_s:.0} s, seed {seed}");
    let lines = [
        TextLine::with_head(Tone::Plain, robot, mills),
        "The daemon uses the calibrated model. In the simulated robot, every parameter deviates randomly within its stated".into(),
        "uncertainty, and there is one hidden effect that the model lacks, drawn at random with the seed.".into(),
    ];
    lines.into_iter().chain(head("1  Milling without and with correction")).collect()
}

/// The result of milling.
pub(crate) fn milled(milled: &MillingResult, width: Option<usize>) -> Vec<TextLine> {
    let errors = &milled.tool_error_mm;
    let rows = [("without correction", errors.without), ("with correction", errors.with)];
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
    let chatter = format!("vibration: simulated chatter {}", milled.ringing.words);
    let detected = milled.vibration.iter().filter(|event| event.state == "alarm").map(|event| {
        let since = event.after_onset_ms.filter(|ms| *ms >= 0.0);
        let since = since.map_or_else(String::new, |ms| format!(", {ms:.0} ms after its onset"));
        format!("  detected at {:.2} s{since}: {}", event.t_s, event.says).into()
    });
    let lines = [table(rows, width), latency.render(width), chatter];
    lines.into_iter().map(TextLine::from).chain(detected).collect()
}

/// How it is measured.
pub(crate) fn measurement(scene: &Scene) -> Vec<TextLine> {
    let rows = &scene.survey;
    let minutes = rows.last().map_or(0.0, |row| row.time_s / 60.0);
    let celsius = rows.iter().map(|row| row.ambient_celsius);
    let (cold, warm) = celsius.fold((f64::MAX, f64::MIN), |(c, w), t| (c.min(t), w.max(t)));
    let program = format!(
        "Measuring program (simulated faster than real time): {minutes:.0} min, all joints in both directions, loads in many directions, air from {cold:.0} to {warm:.0} °C."
    );
    let tracker = format!(
        "A tracker measures three reflectors on the tool, noise {:.3} mm: {} rows. The correction continues at 1 kHz meanwhile.",
        1e3 * TRACKER_M,
        rows.len()
    );
    let lines = head("2  Measurement and diagnosis").into_iter();
    lines.chain([program.into(), tracker.into()]).collect()
}

/// Milling again, the truth, and where everything is.
pub(crate) fn summary(report: &Report, out: &Path, width: Option<usize>) -> Vec<TextLine> {
    let (milled, outcome) = (&report.milled, &report.diagnosis);
    let mut lines = Vec::new();
    if let (Some(after), Some(swap)) = (report.tool_error_after_diagnosis_mm, report.swap) {
        lines.push(model_change_text(&swap).into());
        lines.extend(head("3  The same path with the new model"));
        let errors = &milled.tool_error_mm;
        let rows = [
            ("without correction", errors.without),
            ("with correction, as calibrated", errors.with),
            ("after the diagnosis", after),
        ];
        lines.push(table(rows, width).into());
    }
    lines.extend(head("True effect"));
    let (truth, moved_mm) = (&outcome.truth, outcome.hidden_effect_mm);
    lines.push(format!("{truth} It moved the tool by {moved_mm:.3} mm RMS on this path.").into());
    lines.push(outcome_line(outcome));
    lines.push(TextLine::from(format!(
        "{} cycles at 1 kHz; {} missed, {} commands rejected, {} invariants broken",
        milled.counts.cycles,
        milled.counts.missed_cycles,
        milled.counts.rejected_commands,
        milled.counts.invariants_broken
    )));
    let path_of = |name: &str| out.join(name).display().to_string();
    lines.extend([
        "".into(),
        format!("diagnosis  {}", out.join(FOLDER).join(PAGE).display()).into(),
        format!("recordings {} and {}", path_of("recording.csv"), path_of("measured.csv")).into(),
        format!("MCAP       {} (recorded by the daemon)", path_of("blackbox")).into(),
        format!("page: {}", path_of(PAGE)).into(),
    ]);
    lines
}

/// Whether the diagnosis named the hidden effect.
fn outcome_line(outcome: &DiagnosisOutcome) -> TextLine {
    let (tone, judged) = match (&outcome.said, outcome.named_right) {
        (Some(_), true) => (Tone::Good, "correctly identified".to_owned()),
        (Some(reported), false) => {
            let whose = reported.joint.map_or(String::new(), |joint| format!(" of joint {joint}"));
            let effect = reported.effect.replace('_', " ");
            (Tone::Bad, format!("NOT CORRECT: {effect}{whose} was reported"))
        }
        (None, _) => {
            let verdict = outcome.verdict.replace('_', " ");
            let why = format!("the verdict was {verdict}, and the model was not changed");
            (Tone::Bad, format!("NOT IDENTIFIED: {why}"))
        }
    };
    TextLine::with_head(tone, judged, format!(", in {:.1} s", outcome.diagnosis_s))
}

/// The effect of the model's replacement, compared with the cycles before it.
fn model_change_text(swap: &ModelChange) -> String {
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

fn head(text: &str) -> [TextLine; 2] {
    ["".into(), TextLine::with_head(Tone::Plain, text, "")]
}

fn table<const N: usize>(rows: [(&str, ErrorStatistics); N], width: Option<usize>) -> String {
    let mm = |value: f64| format!("{value:.3}");
    let table = TextTable::new(["tool error, mm", "mean", "95 %", "largest"]);
    let table = rows.into_iter().fold(table, |table, (name, spread)| {
        table.row([name.to_owned(), mm(spread.mean), mm(spread.p95), mm(spread.max)])
    });
    table.render(width)
}
