//! Reads `trued.bridge-rsi/1`: all keys with ranges and defaults, checked against the controller's
//! configuration.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use super::{
    Accumulation, Element, EthernetConfig, RSI_SCHEMA, RsiConfig, RsiCorrection, SOCKET, address,
    common,
};
use crate::faults::Faults;
use crate::series::CoordinateFrame;
use crate::toml_reader::{Document, Table, number_of};

const AXES: [&str; 6] = ["A1", "A2", "A3", "A4", "A5", "A6"];
/// Limit on constants; with longer numbers an answer would not fit into a datagram.
const CONSTANT_MAX: f64 = 1e9;
const POSE: [&str; 6] = ["X", "Y", "Z", "A", "B", "C"];

/// An element with several values: `<AKorr A1=".." A2=".." />`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its tag.
    pub tag: String,
    /// Its attributes, in the order of the joints, or of x, y, z, A, B, C.
    pub names: Vec<String>,
}

/// Path of the controller's own configuration.
pub(super) fn ethernet_path(name: &str, text: &str) -> Result<PathBuf, Faults> {
    let document = Document::parse(name, text)?;
    let root = document.root();
    let path = root.text("ethernet").map(PathBuf::from);
    if path.is_none() {
        root.fault("ethernet", "is missing", "the path of the controller's RSI_EthernetConfig.xml");
    }
    document.finish(path)
}

pub(super) fn parse(name: &str, text: &str, ethernet: EthernetConfig) -> Result<RsiConfig, Faults> {
    let document = Document::parse(name, text)?;
    let config = read(&document.root(), ethernet);
    document.finish(config)
}

fn read(root: &Table<'_, '_>, ethernet: EthernetConfig) -> Option<RsiConfig> {
    root.require("ethernet", "the path of the controller's RSI_EthernetConfig.xml");
    root.text("ethernet");
    for (key, expected) in [
        ("robot", "a table [robot] with the controller's address"),
        ("setpoint", "a table [setpoint]: the axis setpoints of the program"),
        ("correction", "a table [correction]: kind of the correction, absolute or relative"),
    ] {
        root.require(key, expected);
    }
    let robot = root.table("robot");
    let common = robot.as_ref().and_then(|robot| common(root, RSI_SCHEMA, robot));
    let listen = robot.as_ref().and_then(|robot| address(robot, "listen", SOCKET));
    if let Some(robot) = &robot {
        robot.close();
    }
    let setpoint = root.table("setpoint").map(|table| setpoint(&table, &ethernet));
    let correction = root.table("correction").map(|table| correction(&table, &ethernet));
    let own_group = correction.as_ref().and_then(|(group, _)| group.as_ref()).map(group_of);
    let feed = root.table("feed").and_then(|table| feed(&table, &ethernet));
    let others = others(root, &ethernet, own_group, feed.as_ref());
    root.close();
    let (setpoint, setpoint_holds_correction) = setpoint?;
    let (correction, sums) = correction?;
    let any = SocketAddr::from((Ipv4Addr::UNSPECIFIED, ethernet.port));
    Some(RsiConfig {
        common: common?,
        listen: listen.unwrap_or(any),
        setpoint: setpoint?,
        setpoint_holds_correction: setpoint_holds_correction?,
        correction: correction?,
        sums: sums?,
        feed,
        others,
        ethernet,
    })
}

fn group_of(correction: &RsiCorrection) -> &Group {
    match correction {
        RsiCorrection::Axes(group) | RsiCorrection::Pose(group, _) => group,
    }
}

/// A tag with its attributes: as configured, otherwise those of KUKA's standard group.
fn group(table: &Table<'_, '_>, tag: &str, usual: [&str; 6]) -> Group {
    let tag = table.text("tag").unwrap_or(tag).to_owned();
    let given = if table.has("names") { table.texts("names") } else { None };
    let names = given.unwrap_or_else(|| usual.to_vec());
    if names.is_empty() || names.len() > 6 {
        table.fault("names", format!("has {} names", names.len()), "1 to 6 attributes");
    }
    let twice = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
    if let Some((_, name)) = twice {
        table.fault("names", format!("lists {name} twice"), "each attribute once, one per joint");
    }
    Group { tag, names: names.into_iter().map(str::to_owned).collect() }
}

fn setpoint(table: &Table<'_, '_>, ethernet: &EthernetConfig) -> (Option<Group>, Option<bool>) {
    table.require(
        "holds_correction",
        "true if the controller's setpoint already includes the correction, otherwise false",
    );
    let group = group(table, "ASPos", AXES);
    let whole = ethernet.find_sent(&group.tag).is_some_and(|element| element.is_internal);
    let missing = group.names.iter().map(|name| format!("{}.{name}", group.tag));
    let missing = missing.into_iter().find(|tag| ethernet.find_sent(tag).is_none());
    if let (false, Some(missing)) = (whole, missing) {
        table.fault_here(
            format!("the controller does not send {} (nor {missing}): {}", group.tag, ethernet.name),
            format!("add <ELEMENT TAG=\"DEF_{}\" TYPE=\"DOUBLE\" INDX=\"INTERNAL\" /> to SEND in that file, or set another tag here", group.tag),
        );
    }
    let holds = table.flag("holds_correction");
    table.close();
    (Some(group), holds)
}

fn correction(
    table: &Table<'_, '_>,
    ethernet: &EthernetConfig,
) -> (Option<RsiCorrection>, Option<Accumulation>) {
    table.require("kind", "\"axes\" (AXISCORR) or \"pose\" (POSCORR)");
    table.require("sums", "\"absolute\" or \"relative\", as in RSI_ON of the robot program");
    let is_pose = table.choice("kind", &[("axes", false), ("pose", true)]);
    let sums = table.choice(
        "sums",
        &[("absolute", Accumulation::Absolute), ("relative", Accumulation::Relative)],
    );
    let frames = [("base", CoordinateFrame::Base), ("tool", CoordinateFrame::Tool)];
    let correction = match is_pose {
        Some(true) => {
            table.require("frame", "\"base\" (ROBROOT) or \"tool\", as in RefCorrSys of POSCORR");
            let frame = table.choice("frame", &frames);
            let group = group(table, "RKorr", POSE);
            if group.names.len() != POSE.len() {
                table.fault(
                    "names",
                    format!("has {} names", group.names.len()),
                    "x, y, z, A, B, C: six names",
                );
            }
            frame.map(|frame| RsiCorrection::Pose(group, frame))
        }
        Some(false) => Some(RsiCorrection::Axes(group(table, "AKorr", AXES))),
        None => None,
    };
    if let (Some(correction), Some(sums)) = (&correction, sums) {
        check_correction_elements(table, ethernet, group_of(correction), sums);
    }
    table.close();
    (correction, sums)
}

/// Checks that the controller receives this correction, and what it does if an answer is late.
fn check_correction_elements(
    table: &Table<'_, '_>,
    ethernet: &EthernetConfig,
    group: &Group,
    sums: Accumulation,
) {
    for name in &group.names {
        let tag = format!("{}.{name}", group.tag);
        let Some(element) = ethernet.find_received(&tag) else {
            table.fault_here(
                format!("the controller does not receive {tag}: {}", ethernet.name),
                format!("add <ELEMENT TAG=\"{tag}\" TYPE=\"DOUBLE\" INDX=\"…\" HOLDON=\"1\" /> to RECEIVE in that file, and connect it"),
            );
            continue;
        };
        let line = element.place.line;
        match (sums, element.holds) {
            (Accumulation::Absolute, false) => table.fault_here(
                format!(
                    "{tag} becomes zero if a reply is late, and the robot jumps: {} line {line}",
                    ethernet.name
                ),
                "set HOLDON=\"1\" in that line",
            ),
            (Accumulation::Relative, true) => table.fault_here(
                format!(
                    "{tag} is added again if a reply is late, and the robot drifts: {} line {line}",
                    ethernet.name
                ),
                "set HOLDON=\"0\" in that line, or use sums = \"absolute\"",
            ),
            _ => {}
        }
    }
    if ethernet.find_sent("Delay").is_none() {
        table.fault_here(
            format!("requires the controller's count of late replies: {}", ethernet.name),
            "add <ELEMENT TAG=\"DEF_Delay\" TYPE=\"LONG\" INDX=\"INTERNAL\" /> to SEND in that file; it distinguishes a network failure from a new run",
        );
    }
}

/// Where the controller takes the feed override.
fn feed(table: &Table<'_, '_>, ethernet: &EthernetConfig) -> Option<Element> {
    table.require("tag", "the element of RECEIVE that is connected to MAP2OV_PRO");
    let tag = table.text("tag");
    table.close();
    let tag = tag?;
    let Some(element) = ethernet.find_received(tag) else {
        table.fault(
            "tag",
            format!("is {tag}, which the controller does not receive: {}", ethernet.name),
            format!("<ELEMENT TAG=\"{tag}\" TYPE=\"LONG\" INDX=\"…\" HOLDON=\"1\" /> in RECEIVE there, connected to MAP2OV_PRO"),
        );
        return None;
    };
    if !element.holds {
        let line = element.place.line;
        table.fault(
            "tag",
            format!(
                "{tag} becomes zero if a reply is late, and the robot stops: {} line {line}",
                ethernet.name
            ),
            "HOLDON=\"1\" there",
        );
    }
    Some(element.clone())
}

/// Everything else that the controller receives must have a value.
fn others(
    root: &Table<'_, '_>,
    ethernet: &EthernetConfig,
    own_group: Option<&Group>,
    feed: Option<&Element>,
) -> Vec<(Element, f64)> {
    let table = root.table("others");
    let mut others = Vec::new();
    let is_own = |tag: &str| {
        feed.is_some_and(|feed| feed.tag == tag)
            || own_group.is_some_and(|own_group| {
                tag.split_once('.').is_some_and(|(group, name)| {
                    group == own_group.tag && own_group.names.iter().any(|one| one == name)
                })
            })
    };
    for element in ethernet.receive.iter().filter(|element| !element.is_internal) {
        if element.tag == "FREE" || is_own(&element.tag) {
            continue;
        }
        if element.tag.split('.').next() == Some("IPOC") {
            root.fault(
                "ethernet",
                format!("IPOC is listed in RECEIVE: {} line {}", ethernet.name, element.place.line),
                "remove it from RECEIVE; every reply contains the controller's own",
            );
            continue;
        }
        let value = table.as_ref().and_then(|table| {
            let value = table.raw(&element.tag)?;
            let number = number_of(value.get_ref()).filter(|number| number.abs() <= CONSTANT_MAX);
            if number.is_none() {
                let expected = "a number up to 1e9, the constant to send to the controller";
                table.fault(&element.tag, "is not a number that can be sent", expected);
            }
            number
        });
        let is_given = table.as_ref().is_some_and(|table| table.has(&element.tag));
        match value {
            Some(value) => others.push((element.clone(), value)),
            None if !is_given => root.fault(
                "others",
                format!(
                    "has no value for {}, which the controller receives: {} line {}",
                    element.tag, ethernet.name, element.place.line
                ),
                format!(
                    "\"{}\" = 0.0 (or another constant) under [others], or remove it from RECEIVE",
                    element.tag
                ),
            ),
            None => {}
        }
    }
    if let Some(table) = table {
        table.close();
    }
    others
}
