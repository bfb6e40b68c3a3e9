//! Named points with a manner of drawing. Never a scale.

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Line,
    Dots,
}

/// A named series of points `(x, y)` in the units of the plot's axes.
///
/// A point that is not finite (or not above zero on a logarithmic axis) is left out, and breaks a line.
#[derive(Debug, Clone)]
pub struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) shape: Shape,
    pub(crate) muted: bool,
    pub(crate) dashed: bool,
}

impl Series {
    /// Points joined by a line: a signal where `x` is in order, any path in the plane otherwise.
    #[must_use]
    pub fn line(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name.into(), points.into_iter().collect(), Shape::Line)
    }

    /// Points alone.
    #[must_use]
    pub fn dots(name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self::new(name.into(), points.into_iter().collect(), Shape::Dots)
    }

    /// Grey: what others are compared with.
    #[must_use]
    pub fn muted(mut self) -> Self {
        self.muted = true;
        self
    }

    /// Dashed: a model, a target, a bound.
    #[must_use]
    pub fn dashed(mut self) -> Self {
        self.dashed = true;
        self
    }

    fn new(name: String, points: Vec<(f64, f64)>, shape: Shape) -> Self {
        Self { name, points, shape, muted: false, dashed: false }
    }
}

/// Classes of the stylesheet for each series of a plot; muted ones take no colour.
pub(crate) fn classes(series: &[Series]) -> Vec<String> {
    let mut coloured = 0;
    let class = |series: &Series| {
        let dash = if series.dashed { " dash" } else { "" };
        if series.muted {
            return format!("c0{dash}");
        }
        coloured += 1;
        format!("{}{dash}", colour_class(coloured - 1))
    };
    series.iter().map(class).collect()
}

/// Eight colours, then the same again, dashed.
pub(crate) fn colour_class(place: usize) -> String {
    let again = if place >= 8 { " dash" } else { "" };
    format!("c{}{again}", place % 8 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_muted_takes_no_colour() {
        let series = || Series::line("", []);
        assert_eq!(
            classes(&[series().muted(), series(), series().dashed()]),
            ["c0", "c1", "c2 dash"]
        );
    }
}
