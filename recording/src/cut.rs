//! The file of a cut for stability prediction, `trued.cut/1`: the modes at the tool tip, the cutter, the feed.
//!
//! Format: docs/stability.md. A valid [`CutFile`] has every number in range, in SI; all errors of a
//! file are reported. The modes of a referenced tap test stay in that file.

use std::ops::Bound;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::faults::Faults;
use crate::files::{FileError, read_text};
use crate::series::{Cut, read_cut};
use crate::toml_reader::{Document, Table};

/// Name of the format.
pub const SCHEMA: &str = "trued.cut/1";

/// Least and largest spindle speed, rev/min.
const SPINDLE_RPM: (Bound<f64>, Bound<f64>) = (Bound::Included(1.0), Bound::Included(1e6));
/// Largest depth of cut, and of the chart, mm.
const DEPTH_MAX_MM: f64 = 1000.0;
/// Largest cutting coefficient, N/mm². Chosen: those of metals are some thousand at most, and one in N/m² instead is far above.
const COEFFICIENT_MAX_N_PER_MM2: f64 = 1e5;
/// Least sine of the angle between feed and up; the same as in the equations.
const ACROSS_LEAST: f64 = 1e-6;
/// Default range of speeds in the chart, relative to the present one.
const CHART: [f64; 2] = [0.5, 1.5];
/// Default of the largest depth evaluated, as a multiple of the present one.
const DEEPEST: f64 = 10.0;

/// A cut and the dynamics of the structure.
#[derive(Debug, Clone, PartialEq)]
pub struct CutFile {
    /// Direction of the feed, in the frame of the modes' directions; any length but 0.
    pub feed: [f64; 3],
    /// Direction out of the workpiece, opposite to the tool's z axis; any length but 0.
    pub up: [f64; 3],
    /// Spindle speed, rev/min.
    pub spindle_rpm: f64,
    /// Cutter, engagement, depth, coefficients.
    pub cut: Cut,
    /// Modes stated in the file.
    pub modes: Vec<CutMode>,
    /// Results of `trued tap` with further modes; relative paths refer to the file's folder.
    pub taps: Vec<PathBuf>,
    /// A proposed depth of cut stays below the stability limit by this share.
    pub margin: f64,
    /// What the chart shows.
    pub chart: ChartRange,
}

/// A mode at the tool tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutMode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Damping ratio, above 0 and below 1.
    pub damping_ratio: f64,
    /// Modal stiffness along the direction, N/m.
    pub stiffness_n_per_m: f64,
    /// Direction of the tip's motion; any length but 0.
    pub direction: [f64; 3],
}

/// `[chart]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartRange {
    /// Lowest and highest spindle speed, rev/min.
    pub spindle_rpm: [f64; 2],
    /// Largest depth evaluated, m.
    pub depth_max_m: f64,
    /// Spindle speeds of the chart.
    pub points: usize,
}

impl CutFile {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Ok(Self::parse(&path.display().to_string(), &read_text(path)?)?)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        let document = Document::parse(name, text)?;
        let file = cut_file(&document.root());
        document.finish(file)
    }
}

fn cut_file(root: &Table<'_, '_>) -> Option<CutFile> {
    root.require("schema", "schema = \"trued.cut/1\"");
    root.require("spindle_rpm", "the spindle speed, rev/min");
    root.require("cut", "a table [cut], as in the TOML of a recording");
    root.choice("schema", &[(SCHEMA, ())]);
    let feed = direction(root, "feed", [1.0, 0.0, 0.0]);
    let up = direction(root, "up", [0.0, 0.0, 1.0]);
    if let Some((feed, up)) = feed.zip(up) {
        // By the largest component first: the square of 1e200 is infinite.
        let unit = |vector| {
            let vector = DVec3::from(vector);
            (vector / vector.abs().max_element()).normalize()
        };
        let across = unit(feed).cross(unit(up));
        if across.length() < ACROSS_LEAST {
            root.fault("feed", "is parallel to up", "a direction across `up` (0, 0, 1 by default)");
        }
    }
    let spindle_rpm = root.number("spindle_rpm", SPINDLE_RPM);
    let margin = root.number("margin", 0.0..=1.0).unwrap_or(0.1);
    let taps = root.texts("taps").unwrap_or_default();
    let cut = root.table("cut").map(|table| read_cut(&table).filter(|cut| is_usable(&table, cut)));
    let modes: Vec<Option<CutMode>> = root.tables("mode").iter().map(mode).collect();
    if modes.is_empty() && taps.is_empty() {
        root.fault("mode", "no mode is given", "tables headed [[mode]], or taps = [\"tap.json\"]");
    }
    let depth_m = cut.as_ref().and_then(|cut| Some(cut.as_ref()?.axial_depth_m));
    let chart = chart(root.table("chart").as_ref(), spindle_rpm, depth_m);
    root.close();
    Some(CutFile {
        feed: feed?,
        up: up?,
        spindle_rpm: spindle_rpm?,
        cut: cut??,
        modes: modes.into_iter().collect::<Option<_>>()?,
        taps: taps.into_iter().map(PathBuf::from).collect(),
        margin,
        chart: chart?,
    })
}

/// Whether depth and coefficients of a cut are in the range of the prediction; in the TOML of a recording they may be any.
fn is_usable(table: &Table<'_, '_>, cut: &Cut) -> bool {
    let is_shallow = cut.axial_depth_m <= 1e-3 * DEPTH_MAX_MM;
    if !is_shallow {
        // Not a range of the schema, since the TOML of a recording may state any depth.
        let found = format!("is {} m deep, out of the range of the prediction", cut.axial_depth_m);
        table.fault("axial_depth_mm", found, format!("at most {DEPTH_MAX_MM} mm"));
    }
    let coefficients = cut.cutting_pa.map(|pascal| pascal / 1e6);
    let [tangential, ..] = coefficients;
    let is_cutting =
        tangential > 0.0 && coefficients.iter().all(|k| k.abs() <= COEFFICIENT_MAX_N_PER_MM2);
    if !is_cutting {
        let found = format!("is {coefficients:?} N/mm²");
        let expected = format!(
            "tangential, radial, axial: the tangential one above 0, all within {COEFFICIENT_MAX_N_PER_MM2} N/mm²"
        );
        table.fault("coefficients_N_per_mm2", found, expected);
    }
    is_shallow && is_cutting
}

fn direction(table: &Table<'_, '_>, key: &str, default: [f64; 3]) -> Option<[f64; 3]> {
    if !table.has(key) {
        return Some(default);
    }
    let vector = table.vector::<3>(key)?;
    if vector.iter().all(|x| *x == 0.0) {
        table.fault(key, "is zero", "a direction: three numbers, not all 0");
        return None;
    }
    Some(vector)
}

fn mode(table: &Table<'_, '_>) -> Option<CutMode> {
    let numbers = ["frequency_Hz", "damping_ratio", "stiffness_N_per_um"];
    for key in numbers {
        table.require(key, "a number above zero");
    }
    table.require("direction", "three numbers: mode shape at the tool tip");
    let frequency_hz = table.number("frequency_Hz", 0.1..=1e5);
    let damping_ratio = table.number("damping_ratio", 1e-5..=0.99);
    let stiffness = table.number("stiffness_N_per_um", 1e-6..=1e6);
    let direction = direction(table, "direction", [0.0; 3]);
    table.close();
    Some(CutMode {
        frequency_hz: frequency_hz?,
        damping_ratio: damping_ratio?,
        stiffness_n_per_m: stiffness? * 1e6,
        direction: direction?,
    })
}

/// The chart's range; missing values follow from the present cut, if that was read.
fn chart(
    table: Option<&Table<'_, '_>>,
    spindle_rpm: Option<f64>,
    depth_m: Option<f64>,
) -> Option<ChartRange> {
    let number = |key: &str, range| table.and_then(|table| table.number(key, range));
    let from = number("spindle_from_rpm", SPINDLE_RPM).or(spindle_rpm.map(|rpm| CHART[0] * rpm));
    let to = number("spindle_to_rpm", SPINDLE_RPM).or(spindle_rpm.map(|rpm| CHART[1] * rpm));
    let depth = (Bound::Excluded(0.0), Bound::Included(DEPTH_MAX_MM));
    let depth_max_m =
        number("depth_max_mm", depth).map(|mm| 1e-3 * mm).or(depth_m.map(|m| DEEPEST * m));
    let points = table.and_then(|table| table.whole("points", 2..2001)).unwrap_or(200);
    if let Some(table) = table {
        if let (Some(from), Some(to)) = (from, to)
            && from >= to
        {
            table.fault("spindle_to_rpm", format!("is {to}"), format!("more than {from}"));
        }
        if let Some(depth) = depth_max_m.filter(|max| depth_m.is_some_and(|depth| *max <= depth)) {
            let found = format!("is {} mm", 1e3 * depth);
            table.fault("depth_max_mm", found, "larger than the axial depth of cut");
        }
        table.close();
    }
    Some(ChartRange {
        spindle_rpm: [from?, to?],
        depth_max_m: depth_max_m?,
        points: usize::try_from(points).ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORT: &str = r#"
schema = "trued.cut/1"
spindle_rpm = 12000
[cut]
teeth = 2
diameter_mm = 6.0
axial_depth_mm = 0.5
coefficients_N_per_mm2 = [800.0, 300.0, 150.0]
coefficients_N_per_mm = [0, 0, 0]
[[mode]]
frequency_Hz = 700.0
damping_ratio = 0.02
stiffness_N_per_um = 5.0
direction = [0.0, 2.0, 0.0]
"#;

    #[test]
    fn what_is_not_given_follows_from_the_present_cut() {
        let file = CutFile::parse("cut.toml", SHORT).unwrap();
        assert_eq!((file.feed, file.up, file.margin), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.1));
        assert_eq!(file.chart.spindle_rpm, [6000.0, 18_000.0]);
        assert!((file.chart.depth_max_m - 5e-3).abs() < 1e-12 && file.chart.points == 200);
        let [mode] = file.modes.as_slice() else { panic!("{:?}", file.modes) };
        assert!((mode.stiffness_n_per_m - 5e6).abs() < 1e-6 && mode.direction == [0.0, 2.0, 0.0]);
    }

    #[test]
    fn every_fault_is_reported_at_once() {
        let text = SHORT.replace("12000", "0").replace("[0.0, 2.0, 0.0]", "[0, 0, 0]")
            + "stiffness_N_per_mm = 2\n[chart]\nspindle_from_rpm = 9e3\nspindle_to_rpm = 8e3\ndepth_max_mm = 0.1\n";
        let faults = CutFile::parse("cut.toml", &text).unwrap_err();
        for message in ["`spindle_rpm`: is 0", "`mode[1].direction`: is zero", "stiffness_N_per_mm"]
        {
            faults.assert_say(message);
        }
        faults.assert_say("`chart.spindle_to_rpm`: is 8000");
        faults.assert_say("`chart.depth_max_mm`: is 0.1 mm");
    }

    #[test]
    fn a_cut_that_cannot_be_is_refused_in_the_units_of_the_file() {
        for (from, to, words) in [
            (
                "[800.0, 300.0, 150.0]",
                "[-800.0, 300.0, 150.0]",
                "`cut.coefficients_N_per_mm2`: is [-800.0",
            ),
            ("[800.0, 300.0, 150.0]", "[0, 0, 0]", "`cut.coefficients_N_per_mm2`: is [0.0"),
            ("[800.0, 300.0, 150.0]", "[800.0, 1e9, 150.0]", "`cut.coefficients_N_per_mm2`"),
            (
                "axial_depth_mm = 0.5",
                "axial_depth_mm = 1e6",
                "`cut.axial_depth_mm`: is 1000 m deep, out of the range of the prediction",
            ),
            (
                "teeth = 2",
                "teeth = 2\nentry_deg = -200.0\nexit_deg = 180.0",
                "`cut.exit_deg`: is 180, 380° after",
            ),
        ] {
            CutFile::parse("cut.toml", &SHORT.replace(from, to)).unwrap_err().assert_say(words);
        }
        let whole = SHORT.replace("teeth = 2", "teeth = 2\nentry_deg = -180.0\nexit_deg = 180.0");
        CutFile::parse("cut.toml", &whole).unwrap();
    }

    #[test]
    fn a_feed_along_the_spindle_is_refused() {
        let far = SHORT.replace("[cut]", "feed = [1e200, 0.0, 0.0]\n[cut]");
        CutFile::parse("cut.toml", &far).unwrap();
        let text = SHORT.replace("[cut]", "feed = [0.0, 0.0, 2.0]\n[cut]");
        CutFile::parse("cut.toml", &text).unwrap_err().assert_say("is parallel to up");
    }

    #[test]
    fn a_cut_without_any_mode_is_refused() {
        let text = SHORT.split("[[mode]]").next().unwrap();
        CutFile::parse("cut.toml", text).unwrap_err().assert_say("no mode is given");
        let named = text.replace("[cut]", "taps = [\"x.json\"]\n[cut]");
        assert_eq!(CutFile::parse("cut.toml", &named).unwrap().taps, [PathBuf::from("x.json")]);
    }
}
