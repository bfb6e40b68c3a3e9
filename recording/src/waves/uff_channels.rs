//! Converts the time responses of a universal file to channels, and channels to records.
//!
//! A channel is a quantity at one place: response entity, node, direction, quantity and unit.
//! Functions that agree in all of these are distinguished as follows.
//!
//! - One with other ID lines belongs to another sensor, unless it is at a node of the geometry and
//!   has another date.
//! - One that begins where the other ends continues it; one that begins later belongs to it too,
//!   after a gap.
//! - One over the same time is another measurement of the channel if the place is a node of the
//!   geometry, or if their dates differ. Otherwise it is a separate channel: a file without
//!   geometry has all sensors at node 0. So is one with another number at the same date and time of
//!   day.

use std::collections::BTreeMap;

use super::uff_head::{ChannelProperties, PlaceKey};
use super::uff_names::{self, NamingData};
use super::{Grid, Record, Wave};
use crate::faults::{Fault, Faults, Setting};

/// Header numbers have six digits: a start or an end may be off by this share.
const SIX_DIGITS: f64 = 1e-5;

/// A time response.
#[derive(Debug)]
pub(super) struct TimeResponse {
    pub(super) start_s: f64,
    pub(super) rate_hz: f64,
    pub(super) values: Vec<f64>,
}

/// The time responses of one sensor.
#[derive(Debug)]
pub(super) struct Channel {
    source: ChannelProperties,
    /// Unique among the channels.
    pub(super) name: String,
    takes: Vec<TimeResponse>,
    /// Whether some are over the same time, with different numbers and without different dates.
    is_renumbered: bool,
}

/// How a function relates to the last one of a channel, the closest relation first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// It begins where the last one ends.
    Continues,
    /// It begins after the end of the last one.
    Later,
    /// It is another measurement over the same time.
    Again,
}

impl TimeResponse {
    fn end_s(&self) -> f64 {
        self.start_s + self.values.len() as f64 / self.rate_hz
    }

    /// Largest difference of two times that count as equal in a header.
    fn tolerance_s(&self, at_s: f64) -> f64 {
        0.5 / self.rate_hz + SIX_DIGITS * at_s.abs()
    }

    fn begins_with(&self, other: &Self) -> bool {
        (self.start_s - other.start_s).abs() <= self.tolerance_s(self.start_s)
    }
}

impl Channel {
    /// How a function at the channel's place relates to it; `None` where it is of another sensor.
    fn place(&self, source: &ChannelProperties, take: &TimeResponse) -> Option<Place> {
        let last = self.takes.last()?;
        let (on_node, same_texts) = (source.node != 0, self.source.texts == source.texts);
        let dated_apart = self.source.has_other_date(source);
        if !(same_texts || on_node && dated_apart) {
            return None;
        }
        let beside = self.source.has_same_time(source) && self.is_of_other_number(source);
        let gap_s = take.start_s - last.end_s();
        let adjoins = gap_s.abs() <= last.tolerance_s(last.end_s());
        match () {
            () if adjoins && same_texts => Some(Place::Continues),
            () if adjoins || gap_s > 0.0 => Some(Place::Later),
            () if dated_apart || (on_node && !beside) => Some(Place::Again),
            () => None,
        }
    }

    fn unnamed(&self) -> NamingData<'_> {
        let rate_hz = self.takes.first().map(|take| take.rate_hz);
        NamingData { source: &self.source, reference: "", rate_hz }
    }

    fn is_of_other_number(&self, source: &ChannelProperties) -> bool {
        self.source.numbers[0] != source.numbers[0]
    }
}

/// The channels of a file.
#[derive(Debug, Default)]
pub(super) struct Channels {
    pub(super) all: Vec<Channel>,
    /// Indices by place.
    at_place: BTreeMap<PlaceKey, Vec<usize>>,
}

impl Channels {
    /// Adds a time response to the channel that it belongs to, or as a new one.
    pub(super) fn add(&mut self, source: ChannelProperties, take: TimeResponse) {
        let at_place = self.at_place.entry(PlaceKey::of(&source, take.rate_hz)).or_default();
        let relation = |index: &usize| {
            let channel = self.all.get(*index)?;
            let place = channel.place(&source, &take)?;
            let other_texts = channel.source.texts != source.texts;
            Some((other_texts, place, channel.is_of_other_number(&source), *index))
        };
        let best = at_place.iter().filter_map(relation).min();
        let found = best
            .and_then(|(_, place, other, index)| Some((self.all.get_mut(index)?, place, other)));
        let Some((channel, place, other_number)) = found else {
            at_place.push(self.all.len());
            let (name, takes) = (String::new(), vec![take]);
            self.all.push(Channel { source, name, takes, is_renumbered: false });
            return;
        };
        channel.is_renumbered |=
            place == Place::Again && other_number && !channel.source.has_other_date(&source);
        match channel.takes.last_mut() {
            Some(last) if place == Place::Continues => last.values.extend(take.values),
            _ => channel.takes.push(take),
        }
    }

    /// The channels, each with a unique name.
    pub(super) fn named(self, notes: &mut Vec<String>) -> Vec<Channel> {
        let names =
            uff_names::names(&self.all.iter().map(Channel::unnamed).collect::<Vec<_>>(), notes);
        let named = |(channel, name)| Channel { name, ..channel };
        self.all.into_iter().zip(names).map(named).collect()
    }
}

/// Notes which channels may be several sensors: functions over the same time that differ only in
/// their numbers.
pub(super) fn note_renumbered(channels: &[Channel], notes: &mut Vec<String>) {
    let renumbered = channels.iter().filter(|channel| channel.is_renumbered);
    let names: Vec<String> = renumbered.map(|channel| format!("`{}`", channel.name)).collect();
    if !names.is_empty() {
        notes.push(format!(
            "functions at {} over the same time differ only in their numbers and are treated as repeated measurements of one sensor; if \
             they are of several, give these different ID lines or nodes",
            names.join(", ")
        ));
    }
}

/// The records of the channels: those of one rate together, by their start, or, for a channel that
/// was measured several times over the same time, by their order.
pub(super) fn records(
    channels: Vec<Channel>,
    requested_grid: Option<Grid>,
    faults: &mut Faults,
    notes: &mut Vec<String>,
) -> Vec<Record> {
    let mut of_rate: Vec<Vec<Channel>> = Vec::new();
    let mut group_of: BTreeMap<Option<u64>, usize> = BTreeMap::new();
    for channel in channels {
        let rate_bits = channel.takes.first().map(|take| take.rate_hz.to_bits());
        let group = *group_of.entry(rate_bits).or_insert(of_rate.len());
        match of_rate.get_mut(group) {
            Some(group) => group.push(channel),
            None => of_rate.push(vec![channel]),
        }
    }
    let mut records = Vec::new();
    for group in of_rate {
        let turns = match turns(&group) {
            Ok(turns) => turns,
            Err(fault) => {
                faults.push(*fault);
                continue;
            }
        };
        for turn in turns {
            records.extend(record(&group, &turn, requested_grid, notes));
        }
    }
    records
}

/// A take of a channel.
#[derive(Debug, Clone, Copy)]
struct Part {
    channel: usize,
    take: usize,
}

/// The takes of one record, by their channels.
type RecordParts = Vec<Part>;

fn turns(group: &[Channel]) -> Result<Vec<RecordParts>, Box<Fault>> {
    let Some(first) = group.first() else { return Ok(Vec::new()) };
    let agree = |channel: &Channel| {
        let starts = channel.takes.iter().zip(&first.takes);
        channel.takes.len() == first.takes.len() && starts.clone().all(|(a, b)| a.begins_with(b))
    };
    if group.iter().all(agree) {
        let turn = |take| (0..group.len()).map(|channel| Part { channel, take }).collect();
        return Ok((0..first.takes.len()).map(turn).collect());
    }
    let runs_on = |channel: &&Channel| {
        channel
            .takes
            .windows(2)
            .all(|pair| pair[1].start_s >= pair[0].end_s() - pair[0].tolerance_s(pair[0].end_s()))
    };
    if let Some(again) = group.iter().find(|channel| !runs_on(channel)) {
        let other = group.iter().find(|channel| !agree(channel)).unwrap_or(first);
        let other = if other.name == again.name { first } else { other };
        let message = format!(
            "contains {} of `{}` and {} of `{}` over the same time, without stating which belong together",
            again.takes.len(),
            again.name,
            other.takes.len(),
            other.name
        );
        let fault = Fault::new("", message)
            .expected("the same number of functions of each channel")
            .help("select one channel, or export each measurement to a separate file")
            .by(&[Setting::Columns]);
        return Err(Box::new(fault));
    }
    Ok(turns_by_start(group))
}

/// Takes that begin at one time belong together.
fn turns_by_start(group: &[Channel]) -> Vec<RecordParts> {
    let parts = group.iter().enumerate().flat_map(|(channel, parts_of_channel)| {
        parts_of_channel
            .takes
            .iter()
            .enumerate()
            .map(move |(take, start)| (start, Part { channel, take }))
    });
    let mut parts: Vec<(&TimeResponse, Part)> = parts.collect();
    parts.sort_by(|(a, _), (b, _)| a.start_s.total_cmp(&b.start_s));
    let mut turns: Vec<RecordParts> = Vec::new();
    let mut first: Option<&TimeResponse> = None;
    // The measurement of each channel's last record: a channel has one record per measurement.
    let mut last_turn = vec![0; group.len()];
    for (take, part) in parts {
        let begins_with_it = first.is_some_and(|first| take.begins_with(first));
        if !begins_with_it || last_turn[part.channel] == turns.len() {
            first = Some(take);
            turns.push(RecordParts::new());
        }
        last_turn[part.channel] = turns.len();
        if let Some(turn) = turns.last_mut() {
            turn.push(part);
        }
    }
    turns.iter_mut().for_each(|turn| turn.sort_by_key(|part| part.channel));
    turns
}

/// One record, cut to the time that all its channels have.
fn record(
    group: &[Channel],
    turn: &[Part],
    requested_grid: Option<Grid>,
    notes: &mut Vec<String>,
) -> Option<Record> {
    let take = |part: &Part| {
        let channel = group.get(part.channel)?;
        Some((channel, channel.takes.get(part.take)?))
    };
    let takes: Vec<(&Channel, &TimeResponse)> = turn.iter().filter_map(take).collect();
    let (_, first) = takes.first()?;
    let length = |take: &TimeResponse| take.values.len();
    let common = takes.iter().map(|(_, take)| length(take)).min()?;
    let longer = takes.iter().filter(|(_, take)| length(take) > common);
    let longer: Vec<String> =
        longer.map(|(c, take)| format!("`{}` ({})", c.name, length(take))).collect();
    if !longer.is_empty() {
        let longer = longer.join(", ");
        notes.push(format!("cut to the {common} samples that all channels have; longer: {longer}"));
    }
    let grid = Grid::Time { start_s: first.start_s, rate_hz: first.rate_hz };
    let wave = |(channel, take): &(&Channel, &TimeResponse)| {
        let values = take.values.get(..common).unwrap_or_default().to_vec();
        Wave::new(&channel.name, &channel.source.ordinate.unit, values)
    };
    let channels = takes.iter().map(wave).collect();
    Some(Record { grid: requested_grid.unwrap_or(grid), channels, auxiliary: BTreeMap::new() })
}
