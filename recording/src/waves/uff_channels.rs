//! From the time responses of a universal file to channels, and from channels to records.
//!
//! A channel is what was measured at one place: response entity, node, direction, quantity and unit. Functions that agree in
//! all of these are told apart as follows.
//!
//! - One with other ID lines is of another sensor, unless it is at a node of the geometry and of another date.
//! - One that begins where the other ends continues it; one that begins later belongs to it too, behind a gap.
//! - One over the same time is another measurement of the channel where the place is a node of the geometry, or where their
//!   dates differ. Else it is a channel of its own: a file without geometry has all sensors at node 0. So is one of another
//!   number at the same date and time of day.

use std::collections::BTreeMap;

use super::uff_head::Source;
use super::{Grid, Record, Wave};
use crate::faults::{Fault, Faults};

/// Header numbers have six digits: a start or an end may be off by this part of itself.
const SIX_DIGITS: f64 = 1e-5;

/// A time response.
#[derive(Debug)]
pub(super) struct Take {
    pub(super) start_s: f64,
    pub(super) rate_hz: f64,
    pub(super) values: Vec<f64>,
}

/// The time responses of one sensor.
#[derive(Debug)]
pub(super) struct Channel {
    source: Source,
    /// Unlike those of all other channels.
    pub(super) name: String,
    takes: Vec<Take>,
    /// Some are over the same time, of different numbers and without different dates.
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
    /// It is of another sensor.
    Elsewhere,
}

impl Take {
    fn end_s(&self) -> f64 {
        self.start_s + self.values.len() as f64 / self.rate_hz
    }

    /// How far apart two times may be that are the same in a header.
    fn tolerance_s(&self, at_s: f64) -> f64 {
        0.5 / self.rate_hz + SIX_DIGITS * at_s.abs()
    }

    fn begins_with(&self, other: &Self) -> bool {
        (self.start_s - other.start_s).abs() <= self.tolerance_s(self.start_s)
    }
}

impl Channel {
    fn place(&self, source: &Source, take: &Take) -> Place {
        let Some(last) = self.takes.last() else { return Place::Elsewhere };
        if !self.source.is_beside(source) || last.rate_hz != take.rate_hz {
            return Place::Elsewhere;
        }
        let (on_node, same_texts) = (source.node != 0, self.source.texts == source.texts);
        let dated_apart = self.source.is_dated_apart(source);
        if !same_texts && !(on_node && dated_apart) {
            return Place::Elsewhere;
        }
        let beside = self.source.is_at_one_moment(source) && self.is_of_other_number(source);
        let gap_s = take.start_s - last.end_s();
        let adjoins = gap_s.abs() <= last.tolerance_s(last.end_s());
        match () {
            () if adjoins && same_texts => Place::Continues,
            () if adjoins || gap_s > 0.0 => Place::Later,
            () if dated_apart || (on_node && !beside) => Place::Again,
            () => Place::Elsewhere,
        }
    }

    fn is_of_other_number(&self, source: &Source) -> bool {
        self.source.numbers[0] != source.numbers[0]
    }

    /// What tells channels of one place apart, in the order in which it is tried.
    fn marks(&self) -> [String; 10] {
        let Source { texts, numbers, component, ordinate, .. } = &self.source;
        let [first, second, fourth, fifth] = texts.clone();
        let rate_hz = self.takes.first().map_or(0.0, |take| take.rate_hz);
        let (unit, rate) = (format!("({})", ordinate.unit), format!("at {rate_hz} Hz"));
        let (label, component) = (ordinate.label.clone(), component.clone());
        let number = format!("function {}", numbers[0]);
        [unit, label, component, first, second, fourth, fifth, number, rate, String::new()]
    }

    /// Node and direction; without a geometry the response entity or what the first ID line says.
    fn plain_name(&self) -> String {
        let Source { texts, component, node, dof, .. } = &self.source;
        let unplaced = [component, &texts[0]].into_iter().find(|text| !text.is_empty());
        unplaced.filter(|_| *node == 0).unwrap_or(dof).clone()
    }
}

/// Adds a time response to the channel that it belongs to, or as a new one.
pub(super) fn add(channels: &mut Vec<Channel>, source: Source, take: Take) {
    let of_channel = |channel: &Channel| {
        let other_texts = channel.source.texts != source.texts;
        (other_texts, channel.place(&source, &take), channel.is_of_other_number(&source))
    };
    let places = channels.iter().map(of_channel).enumerate();
    let near = places.filter(|(_, (_, place, _))| *place != Place::Elsewhere);
    let best = near.min_by_key(|(_, place)| *place);
    let found = best.and_then(|(at, place)| Some((channels.get_mut(at)?, place)));
    let Some((channel, (_, place, other_number))) = found else {
        channels.push(Channel {
            source,
            name: String::new(),
            takes: vec![take],
            is_renumbered: false,
        });
        return;
    };
    channel.is_renumbered |=
        place == Place::Again && other_number && !channel.source.is_dated_apart(&source);
    match channel.takes.last_mut() {
        Some(last) if place == Place::Continues => last.values.extend(take.values),
        _ => channel.takes.push(take),
    }
}

/// Says which channels may be several sensors: functions over the same time, of which nothing but their numbers differs.
pub(super) fn note_renumbered(channels: &[Channel], notes: &mut Vec<String>) {
    let renumbered = channels.iter().filter(|channel| channel.is_renumbered);
    let names: Vec<String> = renumbered.map(|channel| format!("`{}`", channel.name)).collect();
    if !names.is_empty() {
        notes.push(format!(
            "functions at {} over the same time differ in their numbers alone: taken as repeated measurements of one sensor; if \
             they are of several, give these different ID lines or nodes",
            names.join(", ")
        ));
    }
}

/// Gives every channel a name of its own: its place, and where that is not enough, the first field that tells it apart.
pub(super) fn name(channels: &mut [Channel], notes: &mut Vec<String>) {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (at, channel) in channels.iter().enumerate() {
        groups.entry(channel.plain_name()).or_default().push(at);
    }
    for (plain, group) in groups {
        let marks: Vec<[String; 10]> = group.iter().map(|at| channels[*at].marks()).collect();
        let tells_apart = |field: &usize| {
            let mut values: Vec<&String> = marks.iter().map(|marks| &marks[*field]).collect();
            values.sort();
            values.dedup();
            values.len() == group.len() && values.iter().all(|value| !value.is_empty())
        };
        let field = (0..10).find(tells_apart);
        if field.is_none() && group.len() > 1 {
            notes.push(format!(
                "{} functions at `{plain}` over the same time differ in nothing that names a sensor: taken as channels of \
                 their own",
                group.len()
            ));
        }
        for (number, (at, marks)) in (1..).zip(group.iter().zip(&marks)) {
            channels[*at].name = match field {
                _ if group.len() == 1 => plain.clone(),
                Some(field) => format!("{plain} {}", marks[field]),
                None => format!("{plain} #{number}"),
            };
        }
    }
}

/// The records of the channels: those of one rate beside each other, by their start, or where a channel was measured
/// several times over the same time, by their turn.
pub(super) fn records(
    channels: Vec<Channel>,
    asked: Option<Grid>,
    faults: &mut Faults,
    notes: &mut Vec<String>,
) -> Vec<Record> {
    let mut of_rate: Vec<Vec<Channel>> = Vec::new();
    let rate_hz = |channel: &Channel| channel.takes.first().map(|take| take.rate_hz);
    for channel in channels {
        let same =
            |group: &&mut Vec<Channel>| group.first().map(rate_hz) == Some(rate_hz(&channel));
        match of_rate.iter_mut().find(same) {
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
            records.extend(record(&group, &turn, asked, notes));
        }
    }
    records
}

/// Which take of each channel, if any, belongs to which record.
type Turn = Vec<Option<usize>>;

fn turns(group: &[Channel]) -> Result<Vec<Turn>, Box<Fault>> {
    let Some(first) = group.first() else { return Ok(Vec::new()) };
    let agree = |channel: &Channel| {
        let starts = channel.takes.iter().zip(&first.takes);
        channel.takes.len() == first.takes.len() && starts.clone().all(|(a, b)| a.begins_with(b))
    };
    if group.iter().all(agree) {
        return Ok((0..first.takes.len()).map(|turn| vec![Some(turn); group.len()]).collect());
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
            "holds {} of `{}` and {} of `{}` over the same time: which belong together is not stated",
            again.takes.len(),
            again.name,
            other.takes.len(),
            other.name
        );
        let fault = Fault::new("", message)
            .expected("as many functions of each channel")
            .help("ask for one channel by its name (--column), or export each measurement to a file of its own");
        return Err(Box::new(fault));
    }
    let mut starts: Vec<&Take> = group.iter().flat_map(|channel| &channel.takes).collect();
    starts.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    starts.dedup_by(|b, a| b.begins_with(a));
    let turn = |start: &&Take| {
        let at = |channel: &Channel| channel.takes.iter().position(|take| take.begins_with(start));
        group.iter().map(at).collect()
    };
    Ok(starts.iter().map(turn).collect())
}

/// One record, cut to the time that all its channels have.
fn record(
    group: &[Channel],
    turn: &Turn,
    asked: Option<Grid>,
    notes: &mut Vec<String>,
) -> Option<Record> {
    let takes = group.iter().zip(turn);
    let takes: Vec<(&Channel, &Take)> =
        takes.filter_map(|(channel, turn)| Some((channel, channel.takes.get((*turn)?)?))).collect();
    let (_, first) = takes.first()?;
    let length = |take: &Take| take.values.len();
    let common = takes.iter().map(|(_, take)| length(take)).min()?;
    let longer = takes.iter().filter(|(_, take)| length(take) > common);
    let longer: Vec<String> =
        longer.map(|(c, take)| format!("`{}` ({})", c.name, length(take))).collect();
    if !longer.is_empty() {
        let longer = longer.join(", ");
        notes.push(format!("cut to the {common} samples that all channels have; longer: {longer}"));
    }
    let grid = Grid::Time { start_s: first.start_s, rate_hz: first.rate_hz };
    let wave = |(channel, take): &(&Channel, &Take)| {
        let values = take.values.get(..common).unwrap_or_default().to_vec();
        Wave::new(&channel.name, &channel.source.ordinate.unit, values)
    };
    let channels = takes.iter().map(wave).collect();
    Some(Record { grid: asked.unwrap_or(grid), channels, beside: BTreeMap::new() })
}
