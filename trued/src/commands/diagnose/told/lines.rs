//! A diagnosis as lines for people.
//!
//! Promises: findings first, the most important ones; what was left out is counted. Never: a number that the file does not hold.

use report::significant;

use super::{Alternative, Report, Told};

/// Findings that are told in a line of their own, at most.
const LINES: usize = 12;
/// So much of what the findings take from the squared held-out error is told in lines of their own.
const TOLD: f64 = 0.9;

/// The findings, the rest, and what to do, line by line.
pub(in crate::commands) fn lines(report: &Report) -> Vec<String> {
    let (first, also) = report.findings.split_at(leading(&report.findings));
    let mut lines: Vec<String> = first.iter().map(|told| line(report, told)).collect();
    lines.extend(others(report, first, also));
    if !report.candidates.is_empty() {
        let names = report.candidates.iter().map(|told| match told.confidence {
            Some(confidence) => format!("{} ({confidence:.2})", told.name()),
            None => told.name(),
        });
        let names = names.collect::<Vec<String>>().join(", ");
        lines.push(format!("  not claimed, each with its probability: {names}"));
    }
    lines.extend(report.unexplained.as_ref().map(|rest| format!("  {}", rest.says)));
    lines.extend(report.next_experiment.as_ref().map(|next| format!("  next: {next}")));
    lines.extend(report.notes.iter().map(|note| format!("  {note}")));
    lines
}

/// How many findings, in their order, bring [`TOLD`] of what all bring.
fn leading(findings: &[Told]) -> usize {
    let square = |rms: Option<f64>| rms.map_or(0.0, |rms| rms * rms);
    let before = findings.first().map_or(0.0, |one| square(one.heldout_rms_before));
    let after = findings.last().map_or(0.0, |one| square(one.heldout_rms_after));
    let wanted = before - TOLD * (before - after);
    let enough = findings.iter().position(|one| square(one.heldout_rms_after) <= wanted);
    enough.map_or(findings.len(), |last| last + 1).min(LINES)
}

/// A finding with its figures.
fn line(report: &Report, told: &Told) -> String {
    let unit = report.unit;
    let alike = told.alternatives.iter().filter(|other| other.is_alike);
    let rivals: Vec<String> = alike.map(Alternative::name).collect();
    let rivals = match rivals.as_slice() {
        [] => String::new(),
        rivals => format!(" (cannot be distinguished from {})", rivals.join(", ")),
    };
    let together = |other: &&Told| told.group.is_some() && other.group == told.group;
    let others =
        report.findings.iter().filter(together).filter(|other| !std::ptr::eq(*other, told));
    let others: Vec<String> = others.map(Told::name).collect();
    let together = match others.as_slice() {
        [] => String::new(),
        others => format!(" (determined only together with {})", others.join(", ")),
    };
    let confidence = told.confidence.map(|p| format!("Confidence {p:.2}"));
    let size = told.size.as_ref().map(|size| {
        let [rms, max] = [size.rms, size.max].map(|value| significant(value, 3));
        format!("{rms} {unit} (largest {max})")
    });
    let held = told.heldout_rms_before.zip(told.heldout_rms_after).map(|(before, after)| {
        let [before, after] = [before, after].map(|rms| significant(rms, 3));
        format!("held out {before} to {after} {unit}")
    });
    let figures: Vec<String> = confidence.into_iter().chain(size).chain(held).collect();
    format!("  {} {}{rivals}{together}", told.says, figures.join("; ")).trim_end().to_owned()
}

/// The other findings in one line, with a bound of their sizes where they are all smaller than the first ones.
fn others(report: &Report, first: &[Told], also: &[Told]) -> Option<String> {
    let sizes = |all: &[Told]| -> Vec<f64> {
        all.iter().filter_map(|told| told.size.as_ref()).map(|size| size.rms).collect()
    };
    let largest = sizes(also).into_iter().fold(0.0, f64::max);
    let smallest_told = sizes(first).into_iter().fold(f64::INFINITY, f64::min);
    let size = if 0.0 < largest && largest < smallest_told {
        format!(", each at most {} {}", significant(largest, 3), report.unit)
    } else {
        String::new()
    };
    let names = also.iter().map(Told::name).collect::<Vec<String>>().join(", ");
    (!also.is_empty()).then(|| format!("  also{size}: {names}"))
}
