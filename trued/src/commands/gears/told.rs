//! Output of `trued gears`: tables and JSON.

use recording::model::RobotModel;
use report::{TextTable, fixed, significant};
use serde::Serialize;

use super::Gears;
use super::matching::{DRIFT_MAX, Fit, Matched};
use super::path::{Part, Travelled};
use super::trains::Train;
use crate::table::on_stdout;

/// Alternatives listed on the console for each line.
const RIVALS_TOLD: usize = 3;
/// A drift below this part is not mentioned.
const DRIFT_TOLD: f64 = 0.01;
/// Paths of more parts are listed part by part in the page and the JSON object only.
const PARTS_TOLD: usize = 16;
/// What the column of degrees is.
pub(super) const DEGREES: &str = "deg/mm is what the reference thesis' tables A III call cycles per mm; a shaft that is eccentric writes rev/mm, \
     teeth that meet write teeth/mm";

/// All results.
pub(super) struct Found<'a> {
    pub(super) model: &'a RobotModel,
    pub(super) travelled: Travelled,
    pub(super) trains: Vec<Train>,
    pub(super) lines: Vec<Matched>,
    pub(super) notes: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report<'a> {
    model: &'a str,
    tolerance_percent: f64,
    path: PathReport<'a>,
    wheels: Vec<WheelReport>,
    lines: Vec<LineReport<'a>>,
    notes: &'a [String],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PathReport<'a> {
    known_by: &'a str,
    length_mm: f64,
    parts: Vec<PartReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PartReport {
    segment: i64,
    from_mm: f64,
    to_mm: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct WheelReport {
    joint: u8,
    shaft: u8,
    /// `turn` or `mesh`.
    what: &'static str,
    /// Cycles per revolution of the shaft: 1, or the driver's teeth that mesh.
    teeth: u32,
    cycles_per_mm: Range,
    /// Per revolution of the joint, as in `transmission_error`.
    cycles_per_rev: f64,
    /// Of the shaft; the thesis calls this cycles per mm.
    degrees_per_mm: Option<f64>,
    /// From least to most, of the mean.
    drift_percent: f64,
    /// The wheel turns too unevenly to write a line: it is not matched.
    smeared: bool,
    parts: Vec<Range>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Range {
    mean: f64,
    least: f64,
    most: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct LineReport<'a> {
    source: &'a str,
    cycles_per_mm: f64,
    uncertainty_percent: f64,
    amplitude: Option<f64>,
    unit: Option<&'a str>,
    #[serde(rename = "match")]
    best: Option<FitReport>,
    rivals: Vec<FitReport>,
    /// Probability that a line near this one matches something by chance.
    by_chance: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct FitReport {
    joint: u8,
    shaft: u8,
    what: &'static str,
    teeth: u32,
    multiple: u32,
    cycles_per_mm: f64,
    distance_percent: f64,
    drift_percent: f64,
}

impl<'a> Report<'a> {
    pub(super) fn of(asked: &Gears, found: &'a Found<'_>) -> Self {
        let parts = found.travelled.parts.iter().map(|part| PartReport {
            segment: part.segment,
            from_mm: part.from_mm,
            to_mm: part.to_mm,
        });
        Self {
            model: &found.model.file.name,
            tolerance_percent: asked.tolerance,
            path: PathReport {
                known_by: &found.travelled.by,
                length_mm: found.travelled.length_mm,
                parts: parts.collect(),
            },
            wheels: found.trains.iter().flat_map(wheels).collect(),
            lines: found.lines.iter().map(line).collect(),
            notes: &found.notes,
        }
    }
}

fn what(teeth: u32) -> &'static str {
    if teeth == 1 { "turn" } else { "mesh" }
}

fn wheels(train: &Train) -> Vec<WheelReport> {
    let report = |wheel: &spectrum::Wheel| {
        let range = |[mean, least, most]: [f64; 3]| {
            let [mean, least, most] = [mean, least, most].map(|part| part * wheel.cycles_per_mm);
            Range { mean, least, most }
        };
        WheelReport {
            joint: wheel.joint,
            shaft: wheel.shaft,
            what: what(wheel.teeth),
            teeth: wheel.teeth,
            cycles_per_mm: range([1.0, train.range[0], train.range[1]]),
            cycles_per_rev: wheel.cycles_per_mm / train.turns_per_mm,
            degrees_per_mm: (wheel.teeth == 1).then_some(360.0 * wheel.cycles_per_mm),
            drift_percent: 100.0 * train.drift(),
            smeared: train.drift() > DRIFT_MAX,
            parts: train.parts.iter().map(|part| range(*part)).collect(),
        }
    };
    train.wheels.iter().map(report).collect()
}

fn line(matched: &Matched) -> LineReport<'_> {
    let fit = |fit: &Fit| FitReport {
        joint: fit.wheel.joint,
        shaft: fit.wheel.shaft,
        what: what(fit.wheel.teeth),
        teeth: fit.wheel.teeth,
        multiple: fit.multiple,
        cycles_per_mm: f64::from(fit.multiple) * fit.wheel.cycles_per_mm,
        distance_percent: 100.0 * fit.distance,
        drift_percent: 100.0 * fit.drift,
    };
    LineReport {
        source: &matched.line.source,
        cycles_per_mm: matched.line.cycles_per_mm,
        uncertainty_percent: 100.0 * matched.line.uncertainty,
        amplitude: matched.line.amplitude.as_ref().map(|(value, _)| *value),
        unit: matched.line.amplitude.as_ref().map(|(_, unit)| unit.as_str()),
        best: matched.fits.first().map(fit),
        rivals: matched.fits.iter().skip(1).map(fit).collect(),
        by_chance: matched.by_chance,
    }
}

/// A joint whose speed varies along the path, and where it varies most, in words.
fn drifts(train: &Train, travelled: &Travelled) -> Option<String> {
    let drift = train.drift();
    if drift < DRIFT_TOLD {
        return None;
    }
    let spread = |part: &[f64; 3]| part[2] - part[1];
    let parts = train.parts.iter().zip(&travelled.parts);
    let (_, most) = parts.max_by(|a, b| spread(a.0).total_cmp(&spread(b.0)))?;
    let end = if drift > DRIFT_MAX {
        "too uneven to write lines: not matched"
    } else {
        "its lines smear as much"
    };
    Some(format!(
        "joint {} drifts by {} % along the path, most from {}: {end}",
        train.joint,
        fixed(100.0 * drift, 0),
        place(most)
    ))
}

fn place(part: &Part) -> String {
    let [from, to] = [part.from_mm, part.to_mm].map(|mm| fixed(mm, 1));
    let segment =
        if part.segment == 0 { String::new() } else { format!(" of segment {}", part.segment) };
    format!("{from} to {to} mm{segment}")
}

/// The motor shafts part by part, heads first: mean, least and most revolutions per mm.
pub(super) fn by_parts(found: &Found<'_>) -> Vec<Vec<String>> {
    let heads = found.trains.iter().map(|train| format!("joint {}, rev/mm", train.joint));
    let mut rows = vec![["part".to_owned()].into_iter().chain(heads).collect::<Vec<_>>()];
    for (k, part) in found.travelled.parts.iter().enumerate() {
        let cells = found.trains.iter().filter_map(|train| {
            let motor = train.wheels.first()?.cycles_per_mm;
            let [mean, least, most] =
                train.parts.get(k)?.map(|value| significant(value * motor, 3));
            Some(format!("{mean} ({least} to {most})"))
        });
        rows.push([place(part)].into_iter().chain(cells).collect());
    }
    rows
}

/// A line with its matches, in words; the nearest `rivals` alternatives are named.
pub(super) fn fitting(matched: &Matched, rivals: usize) -> String {
    let Some(best) = matched.fits.first() else { return "fits no wheel".to_owned() };
    let others: Vec<String> = matched.fits.iter().skip(1).take(rivals).map(Fit::words).collect();
    let left = matched.fits.len().saturating_sub(1 + rivals);
    let more = if left > 0 { format!(" or {left} more") } else { String::new() };
    let others = others.iter().map(|words| format!(" or {words}")).collect::<String>();
    let chance = fixed(100.0 * matched.by_chance, 0);
    format!("{}{others}{more}; any line near it fits something with {chance} %", best.words())
}

/// Remarks beside the tables.
pub(super) fn remarks(found: &Found<'_>) -> Vec<String> {
    let drifting = found.trains.iter().filter_map(|train| drifts(train, &found.travelled));
    drifting.chain(found.notes.iter().cloned()).collect()
}

pub(super) fn told(found: &Found<'_>) -> String {
    let travelled = &found.travelled;
    let parts = travelled.parts.len();
    let mut text = format!(
        "path      {} mm: {}; {}\n",
        fixed(travelled.length_mm, 1),
        travelled.by,
        report::count(parts, "part")
    );
    let heads = ["joint", "shaft", "teeth", "rev/mm", "deg/mm", "teeth/mm", "drift %"];
    let mut table = TextTable::new(heads);
    for train in &found.trains {
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
    if found.trains.is_empty() {
        return text + "no joint with gear_teeth turns along this path\n";
    }
    text += &on_stdout(&table);
    text += &format!("{DEGREES}\n");
    text += &remarks(found).into_iter().map(|words| words + "\n").collect::<String>();
    if found.trains.iter().any(|train| train.drift() >= DRIFT_TOLD) && parts <= PARTS_TOLD {
        let mut rows = by_parts(found).into_iter();
        let table = TextTable::new(rows.next().unwrap_or_default());
        text += "\nshaft 1 of each joint: mean (least to most)\n";
        text += &on_stdout(&rows.fold(table, TextTable::row));
        text.push('\n');
    }
    for matched in &found.lines {
        let cycles = significant(matched.line.cycles_per_mm, 3);
        let words = fitting(matched, RIVALS_TOLD);
        text += &format!("line      {cycles}/mm ({}): {words}\n", matched.line.source);
    }
    text
}
