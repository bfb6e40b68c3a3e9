//! Pictures of the saved page: force over time and frequency, latency over time, the robot from two sides.

use std::sync::Arc;

use ::report::{Axis, HeatMap, Plot, Role, Series, Svg};

use super::begin_s;
use super::vibration_events::VibrationEvent;
use crate::history::{Column, Latency, STEP_MS};
use crate::robot::Drawing;

/// The spectrogram extends this many decades below its maximum, as in the reports of recordings.
const DECADES: f64 = 3.0;
/// Largest drawn length of the tool's displacement, as a share of the reach.
const SHIFT_SHARE_MAX: f64 = 0.2;

fn seconds_ago(t_ms: u64, now_ms: u64) -> f64 {
    -1e-3 * now_ms.saturating_sub(t_ms) as f64
}

/// Amplitude of the force over time and frequency; `None` without force samples.
pub(super) fn spectrogram(
    columns: &[Arc<Column>],
    episodes: &[VibrationEvent],
    now_ms: u64,
) -> Option<Svg> {
    let newest = columns.last()?;
    let rows = newest.amplitude_n.len();
    let begin_s = begin_s(columns.first().map(|first| first.t_ms), now_ms);
    let step_s = 1e-3 * STEP_MS as f64;
    let count = (-begin_s / step_s).round() as usize;
    let mut cells = vec![f64::NAN; rows * count];
    for column in columns {
        let column_index = ((seconds_ago(column.t_ms, now_ms) - begin_s) / step_s).round();
        if !(0.0..count as f64).contains(&column_index) {
            continue;
        }
        for (bin, amplitude) in column.amplitude_n.iter().enumerate() {
            // The bins may differ from the newest ones if the daemon was restarted with another configuration.
            let hz = column.first_hz + bin as f64 * column.bin_hz;
            let row = ((hz - newest.first_hz) / newest.bin_hz).round();
            if (0.0..rows as f64).contains(&row) {
                let cell = &mut cells[row as usize * count + column_index as usize];
                *cell = cell.max(*amplitude);
            }
        }
    }
    let largest = cells.iter().copied().fold(0.0, f64::max);
    let low_hz = newest.first_hz - 0.5 * newest.bin_hz;
    let map = HeatMap::new(
        "Force over time and frequency",
        Axis::new("Time before this report", "s").range(begin_s, 0.0),
        Axis::new("Frequency", "Hz").range(low_hz, low_hz + rows as f64 * newest.bin_hz),
        Axis::new("Amplitude", "N").log().range(largest * 10f64.powf(-DECADES), largest),
    )
    .cells(count, cells);
    let outlined = episodes.iter().fold(map, |map, one| {
        let to_s = one.to_ms.map_or(0.0, |to_ms| seconds_ago(to_ms, now_ms));
        let label = if one.is_alarm { one.name.as_str() } else { "" };
        map.outline((seconds_ago(one.from_ms, now_ms), to_s), (one.low_hz, one.high_hz), label)
    });
    Some(outlined.render())
}

/// Latency over time, with the period of the commands where it is known; `None` without an answer.
pub(super) fn latency(latency: &[Latency], period_s: Option<f64>, now_ms: u64) -> Option<Svg> {
    let known = || latency.iter().filter(|one| one.p99_us > 0.0);
    let begin_s = begin_s(known().next().map(|first| first.t_ms), now_ms);
    known().next()?;
    let points = known().map(|one| (seconds_ago(one.t_ms, now_ms), one.p99_us));
    let plot = Plot::new(
        "Latency over time",
        Axis::new("Time before this report", "s").range(begin_s, 0.0),
        Axis::new("Latency", "µs").log(),
    )
    .series(Series::line("99th percentile", points))
    .height(220.0);
    let plot = match period_s {
        Some(period_s) => plot.mark_y(1e6 * period_s, "period of the commands"),
        None => plot,
    };
    Some(plot.render())
}

/// The robot from the side and from above, the scale factor of the drawn tool displacement, and its length, mm; or why the robot is not drawn.
pub(super) fn robot(drawing: &Drawing) -> Result<(Svg, Svg, f64, f64), String> {
    let (points_mm, shift_mm, reach_mm) = match drawing {
        Drawing::Nothing { why } => return Err(why.clone()),
        Drawing::Arm { points_mm, shift_mm, reach_mm } => (points_mm, shift_mm, *reach_mm),
    };
    let tool = points_mm.last().copied().unwrap_or_default();
    let length_mm = shift_mm.iter().copied().fold(0.0, f64::hypot);
    let factor =
        if length_mm > 0.0 { round_down(SHIFT_SHARE_MAX * reach_mm / length_mm) } else { 1.0 };
    let end: [f64; 3] = std::array::from_fn(|k| tool[k] + factor * shift_mm[k]);
    let azimuth = tool[1].atan2(tool[0]);
    let side = |[x, y, z]: [f64; 3]| (1e-3 * (x * azimuth.cos() + y * azimuth.sin()), 1e-3 * z);
    let above = |[x, y, _]: [f64; 3]| (1e-3 * x, 1e-3 * y);
    let draw = |title: &str, axes: [&str; 2], view: &dyn Fn([f64; 3]) -> (f64, f64)| {
        let arm = points_mm.iter().map(|point| view(*point));
        Plot::new(title, Axis::new(axes[0], "m"), Axis::new(axes[1], "m"))
            .series(Series::line("arm", arm.clone()).role(Role::Before))
            .series(Series::dots("joints and tool", arm).role(Role::Truth))
            .series(
                Series::line("displacement by the correction", [view(tool), view(end)])
                    .role(Role::After),
            )
            .equal_scale()
            .height(320.0)
            .render()
    };
    Ok((
        draw("Robot from the side", ["Outwards", "Height"], &side),
        draw("Robot from above", ["x of the base", "y of the base"], &above),
        factor,
        length_mm,
    ))
}

/// The nearest of 1, 2 and 5 times a power of ten that is not larger.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.max(1e-12).log10().floor());
    let digit = [5.0, 2.0].into_iter().find(|digit| digit * power <= value).unwrap_or(1.0);
    digit * power
}
