//! The page of forces alone: when the tool was in air and in the cut, the tones, the sensor.
//!
//! Promises: a bounded number of points in each drawing. Never: a number of its own.

use report::{Axis, Column, Page, Plot, Series, Table, Tone, significant};

use super::{cut, tables};
use crate::commands::diagnose::forces::Forces;
use crate::commands::diagnose::told::{NotTested, Report};
use crate::output::made_by;

/// Points of a drawing.
const POINTS: usize = 2000;

pub(in crate::commands::diagnose) fn render(found: &Forces, report: &Report) -> String {
    let kicker = format!("trued diagnose: {}", report.verdict.replace('_', " "));
    let mut page = Page::new("Diagnosis of forces".to_owned()).kicker(kicker);
    match &found.result {
        Err(doubt) => {
            page = page.lead("This recording cannot be judged.").note(
                Tone::Bad,
                "Why",
                &doubt.to_string(),
            );
        }
        Ok(diagnosis) => {
            let lead = match &diagnosis.compared {
                Ok(_) => format!(
                    "Compared with the stated cut: error {} N before, {} N after, noise {} N; {}.",
                    tables::rms(report.heldout_rms_before),
                    tables::rms(report.heldout_rms_after),
                    significant(report.noise_rms, 3),
                    report.heldout
                ),
                Err(_) => format!("The tool: {}.", report.heldout),
            };
            page = page.lead(&lead);
            let sentences: Vec<&str> =
                report.findings.iter().map(|told| told.says.as_str()).collect();
            if !sentences.is_empty() {
                page = page.section("What was found").list(&sentences);
                page = page.table(&tables::findings(report)).table(&tables::parameters(report));
            }
            if let Some(next) = &report.next_experiment {
                page = page.note(Tone::Caution, "What would settle it", next);
            }
            if let Some(rest) = &report.unexplained {
                page = page.note(Tone::Caution, "What no name explains", &rest.says);
            }
            if let Ok(compared) = &diagnosis.compared {
                page = cut::figures(page, compared);
                if !report.not_tested.is_empty() {
                    let open = |one: &NotTested| format!("{}: {}", one.effect, one.why);
                    let open: Vec<String> = report.not_tested.iter().map(open).collect();
                    page = page.section("What could not have shown").list(&open);
                }
            }
            let stride = diagnosis.level.len().div_ceil(POINTS).max(1);
            let points: Vec<(f64, f64)> = diagnosis.level.iter().step_by(stride).copied().collect();
            let plot =
                Plot::new("Level", Axis::new("time", "s"), Axis::new("level", report.unit).log())
                    .series(Series::line("distance from rest, swing included", points));
            page = page
                .section("Air and cut")
                .figure("How far the signal is from where it is quiet.", &plot.render());
            page = page.table(&phases(report));
            if !report.tones.is_empty() {
                page = page.section("Tones of the cut").table(&tones(report));
            }
        }
    }
    if !report.notes.is_empty() {
        page = page.section("What was done with the data").list(&report.notes);
    }
    page.footer(made_by("diagnose")).render()
}

fn phases(report: &Report) -> Table {
    let heads = ["State", "From, s", "To, s", "Mean of each channel", "Scatter"];
    let table = Table::new(format!("What the tool does, {}", report.unit), heads.map(Column::new));
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
