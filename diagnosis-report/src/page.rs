//! The page of `trued diagnose`: findings as text, validation, location, alternatives, untested effects, handling of the data.
//!
//! The most important results come first. All values are contained in `diagnosis.json` or in the figures' data.

mod cut;
mod drives;
mod figures;
pub(crate) mod forces;
mod tables;

use std::path::Path;

use report::{Axis, Number, Page, Tone, shell_word, significant};

use crate::MODEL;
use crate::drawings::{RankedEffect, ranking};
use crate::result::{Report, ReportedFinding, summary};
use crate::robot::RobotDiagnosis;

/// With at least this many findings, a page shows their sizes joint by joint, and folds the list.
const FOLDED_FROM: usize = 6;

/// The whole page: positions first, then torques. `dir`: where the files of the result are written.
pub(crate) fn render(found: &RobotDiagnosis, reports: &[Report], dir: &Path) -> Page {
    let page = Page::new(format!("Diagnosis of {}", found.base.file.name))
        .kicker("trued diagnose")
        .robot(found.base.file.identity().to_string());
    reports.iter().enumerate().fold(page, |page, (place, report)| {
        let page = if place > 0 { page.section(&domain_heading(report)) } else { page };
        match found.torques().filter(|_| report.domain == "torque") {
            Some(torques) => drives::domain(page, found, torques, report, dir),
            None => domain(page, found, report, dir),
        }
    })
}

fn domain_heading(report: &Report) -> String {
    let domain = if report.domain == "torque" { "Drive torques" } else { "Positions" };
    format!("{domain}: {}", report.verdict.replace('_', " "))
}

/// Tone of a verdict.
fn tone(report: &Report) -> Tone {
    match report.verdict {
        "consistent" => Tone::Good,
        _ => Tone::Caution,
    }
}

/// The first screen of a domain: verdict, numbers, main figure, next step.
fn first_screen(
    page: Page,
    report: &Report,
    is_judged: bool,
    picture: Option<Figure>,
    dir: &Path,
) -> Page {
    let verdict = report.verdict.replace('_', " ");
    let mut page = if is_judged {
        page.verdict(tone(report), &verdict, &verdict_text(report)).numbers(key_figures(report))
    } else {
        let why = format!(
            "These recordings cannot be evaluated with this model: {}",
            self::summary(report)
        );
        page.verdict(Tone::Bad, "not evaluated", &why)
    };
    if let Some(Figure { caption, drawing }) = picture {
        page = page.figure(&caption, &drawing);
    }
    next_step(page, report, is_judged, dir)
}

/// A drawing with its caption.
pub(crate) struct Figure {
    pub(crate) caption: String,
    pub(crate) drawing: report::Svg,
}

fn next_step(page: Page, report: &Report, is_judged: bool, dir: &Path) -> Page {
    let model = shell_word(&dir.join(MODEL).display().to_string());
    if let Some(next) = &report.next_experiment {
        let command = format!("trued plan --for {}", shell_word(&dir.display().to_string()));
        return page.next(next, report.has_experiment().then_some(command.as_str()));
    }
    match report.verdict {
        _ if !is_judged => page.next("Correct the cause named in the verdict and diagnose again.", None),
        _ if report.tolerance.is_some_and(|tolerance| tolerance.is_missed()) => page.next(
            "The tool is outside the tolerance even with the findings. Check that instrument and targets are firm, record more poses and other directions of approach, and diagnose all recordings together; until then the resulting model is an improvement only.",
            None,
        ),
        "consistent" => page.next("Nothing to change. Measure again after a collision or a repair.", None),
        "missing_physics" => page.next(
            "Load the resulting model into the cell's daemon, first in shadow mode.",
            Some(&format!("trued reload --config CELL.toml {model}")),
        ),
        _ => page.next(
            "Record more data: other joints, directions, loads or temperatures; then diagnose all recordings together.",
            None,
        ),
    }
}

/// The findings as sentences; the tables of a long list are folded.
fn findings_section(mut page: Page, report: &Report, joints: usize) -> Page {
    let sentences: Vec<&str> =
        report.findings.iter().map(|reported| reported.says.as_str()).collect();
    if !sentences.is_empty() {
        let (first, others) = sentences.split_at(sentences.len().min(FOLDED_FROM));
        page = page.section("Findings").list(first);
        if !others.is_empty() {
            page = page.folded(&format!("And {} more", others.len()), |page| page.list(others));
        }
        if let Some(figure) = size_figure(report) {
            page = page.figure(&figure.caption, &figure.drawing);
        }
        if report.findings.len() >= FOLDED_FROM {
            if joints > 1 {
                page = page.table(&tables::by_joint(report, joints));
            }
            page = page.folded("Findings in detail", |page| page.table(&tables::findings(report)));
        } else {
            page = page.table(&tables::findings(report));
        }
    }
    if !report.minor.is_empty() {
        let effects = if report.minor.len() == 1 { "effect" } else { "effects" };
        let title = format!("And {} smaller {effects}", report.minor.len());
        page = page.folded(&title, |page| page.table(&tables::minor(report)));
    }
    if !report.candidates.is_empty() {
        let title = "Not reported as findings: probability below 50 %";
        page = page.section(title).table(&tables::candidates(report));
    }
    if let Some(rest) = &report.unexplained {
        page = page.note(Tone::Caution, "Unexplained", &rest.says);
    }
    page
}

/// Effect of each finding alone on the measurement, largest first.
fn size_figure(report: &Report) -> Option<Figure> {
    let what = if report.domain == "torque" {
        "Effect on the torque"
    } else {
        "Effect on the measurement"
    };
    let ranked = report.findings.iter().map(|reported| RankedEffect {
        name: ReportedFinding::name(reported),
        size: reported.size.as_ref().map(|size| size.rms),
    });
    let axis = Axis::new(what, format!("{} RMS", report.unit));
    let drawing = ranking("Effect of each finding", axis, ranked)?;
    let caption = "Effect of each finding alone on the measurement, largest first.".to_owned();
    Some(Figure { caption, drawing })
}

/// The alternatives, the parameters, and what was not tested.
fn details(mut page: Page, report: &Report) -> Page {
    page = alternatives_section(page, report);
    if !report.findings.is_empty() {
        page = page.section("Parameters").text(
            "Parameters are in the units of the model file. Intervals have a coverage of 95 % and include 0.5 % of the value for the uncertainty of \
             scale and geometry.",
        );
        page = if report.findings.len() >= FOLDED_FROM {
            page.folded("All parameters", |page| page.table(&tables::parameters(report)))
        } else {
            page.table(&tables::parameters(report))
        };
    }
    untested_section(page, report)
}

fn domain(page: Page, found: &RobotDiagnosis, report: &Report, dir: &Path) -> Page {
    let Some(diagnosis) = &found.diagnosis else {
        return data_section(
            details(first_screen(page, report, false, None, dir), report),
            found,
            report,
        );
    };
    let arm = &found.base.physics.arm;
    let picture =
        figures::arm(arm, diagnosis, report).or_else(|| figures::sizes(diagnosis, report));
    let mut page = first_screen(page, report, true, picture, dir);
    page = findings_section(page, report, arm.count());
    page = figures::validation(page, diagnosis, report);
    page = figures::error_map(page, diagnosis, report);
    page = figures::findings_over_covariates(page, diagnosis, report);
    data_section(details(page, report), found, report)
}

/// The verdict as sentences, with the evaluation of a tolerance if one was stated.
fn verdict_text(report: &Report) -> String {
    let sentence = sentence(report);
    match &report.tolerance {
        Some(tolerance) => format!("{sentence} Tolerance of {}.", tolerance.evaluation()),
        None => sentence,
    }
}

fn sentence(report: &Report) -> String {
    let [before, after] = [report.heldout_rms_before, report.heldout_rms_after]
        .map(|rms| rms.map_or("?".to_owned(), |rms| significant(rms, 2)));
    let residual = significant(report.noise_rms, 2);
    let unit = report.unit;
    match (report.verdict, report.all_findings().count()) {
        ("consistent", _) => {
            format!(
                "Nothing in the recording contradicts the model: the residuals scatter by {residual} {unit} without structure."
            )
        }
        ("undetermined", _) => format!(
            "The model error is {before} {unit} at a residual scatter of {residual} {unit}, but this recording cannot distinguish between several causes."
        ),
        ("unknown_structure", 0) => format!(
            "The model error is {before} {unit} at a residual scatter of {residual} {unit}, and no known effect explains it."
        ),
        ("unknown_structure", count) => format!(
            "The model error is {before} {unit}. {} reduce{} it to {after} {unit}; the remaining error is not explained by any known effect.",
            effect_count(count),
            if count == 1 { "s" } else { "" }
        ),
        (_, count) => format!(
            "{} explain{} the difference: the RMS error on held-out rows decreases from {before} to {after} {unit}.",
            effect_count(count),
            if count == 1 { "s" } else { "" }
        ),
    }
}

fn effect_count(count: usize) -> String {
    if count == 1 { "One effect".to_owned() } else { format!("{count} effects together") }
}

/// Key figures without a tone: an improvement is not necessarily sufficient.
fn key_figures(report: &Report) -> Vec<Number> {
    let rms = format!("on held-out readings: {}", report.error_kind());
    let held = report.heldout_rms_before.zip(report.heldout_rms_after).map(|(before, after)| {
        let share = format!(
            "{rms}; {} % of the given model's error",
            significant(100.0 * after / before, 2)
        );
        let given = Number::new("Given model", before, report.unit).note(rms.clone());
        let found = Number::new("With the findings", after, report.unit).note(share);
        if report.all_findings().count() == 0 { vec![given] } else { vec![given, found] }
    });
    let residual = Number::new("Residual", report.noise_rms, report.unit)
        .note("on the fitted readings: instrument noise and unexplained errors");
    let smaller = (report.minor.len(), "smaller");
    let not_claimed = (report.candidates.len(), "probability below 50 %");
    let others = [smaller, not_claimed].into_iter().filter(|(count, _)| *count > 0);
    let others: Vec<String> = others.map(|(count, what)| format!("{count} {what}")).collect();
    let note = if others.is_empty() { String::new() } else { format!("and {}", others.join(", ")) };
    let findings = Number::text("Findings", report.findings.len().to_string()).note(note);
    held.into_iter().flatten().chain([residual, findings]).collect()
}

/// Findings with alternatives that explain the data equally or almost as well.
fn alternatives_section(page: Page, report: &Report) -> Page {
    if report.findings.iter().all(|reported| reported.alternatives.is_empty()) {
        return page;
    }
    page.section("Alternatives")
        .text("Alternative explanations of a finding, with the probability of each from this recording alone.")
        .figure("Probability of each candidate.", &figures::probabilities_of_alternatives(report))
}

/// An effect, and its joints (1-based; empty for the whole robot).
type EffectJoints = (String, Vec<usize>);

/// Effects that could not be tested, grouped by reason.
fn untested_section(page: Page, report: &Report) -> Page {
    let mut reasons: Vec<(&str, Vec<EffectJoints>)> = Vec::new();
    for one in &report.not_tested {
        let index = reasons.iter().position(|(why, _)| *why == one.why).unwrap_or_else(|| {
            reasons.push((&one.why, Vec::new()));
            reasons.len() - 1
        });
        let (name, effects) = (one.effect.replace('_', " "), &mut reasons[index].1);
        match effects.iter_mut().find(|(known, _)| *known == name) {
            Some((_, joints)) => joints.extend(one.joint),
            None => effects.push((name, one.joint.into_iter().collect())),
        }
    }
    if reasons.is_empty() {
        return page;
    }
    let lines = reasons.into_iter().map(|(why, effects)| {
        let effects = effects.into_iter().map(|(name, joints)| match joints.as_slice() {
            [] => name,
            [one] => format!("{name} of joint {one}"),
            many => {
                let joints: Vec<String> = many.iter().map(usize::to_string).collect();
                format!("{name} of joints {}", joints.join(", "))
            }
        });
        format!("{why}: {}.", effects.collect::<Vec<_>>().join("; "))
    });
    page.section("Not observable in this recording").list(lines)
}

fn data_section(page: Page, found: &RobotDiagnosis, report: &Report) -> Page {
    let mut page = page.section("Data processing");
    if !report.notes.is_empty() {
        page = page.list(&report.notes);
    }
    let recordings = found.diagnosis.as_ref().map_or(Vec::new(), |d| {
        let names = d.campaign.recordings.iter().map(|source| &source.name);
        names.map(|name| name.rsplit('/').next().unwrap_or(name).to_owned()).collect()
    });
    let mut facts = Vec::new();
    if !recordings.is_empty() {
        facts.push(("Recordings", recordings.join(", ")));
    }
    facts.extend([
        ("Rows with readings", found.rows.to_string()),
        ("Held out", report.heldout.clone()),
        ("Also estimated", "measuring frames and reflector positions".to_owned()),
        ("Seed", found.settings.seed.to_string()),
    ]);
    page.facts(facts)
}
