//! A diagnosis as lines of text.
//!
//! The most important findings come first; omitted ones are counted. All values are contained in the file.

use report::{capitalised, significant};

use super::{Alternative, Report, ReportedFinding};

/// Largest number of findings with a line of their own.
const LINES_MOST: usize = 12;
/// Fraction of the reduction of the squared held-out error that the findings in lines of their own account for.
const SHARE_IN_LINES: f64 = 0.9;

/// The findings, the remaining deviation, and the next step, line by line.
#[must_use]
pub fn lines(report: &Report) -> Vec<String> {
    let (first, also) = report.findings.split_at(leading_count(&report.findings));
    let mut lines: Vec<String> =
        first.iter().map(|reported| finding_line(report, reported)).collect();
    lines.extend(other_findings_line(report, first, also));
    lines.extend(minor_findings_line(report));
    if !report.candidates.is_empty() {
        let names = report.candidates.iter().map(|reported| match reported.confidence {
            Some(confidence) => format!("{} ({confidence:.2})", reported.name()),
            None => reported.name(),
        });
        let names = names.collect::<Vec<String>>().join(", ");
        lines.push(format!("  not reported as findings, with their probabilities: {names}"));
    }
    lines.extend(report.unexplained.as_ref().map(|rest| format!("  {}", rest.says)));
    let next =
        report.action.as_ref().map(|action| &action.says).or(report.next_experiment.as_ref());
    lines.extend(next.map(|next| format!("  next: {next}")));
    lines.extend(report.notes.iter().map(|note| format!("  {note}")));
    lines
}

/// Number of leading findings that account for [`SHARE_IN_LINES`] of the reduction.
fn leading_count(findings: &[ReportedFinding]) -> usize {
    let square = |rms: Option<f64>| rms.map_or(0.0, |rms| rms * rms);
    let before = findings.first().map_or(0.0, |one| square(one.heldout_rms_before));
    let after = findings.last().map_or(0.0, |one| square(one.heldout_rms_after));
    let wanted = before - SHARE_IN_LINES * (before - after);
    let enough = findings.iter().position(|one| square(one.heldout_rms_after) <= wanted);
    enough.map_or(findings.len(), |last| last + 1).min(LINES_MOST)
}

/// A finding with its values.
fn finding_line(report: &Report, reported: &ReportedFinding) -> String {
    let unit = report.unit;
    let indistinguishable = reported.alternatives.iter().filter(|other| other.is_indistinguishable);
    let rivals: Vec<String> = indistinguishable.map(Alternative::name).collect();
    let rivals = match rivals.as_slice() {
        [] => String::new(),
        rivals => format!(" (cannot be distinguished from {})", rivals.join(", ")),
    };
    let together =
        |other: &&ReportedFinding| reported.group.is_some() && other.group == reported.group;
    let others =
        report.all_findings().filter(together).filter(|other| !std::ptr::eq(*other, reported));
    let mut others: Vec<String> = others.map(ReportedFinding::name).collect();
    // Several effects of one kind and joint, such as transmission errors, have one name.
    others.sort_unstable();
    others.dedup();
    let together = match others.as_slice() {
        [] => String::new(),
        others => format!(" (determined only together with {})", others.join(", ")),
    };
    let confidence = reported.confidence.map(|p| format!("Confidence {p:.2}"));
    let size = reported.size.as_ref().map(|size| {
        let [rms, max] = [size.rms, size.max].map(|value| significant(value, 3));
        format!("{rms} {unit} (largest {max})")
    });
    let held = report.heldout_rms_after.zip(reported.heldout_rms_without).map(|(with, without)| {
        let [with, without] = [with, without].map(|rms| significant(rms, 3));
        format!("without it, the held-out error would be {without} {unit} instead of {with}")
    });
    let figures: Vec<String> = confidence.into_iter().chain(size).chain(held).collect();
    let figures = capitalised(&figures.join("; "));
    format!("  {} {figures}{rivals}{together}", reported.says).trim_end().to_owned()
}

/// The other findings in one line, with an upper bound of their sizes if they are all smaller than the first ones.
fn other_findings_line(
    report: &Report,
    first: &[ReportedFinding],
    also: &[ReportedFinding],
) -> Option<String> {
    let sizes = |all: &[ReportedFinding]| -> Vec<f64> {
        all.iter().filter_map(|reported| reported.size.as_ref()).map(|size| size.rms).collect()
    };
    let largest = sizes(also).into_iter().fold(0.0, f64::max);
    let smallest_told = sizes(first).into_iter().fold(f64::INFINITY, f64::min);
    let size = if 0.0 < largest && largest < smallest_told {
        format!(", each at most {} {}", significant(largest, 3), report.unit)
    } else {
        String::new()
    };
    (!also.is_empty()).then(|| format!("  also{size}: {}", grouped_by_effect(also)))
}

/// The claimed effects with the smallest sizes, with an upper bound.
fn minor_findings_line(report: &Report) -> Option<String> {
    let sizes =
        report.minor.iter().filter_map(|reported| reported.size.as_ref()).map(|size| size.rms);
    let largest = significant(sizes.fold(0.0, f64::max), 3);
    let (count, unit) = (report.minor.len(), report.unit);
    let effects = if count == 1 { "effect" } else { "effects" };
    (count > 0).then(|| {
        let names = grouped_by_effect(&report.minor);
        format!("  and {count} smaller {effects}, each at most {largest} {unit}: {names}")
    })
}

/// Each effect once, with its joints.
fn grouped_by_effect(all: &[ReportedFinding]) -> String {
    let mut effects: Vec<(&str, Vec<usize>)> = Vec::new();
    for reported in all {
        let known = effects.iter().position(|(effect, _)| *effect == reported.effect);
        let index = known.unwrap_or_else(|| {
            effects.push((reported.effect, Vec::new()));
            effects.len() - 1
        });
        effects[index].1.extend(reported.joint);
    }
    let joints = |joints: &mut Vec<usize>| {
        joints.sort_unstable();
        joints.dedup();
        let listed: Vec<String> = joints.iter().map(usize::to_string).collect();
        match listed.as_slice() {
            [] => String::new(),
            [one] => format!(" of joint {one}"),
            [others @ .., last] => format!(" of joints {} and {last}", others.join(", ")),
        }
    };
    let parts = effects
        .iter_mut()
        .map(|(effect, all)| format!("{}{}", effect.replace('_', " "), joints(all)));
    parts.collect::<Vec<String>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::super::{FindingLocation, Report, ReportedFinding, Size, partition_by_size};
    use super::{grouped_by_effect, lines};
    use std::collections::BTreeMap;

    fn reported(effect: &'static str, joint: Option<usize>, rms: f64) -> ReportedFinding {
        ReportedFinding {
            effect,
            joint,
            change: "new",
            confidence: Some(1.0),
            parameters: BTreeMap::new(),
            heldout_rms_before: Some(1.0),
            heldout_rms_after: Some(0.5),
            heldout_rms_without: Some(0.75),
            size: Some(Size { rms, max: 2.0 * rms }),
            group: None,
            location: FindingLocation {
                joint,
                channels: Vec::new(),
                condition: String::new(),
                intervals_s: Vec::new(),
                frequency_Hz: None,
            },
            alternatives: Vec::new(),
            says: format!("{effect} is missing."),
        }
    }

    /// This number of findings, with sizes of k times 1 µm, k from 1 in the order of the list.
    fn many(count: usize) -> Vec<ReportedFinding> {
        (1..=count).map(|k| reported("backlash", Some(k % 6 + 1), 1e-3 * k as f64)).collect()
    }

    #[test]
    fn twenty_findings_are_listed_the_largest_and_all_others_are_minor() {
        let (findings, minor) = partition_by_size(many(43), 20);
        assert_eq!((findings.len(), minor.len()), (20, 23));
        let size = |reported: &ReportedFinding| reported.size.as_ref().map_or(0.0, |size| size.rms);
        let smallest = findings.iter().map(size).fold(f64::INFINITY, f64::min);
        assert!(minor.iter().map(size).all(|size| size < smallest));
        let (findings, minor) = partition_by_size(many(20), 20);
        assert_eq!((findings.len(), minor.len()), (20, 0), "nothing is cut from twenty");
    }

    #[test]
    fn a_long_list_ends_with_how_many_are_smaller_and_how_small() {
        let (findings, minor) = partition_by_size(many(43), 20);
        let empty = Report::empty("position", "mm", 1);
        let report = Report { findings, minor, heldout_rms_after: Some(0.5), ..empty };
        let lines = lines(&report);
        let last = lines.last().expect("lines");
        assert!(
            last.starts_with(
                "  and 23 smaller effects, each at most 0.0230 mm: backlash of joints 1, 2"
            ),
            "{last}"
        );
        assert!(
            lines[0].contains("without it, the held-out error would be 0.750 mm instead of 0.500"),
            "{}",
            lines[0]
        );
    }

    #[test]
    fn an_effect_is_named_once_with_all_its_joints() {
        let all = [("axis_tilt", Some(3)), ("payload", None), ("axis_tilt", Some(1))];
        let all = all.map(|(effect, joint)| reported(effect, joint, 0.1));
        assert_eq!(grouped_by_effect(&all), "axis tilt of joints 1 and 3; payload");
        assert_eq!(grouped_by_effect(&all[..1]), "axis tilt of joint 3");
    }
}
