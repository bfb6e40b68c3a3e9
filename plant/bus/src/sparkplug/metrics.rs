//! Kept messages as Sparkplug metrics: a table of names, types and places in the message.
//!
//! A summary becomes the metrics of the device, an event or a change of health one metric of the node with its body as JSON. Every metric of the table is in every message, without a value where it is unknown,
//! so that a birth names all metrics whatever has come before.

use serde_json::Value as Json;

use super::payload::{DataType, Metric, Value};

/// A metric of the device.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Name.
    pub name: &'static str,
    /// Type.
    pub datatype: DataType,
    /// Place in the message, as a JSON pointer.
    pub place: &'static str,
}

const fn row(name: &'static str, datatype: DataType, place: &'static str) -> Row {
    Row { name, datatype, place }
}

/// Metrics of the device: the cell's summary.
pub const DEVICE: &[Row] = &[
    row("number", DataType::Int64, "/number"),
    row("away", DataType::String, "/body/away"),
    row("alarms", DataType::String, "/body/alarms"),
    row("daemon_version", DataType::String, "/body/daemon_version"),
    row("health", DataType::String, "/body/status/health"),
    row("mode", DataType::String, "/body/status/mode"),
    row("bypassed", DataType::Boolean, "/body/status/bypassed"),
    row("message", DataType::String, "/body/status/message"),
    row("robot/maker", DataType::String, "/body/status/robot/maker"),
    row("robot/type", DataType::String, "/body/status/robot/type"),
    row("robot/serial", DataType::String, "/body/status/robot/serial"),
    row("model/hash", DataType::String, "/body/status/model/hash"),
    row("model/since_unix_ms", DataType::Int64, "/body/model_since_unix_ms"),
    row("model/holds", DataType::Boolean, "/body/status/model/holds"),
    row("model/residual_mm", DataType::Double, "/body/status/model/residual_mm"),
    row("correction/rms", DataType::Double, "/body/correction/rms"),
    row("correction/largest", DataType::Double, "/body/correction/largest"),
    row("correction/largest_share", DataType::Double, "/body/correction/largest_share"),
    row("counts/cycles", DataType::Int64, "/body/status/counts/cycles"),
    row("counts/missed_cycles", DataType::Int64, "/body/status/counts/missed_cycles"),
    row("counts/commands", DataType::Int64, "/body/status/counts/commands"),
    row("counts/rejected", DataType::Int64, "/body/status/counts/rejected"),
    row("latency_us/p999", DataType::Double, "/body/status/latency_us/p999"),
    row("vibration/line", DataType::String, "/body/status/vibration/line"),
    row("recorder", DataType::String, "/body/status/recorder"),
    row("trim/state", DataType::String, "/body/status/trim/state"),
    row("feed/override_percent", DataType::Double, "/body/status/feed/override_percent"),
];

/// Metrics of the node: what happened.
pub const NODE: &[Row] = &[
    row("number", DataType::Int64, "/number"),
    row("event", DataType::String, "/body"),
    row("health", DataType::String, "/body"),
];

/// A metric without a value.
fn empty(row: &Row, unix_ms: u64) -> Metric {
    Metric {
        name: Some(row.name.to_owned()),
        timestamp: Some(unix_ms),
        datatype: Some(row.datatype as u32),
        is_historical: None,
        is_null: Some(true),
        value: None,
    }
}

/// A metric with a value.
#[must_use]
pub fn metric(name: &str, datatype: DataType, value: Value, unix_ms: u64) -> Metric {
    Metric {
        name: Some(name.to_owned()),
        timestamp: Some(unix_ms),
        datatype: Some(datatype as u32),
        is_historical: None,
        is_null: None,
        value: Some(value),
    }
}

/// The value at a place; of a list of numbers the largest, of other lists the members with commas between them.
fn value(found: &Json, datatype: DataType) -> Option<Value> {
    match (datatype, found) {
        (DataType::Int64, found) => found.as_u64().map(Value::Long),
        (DataType::Double, Json::Array(list)) => {
            let numbers = list.iter().filter_map(Json::as_f64);
            numbers.reduce(f64::max).map(Value::Double)
        }
        (DataType::Double, found) => found.as_f64().map(Value::Double),
        (DataType::Boolean, found) => found.as_bool().map(Value::Boolean),
        (DataType::String, Json::String(text)) => Some(Value::String(text.clone())),
        (DataType::String, Json::Array(list)) => {
            let texts: Vec<&str> = list.iter().filter_map(Json::as_str).collect();
            Some(Value::String(texts.join(",")))
        }
        (DataType::String, Json::Object(_)) => Some(Value::String(found.to_string())),
        (DataType::String, _) => None,
    }
}

fn filled(row: &Row, message: &Json, unix_ms: u64) -> Metric {
    let found = message.pointer(row.place).and_then(|found| value(found, row.datatype));
    match found {
        Some(value) => metric(row.name, row.datatype, value, unix_ms),
        None => empty(row, unix_ms),
    }
}

/// All metrics of a table, without values.
#[must_use]
pub fn unknown(table: &[Row], unix_ms: u64) -> Vec<Metric> {
    table.iter().map(|row| empty(row, unix_ms)).collect()
}

/// Whose metrics a message has.
#[derive(Debug, Clone, PartialEq)]
pub enum Metrics {
    /// Of the node: an event or a change of health.
    Node(Vec<Metric>),
    /// Of the device: a summary.
    Device(Vec<Metric>),
}

/// The metrics of a kept message; `None` where it is of a later version.
#[must_use]
pub fn of(message: &[u8], is_historical: bool) -> Option<Metrics> {
    let message: Json = serde_json::from_slice(message).ok()?;
    let unix_ms = message.get("unix_ms")?.as_u64()?;
    let kind = message.get("kind")?.as_str()?;
    let read = |rows: &mut dyn Iterator<Item = &Row>| -> Vec<Metric> {
        rows.map(|row| Metric {
            is_historical: is_historical.then_some(true),
            ..filled(row, &message, unix_ms)
        })
        .collect()
    };
    match kind {
        "summary" => Some(Metrics::Device(read(&mut DEVICE.iter()))),
        "event" | "health" => {
            let mut rows = NODE.iter().filter(|row| row.name == "number" || row.name == kind);
            Some(Metrics::Node(read(&mut rows)))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_has_every_metric_of_the_birth_and_unknown_numbers_have_no_value() {
        let text = r#"{"unix_ms": 5, "number": 3, "kind": "summary", "body": {"alarms": ["fault", "recorder"],
            "correction": {"rms": [0.1, null, 0.3]}, "status": {"bypassed": false, "model": {"residual_mm": null}}}}"#;
        let Some(Metrics::Device(metrics)) = of(text.as_bytes(), true) else { panic!("{text}") };
        assert_eq!(metrics.len(), DEVICE.len());
        let get =
            |name: &str| metrics.iter().find(|one| one.name.as_deref() == Some(name)).unwrap();
        assert!(
            metrics.iter().all(|one| one.is_historical == Some(true) && one.timestamp == Some(5))
        );
        assert!(metrics.iter().all(|one| one.is_null == Some(true) || one.value.is_some()));
        assert_eq!(get("number").value, Some(Value::Long(3)));
        assert_eq!(get("alarms").value, Some(Value::String("fault,recorder".to_owned())));
        assert_eq!(get("correction/rms").value, Some(Value::Double(0.3)));
        assert_eq!(get("bypassed").value, Some(Value::Boolean(false)));
        assert_eq!(get("model/residual_mm").is_null, Some(true));
    }

    #[test]
    fn every_place_of_the_table_is_one_of_a_summary_with_a_status() {
        let status = trued_client::Status { joints: 6, ..trued_client::Status::default() };
        let text = "known".to_owned();
        let summary = crate::message::Summary {
            period_s: 1.0,
            bridge_version: text.clone(),
            daemon_version: Some(text.clone()),
            away: Some(text.clone()),
            alarms: Vec::new(),
            model_since_unix_ms: Some(1),
            correction: crate::message::CorrectionStatistics {
                rms: vec![0.0],
                largest: vec![0.0],
                ..Default::default()
            },
            spool: crate::message::SpoolState { first: 1, bytes: 1, budget_bytes: 1 },
            status: Some(live::report::Report::new("cell", &status, None)),
        };
        let message = crate::message::Message {
            schema: crate::message::SCHEMA,
            stream: 1,
            number: 1,
            unix_ms: 1,
            group: text.clone(),
            cell: text,
            content: crate::message::Content::Summary(Box::new(summary)),
        };
        let bytes = serde_json::to_vec(&message).unwrap();
        let Some(Metrics::Device(metrics)) = of(&bytes, false) else { panic!("{message:?}") };
        let unknown = metrics.iter().filter(|one| one.is_null == Some(true));
        let names: Vec<_> = unknown.filter_map(|one| one.name.as_deref()).collect();
        assert_eq!(names, ["vibration/line"], "there is none");
    }

    #[test]
    fn a_message_of_another_kind_or_of_no_version_is_left_out() {
        assert_eq!(of(br#"{"unix_ms": 5, "number": 3, "kind": "later", "body": {}}"#, false), None);
        assert_eq!(of(b"[]", false), None);
    }
}
