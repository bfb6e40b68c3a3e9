//! Fitted objects around the robot: fixed points, planes, spheres.
//!
//! Every fitted parameter, with its standard uncertainty if the data determine it. Measuring frames and targets are not listed.

use diagnosis::Fit;
use diagnosis::extrinsics;
use report::significant;
use serde::Serialize;

/// From m to mm, or rad to mrad.
const MILLI: f64 = 1e3;

/// A fitted parameter of a fixed point, plane or sphere.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct ObjectParameter {
    thing: &'static str,
    /// 1-based.
    number: usize,
    what: &'static str,
    /// mm; null for a plane's tilts, which are relative to the stated normal.
    value_mm: Option<f64>,
    /// mm; mrad for a plane's tilts.
    sigma: Option<f64>,
}

/// All fitted parameters.
pub(super) fn object_parameters(fit: &Fit) -> Vec<ObjectParameter> {
    let numbers = fit.surroundings.parameters().into_iter().enumerate();
    numbers.filter_map(|(column, number)| object_parameter(fit, column, number)).collect()
}

fn object_parameter(
    fit: &Fit,
    column: usize,
    number: extrinsics::ExtrinsicParameter,
) -> Option<ObjectParameter> {
    use extrinsics::ExtrinsicParameter as Place;
    let around = &fit.surroundings;
    let coordinate = |k: usize| ["x", "y", "z"].get(k).copied().unwrap_or_default();
    let (thing, index, what, value_m) = match number {
        Place::Frame(..) | Place::Target(..) => return None,
        Place::Anchor(i, 3) => ("distance", i, "offset", Some(around.anchors[i].offset_m.value)),
        Place::Anchor(i, k) => {
            ("distance", i, coordinate(k), Some(around.anchors[i].place.value[k]))
        }
        Place::Plane(i, 2) => ("plane", i, "offset", Some(around.planes[i].value.offset_m)),
        Place::Plane(i, _) => ("plane", i, "tilt", None),
        Place::Sphere(i, 3) => ("sphere", i, "radius", Some(around.spheres[i].radius_m.value)),
        Place::Sphere(i, k) => {
            ("sphere", i, coordinate(k), Some(around.spheres[i].centre.value[k]))
        }
    };
    let sigma = fit.sigma(column).map(|sigma| sigma * MILLI);
    Some(ObjectParameter {
        thing,
        number: index + 1,
        what,
        value_mm: value_m.map(|m| m * MILLI),
        sigma,
    })
}

/// One line per object: `sphere 1: x 800.123 ± 0.004, …`.
pub(super) fn lines(numbers: &[ObjectParameter]) -> Vec<String> {
    let whole = numbers.chunk_by(|a, b| (a.thing, a.number) == (b.thing, b.number));
    let number = |parameter: &ObjectParameter| {
        let value = format!("{:.3}", parameter.value_mm?);
        let sigma = parameter.sigma.map(|sigma| format!(" ± {}", significant(sigma, 2)));
        Some(format!(
            "{} {value}{}",
            parameter.what,
            sigma.unwrap_or_else(|| " (not determined)".to_owned())
        ))
    };
    let line = |group: &[ObjectParameter]| {
        let first = group.first()?;
        let numbers: Vec<String> = group.iter().filter_map(number).collect();
        Some(format!("{} {}: {} mm", first.thing, first.number, numbers.join(", ")))
    };
    whole.filter_map(line).collect()
}
