//! Import and export of URDF.
//!
//! Format: the URDF specification (ROS wiki, `urdf/XML`): joint and link frames by `<origin>`, axes
//! in the joint's frame, SI units. A model describes the chain from a base link to a tip link: its
//! axes and points are those of the URDF with all joints at zero, in the base link's frame; the tip
//! link is the tool. All errors of a file are reported at once, each with its joint or link; no
//! text causes a panic; import and export keep the forward kinematics to rounding.

mod bodies;
mod ends;
mod export;
#[cfg(test)]
mod hostile_tests;
mod import;
#[cfg(test)]
mod real_tests;
mod rpy;
mod source;
mod telescope;
#[cfg(test)]
mod tests;
mod tree;

use std::path::Path;

pub use export::{Export, OmittedPart, export};
pub use import::parse;

use crate::files::FileError;
use crate::model::RobotModel;
use crate::xml;

/// Which chain of a URDF is the arm.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ChainEnds<'a> {
    /// The fixed link; by default the root above the tip.
    pub base: Option<&'a str>,
    /// The link of the tool; by default the only leaf that moves.
    pub tip: Option<&'a str>,
}

/// A model imported from a URDF.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The model, without effects.
    pub model: RobotModel,
    /// The link whose frame is the model's base frame.
    pub base: String,
    /// The link whose frame is the tool's.
    pub tip: String,
    /// Deviations from the file, one sentence each.
    pub notes: Vec<String>,
}

/// Reads the arm between two links of a URDF file.
///
/// # Errors
/// The file cannot be read, or all its faults.
pub fn read(path: &Path, ends: &ChainEnds<'_>) -> Result<Import, FileError> {
    let xml::Decoded { text, assumed } = xml::read(path)?;
    let mut import = parse(&path.display().to_string(), &text, ends)?;
    if let Some(encoding) = assumed {
        let remark = format!("the file is not UTF-8 and declares nothing else: read as {encoding}");
        import.notes.push(remark);
    }
    Ok(import)
}
