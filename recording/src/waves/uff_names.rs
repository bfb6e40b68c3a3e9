//! Names of channels in a universal file: the location and, if several share it, the first field that distinguishes them.

use std::collections::BTreeMap;

use super::ResponseFunction;
use super::uff_head::{ChannelProperties, PlaceKey};

/// Data from which a channel or response is named.
pub(super) struct NamingData<'s> {
    pub(super) source: &'s ChannelProperties,
    /// Node and direction of the reference: only names with the same reference have to differ.
    pub(super) reference: &'s str,
    /// Samples per second; for channels over time.
    pub(super) rate_hz: Option<f64>,
}

impl NamingData<'_> {
    /// Fields that distinguish channels at one place, in the order in which they are tried.
    fn marks(&self) -> [String; 9] {
        let ChannelProperties { texts, numbers, component, ordinate, .. } = self.source;
        let [first, second, fourth, fifth] = texts.clone();
        let rate = self.rate_hz.map_or_else(String::new, |rate_hz| format!("at {rate_hz} Hz"));
        let (unit, number) = (format!("({})", ordinate.unit), format!("function {}", numbers[0]));
        let (label, component) = (ordinate.label.clone(), component.clone());
        [unit, label, component, first, second, fourth, fifth, number, rate]
    }

    /// Node and direction; without a geometry the response entity or the first ID line.
    fn plain_name(&self) -> &str {
        let ChannelProperties { texts, component, node, dof, .. } = self.source;
        let unplaced = [component, &texts[0]].into_iter().find(|text| !text.is_empty());
        unplaced.filter(|_| *node == 0).unwrap_or(dof)
    }
}

/// A name for each.
pub(super) fn names(unnamed: &[NamingData<'_>], notes: &mut Vec<String>) -> Vec<String> {
    let mut names = vec![String::new(); unnamed.len()];
    let mut groups: BTreeMap<(&str, &str), Vec<usize>> = BTreeMap::new();
    for (index, one) in unnamed.iter().enumerate() {
        groups.entry((one.plain_name(), one.reference)).or_default().push(index);
    }
    for ((plain, _), group) in groups {
        let marks: Vec<[String; 9]> = group.iter().map(|index| unnamed[*index].marks()).collect();
        let tells_apart = |field: &usize| {
            let mut values: Vec<&String> = marks.iter().map(|marks| &marks[*field]).collect();
            values.sort();
            values.dedup();
            values.len() == group.len() && values.iter().all(|value| !value.is_empty())
        };
        let field = (0..9).find(tells_apart);
        if field.is_none() && group.len() > 1 {
            notes.push(format!(
                "{} functions at `{plain}` have the same sensor name and are treated as separate channels",
                group.len()
            ));
        }
        for (number, (index, marks)) in (1..).zip(group.iter().zip(&marks)) {
            names[*index] = match field {
                _ if group.len() == 1 => plain.to_owned(),
                Some(field) => format!("{plain} {}", marks[field]),
                None => format!("{plain} #{number}"),
            };
        }
    }
    names
}

/// Names the places of response functions. Functions at one node without a difference are repeated
/// measurements of one place; without a geometry each is a separate place.
pub(super) fn name_responses(
    found: Vec<(ChannelProperties, ResponseFunction)>,
    notes: &mut Vec<String>,
) -> Vec<ResponseFunction> {
    let (mut places, mut known, mut place_of) = (Vec::new(), BTreeMap::new(), Vec::new());
    for (index, (source, function)) in found.iter().enumerate() {
        let reference = function.reference.as_str();
        let turn = if source.node == 0 { index } else { 0 };
        let place = *known
            .entry((PlaceKey::of(source, 0.0), &source.texts, reference, turn))
            .or_insert(places.len());
        if place == places.len() {
            places.push(NamingData { source, reference, rate_hz: None });
        }
        place_of.push(place);
    }
    let names = names(&places, notes);
    let named = |((_, function), place): ((ChannelProperties, ResponseFunction), usize)| {
        ResponseFunction { response: names.get(place).cloned().unwrap_or_default(), ..function }
    };
    drop(known);
    found.into_iter().zip(place_of).map(named).collect()
}
