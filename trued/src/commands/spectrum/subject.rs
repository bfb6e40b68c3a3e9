//! The channels of a recording in pieces without gaps, and the robot they belong to.

use std::collections::BTreeMap;
use std::path::PathBuf;

use recording::faults::{Fault, Faults};
use recording::files::FileError;
use recording::model::RobotModel;
use recording::waves::{self, Grid, Options, Record, Stored, Wave, Waves};
use spectrum::Axis;

use super::Spectrum;
use super::motion::Motion;
use super::samples::Samples;
use crate::exit::Failure;
use crate::input;

/// A channel, as the recording names it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Channel {
    pub(super) name: String,
    /// Its own unit; empty if the recording states none.
    pub(super) unit: String,
    /// The axis according to its name.
    pub(super) axis: Option<Axis>,
    /// Number of missing samples.
    pub(super) holes: usize,
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

/// The data to be analysed.
#[derive(Debug)]
pub(super) struct Subject {
    pub(super) file: PathBuf,
    pub(super) rate_hz: f64,
    pub(super) channels: Vec<Channel>,
    pub(super) pieces: Vec<Piece>,
    pub(super) model: Option<RobotModel>,
    pub(super) teeth: u32,
    pub(super) notes: Vec<String>,
}

impl Piece {
    pub(super) fn len(&self) -> usize {
        self.samples.len()
    }
}

impl Subject {
    pub(super) fn read(asked: &Spectrum) -> Result<Self, Failure> {
        let options = Options {
            rate_hz: asked.rate,
            columns: asked.columns.clone(),
            mapping: asked.mapping.clone(),
            full_scale: asked.scale,
            ..Options::default()
        };
        if let Some(stored) = Stored::open(&asked.file, &options).map_err(input::unusable)? {
            return Self::stored(asked, stored);
        }
        let waves = waves::read(&asked.file, &options).map_err(input::unusable)?;
        let model = model(asked, &waves)?;
        let mut notes = waves.notes.clone();
        let teeth = asked.teeth.or_else(|| waves.about.as_ref()?.cut.as_ref().map(|cut| cut.teeth));
        let (rate_hz, records) = alike(asked, waves, &mut notes)?;
        let mut channels: Vec<Channel> = records
            .first()
            .map(|record| record.channels.iter().map(channel).collect())
            .unwrap_or_default();
        let mut pieces = Vec::new();
        let mut end_s = f64::NEG_INFINITY;
        for record in records {
            let piece = piece(asked, record, rate_hz, end_s, model.as_ref(), &mut notes);
            end_s = piece.at_s + piece.len() as f64 / rate_hz;
            for (at, channel) in channels.iter_mut().enumerate() {
                channel.holes += piece.samples.holes(at);
            }
            pieces.push(piece);
        }
        refuse_empty(asked, &channels, &pieces)?;
        notes.dedup();
        let file = asked.file.clone();
        Ok(Self { file, rate_hz, channels, pieces, model, teeth: teeth.unwrap_or(0), notes })
    }

    /// One record whose samples remain in the file.
    fn stored(asked: &Spectrum, mut stored: Stored) -> Result<Self, Failure> {
        let Grid::Time { rate_hz, start_s } = stored.grid else {
            return Err(Failure::input("samples over a length have no spectrum over time"));
        };
        let model = asked.model.as_deref().map(input::model).transpose()?;
        let mut notes = std::mem::take(&mut stored.notes);
        let channels = stored.channels.iter().map(channel).collect();
        let motion =
            Motion::of(asked, &BTreeMap::new(), stored.len(), rate_hz, model.as_ref(), &mut notes);
        let samples = Samples::Stored(Box::new(stored));
        let pieces = vec![Piece { start_s, at_s: start_s, samples, motion }];
        let (file, teeth) = (asked.file.clone(), asked.teeth.unwrap_or(0));
        Ok(Self { file, rate_hz, channels, pieces, model, teeth, notes })
    }

    /// Samples of each channel.
    pub(super) fn len(&self) -> usize {
        self.pieces.iter().map(Piece::len).sum()
    }

    /// Length of the recording without gaps, s.
    pub(super) fn seconds(&self) -> f64 {
        self.len() as f64 / self.rate_hz
    }

    /// Whether `what` finds something in any piece.
    pub(super) fn any(&self, what: impl Fn(&Motion) -> bool) -> bool {
        self.pieces.iter().any(|piece| what(&piece.motion))
    }

    /// The channels of one monitor: those of one unit, at most three; a complete wrench together.
    pub(super) fn groups(&self) -> Vec<Vec<usize>> {
        let of_unit = |unit: &str| -> Vec<usize> {
            (0..self.channels.len()).filter(|at| self.channels[*at].unit == unit).collect()
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
    let unit = if wave.unit == "1" { String::new() } else { told(&wave.unit) };
    let axis = wave.axis.and_then(|axis| Axis::ALL.get(axis).copied());
    // Columns without a name are named by their numbers.
    let bare = wave.name.bytes().all(|byte| byte.is_ascii_digit());
    let name = if bare { format!("column {}", wave.name) } else { wave.name.clone() };
    Channel { name, unit, axis, holes: 0 }
}

/// Units as they are written for people.
fn told(unit: &str) -> String {
    match unit {
        "m_s2" | "m/s^2" | "m/s2" => "m/s²".to_owned(),
        unit => unit.to_owned(),
    }
}

fn model(asked: &Spectrum, waves: &Waves) -> Result<Option<RobotModel>, Failure> {
    let named = waves.about.as_ref().and_then(|about| about.model.as_ref());
    let beside = named.map(|name| input::beside(&asked.file, name.as_ref()));
    asked.model.clone().or(beside).map(|name| input::model(&name)).transpose()
}

/// The records over time with the rate and the channels of the first one; the others are reported.
fn alike(
    asked: &Spectrum,
    waves: Waves,
    notes: &mut Vec<String>,
) -> Result<(f64, Vec<Record>), Failure> {
    let mut faults = Faults::of(asked.file.display().to_string());
    let rate = |record: &Record| match record.grid {
        Grid::Time { rate_hz, .. } => Some(rate_hz),
        Grid::Length { .. } => None,
    };
    let responses = waves.responses.len();
    let all = waves.records.len();
    let Some((rate_hz, first)) = waves.records.iter().find_map(|r| Some((rate(r)?, r))) else {
        let fault = if all > 0 {
            Fault::new("", "its samples stand over a length, not over time")
                .help("`trued surface` reads profiles")
        } else {
            Fault::new("", "holds response functions, no samples over time")
                .help("`trued tap` reads response functions")
        };
        faults.push(fault.expected("samples over time"));
        return Err(input::unusable(FileError::Content(faults)));
    };
    let names = |record: &Record| -> Vec<String> {
        record.channels.iter().map(|wave| wave.name.clone()).collect()
    };
    let wanted = names(first);
    let fits = |record: &Record| rate(record) == Some(rate_hz) && names(record) == wanted;
    for other in waves.records.iter().filter(|record| !fits(record)) {
        notes.push(format!(
            "left out: {} at {}; looked at are {} at {rate_hz} Hz (--column asks for others)",
            names(other).join(", "),
            rate(other).map_or("steps of length".to_owned(), |rate_hz| format!("{rate_hz} Hz")),
            wanted.join(", "),
        ));
    }
    let records: Vec<Record> = waves.records.into_iter().filter(fits).collect();
    if responses > 0 {
        notes.push(format!("response functions, left out: {responses} (`trued tap` reads them)"));
    }
    Ok((rate_hz, records))
}

fn piece(
    asked: &Spectrum,
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
    let motion = Motion::of(asked, &record.beside, record.len(), rate_hz, model, notes);
    let taken = record.channels.into_iter().map(|wave| wave.values).collect();
    Piece { start_s, at_s: start_s.max(end_s), samples: Samples::held(taken), motion }
}

fn refuse_empty(asked: &Spectrum, channels: &[Channel], pieces: &[Piece]) -> Result<(), Failure> {
    let samples: usize = pieces.iter().map(Piece::len).sum();
    let mut faults = Faults::of(asked.file.display().to_string());
    for channel in channels.iter().filter(|channel| channel.holes == samples) {
        let fault = Fault::new(&channel.name, "holds no sample at all");
        faults.push(fault.expected("numbers").help("choose other columns: --column"));
    }
    if faults.is_empty() { Ok(()) } else { Err(input::unusable(FileError::Content(faults))) }
}
