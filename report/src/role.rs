//! Roles of curves, dots and bars: one colour, dash and marker per role on every page.
//!
//! A role does not rely on colour alone: a line also has a dash, a dot a shape. Colours are in
//! `style.css`, for light, dark and print.

use crate::canvas::Px;

/// Meaning of a curve, dot or bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Role {
    /// The initial state, or the reference of a comparison.
    Before,
    /// After a calibration, before further effects are found.
    Calibrated,
    /// With the identified effects; with correction.
    After,
    /// The truth, if known.
    Truth,
    /// None of these: signals, axes, channels; distinguished by their order.
    #[default]
    Other,
}

/// Number of colours without a role.
const OTHERS: usize = 8;
/// Number of different dashes and markers.
const SHAPES: usize = 4;

/// Appearance of one element: by its role, and among those without a role by its order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Appearance {
    pub(crate) role: Role,
    pub(crate) place: usize,
}

impl Appearance {
    /// The appearances for a list of roles, in its order.
    pub(crate) fn each(roles: impl IntoIterator<Item = Role>) -> Vec<Self> {
        let mut others = 0;
        let appearance = |role| {
            let place = others;
            others += usize::from(role == Role::Other);
            Self { role, place }
        };
        roles.into_iter().map(appearance).collect()
    }

    /// The class of its colour.
    pub(crate) fn colour(self) -> String {
        match self.role {
            Role::Before => "before".to_owned(),
            Role::Calibrated => "calibrated".to_owned(),
            Role::After => "after".to_owned(),
            Role::Truth => "truth".to_owned(),
            Role::Other => format!("c{}", self.place % OTHERS + 1),
        }
    }

    fn shape(self) -> usize {
        match self.role {
            Role::After => 0,
            Role::Before => 1,
            Role::Truth => 2,
            Role::Calibrated => 3,
            // The eight colours repeat with the next shape.
            Role::Other => (self.place + self.place / OTHERS) % SHAPES,
        }
    }

    /// The classes of a line in its colour and dash.
    pub(crate) fn line(self) -> String {
        format!("line {} d{}", self.colour(), self.shape())
    }

    /// The classes of dots in its colour.
    pub(crate) fn dots(self) -> String {
        format!("dots {} m{}", self.colour(), self.shape())
    }

    /// The path of a marker around a point: a dot, or a vertical, horizontal or oblique stroke.
    /// Short, because a plot has thousands.
    pub(crate) fn marker(self, (x, y): (f64, f64)) -> String {
        match self.shape() {
            0 => format!("M{} {}h0", Px(x), Px(y)),
            1 => format!("M{} {}v5", Px(x), Px(y - 2.5)),
            2 => format!("M{} {}h5", Px(x - 2.5), Px(y)),
            _ => format!("M{} {}l4 4", Px(x - 2.0), Px(y - 2.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMED: [Role; 4] = [Role::Before, Role::Calibrated, Role::After, Role::Truth];

    #[test]
    fn a_role_looks_the_same_wherever_it_stands() {
        let first = Appearance::each([Role::After, Role::Other, Role::Other]);
        let last = Appearance::each([Role::Other, Role::Before, Role::Other, Role::After]);
        assert_eq!(
            (first[0].line(), first[0].dots(), first[0].marker((1.0, 2.0))),
            (last[3].line(), last[3].dots(), last[3].marker((1.0, 2.0)))
        );
        assert_eq!(first[2].colour(), last[2].colour(), "the second of those without a role");
    }

    #[test]
    fn roles_differ_in_colour_in_dash_and_in_marker() {
        let looks = Appearance::each(NAMED);
        for (i, one) in looks.iter().enumerate() {
            for other in &looks[..i] {
                assert_ne!(one.colour(), other.colour());
                assert_ne!(one.shape(), other.shape());
                assert_ne!(one.marker((0.0, 0.0)), other.marker((0.0, 0.0)));
            }
        }
    }

    #[test]
    fn a_series_without_a_role_never_has_the_colour_of_one() {
        let named: Vec<String> =
            Appearance::each(NAMED).iter().map(|appearance| appearance.colour()).collect();
        let others = Appearance::each([Role::Other; 20]);
        assert!(others.iter().all(|appearance| !named.contains(&appearance.colour())));
        assert_ne!(others[0].line(), others[8].line(), "the same colour again has another dash");
    }
}
