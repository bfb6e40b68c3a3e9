//! Faults of a measured channel: frozen or saturated while the arm moves, held over several rows, or coarsely quantised.
//!
//! A repeated value alone is not a fault: the arm can be at rest, or move perpendicular to the channel. It is a fault if the channel should have
//! changed, by the nominal model, by much more than the usual deviation from that model.
//!
//! Rows with a fault become missing measurements of that channel (NaN), or of all channels of the group if the group is frozen or repeated.

use std::ops::Range;

use physics::{Arm, Chain};
use recording::series::{Channel, Recording, RecordingKind};

use super::expected_values::{Regressors, position_spread, predict};
use super::{channel_groups, column_name, finite, group_names};
use crate::campaign_import::JointPositions;
use crate::engine::statistics::median;

/// Least number of rows with the same value that are examined, also as a multiple of the median run length.
const RUN_MIN: usize = 8;
const RUN_MEDIANS_MIN: usize = 10;
/// Standard deviations by which a channel should have changed.
const FAULT_SIGMAS: f64 = 8.0;
/// Standard deviation of the motion, along the direction of least or largest motion, below which a constant channel is no fault, m or rad.
const MOTION_MIN: f64 = 1e-3;
/// Rotation of the tool below which a constant orientation is no fault, rad.
const ROTATION_MIN: f64 = 2e-2;
/// Median change of a held channel as a multiple of its resolution; below it the channel is coarsely quantised instead.
const RESOLUTION_STEPS_MIN: f64 = 3.0;
/// Noise below this share of the resolution is hidden by quantisation.
const HIDDEN_NOISE_SHARE: f64 = 0.5;

/// Why the values of rows are not measurements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Frozen,
    Saturated,
}

/// A recording under inspection, with the joint positions of all rows.
pub(super) struct ChannelInspection<'a> {
    arm: &'a Arm,
    recording: &'a mut Recording,
    q: &'a JointPositions,
}

impl<'a> ChannelInspection<'a> {
    pub(super) fn new(arm: &'a Arm, recording: &'a mut Recording, q: &'a JointPositions) -> Self {
        Self { arm, recording, q }
    }

    /// Excludes faulty rows; returns messages for the user.
    pub(super) fn exclude_faulty_rows(mut self) -> Vec<String> {
        let mut notes = Vec::new();
        for group in channel_groups(self.recording) {
            notes.extend(self.resolution_notes(&group));
            if group.len() == 4 {
                notes.extend(self.exclude_frozen_orientations(&group));
            } else {
                notes.extend(self.exclude_faults_of_point(&group));
            }
            notes.extend(self.exclude_repeated_rows(&group));
        }
        notes
    }

    /// Rows with a value, by station of the instrument: each station has its own measuring frame.
    fn rows(&self, channel: Channel) -> Vec<Vec<usize>> {
        let mut stations: Vec<(Option<u64>, Vec<usize>)> = Vec::new();
        for row in 0..self.recording.len() {
            if finite(self.recording, channel, row).is_none() {
                continue;
            }
            let station = finite(self.recording, Channel::Station, row).map(f64::to_bits);
            match stations.iter_mut().find(|known| known.0 == station) {
                Some(known) => known.1.push(row),
                None => stations.push((station, vec![row])),
            }
        }
        stations.into_iter().map(|(_, rows)| rows).collect()
    }

    fn values(&self, channel: Channel) -> Vec<f64> {
        self.recording.column(channel).map(<[f64]>::to_vec).unwrap_or_default()
    }

    /// Excludes frozen and saturated rows of the channels of a point or a joint.
    fn exclude_faults_of_point(&mut self, group: &[Channel]) -> Vec<String> {
        let followed =
            group.first().and_then(|c| Regressors::of(self.arm, *c, self.q, self.recording.len()));
        let Some(follows) = followed else { return Vec::new() };
        if let Some(note) = self.exclude_if_frozen(group, &follows) {
            return vec![note];
        }
        let mut notes = Vec::new();
        for channel in group {
            let mut values = self.values(*channel);
            let found: Vec<_> = self
                .rows(*channel)
                .iter()
                .flat_map(|rows| faults(&follows, &values, rows))
                .collect();
            for (fault, rows) in found {
                notes.push(self.fault_message(*channel, fault, &rows, &values));
                rows.into_iter().for_each(|row| values[row] = f64::NAN);
            }
            self.recording.set(*channel, values);
        }
        notes
    }

    /// Excludes a group that never changes although the arm moves.
    fn exclude_if_frozen(&mut self, group: &[Channel], follows: &Regressors) -> Option<String> {
        let rows: Vec<usize> = (0..self.recording.len())
            .filter(|row| group.iter().all(|c| finite(self.recording, *c, *row).is_some()))
            .collect();
        let same = |channel: &Channel| {
            let values = self.values(*channel);
            rows.iter().all(|row| values[*row] == values[rows[0]])
        };
        let still = rows.len() >= RUN_MIN && group.iter().all(same);
        if !still || position_spread(follows, &rows).1 <= MOTION_MIN {
            return None;
        }
        let note = format!(
            "{} never change{} in {} rows while the arm moves: the instrument did not follow it, or the columns are wrong; not used",
            group_names(self.recording, group),
            if group.len() == 1 { "s" } else { "" },
            rows.len()
        );
        self.mark_missing(group, &rows);
        Some(note)
    }

    /// Excludes orientations that are constant while the tool rotates.
    fn exclude_frozen_orientations(&mut self, group: &[Channel]) -> Option<String> {
        let all: Vec<Vec<f64>> = group.iter().map(|channel| self.values(*channel)).collect();
        let rows: Vec<usize> = (0..self.recording.len())
            .filter(|row| all.iter().all(|v| v[*row].is_finite()))
            .collect();
        let same = |a: usize, b: usize| all.iter().all(|values| values[a] == values[b]);
        let turned = |run: &Range<usize>| {
            let rotation =
                |k: usize| Chain::nominal(self.arm, &self.q.at(rows[k])).base_from_tool.rotation;
            let first = rotation(run.start);
            let relative = |k: usize| (first.transpose() * rotation(k)).to_cols_array();
            let trace = |m: [f64; 9]| m[0] + m[4] + m[8];
            run.clone().any(|k| 3.0 - trace(relative(k)) > ROTATION_MIN * ROTATION_MIN)
        };
        let frozen = long_runs(&runs(&rows, same)).into_iter().filter(turned);
        let frozen: Vec<usize> = frozen.flatten().map(|k| rows[k]).collect();
        let (first, last) = (*frozen.first()?, *frozen.last()?);
        let note = format!(
            "{} are constant from {:.3} s to {:.3} s ({} rows) while the tool rotates; not used",
            group_names(self.recording, group),
            self.recording.t_s[first],
            self.recording.t_s[last],
            frozen.len()
        );
        self.mark_missing(group, &frozen);
        Some(note)
    }

    /// Excludes rows of a path that repeat the row before because the instrument's sampling rate is lower.
    fn exclude_repeated_rows(&mut self, group: &[Channel]) -> Option<String> {
        let rows: Vec<usize> = (0..self.recording.len())
            .filter(|row| group.iter().all(|c| finite(self.recording, *c, *row).is_some()))
            .collect();
        let all: Vec<Vec<f64>> = group.iter().map(|channel| self.values(*channel)).collect();
        let same = |a: usize, b: usize| all.iter().all(|values| values[a] == values[b]);
        let again = |pair: &&[usize]| {
            let [a, b] = [pair[0], pair[1]];
            b == a + 1 && same(a, b) && self.q.row(a) != self.q.row(b)
        };
        let repeats: Vec<usize> = rows.windows(2).filter(again).map(|pair| pair[1]).collect();
        if self.recording.metadata.kind != RecordingKind::Path || 2 * repeats.len() <= rows.len() {
            return None;
        }
        // A coarsely quantised channel repeats values, too, but changes by single steps.
        let jumps = |values: &Vec<f64>| {
            let steps = rows.windows(2).map(|pair| (values[pair[1]] - values[pair[0]]).abs());
            let steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
            let smallest = steps.iter().copied().fold(f64::INFINITY, f64::min);
            median(steps) > RESOLUTION_STEPS_MIN * smallest
        };
        if !all.iter().any(jumps) {
            return None;
        }
        self.mark_missing(group, &repeats);
        Some(format!(
            "{} only repeat{} the row before in {} of {} rows: the sampling rate of the instrument is lower; repeats are not used",
            group_names(self.recording, group),
            if group.len() == 1 { "s" } else { "" },
            repeats.len(),
            rows.len()
        ))
    }

    /// Messages on channels whose resolution is coarser than their noise.
    fn resolution_notes(&self, group: &[Channel]) -> Vec<String> {
        let mut notes = Vec::new();
        for channel in group {
            let values = self.values(*channel);
            let Some(step) = resolution(&values) else { continue };
            let stated = self.recording.sigma(*channel).unwrap_or(0.0);
            if step > stated
                && noise_sigma(&values).is_some_and(|noise| noise < HIDDEN_NOISE_SHARE * step)
            {
                let [step] = self.in_file_units(*channel, [step]);
                let name = column_name(self.recording, *channel);
                notes
                    .push(format!("{name} has a resolution of {step:.3e}, coarser than its noise"));
            }
        }
        notes
    }

    fn in_file_units<const N: usize>(&self, channel: Channel, si: [f64; N]) -> [f64; N] {
        let kind = self.recording.joint_kind(channel.joint().unwrap_or(0));
        let unit = channel.unit_in(self.recording.units, kind);
        si.map(|si| unit.map_or(si, |unit| unit.from_si(si)))
    }

    fn fault_message(
        &self,
        channel: Channel,
        fault: Fault,
        rows: &[usize],
        values: &[f64],
    ) -> String {
        let (first, last) = (rows.first().copied().unwrap_or(0), rows.last().copied().unwrap_or(0));
        let [value] = self.in_file_units(channel, [values[first]]);
        let what = match fault {
            Fault::Frozen => "is constant",
            Fault::Saturated => "is clipped",
        };
        let t = &self.recording.t_s;
        format!(
            "{} {what} at {value:.6} between {:.3} s and {:.3} s ({} rows) while the arm moves; these rows are not used",
            column_name(self.recording, channel),
            t[first],
            t[last],
            rows.len()
        )
    }

    /// Marks rows of these channels as missing.
    fn mark_missing(&mut self, group: &[Channel], rows: &[usize]) {
        for channel in group {
            let mut values = self.values(*channel);
            rows.iter().for_each(|row| values[*row] = f64::NAN);
            self.recording.set(*channel, values);
        }
    }
}

/// Runs of equal rows, as ranges of indices in `rows`.
fn runs(rows: &[usize], same: impl Fn(usize, usize) -> bool) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for k in 0..rows.len() {
        match runs.last_mut().filter(|run| same(rows[run.start], rows[k])) {
            Some(run) => run.end = k + 1,
            None => runs.push(k..k + 1),
        }
    }
    runs
}

/// Runs that are long compared with the median run.
fn long_runs(runs: &[Range<usize>]) -> Vec<Range<usize>> {
    let usual = median(runs.iter().map(|run| run.len() as f64)) as usize;
    let length_min = if runs.len() > 1 { RUN_MIN.max(RUN_MEDIANS_MIN * usual) } else { RUN_MIN };
    runs.iter().filter(|run| run.len() >= length_min).cloned().collect()
}

/// Faulty rows of one channel at one station.
fn faults(follows: &Regressors, values: &[f64], rows: &[usize]) -> Vec<(Fault, Vec<usize>)> {
    let long = long_runs(&runs(rows, |a, b| values[a] == values[b]));
    let whole = long.first().is_some_and(|run| run.len() == rows.len());
    if whole {
        let moves = position_spread(follows, rows).0 > MOTION_MIN;
        return if moves { vec![(Fault::Frozen, rows.to_vec())] } else { Vec::new() };
    }
    let ends = [1.0, -1.0].map(|sign: f64| {
        let most = rows.iter().map(|row| sign * values[*row]).fold(f64::NEG_INFINITY, f64::max);
        let at_extreme: Vec<usize> =
            rows.iter().copied().filter(|row| sign * values[*row] == most).collect();
        (sign, if at_extreme.len() < RUN_MIN { Vec::new() } else { at_extreme })
    });
    let mut sound = vec![true; values.len()];
    long.iter().flat_map(Range::clone).for_each(|k| sound[rows[k]] = false);
    ends.iter().flat_map(|end| &end.1).for_each(|row| sound[*row] = false);
    let sound: Vec<usize> = rows.iter().copied().filter(|row| sound[*row]).collect();
    let Some(line) = predict(follows, values, &sound) else { return Vec::new() };
    let (expected, clear) = (&line.expected, FAULT_SIGMAS * line.sigma);
    let mut found: Vec<(Fault, Vec<usize>)> = Vec::new();
    for (sign, at_extreme) in ends {
        let beyond = |row: &usize| sign * (expected[*row] - values[*row]);
        let further = at_extreme.iter().map(beyond).fold(f64::NEG_INFINITY, f64::max);
        let inside = at_extreme.iter().filter(|row| beyond(row) < -clear).count();
        if further > clear && 20 * inside <= at_extreme.len() {
            found.push((Fault::Saturated, at_extreme));
        }
    }
    let cut_at: Vec<f64> = found.iter().map(|(_, at_extreme)| values[at_extreme[0]]).collect();
    let is_cut = |run: &Range<usize>| cut_at.contains(&values[rows[run.start]]);
    let still = long.into_iter().filter(|run| !is_cut(run)).filter(|run| {
        let values_expected = run.clone().map(|k| expected[rows[k]]);
        let (low, high) = values_expected
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        high - low > clear
    });
    let still: Vec<Vec<usize>> = still.map(|run| rows[run].to_vec()).collect();
    found.extend(still.into_iter().map(|rows| (Fault::Frozen, rows)));
    found
}

/// Resolution: the step of which all differences are multiples, found from the smallest difference; `None` if there is none.
fn resolution(values: &[f64]) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let size = sorted.first()?.abs().max(sorted.last()?.abs());
    let gaps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    let gaps: Vec<f64> = gaps.filter(|gap| *gap > 1e-12 * size).collect();
    let step = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    let whole = |gap: &&f64| (**gap / step - (**gap / step).round()).abs() < 1e-2;
    (gaps.len() > RUN_MIN && gaps.iter().filter(whole).count() == gaps.len()).then_some(step)
}

/// Standard deviation of the noise, estimated from third differences, in which smooth motion cancels.
fn noise_sigma(values: &[f64]) -> Option<f64> {
    let third = values.windows(4).map(|v| v[3] - 3.0 * v[2] + 3.0 * v[1] - v[0]);
    let squares: Vec<f64> = third.filter(|x| x.is_finite()).map(|x| x * x).collect();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // Sum of squared coefficients: 1 + 9 + 9 + 1.
    (!squares.is_empty()).then(|| (mean / 20.0).sqrt())
}
