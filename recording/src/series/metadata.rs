//! Metadata of a recording: `NAME.toml` in the same folder, or the `[recording]` table of a
//! mapping.
//!
//! Format: docs/reference/recording.md. Values SI. Unknown keys are faults.

use std::collections::BTreeMap;

use toml::de::DeValue;

use super::channel::{Channel, Column, JOINTS_MAX, TARGETS_MAX};
use super::gauges::Gauges;
use crate::faults::Faults;
use crate::toml_reader::{Document, POSITIVE, Table, number_of};

/// Name of the format.
pub(crate) const SCHEMA: &str = "trued.recording/1";

/// Meaning of the rows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum RecordingKind {
    /// A path in time.
    #[default]
    Path,
    /// A settled pose in each row.
    Poses,
}

/// Which joint positions are the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputKind {
    /// Commanded, `q`.
    Command,
    /// Measured on the motor side, `qa`.
    Motor,
}

/// A frame that a quantity may be given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CoordinateFrame {
    /// The robot's base.
    Base,
    /// The tool.
    Tool,
}

/// Source of the direction of the last motion at poses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum DirectionSource {
    /// Columns `d1` ….
    Columns,
    /// From the row before.
    Sequence,
    /// Unknown: lost motion cannot be identified.
    #[default]
    Unknown,
}

/// Test data: rows for validation only, excluded from every fit.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum HeldOut {
    /// Not stated: the command chooses.
    #[default]
    Unspecified,
    /// These segments.
    Segments(Vec<i64>),
    /// The whole file.
    All,
}

/// The cut, in the force domain. Files give mm, degrees, N/mm², N/mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// Number of teeth.
    pub teeth: u32,
    /// Diameter of the tool, m.
    pub diameter_m: f64,
    /// Helix angle, rad.
    pub helix_rad: f64,
    /// Axial depth of cut, m.
    pub axial_depth_m: f64,
    /// Angle at which a tooth enters, rad.
    pub entry_rad: f64,
    /// Angle at which a tooth leaves, rad.
    pub exit_rad: f64,
    /// Tangential, radial, axial cutting coefficients, N/m².
    pub cutting_pa: [f64; 3],
    /// Tangential, radial, axial edge coefficients, N/m.
    pub edge_n_per_m: [f64; 3],
    /// Turning (`operation = "turning"`): the workpiece rotates, and the tool does not.
    pub turning: bool,
}

impl Cut {
    /// The cutter for `physics`.
    #[must_use]
    pub fn cutter(&self) -> physics::Cutter {
        physics::Cutter {
            teeth: self.teeth,
            diameter_m: self.diameter_m,
            helix_rad: self.helix_rad,
            axial_depth_m: self.axial_depth_m,
            entry_rad: self.entry_rad,
            exit_rad: self.exit_rad,
            turning: self.turning,
            chip_n_m2: self.cutting_pa.into(),
            edge_n_m: self.edge_n_per_m.into(),
        }
    }
}

/// Metadata of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordingMetadata {
    /// The model of the robot; the command line takes precedence.
    pub model: Option<String>,
    /// Path or poses.
    pub kind: RecordingKind,
    /// Which positions are the input; by default `q`, if it exists.
    pub input: Option<InputKind>,
    /// Whether measured positions are in the base frame; otherwise the measuring frame is unknown.
    pub measured_in_base: bool,
    /// The axes of the wrench; by default the tool's.
    pub wrench_frame: Option<CoordinateFrame>,
    /// Instruments' standard uncertainty per column, SI.
    pub sigma: BTreeMap<Channel, f64>,
    /// Source of the direction of approach.
    pub approach: DirectionSource,
    /// Torque (force) at the joint per ampere, N m/A (N/A).
    pub torque_per_ampere: Vec<f64>,
    /// Known positions of targets, m, tool frame; by target from 0.
    pub targets_tool: BTreeMap<usize, [f64; 3]>,
    /// Targets that sit on the base (0) or on the link that a joint (from 1) moves, instead of the tool; by target from 0.
    pub targets_on_link: BTreeMap<usize, usize>,
    /// Test data, for validation only.
    pub heldout: HeldOut,
    /// The cut, for the force domain.
    pub cut: Option<Cut>,
    /// References of distances, and touched objects.
    pub gauges: Gauges,
}

impl RecordingMetadata {
    /// Reads the TOML of a recording.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Faults> {
        let document = Document::parse(name, text)?;
        let root = document.root();
        root.require("schema", "schema = \"trued.recording/1\"");
        root.choice("schema", &[(SCHEMA, ())]);
        let about = Self::from_table(&root);
        document.finish(Some(about))
    }

    /// Reads the keys out of a table and closes it.
    pub(crate) fn from_table(table: &Table<'_, '_>) -> Self {
        let kinds = [("path", RecordingKind::Path), ("poses", RecordingKind::Poses)];
        let inputs = [("q", InputKind::Command), ("qa", InputKind::Motor)];
        let approaches = [
            ("columns", DirectionSource::Columns),
            ("sequence", DirectionSource::Sequence),
            ("unknown", DirectionSource::Unknown),
        ];
        let about = Self {
            model: table.text("model").map(str::to_owned),
            kind: table.choice("kind", &kinds).unwrap_or_default(),
            input: table.choice("input", &inputs),
            measured_in_base: table
                .choice("measuring_frame", &[("unknown", false), ("base", true)])
                .unwrap_or_default(),
            wrench_frame: table.choice(
                "wrench_frame",
                &[("tool", CoordinateFrame::Tool), ("base", CoordinateFrame::Base)],
            ),
            sigma: sigma_of(table),
            approach: table.choice("approach", &approaches).unwrap_or_default(),
            torque_per_ampere: table.numbers("torque_per_ampere", ..).unwrap_or_default(),
            targets_tool: targets_of(table),
            targets_on_link: links_of(table),
            heldout: heldout_of(table),
            cut: table.table("cut").and_then(|cut| read_cut(&cut)),
            gauges: Gauges::of(table),
        };
        table.close();
        about
    }
}

fn sigma_of(table: &Table<'_, '_>) -> BTreeMap<Channel, f64> {
    let mut sigma = BTreeMap::new();
    let Some(entries) = table.free_table("sigma") else { return sigma };
    for (key, value) in entries {
        let name = key.get_ref().as_ref();
        let number = number_of(value.get_ref()).filter(|number| *number > 0.0);
        match (Column::named(name), number.filter(|number| number.is_finite())) {
            (Ok(Column::Channel(channel, unit)), Some(number)) => {
                sigma.insert(channel, unit.map_or(number, |unit| unit.to_si(number)));
            }
            (Ok(Column::Channel(..)), None) => {
                table.fault("sigma", format!("`{name}` is not a number above zero"), "above zero");
            }
            (Err(expected), _) => {
                table.fault("sigma", format!("`{name}` has a wrong unit"), expected);
            }
            (Ok(_), _) => table.fault(
                "sigma",
                format!("`{name}` is not a column of a recording"),
                "column names such as x_mm or q1_deg",
            ),
        }
    }
    sigma
}

fn targets_of(table: &Table<'_, '_>) -> BTreeMap<usize, [f64; 3]> {
    let mut targets = BTreeMap::new();
    for target in 0..TARGETS_MAX {
        let key = format!("target{}_mm", target + 1);
        // Only existing ones are read: the others would fill every help text.
        if table.keys().any(|name| name == key)
            && let Some(place) = table.vector::<3>(&key)
        {
            targets.insert(target, place.map(|mm| mm * 1e-3));
        }
    }
    targets
}

fn links_of(table: &Table<'_, '_>) -> BTreeMap<usize, usize> {
    let mut links = BTreeMap::new();
    for target in 0..TARGETS_MAX {
        let key = format!("target{}_on_link", target + 1);
        if table.keys().any(|name| name == key)
            && let Some(link) = table.whole(&key, 0..JOINTS_MAX as i64)
        {
            links.extend(usize::try_from(link).ok().map(|link| (target, link)));
        }
    }
    links
}

fn heldout_of(table: &Table<'_, '_>) -> HeldOut {
    match table.raw("heldout").map(toml::Spanned::get_ref) {
        None => HeldOut::Unspecified,
        Some(DeValue::String(keyword)) if keyword == "all" => HeldOut::All,
        Some(DeValue::Array(_)) => table
            .wholes("heldout", i64::from(i32::MIN)..i64::from(i32::MAX))
            .map_or(HeldOut::Unspecified, HeldOut::Segments),
        Some(value) => {
            let message = format!("is of type {}", value.type_str());
            table.fault("heldout", message, "a list of segments, or \"all\"");
            HeldOut::Unspecified
        }
    }
}

/// The largest arc in which a tooth cuts.
const FULL_TURN_DEG: f64 = 360.0;

/// The cut of a table `[cut]`.
pub(crate) fn read_cut(table: &Table<'_, '_>) -> Option<Cut> {
    for key in ["teeth", "diameter_mm", "axial_depth_mm"] {
        table.require(key, "a number above zero");
    }
    for key in ["coefficients_N_per_mm2", "coefficients_N_per_mm"] {
        table.require(key, "three numbers: tangential, radial, axial");
    }
    let teeth = table.whole("teeth", 1..1000);
    let diameter = table.number("diameter_mm", POSITIVE);
    let helix = table.number("helix_deg", -89.0..=89.0).unwrap_or(0.0);
    let depth = table.number("axial_depth_mm", POSITIVE);
    let entry = table.number("entry_deg", -360.0..=360.0).unwrap_or(0.0);
    let exit = table.number("exit_deg", -360.0..=360.0).unwrap_or(180.0);
    let cutting = table.vector::<3>("coefficients_N_per_mm2");
    let edge = table.vector::<3>("coefficients_N_per_mm");
    let turning = table.choice("operation", &[("milling", false), ("turning", true)]);
    let turning = turning.unwrap_or_default();
    if turning && teeth.is_some_and(|teeth| teeth != 1) {
        table.fault("teeth", "1, for a turning tool".to_owned(), "teeth = 1");
    }
    if entry >= exit {
        table.fault("exit_deg", format!("is {exit}"), format!("more than entry_deg ({entry})"));
    } else if exit - entry > FULL_TURN_DEG {
        let found = format!("is {exit}, {}° after entry_deg ({entry})", exit - entry);
        table.fault("exit_deg", found, "at most a full turn, 360°, after entry_deg");
    }
    table.close();
    Some(Cut {
        teeth: u32::try_from(teeth?).ok()?,
        diameter_m: diameter? * 1e-3,
        helix_rad: helix.to_radians(),
        axial_depth_m: depth? * 1e-3,
        entry_rad: entry.to_radians(),
        exit_rad: exit.to_radians(),
        cutting_pa: cutting?.map(|value| value * 1e6),
        edge_n_per_m: edge?.map(|value| value * 1e3),
        turning,
    })
}
