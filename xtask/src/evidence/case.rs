//! One case of a set: concealed effect, result, and its evaluation by rule.
//!
//! A missed limit, a better reference, a missing answer and a doubt are reported for every case in
//! the same words.

use report::significant;

use super::bench::Answer;
use super::said::{Found, Said};

/// Findings of a case that the document lists, and reasons for silence.
const LISTED: usize = 12;
const REASONS: usize = 4;

/// A requirement on a run.
pub(super) struct Judged {
    pub(super) what: String,
    pub(super) measured: String,
    pub(super) bar: String,
    pub(super) met: bool,
}

/// Held-out errors in one unit.
pub(super) struct Errors {
    pub(super) before: f64,
    pub(super) after: f64,
    /// `%`, `N`, `mm`.
    pub(super) unit: &'static str,
    /// The quantity: root mean square, mean distance.
    pub(super) of: &'static str,
}

/// What the set's authors, or its note, reached.
pub(super) struct Reference {
    /// In the unit of the case's errors; `None` if it is not comparable as a number.
    pub(super) value: Option<f64>,
    /// The figure with its source.
    pub(super) says: &'static str,
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
    pub(super) said: Vec<String>,
    pub(super) rows: Vec<Row>,
    pub(super) more_rows: usize,
    pub(super) errors: Option<Errors>,
    pub(super) reference: Option<Reference>,
    pub(super) judged: Vec<Judged>,
    /// Where it is worse, in doubt or without an answer, besides missed limits.
    pub(super) short_of: Vec<String>,
    pub(super) was_run: bool,
}

impl Judged {
    pub(super) fn new(
        what: impl Into<String>,
        measured: impl Into<String>,
        bar: impl Into<String>,
        met: bool,
    ) -> Self {
        Self { what: what.into(), measured: measured.into(), bar: bar.into(), met }
    }

    /// An upper limit on a number.
    pub(super) fn at_most(what: &str, value: f64, bar: f64, unit: &str) -> Self {
        let told = |x: f64| format!("{} {unit}", significant(x, 3));
        Self::new(what, told(value), format!("at most {}", told(bar)), value <= bar)
    }

    /// A lower limit on a number.
    pub(super) fn at_least(what: &str, value: f64, bar: f64, unit: &str) -> Self {
        let told = |x: f64| format!("{} {unit}", significant(x, 3));
        Self::new(what, told(value), format!("at least {}", told(bar)), value >= bar)
    }

    /// An interval that has to contain a value.
    pub(super) fn holds(what: &str, found: Option<(f64, [f64; 2])>, truth: f64) -> Self {
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

impl Case {
    /// Result of a command other than a diagnosis.
    pub(super) fn plain(name: &str, concealed: &str, command: &[&str], answer: &Answer) -> Self {
        let verdict = why(answer);
        Self {
            name: name.to_owned(),
            concealed: concealed.to_owned(),
            command: shown(command),
            short: verdict.clone(),
            verdict,
            was_run: !matches!(answer, Answer::NotRun),
            ..Self::default()
        }
    }

    /// Result of `trued diagnose` in one domain; otherwise why there is none.
    pub(super) fn of(
        name: &str,
        concealed: &str,
        command: &[&str],
        answer: &Answer,
        domain: &str,
    ) -> (Self, Option<Said>) {
        let mut case = Self::plain(name, concealed, command, answer);
        let Answer::Done(folder) = answer else { return (case, None) };
        let said = Said::of(folder, domain);
        case.verdict = said.verdict().replace('_', " ");
        case.short = format!("{}: {}", case.verdict, said.names(5));
        case.tell(&said);
        (case, Some(said))
    }

    fn tell(&mut self, said: &Said) {
        let unit = said.text("unit");
        let [before, after, noise] = ["heldout_rms_before", "heldout_rms_after", "noise_rms"]
            .map(|key| significant(said.number(key), 3));
        if said.number("heldout_rms_before") > 0.0 {
            self.said.push(format!(
                "Held out ({}): {before} {unit} with the given model, {after} {unit} with the findings, noise {noise} {unit} (RMS of single values).",
                said.text("heldout")
            ));
        }
        for one in said.findings().take(LISTED) {
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
        self.more_rows = said.findings().count().saturating_sub(LISTED);
        if said.findings().count() == 1 {
            self.said.extend(said.findings().map(|one| one.says().to_owned()));
        }
        if said.number("heldout_rms_after") > said.number("heldout_rms_before") {
            self.short_of.push(format!(
                "The findings increase the held-out error: {before} to {after} {unit}."
            ));
        }
        if let Some(rest) = said.unexplained() {
            self.short_of.push(format!("Unexplained: {rest}"));
        }
        let notes = said.list("notes").iter().filter_map(|note| note.as_str());
        let refuted = notes.clone().filter(|note| note.contains("increases the error")).count();
        if refuted > 0 {
            self.short_of.push(format!(
                "Selected, but rejected because they increase the error on held-out rows: {refuted}."
            ));
        }
        let zones: Vec<&str> = notes.filter(|note| note.contains("follows no known law")).collect();
        match zones.as_slice() {
            [] => {}
            [one] => self.short_of.push(sentence(one)),
            many => self.short_of.push(format!(
                "Low-speed zones whose torque follows no known law: {} joints.",
                many.len()
            )),
        }
        let open: Vec<String> =
            said.findings().filter(Found::may_be_nothing).map(|one| one.name()).collect();
        if !open.is_empty() {
            self.short_of.push(format!(
                "Reported, although the interval of its only parameter includes zero: {}.",
                open.join(", ")
            ));
        }
        let reasons = said.not_tested();
        let more = reasons.len().saturating_sub(REASONS);
        let mut told: Vec<String> = reasons.into_iter().take(REASONS).collect();
        told.extend((more > 0).then(|| format!("{more} more reasons")));
        if !told.is_empty() {
            self.short_of.push(format!("Not tested: {}.", told.join("; ")));
        }
    }

    /// Held-out errors reported by the diagnosis.
    pub(super) fn rms(&mut self, said: &Said, unit: &'static str) {
        self.errors = Some(Errors {
            before: said.number("heldout_rms_before"),
            after: said.number("heldout_rms_after"),
            unit,
            of: "root mean square",
        });
    }

    /// Whether all requirements are met, including that of an answer.
    pub(super) fn is_met(&self) -> bool {
        let is_answered =
            !(self.verdict.starts_with("no answer") || self.verdict.starts_with("refused"));
        is_answered && self.judged.iter().all(|one| one.met)
    }

    /// All shortfalls, as text.
    pub(super) fn shortfalls(&self) -> Vec<String> {
        let mut all: Vec<String> = self
            .judged
            .iter()
            .filter(|one| !one.met)
            .map(|one| format!("**Missed**: {}: {}; limit: {}.", one.what, one.measured, one.bar))
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
        let was_asked = self.judged.iter().any(|one| one.met && one.what == "verdict");
        if self.rows.is_empty()
            && !was_asked
            && matches!(self.verdict.as_str(), "undetermined" | "consistent")
        {
            all.push(format!("No result: {}, no finding.", self.verdict));
        }
        all.extend(self.short_of.iter().cloned());
        all
    }
}

/// Why there is no answer.
pub(super) fn why(answer: &Answer) -> String {
    match answer {
        Answer::Done(_) => "done".to_owned(),
        Answer::Late(limit_s) => format!("no answer within {limit_s} s"),
        Answer::Refused(said) => format!("refused: {said}"),
        Answer::NotRun => "not run".to_owned(),
    }
}

/// The command as one types it.
pub(super) fn shown(words: &[&str]) -> String {
    format!("trued {}", words.join(" "))
}

/// With a capital and a full stop.
pub(super) fn sentence(text: &str) -> String {
    let text = report::capitalised(text);
    if text.ends_with('.') { text } else { text + "." }
}
