//! The drawings of the page: waterfall, signal, spectra over time and path.

use report::{Axis, HeatMap, Plot, Series, Svg};
use spectrum::folded_hz;
use spectrum::welch::{Scaling, SegmentPower, Segments, Spectrum};

use super::analysis::Analysis;
use super::input::Source;
use super::monitor::Episode;
use super::path::{ChannelPathSpectrum, PathSpectra};
use super::samples::GapHandling;
use super::spectra::{ChannelSpectrum, segments};
use super::text::density_unit;
use crate::error::Error;

/// Columns of a waterfall: as many as are drawn.
const COLUMNS: usize = 208;
/// A line's frame in the waterfall reaches this many rows of the picture to both sides of its frequency.
const FRAME_BINS: f64 = 3.0;
/// Multiples of the spindle's speed that are marked.
const HARMONICS: u32 = 40;
/// Lines that are named in a plot.
const NAMED: usize = 3;
/// Points of a signal that are kept for its drawing, which thins them further.
const SIGNAL_POINTS: usize = 1 << 20;
/// Spectra of power extend this many decades below their maximum.
const POWER_DECADES: f64 = 7.0;
/// The waterfall extends this many decades below its maximum.
const DECADES: f64 = 3.0;

/// The highest frequency to draw, rounded: above the monitor's lines and the model's modes, or
/// above the strongest lines if the monitor reported none.
pub(super) fn top_hz(analysis: &Analysis) -> f64 {
    let strongest =
        analysis.spectra.iter().flat_map(|one| one.lines.iter().take(3).map(|l| l.line.frequency));
    let episodes = analysis.episodes.iter().take(8).map(|episode| episode.frequency_hz);
    let modes = analysis
        .source
        .model
        .iter()
        .flat_map(|model| &model.file.modes)
        .map(|mode| mode.frequency_hz);
    let nyquist_hz = 0.5 * analysis.source.rate_hz;
    let known = episodes.chain(modes.filter(|f| *f < nyquist_hz));
    let highest = if analysis.episodes.is_empty() {
        strongest.fold(80.0, f64::max)
    } else {
        known.fold(80.0, f64::max)
    };
    let rounds = (2..5).flat_map(|k| {
        [1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0].map(|m| m * 10f64.powi(k))
    });
    rounds.into_iter().find(|top| *top >= 1.12 * highest).unwrap_or(nyquist_hz).min(nyquist_hz)
}

/// The lines that are named in a plot over time, by their begin: the time of the table, not that of the alarm.
fn named(analysis: &Analysis) -> Vec<&Episode> {
    let mut named: Vec<&Episode> =
        analysis.episodes.iter().filter(|e| e.is_alarm()).take(NAMED).collect();
    named.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    named
}

/// The channel that shows the finding best.
pub(super) fn shown(analysis: &Analysis) -> usize {
    let first = analysis.episodes.first().map(|episode| episode.channel);
    let loudest =
        || analysis.spectra.iter().max_by(|a, b| a.rms.total_cmp(&b.rms)).map(|s| s.channel);
    first.or_else(loudest).unwrap_or(0)
}

/// Amplitude of one channel over time and frequency.
pub(super) fn waterfall(analysis: &Analysis, channel: usize) -> Result<Option<Svg>, Error> {
    let top_hz = top_hz(analysis);
    let Some((from_s, to_s)) = span_s(&analysis.source) else { return Ok(None) };
    // About 60 windows, of half a second at most, but of 20 periods of the highest frequency and of 32 samples at least.
    let least_s = (20.0 / top_hz).max(32.0 / analysis.source.rate_hz);
    let window_s = ((to_s - from_s) / 60.0).min(0.5).max(least_s);
    let plan =
        Segments { scaling: Scaling::Spectrum, ..segments(analysis.source.rate_hz, window_s) };
    let plan = Segments { overlap: 3 * plan.length / 4, ..plan };
    let step_hz = analysis.source.rate_hz / plan.length as f64;
    let rows = ((top_hz / step_hz) as usize).clamp(1, plan.length / 2);
    let columns = COLUMNS.min(((to_s - from_s) / (window_s / 4.0)) as usize).max(1);
    let mut cells = vec![f64::NAN; rows * columns];
    for piece in &analysis.source.pieces {
        let Ok(mut segments) = SegmentPower::new(piece.len(), &plan) else { continue };
        let mut enter = |t_s: f64, power: &[f64]| {
            let place = (piece.at_s + t_s - from_s) / (to_s - from_s) * columns as f64;
            let column = (place as usize).min(columns - 1);
            for (row, power) in power.iter().skip(1).take(rows).enumerate() {
                let amplitude = (2.0 * power).sqrt();
                let cell = &mut cells[row * columns + column];
                *cell = cell.max(amplitude);
            }
        };
        let all = 0..piece.len();
        piece
            .samples
            .parts(GapHandling::Bridged, &[channel], all, |part| segments.push(part, &mut enter))?;
    }
    fill_gaps(
        &mut cells,
        rows,
        columns,
        1 + (columns as f64 * window_s / (to_s - from_s)) as usize,
    );
    let largest = cells.iter().copied().fold(0.0, f64::max);
    let unit = &analysis.source.channels[channel].unit;
    let map = HeatMap::new(
        "Waterfall",
        Axis::new("Time", "s").range(from_s, to_s),
        Axis::new("Frequency", "Hz").range(0.5 * step_hz, (rows as f64 + 0.5) * step_hz),
        Axis::new("Amplitude", unit).log().range(largest * 10f64.powf(-DECADES), largest),
    )
    .cells(columns, cells);
    let framed = named(analysis).into_iter().fold(map, |map, episode| {
        let beside_hz = FRAME_BINS * step_hz;
        let band_hz = (episode.frequency_hz - beside_hz, episode.frequency_hz + beside_hz);
        map.outline((episode.from_s, episode.to_s.unwrap_or(to_s)), band_hz, label(episode))
    });
    Ok(Some(framed.render()))
}

/// Columns without the centre of a segment take their neighbour's values; gaps of the recording stay empty.
fn fill_gaps(cells: &mut [f64], rows: usize, columns: usize, reach: usize) {
    for row in 0..rows {
        let line = &mut cells[row * columns..(row + 1) * columns];
        let known: Vec<usize> = (0..columns).filter(|column| !line[*column].is_nan()).collect();
        for column in 0..columns {
            if !line[column].is_nan() {
                continue;
            }
            let next = known.partition_point(|k| *k < column);
            let nearest = [next.checked_sub(1), Some(next)].into_iter().flatten();
            let nearest = nearest.filter_map(|k| known.get(k)).min_by_key(|k| k.abs_diff(column));
            if let Some(nearest) = nearest.filter(|nearest| nearest.abs_diff(column) <= reach) {
                line[column] = line[*nearest];
            }
        }
    }
}

fn span_s(source: &Source) -> Option<(f64, f64)> {
    let first = source.pieces.first()?;
    let last = source.pieces.last()?;
    let end_s = last.at_s + last.len() as f64 / source.rate_hz;
    (end_s > first.at_s).then_some((first.at_s, end_s))
}

fn label(episode: &Episode) -> String {
    format!("{:.0} Hz {}", episode.frequency_hz, episode.verdict.class.name().replace('_', " "))
}

/// Decimation of the signal plot: minimum and maximum of this many consecutive samples are drawn; 1: all samples.
pub(super) fn thinned(source: &Source) -> usize {
    if source.len() <= SIGNAL_POINTS { 1 } else { (2 * source.len()).div_ceil(SIGNAL_POINTS) }
}

/// The samples of one channel over time.
pub(super) fn signal(analysis: &Analysis, channel: usize) -> Result<Svg, Error> {
    let shown = &analysis.source.channels[channel];
    let group = thinned(&analysis.source);
    let mut points =
        Vec::with_capacity(analysis.source.len().min(SIGNAL_POINTS) + analysis.source.pieces.len());
    for piece in &analysis.source.pieces {
        let t_s = |i: usize| piece.at_s + i as f64 / analysis.source.rate_hz;
        let (mut sample, mut open) = (0, Vec::with_capacity(group));
        piece.samples.parts(GapHandling::Missing, &[channel], 0..piece.len(), |part| {
            for x in part {
                open.push((t_s(sample), *x));
                sample += 1;
                if open.len() == group {
                    extremes(&mut open, &mut points);
                }
            }
        })?;
        extremes(&mut open, &mut points);
        points.push((t_s(piece.len()), f64::NAN));
    }
    let plot = Plot::new("Signal", Axis::new("Time", "s"), Axis::new(&shown.name, &shown.unit))
        .series(Series::line("", points))
        .height(220.0);
    let marked = named(analysis)
        .into_iter()
        .fold(plot, |plot, episode| plot.mark_x(episode.from_s, label(episode)));
    Ok(marked.render())
}

/// Appends minimum and maximum of `open` to `to` in time order; one NaN point where every sample is missing.
fn extremes(open: &mut Vec<(f64, f64)>, to: &mut Vec<(f64, f64)>) {
    let taken = || open.iter().filter(|point| !point.1.is_nan());
    let smallest = taken().min_by(|a, b| a.1.total_cmp(&b.1));
    let largest = taken().max_by(|a, b| a.1.total_cmp(&b.1));
    match smallest.zip(largest) {
        Some((a, b)) if a.0 == b.0 => to.push(*a),
        Some((a, b)) if a.0 < b.0 => to.extend([*a, *b]),
        Some((a, b)) => to.extend([*b, *a]),
        None => to.extend(open.first()),
    }
    open.clear();
}

/// Power density of all channels of one unit, with markers of known frequencies.
pub(super) fn density(analysis: &Analysis, unit: &str, whole: bool) -> Svg {
    let top_hz = if whole { 0.5 * analysis.source.rate_hz } else { top_hz(analysis) };
    let of_unit = |one: &&ChannelSpectrum| analysis.source.channels[one.channel].unit == unit;
    let step_hz =
        analysis.spectra.first().and_then(|s| s.density.frequency.get(1)).copied().unwrap_or(1.0);
    let x = Axis::new("Frequency", "Hz");
    let x = if whole { x.log().range(step_hz, top_hz) } else { x.range(0.0, top_hz) };
    let y = Axis::new("Power density", density_unit(unit, "Hz")).log();
    let curves: Vec<(&str, Vec<(f64, f64)>)> = analysis
        .spectra
        .iter()
        .filter(of_unit)
        .map(|one| {
            (analysis.source.channels[one.channel].name.as_str(), curve(&one.density, top_hz))
        })
        .collect();
    let (low, y) = bounded(&curves, y);
    let mut plot = Plot::new("Spectrum", x, y).height(340.0);
    for (name, points) in curves {
        plot = plot.series(Series::line(name, points));
    }
    if low.is_finite() && !whole {
        plot = marks(plot, &analysis.source, top_hz, low);
    }
    let of_unit = |episode: &&Episode| analysis.source.channels[episode.channel].unit == unit;
    let mut named: Vec<&Episode> = analysis.episodes.iter().filter(of_unit).take(NAMED).collect();
    named.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    named
        .into_iter()
        .fold(plot, |plot, episode| plot.mark_x(episode.frequency_hz, label(episode)))
        .render()
}

/// The lowest power to draw, and the axis down to it: lower values are leakage of the window, not
/// the signal. There is room below for rows of dots.
fn bounded(curves: &[(&str, Vec<(f64, f64)>)], y: Axis) -> (f64, Axis) {
    let powers = || curves.iter().flat_map(|(_, points)| points).map(|point| point.1);
    let high = powers().fold(0.0, f64::max);
    let low = powers().fold(f64::INFINITY, f64::min).max(high * 10f64.powf(-POWER_DECADES));
    let drawn = low.is_finite() && high > 0.0;
    (low, if drawn { y.range(0.05 * low, 2.0 * high) } else { y })
}

/// A spectrum's points up to a frequency, without the mean.
fn curve(spectrum: &Spectrum, top: f64) -> Vec<(f64, f64)> {
    let points = spectrum.frequency.iter().copied().zip(spectrum.power.iter().copied());
    points.skip(1).take_while(|(f, _)| *f <= top).collect()
}

/// Rows of dots below the curves: modes, spindle multiples, aliases.
fn marks(plot: Plot, source: &Source, top_hz: f64, low: f64) -> Plot {
    let inside = |f: &f64| (0.0..=top_hz).contains(f);
    let modes =
        source.model.iter().flat_map(|model| &model.file.modes).map(|mode| mode.frequency_hz);
    let modes: Vec<f64> = modes.filter(inside).collect();
    let turn_hz =
        source.pieces.iter().find_map(|piece| piece.motion.median_rpm()).map(|rpm| rpm / 60.0);
    let orders = |turn_hz: f64| (1..=HARMONICS).map(move |k| f64::from(k) * turn_hz);
    let nyquist_hz = 0.5 * source.rate_hz;
    let harmonics = turn_hz.into_iter().flat_map(orders).filter(|f| *f < nyquist_hz);
    let harmonics: Vec<f64> = harmonics.filter(inside).collect();
    let teeth = f64::from(source.teeth);
    let passing =
        turn_hz.into_iter().flat_map(|turn_hz| orders(turn_hz * teeth)).filter(|f| *f > nyquist_hz);
    let aliases = passing.take(10).map(|f| folded_hz(f, source.rate_hz)).filter(inside);
    let aliases: Vec<f64> = if source.teeth > 0 { aliases.collect() } else { Vec::new() };
    let rows = [
        ("the model's modes", modes),
        ("multiples of the spindle", harmonics),
        ("aliased tooth harmonics", aliases),
    ];
    let mut level = low;
    rows.into_iter().filter(|(_, row)| !row.is_empty()).fold(plot, |plot, (name, row)| {
        level *= 0.4;
        let height = level;
        plot.series(Series::dots(name, row.into_iter().map(move |f| (f, height))))
    })
}

/// Power density over the path of all channels of one unit.
pub(super) fn path(source: &Source, spectra: &PathSpectra, unit: &str) -> Svg {
    let highest =
        spectra.channels.iter().flat_map(|one| one.lines.iter().map(|l| l.line.frequency));
    let wheels = spectra.wheels.list.iter().map(|wheel| wheel.cycles_per_mm);
    let end = 0.5 / spectra.step_mm;
    let needed = highest.chain(wheels).fold(0.8, f64::max) * 1.2;
    let top = needed.min(end);
    let of_unit = |one: &&ChannelPathSpectrum| source.channels[one.channel].unit == unit;
    let curves: Vec<(&str, Vec<(f64, f64)>)> = spectra
        .channels
        .iter()
        .filter(of_unit)
        .map(|one| (source.channels[one.channel].name.as_str(), curve(&one.density, top)))
        .collect();
    let y = density_unit(unit, "(1/mm)").replace("/(1/mm)", " mm");
    let (low, y) = bounded(&curves, Axis::new("Power density", y).log());
    let x = Axis::new("Cycles per mm of path", "1/mm").range(0.0, top);
    let mut plot = Plot::new("Spectrum over the path", x, y).height(320.0);
    for (name, points) in curves {
        plot = plot.series(Series::line(name, points));
    }
    let wheels: Vec<(f64, f64)> = spectra
        .wheels
        .list
        .iter()
        .map(|w| (w.cycles_per_mm, 0.4 * low))
        .filter(|w| w.0 <= top)
        .collect();
    if !wheels.is_empty() && low.is_finite() {
        plot = plot.series(Series::dots("gear shafts", wheels));
    }
    let mut named: Vec<_> = spectra
        .channels
        .iter()
        .filter(|one| source.channels[one.channel].unit == unit)
        .flat_map(|one| &one.lines)
        .collect();
    named.sort_by(|a, b| b.line.amplitude.total_cmp(&a.line.amplitude));
    let mut marked: Vec<f64> = Vec::new();
    for found in named {
        let line = found.line.frequency;
        let again = marked.iter().any(|marked_hz| (line / marked_hz - 1.0).abs() < 0.03);
        if again || marked.len() == NAMED {
            continue;
        }
        marked.push(line);
        let cycles = format!("{:.2} /mm", found.line.frequency);
        let label = found
            .wheel
            .map_or(cycles.clone(), |found| format!("{cycles}, joint {}", found.wheel.joint));
        plot = plot.mark_x(found.line.frequency, label);
    }
    plot.render()
}
