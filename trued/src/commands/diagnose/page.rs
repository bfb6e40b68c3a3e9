//! The page of `trued diagnose`: what was found in words first, then the proof, where it shows, the rivals, what is open, what was done with the data.
//!
//! Promises: a reader who stops anywhere has read the most important of what there is. Never: a number that is not in `diagnosis.json` or its figures.

mod cut;
mod drives;
mod figures;
pub(super) mod forces;
mod tables;

use report::{Number, Page, Tone, significant};

use super::Found;
use super::told::{Report, lead};
use crate::output::made_by;

/// The whole page: positions first, then torques.
pub(super) fn render(found: &Found, reports: &[Report]) -> String {
    let verdicts: Vec<String> =
        reports.iter().map(|report| report.verdict.replace('_', " ")).collect();
    let mut page = Page::new(format!("Diagnosis of {}", found.base.file.name))
        .kicker(format!("trued diagnose: {}", verdicts.join("; ")));
    for report in reports {
        page = match found.torques().filter(|_| report.domain() == "torque") {
            Some(torques) => drives::domain(page, found, torques, report),
            None => domain(page, found, report),
        };
    }
    page.footer(made_by("diagnose")).render()
}

/// All of one domain, but its own figures.
fn words(mut page: Page, report: &Report, is_judged: bool) -> Page {
    page = if is_judged {
        page.lead(&sentence(report)).numbers(numbers(report))
    } else {
        let lead = page.lead("These recordings cannot be judged with this model.");
        lead.note(Tone::Bad, "Why", &self::lead(report))
    };
    let sentences: Vec<&str> = report.findings.iter().map(|told| told.says.as_str()).collect();
    if !sentences.is_empty() {
        page = page.section("What was found").list(&sentences).table(&tables::findings(report));
    }
    if !report.candidates.is_empty() {
        let title = "Not claimed: less likely than not";
        page = page.section(title).table(&tables::candidates(report));
    }
    if is_judged && let Some(rest) = &report.unexplained {
        page = page.note(Tone::Caution, "Not explained", &rest.says);
    }
    if let Some(next) = &report.next_experiment {
        page = page.note(Tone::Caution, "What would settle it", next);
    }
    page
}

/// The rivals, the numbers, and what is open.
fn rest(mut page: Page, report: &Report) -> Page {
    page = rivals(page, report);
    if !report.findings.is_empty() {
        page = page.section("The numbers").table(&tables::parameters(report)).text(
            "Parameters carry the units of the model file. The interval holds the true value 95 times in 100, half a percent of the number included for what \
             scale and geometry leave open.",
        );
    }
    open(page, report)
}

fn domain(page: Page, found: &Found, report: &Report) -> Page {
    let mut page = words(page, report, found.diagnosis.is_some());
    if let Some(diagnosis) = &found.diagnosis {
        page = figures::proof(page, diagnosis, report);
        page = figures::places(page, diagnosis, report);
        page = figures::guilty(page, diagnosis, report);
    }
    made_from(rest(page, report), found, report)
}

fn sentence(report: &Report) -> String {
    let [before, after] = [report.heldout_rms_before, report.heldout_rms_after]
        .map(|rms| rms.map_or("?".to_owned(), |rms| significant(rms, 2)));
    let noise = significant(report.noise_rms, 2);
    let unit = report.unit;
    match (report.verdict, report.findings.len()) {
        ("consistent", _) => {
            format!("Model and recording agree: nothing stands above the noise of {noise} {unit}.")
        }
        ("undetermined", _) => format!(
            "The model is off by {before} {unit} and the noise is {noise} {unit}, but this recording cannot tell which of several causes is the right one."
        ),
        ("unknown_structure", 0) => format!(
            "The model is off by {before} {unit} where the noise is {noise} {unit}, and no known effect explains it."
        ),
        ("unknown_structure", count) => format!(
            "The model is off by {before} {unit}. {} bring{} it to {after} {unit}; what is left follows a law that no known effect explains.",
            effects(count),
            if count == 1 { "s" } else { "" }
        ),
        (_, count) => format!(
            "{} explain{} what the model lacks: on rows that no fit has seen it was off by {before} {unit} and is off by {after} {unit} now; the noise is {noise} {unit}.",
            effects(count),
            if count == 1 { "s" } else { "" }
        ),
    }
}

fn effects(count: usize) -> String {
    if count == 1 { "One effect".to_owned() } else { format!("{count} effects together") }
}

fn numbers(report: &Report) -> Vec<Number> {
    let rms = "root mean square, held out";
    let held = report.heldout_rms_before.zip(report.heldout_rms_after).map(|(before, after)| {
        let tone = if after < before { Tone::Good } else { Tone::Plain };
        [
            Number::new("Model as given", before, report.unit).note(rms),
            Number::new("With what was found", after, report.unit).tone(tone).note(rms),
        ]
    });
    let noise = Number::new("Noise", report.noise_rms, report.unit)
        .note("what no finding explains, on the rows that were fitted");
    let findings = Number::text("Findings", report.findings.len().to_string());
    held.into_iter().flatten().chain([noise, findings]).collect()
}

/// Findings that another name explains as well or nearly.
fn rivals(page: Page, report: &Report) -> Page {
    if report.findings.iter().all(|told| told.alternatives.is_empty()) {
        return page;
    }
    page.section("Rivals")
        .text("What else might explain a finding, with the probability of each name by this recording alone.")
        .figure("Probability of each name.", &figures::rivals(report))
}

/// An effect, and joints from 1; none for the whole robot.
type OfJoints = (String, Vec<usize>);

/// What could not have shown, together where the reason is one.
fn open(page: Page, report: &Report) -> Page {
    let mut reasons: Vec<(&str, Vec<OfJoints>)> = Vec::new();
    for one in &report.not_tested {
        let at = reasons.iter().position(|(why, _)| *why == one.why).unwrap_or_else(|| {
            reasons.push((&one.why, Vec::new()));
            reasons.len() - 1
        });
        let (name, effects) = (one.effect.replace('_', " "), &mut reasons[at].1);
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
    page.section("What this recording could not show").list(lines)
}

fn made_from(page: Page, found: &Found, report: &Report) -> Page {
    let mut page = page.section("What was done with the data");
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
        ("Fitted along", "measuring frames and places of reflectors".to_owned()),
        ("Seed", found.seed.to_string()),
    ]);
    page.facts(facts)
}
