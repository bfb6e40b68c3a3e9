//! Reads `trued.bridge-egm/1`: all keys with ranges and defaults.

use std::net::{Ipv4Addr, SocketAddr};

use super::{EGM_SCHEMA, EgmConfig, Guidance, SOCKET, address, common};
use crate::faults::Faults;
use crate::series::CoordinateFrame;
use crate::toml_reader::{Document, Table};

/// Default port of EGM controllers.
const PORT: u16 = 6510;
/// Path corrections are accepted at multiples of this period, ms.
const PATH_STEP_MS: f64 = 24.0;

pub(super) fn parse(name: &str, text: &str) -> Result<EgmConfig, Faults> {
    let document = Document::parse(name, text)?;
    let config = read(&document.root());
    document.finish(config)
}

fn read(root: &Table<'_, '_>) -> Option<EgmConfig> {
    root.require("robot", "a table [robot] with the controller's address");
    root.require(
        "guidance",
        "\"joints\" (an application streams targets) or \"path\" (RAPID moves)",
    );
    let guidance =
        root.choice("guidance", &[("joints", Guidance::Joints), ("path", Guidance::Path)]);
    let robot = root.table("robot");
    let common = robot.as_ref().and_then(|robot| common(root, EGM_SCHEMA, robot));
    let any = |port| SocketAddr::from((Ipv4Addr::UNSPECIFIED, port));
    let listen = robot.as_ref().and_then(|robot| address(robot, "listen", SOCKET));
    let port = robot.as_ref().and_then(|robot| robot.whole("port", 1..65_536));
    let seventh = robot.as_ref().and_then(|robot| robot.whole("seventh_after", 1..7));
    if let Some(robot) = &robot {
        robot.close();
    }
    let application = root.table("application").map(|table| application(&table, any(0)));
    if guidance == Some(Guidance::Joints) && application.is_none() {
        root.fault(
            "guidance",
            "needs an application that streams targets",
            "a table [application] with its address",
        );
    }
    let path_period_ms = root.table("path").map(|table| path_period_ms(&table));
    let force = root.table("force").and_then(|table| force(&table));
    root.close();
    Some(EgmConfig {
        common: common?,
        guidance: guidance?,
        listen: listen.unwrap_or(any(PORT)),
        robot_port: port.and_then(|port| u16::try_from(port).ok()),
        application: application.flatten(),
        seventh_after: seventh.and_then(|axes| usize::try_from(axes).ok()),
        path_period_s: path_period_ms.unwrap_or(2.0 * PATH_STEP_MS) * 1e-3,
        force,
    })
}

fn application(table: &Table<'_, '_>, any: SocketAddr) -> Option<(SocketAddr, SocketAddr)> {
    table.require(
        "address",
        "the address on which the application listens, like \"127.0.0.1:6511\"",
    );
    let theirs = address(table, "address", "an address with a port, like \"127.0.0.1:6511\"");
    let ours = address(table, "local", SOCKET);
    table.close();
    Some((theirs?, ours.unwrap_or(any)))
}

fn path_period_ms(table: &Table<'_, '_>) -> f64 {
    let period = table.number("period_ms", PATH_STEP_MS..=1000.0);
    if let Some(odd) = period.filter(|period| period % PATH_STEP_MS != 0.0) {
        table.fault(
            "period_ms",
            format!("is {odd}"),
            "a multiple of 24 ms, equal to the controller's SampleRate",
        );
    }
    table.close();
    period.unwrap_or(2.0 * PATH_STEP_MS)
}

fn force(table: &Table<'_, '_>) -> Option<CoordinateFrame> {
    let is_enabled = table.flag("enabled").unwrap_or(true);
    let frame =
        table.choice("frame", &[("tool", CoordinateFrame::Tool), ("base", CoordinateFrame::Base)]);
    table.close();
    is_enabled.then(|| frame.unwrap_or(CoordinateFrame::Tool))
}
