//! Converts table columns to records: waveforms, their positions, gaps.

use std::collections::BTreeMap;

use super::spacing::{Run, Spacing};
use super::{Grid, Options, Record, Wave};
use crate::faults::{Fault, Faults, Setting};
use crate::series::Channel;

/// If at least this share of the rows has no sample of any channel, another instrument was slower:
/// those rows are dropped.
const SLOWER: f64 = 0.2;

/// Positions of a table's rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Positions {
    /// Times, s.
    Time(Vec<f64>),
    /// Positions, mm.
    Length(Vec<f64>),
    /// A constant rate stated in the file, Hz.
    Rate(f64),
    /// Unknown.
    Unknown,
}

/// The chosen columns of one table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    pub(super) stand: Positions,
    /// The name of the column with the positions, for faults.
    pub(super) named: String,
    /// Segment of each row; empty: one.
    pub(super) segment: Vec<i64>,
    pub(super) channels: Vec<Wave>,
    pub(super) beside: BTreeMap<Channel, Vec<f64>>,
}

impl Columns {
    /// The records of the columns. `fault_at` gives a fault the position of a row in the table.
    pub(super) fn records(
        mut self,
        options: &Options,
        faults: &mut Faults,
        notes: &mut Vec<String>,
        fault_at: impl Fn(usize, Fault) -> Fault,
    ) -> Vec<Record> {
        let rows = self.channels.first().map_or(0, |wave| wave.values.len());
        if rows == 0 {
            return Vec::new();
        }
        let kept = self.drop_empty_rows(rows, notes);
        let rows = kept.as_ref().map_or(rows, Vec::len);
        let Some((grid, runs)) = self.grid(rows, options, faults, notes, |row, fault| {
            fault_at(kept.as_ref().and_then(|kept| kept.get(row)).copied().unwrap_or(row), fault)
        }) else {
            return Vec::new();
        };
        let part =
            |values: &[f64], run: &Run| values.get(run.rows.clone()).unwrap_or_default().to_vec();
        let record = |run: &Run| Record {
            grid: match grid {
                Grid::Time { rate_hz, .. } => Grid::Time { start_s: run.start, rate_hz },
                Grid::Length { step_mm, .. } => Grid::Length { start_mm: run.start, step_mm },
            },
            channels: self
                .channels
                .iter()
                .map(|wave| Wave {
                    name: wave.name.clone(),
                    unit: wave.unit.clone(),
                    axis: wave.axis,
                    values: part(&wave.values, run),
                })
                .collect(),
            auxiliary: self.beside.iter().map(|(c, values)| (*c, part(values, run))).collect(),
        };
        runs.iter().map(record).collect()
    }

    /// Drops the rows without any sample if there are many; returns which rows remain.
    fn drop_empty_rows(&mut self, rows: usize, notes: &mut Vec<String>) -> Option<Vec<usize>> {
        if !matches!(self.stand, Positions::Time(_) | Positions::Length(_)) {
            return None;
        }
        let taken = |row: &usize| {
            self.channels.iter().any(|wave| wave.values.get(*row).is_some_and(|v| !v.is_nan()))
        };
        let kept: Vec<usize> = (0..rows).filter(taken).collect();
        let empty = rows - kept.len();
        if kept.is_empty() || (empty as f64) < SLOWER * rows as f64 {
            return None;
        }
        notes.push(format!(
            "{empty} of {rows} rows have no sample of these channels and were skipped"
        ));
        let keep = |values: &mut Vec<f64>| {
            *values = kept.iter().filter_map(|row| values.get(*row).copied()).collect();
        };
        self.channels.iter_mut().for_each(|wave| keep(&mut wave.values));
        self.beside.values_mut().for_each(keep);
        if let Positions::Time(x) | Positions::Length(x) = &mut self.stand {
            keep(x);
        }
        if !self.segment.is_empty() {
            self.segment = kept.iter().filter_map(|row| self.segment.get(*row).copied()).collect();
        }
        Some(kept)
    }

    fn grid(
        &self,
        rows: usize,
        options: &Options,
        faults: &mut Faults,
        notes: &mut Vec<String>,
        fault_at: impl Fn(usize, Fault) -> Fault,
    ) -> Option<(Grid, Vec<Run>)> {
        if let Some(grid) = requested_grid(options) {
            return Some((grid, self.segments(rows)));
        }
        let x = match &self.stand {
            Positions::Time(x) | Positions::Length(x) => x,
            Positions::Rate(rate_hz) => {
                return Some((Grid::Time { start_s: 0.0, rate_hz: *rate_hz }, self.segments(rows)));
            }
            Positions::Unknown => {
                faults.push(
                    Fault::new("", "no time column found")
                        .expected("a column `t_s`, `time`, `X_Value`, or a first column that increases evenly")
                        .help("give the sampling rate, or the spacing of a profile")
                        .by(&[Setting::SamplingRate, Setting::Spacing]),
                );
                return None;
            }
        };
        let breaks = |row: usize| {
            row > 0
                && self.segment.get(row).zip(self.segment.get(row - 1)).is_some_and(|(a, b)| a != b)
        };
        match Spacing::of(x, breaks) {
            Ok(spacing) => {
                notes.extend(spacing.notes.iter().map(|note| format!("`{}`: {note}", self.named)));
                let grid = match self.stand {
                    Positions::Length(_) => Grid::Length { start_mm: 0.0, step_mm: spacing.step },
                    _ => Grid::Time { start_s: 0.0, rate_hz: spacing.rate() },
                };
                Some((grid, spacing.runs))
            }
            Err((row, fault)) => {
                let fault = Fault { key: self.named.clone(), ..*fault };
                let is_length = matches!(self.stand, Positions::Length(_));
                faults.push(fault_at(row, if is_length { of_length(fault) } else { fault }));
                None
            }
        }
    }

    /// One run for each segment: if the rate is given, times are not checked for gaps.
    fn segments(&self, rows: usize) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for row in 0..rows {
            let new = row > 0 && self.segment.get(row) != self.segment.get(row - 1);
            match runs.last_mut() {
                Some(run) if !new => run.rows.end = row + 1,
                _ => {
                    let start = match &self.stand {
                        Positions::Time(x) | Positions::Length(x) => x.get(row).copied(),
                        _ => None,
                    };
                    let start = start.filter(|start| start.is_finite()).unwrap_or(0.0);
                    runs.push(Run { rows: row..row + 1, start });
                }
            }
        }
        runs
    }
}

/// A fault of times as one of lengths: a spacing replaces them, not a rate.
fn of_length(fault: Fault) -> Fault {
    match fault.settings.contains(&Setting::SamplingRate) {
        true => {
            fault.help("give the spacing if the points are evenly spaced").by(&[Setting::Spacing])
        }
        false => fault,
    }
}

/// The requested grid, which takes precedence over the file.
pub(super) fn requested_grid(options: &Options) -> Option<Grid> {
    let time = options.rate_hz.map(|rate_hz| Grid::Time { start_s: 0.0, rate_hz });
    time.or_else(|| options.step_mm.map(|step_mm| Grid::Length { start_mm: 0.0, step_mm }))
}

/// Checks the options before any file is read.
pub(super) fn check(options: &Options, faults: &mut Faults) {
    let quantities = [
        ("rate_hz", options.rate_hz, Setting::SamplingRate),
        ("step_mm", options.step_mm, Setting::Spacing),
        ("full_scale", options.full_scale, Setting::FullScale),
    ];
    for (key, value, setting) in quantities {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            let fault = Fault::new(key, format!("is {value}")).expected("a finite number above 0");
            faults.push(fault.by(&[setting]));
        }
    }
}
