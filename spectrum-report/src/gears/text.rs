//! Gear shafts along a path as text.

use report::{TextTable, fixed, significant};

use super::analysis::Analysis;
use super::matching::{MatchedLine, MatchingGear};
use super::path::{PathPart, TravelledPath};
use super::trains::GearTrain;

/// Alternatives that are listed for each line.
const RIVALS_MAX: usize = 3;
/// A drift below this part is not mentioned.
const DRIFT_LEAST: f64 = 0.01;
/// Paths of more parts are listed part by part in the page and the object only.
const PARTS_MAX: usize = 16;
/// The meaning of the column of degrees.
pub(super) const DEGREES: &str = "deg/mm is what the reference thesis' tables A III call cycles per mm; a shaft that is eccentric writes rev/mm, \
     teeth that meet write teeth/mm";

/// A joint whose speed varies along the path, and where it varies most, as text.
fn drifts(train: &GearTrain, travelled: &TravelledPath, drift_max: f64) -> Option<String> {
    let drift = train.drift();
    if drift < DRIFT_LEAST {
        return None;
    }
    let spread = |part: &[f64; 3]| part[2] - part[1];
    let parts = train.parts.iter().zip(&travelled.parts);
    let (_, most) = parts.max_by(|a, b| spread(a.0).total_cmp(&spread(b.0)))?;
    let end = if drift > drift_max {
        "too uneven to cause lines: not matched"
    } else {
        "its lines are broadened as much"
    };
    Some(format!(
        "joint {} drifts by {} % along the path, most from {}: {end}",
        train.joint,
        fixed(100.0 * drift, 0),
        place(most)
    ))
}

fn place(part: &PathPart) -> String {
    let [from, to] = [part.from_mm, part.to_mm].map(|mm| fixed(mm, 1));
    let segment =
        if part.segment == 0 { String::new() } else { format!(" of segment {}", part.segment) };
    format!("{from} to {to} mm{segment}")
}

/// The motor shafts part by part, heads first: mean, least and most revolutions per mm.
pub(super) fn by_parts(analysis: &Analysis) -> Vec<Vec<String>> {
    let heads = analysis.trains.iter().map(|train| format!("joint {}, rev/mm", train.joint));
    let mut rows = vec![["part".to_owned()].into_iter().chain(heads).collect::<Vec<_>>()];
    for (k, part) in analysis.travelled.parts.iter().enumerate() {
        let cells = analysis.trains.iter().filter_map(|train| {
            let motor = train.wheels.first()?.cycles_per_mm;
            let [mean, min, max] = train.parts.get(k)?.map(|value| significant(value * motor, 3));
            Some(format!("{mean} ({min} to {max})"))
        });
        rows.push([place(part)].into_iter().chain(cells).collect());
    }
    rows
}

/// A line with its matches, as text; the nearest `rivals` alternatives are named.
pub(super) fn fitting(matched: &MatchedLine, rivals: usize) -> String {
    let Some(best) = matched.fits.first() else { return "matches no wheel".to_owned() };
    let others: Vec<String> =
        matched.fits.iter().skip(1).take(rivals).map(MatchingGear::text).collect();
    let left = matched.fits.len().saturating_sub(1 + rivals);
    let more = if left > 0 { format!(" or {left} more") } else { String::new() };
    let others = others.iter().map(|other| format!(" or {other}")).collect::<String>();
    let chance = fixed(100.0 * matched.by_chance, 0);
    format!("{}{others}{more}; a random line near it would match with {chance} %", best.text())
}

/// Remarks beside the tables.
pub(super) fn remarks(analysis: &Analysis) -> Vec<String> {
    let drifting = analysis
        .trains
        .iter()
        .filter_map(|train| drifts(train, &analysis.travelled, analysis.settings.drift_max));
    drifting.chain(analysis.notes.iter().cloned()).collect()
}

impl Analysis {
    /// The result as text; its tables are at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> String {
        let travelled = &self.travelled;
        let parts = travelled.parts.len();
        let mut text = format!(
            "path      {} mm: {}; {}\n",
            fixed(travelled.length_mm, 1),
            travelled.by,
            report::pluralise(parts, "part")
        );
        if self.trains.is_empty() {
            return text + "no joint with gear_teeth turns along this path\n";
        }
        text += &shafts(self).render(width_max);
        text += &format!("{DEGREES}\n");
        text += &remarks(self).into_iter().map(|remark| remark + "\n").collect::<String>();
        if self.trains.iter().any(|train| train.drift() >= DRIFT_LEAST) && parts <= PARTS_MAX {
            let mut rows = by_parts(self).into_iter();
            let table = TextTable::new(rows.next().unwrap_or_default());
            text += "\nshaft 1 of each joint: mean (minimum to maximum)\n";
            text += &rows.fold(table, TextTable::row).render(width_max);
            text.push('\n');
        }
        for matched in &self.lines {
            let cycles = significant(matched.line.cycles_per_mm, 3);
            let fits = fitting(matched, RIVALS_MAX);
            text += &format!("line      {cycles}/mm ({}): {fits}\n", matched.line.source);
        }
        text
    }
}

fn shafts(analysis: &Analysis) -> TextTable {
    let heads = ["joint", "shaft", "teeth", "rev/mm", "deg/mm", "teeth/mm", "drift %"];
    let mut table = TextTable::new(heads);
    for train in &analysis.trains {
        for ((turn, mesh), [driver, driven]) in train.shafts().zip(&train.stages) {
            table = table.row([
                train.joint.to_string(),
                turn.shaft.to_string(),
                format!("{driver}:{driven}"),
                significant(turn.cycles_per_mm, 4),
                significant(360.0 * turn.cycles_per_mm, 3),
                significant(mesh.cycles_per_mm, 4),
                fixed(100.0 * train.drift(), 1),
            ]);
        }
    }
    table
}
