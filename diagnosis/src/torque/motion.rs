//! Position, velocity, acceleration and torque of every joint from recordings, resampled to even time steps and filtered into one frequency band.
//!
//! Motion and torque pass the same zero-phase low-pass, so that both sides of the equation of motion remain equal; motion for nonlinear laws is kept
//! in a wider band as well. Recordings are split into runs at gaps, which are never bridged, and nothing is extrapolated. Units: rad or m, N m or N,
//! s, °C.

use crate::engine::statistics::median;
use std::borrow::Cow;

use physics::{Arm, Inputs, JOINTS_MAX};
use recording::series::{Channel, Recording, RecordingKind};

use super::filter::{LowPass, with_derivatives};
use super::resample::resampled;
use super::rest_detection::{resolution, stopped_samples};
use super::subsampling::Subsampling;

/// Default band, Hz: industrial drives and links move as rigid bodies up to about here.
const BAND_HZ: f64 = 40.0;
/// Largest band as a share of the sampling rate.
const BAND_SHARE: f64 = 0.1;
/// Nonlinear laws (sign changes, reversals) are evaluated on motion in a wider band, up to [`BAND_HZ`] and this share of the sampling rate, because
/// filtered motion reverses too gradually.
const WIDE_BAND_SHARE: f64 = 0.25;
/// Rows per period of the band edge.
const ROWS_PER_PERIOD: f64 = 5.0;
/// Periods of the band edge omitted at each end of a run, where the filter lacks the preceding samples.
const OMITTED_PERIODS: f64 = 2.0;
/// A joint that moves less than this share of its span within [`REST_S`] is at rest.
const REST_SPAN_SHARE: f64 = 1e-4;
/// A joint whose whole span is smaller never moves, rad or m.
const SPAN_LEAST: f64 = 1e-3;
/// Duration for the detection of rest, s.
const REST_S: f64 = 0.2;
/// A pause longer than this many time steps is a gap.
const GAP_STEPS: f64 = 3.5;
/// Minimum number of samples of a run.
const RUN_SAMPLES_LEAST: usize = 64;
/// Reference temperature of the temperature laws, and value of samples without any recorded one, °C.
pub(super) const ROOM_C: f64 = 20.0;

/// Motion and torque of one joint in a run, in the torque's band; rad or m, N m or N.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub(super) q: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) a: Vec<f64>,
    /// Position, velocity and acceleration in the wider band; `None` if the torque's band is as wide.
    wide_band: Option<[Vec<f64>; 3]>,
    /// Position, velocity and acceleration unfiltered; empty if the torque's band is as wide as the wider one.
    unfiltered: [Vec<f64>; 3],
    /// `None` if no torque of this joint was recorded.
    pub(super) torque: Option<Vec<f64>>,
    /// Whether the recorded position is constant around each sample.
    stops: Vec<bool>,
    /// Temperature, °C; empty if none was recorded.
    pub(super) temperature: Vec<f64>,
}

/// A section of a recording without gaps.
#[derive(Clone, Debug)]
pub(super) struct Run {
    /// Index of the recording, from 0.
    pub(super) recording: usize,
    pub(super) segment: i64,
    pub(super) step_s: f64,
    pub(super) start_s: f64,
    pub(super) joints: Vec<Track>,
    pub(super) filter: LowPass,
    /// Samples that are used as rows.
    pub(super) rows: Vec<usize>,
}

/// All runs of the recordings, with the frequency bands used.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    pub(super) runs: Vec<Run>,
    pub(super) band_hz: f64,
    /// Edge of the wider band for nonlinear laws, Hz; at least `band_hz`.
    pub(super) wide_band_hz: f64,
    /// Notes on the processing, for users.
    pub(super) notes: Vec<String>,
    /// Whether torque is computed from current and stated torque constants.
    pub(super) is_torque_from_current: bool,
}

impl Track {
    /// Position, velocity and acceleration in the wider band.
    pub(super) fn wide_band_motion(&self) -> [&[f64]; 3] {
        let Self { q, v, a, wide_band, .. } = self;
        wide_band.as_ref().map_or([q, v, a], |[q, v, a]| [q, v, a])
    }
}

impl Run {
    /// State of the arm at a sample, in the torque's band.
    pub(super) fn inputs(&self, sample: usize) -> Inputs {
        self.state(|Track { q, v, a, .. }| [q, v, a].map(|list| list[sample]))
    }

    /// State of the arm at a sample, in the wider band.
    pub(super) fn wide_band_inputs(&self, sample: usize) -> Inputs {
        self.state(|track| track.wide_band_motion().map(|list| list[sample]))
    }

    /// State of the arm at a sample, unfiltered. Terms are computed from it first and filtered afterwards, as the recorded torque is; this is exact
    /// for terms that are nonlinear in the motion too.
    pub(super) fn unfiltered_inputs(&self, sample: usize) -> Inputs {
        self.state(|track| track.unfiltered.each_ref().map(|list| list[sample]))
    }

    fn state(&self, components: impl Fn(&Track) -> [f64; 3]) -> Inputs {
        let mut inputs = Inputs::at_rest([0.0; JOINTS_MAX]);
        for (joint, track) in self.joints.iter().enumerate() {
            [inputs.q[joint], inputs.velocity[joint], inputs.acceleration[joint]] =
                components(track);
        }
        inputs
    }

    /// Samples of a nonlinear law, low-pass filtered into the torque's band, at the rows.
    pub(super) fn at_rows(&self, samples: &[f64]) -> Vec<f64> {
        self.all_at_rows(&[samples]).remove(0)
    }

    /// [`Run::at_rows`] for several lists of samples at once.
    pub(super) fn all_at_rows<L: AsRef<[f64]>>(&self, lists: &[L]) -> Vec<Vec<f64>> {
        let lists: Vec<&[f64]> = lists.iter().map(AsRef::as_ref).collect();
        let mut all = vec![vec![0.0; self.rows.len()]; lists.len()];
        let nonzero = |k: &usize| lists[*k].iter().any(|x| *x != 0.0);
        let nonzero: Vec<usize> = (0..lists.len()).filter(nonzero).collect();
        let mut put = |k: usize, passed: Vec<f64>| {
            all[k] = self.rows.iter().map(|row| passed[*row]).collect();
        };
        let (pairs, last) = nonzero.as_chunks();
        for &[one, other] in pairs {
            let [of_one, of_other] = self.filter.pass_each([lists[one], lists[other]]);
            put(one, of_one);
            put(other, of_other);
        }
        last.iter().for_each(|k| put(*k, self.filter.filtered(lists[*k])));
        all
    }

    /// Values at the rows interpolated linearly to every sample.
    pub(super) fn interpolated_from_rows(&self, values: &[f64]) -> Vec<f64> {
        let samples = self.joints.first().map_or(0, |track| track.q.len());
        let value = |sample: usize| {
            let above = self.rows.partition_point(|row| *row < sample);
            let last = values.len().saturating_sub(1);
            let [low, high] = [above.saturating_sub(1), above.min(last)];
            let (Some(from), Some(to)) = (self.rows.get(low), self.rows.get(high)) else {
                return 0.0;
            };
            let share = if to > from {
                (sample.max(*from) - from) as f64 / (to - from) as f64
            } else {
                0.0
            };
            values[low] + share.min(1.0) * (values[high] - values[low])
        };
        (0..samples).map(value).collect()
    }

    pub(super) fn time_s(&self, sample: usize) -> f64 {
        self.start_s + sample as f64 * self.step_s
    }

    /// Whether a joint moves at each row: all windows of [`REST_S`] within `after` samples span at least `span_min`, and no stop lies within half as
    /// many samples.
    fn moves(&self, joint: usize, span_min: f64, after: usize) -> Vec<bool> {
        let Track { q, stops, .. } = &self.joints[joint];
        let half = (0.5 * REST_S / self.step_s).ceil() as usize;
        let around = |k: usize, half_width: usize| {
            k.saturating_sub(half_width)..(k + half_width + 1).min(q.len())
        };
        let moves = |k| {
            let [low, high] = span(q[around(k, half)].iter().copied());
            high - low >= span_min
        };
        let moves: Vec<bool> = (0..q.len()).map(moves).collect();
        let is_moving = |row: &usize| {
            let stops = stops[around(*row, after / 2)].contains(&true);
            !stops && moves[around(*row, after)].iter().all(|moves| *moves)
        };
        self.rows.iter().map(is_moving).collect()
    }
}

/// Whether the recordings contain torque along a path, or current with torque constants. Settled poses do not count, since static friction there can
/// hold any torque.
#[must_use]
pub fn has_torque(recordings: &[Recording]) -> bool {
    let some = |torque: Cow<'_, [f64]>| torque.iter().any(|torque| torque.is_finite());
    recordings.iter().filter(|recording| recording.metadata.kind == RecordingKind::Path).any(
        |recording| {
            (0..recording.joint_count()).any(|joint| torque(recording, joint).is_some_and(some))
        },
    )
}

/// Torque of a joint, as recorded or computed from its current, N m or N.
fn torque(recording: &Recording, joint: usize) -> Option<Cow<'_, [f64]>> {
    if let Some(torque) = recording.column(Channel::Torque(joint)) {
        return Some(Cow::Borrowed(torque));
    }
    let constant = *recording.metadata.torque_per_ampere.get(joint)?;
    let current = recording.column(Channel::Current(joint))?;
    Some(current.iter().map(|ampere| constant * ampere).collect())
}

/// Position of a joint: on the motor side if measured, since torque follows the actual motion; otherwise the command.
fn position(recording: &Recording, joint: usize) -> Option<&[f64]> {
    recording.column(Channel::Motor(joint)).or_else(|| recording.column(Channel::Command(joint)))
}

impl Motion {
    /// Motion of `arm`, with torques recorded `delay_s` late, in the band `band_hz` (`None`: [`BAND_HZ`], or a tenth of the lowest sampling rate).
    pub(super) fn of(
        arm: &Arm,
        delay_s: f64,
        recordings: &[Recording],
        band_hz: Option<f64>,
    ) -> Self {
        let steps = recordings.iter().filter_map(step_s);
        let slowest_hz = 1.0 / steps.fold(1e-6, f64::max);
        let usual = BAND_HZ.min(BAND_SHARE * slowest_hz);
        let band_hz = band_hz.unwrap_or(usual).min(0.4 * slowest_hz);
        let wide_band_hz = BAND_HZ.min(WIDE_BAND_SHARE * slowest_hz).max(band_hz);
        let recorded = |recording| row_count(recording, band_hz);
        let all_rows: usize = recordings.iter().map(recorded).sum();
        let mut runs = Vec::new();
        for (number, recording) in recordings.iter().enumerate() {
            runs.extend(runs_of(
                arm,
                (number, recording),
                delay_s,
                [band_hz, wide_band_hz],
                all_rows,
            ));
        }
        let whole: usize = runs.iter().map(|run: &Run| run.rows.len()).sum();
        let mut notes = vec![format!(
            "torque and motion were filtered by the same zero-phase low-pass of {} Hz; {whole} rows in {} remain",
            format_hz(band_hz),
            count_runs(runs.len())
        )];
        if Subsampling::of(all_rows, 1).is_some() {
            let share = 100.0 * whole as f64 / all_rows as f64;
            notes.push(format!(
                "they are {share:.0} % of the recording, in evenly distributed sections"
            ));
        }
        let has_only_current = |recording: &Recording| {
            let is_torque = |channel| matches!(channel, Channel::Torque(_));
            !recording.channels().any(is_torque) && has_torque(std::slice::from_ref(recording))
        };
        let is_torque_from_current = recordings.iter().any(has_only_current);
        if is_torque_from_current {
            notes.push("torque is current times the stated torque constants".to_owned());
        }
        Self { runs, band_hz, wide_band_hz, notes, is_torque_from_current }
    }

    /// Whether a joint moves, row by row.
    pub(super) fn moves(&self, joint: usize) -> Vec<bool> {
        let [low, high] = self.span(joint);
        let span_min =
            if high - low > SPAN_LEAST { REST_SPAN_SHARE * (high - low) } else { f64::INFINITY };
        // The filter rings around a stop, so rows near one are excluded.
        let after = |run: &Run| (OMITTED_PERIODS / (run.step_s * self.band_hz)).ceil() as usize;
        self.runs.iter().flat_map(|run| run.moves(joint, span_min, after(run))).collect()
    }

    /// Range of a joint's position over all rows, lowest and highest, rad or m.
    pub(super) fn span(&self, joint: usize) -> [f64; 2] {
        let rows = |run| {
            let Run { rows, joints, .. }: &Run = run;
            rows.iter().map(|row| joints[joint].q[*row])
        };
        span(self.runs.iter().flat_map(rows))
    }
}

/// Lowest and highest value.
pub(super) fn span(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Number of runs as text.
fn count_runs(count: usize) -> String {
    if count == 1 { "1 run".to_owned() } else { format!("{count} runs") }
}

fn format_hz(band_hz: f64) -> String {
    format!("{band_hz:.3}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Median time step of a recording, s.
fn step_s(recording: &Recording) -> Option<f64> {
    let pairs = recording.t_s.windows(2).zip(recording.segment.windows(2));
    let step = median(pairs.filter(|(_, s)| s[0] == s[1]).map(|(t, _)| t[1] - t[0]));
    (step > 0.0).then_some(step)
}

/// Indices of complete rows, in sections without gaps and of sufficient length.
fn complete_sections(
    recording: &Recording,
    step_s: f64,
    whole: impl Fn(usize) -> bool,
) -> Vec<Vec<usize>> {
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for row in (0..recording.len()).filter(|row| whole(*row)) {
        let is_contiguous = pieces.last().and_then(|piece| piece.last()).is_some_and(|before| {
            recording.segment[*before] == recording.segment[row]
                && recording.t_s[row] - recording.t_s[*before] < GAP_STEPS * step_s
                && recording.t_s[row] > recording.t_s[*before]
        });
        if is_contiguous {
            pieces.last_mut().into_iter().for_each(|piece| piece.push(row));
        } else {
            pieces.push(vec![row]);
        }
    }
    pieces.retain(|piece| piece.len() >= RUN_SAMPLES_LEAST);
    pieces
}

/// Number of samples between rows.
fn stride(step_s: f64, band_hz: f64) -> usize {
    (1.0 / (step_s * band_hz * ROWS_PER_PERIOD)).round().max(1.0) as usize
}

/// Number of rows of a torque recording, if it has no gaps.
fn row_count(recording: &Recording, band_hz: f64) -> usize {
    let step_s = step_s(recording).filter(|_| has_torque(std::slice::from_ref(recording)));
    step_s.map_or(0, |step_s| recording.len() / stride(step_s, band_hz))
}

fn runs_of(
    arm: &Arm,
    (number, recording): (usize, &Recording),
    delay_s: f64,
    [band_hz, quick_hz]: [f64; 2],
    all_rows: usize,
) -> Vec<Run> {
    let Some(step_s) = step_s(recording).filter(|_| recording.metadata.kind == RecordingKind::Path)
    else {
        return Vec::new();
    };
    let joints = arm.count();
    let columns: Vec<Option<&[f64]>> = (0..joints).map(|j| position(recording, j)).collect();
    let torques: Vec<Option<Cow<'_, [f64]>>> = (0..joints).map(|j| torque(recording, j)).collect();
    if columns.iter().any(Option::is_none) || torques.iter().all(Option::is_none) {
        return Vec::new();
    }
    let columns: Vec<&[f64]> = columns.into_iter().flatten().collect();
    let whole = |row: usize| {
        columns.iter().all(|column| column[row].is_finite())
            && torques.iter().flatten().all(|torque| torque[row].is_finite())
    };
    let stride = stride(step_s, band_hz);
    let mut pieces = complete_sections(recording, step_s, whole);
    if let Some(stretches) = Subsampling::of(all_rows, stride) {
        pieces = stretches.apply(&pieces);
        pieces.retain(|piece| piece.len() >= RUN_SAMPLES_LEAST);
    }
    let run = |piece: &Vec<usize>| {
        let times: Vec<f64> = piece.iter().map(|row| recording.t_s[*row]).collect();
        let count = ((times[times.len() - 1] - times[0]) / step_s) as usize + 1;
        let late = |column: &[f64], delay_s: f64| {
            let samples: Vec<f64> = piece.iter().map(|row| column[*row]).collect();
            resampled(&times, &samples, times[0] + delay_s, step_s, count)
        };
        let even = |column: &[f64]| late(column, 0.0);
        let filter = LowPass::new(band_hz, 1.0 / step_s);
        let quick = LowPass::new(quick_hz, 1.0 / step_s);
        let track = |joint: usize| {
            let recorded = even(columns[joint]);
            let stops = stopped_samples(&recorded, resolution(columns[joint]), step_s);
            let [q, v, a] = with_derivatives(filter.filtered(&recorded), step_s);
            let (wide_band, unfiltered) = match quick_hz > band_hz {
                true => (
                    Some(with_derivatives(quick.filtered(&recorded), step_s)),
                    with_derivatives(recorded, step_s),
                ),
                false => (None, Default::default()),
            };
            let torque =
                torques[joint].as_ref().map(|torque| filter.filtered(&late(torque, delay_s)));
            let temperature = recording
                .column(Channel::JointTemperature(joint))
                .or_else(|| recording.column(Channel::Ambient))
                .map_or(Vec::new(), |column| even(&gaps_filled(column)));
            Track { q, v, a, wide_band, unfiltered, torque, stops, temperature }
        };
        let ends = ((OMITTED_PERIODS / (step_s * band_hz)).ceil() as usize).min(count / 4);
        Run {
            recording: number,
            segment: recording.segment[piece[0]],
            step_s,
            start_s: times[0],
            joints: (0..joints).map(track).collect(),
            filter,
            rows: (ends..count.saturating_sub(ends)).step_by(stride).collect(),
        }
    };
    pieces.iter().map(run).collect()
}

/// Samples of a slowly varying quantity, missing ones replaced by the last recorded value.
fn gaps_filled(column: &[f64]) -> Vec<f64> {
    let first = column.iter().copied().find(|value| value.is_finite()).unwrap_or(ROOM_C);
    let mut last = first;
    let mut next = |value: &f64| {
        last = if value.is_finite() { *value } else { last };
        last
    };
    column.iter().map(&mut next).collect()
}

#[cfg(test)]
mod tests {
    use super::Motion;
    use crate::torque::tests::slider;
    use physics::JointKind;
    use recording::series::{Channel, Recording};

    #[test]
    fn of_a_long_recording_stretches_from_its_beginning_to_its_end_become_rows() {
        let count = 400_000_u32;
        let t_s: Vec<f64> = (0..count).map(|k| 1e-3 * f64::from(k)).collect();
        let end_s = *t_s.last().expect("rows");
        let q = t_s.iter().map(|t| 0.1 * libm::sin(*t)).collect();
        let mut recording = Recording::new(t_s);
        recording.set_joint_kind(0, JointKind::Prismatic);
        recording.set(Channel::Motor(0), q);
        recording.set(Channel::Torque(0), vec![1.0; count as usize]);
        let motion = Motion::of(&slider(true), 0.0, &[recording], None);
        let rows: usize = motion.runs.iter().map(|run| run.rows.len()).sum();
        let samples: usize = motion.runs.iter().map(|run| run.joints[0].q.len()).sum();
        assert!((38_000..=40_000).contains(&rows), "{rows}");
        assert!(samples <= 200_000, "what is not looked at is not kept: {samples}");
        let starts: Vec<f64> = motion.runs.iter().map(|run| run.start_s).collect();
        assert!(starts[0] == 0.0 && starts.last().is_some_and(|last| *last > 0.9 * end_s));
        assert!(motion.notes.iter().any(|note| note.contains("% of the recording")));
    }
}
