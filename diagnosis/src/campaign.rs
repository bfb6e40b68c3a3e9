//! A measuring campaign: inputs of the robot, measurements and their uncertainties.
//!
//! Kinds of measurements can be mixed: points of the tool and its orientation in a measuring frame, distances to a fixed point (ballbar, cable
//! encoder), contacts of a probe with planes and spheres, joint positions on the link side.
//!
//! All values are SI. A campaign contains no effects; it is built from files by [`crate::campaign_import`].

use crate::autocorrelation::ArModel;
use crate::extrinsics::Extrinsics;
use crate::frame_drift::FrameDrift;
use glam::{DMat3, DVec3};
use physics::Inputs;

/// The measured point of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolPoint {
    /// The tool centre point.
    Tcp,
    /// A target (reflector, probe tip) of [`Extrinsics::targets`].
    Target(usize),
}

/// One measurement of an instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// A point of the tool, m, measuring frame.
    Point {
        /// The measured point.
        place: ToolPoint,
        /// Measuring frame, index into [`Extrinsics::frames`].
        frame: usize,
        /// Measured position, m, in that frame.
        at: DVec3,
    },
    /// The tool's orientation in a measuring frame.
    Orientation {
        /// Measuring frame, index into [`Extrinsics::frames`].
        frame: usize,
        /// Measured rotation matrix from tool axes to measuring axes.
        measuring_from_tool: DMat3,
    },
    /// The distance of a point of the tool from a fixed point.
    Distance {
        /// The measured point.
        place: ToolPoint,
        /// The fixed point, index into [`Extrinsics::anchors`].
        anchor: usize,
        /// Measured distance, m.
        length_m: f64,
    },
    /// A probe touches a plane from the side of its normal.
    Plane {
        /// Centre of the probe's ball.
        place: ToolPoint,
        /// The plane, index into [`Extrinsics::planes`].
        plane: usize,
        /// Radius of the probe's ball, m.
        radius_m: f64,
    },
    /// A probe touches a sphere from outside.
    Sphere {
        /// Centre of the probe's ball.
        place: ToolPoint,
        /// The sphere, index into [`Extrinsics::spheres`].
        sphere: usize,
        /// Radius of the probe's ball, m.
        radius_m: f64,
    },
    /// A joint's position measured on the link side, rad or m.
    JointPosition {
        /// 0-based.
        joint: usize,
        /// Measured position, rad or m.
        position: f64,
    },
}

impl Reading {
    /// Number of scalar values: 3 for points and orientations, otherwise 1.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Point { .. } | Self::Orientation { .. } => 3,
            _ => 1,
        }
    }

    /// The extrinsic object that the measurement refers to, if any: its kind and its index among objects of that kind.
    pub(crate) fn extrinsic_object(&self) -> Option<(u8, usize)> {
        match *self {
            Self::Point { frame, .. } | Self::Orientation { frame, .. } => Some((0, frame)),
            Self::Distance { anchor, .. } => Some((1, anchor)),
            Self::Plane { plane, .. } => Some((2, plane)),
            Self::Sphere { sphere, .. } => Some((3, sphere)),
            Self::JointPosition { .. } => None,
        }
    }

    /// Whether the measurement is a length in m; otherwise it is an angle.
    #[must_use]
    pub fn is_length(&self) -> bool {
        !matches!(self, Self::Orientation { .. } | Self::JointPosition { .. })
    }
}

/// Standard uncertainty of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReadingNoise {
    /// The same in every direction, m or rad.
    Equal(f64),
    /// Per axis of the measuring frame, m or rad.
    Axes(DVec3),
    /// A laser tracker at the origin of the measuring frame: `u = fixed + per_metre · distance`, along and across the beam.
    Tracker {
        /// Along the beam: m, and m per m.
        along: (f64, f64),
        /// Across the beam: m, and m per m.
        across: (f64, f64),
    },
    /// A covariance, m², measuring axes; it must be positive definite.
    Covariance(DMat3),
}

impl ReadingNoise {
    /// Whitening matrix `W` with `Wᵀ W` equal to the inverse covariance, so that `W` scales residuals to unit noise. `measured_point` in m.
    ///
    /// `None` if the noise is not positive and finite.
    #[must_use]
    pub fn whitening(&self, measured_point: DVec3) -> Option<DMat3> {
        let whitening = match *self {
            Self::Equal(sigma) => DMat3::from_diagonal(DVec3::splat(1.0 / sigma)),
            Self::Axes(sigma) => DMat3::from_diagonal(DVec3::ONE / sigma),
            Self::Tracker { along, across } => {
                let distance = measured_point.length();
                let beam = measured_point.try_normalize().unwrap_or(DVec3::X);
                let (first, second) = physics::frame::normals(beam);
                let (u, v) = (along.0 + along.1 * distance, across.0 + across.1 * distance);
                DMat3::from_cols(beam / u, first / v, second / v).transpose()
            }
            Self::Covariance(covariance) => inverse_root(&covariance)?,
        };
        let numbers = whitening.to_cols_array();
        let sound = whitening.is_finite() && whitening.determinant() > 0.0;
        (sound && numbers.iter().any(|x| *x != 0.0)).then_some(whitening)
    }
}

/// Inverse of the lower Cholesky factor of a covariance; `None` if it is not positive definite.
fn inverse_root(c: &DMat3) -> Option<DMat3> {
    let (xx, xy, xz) = (c.x_axis.x, c.x_axis.y, c.x_axis.z);
    let (yy, yz, zz) = (c.y_axis.y, c.y_axis.z, c.z_axis.z);
    let l11 = xx.sqrt();
    let (l21, l31) = (xy / l11, xz / l11);
    let l22 = (yy - l21 * l21).sqrt();
    let l32 = (yz - l31 * l21) / l22;
    let l33 = (zz - l31 * l31 - l32 * l32).sqrt();
    let lower = DMat3::from_cols(
        DVec3::new(l11, l21, l31),
        DVec3::new(0.0, l22, l32),
        DVec3::new(0.0, 0.0, l33),
    );
    (l33 > 0.0).then(|| lower.inverse())
}

/// One measurement with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// The measurement.
    pub reading: Reading,
    /// See [`ReadingNoise::whitening`]; a scalar measurement uses only the first entry.
    pub whitening: DMat3,
    /// Index into [`Campaign::instruments`].
    pub instrument: usize,
}

/// How the arm arrived at a pose, which determines the state of effects with memory (hysteresis, backlash).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// After a long move that ended in the direction given by the inputs: the memory is fully developed.
    Settled,
    /// From the preceding pose: the memory continues.
    FromPrevious,
}

/// One pose of the arm with its measurements.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Inputs of the model.
    pub inputs: Inputs,
    /// How the arm arrived there.
    pub arrival: Arrival,
    /// Recording, 0-based index into [`Campaign::recordings`].
    pub recording: usize,
    /// Row of that recording, 0-based.
    pub row: usize,
    /// The measurements.
    pub seen: Vec<Observation>,
}

impl Pose {
    /// Measuring frame of the first measurement that has one, index into [`Extrinsics::frames`].
    #[must_use]
    pub fn frame(&self) -> Option<usize> {
        self.seen.iter().find_map(|observation| match observation.reading {
            Reading::Point { frame, .. } | Reading::Orientation { frame, .. } => Some(frame),
            _ => None,
        })
    }
}

/// One instrument: measurements that share one noise model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instrument {
    /// Name for users: `targets of FILE`.
    pub name: String,
    /// Whether its standard uncertainty is known; otherwise the fit estimates a factor on it.
    pub noise_is_known: bool,
    /// Autocorrelation of its noise.
    pub noise_model: ArModel,
}

/// One recording from which poses are taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingInfo {
    /// Name for users.
    pub name: String,
    /// Whether the arm moved along a path; otherwise it was at rest at each pose.
    pub is_path: bool,
    /// Whether joint positions were read back from the controller; otherwise they are commands.
    pub reads_back: bool,
    /// Drift of the instrument, where reference targets on the base measure it; points and orientations are already corrected for it.
    pub frame_drift: Option<FrameDrift>,
}

impl RecordingInfo {
    /// Settled poses with commanded positions.
    #[must_use]
    pub fn of_poses(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }
}

/// All measurements, with the extrinsic parameters (frames, targets, stations) as far as they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaign {
    /// In the order of measurement.
    pub poses: Vec<Pose>,
    /// Frames, targets and touched objects: known, or to be fitted.
    pub surroundings: Extrinsics,
    /// The instruments.
    pub instruments: Vec<Instrument>,
    /// The recordings, indexed by [`Pose::recording`].
    pub recordings: Vec<RecordingInfo>,
}

impl Campaign {
    /// Number of measurements of all poses.
    #[must_use]
    pub fn readings(&self) -> usize {
        self.poses.iter().map(|pose| pose.seen.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn whitening_takes_the_covariance_to_one(a in prop::array::uniform3(0.1..2.0_f64), b in prop::array::uniform3(-0.05..0.05_f64)) {
            let c = DMat3::from_cols(DVec3::new(a[0], b[0], b[1]), DVec3::new(b[0], a[1], b[2]), DVec3::new(b[1], b[2], a[2]));
            let w = ReadingNoise::Covariance(c).whitening(DVec3::ZERO).expect("positive definite");
            let one = w * c * w.transpose();
            prop_assert!((one - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-12));
        }

        #[test]
        fn a_tracker_is_sharp_along_the_beam_and_blunt_across(point in prop::array::uniform3(1.0..9.0_f64)) {
            let point = DVec3::from_array(point);
            let noise = ReadingNoise::Tracker { along: (1e-6, 0.0), across: (0.0, 6e-6) };
            let w = noise.whitening(point).expect("sound");
            let (beam, side) = (point.normalize(), point.normalize().any_orthonormal_vector());
            prop_assert!(((w * beam).length() - 1e6).abs() < 1e-3);
            let across = 1.0 / (6e-6 * point.length());
            prop_assert!(((w * side).length() / across - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_noise_that_is_none_is_refused() {
        for noise in
            [ReadingNoise::Equal(0.0), ReadingNoise::Equal(f64::NAN), ReadingNoise::Axes(DVec3::X)]
        {
            assert_eq!(noise.whitening(DVec3::ONE), None, "{noise:?}");
        }
        assert_eq!(ReadingNoise::Covariance(DMat3::ZERO).whitening(DVec3::ONE), None);
    }
}
