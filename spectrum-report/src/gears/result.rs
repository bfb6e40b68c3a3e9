//! Gear shafts along a path as an object: `trued.gears/1`.

use recording::program;
use serde::Serialize;

use super::analysis::Analysis;
use super::matching::{MatchedLine, MatchingGear};
use super::trains::GearTrain;
use crate::error::Error;

/// Gear shafts and meshes along a path: `trued.gears/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report<'a> {
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
    /// The wheel turns too unevenly to produce a line: it is not matched.
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
    /// Probability that a random line near this one matches a wheel.
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

impl Analysis {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> Report<'_> {
        Report::of(self)
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        let text = program::json("trued.gears/1", &self.report()).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

impl<'a> Report<'a> {
    fn of(analysis: &'a Analysis) -> Self {
        let drift_max = analysis.settings.drift_max;
        let parts = analysis.travelled.parts.iter().map(|part| PartReport {
            segment: part.segment,
            from_mm: part.from_mm,
            to_mm: part.to_mm,
        });
        Self {
            model: &analysis.model.file.name,
            tolerance_percent: analysis.settings.tolerance_percent,
            path: PathReport {
                known_by: &analysis.travelled.by,
                length_mm: analysis.travelled.length_mm,
                parts: parts.collect(),
            },
            wheels: analysis.trains.iter().flat_map(|train| wheels(train, drift_max)).collect(),
            lines: analysis.lines.iter().map(line).collect(),
            notes: &analysis.notes,
        }
    }
}

fn what(teeth: u32) -> &'static str {
    if teeth == 1 { "turn" } else { "mesh" }
}

fn wheels(train: &GearTrain, drift_max: f64) -> Vec<WheelReport> {
    let report = |wheel: &spectrum::GearFrequency| {
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
            smeared: train.drift() > drift_max,
            parts: train.parts.iter().map(|part| range(*part)).collect(),
        }
    };
    train.wheels.iter().map(report).collect()
}

fn line(matched: &MatchedLine) -> LineReport<'_> {
    let fit = |fit: &MatchingGear| FitReport {
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
