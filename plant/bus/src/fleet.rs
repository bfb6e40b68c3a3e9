//! All cells on the bus as rows: one query for the last summary of each.

use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use zenoh::Wait;
use zenoh::query::QueryTarget;

use crate::keys::{self, NotAName};
use crate::message::{Kind, SCHEMA};
use crate::zenoh_bus::{BusError, Endpoints, Part, zenoh_error};

/// The cells on the bus.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Fleet {
    /// `trued.plant-fleet/1`.
    pub schema: &'static str,
    /// One row for each cell whose bridge answers, by group and name.
    pub cells: Vec<Row>,
    /// Expected cells (`GROUP/CELL`) whose bridge does not respond.
    pub missing: Vec<String>,
    /// Answers that cannot be read, with the reason.
    pub unreadable: Vec<String>,
}

/// A cell.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Row {
    /// Group of cells.
    pub group: String,
    /// The cell.
    pub cell: String,
    /// Health of the daemon; `null` if no status was ever received.
    pub health: Option<String>,
    /// Mode, likewise.
    pub mode: Option<String>,
    /// Whether the cell is bypassed.
    pub bypassed: bool,
    /// Why the daemon does not respond to its bridge; `null` if it does.
    pub away: Option<String>,
    /// The daemon's message for the operator.
    pub message: String,
    /// Present alarms.
    pub alarms: Vec<String>,
    /// Version of the daemon; `null` where unknown.
    pub daemon_version: Option<String>,
    /// Version of its bridge.
    pub bridge_version: String,
    /// Maker, type and serial number of the robot as far as its model states them.
    pub robot: String,
    /// Hash of the model in use; `null` where no status was ever received.
    pub model_hash: Option<String>,
    /// For how long the bridge has seen this model in this cell, s.
    pub model_age_s: Option<f64>,
    /// Largest root mean square of a joint's correction over the last period, rad or m.
    pub correction_rms: f64,
    /// Largest correction of a joint over its limit in the last period, 0 to 1.
    pub correction_largest_share: f64,
    /// RMS deviation of the latest measurements of the tool from the model, mm; `null` where there are none.
    pub residual_mm: Option<f64>,
    /// Time between the daemon's last status and the bridge's last summary, s; `null` where no status was ever received.
    pub heard_s: Option<f64>,
}

impl Fleet {
    /// Whether a cell is missing or has an alarm, or an answer cannot be read.
    #[must_use]
    pub fn needs_attention(&self) -> bool {
        let alarm = self.cells.iter().any(|row| !row.alarms.is_empty());
        alarm || !self.missing.is_empty() || !self.unreadable.is_empty()
    }
}

/// What is read of a message: a later version may say more.
#[derive(Debug, Deserialize)]
struct Read {
    schema: String,
    unix_ms: u64,
    group: String,
    cell: String,
    body: Body,
}

#[derive(Debug, Deserialize)]
struct Body {
    bridge_version: String,
    daemon_version: Option<String>,
    away: Option<String>,
    /// As text: a later version may have other alarms.
    alarms: Vec<String>,
    model_since_unix_ms: Option<u64>,
    correction: Correction,
    status: Option<Status>,
}

#[derive(Debug, Deserialize)]
struct Correction {
    rms: Vec<Option<f64>>,
    largest_share: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Status {
    age_s: f64,
    health: String,
    mode: String,
    bypassed: bool,
    message: String,
    robot: Robot,
    model: Model,
}

#[derive(Debug, Deserialize)]
struct Robot {
    maker: String,
    #[serde(rename = "type")]
    kind: String,
    serial: String,
}

#[derive(Debug, Deserialize)]
struct Model {
    hash: String,
    residual_mm: Option<f64>,
}

/// A summary as a row.
///
/// # Errors
/// Why this version cannot read the summary.
pub fn row(summary: &[u8]) -> Result<Row, String> {
    let read: Read = serde_json::from_slice(summary).map_err(|why| why.to_string())?;
    if read.schema != SCHEMA {
        return Err(format!("format `{}`; expected `{SCHEMA}`", read.schema));
    }
    let Body { correction, status, .. } = &read.body;
    let since = read.body.model_since_unix_ms;
    let robot = status.as_ref().map_or(String::new(), |Status { robot, .. }| {
        let parts = [&robot.maker, &robot.kind, &robot.serial].map(String::as_str);
        parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
    });
    let message = status.as_ref().map_or(String::new(), |status| status.message.clone());
    Ok(Row {
        group: read.group,
        cell: read.cell,
        health: status.as_ref().map(|status| status.health.clone()),
        mode: status.as_ref().map(|status| status.mode.clone()),
        bypassed: status.as_ref().is_some_and(|status| status.bypassed),
        message,
        robot,
        model_hash: status.as_ref().map(|status| status.model.hash.clone()),
        model_age_s: since.map(|since| read.unix_ms.saturating_sub(since) as f64 * 1e-3),
        correction_rms: correction.rms.iter().flatten().fold(0.0, |a, b| a.max(*b)),
        correction_largest_share: correction.largest_share.unwrap_or(f64::NAN),
        residual_mm: status.as_ref().and_then(|status| status.model.residual_mm),
        heard_s: status.as_ref().map(|status| status.age_s),
        away: read.body.away,
        alarms: read.body.alarms,
        daemon_version: read.body.daemon_version,
        bridge_version: read.body.bridge_version,
    })
}

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// The group cannot be part of a key.
    #[error(transparent)]
    Name(#[from] NotAName),
    /// An expected cell that is none.
    #[error("expected cell `{0}`: write GROUP/CELL")]
    Expected(String),
    /// The bus cannot be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// No bridge answers.
    #[error(
        "no cell answers on the bus; check that `trued-plant bridge` is running and connected to the same router"
    )]
    Nobody,
}

/// Which cells to query.
#[derive(Debug, Clone)]
pub struct Question {
    /// One group alone; none: all groups.
    pub group: Option<String>,
    /// Cells (`GROUP/CELL`) that are reported as missing if they do not respond.
    pub expected: Vec<String>,
    /// Timeout for answers.
    pub within: Duration,
}

/// Asks the bus.
///
/// # Errors
/// See [`FleetError`].
pub fn query_fleet(endpoints: &Endpoints, question: &Question) -> Result<Fleet, FleetError> {
    for expected in &question.expected {
        let (group, cell) =
            expected.split_once('/').ok_or_else(|| FleetError::Expected(expected.clone()))?;
        keys::Keys::new(group, cell)?;
    }
    let group = question.group.as_deref();
    group.map_or(Ok(()), |group| keys::check("group", group))?;
    let session = endpoints.open(Part::Client)?;
    let selector = format!("{}/{}/*/{}", keys::ROOT, group.unwrap_or("*"), Kind::Summary.word());
    let query = session.get(selector).target(QueryTarget::All).timeout(question.within);
    let replies = query.wait().map_err(zenoh_error("ask"))?;
    let mut fleet = Fleet {
        schema: "trued.plant-fleet/1",
        cells: Vec::new(),
        missing: Vec::new(),
        unreadable: Vec::new(),
    };
    while let Ok(reply) = replies.recv() {
        let Ok(sample) = reply.result() else { continue };
        match row(&sample.payload().to_bytes()) {
            Ok(row) => fleet.cells.push(row),
            Err(why) => fleet.unreadable.push(format!("{}: {why}", sample.key_expr())),
        }
    }
    if fleet.cells.is_empty() && fleet.unreadable.is_empty() && question.expected.is_empty() {
        return Err(FleetError::Nobody);
    }
    fleet.cells.sort_by(|a, b| (&a.group, &a.cell).cmp(&(&b.group, &b.cell)));
    let is_there = |name: &&String| {
        fleet.cells.iter().any(|row| format!("{}/{}", row.group, row.cell) == **name)
    };
    fleet.missing = question.expected.iter().filter(|name| !is_there(name)).cloned().collect();
    Ok(fleet)
}
