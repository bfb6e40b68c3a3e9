//! Analysis of a force recording without a model of the cut: phases (air, entry, cut, exit), sensor bias in air, spectral lines of the
//! cut and chatter.
//!
//! Read in this order: `signal` (runs without holes, blocks of time), `phases` (air, entry, cut, exit), `lines` (lines of the cut compared with those of the air),
//! `cut` (comparison with the model of a stated cut).
//! Accelerations are used if no force was recorded.
//!
//! Promises: the same input gives the same bits; a line that is also in air, or at a multiple of the spindle speed, is never called chatter; without
//! air there is no statement on the sensor. Never: a file, a name of a data set.

mod cut;
mod lines;
mod phases;
mod signal;
#[cfg(test)]
mod tests;

use crate::engine::statistics::median;
use physics::Model;
use recording::series::{Channel, Recording};

use crate::diagnose::Verdict;
use signal::Signal;

pub use cut::{Compared, Rest, Silence, Traced};
pub use lines::{Cause, Tone};
pub use phases::{Phase, State};

/// Why nothing can be said.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Doubt {
    /// No channel with samples.
    #[error(
        "no force or acceleration has samples in it: record fx_N, fy_N, fz_N, or name them in a mapping"
    )]
    Empty,
    /// Every channel always reads the same.
    #[error(
        "every channel reads the same in every row: nothing was connected, or the sensor is overloaded"
    )]
    Constant,
    /// An amplifier or a converter at its end.
    #[error(
        "{channel} stands at {limit} N (m/s²) in {percent:.1} % of its rows: the amplifier is at its limit there, so no force is known; record with a larger range"
    )]
    Overloaded {
        /// Its name.
        channel: String,
        /// Where it stands.
        limit: f64,
        /// In how much of its rows.
        percent: f64,
    },
    /// Too little.
    #[error(
        "the longest run without a hole is {rows} rows, expected at least {least}: record more"
    )]
    Short {
        /// Found.
        rows: usize,
        /// Needed.
        least: usize,
    },
}

/// Something that the recording shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// The sensor reads this in air, N; standard uncertainties.
    Bias {
        /// x, y, z; 0 where a channel is not there.
        force: [f64; 3],
        /// Of each.
        sigma: [f64; 3],
        /// Held-out blocks of air: root mean square with the reading, and without it.
        heldout: [f64; 2],
    },
    /// A line of the cut that nothing forces.
    Chatter {
        /// The line.
        tone: Tone,
        /// Half of the width of a bin, Hz.
        resolution_hz: f64,
        /// Whether the spindle's speed is known, so that its multiples are ruled out.
        is_alone: bool,
    },
}

/// All that was found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// Most important first.
    pub findings: Vec<Finding>,
    /// In time order; without holes within a run.
    pub phases: Vec<Phase>,
    /// Lines of the cut, strongest first.
    pub tones: Vec<Tone>,
    /// Whether forces were recorded; else accelerations.
    pub is_force: bool,
    /// Names of the channels that were looked at.
    pub channels: Vec<String>,
    /// Rows that were looked at.
    pub rows: usize,
    /// Root mean square of single values.
    pub signal: f64,
    /// Scatter of single values in air (of all rows without air).
    pub noise: f64,
    /// The middle spindle speed in the cut, Hz, where it is known.
    pub spindle_hz: Option<f64>,
    /// Of a turned cut that the recording tells of: force along the cutting speed per area of chip, N/m².
    pub specific_force_pa: Option<f64>,
    /// What was done with the data, in words.
    pub notes: Vec<String>,
    /// What could not have shown: effect and why.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// Forces held against the told cut; else why not.
    pub compared: Result<Compared, Silence>,
    /// Level over time for a page: s, level.
    pub level: Vec<(f64, f64)>,
}

/// Names that need a told cut.
const OF_CUT: [&str; 7] = [
    "edge_force",
    "cutting_force",
    "tool_wear",
    "runout",
    "wrench_scale",
    "wrench_misalignment",
    "cross_talk",
];

/// Whether this is a recording of forces or accelerations without joints.
#[must_use]
pub fn has_force(recording: &Recording) -> bool {
    recording.joint_count() == 0
        && recording
            .channels()
            .any(|channel| matches!(channel, Channel::Wrench(_) | Channel::Acceleration(_)))
}

/// Reads what forces say by themselves, and beside a told cut; `sigma`: standard uncertainties of the values of each of the model's effects, SI, in their order.
///
/// # Errors
/// Recordings that say nothing.
pub fn diagnose(
    model: &Model,
    sigma: &[Vec<f64>],
    recording: &Recording,
) -> Result<Diagnosis, Doubt> {
    let signal = Signal::of(recording)?;
    let level = phases::levels(&signal);
    let phases = phases::of(&signal, &level);
    let (tones, spindle_hz, resolution_hz) = lines::of(&signal, &phases, recording);
    let mut findings = Vec::new();
    let mut not_tested = Vec::new();
    let has = |state: State| phases.iter().any(|phase| phase.state == state);
    let mut notes = signal.notes.clone();
    if has(State::Cut) {
        let chatter = tones.iter().filter(|tone| tone.cause == Cause::Unforced);
        findings.extend(chatter.take(1).map(|tone| Finding::Chatter {
            tone: tone.clone(),
            resolution_hz,
            is_alone: spindle_hz.is_some(),
        }));
    } else {
        not_tested.push(("chatter", "cutting and air cannot be distinguished in this recording"));
    }
    if !signal.is_force {
        not_tested.push(("wrench_bias", "no force was recorded"));
    } else if has(State::Air) {
        findings.extend(phases::bias(&level, &phases));
        notes.extend(phases::drift(&level, &phases));
    } else {
        not_tested.push((
            "wrench_bias",
            "the tool is never in air, so the sensor is never known to be unloaded",
        ));
    }
    let compared = cut::compare(model, sigma, recording, &signal);
    match &compared {
        Ok(compared) => {
            findings.clear();
            not_tested.clone_from(&compared.not_tested);
        }
        Err(silence) => {
            not_tested.extend(OF_CUT.map(|kind| (kind, silence.why())));
            // Whoever tells of a cut that the forces cannot be held against is told of nothing else.
            if silence.is_grave() {
                findings.clear();
                notes.push(format!("not compared with the stated cut: {}", silence.why()));
            }
        }
    }
    let verdict = compared.as_ref().map_or_else(|_| alone(&findings), |one| one.verdict);
    not_tested.sort_unstable();
    Ok(Diagnosis {
        verdict,
        findings,
        noise: phases::noise(&level, &phases),
        specific_force_pa: specific_force(&signal, &phases, recording, spindle_hz),
        phases,
        tones,
        is_force: signal.is_force,
        channels: signal.names(),
        rows: signal.rows(),
        signal: signal.rms(),
        spindle_hz,
        notes,
        not_tested,
        compared,
        level: level.plot(),
    })
}

/// What forces say that are held against nothing.
fn alone(findings: &[Finding]) -> Verdict {
    let doubtful = |one: &Finding| matches!(one, Finding::Chatter { is_alone: false, .. });
    match findings {
        [] => Verdict::Undetermined,
        all if all.iter().any(doubtful) => Verdict::Undetermined,
        _ => Verdict::MissingPhysics,
    }
}

/// Of turning, force across the feed and the axis over depth times feed per turn, the reading in air taken off.
fn specific_force(
    signal: &Signal,
    phases: &[Phase],
    recording: &Recording,
    spindle_hz: Option<f64>,
) -> Option<f64> {
    let cut = recording.about.cut.as_ref().filter(|cut| cut.turning)?;
    let along = signal.channels.iter().position(|(axis, _)| signal.is_force && *axis == 1)?;
    let of = |state: State| {
        let here = phases.iter().filter(move |phase| phase.state == state);
        here.max_by_key(|phase| phase.rows.len())
    };
    let steady = of(State::Cut)?;
    let air = of(State::Air).map_or(0.0, |air| air.mean[along]);
    let feed = recording.column(Channel::Feed)?.get(steady.rows.clone())?;
    let feed = median(feed.iter().copied().filter(|feed| *feed > 0.0));
    let chip = cut.axial_depth_m * feed / spindle_hz?;
    (chip > 0.0).then(|| (steady.mean[along] - air).abs() / chip)
}
