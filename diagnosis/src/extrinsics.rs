//! Extrinsic parameters: measuring frames, targets on the tool, fixed points, planes and spheres; known or fitted.
//!
//! They precede the parameters of effects in every fit, in the order of the fields here: directions confounded with an unknown measuring frame or
//! target (docs/reference/effects.md, last section) are assigned to these, not to the arm.
//!
//! Invariant: a step of the fit keeps rotations orthonormal and normals of unit length.

use glam::DVec3;
use physics::Frame;
use physics::frame::{normals, rotation_from_vector};

/// A quantity, and whether the fit may change it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitParameter<T> {
    /// Known or estimated value.
    pub value: T,
    /// Whether it is fitted.
    pub free: bool,
}

impl<T> FitParameter<T> {
    /// A known quantity.
    pub const fn known(value: T) -> Self {
        Self { value, free: false }
    }

    /// A quantity to be estimated, with its initial value.
    pub const fn unknown(start: T) -> Self {
        Self { value: start, free: true }
    }
}

/// Pose of a measuring frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuringFrame {
    /// Transformation from base coordinates to measuring coordinates.
    pub measuring_from_base: Frame,
    /// The point about which the fit rotates it, measuring frame, m: the mean of the measured points.
    pub pivot: DVec3,
}

/// A plane `normal · p = offset`, base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit vector towards the side that is touched.
    pub normal: DVec3,
    /// Offset, m.
    pub offset_m: f64,
}

/// A fixed point from which distances are measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Position, base frame, m.
    pub place: FitParameter<DVec3>,
    /// Constant offset of the measured distance (measured minus true), m.
    pub offset_m: FitParameter<f64>,
}

/// A sphere, base frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, m.
    pub centre: FitParameter<DVec3>,
    /// Radius, m.
    pub radius_m: FitParameter<f64>,
}

/// All extrinsic parameters of a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extrinsics {
    /// Measuring frames.
    pub frames: Vec<FitParameter<MeasuringFrame>>,
    /// Points of the tool, tool frame, m.
    pub targets: Vec<FitParameter<DVec3>>,
    /// Fixed points.
    pub anchors: Vec<Anchor>,
    /// Planes that are touched.
    pub planes: Vec<FitParameter<Plane>>,
    /// Spheres that are touched.
    pub spheres: Vec<Sphere>,
}

/// One scalar extrinsic parameter: index of the object (0-based) and component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExtrinsicParameter {
    /// A frame; 0 to 2 rotate it about its pivot (measuring axes, rad), 3 to 5 translate it (m).
    Frame(usize, usize),
    /// A coordinate of a target, m.
    Target(usize, usize),
    /// A fixed point; 0 to 2 are its coordinates, 3 the offset of its distances, m.
    Anchor(usize, usize),
    /// A plane; 0 and 1 tilt it about the two perpendiculars of its normal (rad), 2 is its offset (m).
    Plane(usize, usize),
    /// A sphere; 0 to 2 are its centre, 3 its radius, m.
    Sphere(usize, usize),
}

impl Extrinsics {
    /// The fitted parameters in their order in a fit.
    #[must_use]
    pub fn parameters(&self) -> Vec<ExtrinsicParameter> {
        let mut numbers = Vec::new();
        let mut list = |free: bool, count: usize, number: &dyn Fn(usize) -> ExtrinsicParameter| {
            numbers.extend((0..if free { count } else { 0 }).map(number));
        };
        for (i, frame) in self.frames.iter().enumerate() {
            list(frame.free, 6, &|k| ExtrinsicParameter::Frame(i, k));
        }
        for (i, target) in self.targets.iter().enumerate() {
            list(target.free, 3, &|k| ExtrinsicParameter::Target(i, k));
        }
        for (i, anchor) in self.anchors.iter().enumerate() {
            list(anchor.place.free, 3, &|k| ExtrinsicParameter::Anchor(i, k));
            list(anchor.offset_m.free, 1, &|_| ExtrinsicParameter::Anchor(i, 3));
        }
        for (i, plane) in self.planes.iter().enumerate() {
            list(plane.free, 3, &|k| ExtrinsicParameter::Plane(i, k));
        }
        for (i, sphere) in self.spheres.iter().enumerate() {
            list(sphere.centre.free, 3, &|k| ExtrinsicParameter::Sphere(i, k));
            list(sphere.radius_m.free, 1, &|_| ExtrinsicParameter::Sphere(i, 3));
        }
        numbers
    }

    /// The extrinsic parameters after a step of the fit, one entry per element of [`Extrinsics::parameters`].
    #[must_use]
    pub fn stepped(&self, step: &[f64]) -> Self {
        let mut next = self.clone();
        for (number, by) in self.parameters().into_iter().zip(step) {
            match number {
                ExtrinsicParameter::Frame(i, k @ 0..3) => {
                    next.frames[i].value.rotate_about_pivot(axis(k) * *by);
                }
                ExtrinsicParameter::Frame(i, k) => {
                    next.frames[i].value.measuring_from_base.origin[k - 3] += by;
                }
                ExtrinsicParameter::Target(i, k) => next.targets[i].value[k] += by,
                ExtrinsicParameter::Anchor(i, 3) => next.anchors[i].offset_m.value += by,
                ExtrinsicParameter::Anchor(i, k) => next.anchors[i].place.value[k] += by,
                ExtrinsicParameter::Plane(i, 2) => next.planes[i].value.offset_m += by,
                ExtrinsicParameter::Plane(i, k) => {
                    let old = self.planes[i].value.normal;
                    let along = if k == 0 { normals(old).0 } else { normals(old).1 };
                    let normal = &mut next.planes[i].value.normal;
                    *normal = (*normal + along * *by).normalize();
                }
                ExtrinsicParameter::Sphere(i, 3) => next.spheres[i].radius_m.value += by,
                ExtrinsicParameter::Sphere(i, k) => next.spheres[i].centre.value[k] += by,
            }
        }
        next
    }

    /// Name of a parameter for users.
    #[must_use]
    pub fn describe(&self, number: ExtrinsicParameter) -> String {
        let coordinate = |k: usize| ["x", "y", "z"].get(k).copied().unwrap_or("size");
        match number {
            ExtrinsicParameter::Frame(i, k @ 0..3) => {
                format!("the measuring frame {}'s turn about {}", i + 1, coordinate(k))
            }
            ExtrinsicParameter::Frame(i, k) => {
                format!("the measuring frame {}'s {}", i + 1, coordinate(k.saturating_sub(3)))
            }
            ExtrinsicParameter::Target(i, k) => {
                format!("target {}'s {} on the tool", i + 1, coordinate(k))
            }
            ExtrinsicParameter::Anchor(i, 3) => format!("the length offset of distance {}", i + 1),
            ExtrinsicParameter::Anchor(i, k) => {
                format!("the fixed point {}'s {}", i + 1, coordinate(k))
            }
            ExtrinsicParameter::Plane(i, 2) => format!("the plane {}'s place", i + 1),
            ExtrinsicParameter::Plane(i, _) => format!("the plane {}'s tilt", i + 1),
            ExtrinsicParameter::Sphere(i, 3) => format!("the sphere {}'s radius", i + 1),
            ExtrinsicParameter::Sphere(i, k) => format!("the sphere {}'s {}", i + 1, coordinate(k)),
        }
    }
}

impl ExtrinsicParameter {
    /// Largest plausible error of an initial value, m or rad: the unit in which a column counts as determined or not.
    pub const PLAUSIBLE_ERROR: f64 = 0.1;
}

impl MeasuringFrame {
    fn rotate_about_pivot(&mut self, turn: DVec3) {
        let about = Frame::about(self.pivot, rotation_from_vector(turn));
        self.measuring_from_base = about.after(&self.measuring_from_base);
    }
}

fn axis(k: usize) -> DVec3 {
    DVec3::AXES[k]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_free() -> Extrinsics {
        let station = MeasuringFrame { measuring_from_base: Frame::IDENTITY, pivot: DVec3::X };
        let plane = Plane { normal: DVec3::Z, offset_m: 0.1 };
        let centre = FitParameter::unknown(DVec3::ZERO);
        Extrinsics {
            frames: vec![FitParameter::unknown(station)],
            targets: vec![FitParameter::unknown(DVec3::ZERO), FitParameter::known(DVec3::ONE)],
            anchors: vec![Anchor {
                place: FitParameter::unknown(DVec3::ZERO),
                offset_m: FitParameter::unknown(0.0),
            }],
            planes: vec![FitParameter::unknown(plane)],
            spheres: vec![Sphere { centre, radius_m: FitParameter::known(0.01) }],
        }
    }

    #[test]
    fn what_is_known_takes_no_part_in_a_step() {
        let surroundings = all_free();
        let numbers = surroundings.parameters();
        assert_eq!(numbers.len(), 6 + 3 + 4 + 3 + 3);
        let moved = surroundings.stepped(&vec![0.01; numbers.len()]);
        assert_eq!(moved.targets[1], surroundings.targets[1]);
        assert_eq!(moved.spheres[0].radius_m, surroundings.spheres[0].radius_m);
        assert!((moved.planes[0].value.normal.length() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_frame_turns_about_the_middle_of_what_was_seen() {
        let surroundings = all_free();
        let mut step = vec![0.0; surroundings.parameters().len()];
        step[2] = 0.3;
        let moved = surroundings.stepped(&step).frames[0].value.measuring_from_base;
        assert!((moved.point(DVec3::X) - DVec3::X).length() < 1e-15);
        assert!((moved.point(DVec3::ZERO) - DVec3::ZERO).length() > 0.2);
    }
}
