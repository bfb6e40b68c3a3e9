//! Rigid motions as 4×4 matrices of plain numbers, with the system's sine and cosine: independent
//! of the crate.

use crate::{Arm, Frame, JointKind};
use glam::DVec3;

#[derive(Clone, Copy, Debug)]
pub(super) struct Matrix(pub(super) [[f64; 4]; 4]);

pub(super) fn identity() -> Matrix {
    shift([0.0; 3])
}

pub(super) fn shift(d: [f64; 3]) -> Matrix {
    Matrix([
        [1.0, 0.0, 0.0, d[0]],
        [0.0, 1.0, 0.0, d[1]],
        [0.0, 0.0, 1.0, d[2]],
        [0.0, 0.0, 0.0, 1.0],
    ])
}

/// The rotation by `|t|` about the line along `t` through `p`: a series of the matrix exponential.
pub(super) fn turn(t: [f64; 3], p: [f64; 3]) -> Matrix {
    let cross = [[0.0, -t[2], t[1]], [t[2], 0.0, -t[0]], [-t[1], t[0], 0.0]];
    let mut rate = [[0.0; 4]; 4];
    for r in 0..3 {
        rate[r][..3].copy_from_slice(&cross[r]);
    }
    let (mut sum, mut term) = (identity(), identity());
    for n in 1..60 {
        term = term.times(&Matrix(rate));
        term.0.iter_mut().flatten().for_each(|x| *x /= f64::from(n));
        sum.0.iter_mut().flatten().zip(term.0.as_flattened()).for_each(|(s, t)| *s += t);
    }
    shift(p).times(&sum).times(&shift(p.map(|x| -x)))
}

/// One row of a table by Denavit and Hartenberg, standard form: lengths in m, angles in rad.
pub(super) fn denavit_hartenberg(theta: f64, d: f64, a: f64, alpha: f64) -> Matrix {
    let ((st, ct), (sa, ca)) = (theta.sin_cos(), alpha.sin_cos());
    Matrix([
        [ct, -st * ca, st * sa, a * ct],
        [st, ct * ca, -ct * sa, a * st],
        [0.0, sa, ca, d],
        [0.0, 0.0, 0.0, 1.0],
    ])
}

impl Matrix {
    pub(super) fn times(&self, other: &Self) -> Self {
        let mut product = [[0.0; 4]; 4];
        for (r, row) in product.iter_mut().enumerate() {
            for (c, x) in row.iter_mut().enumerate() {
                *x = (0..4).map(|k| self.0[r][k] * other.0[k][c]).sum();
            }
        }
        Self(product)
    }

    pub(super) fn point(&self, p: DVec3) -> DVec3 {
        let row = |r: usize| DVec3::from_slice(&self.0[r][..3]).dot(p) + self.0[r][3];
        DVec3::new(row(0), row(1), row(2))
    }

    pub(super) fn of(frame: &Frame) -> Self {
        let (r, p) = (frame.rotation.to_cols_array_2d(), frame.origin);
        let row = |k: usize, x: f64| [r[0][k], r[1][k], r[2][k], x];
        Self([row(0, p.x), row(1, p.y), row(2, p.z), [0.0, 0.0, 0.0, 1.0]])
    }

    /// The largest difference of any entry; lengths in m together with dimensionless entries.
    pub(super) fn difference(&self, frame: &Frame) -> f64 {
        let other = Self::of(frame);
        let pairs = self.0.as_flattened().iter().zip(other.0.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }
}

/// The geometry: axes, points and tool at the zero configuration.
pub(super) struct Geometry {
    pub(super) joints: Vec<(JointKind, DVec3, DVec3)>,
    pub(super) tool: Matrix,
}

impl Geometry {
    pub(super) fn of(arm: &Arm) -> Self {
        let joints = arm.joints().iter().map(|j| (j.kind, j.axis, j.point)).collect();
        let tool = Matrix::of(&Frame::new(arm.tool.base_from_tool, arm.tool.tcp));
        Self { joints, tool }
    }

    /// Moves the points of joints `first` and beyond, and the tool, at the zero configuration.
    pub(super) fn move_from(&mut self, first: usize, by: DVec3) {
        self.joints[first..].iter_mut().for_each(|(_, _, point)| *point += by);
        self.tool = shift(by.to_array()).times(&self.tool);
    }

    /// Pose of body `i` at `q`; of the base for `None`.
    pub(super) fn body(&self, q: &[f64], i: Option<usize>) -> Matrix {
        let moved = self.joints.iter().zip(q).take(i.map_or(0, |i| i + 1));
        moved.fold(identity(), |carried, ((kind, axis, point), q)| {
            carried.times(&match kind {
                JointKind::Revolute => turn((*axis * *q).to_array(), point.to_array()),
                JointKind::Prismatic => shift((*axis * *q).to_array()),
            })
        })
    }

    pub(super) fn base_from_tool(&self, q: &[f64]) -> Matrix {
        self.body(q, Some(self.joints.len() - 1)).times(&self.tool)
    }
}
