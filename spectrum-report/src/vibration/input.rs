//! The channels of a recording in pieces without gaps, and the robot they belong to.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use recording::faults::{Fault, Faults};
use recording::files::FileError;
use recording::model::{RobotModel, presets};
use recording::waves::{self, Grid, Options, Record, Stored, Wave, Waves};
use spectrum::Axis;

use super::motion::Motion;
use super::samples::Samples;
use crate::error::Error;

/// How a recording is read, and what is known of its cut.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// Columns to analyse, by name or by number from 1. Default: none, which is all waveforms.
    pub columns: Vec<String>,
    /// Samples per second, Hz; above 0. Default: that of the file.
    pub rate_hz: Option<f64>,
    /// What the full scale of a WAV file stands for, in the channel's unit. Default: 1.
    pub full_scale: Option<f64>,
    /// How another program's table becomes a recording. Default: `NAME.mapping.toml` beside it, if
    /// it exists.
    pub mapping: Option<PathBuf>,
    /// The robot's model, for its modes and gears: a file, or the name of a preset. Default: the
    /// one that the recording's TOML names.
    pub model: Option<PathBuf>,
    /// Spindle speed, rev/min; above 0. Default: from the columns `spindle_rpm` or `tacho`.
    pub spindle_rpm: Option<f64>,
    /// Teeth of the cutter; only with a spindle speed, given or recorded. Default: from `[cut]` of the TOML beside the recording, otherwise
    /// unknown.
    pub teeth: Option<u32>,
    /// Feed along the path, mm/s; above 0. Default: from the columns `feed_mm_s`, `x_mm` … or
    /// `q1_deg` ….
    pub feed_mm_s: Option<f64>,
}

/// A channel, as the recording names it.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// Its own unit; empty if the recording states none.
    pub unit: String,
    /// The axis according to its name.
    pub axis: Option<Axis>,
    /// Number of missing samples.
    pub missing: usize,
}

/// A run of samples without a gap.
#[derive(Debug)]
pub(super) struct Piece {
    /// Time of the first sample, s, as the recording has it.
    pub(super) start_s: f64,
    /// The same on an axis on which time never runs back.
    pub(super) at_s: f64,
    pub(super) samples: Samples,
    pub(super) motion: Motion,
}

/// The samples of a recording, with the machine's motion and the robot's model.
#[derive(Debug)]
pub struct Source {
    /// The recording.
    pub file: PathBuf,
    /// Samples per second, Hz.
    pub rate_hz: f64,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// The robot's model, if one is given or named.
    pub model: Option<RobotModel>,
    /// Teeth of the cutter; 0 if unknown.
    pub teeth: u32,
    /// Remarks on the recording, as text.
    pub notes: Vec<String>,
    pub(super) pieces: Vec<Piece>,
    /// Whether the rate is not that of the file.
    pub(super) rate_is_given: bool,
}

impl Piece {
    pub(super) fn len(&self) -> usize {
        self.samples.len()
    }
}

/// Reads a recording; samples of long WAV files remain in the file.
///
/// # Errors
/// [`Error::File`] if a file cannot be read, or if a channel has no sample; [`Error::Model`] if there is
/// no such model; [`Error::Input`] if the recording has no samples over time.
pub fn read(file: impl AsRef<Path>, inputs: &Inputs) -> Result<Source, Error> {
    Source::read(file.as_ref(), inputs)
}

impl Source {
    fn read(file: &Path, inputs: &Inputs) -> Result<Self, Error> {
        let options = Options {
            rate_hz: inputs.rate_hz,
            columns: inputs.columns.clone(),
            mapping: inputs.mapping.clone(),
            full_scale: inputs.full_scale,
            ..Options::default()
        };
        if let Some(stored) = Stored::open(file, &options)? {
            return Self::stored(file, inputs, stored);
        }
        let waves = waves::read(file, &options)?;
        let model = model(file, inputs, &waves)?;
        let mut notes = waves.notes.clone();
        let teeth =
            inputs.teeth.or_else(|| waves.about.as_ref()?.cut.as_ref().map(|cut| cut.teeth));
        let (rate_hz, records) = uniform_records(file, waves, &mut notes)?;
        let mut channels: Vec<Channel> = records
            .first()
            .map(|record| record.channels.iter().map(channel).collect())
            .unwrap_or_default();
        let mut pieces = Vec::new();
        let mut end_s = f64::NEG_INFINITY;
        for record in records {
            let piece = piece(inputs, record, rate_hz, end_s, model.as_ref(), &mut notes);
            end_s = piece.at_s + piece.len() as f64 / rate_hz;
            for (index, channel) in channels.iter_mut().enumerate() {
                channel.missing += piece.samples.missing(index);
            }
            pieces.push(piece);
        }
        refuse_empty(file, &channels, &pieces)?;
        refuse_teeth_alone(inputs, &pieces)?;
        notes.dedup();
        let (file, teeth) = (file.to_owned(), teeth.unwrap_or(0));
        let rate_is_given = inputs.rate_hz.is_some();
        Ok(Self { file, rate_hz, channels, pieces, model, teeth, notes, rate_is_given })
    }

    /// One record whose samples remain in the file.
    fn stored(file: &Path, inputs: &Inputs, mut stored: Stored) -> Result<Self, Error> {
        let Grid::Time { rate_hz, start_s } = stored.grid else {
            return Err(Error::input(
                "the samples are over a length: there is no spectrum over time",
            ));
        };
        let model = inputs.model.as_deref().map(model_at).transpose()?;
        let mut notes = std::mem::take(&mut stored.notes);
        let channels = stored.channels.iter().map(channel).collect();
        let motion =
            Motion::of(inputs, &BTreeMap::new(), stored.len(), rate_hz, model.as_ref(), &mut notes);
        let samples = Samples::Stored(Box::new(stored));
        let pieces = vec![Piece { start_s, at_s: start_s, samples, motion }];
        refuse_teeth_alone(inputs, &pieces)?;
        let (file, teeth) = (file.to_owned(), inputs.teeth.unwrap_or(0));
        let rate_is_given = inputs.rate_hz.is_some();
        Ok(Self { file, rate_hz, channels, pieces, model, teeth, notes, rate_is_given })
    }

    /// Number of samples of each channel.
    pub(super) fn len(&self) -> usize {
        self.pieces.iter().map(Piece::len).sum()
    }

    /// Length of the recording without gaps, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.len() as f64 / self.rate_hz
    }

    /// Whether `what` finds something in any piece.
    pub(super) fn any(&self, what: impl Fn(&Motion) -> bool) -> bool {
        self.pieces.iter().any(|piece| what(&piece.motion))
    }

    /// The channels of one monitor: those of one unit, at most three; a complete wrench together.
    pub(super) fn groups(&self) -> Vec<Vec<usize>> {
        let of_unit = |unit: &str| -> Vec<usize> {
            (0..self.channels.len())
                .filter(|channel| self.channels[*channel].unit == unit)
                .collect()
        };
        let mut units: Vec<&str> = Vec::new();
        for channel in &self.channels {
            if !units.contains(&channel.unit.as_str()) {
                units.push(&channel.unit);
            }
        }
        let (forces, moments) = (of_unit("N"), of_unit("Nm"));
        if forces.len() == 3 && moments.len() == 3 && units.len() == 2 {
            return vec![[forces, moments].concat()];
        }
        let groups = units.into_iter().map(of_unit);
        groups
            .flat_map(|group| group.chunks(3).map(<[usize]>::to_vec).collect::<Vec<_>>())
            .collect()
    }
}

fn channel(wave: &Wave) -> Channel {
    let unit = if wave.unit == "1" { String::new() } else { displayed(&wave.unit) };
    let axis = wave.axis.and_then(|axis| Axis::ALL.get(axis).copied());
    // Columns without a name are named by their numbers.
    let is_unnamed = wave.name.bytes().all(|byte| byte.is_ascii_digit());
    let name = if is_unnamed { format!("column {}", wave.name) } else { wave.name.clone() };
    Channel { name, unit, axis, missing: 0 }
}

/// A unit as it is displayed.
fn displayed(unit: &str) -> String {
    match unit {
        "m_s2" | "m/s^2" | "m/s2" => "m/s²".to_owned(),
        unit => unit.to_owned(),
    }
}

/// The model that is given, otherwise the one that the recording's TOML names.
fn model(file: &Path, inputs: &Inputs, waves: &Waves) -> Result<Option<RobotModel>, Error> {
    let named = waves.about.as_ref().and_then(|about| about.model.as_ref());
    let beside = named.map(|name| presets::resolve_model_path(file, name.as_ref()));
    inputs.model.clone().or(beside).map(|name| model_at(&name)).transpose()
}

fn model_at(name: &Path) -> Result<RobotModel, Error> {
    RobotModel::read(name).map_err(|source| Error::Model { name: name.to_owned(), source })
}

/// The records over time with the rate and the channels of the first one; the others are reported.
fn uniform_records(
    file: &Path,
    waves: Waves,
    notes: &mut Vec<String>,
) -> Result<(f64, Vec<Record>), Error> {
    let mut faults = Faults::new(file.display().to_string());
    let rate = |record: &Record| match record.grid {
        Grid::Time { rate_hz, .. } => Some(rate_hz),
        Grid::Length { .. } => None,
    };
    let responses = waves.responses.len();
    let all = waves.records.len();
    let Some((rate_hz, first)) = waves.records.iter().find_map(|r| Some((rate(r)?, r))) else {
        let fault = if all > 0 {
            Fault::new("", "its samples are over a length, not over time")
                .help("`trued surface` reads profiles")
        } else {
            Fault::new("", "holds response functions, no samples over time")
                .help("`trued tap` reads response functions")
        };
        faults.push(fault.expected("samples over time"));
        return Err(FileError::Content(faults).into());
    };
    let names = |record: &Record| -> Vec<String> {
        record.channels.iter().map(|wave| wave.name.clone()).collect()
    };
    let expected = names(first);
    let fits = |record: &Record| rate(record) == Some(rate_hz) && names(record) == expected;
    for other in waves.records.iter().filter(|record| !fits(record)) {
        notes.push(format!(
            "not analysed: {} at {}; analysed: {} at {rate_hz} Hz (choose others with --column)",
            names(other).join(", "),
            rate(other).map_or("steps of length".to_owned(), |rate_hz| format!("{rate_hz} Hz")),
            expected.join(", "),
        ));
    }
    let records: Vec<Record> = waves.records.into_iter().filter(fits).collect();
    if responses > 0 {
        notes.push(format!("response functions, left out: {responses} (`trued tap` reads them)"));
    }
    Ok((rate_hz, records))
}

fn piece(
    inputs: &Inputs,
    record: Record,
    rate_hz: f64,
    end_s: f64,
    model: Option<&RobotModel>,
    notes: &mut Vec<String>,
) -> Piece {
    let start_s = match record.grid {
        Grid::Time { start_s, .. } => start_s,
        Grid::Length { .. } => 0.0,
    };
    let motion = Motion::of(inputs, &record.auxiliary, record.len(), rate_hz, model, notes);
    let taken = record.channels.into_iter().map(|wave| wave.values).collect();
    Piece { start_s, at_s: start_s.max(end_s), samples: Samples::held(taken), motion }
}

/// Without a speed of the spindle, a number of teeth would do nothing.
fn refuse_teeth_alone(inputs: &Inputs, pieces: &[Piece]) -> Result<(), Error> {
    let is_known = pieces.iter().any(|piece| piece.motion.has_spindle_speed());
    if inputs.teeth.is_none() || is_known {
        return Ok(());
    }
    Err(Error::input(
        "--teeth has no effect without the spindle speed, which the recording does not contain: give --spindle-rpm too, or leave out --teeth",
    ))
}

fn refuse_empty(file: &Path, channels: &[Channel], pieces: &[Piece]) -> Result<(), Error> {
    let samples: usize = pieces.iter().map(Piece::len).sum();
    let mut faults = Faults::new(file.display().to_string());
    for channel in channels.iter().filter(|channel| channel.missing == samples) {
        let fault = Fault::new(&channel.name, "contains no sample");
        faults.push(fault.expected("numbers").help("choose other columns: --column"));
    }
    if faults.is_empty() { Ok(()) } else { Err(FileError::Content(faults).into()) }
}
