//! Orientations of other programs as unit quaternions: angles about three axes, rotation vectors, matrices, quaternions of either order.
//!
//! Every form is the rotation from tool axes to measuring frame axes. Sequences of axes are written as in scipy: upper case for rotations about
//! moving axes, in the given order (`ZYX`: KUKA's A, B, C), lower case about fixed ones (`xyz`: roll, pitch, yaw). Matrices are
//! accepted as rotations to 1e-3.

use glam::{DMat3, DQuat, DVec3};
use physics::frame::{rotation_about, rotation_from_vector};

use super::read::{names_of, unit_of};
use crate::faults::Fault;
use crate::series::{Builder, RawTable};
use crate::toml_reader::Table;
use crate::unit::{Quantity, Unit};

/// Source columns of an orientation.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Orientation {
    form: Convention,
    /// Unit of angles and of rotation vectors.
    unit: Option<Unit>,
    theirs: Vec<String>,
}

/// Meaning of an orientation's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Convention {
    /// Angles about three axes, one after the other.
    Angles {
        axes: [DVec3; 3],
        moving: bool,
    },
    /// Rotation vector: the axis scaled by the angle.
    Vector,
    Matrix {
        by_rows: bool,
    },
    Quaternion {
        scalar_first: bool,
    },
}

/// Largest difference of a matrix times its transpose from the unit matrix, as for quaternions in
/// docs/reference/recording.md.
const MATRIX_TOLERANCE: f64 = 1e-3;
const EXPECTED: &str = "`ZYX` (KUKA A B C, ABB EZ EY EX), `xyz` (Fanuc W P R, Yaskawa, roll pitch yaw), `XYZ` (Staubli), \
    `ZYZ` (Kawasaki O A T) or another sequence of three axes, `rotation_vector` (Universal Robots), `matrix_rows`, `matrix_columns`, `wxyz` or `xyzw`";

impl Convention {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "rotation_vector" => Self::Vector,
            "matrix_rows" => Self::Matrix { by_rows: true },
            "matrix_columns" => Self::Matrix { by_rows: false },
            "wxyz" => Self::Quaternion { scalar_first: true },
            "xyzw" => Self::Quaternion { scalar_first: false },
            sequence => {
                let moving = sequence.chars().all(|c| c.is_ascii_uppercase());
                let fixed = sequence.chars().all(|c| c.is_ascii_lowercase());
                let axis = |c: char| match c.to_ascii_lowercase() {
                    'x' => Some(DVec3::X),
                    'y' => Some(DVec3::Y),
                    'z' => Some(DVec3::Z),
                    _ => None,
                };
                let axes: Option<Vec<DVec3>> = sequence.chars().map(axis).collect();
                let axes: [DVec3; 3] = axes?.try_into().ok()?;
                // Two consecutive rotations about one axis are a single one: they cannot describe
                // every orientation.
                let turns = axes[0] != axes[1] && axes[1] != axes[2];
                return (turns && (moving || fixed)).then_some(Self::Angles { axes, moving });
            }
        })
    }

    fn count(self) -> usize {
        match self {
            Self::Angles { .. } | Self::Vector => 3,
            Self::Matrix { .. } => 9,
            Self::Quaternion { .. } => 4,
        }
    }

    fn has_unit(self) -> bool {
        matches!(self, Self::Angles { .. } | Self::Vector)
    }

    /// w, x, y, z of these numbers, angles in rad; `None` if a matrix is not a rotation.
    fn quaternion(self, numbers: &[f64]) -> Option<[f64; 4]> {
        let vector = || DVec3::from_slice(numbers);
        let rotation = match self {
            Self::Angles { axes, moving } => {
                let [a, b, c] = [0, 1, 2].map(|k| rotation_about(axes[k], numbers[k]));
                if moving { a * b * c } else { c * b * a }
            }
            Self::Vector => rotation_from_vector(vector()),
            Self::Matrix { by_rows } => {
                let read = DMat3::from_cols_slice(numbers);
                let error = (read * read.transpose() - DMat3::IDENTITY).to_cols_array();
                let deviation = error.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                if deviation > MATRIX_TOLERANCE || read.determinant() < 0.0 {
                    return None;
                }
                if by_rows { read.transpose() } else { read }
            }
            Self::Quaternion { scalar_first: true } => return numbers.try_into().ok(),
            Self::Quaternion { scalar_first: false } => {
                return Some([numbers[3], numbers[0], numbers[1], numbers[2]]);
            }
        };
        let [x, y, z, w] = DQuat::from_mat3(&rotation).normalize().to_array();
        Some([w, x, y, z])
    }
}

impl Orientation {
    pub(super) fn read(entry: &Table<'_, '_>) -> Option<Self> {
        entry.require("from", "a list of the columns of one orientation");
        entry.require("convention", EXPECTED);
        let theirs = names_of(entry);
        let unit = unit_of(entry);
        let name = entry.text("convention")?;
        let Some(form) = Convention::named(name) else {
            entry.fault("convention", format!("is \"{name}\""), EXPECTED);
            return None;
        };
        if form.has_unit() {
            entry.require("unit", "\"deg\" or \"rad\"");
        }
        if let Some(unit) = unit.filter(|unit| unit.quantity != Quantity::Angle || !form.has_unit())
        {
            let expected = if form.has_unit() { "a unit of angle" } else { "no unit here" };
            entry.fault("unit", format!("is \"{}\"", unit.name), expected);
        }
        let theirs = theirs?;
        if theirs.len() != form.count() {
            let found = format!("has {} columns", theirs.len());
            entry.fault("from", found, format!("{}, like `{name}`", form.count()));
        }
        let twice = theirs.iter().enumerate().find(|(index, name)| theirs[..*index].contains(name));
        if let Some((_, name)) = twice {
            entry.fault("from", format!("lists `{name}` twice"), "a different column for each");
        }
        Some(Self { form, unit, theirs })
    }

    /// The source columns that it needs.
    pub(super) fn theirs(&self) -> &[String] {
        &self.theirs
    }

    pub(super) fn apply(&self, table: &RawTable<'_>, builder: &mut Builder<'_, '_>) {
        let places = builder.places(&self.theirs);
        let Some(places) = places.filter(|places| places.len() == self.form.count()) else {
            return;
        };
        let si = |value: f64| self.unit.map_or(value, |unit| unit.to_si(value));
        let mut columns = Vec::new();
        for column in &places {
            builder.check_unit(*column, self.unit, true);
            columns.push(builder.numbers(*column).into_iter().map(si).collect::<Vec<f64>>());
        }
        let mut parts: [Vec<f64>; 4] = Default::default();
        let mut no_rotation = None;
        for row in 0..table.len() {
            let numbers: Vec<f64> =
                columns.iter().filter_map(|column| column.get(row)).copied().collect();
            // A missing sample, or one already reported as a fault.
            let taken = numbers.iter().all(|number| number.is_finite());
            let quaternion = if taken { self.form.quaternion(&numbers) } else { None };
            if taken && quaternion.is_none() {
                no_rotation.get_or_insert(row);
            }
            let quaternion = quaternion.unwrap_or([f64::NAN; 4]);
            parts.iter_mut().zip(quaternion).for_each(|(part, number)| part.push(number));
        }
        if let Some(row) = no_rotation {
            let fault = Fault::new("orientation", "the matrix of this row is not a rotation")
                .expected("orthogonal unit columns, right-handed, within 1e-3");
            builder.fault(table.cell_fault(row, places[0], fault));
        }
        for (name, part) in ["ow", "ox", "oy", "oz"].into_iter().zip(parts) {
            builder.take(name, places.first().copied(), part);
        }
    }
}

#[cfg(test)]
mod tests;
