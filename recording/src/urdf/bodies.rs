//! Masses of a URDF, and how the links that move together become one body.
//!
//! A link's inertia is given about its centre of mass, in the axes of `<inertial><origin>`: it is
//! rotated to base axes and moved to the common centre (parallel axes, Huygens-Steiner), all at the
//! zero configuration. Physically impossible bodies, which are placeholders, are read as point
//! masses, with a note.

use glam::{DMat3, DVec3};
use physics::{Body, Frame};
use roxmltree::Node;

use super::source::{Source, child, name};

/// Files contain rounded moments: a thin rod may violate the inequality in the third digit.
const ROUNDED: f64 = 1e-3;

/// The body of a link with the pose `base_from_link`; `None` without a mass.
///
/// Many descriptions contain placeholders, which say nothing about the geometry: a physically
/// impossible inertia gives a point mass, no mass gives no body, and `remarks` notes it.
pub(super) fn of_link(
    source: &Source<'_>,
    link: Node<'_, '_>,
    base_from_link: &Frame,
    remarks: &mut Vec<String>,
) -> Option<Body> {
    let inertial = child(link, "inertial")?;
    let base_from_inertial = base_from_link.after(&source.origin(inertial));
    let inertia = tensor(source, inertial);
    let mass = child(inertial, "mass").and_then(|mass| source.finite(mass, "value"));
    let Some(mass) = mass.filter(|mass| *mass > 0.0) else {
        let found = mass.map_or("no finite mass".to_owned(), |mass| format!("a mass of {mass} kg"));
        remarks.push(format!("link {} has {found}; imported without mass", name(link)));
        return None;
    };
    let inertia = inertia.unwrap_or_else(|why| {
        remarks.push(format!("link {} {why}; imported as a point mass of {mass} kg", name(link)));
        DMat3::ZERO
    });
    let turn = base_from_inertial.rotation;
    let inertia = turn * inertia * turn.transpose();
    Some(Body { mass, centre: base_from_inertial.origin, inertia })
}

/// The inertia about the centre of mass; why it is a placeholder where it is one.
fn tensor(source: &Source<'_>, inertial: Node<'_, '_>) -> Result<DMat3, &'static str> {
    let Some(inertia) = child(inertial, "inertia") else { return Err("has no <inertia>") };
    let moments = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"].map(|key| source.finite(inertia, key));
    let [Some(xx), Some(xy), Some(xz), Some(yy), Some(yz), Some(zz)] = moments else {
        return Err("has an inertia with a missing or non-finite moment");
    };
    let inertia = DMat3::from_cols_array_2d(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    if inertia == DMat3::ZERO {
        return Err("has an inertia of zero");
    }
    if !is_physical(&inertia) {
        return Err(
            "has an unphysical inertia (a principal moment is negative or above the sum of the other two)",
        );
    }
    Ok(inertia)
}

/// Whether the inertia is physically possible: the second moments `½ tr(I) 1 − I` must not be
/// negative in any direction (Wensing, Kim, Slotine 2018, IEEE RA-L 3(1): 60), which is checked by
/// all principal minors.
fn is_physical(inertia: &DMat3) -> bool {
    let [xx, yy, zz] = [inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z];
    let size = xx.abs().max(yy.abs()).max(zz.abs()).max(inertia.x_axis.y.abs());
    let size = size.max(inertia.x_axis.z.abs()).max(inertia.y_axis.z.abs());
    let unit = *inertia * size.recip();
    let half_trace = 0.5 * (xx + yy + zz) / size;
    let second = DMat3::from_diagonal(DVec3::splat(half_trace)) - unit;
    let (a, b, c) = (second.x_axis, second.y_axis, second.z_axis);
    let slack = -ROUNDED;
    let minors = [a.x * b.y - a.y * b.x, a.x * c.z - a.z * c.x, b.y * c.z - b.z * c.y];
    let diagonal = [a.x, b.y, c.z].iter().all(|moment| *moment >= slack);
    diagonal && minors.iter().all(|minor| *minor >= slack) && second.determinant() >= slack
}

/// All bodies as one; `None` if there are none.
pub(super) fn together(bodies: &[Body]) -> Option<Body> {
    let mass: f64 = bodies.iter().map(|body| body.mass).sum();
    if bodies.is_empty() {
        return None;
    }
    let centre = bodies.iter().map(|body| body.centre * (body.mass / mass)).sum();
    let about_centre = |body: &Body| {
        let d: DVec3 = body.centre - centre;
        let outer = DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        body.inertia + (DMat3::from_diagonal(DVec3::splat(d.length_squared())) - outer) * body.mass
    };
    let inertia = bodies.iter().map(about_centre).fold(DMat3::ZERO, |sum, part| sum + part);
    Some(Body { mass, centre, inertia: lifted(inertia) })
}

/// Increases moments that rounding made too small, equally about every axis, so that no moment
/// exceeds the sum of the others.
fn lifted(inertia: DMat3) -> DMat3 {
    let [xx, yy, zz] = [inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z];
    let missing = (xx - yy - zz).max(yy - zz - xx).max(zz - xx - yy).max(0.0);
    inertia + DMat3::from_diagonal(DVec3::splat(missing))
}
