//! Spectral lines of the cut, compared with those in air, and their causes.
//!
//! Averaged spectra (Welch) of both phases. A harmonic of the spindle speed, aliased or not, is forced; a line that is also in air does not belong to
//! the cut; other lines count as self-excited only if they carry a large share of the oscillation. Frequencies in Hz.

use crate::engine::statistics::median;
use recording::series::{Channel, Recording};
use spectrum::folded_hz;
use spectrum::offline::{AveragedSpectrum, line_near, speed_from_pulses};
use spectrum::welch::Segments;

use super::phases::{Phase, State};
use super::signal::Signal;

/// Length of a spectral segment, s; its inverse is the frequency resolution.
const SEGMENT_S: f64 = 0.5;
/// Largest harmonic of the spindle speed that is recognised.
const HARMONICS_MOST: u32 = 200;
/// Relative uncertainty of the spindle speed.
const SPEED_SIGMA: f64 = 3e-3;
/// Minimum ratio of a line's amplitude in the cut to that in air for it to belong to the cut.
const AIR_RATIO_LEAST: f64 = 3.0;
/// Minimum share of the oscillation's energy in the cut that a self-excited line carries.
const SELF_EXCITED_SHARE_LEAST: f64 = 0.15;
/// Largest number of lines reported.
const LINES_MOST: usize = 12;

/// Cause of a spectral line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Harmonic of the spindle speed, with its number.
    Spindle(u32),
    /// Present in air too.
    Air,
    /// Only in the cut, but small, or not comparable with air.
    Minor,
    /// Only in the cut, not forced, and with a large share of the oscillation: self-excited.
    SelfExcited,
}

/// A spectral line of the cut.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralLine {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude in the channel where it is largest, N or m/s².
    pub amplitude: f64,
    /// Amplitude in air, N or m/s²; 0 without air.
    pub amplitude_in_air: f64,
    /// Share of the oscillation's energy in the cut, 0 to 1.
    pub share: f64,
    /// Index of the channel among the analysed ones.
    pub channel: usize,
    /// Cause of the line.
    pub cause: Cause,
}

/// Spectral lines, strongest first; the spindle frequency, Hz, if known; half the width of a frequency bin, Hz.
pub(super) fn find_lines(
    signal: &Signal,
    phases: &[Phase],
    recording: &Recording,
) -> (Vec<SpectralLine>, Option<f64>, f64) {
    let rows = |state: State| phases.iter().filter(move |phase| phase.state == state);
    let cut: Vec<&Phase> = rows(State::Cut).collect();
    let longest = cut.iter().map(|phase| phase.rows.len()).max().unwrap_or(0);
    let length = ((SEGMENT_S * signal.rate_hz) as usize).min(longest);
    let spindle_hz = spindle_frequency(recording, &cut, signal.rate_hz);
    if length < 64 {
        return (Vec::new(), spindle_hz, 0.0);
    }
    let plan = Segments::new(signal.rate_hz, length);
    let bin_hz = signal.rate_hz / length as f64;
    let mut tones: Vec<SpectralLine> = Vec::new();
    for (channel, (_, samples)) in signal.channels.iter().enumerate() {
        let spectrum_of = |state: State| {
            let runs: Vec<&[f64]> = rows(state).map(|phase| &samples[phase.rows.clone()]).collect();
            AveragedSpectrum::from_runs(runs, &plan).ok()
        };
        let Some(inside) = spectrum_of(State::Cut) else { continue };
        let air = spectrum_of(State::Air);
        let swings = inside.mean.power.iter().skip(2).sum::<f64>() * bin_hz;
        for line in inside.lines().into_iter().take(LINES_MOST) {
            let in_air = air.as_ref().and_then(|air| line_near(&air.mean, line.frequency, bin_hz));
            let amplitude_in_air = in_air.map_or(0.0, |line| line.amplitude);
            let share = 0.5 * line.amplitude * line.amplitude / swings.max(f64::MIN_POSITIVE);
            let cause = match harmonic_number(line.frequency, spindle_hz, signal.rate_hz, bin_hz) {
                Some(k) => Cause::Spindle(k),
                None if line.amplitude < AIR_RATIO_LEAST * amplitude_in_air => Cause::Air,
                None if share < SELF_EXCITED_SHARE_LEAST || air.is_none() => Cause::Minor,
                None => Cause::SelfExcited,
            };
            let tone = SpectralLine {
                frequency_hz: line.frequency,
                amplitude: line.amplitude,
                amplitude_in_air,
                share,
                channel,
                cause,
            };
            let is_same_line =
                |one: &&mut SpectralLine| (one.frequency_hz - line.frequency).abs() < 2.0 * bin_hz;
            match tones.iter_mut().find(is_same_line) {
                Some(known) if known.amplitude < tone.amplitude => *known = tone,
                Some(_) => {}
                None => tones.push(tone),
            }
        }
    }
    tones.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    tones.truncate(LINES_MOST);
    (tones, spindle_hz, 0.5 * bin_hz)
}

/// Median spindle frequency in the cut, Hz, as recorded or from the pulses of the tachometer.
fn spindle_frequency(recording: &Recording, cut: &[&Phase], rate_hz: f64) -> Option<f64> {
    let of_pulses;
    let speed = match recording.column(Channel::Spindle) {
        Some(speed) => speed,
        None => {
            of_pulses = speed_from_pulses(recording.column(Channel::Tacho)?, rate_hz);
            &of_pulses
        }
    };
    let speeds = cut.iter().filter_map(|phase| speed.get(phase.rows.clone())).flatten();
    let rpm = median(speeds.copied().filter(|rpm| *rpm > 0.0));
    (rpm > 0.0).then_some(rpm / 60.0)
}

/// Number of the spindle harmonic that matches a frequency, aliasing included.
fn harmonic_number(
    frequency_hz: f64,
    spindle_hz: Option<f64>,
    rate_hz: f64,
    bin_hz: f64,
) -> Option<u32> {
    let spindle_hz = spindle_hz?;
    (1..=HARMONICS_MOST).find(|k| {
        let true_hz = f64::from(*k) * spindle_hz;
        // Harmonics whose uncertainty reaches half their spacing match anything and are not used.
        let tolerance = (SPEED_SIGMA * true_hz).max(bin_hz);
        tolerance < 0.25 * spindle_hz.max(2.0 * bin_hz)
            && (folded_hz(true_hz, rate_hz) - frequency_hz).abs() < tolerance
    })
}
