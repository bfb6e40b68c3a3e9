//! Waveforms of `trued.recording/1`: the data of `series` as evenly sampled records.

use super::columns::{self, Columns, Positions};
use super::{Options, Wave, Waves, pick};
use crate::faults::{Fault, Faults, Setting};
use crate::series::{Channel, Column, Recording};

/// The header is searched in this many bytes.
const HEAD_BYTES: usize = 64 << 10;

/// Whether a file begins with the header of a `trued.recording/1`: `t_s` and another known column.
pub(super) fn is_recording(bytes: &[u8]) -> bool {
    let head = bytes.get(..HEAD_BYTES.min(bytes.len())).unwrap_or_default();
    let text = String::from_utf8_lossy(head);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let Some(line) = text.lines().find(|line| !line.trim().is_empty()) else { return false };
    let names: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
    let ours = |name: &&str| matches!(Column::named(name), Ok(Column::Channel(..)));
    names.contains(&"t_s") && names.iter().any(ours)
}

pub(super) fn waves(recording: Recording, options: &Options) -> Result<Waves, Faults> {
    let mut faults = Faults::new(recording.file.display().to_string());
    columns::check(options, &mut faults);
    let known_channels: Vec<Channel> = recording.channels().collect();
    let mut names: Vec<String> =
        known_channels.iter().map(|channel| name(&recording, *channel)).collect();
    names.extend(recording.other.iter().map(|(name, _)| name.clone()));
    let mut chosen = pick::columns(&names, &options.columns, &mut faults);
    if options.columns.is_empty() {
        let force = |c: &Channel| matches!(c, Channel::Wrench(_) | Channel::Acceleration(_));
        chosen =
            (0..known_channels.len()).filter(|column| force(&known_channels[*column])).collect();
        if chosen.is_empty() {
            chosen = (known_channels.len()..names.len())
                .filter(|column| {
                    cells(&recording, column - known_channels.len(), &mut Faults::new("")).is_some()
                })
                .collect();
        }
    }
    if chosen.is_empty() && options.columns.is_empty() {
        let fault = Fault::new("", "no column contains a waveform").expected("fx_N …, ax_m_s2 …");
        let help = format!("select a column; there are {}", names.join(", "));
        faults.push(fault.help(help).by(&[Setting::Columns]));
    }
    let mut channels = Vec::new();
    for column in chosen {
        let found = match known_channels.get(column) {
            Some(channel) => Some(wave(&recording, *channel)),
            None => cells(&recording, column - known_channels.len(), &mut faults).map(|values| {
                let unit = super::names::split(&names[column]).1.unwrap_or("1").to_owned();
                Wave::new(&names[column], unit, values)
            }),
        };
        channels.extend(found);
    }
    let mut notes: Vec<String> = recording.notes.clone();
    notes.retain(|note| {
        !note.starts_with("unused columns") && !note.starts_with("not read as a quantity")
    });
    let beside = known_channels
        .iter()
        .filter_map(|channel| Some((*channel, recording.column(*channel)?.to_vec())))
        .collect();
    let columns = Columns {
        stand: Positions::Time(recording.t_s.clone()),
        named: "t_s".to_owned(),
        segment: recording.segment.clone(),
        channels,
        beside,
    };
    let records =
        columns.records(options, &mut faults, &mut notes, |row, fault| fault.in_row(row + 1));
    let waves = Waves {
        file: recording.file,
        records,
        about: Some(recording.metadata),
        responses: Vec::new(),
        notes,
    };
    faults.into_result((!waves.records.is_empty()).then_some(waves))
}

fn name(recording: &Recording, channel: Channel) -> String {
    let kind = recording.joint_kind(channel.joint().unwrap_or(0));
    channel.name(channel.unit_in(recording.units, kind))
}

/// A known column, in the unit of its name in the file.
fn wave(recording: &Recording, channel: Channel) -> Wave {
    let kind = recording.joint_kind(channel.joint().unwrap_or(0));
    let unit = channel.unit_in(recording.units, kind);
    let values = recording.column(channel).unwrap_or_default().iter();
    let values = values.map(|v| unit.map_or(*v, |unit| unit.from_si(*v))).collect();
    Wave::new(channel.name(unit), unit.map_or("1", |unit| unit.name), values)
}

/// An unknown column as numbers; `None` if a cell is not a number.
fn cells(recording: &Recording, index: usize, faults: &mut Faults) -> Option<Vec<f64>> {
    let (name, cells) = recording.other.get(index)?;
    let mut values = Vec::with_capacity(cells.len());
    for (row, cell) in cells.iter().enumerate() {
        let number = match cell.trim() {
            "" => Some(f64::NAN),
            cell => cell.parse().or_else(|_| cell.replace(',', ".").parse()).ok(),
        };
        let Some(number) = number.filter(|number: &f64| !number.is_infinite()) else {
            let fault = Fault::new(name, format!("`{cell}` in row {} of the data", row + 1));
            faults.push(fault.expected("a finite number, or nothing"));
            return None;
        };
        values.push(number);
    }
    Some(values)
}
