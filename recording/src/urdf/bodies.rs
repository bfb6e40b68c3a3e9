//! Masses of a URDF, and how the links that move together become one body.
//!
//! A link's inertia stands about its centre of mass, in the axes of `<inertial><origin>`: it is turned into base axes and
//! moved to the common centre (parallel axes, Huygens-Steiner), all at the zero configuration. Never: a body that no matter
//! could make.

use glam::{DMat3, DVec3};
use physics::{Body, Frame};
use roxmltree::Node;

use super::source::{Source, child};

/// Files round their moments: a thin rod may miss what matter allows by its third figure.
const ROUNDED: f64 = 1e-3;

/// The body of a link whose frame stands at `base_from_link`; nothing where it has no mass.
pub(super) fn of_link(
    source: &Source<'_>,
    link: Node<'_, '_>,
    base_from_link: &Frame,
) -> Option<Body> {
    let inertial = child(link, "inertial")?;
    let base_from_inertial = base_from_link.after(&source.origin(inertial));
    let Some(mass) = child(inertial, "mass").map(|mass| source.needed(mass, "value")) else {
        source.fault(inertial, "has no <mass>", "give <mass value=\"…\"/> in kg");
        return None;
    };
    if mass < 0.0 {
        source.fault(inertial, format!("has a mass of {mass} kg"), "give a mass of 0 or more");
    }
    let inertia = child(inertial, "inertia").map_or(DMat3::ZERO, |inertia| tensor(source, inertia));
    if !is_of_matter(&inertia) {
        let help = "correct it (each principal moment is at most the sum of the other two), or leave <inertia> out: the \
                    link then counts as a point mass";
        source.fault(inertial, "has an inertia that no body has", help);
    }
    let turn = base_from_inertial.rotation;
    let inertia = turn * inertia * turn.transpose();
    (mass > 0.0).then_some(Body { mass, centre: base_from_inertial.origin, inertia })
}

fn tensor(source: &Source<'_>, inertia: Node<'_, '_>) -> DMat3 {
    let [xx, xy, xz] = ["ixx", "ixy", "ixz"].map(|key| source.needed(inertia, key));
    let [yy, yz, zz] = ["iyy", "iyz", "izz"].map(|key| source.needed(inertia, key));
    DMat3::from_cols_array_2d(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
}

/// Whether some spread of mass has this inertia: the second moments `½ tr(I) 1 − I` must not be negative in any direction
/// (Wensing, Kim, Slotine 2018, IEEE RA-L 3(1): 60), which all principal minors tell.
fn is_of_matter(inertia: &DMat3) -> bool {
    let [xx, yy, zz] = [inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z];
    let size = xx.abs().max(yy.abs()).max(zz.abs()).max(inertia.x_axis.y.abs());
    let size = size.max(inertia.x_axis.z.abs()).max(inertia.y_axis.z.abs());
    if size == 0.0 {
        return true;
    }
    let unit = *inertia * size.recip();
    let half_trace = 0.5 * (xx + yy + zz) / size;
    let second = DMat3::from_diagonal(DVec3::splat(half_trace)) - unit;
    let (a, b, c) = (second.x_axis, second.y_axis, second.z_axis);
    let slack = -ROUNDED;
    let minors = [a.x * b.y - a.y * b.x, a.x * c.z - a.z * c.x, b.y * c.z - b.z * c.y];
    let diagonal = [a.x, b.y, c.z].iter().all(|moment| *moment >= slack);
    diagonal && minors.iter().all(|minor| *minor >= slack) && second.determinant() >= slack
}

/// All bodies as one; nothing where there are none.
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

/// What rounding left too small is given back, alike about every axis: then no moment is above the sum of the others.
fn lifted(inertia: DMat3) -> DMat3 {
    let [xx, yy, zz] = [inertia.x_axis.x, inertia.y_axis.y, inertia.z_axis.z];
    let missing = (xx - yy - zz).max(yy - zz - xx).max(zz - xx - yy).max(0.0);
    inertia + DMat3::from_diagonal(DVec3::splat(missing))
}
