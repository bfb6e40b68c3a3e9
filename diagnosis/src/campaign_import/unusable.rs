//! Reasons why a recording cannot be used as a campaign.

/// A recording that cannot be used in a campaign.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CampaignError {
    /// Its input lacks a joint.
    #[error("{file}: the position of joint {joint} is missing")]
    JointMissing {
        /// The recording.
        file: String,
        /// 1-based.
        joint: usize,
    },
    /// A standard uncertainty that is not positive.
    #[error("{file}: `sigma` of {what} must be above zero")]
    Sigma {
        /// The recording.
        file: String,
        /// The group of columns.
        what: &'static str,
    },
    /// A target on a link that does not exist or that carries the tool.
    #[error(
        "`target{target}_on_link` is {link}: expected 0 (the base) to {}; targets on the last link move with the tool and need no such entry",
        joints - 1
    )]
    NoSuchLink {
        /// 1-based.
        target: usize,
        /// As stated in the file.
        link: usize,
        /// Number of joints of the arm.
        joints: usize,
    },
    /// Two recordings contradict each other.
    #[error(
        "{file}: its TOML defines `{what}` differently from another recording; a number has one meaning in all recordings"
    )]
    Contradiction {
        /// The recording.
        file: String,
        /// The definition in question.
        what: String,
    },
    /// No measurement.
    #[error(
        "{file}: nothing was measured; a calibration needs x_mm, y_mm, z_mm, targets, ql, distances or touches"
    )]
    NothingMeasured {
        /// The recording.
        file: String,
    },
}
