//! The page of a force recording: phases of air and cut, spectral lines, sensor.
//!
//! The number of points in each drawing is bounded; all values come from the result.

use diagnosis::force::Diagnosis;
use report::{Axis, Bars, Column, Number, Page, Plot, Series, Svg, Table, Tone, significant};

use super::{cut, tables, tone};
use crate::forces::ForceDiagnosis;
use crate::result::{Report, UntestedEffect};

/// Largest number of points of a drawing.
const POINTS: usize = 2000;
/// Largest number of tones that are drawn.
const TONES: usize = 12;

pub(crate) fn render(found: &ForceDiagnosis, report: &Report) -> Page {
    let page = Page::new("Diagnosis of forces at the tool")
        .kicker("trued diagnose")
        .robot(found.base.file.identity().to_string());
    let page = match &found.result {
        Err(doubt) => {
            let why = format!("This recording cannot be evaluated: {doubt}");
            page.verdict(Tone::Bad, "not evaluated", &why)
                .next("Correct the cause named in the verdict and diagnose again.", None)
        }
        Ok(diagnosis) => evaluated(page, diagnosis, report),
    };
    if report.notes.is_empty() {
        return page;
    }
    page.section("Data processing").list(&report.notes)
}

fn evaluated(page: Page, diagnosis: &Diagnosis, report: &Report) -> Page {
    let verdict = report.verdict.replace('_', " ");
    let mut page = page
        .verdict(tone(report), &verdict, &sentence(diagnosis, report))
        .numbers(numbers(report))
        .figure(
            "Distance of the signal from its mean at rest: air and cut.",
            &level(diagnosis, report),
        );
    page = next_step(page, report);
    let sentences: Vec<&str> =
        report.findings.iter().map(|reported| reported.says.as_str()).collect();
    if !sentences.is_empty() {
        page = page.section("Findings").list(&sentences);
        page = page.table(&tables::findings(report)).table(&tables::parameters(report));
    }
    if let Some(rest) = &report.unexplained {
        page = page.note(Tone::Caution, "Unexplained", &rest.says);
    }
    if let Ok(compared) = &diagnosis.cut_comparison {
        page = cut::figures(page, compared);
        if !report.not_tested.is_empty() {
            let open =
                |one: &UntestedEffect| format!("{}: {}", one.effect.replace('_', " "), one.why);
            let open: Vec<String> = report.not_tested.iter().map(open).collect();
            page = page.section("Not observable in this recording").list(&open);
        }
    }
    page = page.section("Air and cut").table(&phases(report));
    if !report.tones.is_empty() {
        page = page
            .section("Tones of the cut")
            .figure("Amplitude of each tone in the cut and in air.", &tones_drawn(report))
            .table(&tones(report));
    }
    page
}

/// The step for what was found, or for what remains undecided; nothing is to be done only if nothing was found.
fn next_step(page: Page, report: &Report) -> Page {
    if let Some(action) = &report.action {
        return page.next(&action.says, action.command.as_deref());
    }
    let otherwise = match report.verdict {
        "consistent" => "No action required. Record again if the cut sounds different.",
        "missing_physics" => "Use the resulting model: it contains what was found.",
        _ => {
            "Record again, with some seconds in air before and after the cut, and state the cut (`[cut]` in the recording's TOML)."
        }
    };
    page.next(report.next_experiment.as_deref().unwrap_or(otherwise), None)
}

fn sentence(diagnosis: &Diagnosis, report: &Report) -> String {
    match &diagnosis.cut_comparison {
        Ok(_) => format!(
            "RMS force error: {} {unit} with the stated cutting model and {} {unit} with the findings; the tool: {}.",
            tables::rms(report.heldout_rms_before),
            tables::rms(report.heldout_rms_after),
            report.heldout,
            unit = report.unit,
        ),
        Err(_) => {
            let found = report.findings.first().map(|reported| format!("{} ", reported.says));
            format!("{}The tool: {}.", found.unwrap_or_default(), report.heldout)
        }
    }
}

fn numbers(report: &Report) -> Vec<Number> {
    let mut numbers = vec![Number::text("Findings", report.findings.len().to_string())];
    let held = report.heldout_rms_before.zip(report.heldout_rms_after);
    numbers.extend(held.into_iter().flat_map(|(before, after)| {
        let rms = "RMS";
        [
            Number::new("Error, stated model", before, report.unit).note(rms),
            Number::new("Error, with the findings", after, report.unit).note(rms),
        ]
    }));
    if let Some(loudest) = report.tones.iter().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude)) {
        let note =
            format!("{} {}; {}", significant(loudest.amplitude, 3), report.unit, loudest.cause);
        numbers.push(Number::new("Loudest tone", loudest.frequency_Hz, "Hz").note(note));
    }
    numbers
}

fn level(diagnosis: &Diagnosis, report: &Report) -> Svg {
    let stride = diagnosis.level.len().div_ceil(POINTS).max(1);
    let points: Vec<(f64, f64)> = diagnosis.level.iter().step_by(stride).copied().collect();
    let plot = Plot::new("Level", Axis::new("Time", "s"), Axis::new("Level", report.unit).log())
        .series(Series::line("distance from rest, including vibration", points));
    let phases = report.phases.iter().skip(1);
    phases.fold(plot, |plot, phase| plot.mark_x(phase.from_s, phase.state)).render()
}

fn tones_drawn(report: &Report) -> Svg {
    let bars = Bars::new("Tones of the cut", Axis::new("Amplitude", report.unit))
        .groups(["in the cut", "in air"]);
    let shown = report.tones.iter().take(TONES);
    shown
        .fold(bars, |bars, tone| {
            let name = format!("{} Hz, {}", significant(tone.frequency_Hz, 4), tone.cause);
            bars.row(name, [tone.amplitude, tone.amplitude_in_air])
        })
        .render()
}

fn phases(report: &Report) -> Table {
    let heads = ["State", "From, s", "To, s", "Mean of each channel", "Scatter"];
    let table = Table::new(format!("State of the tool, {}", report.unit), heads.map(Column::new));
    let list = |values: &[f64]| {
        values.iter().map(|x| significant(*x, 3)).collect::<Vec<String>>().join(", ")
    };
    report.phases.iter().fold(table, |table, one| {
        table.row([
            one.state.to_owned().into(),
            significant(one.from_s, 3).into(),
            significant(one.to_s, 3).into(),
            list(&one.mean).into(),
            list(&one.scatter).into(),
        ])
    })
}

fn tones(report: &Report) -> Table {
    let heads = ["Frequency, Hz", "Amplitude", "In air", "Channel", "Cause"];
    let table = Table::new(format!("Tones, {}", report.unit), heads.map(Column::new));
    report.tones.iter().fold(table, |table, one| {
        table.row([
            significant(one.frequency_Hz, 4).into(),
            significant(one.amplitude, 3).into(),
            significant(one.amplitude_in_air, 3).into(),
            one.channel.clone().into(),
            one.cause.clone().into(),
        ])
    })
}
