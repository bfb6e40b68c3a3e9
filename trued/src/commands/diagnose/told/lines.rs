//! A diagnosis as lines for people.
//!
//! Promises: findings first, the most important ones; what was left out is counted. Never: a number that the file does not hold.

use report::significant;

use super::{Alternative, Report};

/// Findings that are told, at most.
const LINES: usize = 12;

/// The findings, the rest, and what to do, line by line.
pub(in crate::commands) fn lines(report: &Report) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for told in report.findings.iter().take(LINES) {
        let alike = told.alternatives.iter().filter(|other| other.is_alike);
        let rivals: Vec<String> = alike.map(Alternative::name).collect();
        let rivals = if rivals.is_empty() {
            String::new()
        } else {
            format!(" (cannot be told from {})", rivals.join(", "))
        };
        let confidence = told.confidence.map(|p| format!("Confidence {p:.2}"));
        let held = told.heldout_rms_before.zip(told.heldout_rms_after).map(|(before, after)| {
            let [before, after] = [before, after].map(|rms| significant(rms, 3));
            format!("held out {before} to {after} {}", report.unit)
        });
        let figures: Vec<String> = confidence.into_iter().chain(held).collect();
        lines.push(format!("  {} {}{rivals}", told.says, figures.join("; ")).trim_end().to_owned());
    }
    if report.findings.len() > LINES {
        lines.push(format!("  and {} more", report.findings.len() - LINES));
    }
    lines.extend(report.unexplained.as_ref().map(|rest| format!("  {}", rest.says)));
    lines.extend(report.next_experiment.as_ref().map(|next| format!("  next: {next}")));
    lines.extend(report.notes.iter().map(|note| format!("  {note}")));
    lines
}
