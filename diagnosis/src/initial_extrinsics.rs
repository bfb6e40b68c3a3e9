//! Initial values of the extrinsic parameters: frames and targets by alternating least squares, fixed points, planes and spheres by linear least
//! squares.
//!
//! Accurate enough (centimetres, degrees) for convergence of [`crate::fit()`], for any position of the instrument and any mounting of the targets.

use crate::campaign::{Campaign, Pose, Reading, ToolPoint};
use crate::extrinsics::{Extrinsics, FitParameter, MeasuringFrame, Plane};
use crate::qr::QrFactor;
use crate::rigid_motion::{fit_rigid_motion, mean};
use glam::DVec3;
use physics::{Chain, Frame, Model};

const ROUNDS: usize = 30;

/// Extrinsic parameters of `campaign`, with all free ones estimated from the nominal geometry.
#[must_use]
pub fn estimate_extrinsics(campaign: &Campaign, model: &Model, used: &[bool]) -> Extrinsics {
    let poses: Vec<(Frame, &Pose)> = campaign
        .poses
        .iter()
        .zip(used)
        .filter(|(_, used)| **used)
        .map(|(pose, _)| (Chain::nominal(&model.arm, &pose.inputs.q).base_from_tool, pose))
        .collect();
    let mut found = campaign.surroundings.clone();
    for _ in 0..ROUNDS {
        place_frames(&mut found, &poses);
        if !found.targets.iter().any(|target| target.free) {
            break;
        }
        place_targets(&mut found, &poses);
    }
    place_frames(&mut found, &poses);
    place_touched(&mut found, &poses);
    found
}

/// Position of a point of the tool in base coordinates, m.
fn point(found: &Extrinsics, tool: &Frame, place: ToolPoint) -> DVec3 {
    match place {
        ToolPoint::Tcp => tool.origin,
        ToolPoint::Target(i) => tool.point(found.targets[i].value),
    }
}

fn place_frames(found: &mut Extrinsics, poses: &[(Frame, &Pose)]) {
    for index in 0..found.frames.len() {
        let (mut predicted, mut measured) = (Vec::new(), Vec::new());
        for (tool, pose) in poses {
            for observation in &pose.seen {
                if let Reading::Point { place, frame, at } = observation.reading
                    && frame == index
                {
                    predicted.push(point(found, tool, place));
                    measured.push(at);
                }
            }
        }
        let pivot = mean(&measured);
        let FitParameter { value, free } = &mut found.frames[index];
        value.pivot = pivot;
        if let Some(moved) = fit_rigid_motion(&predicted, &measured)
            && *free
        {
            *value = MeasuringFrame { measuring_from_base: moved, pivot };
        }
    }
}

fn place_targets(found: &mut Extrinsics, poses: &[(Frame, &Pose)]) {
    let mut sums = vec![(DVec3::ZERO, 0.0); found.targets.len()];
    for (tool, pose) in poses {
        for observation in &pose.seen {
            if let Reading::Point { place: ToolPoint::Target(target), frame, at } =
                observation.reading
            {
                let base = found.frames[frame].value.measuring_from_base.inverse().point(at);
                sums[target].0 += tool.inverse().point(base);
                sums[target].1 += 1.0;
            }
        }
    }
    for (target, (sum, count)) in found.targets.iter_mut().zip(sums) {
        if target.free && count > 0.0 {
            target.value = sum / count;
        }
    }
}

/// Fixed points, planes and spheres from the probe positions and the measured distances.
fn place_touched(found: &mut Extrinsics, poses: &[(Frame, &Pose)]) {
    let all = |wanted: &dyn Fn(&Reading) -> Option<(ToolPoint, f64)>, found: &Extrinsics| {
        let each = poses.iter().flat_map(|(tool, pose)| pose.seen.iter().map(move |o| (tool, o)));
        let picked = each.filter_map(|(tool, o)| Some((tool, wanted(&o.reading)?)));
        picked.map(|(tool, (place, x))| (point(found, tool, place), x)).collect::<Vec<_>>()
    };
    for index in 0..found.anchors.len() {
        let matching = |r: &Reading| match *r {
            Reading::Distance { place, anchor, length_m } if anchor == index => {
                Some((place, length_m))
            }
            _ => None,
        };
        let (readings, fixed) = (all(&matching, found), &mut found.anchors[index]);
        let lengths = if fixed.offset_m.free {
            DistanceKnowledge::FromSome
        } else {
            DistanceKnowledge::Known
        };
        if let Some((centre, offset_m)) = centre_of(&readings, lengths)
            && fixed.place.free
        {
            fixed.place.value = centre;
            if fixed.offset_m.free {
                fixed.offset_m.value = offset_m;
            }
        }
    }
    for index in 0..found.spheres.len() {
        let matching = |r: &Reading| match *r {
            Reading::Sphere { place, sphere, radius_m } if sphere == index => {
                Some((place, radius_m))
            }
            _ => None,
        };
        if let Some((centre, distance)) =
            centre_of(&all(&matching, found), DistanceKnowledge::OneUnknown)
        {
            let probe = all(&matching, found).first().map_or(0.0, |(_, radius)| *radius);
            let sphere = &mut found.spheres[index];
            sphere.centre.value = if sphere.centre.free { centre } else { sphere.centre.value };
            sphere.radius_m.value =
                if sphere.radius_m.free { distance - probe } else { sphere.radius_m.value };
        }
    }
    for index in 0..found.planes.len() {
        let matching = |r: &Reading| match *r {
            Reading::Plane { place, plane, radius_m } if plane == index => Some((place, radius_m)),
            _ => None,
        };
        let touched = all(&matching, found);
        if let Some(plane) = plane_through(&touched, found.planes[index].value.normal)
            && found.planes[index].free
        {
            found.planes[index].value = plane;
        }
    }
}

/// Prior knowledge on the distances of points from a centre.
#[derive(Clone, Copy, PartialEq)]
enum DistanceKnowledge {
    /// They are measured.
    Known,
    /// They are measured up to a common offset.
    FromSome,
    /// They are equal, but unknown.
    OneUnknown,
}

/// The centre around which points lie, with the offset of their distances, or the unknown distance. `|p − c|² = (d − o)²` is linear in `c`, `o` and
/// `c² − o²`; with an unknown `d`, in `c` and `c² − d²`.
fn centre_of(points: &[(DVec3, f64)], lengths: DistanceKnowledge) -> Option<(DVec3, f64)> {
    if points.len() < 6 {
        return None;
    }
    let middle = points.iter().map(|(p, _)| *p).sum::<DVec3>() / points.len() as f64;
    let width = if lengths == DistanceKnowledge::FromSome { 5 } else { 4 };
    let mut triangle = QrFactor::new(width);
    for (p, distance) in points {
        let p = *p - middle;
        let given =
            if lengths == DistanceKnowledge::OneUnknown { 0.0 } else { distance * distance };
        let row = [2.0 * p.x, 2.0 * p.y, 2.0 * p.z, 1.0, -2.0 * distance];
        triangle.push(&row[..width], p.length_squared() - given);
    }
    triangle.reduce();
    let x = triangle.solve(&[1e-9; 5][..width]);
    let centre = DVec3::new(x[0], x[1], x[2]);
    let second = match lengths {
        DistanceKnowledge::FromSome => x[4],
        _ => (x[3] + centre.length_squared()).max(0.0).sqrt(),
    };
    Some((centre + middle, second))
}

/// The plane at the probe's radius from its centres; its normal points to the side of `side`.
fn plane_through(points: &[(DVec3, f64)], side: DVec3) -> Option<Plane> {
    if points.len() < 4 {
        return None;
    }
    let cloud: Vec<DVec3> = points.iter().map(|(p, _)| *p).collect();
    let middle = mean(&cloud);
    // Direction of least spread: the regression over each of three pairs of axes is tried.
    let best = (0..3).filter_map(|k| {
        let mut triangle = QrFactor::new(2);
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        cloud.iter().map(|p| *p - middle).for_each(|p| triangle.push(&[p[i], p[j]], p[k]));
        triangle.reduce();
        let slope = triangle.solve(&[1e-9; 2]);
        let mut normal = DVec3::AXES[k];
        normal[i] = -slope[0];
        normal[j] = -slope[1];
        let normal = normal.try_normalize()?;
        let spread: f64 = cloud.iter().map(|p| normal.dot(*p - middle).powi(2)).sum();
        Some((spread, normal))
    });
    let (_, normal) = best.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let normal = if normal.dot(side) < 0.0 { -normal } else { normal };
    let probe = points.iter().map(|(_, radius)| radius).sum::<f64>() / points.len() as f64;
    Some(Plane { normal, offset_m: normal.dot(middle) - probe })
}
