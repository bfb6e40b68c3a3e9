//! Folders of results as `trued diagnose --batch` writes them (docs/reference/batch.md), made by hand.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use datafusion::arrow::array::{
    ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray,
    TimestampMicrosecondArray,
};
use datafusion::parquet::arrow::ArrowWriter;

/// 2026-01-01T06:00:00Z.
const START_US: i64 = 1_767_247_200_000_000;
/// A day of several recordings, each with a file of its own.
pub(crate) const ONE_DAY: i64 = 400;
const DAY_US: i64 = 86_400_000_000;

/// A finding of one number.
#[derive(Debug, Clone)]
pub(crate) struct Finding {
    pub(crate) effect: &'static str,
    pub(crate) joint: Option<i64>,
    pub(crate) parameter: &'static str,
    pub(crate) value: f64,
    pub(crate) sigma: f64,
    pub(crate) claimed: bool,
    /// Rows of one finding share its words.
    pub(crate) says: &'static str,
}

/// Backlash of joint 2.
pub(crate) fn backlash(value: f64) -> Finding {
    Finding {
        effect: "backlash",
        joint: Some(2),
        parameter: "width_mrad",
        value,
        sigma: 0.008,
        claimed: true,
        says: "loses motion",
    }
}

/// A recording, one for each day.
#[derive(Debug, Clone)]
pub(crate) struct Recorded {
    pub(crate) robot: &'static str,
    pub(crate) day: Option<i64>,
    pub(crate) ambient_c: Option<f64>,
    /// None where it was refused.
    pub(crate) findings: Option<Vec<Finding>>,
}

/// A folder that goes when it is dropped.
#[derive(Debug)]
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let name =
            format!("trends-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// With a result for each recording.
    pub(crate) fn with(recordings: &[Recorded]) -> Self {
        let folder = Self::new();
        for (number, recorded) in recordings.iter().enumerate() {
            write(
                &folder.0.join(format!("{number:064x}.parquet")),
                &format!("{number:064x}"),
                recorded,
            );
        }
        folder
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Writes a result.
pub(crate) fn write(path: &Path, key: &str, recorded: &Recorded) {
    let batch = batch(key, recorded);
    let mut writer =
        ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), None).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}

fn batch(key: &str, recorded: &Recorded) -> RecordBatch {
    let subject = if recorded.findings.is_some() { "recording" } else { "refused" };
    let findings = recorded.findings.as_deref().unwrap_or_default();
    let rows: Vec<Option<&Finding>> =
        std::iter::once(None).chain(findings.iter().map(Some)).collect();
    let texts = |of: &dyn Fn(Option<&Finding>) -> Option<String>| -> ArrayRef {
        Arc::new(StringArray::from_iter(rows.iter().map(|row| of(*row))))
    };
    let numbers = |of: &dyn Fn(&Finding) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter(rows.iter().map(|row| row.map(of))))
    };
    let all = |text: &str| texts(&|_| Some(text.to_owned()));
    let time_us = recorded.day.map(|day| START_US + day * DAY_US);
    let times =
        TimestampMicrosecondArray::from_iter(rows.iter().map(|_| time_us)).with_timezone("UTC");
    // On `ONE_DAY` there are several files.
    let day = recorded.day.filter(|day| *day != ONE_DAY);
    let file = day.map_or_else(|| key.to_owned(), |day| format!("{}-{day}.csv", recorded.robot));
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("key", all(key)),
        ("robot", all(recorded.robot)),
        ("recorded_at", Arc::new(times)),
        ("files", all(&file)),
        ("subject", texts(&|row| Some(row.map_or(subject, |_| "finding").to_owned()))),
        ("domain", all("position")),
        ("unit", all("mm")),
        ("ambient_C", Arc::new(Float64Array::from_iter(rows.iter().map(|_| recorded.ambient_c)))),
        ("effect", texts(&|row| row.map(|row| row.effect.to_owned()))),
        (
            "joint",
            Arc::new(Int64Array::from_iter(rows.iter().map(|row| row.and_then(|row| row.joint)))),
        ),
        ("change", texts(&|row| row.map(|_| "new".to_owned()))),
        (
            "claimed",
            Arc::new(BooleanArray::from_iter(rows.iter().map(|row| row.map(|row| row.claimed)))),
        ),
        ("parameter", texts(&|row| row.map(|row| row.parameter.to_owned()))),
        ("index", Arc::new(Int64Array::from_iter(rows.iter().map(|_| None)))),
        ("value", numbers(&|row| row.value)),
        ("low", numbers(&|row| row.value - 1.96 * row.sigma)),
        ("high", numbers(&|row| row.value + 1.96 * row.sigma)),
        ("size_rms", numbers(&|row| 0.3 * row.value.abs())),
        ("size_max", numbers(&|row| 0.6 * row.value.abs())),
        ("says", texts(&|row| Some(row.map_or("domain", |row| row.says).to_owned()))),
    ];
    RecordBatch::try_from_iter_with_nullable(
        columns.into_iter().map(|(name, column)| (name, column, true)),
    )
    .unwrap()
}
