//! Plot data, notes and untestable effects of a force comparison, for page and report. No influence on the findings.

use recording::series::Recording;
use std::f64::consts::TAU;

use super::candidates::KINDS;
use super::case::{Case, Estimates};

/// Maximum number of points of a trace.
const POINTS: usize = 1500;
/// Largest relative variation of the feed that counts as constant.
const FEED_VARIATION_MOST: f64 = 0.02;

/// Measured and predicted force of one axis over time.
#[derive(Clone, Debug)]
pub struct ForceTrace {
    /// Axis: 0 x, 1 y, 2 z.
    pub axis: usize,
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Spindle angle in revolutions, 0 to 1.
    pub revolution: Vec<f64>,
    /// Recorded force, N.
    pub measured: Vec<f64>,
    /// Residual of the stated cut, and with all findings, N.
    pub residuals: [Vec<f64>; 2],
    /// Prediction of the stated cut, and with all findings, N.
    pub predicted: [Vec<f64>; 2],
    /// Residuals of the longest run at full rate, before and after, for spectra.
    pub residual_run: [Vec<f64>; 2],
    /// Sampling rate of `run`, Hz.
    pub rate_hz: f64,
}

pub(super) fn signal_rms(case: &Case) -> f64 {
    let values = case.measured.iter().flatten().flatten();
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    libm::sqrt(sum / f64::max(count, 1.0))
}

fn feed_range(case: &Case) -> [f64; 2] {
    let cuts = case.model.rows.iter().filter(|state| state.is_cutting);
    cuts.map(|state| state.feed_per_tooth_m)
        .fold([f64::INFINITY, 0.0], |[low, high], feed| [low.min(feed), high.max(feed)])
}

pub(super) fn has_one_feed(case: &Case) -> bool {
    let [low, high] = feed_range(case);
    high - low <= FEED_VARIATION_MOST * high
}

/// Effects that this recording cannot show, with the reason.
pub(super) fn not_tested(case: &Case) -> Vec<(&'static str, &'static str)> {
    let mut all: Vec<(&'static str, &'static str)> =
        case.library.untested.iter().map(|(kind, _, why)| (*kind, *why)).collect();
    const LACKING: [(&str, &str); 3] = [
        (
            "fx_N",
            "fx_N was not recorded or is constant: effects that appear only there are not observable",
        ),
        (
            "fy_N",
            "fy_N was not recorded or is constant: effects that appear only there are not observable",
        ),
        (
            "fz_N",
            "fz_N was not recorded or is constant: effects that appear only there are not observable",
        ),
    ];
    for (measured, (_, why)) in case.measured.iter().zip(LACKING) {
        if measured.is_none() {
            all.push(("cutting_force", why));
        }
    }
    all
}

pub(super) fn notes(case: &Case, recording: &Recording) -> Vec<String> {
    let mut notes = Vec::new();
    let faster = case.estimates.spindle.excess_speed;
    let is_faster = libm::fabs(faster) > 1e-5;
    if is_faster {
        notes.push(format!(
            "the spindle rotates {:.3} % {} than recorded",
            100.0 * libm::fabs(faster),
            if faster > 0.0 { "faster" } else { "slower" }
        ));
    }
    let turned = case.estimates.spindle.phases.iter().map(|phase| phase.abs()).fold(0.0, f64::max);
    if turned > 0.02 {
        notes.push(format!(
            "tooth 0 is not at angle 0 at the start of a segment: off by up to {turned:.2} rad, estimated too"
        ));
    }
    if recording.len() > case.model.rows.len() {
        notes.push(format!(
            "{} of {} rows were compared, in sections distributed over the recording",
            case.model.rows.len(),
            recording.len()
        ));
    }
    notes
}

/// Plot data of all recorded axes.
pub(super) fn traces(case: &Case) -> Vec<ForceTrace> {
    let stated = Estimates::as_stated(case.estimates.spindle.clone());
    let law = [&stated, &case.estimates].map(|estimates| case.readings(estimates));
    let residuals = [&stated, &case.estimates].map(|estimates| case.residual(estimates));
    let count = case.model.rows.len();
    let thin = count.div_ceil(POINTS).max(1);
    let rows: Vec<usize> = (0..count).step_by(thin).collect();
    let some = |list: &[f64]| -> Vec<f64> { rows.iter().map(|row| list[*row]).collect() };
    let run = case.table.runs.iter().max_by_key(|run| run.len()).cloned().unwrap_or(0..0);
    let time = |row: usize| case.model.rows[row].time_s;
    let lasts_s = if run.len() > 1 { time(run.end - 1) - time(run.start) } else { 0.0 };
    let rate_hz = (run.len().saturating_sub(1)) as f64 / lasts_s.max(f64::MIN_POSITIVE);
    let spindle = &case.estimates.spindle;
    KINDS[..3]
        .iter()
        .enumerate()
        .filter_map(|(axis, _)| Some((axis, case.measured[axis].as_ref()?)))
        .map(|(axis, read)| ForceTrace {
            axis,
            t_s: rows.iter().map(|row| time(*row)).collect(),
            revolution: rows
                .iter()
                .map(|row| (spindle.angle(&case.model.rows[*row]) / TAU).rem_euclid(1.0))
                .collect(),
            measured: some(read),
            residuals: [some(&residuals[0][axis]), some(&residuals[1][axis])],
            predicted: [some(&law[0][axis]), some(&law[1][axis])],
            residual_run: [
                residuals[0][axis][run.clone()].to_vec(),
                residuals[1][axis][run.clone()].to_vec(),
            ],
            rate_hz,
        })
        .collect()
}
