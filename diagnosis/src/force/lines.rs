//! Spectral lines of the cut compared with those in air, and their causes.
//!
//! Promises: a harmonic of the spindle speed, aliased or not, is forced; a line that is also in air does not belong to the cut; other
//! lines count as self-excited only if they carry a large part of the oscillation.

use crate::engine::statistics::median;
use recording::series::{Channel, Recording};
use spectrum::folded_hz;
use spectrum::offline::{Averaged, line_near, speed_of_pulses};
use spectrum::welch::Segments;

use super::phases::{Phase, State};
use super::signal::Signal;

/// Length of a segment, s: lines this close are one.
const SEGMENT_S: f64 = 0.5;
/// Multiples of the spindle's speed that are told.
const MULTIPLES: u32 = 200;
/// How far the spindle's speed is off, as a share.
const SPEED_OFF: f64 = 3e-3;
/// A tone is of the cut where it is so many times as large as in air.
const OVER_AIR: f64 = 3.0;
/// The least share of what swings in the cut that a self-excited tone carries.
const CARRIES: f64 = 0.15;
/// Tones that are told, at most.
const TOLD: usize = 12;

/// What makes a tone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A multiple of the spindle's speed.
    Spindle(u32),
    /// It stands in air as well.
    Air,
    /// It stands in the cut alone, and is small.
    Small,
    /// It stands in the cut alone, forced by nothing, and carries a good part of what swings.
    Unforced,
}

/// A tone of the cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Tone {
    /// Hz.
    pub frequency_hz: f64,
    /// Of the channel that has most of it.
    pub amplitude: f64,
    /// The same in air; 0 without air.
    pub in_air: f64,
    /// Its share of what swings in the cut.
    pub share: f64,
    /// Which channel, from 0, of those that were looked at.
    pub channel: usize,
    /// What makes it.
    pub cause: Cause,
}

/// Tones, strongest first; the spindle's frequency where it is known; half a bin, Hz.
pub(super) fn of(
    signal: &Signal,
    phases: &[Phase],
    recording: &Recording,
) -> (Vec<Tone>, Option<f64>, f64) {
    let rows = |state: State| phases.iter().filter(move |phase| phase.state == state);
    let cut: Vec<&Phase> = rows(State::Cut).collect();
    let longest = cut.iter().map(|phase| phase.rows.len()).max().unwrap_or(0);
    let length = ((SEGMENT_S * signal.rate_hz) as usize).min(longest);
    let spindle_hz = spindle(recording, &cut, signal.rate_hz);
    if length < 64 {
        return (Vec::new(), spindle_hz, 0.0);
    }
    let plan = Segments::new(signal.rate_hz, length);
    let bin_hz = signal.rate_hz / length as f64;
    let mut tones: Vec<Tone> = Vec::new();
    for (channel, (_, samples)) in signal.channels.iter().enumerate() {
        let of = |state: State| {
            let runs: Vec<&[f64]> = rows(state).map(|phase| &samples[phase.rows.clone()]).collect();
            Averaged::of(runs, &plan).ok()
        };
        let Some(inside) = of(State::Cut) else { continue };
        let air = of(State::Air);
        let swings = inside.mean.power.iter().skip(2).sum::<f64>() * bin_hz;
        for line in inside.lines().into_iter().take(TOLD) {
            let in_air = air.as_ref().and_then(|air| line_near(&air.mean, line.frequency, bin_hz));
            let in_air = in_air.map_or(0.0, |line| line.amplitude);
            let share = 0.5 * line.amplitude * line.amplitude / swings.max(f64::MIN_POSITIVE);
            let cause = match multiple(line.frequency, spindle_hz, signal.rate_hz, bin_hz) {
                Some(k) => Cause::Spindle(k),
                None if line.amplitude < OVER_AIR * in_air => Cause::Air,
                None if share < CARRIES || air.is_none() => Cause::Small,
                None => Cause::Unforced,
            };
            let tone = Tone {
                frequency_hz: line.frequency,
                amplitude: line.amplitude,
                in_air,
                share,
                channel,
                cause,
            };
            let near = |one: &&mut Tone| (one.frequency_hz - line.frequency).abs() < 2.0 * bin_hz;
            match tones.iter_mut().find(near) {
                Some(known) if known.amplitude < tone.amplitude => *known = tone,
                Some(_) => {}
                None => tones.push(tone),
            }
        }
    }
    tones.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    tones.truncate(TOLD);
    (tones, spindle_hz, 0.5 * bin_hz)
}

/// The middle spindle speed in the cut, Hz: as recorded, or by the tacho's pulses.
fn spindle(recording: &Recording, cut: &[&Phase], rate_hz: f64) -> Option<f64> {
    let of_pulses;
    let speed = match recording.column(Channel::Spindle) {
        Some(speed) => speed,
        None => {
            of_pulses = speed_of_pulses(recording.column(Channel::Tacho)?, rate_hz);
            &of_pulses
        }
    };
    let here = cut.iter().filter_map(|phase| speed.get(phase.rows.clone())).flatten();
    let rpm = median(here.copied().filter(|rpm| *rpm > 0.0));
    (rpm > 0.0).then_some(rpm / 60.0)
}

/// Which multiple of the spindle's speed a frequency is, as sampled.
fn multiple(frequency_hz: f64, spindle_hz: Option<f64>, rate_hz: f64, bin_hz: f64) -> Option<u32> {
    let spindle_hz = spindle_hz?;
    (1..=MULTIPLES).find(|k| {
        let true_hz = f64::from(*k) * spindle_hz;
        // Where the multiples' own uncertainty fills half of the distance between them nothing can be told.
        let off = (SPEED_OFF * true_hz).max(bin_hz);
        off < 0.25 * spindle_hz.max(2.0 * bin_hz)
            && (folded_hz(true_hz, rate_hz) - frequency_hz).abs() < off
    })
}
