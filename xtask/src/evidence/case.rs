//! One case of a set: concealed effect, result, and its evaluation by rule.
//!
//! A missed limit, a better reference, a missing answer and a doubt are reported for every case in
//! the same words.

use report::significant;

use super::diagnosis_result::{DiagnosisResult, FindingView};
use super::set_runner::RunOutcome;

/// Largest number of findings of a case in the document, and of reasons for a missing finding.
const FINDINGS_LISTED: usize = 12;
const REASONS_LISTED: usize = 4;

/// A requirement on a run.
pub(super) struct LimitCheck {
    pub(super) what: String,
    pub(super) measured: String,
    pub(super) limit: String,
    pub(super) met: bool,
}

/// Held-out errors in one unit.
pub(super) struct Errors {
    pub(super) before: f64,
    pub(super) after: f64,
    /// `%`, `N`, `mm`.
    pub(super) unit: &'static str,
    /// The quantity: root mean square, mean distance.
    pub(super) quantity: &'static str,
}

/// Reference value from the set's authors or its note.
pub(super) struct Reference {
    /// In the unit of the case's errors; `None` if it is not comparable as a number.
    pub(super) value: Option<f64>,
    /// The figure with its source.
    pub(super) text: &'static str,
}

/// A finding as a row: name, numbers with intervals, held-out error before and after it.
pub(super) type Row = [String; 3];

/// One case.
#[derive(Default)]
pub(super) struct Case {
    pub(super) name: String,
    pub(super) concealed: String,
    pub(super) command: String,
    /// The verdict, or why there is none.
    pub(super) verdict: String,
    /// Short form, for the summary table.
    pub(super) short: String,
    pub(super) statements: Vec<String>,
    pub(super) rows: Vec<Row>,
    pub(super) more_rows: usize,
    pub(super) errors: Option<Errors>,
    pub(super) reference: Option<Reference>,
    pub(super) checks: Vec<LimitCheck>,
    /// Where it is worse, in doubt or without an answer, besides missed limits.
    pub(super) shortfall_notes: Vec<String>,
    pub(super) was_run: bool,
}

impl LimitCheck {
    pub(super) fn new(
        what: impl Into<String>,
        measured: impl Into<String>,
        bar: impl Into<String>,
        met: bool,
    ) -> Self {
        Self { what: what.into(), measured: measured.into(), limit: bar.into(), met }
    }

    /// An upper limit on a number.
    pub(super) fn at_most(what: &str, value: f64, limit: f64, unit: &str) -> Self {
        let with_unit = |x: f64| format!("{} {unit}", significant(x, 3));
        Self::new(what, with_unit(value), format!("at most {}", with_unit(limit)), value <= limit)
    }

    /// A lower limit on a number.
    pub(super) fn at_least(what: &str, value: f64, limit: f64, unit: &str) -> Self {
        let with_unit = |x: f64| format!("{} {unit}", significant(x, 3));
        Self::new(what, with_unit(value), format!("at least {}", with_unit(limit)), value >= limit)
    }

    /// An interval that has to contain a value.
    pub(super) fn contains(what: &str, found: Option<(f64, [f64; 2])>, truth: f64) -> Self {
        let (measured, met) = match found {
            Some((_, [low, high])) => (
                format!("{} to {}", significant(low, 3), significant(high, 3)),
                low <= truth && truth <= high,
            ),
            None => ("not named".to_owned(), false),
        };
        Self::new(what, measured, format!("includes {truth}"), met)
    }
}

/// Which mean the errors of a domain are (docs/reference/results.md).
fn error_kind(domain: &str) -> &'static str {
    match domain {
        "position" => "RMS of single values",
        "torque" => "RMS, each joint weighted by its noise",
        _ => "RMS",
    }
}

impl Case {
    /// Result of a command other than a diagnosis.
    pub(super) fn from_outcome(
        name: &str,
        concealed: &str,
        command: &[&str],
        answer: &RunOutcome,
    ) -> Self {
        let verdict = outcome_text(answer);
        Self {
            name: name.to_owned(),
            concealed: concealed.to_owned(),
            command: command_text(command),
            short: verdict.clone(),
            verdict,
            was_run: !matches!(answer, RunOutcome::NotRun),
            ..Self::default()
        }
    }

    /// Result of `trued diagnose` in one domain; otherwise why there is none.
    pub(super) fn from_diagnosis(
        name: &str,
        concealed: &str,
        command: &[&str],
        answer: &RunOutcome,
        domain: &str,
    ) -> (Self, Option<DiagnosisResult>) {
        let mut case = Self::from_outcome(name, concealed, command, answer);
        let RunOutcome::Done(folder) = answer else { return (case, None) };
        let result = DiagnosisResult::read(folder, domain);
        case.verdict = result.verdict().replace('_', " ");
        case.short = format!("{}: {}", case.verdict, result.names(5));
        case.add_findings(&result);
        (case, Some(result))
    }

    fn add_findings(&mut self, result: &DiagnosisResult) {
        let unit = result.text("unit");
        let [before, after, noise] = ["heldout_rms_before", "heldout_rms_after", "noise_rms"]
            .map(|key| significant(result.number(key), 3));
        let kind = error_kind(result.text("domain"));
        if result.number("heldout_rms_before") > 0.0 {
            self.statements.push(format!(
                "Held out ({}): {before} {unit} with the given model, {after} {unit} with the findings, noise {noise} {unit} ({kind}).",
                result.text("heldout")
            ));
        }
        for one in result.findings().take(FINDINGS_LISTED) {
            let held = ["heldout_rms_before", "heldout_rms_after"].map(|key| one.number(key));
            let held = if held.iter().all(|rms| rms.is_finite()) {
                held.map(|rms| significant(rms, 3)).join(" → ")
            } else {
                "not held out".to_owned()
            };
            let only = one.condition().split_once(", in ").map(|(_, only)| format!(", in {only}"));
            self.rows.push([
                format!("{}{}", one.name(), only.unwrap_or_default()),
                one.parameters(),
                held,
            ]);
        }
        self.more_rows = result.findings().count().saturating_sub(FINDINGS_LISTED);
        if result.findings().count() == 1 {
            self.statements.extend(result.findings().map(|one| one.statement().to_owned()));
        }
        if result.number("heldout_rms_after") > result.number("heldout_rms_before") {
            self.shortfall_notes.push(format!(
                "The findings increase the held-out error: {before} to {after} {unit}."
            ));
        }
        if let Some(rest) = result.unexplained() {
            self.shortfall_notes.push(format!("Unexplained: {rest}"));
        }
        let notes = result.list("notes").iter().filter_map(|note| note.as_str());
        let refuted = notes.clone().filter(|note| note.contains("increases the error")).count();
        if refuted > 0 {
            self.shortfall_notes.push(format!(
                "Selected, but rejected because they increase the error on held-out rows: {refuted}."
            ));
        }
        let zones: Vec<&str> = notes.filter(|note| note.contains("follows no known law")).collect();
        match zones.as_slice() {
            [] => {}
            [one] => self.shortfall_notes.push(sentence(one)),
            many => self.shortfall_notes.push(format!(
                "Low-speed zones whose torque follows no known law: {} joints.",
                many.len()
            )),
        }
        let open = result.findings().filter(FindingView::interval_contains_zero);
        let open: Vec<String> = open.map(|one| one.name()).collect();
        if !open.is_empty() {
            self.shortfall_notes.push(format!(
                "Reported, although the interval of its only parameter includes zero: {}.",
                open.join(", ")
            ));
        }
        let reasons = result.not_tested();
        let more = reasons.len().saturating_sub(REASONS_LISTED);
        let mut listed: Vec<String> = reasons.into_iter().take(REASONS_LISTED).collect();
        listed.extend((more > 0).then(|| format!("{more} more reasons")));
        if !listed.is_empty() {
            self.shortfall_notes.push(format!("Not tested: {}.", listed.join("; ")));
        }
    }

    /// Held-out errors reported by the diagnosis.
    pub(super) fn set_heldout_errors(&mut self, result: &DiagnosisResult, unit: &'static str) {
        self.errors = Some(Errors {
            before: result.number("heldout_rms_before"),
            after: result.number("heldout_rms_after"),
            unit,
            quantity: "root mean square",
        });
    }

    /// Whether all requirements are met, including that of an answer.
    pub(super) fn is_met(&self) -> bool {
        let is_answered =
            !(self.verdict.starts_with("no answer") || self.verdict.starts_with("refused"));
        is_answered && self.checks.iter().all(|one| one.met)
    }

    /// All shortfalls, as text.
    pub(super) fn shortfalls(&self) -> Vec<String> {
        let mut all: Vec<String> = self
            .checks
            .iter()
            .filter(|one| !one.met)
            .map(|one| format!("**Missed**: {}: {}; limit: {}.", one.what, one.measured, one.limit))
            .collect();
        if let (Some(errors), Some(Reference { value: Some(value), .. })) =
            (&self.errors, &self.reference)
            && errors.after > *value
        {
            all.push(format!(
                "**Worse than the reference**: {} {unit} against {} {unit}.",
                significant(errors.after, 3),
                significant(*value, 3),
                unit = errors.unit
            ));
        }
        let was_asked = self.checks.iter().any(|one| one.met && one.what == "verdict");
        if self.rows.is_empty()
            && !was_asked
            && matches!(self.verdict.as_str(), "undetermined" | "consistent")
        {
            all.push(format!("No result: {}, no finding.", self.verdict));
        }
        all.extend(self.shortfall_notes.iter().cloned());
        all
    }
}

/// Text for a run without an answer.
pub(super) fn outcome_text(answer: &RunOutcome) -> String {
    match answer {
        RunOutcome::Done(_) => "done".to_owned(),
        RunOutcome::Late(limit_s) => format!("no answer within {limit_s} s"),
        RunOutcome::Refused(message) => format!("refused: {message}"),
        RunOutcome::NotRun => "not run".to_owned(),
    }
}

/// The command line.
pub(super) fn command_text(arguments: &[&str]) -> String {
    format!("trued {}", arguments.join(" "))
}

/// With a capital letter and a full stop.
pub(super) fn sentence(text: &str) -> String {
    let text = report::capitalised(text);
    if text.ends_with('.') { text } else { text + "." }
}
