//! The page of `trued diagnose`: what was found in words first, then the proof, the map, the rivals, what is open.

use report::{Column, Number, Page, Table, Tone, significant};

use super::Found;
use super::told::{Alternative, Report, Value, lead};

/// Cells of the map that are shown.
const CELLS: usize = 15;

/// The whole page.
pub(super) fn render(found: &Found, report: &Report) -> String {
    let lead = lead(found, report);
    let mut page = Page::new(format!("Diagnosis of {}", found.base.file.name))
        .kicker(format!("trued diagnose: {}", report.verdict.replace('_', " ")))
        .lead(&lead);
    if found.diagnosis.is_some() {
        page = page.numbers(numbers(report));
    }
    let sentences: Vec<&str> = report.findings.iter().map(|told| told.says.as_str()).collect();
    if !sentences.is_empty() {
        page = page
            .section("What was found")
            .list(&sentences)
            .table(&findings(report))
            .table(&parameters(report));
    }
    if let Some(rest) = &report.unexplained {
        page = page.note(Tone::Caution, "Not explained", &rest.says);
    }
    if let Some(next) = &report.next_experiment {
        page = page.note(Tone::Caution, "What would settle it", next);
    }
    if !report.map.is_empty() {
        page = page
            .section("Where model and recording differ")
            .text("How far each joint would have to be off, alone, in parts of the range of what the arm was doing; the clearest first.")
            .table(&map(report));
    }
    if !report.not_tested.is_empty() {
        let open: Vec<String> = report
            .not_tested
            .iter()
            .map(|one| {
                let whose = one.joint.map_or(String::new(), |joint| format!(", joint {joint}"));
                format!("{}{whose}: {}", one.effect.replace('_', " "), one.why)
            })
            .collect();
        page = page.section("What this recording could not show").list(&open);
    }
    page.section("Made from")
        .facts([
            ("Held out", report.heldout.clone()),
            ("Seed", found.seed.to_string()),
            ("Rows", found.rows.to_string()),
        ])
        .footer("Made by trued diagnose.")
        .render()
}

fn numbers(report: &Report) -> Vec<Number> {
    let gained = report.heldout_rms_after < report.heldout_rms_before;
    vec![
        Number::new("Held out, as given", report.heldout_rms_before, report.unit),
        Number::new("Held out, with what was found", report.heldout_rms_after, report.unit)
            .tone(if gained { Tone::Good } else { Tone::Caution }),
        Number::new("Noise", report.noise_rms, report.unit),
        Number::text("Findings", report.findings.len().to_string()),
    ]
}

fn findings(report: &Report) -> Table {
    let heads =
        ["Effect", "Joint", "Confidence", "Held out before", "after", "Cannot be told from"];
    let table = Table::new(format!("Findings, {}", report.unit), heads.map(Column::new));
    report.findings.iter().fold(table, |table, told| {
        let rivals: Vec<String> = told.alternatives.iter().map(Alternative::name).collect();
        table.row([
            told.effect.replace('_', " ").into(),
            told.joint.map_or("robot".to_owned(), |joint| joint.to_string()).into(),
            format!("{:.2}", told.confidence).into(),
            significant(told.heldout_rms_before, 3).into(),
            significant(told.heldout_rms_after, 3).into(),
            rivals.join(", ").into(),
        ])
    })
}

fn parameters(report: &Report) -> Table {
    let heads = ["Effect", "Joint", "Parameter", "Value", "95 % interval"];
    let mut table =
        Table::new("Parameters, in the units of the model file", heads.map(Column::new));
    for told in &report.findings {
        for (key, value) in &told.parameters {
            let said = |value: f64, ci: &[f64; 2]| {
                (
                    significant(value, 4),
                    format!("{} to {}", significant(ci[0], 4), significant(ci[1], 4)),
                )
            };
            let all: Vec<(String, String)> = match value {
                Value::One { value, ci95 } => vec![said(*value, ci95)],
                Value::List { value, ci95 } => {
                    value.iter().zip(ci95).map(|(v, c)| said(*v, c)).collect()
                }
            };
            for (value, interval) in all {
                table = table.row([
                    told.effect.replace('_', " ").into(),
                    told.joint.map_or("robot".to_owned(), |joint| joint.to_string()).into(),
                    key.clone().into(),
                    value.into(),
                    interval.into(),
                ]);
            }
        }
    }
    table
}

fn map(report: &Report) -> Table {
    let heads = ["Joint", "While", "from", "to", "off by (mrad or mm)", "95 % interval"];
    let table = Table::new("Clearest cells", heads.map(Column::new));
    report.map.iter().take(CELLS).fold(table, |table, cell| {
        table.row([
            cell.joint.to_string().into(),
            cell.depends_on.clone().into(),
            significant(cell.from, 3).into(),
            significant(cell.to, 3).into(),
            significant(cell.off, 3).into(),
            format!("{} to {}", significant(cell.ci95[0], 3), significant(cell.ci95[1], 3)).into(),
        ])
    })
}
