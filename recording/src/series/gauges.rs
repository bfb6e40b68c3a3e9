//! Distances and touches: their tables in the TOML of a recording.
//!
//! `[distance1]` … describe the fixed end of a ballbar, cable or draw-wire; `[probe]`, `[plane1]` …, `[sphere1]` … the probe and the touched objects. Parameters that are not stated are
//! fitted. Lengths in mm, base frame, tool points by the number of their target. See docs/measurements.md.
//!
//! All errors are reported.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use toml::de::DeValue;

use super::channel::{GAUGES_MAX, TARGETS_MAX};
use crate::toml_reader::{POSITIVE, Table};
use crate::toml_text::{line, list, number, string};

const MM: f64 = 1e-3;

/// Reference and measured point of a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Distance {
    /// The fixed point, m, base frame; `None` if it is to be fitted.
    pub anchor_m: Option<[f64; 3]>,
    /// The target on the tool (from 0); `None` for the TCP.
    pub target: Option<usize>,
    /// Reading minus distance, m; `None` if it is to be fitted.
    pub offset_m: Option<f64>,
}

impl Default for Distance {
    fn default() -> Self {
        Self { anchor_m: None, target: None, offset_m: Some(0.0) }
    }
}

/// The touch probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// Radius of its ball, m.
    pub radius_m: f64,
    /// The target at the ball's centre (from 0); `None` for the TCP.
    pub target: Option<usize>,
    /// Standard uncertainty of a touch, m.
    pub sigma_m: Option<f64>,
}

/// A touched plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TouchedPlane {
    /// Normal towards the touched side, base frame; approximate if the plane is to be fitted.
    pub normal: [f64; 3],
    /// Along the normal from the base frame's origin, m; `None` if the plane is to be fitted.
    pub offset_m: Option<f64>,
}

/// A touched sphere.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TouchedSphere {
    /// Centre in the base frame, m; `None` if it is to be fitted.
    pub centre_m: Option<[f64; 3]>,
    /// Radius, m; `None` if it is to be fitted.
    pub radius_m: Option<f64>,
}

/// Distances, probe and touched surfaces, by number from 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gauges {
    /// References of the distances.
    pub distances: BTreeMap<usize, Distance>,
    /// The touch probe.
    pub probe: Option<Probe>,
    /// The touched planes.
    pub planes: BTreeMap<usize, TouchedPlane>,
    /// The touched spheres.
    pub spheres: BTreeMap<usize, TouchedSphere>,
}

impl Gauges {
    pub(super) fn of(table: &Table<'_, '_>) -> Self {
        Self {
            distances: numbered(table, "distance", |table| Some(distance_of(table))),
            probe: table
                .has("probe")
                .then(|| table.table("probe"))
                .flatten()
                .and_then(|table| probe_of(&table)),
            planes: numbered(table, "plane", plane_of),
            spheres: numbered(table, "sphere", |table| Some(sphere_of(table))),
        }
    }

    /// One more than the highest target that a distance or the probe names.
    #[must_use]
    pub fn target_count(&self) -> usize {
        let of_distances = self.distances.values().map(|distance| distance.target);
        let all = of_distances.chain([self.probe.and_then(|probe| probe.target)]);
        all.flatten().max().map_or(0, |highest| highest + 1)
    }

    /// The tables as TOML.
    pub(super) fn toml(&self) -> String {
        let mut out = String::new();
        for (index, distance) in &self.distances {
            head(&mut out, "distance", *index);
            vector(&mut out, "anchor_mm", distance.anchor_m);
            target(&mut out, distance.target);
            match distance.offset_m {
                None => line(&mut out, "offset_mm", &string(FITTED)),
                Some(0.0) => {}
                Some(offset) => line(&mut out, "offset_mm", &number(offset / MM)),
            }
        }
        if let Some(probe) = &self.probe {
            out.push_str("\n[probe]\n");
            line(&mut out, "radius_mm", &number(probe.radius_m / MM));
            target(&mut out, probe.target);
            length(&mut out, "sigma_mm", probe.sigma_m);
        }
        for (index, plane) in &self.planes {
            head(&mut out, "plane", *index);
            line(&mut out, "normal", &list(&plane.normal));
            length(&mut out, "offset_mm", plane.offset_m);
        }
        for (index, sphere) in &self.spheres {
            head(&mut out, "sphere", *index);
            vector(&mut out, "centre_mm", sphere.centre_m);
            length(&mut out, "radius_mm", sphere.radius_m);
        }
        out
    }
}

/// Used for unknown values.
const FITTED: &str = "fitted";

/// The tables `STEM1`, `STEM2`, …; only existing ones are read.
fn numbered<T>(
    table: &Table<'_, '_>,
    stem: &str,
    read: impl Fn(&Table<'_, '_>) -> Option<T>,
) -> BTreeMap<usize, T> {
    let mut found = BTreeMap::new();
    for index in 0..GAUGES_MAX {
        let key = format!("{stem}{}", index + 1);
        if table.keys().any(|name| name == key)
            && let Some(inner) = table.table(&key)
        {
            found.extend(read(&inner).map(|value| (index, value)));
            inner.close();
        }
    }
    found
}

fn target_of(table: &Table<'_, '_>) -> Option<usize> {
    let targets_max = i64::try_from(TARGETS_MAX).unwrap_or(i64::MAX);
    let target = table.whole("target", 1..targets_max + 1)?;
    usize::try_from(target - 1).ok()
}

fn distance_of(table: &Table<'_, '_>) -> Distance {
    let fitted = |value: &toml::Spanned<DeValue<'_>>| matches!(value.get_ref(), DeValue::String(keyword) if keyword == FITTED);
    let offset_m = if table.raw("offset_mm").is_some_and(fitted) {
        None
    } else {
        Some(table.number("offset_mm", ..).unwrap_or(0.0) * MM)
    };
    let anchor_m = table.vector::<3>("anchor_mm").map(|point| point.map(|x| x * MM));
    Distance { anchor_m, target: target_of(table), offset_m }
}

fn probe_of(table: &Table<'_, '_>) -> Option<Probe> {
    table.require("radius_mm", "the radius of the probe's ball, 0 for a point");
    let radius = table.number("radius_mm", 0.0..);
    let sigma_m = table.number("sigma_mm", POSITIVE).map(|sigma| sigma * MM);
    let target = target_of(table);
    table.close();
    Some(Probe { radius_m: radius? * MM, target, sigma_m })
}

fn plane_of(table: &Table<'_, '_>) -> Option<TouchedPlane> {
    table.require("normal", "three numbers, pointing to the side of the probe");
    let offset_m = table.number("offset_mm", ..).map(|offset| offset * MM);
    let normal = table.vector::<3>("normal")?;
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !(length > 0.0 && length.is_finite()) {
        table.fault("normal", "has no direction", "three numbers, not all zero");
        return None;
    }
    Some(TouchedPlane { normal: normal.map(|x| x / length), offset_m })
}

fn sphere_of(table: &Table<'_, '_>) -> TouchedSphere {
    TouchedSphere {
        centre_m: table.vector::<3>("centre_mm").map(|point| point.map(|x| x * MM)),
        radius_m: table.number("radius_mm", POSITIVE).map(|radius| radius * MM),
    }
}

fn head(out: &mut String, stem: &str, index: usize) {
    let _ = writeln!(out, "\n[{stem}{}]", index + 1);
}

fn target(out: &mut String, target: Option<usize>) {
    if let Some(target) = target {
        line(out, "target", &(target + 1).to_string());
    }
}

fn length(out: &mut String, key: &str, metres: Option<f64>) {
    if let Some(metres) = metres {
        line(out, key, &number(metres / MM));
    }
}

fn vector(out: &mut String, key: &str, metres: Option<[f64; 3]>) {
    if let Some(metres) = metres {
        line(out, key, &list(&metres.map(|x| x / MM)));
    }
}
