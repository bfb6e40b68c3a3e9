//! Residual of a measurement and its derivatives: one rule per kind of measurement.
//!
//! `residual = W (measured − predicted)`, W the whitening matrix of its noise. Derivatives are those of the prediction, so that a step `dx` of the
//! fit solves `J dx ≈ residual`.
//!
//! Derivatives are exact where the residual is small compared with a radian and with the measured distances; they agree with central differences
//! (property tests). Robust weights: [`crate::robust_weights`].

use crate::campaign::{Observation, Reading, ToolPoint};
use crate::extrinsics::{ExtrinsicParameter, Extrinsics};
use crate::tool_motion::ToolMotion;
use glam::{DMat3, DVec3};
use physics::frame::{normals, vector_from_rotation};
use physics::{Evaluation, Joints};
use std::collections::BTreeMap;

/// First column of each extrinsic object in a fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExtrinsicColumns(BTreeMap<(u8, usize), usize>);

impl ExtrinsicColumns {
    pub(crate) fn of(surroundings: &Extrinsics) -> Self {
        let mut first = BTreeMap::new();
        for (column, number) in surroundings.parameters().into_iter().enumerate() {
            let key = match number {
                ExtrinsicParameter::Frame(i, _) => (0, i),
                ExtrinsicParameter::Target(i, _) => (1, i),
                ExtrinsicParameter::Anchor(i, 3) => (6, i),
                ExtrinsicParameter::Anchor(i, _) => (2, i),
                ExtrinsicParameter::Plane(i, _) => (3, i),
                ExtrinsicParameter::Sphere(i, 3) => (5, i),
                ExtrinsicParameter::Sphere(i, _) => (4, i),
            };
            first.entry(key).or_insert(column);
        }
        Self(first)
    }

    fn first(&self, what: u8, index: usize) -> Option<usize> {
        self.0.get(&(what, index)).copied()
    }
}

/// A measurement compared with the model.
#[derive(Clone, Debug)]
pub(crate) struct ReadingResidual {
    /// Number of components in use, 1 to 3.
    pub(crate) count: usize,
    /// Measured minus predicted, in units of the noise.
    pub(crate) residual: DVec3,
    /// Derivative of the prediction by rotation and translation of the tool (columns: x, y, z), in units of the noise.
    by_turn: DMat3,
    by_shift: DMat3,
    /// The joint whose position is predicted.
    by_joint: Option<usize>,
    whitening: DMat3,
    /// Derivatives by extrinsic parameters.
    extrinsic: [Option<ExtrinsicBlock>; EXTRINSIC_BLOCKS_MAX],
}

/// Largest number of extrinsic objects that a measurement depends on: a target, and place and size of what is measured from.
const EXTRINSIC_BLOCKS_MAX: usize = 3;
/// Largest number of parameters of an extrinsic object: those of a frame.
const OBJECT_PARAMETERS_MAX: usize = 6;

/// Derivatives by the parameters of an extrinsic object, which are consecutive columns.
#[derive(Clone, Copy, Debug)]
struct ExtrinsicBlock {
    first: usize,
    count: usize,
    by: [DVec3; OBJECT_PARAMETERS_MAX],
}

impl ReadingResidual {
    /// Compares a measurement with the evaluation of the arm.
    pub(crate) fn of(
        observation: &Observation,
        evaluation: &Evaluation,
        commanded: &Joints,
        surroundings: &Extrinsics,
        columns: &ExtrinsicColumns,
    ) -> Self {
        let scene = ReadingPrediction { evaluation, surroundings, columns };
        let mut rows = match observation.reading {
            Reading::Point { place, frame, at } => scene.point(place, frame, at),
            Reading::Orientation { frame, measuring_from_tool } => {
                scene.orientation(frame, &measuring_from_tool)
            }
            Reading::Distance { place, anchor, length_m } => {
                scene.distance(place, anchor, length_m)
            }
            Reading::Plane { place, plane, radius_m } => scene.plane(place, plane, radius_m),
            Reading::Sphere { place, sphere, radius_m } => scene.sphere(place, sphere, radius_m),
            Reading::JointPosition { joint, position } => {
                let predicted = commanded[joint] + evaluation.deviation.joints[joint];
                Self {
                    by_joint: Some(joint),
                    ..Self::without_derivatives(1, DVec3::X * (position - predicted))
                }
            }
        };
        rows.whiten(&observation.whitening);
        rows
    }

    /// Writes the derivatives to `rows`, one slice per component: extrinsic parameters first, then one column per motion from `effects_from`.
    pub(crate) fn write_derivatives(
        &self,
        effects_from: usize,
        motions: &[ToolMotion],
        rows: &mut [Vec<f64>],
    ) {
        for row in rows.iter_mut() {
            row.fill(0.0);
        }
        let mut put = |column: usize, value: DVec3| {
            for (k, row) in rows.iter_mut().enumerate().take(self.count) {
                row[column] = value[k];
            }
        };
        for ExtrinsicBlock { first, count, by } in self.extrinsic.iter().flatten() {
            by[..*count].iter().enumerate().for_each(|(k, value)| put(first + k, *value));
        }
        for (k, motion) in motions.iter().enumerate() {
            put(effects_from + k, self.derivative_along(motion));
        }
    }

    /// Derivative of the prediction along a motion of the tool, in units of the noise.
    pub(crate) fn derivative_along(&self, motion: &ToolMotion) -> DVec3 {
        self.along_parts((motion.turn, motion.shift), |joint| motion.joints[joint])
    }

    /// The same for a motion given as rotation and translation of the tool and a function of joint motions.
    pub(crate) fn along_parts(
        &self,
        (turn, shift): (DVec3, DVec3),
        joint_moves: impl FnOnce(usize) -> f64,
    ) -> DVec3 {
        match self.by_joint {
            Some(joint) => self.whitening.x_axis * joint_moves(joint),
            None => self.by_turn * turn + self.by_shift * shift,
        }
    }

    fn without_derivatives(count: usize, residual: DVec3) -> Self {
        Self {
            count,
            residual,
            by_turn: DMat3::ZERO,
            by_shift: DMat3::ZERO,
            by_joint: None,
            whitening: DMat3::IDENTITY,
            extrinsic: [None; EXTRINSIC_BLOCKS_MAX],
        }
    }

    fn whiten(&mut self, whitening: &DMat3) {
        self.whitening = if self.count == 1 {
            DMat3::from_diagonal(DVec3::new(whitening.x_axis.x, 0.0, 0.0))
        } else {
            *whitening
        };
        self.residual = self.whitening * self.residual;
        self.by_turn = self.whitening * self.by_turn;
        self.by_shift = self.whitening * self.by_shift;
        for ExtrinsicBlock { count, by, .. } in self.extrinsic.iter_mut().flatten() {
            by[..*count].iter_mut().for_each(|value| *value = self.whitening * *value);
        }
    }

    /// Adds the derivatives by the parameters of an extrinsic object, whose first column is `first` if it is fitted.
    fn add_extrinsic<const COUNT: usize>(&mut self, first: Option<usize>, by: [DVec3; COUNT]) {
        let slot = self.extrinsic.iter_mut().find(|slot| slot.is_none());
        if let (Some(first), Some(slot)) = (first, slot) {
            let mut all = [DVec3::ZERO; OBJECT_PARAMETERS_MAX];
            all[..COUNT].copy_from_slice(&by);
            *slot = Some(ExtrinsicBlock { first, count: COUNT, by: all });
        }
    }
}

struct ReadingPrediction<'a> {
    evaluation: &'a Evaluation,
    surroundings: &'a Extrinsics,
    columns: &'a ExtrinsicColumns,
}

impl ReadingPrediction<'_> {
    /// Position of a point of the tool in base coordinates, and its lever arm from the TCP.
    fn place(&self, place: ToolPoint) -> (DVec3, DVec3) {
        let tool = &self.evaluation.real.base_from_tool;
        let lever = match place {
            ToolPoint::Tcp => DVec3::ZERO,
            ToolPoint::Target(i) => tool.rotation * self.surroundings.targets[i].value,
        };
        (tool.origin + lever, lever)
    }

    /// Rows whose derivative is `slope · (displacement of the point)`, by the tool and by the position of the target on it.
    fn of_point(
        &self,
        count: usize,
        residual: DVec3,
        slope: DMat3,
        place: ToolPoint,
    ) -> ReadingResidual {
        let (_, lever) = self.place(place);
        let mut rows = ReadingResidual::without_derivatives(count, residual);
        rows.by_shift = slope;
        // turn × lever = −lever × turn
        rows.by_turn = slope * -cross_matrix(lever);
        if let ToolPoint::Target(i) = place {
            let tool = self.evaluation.real.base_from_tool.rotation;
            let block = DVec3::AXES.map(|axis| slope * (tool * axis));
            rows.add_extrinsic(self.columns.first(1, i), block);
        }
        rows
    }

    fn point(&self, place: ToolPoint, frame: usize, measured: DVec3) -> ReadingResidual {
        let station = &self.surroundings.frames[frame].value;
        let predicted = station.measuring_from_base.point(self.place(place).0);
        let slope = station.measuring_from_base.rotation;
        let mut rows = self.of_point(3, measured - predicted, slope, place);
        let [x, y, z] = DVec3::AXES.map(|axis| axis.cross(predicted - station.pivot));
        let block = [x, y, z, DVec3::X, DVec3::Y, DVec3::Z];
        rows.add_extrinsic(self.columns.first(0, frame), block);
        rows
    }

    fn orientation(&self, frame: usize, measured: &DMat3) -> ReadingResidual {
        let turned = self.surroundings.frames[frame].value.measuring_from_base.rotation;
        let predicted = turned * self.evaluation.real.base_from_tool.rotation;
        let residual = vector_from_rotation(&(*measured * predicted.transpose()));
        let mut rows = ReadingResidual {
            by_turn: turned,
            ..ReadingResidual::without_derivatives(3, residual)
        };
        rows.add_extrinsic(self.columns.first(0, frame), DVec3::AXES);
        rows
    }

    /// A scalar measurement that changes with the displacement of the point along `direction`.
    fn along(&self, residual: f64, direction: DVec3, place: ToolPoint) -> ReadingResidual {
        let slope = DMat3::from_cols(
            DVec3::X * direction.x,
            DVec3::X * direction.y,
            DVec3::X * direction.z,
        );
        self.of_point(1, DVec3::X * residual, slope, place)
    }

    fn distance(&self, place: ToolPoint, anchor: usize, length_m: f64) -> ReadingResidual {
        let fixed = &self.surroundings.anchors[anchor];
        let away = self.place(place).0 - fixed.place.value;
        let direction = away.normalize_or_zero();
        let predicted_m = away.length() + fixed.offset_m.value;
        let mut rows = self.along(length_m - predicted_m, direction, place);
        let block = direction.to_array().map(|d| DVec3::X * -d);
        rows.add_extrinsic(self.columns.first(2, anchor), block);
        rows.add_extrinsic(self.columns.first(6, anchor), [DVec3::X]);
        rows
    }

    fn plane(&self, place: ToolPoint, plane: usize, radius_m: f64) -> ReadingResidual {
        let wall = &self.surroundings.planes[plane].value;
        let point = self.place(place).0;
        let height = wall.normal.dot(point) - wall.offset_m;
        let mut rows = self.along(radius_m - height, wall.normal, place);
        let (n1, n2) = normals(wall.normal);
        let block = [n1.dot(point), n2.dot(point), -1.0].map(|d| DVec3::X * d);
        rows.add_extrinsic(self.columns.first(3, plane), block);
        rows
    }

    fn sphere(&self, place: ToolPoint, sphere: usize, radius_m: f64) -> ReadingResidual {
        let ball = &self.surroundings.spheres[sphere];
        let away = self.place(place).0 - ball.centre.value;
        let direction = away.normalize_or_zero();
        let gap = away.length() - ball.radius_m.value;
        let mut rows = self.along(radius_m - gap, direction, place);
        let block = direction.to_array().map(|d| DVec3::X * -d);
        rows.add_extrinsic(self.columns.first(4, sphere), block);
        rows.add_extrinsic(self.columns.first(5, sphere), [-DVec3::X]);
        rows
    }
}

/// Cross-product matrix `[v]×`: `[v]× w = v × w`.
fn cross_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.cross(DVec3::X), v.cross(DVec3::Y), v.cross(DVec3::Z))
}
