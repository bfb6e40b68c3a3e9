//! The document: a summary table, then a section for each set.
//!
//! Every sentence about a run is generated from it.

use std::fmt::Write as _;

use report::significant;

use super::case::Case;
use super::sets::Set;

const HEAD: &str = "\
# Evidence

Made by `cargo xtask evidence`; never edited by hand. Real recordings of machines, each with the effect in question concealed from the program: what it was given, what it said, and the
error on rows that no choice and no fit has seen. `trued diagnose` and its kin run as their users run them; every statement about a run is made of its files by rule. The recordings are not
part of this tree: their sources stand in each section and in [deploy/mappings](../deploy/mappings). Files in the commands are those of the set, or made of them by the task; both stand under `target/evidence/SET` after a run.

";

/// A set with its results.
pub(super) struct Section {
    pub(super) set: &'static Set,
    /// Missing files; then nothing was run.
    pub(super) missing: Vec<String>,
    pub(super) cases: Vec<Case>,
    /// Of the plot, where there is one.
    pub(super) caption: Option<String>,
}

/// The whole document.
pub(super) fn render(sections: &[Section]) -> String {
    let mut text = HEAD.to_owned();
    table(&mut text, sections);
    for section in sections {
        write_section(&mut text, section);
    }
    text
}

fn table(text: &mut String, sections: &[Section]) {
    line(text, "| set | concealed | said | held out, before → after | reference | bars |");
    line(text, "| --- | --- | --- | --- | --- | --- |");
    for section in sections {
        let name = section.set.name;
        if let Some(why) = absent(section) {
            line(text, &format!("| [{name}](#{name}) | {why} | | | | |"));
        }
        for case in &section.cases {
            let cells = [
                format!("[{name}](#{name}): {}", case.name),
                case.concealed.clone(),
                case.short.clone(),
                errors(case),
                case.reference.as_ref().map_or(String::new(), |one| one.says.to_owned()),
                bars(case),
            ];
            line(text, &format!("| {} |", cells.map(|cell| cell.replace('|', "/")).join(" | ")));
        }
    }
    line(text, "");
}

/// Why a set has no case.
fn absent(section: &Section) -> Option<String> {
    if let Some(why) = section.set.cannot {
        return Some(format!("not run: {why}"));
    }
    (!section.missing.is_empty()).then(|| format!("absent: {}", section.missing.join(", ")))
}

fn errors(case: &Case) -> String {
    case.errors.as_ref().map_or(String::new(), |errors| {
        let [before, after] = [errors.before, errors.after].map(|x| significant(x, 3));
        format!("{before} → {after} {}", errors.unit)
    })
}

fn bars(case: &Case) -> String {
    let missed = case.judged.iter().filter(|one| !one.met).count();
    match (case.was_run, case.judged.len(), missed) {
        (false, ..) => "not run".to_owned(),
        (_, 0, _) if case.rows.is_empty() && case.said.is_empty() => "no answer".to_owned(),
        (_, 0, _) => "no bar".to_owned(),
        (_, all, 0) => format!("met ({all})"),
        (_, all, missed) => format!("**{missed} of {all} missed**"),
    }
}

fn write_section(text: &mut String, section: &Section) {
    let set = section.set;
    line(text, &format!("## {}\n", set.name));
    line(text, &format!("{} Source: {}.\n", set.what, set.source));
    if let Some(why) = absent(section) {
        line(text, &format!("{}.\n", super::case::sentence(&why).trim_end_matches('.')));
        return;
    }
    line(text, &format!("What the program was given: {}\n", set.given));
    if let Some(caption) = &section.caption {
        let caption = super::case::sentence(caption);
        line(text, &format!("![{caption}](evidence/{}.svg)\n\n{caption}\n", set.name));
    }
    for case in &section.cases {
        write_case(text, case);
    }
}

fn write_case(text: &mut String, case: &Case) {
    line(text, &format!("### {}\n", case.name));
    line(text, &format!("Concealed: {}. `{}`\n", case.concealed, case.command));
    line(text, &format!("Said: **{}**.\n", case.verdict));
    for said in &case.said {
        line(text, &format!("- {said}"));
    }
    if !case.said.is_empty() {
        line(text, "");
    }
    if !case.rows.is_empty() {
        line(text, "| named | how much (95 %) | held out |\n| --- | --- | --- |");
        for [name, numbers, held] in &case.rows {
            line(text, &format!("| {name} | {numbers} | {held} |"));
        }
        if case.more_rows > 0 {
            line(text, &format!("| and {} more | | |", case.more_rows));
        }
        line(text, "");
    }
    if let Some(errors) = &case.errors {
        let [before, after] = [errors.before, errors.after].map(|x| significant(x, 3));
        let reference = case
            .reference
            .as_ref()
            .map_or(String::new(), |one| format!(" Reference: {}.", one.says));
        let unit = errors.unit;
        line(
            text,
            &format!(
                "{}: {before} {unit} before, {after} {unit} after.{reference}\n",
                super::case::sentence(errors.of).trim_end_matches('.')
            ),
        );
    }
    if !case.judged.is_empty() {
        line(text, "| asked | measured | bar | |\n| --- | --- | --- | --- |");
        for one in &case.judged {
            let met = if one.met { "met" } else { "**missed**" };
            line(text, &format!("| {} | {} | {} | {met} |", one.what, one.measured, one.bar));
        }
        line(text, "");
    }
    let shortfalls = case.shortfalls();
    if !shortfalls.is_empty() {
        line(text, "Where it falls short, or is silent:\n");
        for one in shortfalls {
            line(text, &format!("- {one}"));
        }
        line(text, "");
    }
}

fn line(text: &mut String, line: &str) {
    let _ = writeln!(text, "{line}");
}
