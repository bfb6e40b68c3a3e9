//! Named points with a drawing style.

use crate::role::{Appearance, Role};

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Line,
    Dots,
}

/// A named series of points `(x, y)` in the units of the plot's axes.
///
/// A point that is not finite (or not above zero on a logarithmic axis) is omitted, and interrupts
/// a line.
#[derive(Debug, Clone)]
pub struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) shape: Shape,
    pub(crate) role: Role,
    pub(crate) dashed: bool,
}

impl Series {
    /// Points joined by a line: a signal where `x` is in order, any path in the plane otherwise.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name.into(), points.into_iter().collect(), Shape::Line)
    }

    /// Points only.
    #[must_use]
    pub fn dots(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name.into(), points.into_iter().collect(), Shape::Dots)
    }

    /// Its role; without one, it is distinguished by its order.
    #[must_use]
    pub fn role(mut self, role: Role) -> Self {
        self.role = role;
        self
    }

    /// Dashed: a model, a target, a limit.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }

    fn new(name: String, points: Vec<(f64, f64)>, shape: Shape) -> Self {
        Self { name, points, shape, role: Role::Other, dashed: false }
    }
}

/// The appearance of each series of a plot.
pub(crate) fn looks(series: &[Series]) -> Vec<Appearance> {
    Appearance::each(series.iter().map(|series| series.role))
}
