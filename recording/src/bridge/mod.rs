//! The configurations of the bridges, `trued.bridge-egm/1` and `trued.bridge-rsi/1`, and the controller's own RSI
//! configuration: parsed and validated.
//!
//! Format: docs/reference/bridge.md. A valid configuration has every value in range, in SI; all
//! errors of a file are reported. Values that depend on the model (number of joints) are checked
//! where the model is known.

mod egm;
mod ethernet;
mod rsi;
#[cfg(test)]
mod tests;

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use crate::faults::Faults;
use crate::files::{FileError, read_text};
use crate::series::CoordinateFrame;
use crate::toml_reader::Table;
use crate::xml;

pub use ethernet::{Element, EthernetConfig};
pub use rsi::Group;

/// Names of the formats.
pub const EGM_SCHEMA: &str = "trued.bridge-egm/1";
/// See [`EGM_SCHEMA`].
pub const RSI_SCHEMA: &str = "trued.bridge-rsi/1";

/// What EGM corrects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Guidance {
    /// Joint targets that an application streams.
    Joints,
    /// A RAPID path, corrected across its direction.
    Path,
}

/// What both bridges need.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonConfig {
    /// The cell's configuration.
    pub cell: PathBuf,
    /// The controller compensates its robot itself.
    pub absolute_accuracy: bool,
    /// The controller's address; datagrams of others are foreign.
    pub robot: IpAddr,
    /// Time limit for an answer of the daemon, s.
    pub answer_within_s: f64,
    /// Time without datagrams after which the controller's run has ended, s.
    pub run_ends_after_s: f64,
}

/// `trued.bridge-egm/1`.
#[derive(Debug, Clone, PartialEq)]
pub struct EgmConfig {
    /// What both bridges need.
    pub common: CommonConfig,
    /// What is corrected.
    pub guidance: Guidance,
    /// Where the controller sends.
    pub listen: SocketAddr,
    /// The port of the mechanical unit that is served; `None`: the first one that sends.
    pub robot_port: Option<u16>,
    /// The existing application, and the bridge's own address towards it.
    pub application: Option<(SocketAddr, SocketAddr)>,
    /// Number of axes before the seventh one; `None`: six axes.
    pub seventh_after: Option<usize>,
    /// Least time between two path corrections, s.
    pub path_period_s: f64,
    /// Measured force is sent to the vibration monitor, in these axes.
    pub force: Option<CoordinateFrame>,
}

/// How RSI accumulates corrections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accumulation {
    /// What is sent is the whole correction.
    Absolute,
    /// Corrections are added to the previous ones.
    Relative,
}

/// What RSI corrects.
#[derive(Debug, Clone, PartialEq)]
pub enum RsiCorrection {
    /// Axes, degrees.
    Axes(Group),
    /// The tool's pose, mm and degrees (Z-Y-X), about the TCP, in these axes.
    Pose(Group, CoordinateFrame),
}

/// `trued.bridge-rsi/1`, with the controller's own configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct RsiConfig {
    /// What both bridges need.
    pub common: CommonConfig,
    /// Where the controller sends.
    pub listen: SocketAddr,
    /// Elements sent and received, from the controller's own file.
    pub ethernet: EthernetConfig,
    /// The program's axis setpoints, degrees.
    pub setpoint: Group,
    /// The setpoint as sent contains the correction already.
    pub setpoint_holds_correction: bool,
    /// What is corrected.
    pub correction: RsiCorrection,
    /// How corrections accumulate.
    pub sums: Accumulation,
    /// Where the controller takes the feed override, percent of the programmed feed.
    pub feed: Option<Element>,
    /// Every other element that the controller receives, and its value.
    pub others: Vec<(Element, f64)>,
}

impl EgmConfig {
    /// Reads a configuration; relative paths in it count from its folder.
    ///
    /// # Errors
    /// The file cannot be read, or all its faults.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let mut config = Self::parse(&path.display().to_string(), &read_text(path)?)?;
        config.common.cell = beside(path, &config.common.cell);
        Ok(config)
    }

    /// Reads a configuration from a text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        egm::parse(name, text)
    }
}

impl RsiConfig {
    /// Reads a configuration and the controller's; relative paths in it refer to its folder.
    ///
    /// # Errors
    /// A file cannot be read, or all its errors.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let (name, text) = (path.display().to_string(), read_text(path)?);
        let ethernet = beside(path, &rsi::ethernet_path(&name, &text)?);
        let ethernet =
            EthernetConfig::parse(&ethernet.display().to_string(), &xml::read(&ethernet)?.text)?;
        let mut config = Self::parse(&name, &text, ethernet)?;
        config.common.cell = beside(path, &config.common.cell);
        Ok(config)
    }

    /// Reads a configuration from a text, with the controller's own.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str, ethernet: EthernetConfig) -> Result<Self, Faults> {
        rsi::parse(name, text, ethernet)
    }
}

fn beside(path: &Path, named: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).join(named)
}

/// What both bridges need, from the root, its `[robot]` and its `[timing]`.
fn common(root: &Table<'_, '_>, schema: &str, robot: &Table<'_, '_>) -> Option<CommonConfig> {
    root.require("schema", schema);
    root.require("cell", "the path of the cell's configuration");
    root.require(
        "absolute_accuracy",
        "\"off\", or \"on\" if the controller compensates its robot itself; the bridge then does not correct",
    );
    root.choice("schema", &[(schema, ())]);
    let cell = root.text("cell").map(PathBuf::from);
    let accuracy = root.choice("absolute_accuracy", &[("off", false), ("on", true)]);
    robot.require("address", "the controller's address, like \"192.168.125.1\"");
    let address = address(robot, "address", "an address, like \"192.168.125.1\"");
    let timing = root.table("timing");
    let number = |key, range| timing.as_ref().and_then(|table| table.number(key, range));
    let within_ms = number("answer_within_ms", 0.05..=100.0);
    let run_ends_after_ms = number("run_ends_after_ms", 400.0..=10_000.0);
    if let Some(table) = timing {
        table.close();
    }
    Some(CommonConfig {
        cell: cell?,
        absolute_accuracy: accuracy?,
        robot: address?,
        answer_within_s: within_ms.unwrap_or(1.0) * 1e-3,
        run_ends_after_s: run_ends_after_ms.unwrap_or(1000.0) * 1e-3,
    })
}

/// An address with or without a port.
fn address<T: std::str::FromStr>(table: &Table<'_, '_>, key: &str, expected: &str) -> Option<T> {
    let text = table.text(key)?;
    let parsed = text.parse().ok();
    if parsed.is_none() {
        table.fault(key, format!("is \"{text}\""), expected);
    }
    parsed
}

const SOCKET: &str = "an address with a port, like \"0.0.0.0:6510\"";
