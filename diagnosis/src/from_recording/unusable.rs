//! Reasons why a recording cannot be used as a campaign.

/// A recording that cannot be used in a campaign.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// Its input lacks a joint.
    #[error("{file}: the position of joint {joint} is missing")]
    JointMissing {
        /// The recording.
        file: String,
        /// From 1.
        joint: usize,
    },
    /// A standard uncertainty that is no number above zero.
    #[error("{file}: `sigma` of {what} must be above zero")]
    Sigma {
        /// The recording.
        file: String,
        /// Which group.
        what: &'static str,
    },
    /// A target on a link that is not there, or is the tool's.
    #[error(
        "`target{target}_on_link` is {link}: expected 0 (the base) to {}; targets on the last link move with the tool and need no such entry",
        joints - 1
    )]
    NoSuchLink {
        /// From 1.
        target: usize,
        /// As stated.
        link: usize,
        /// The arm's joints.
        joints: usize,
    },
    /// Two recordings that do not agree.
    #[error(
        "{file}: its TOML defines `{what}` differently from another recording; a number has one meaning in all recordings"
    )]
    Contradiction {
        /// The recording.
        file: String,
        /// Which thing.
        what: String,
    },
    /// Nothing measured.
    #[error(
        "{file}: nothing was measured; a calibration needs x_mm, y_mm, z_mm, targets, ql, distances or touches"
    )]
    NothingMeasured {
        /// The recording.
        file: String,
    },
}
