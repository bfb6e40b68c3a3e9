//! One parameter of one effect of one robot over its recordings, and the bound given by a recording that did not find it.
//!
//! Selection: a diagnosis names only what stands out of the noise, so that the values alone are too large on average and begin too late. A recording that did not
//! find the effect is therefore kept as a bound: its size is below the least that this series would show. It is no bound, and says nothing, where the recording
//! names something else in its place: an effect of the same joint, of a neighbour or of the whole robot that rarely stands beside this one.

use std::collections::BTreeMap;

use crate::likelihood::Reading;
use crate::results::{EffectName, Finding, ParameterKey, Recording, Results};
use crate::settings::Settings;

/// A recording with information on the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// When, µs since 1970 in UTC.
    pub at_us: i64,
    /// Which recording of the robot, from 0.
    pub place: usize,
    /// The observation.
    pub reading: Reading,
    /// Ambient temperature, °C.
    pub ambient_c: Option<f64>,
}

/// A parameter over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Which.
    pub number: ParameterKey,
    /// In the order of time.
    pub observations: Vec<Observation>,
    /// Recordings of the robot in this domain.
    pub recordings: usize,
    /// Recordings without information on it, because they name another effect in its place.
    pub unknown: usize,
    /// Size of the effect on the measured quantity per unit of the parameter, root mean square and largest; medians over the recordings.
    pub per_unit: Option<[f64; 2]>,
}

impl Series {
    /// Recordings in which it was found.
    #[must_use]
    pub fn found(&self) -> usize {
        self.places().len()
    }

    /// Which recordings these are.
    pub(crate) fn places(&self) -> Vec<usize> {
        let is_found = |one: &&Observation| matches!(one.reading, Reading::Value { .. });
        self.observations.iter().filter(is_found).map(|one| one.place).collect()
    }
}

/// All series of the results.
#[must_use]
pub fn all(results: &Results, settings: &Settings) -> Vec<Series> {
    let recordings = |number: &ParameterKey| {
        let of = results
            .recordings
            .iter()
            .find(|(robot, _)| robot.name == number.robot && robot.domain == number.domain);
        of.map(|(_, recordings)| recordings.as_slice()).unwrap_or_default()
    };
    results
        .numbers
        .iter()
        .map(|(number, found)| of(number, found, recordings(number), settings))
        .filter(|series| series.observations.iter().any(|one| is_reported(&one.reading)))
        .collect()
}

/// Whether a value is determined by the data.
fn is_reported(reading: &Reading) -> bool {
    matches!(reading, Reading::Value { value, .. } if *value != 0.0)
}

fn of(
    number: &ParameterKey,
    found: &BTreeMap<String, Finding>,
    recordings: &[Recording],
    settings: &Settings,
) -> Series {
    let spread = Own::of(found, settings);
    let instead = substitutes(number, found, recordings, settings);
    let observation = |(place, recording): (usize, &Recording)| {
        let reading = match found.get(&recording.key) {
            Some(found) => {
                Reading::Value { value: found.value, sigma: found.sigma.unwrap_or(spread.sigma) }
            }
            None if recording.named.iter().any(|name| instead.contains(&name)) => return None,
            None => Reading::Below { limit: spread.limit, sigma: spread.sigma },
        };
        Some(Observation { at_us: recording.at_us, place, reading, ambient_c: recording.ambient_c })
    };
    let observations: Vec<Observation> =
        recordings.iter().enumerate().filter_map(observation).collect();
    Series {
        number: number.clone(),
        recordings: recordings.len(),
        unknown: recordings.len() - observations.len(),
        observations,
        per_unit: spread.per_unit,
    }
}

/// Statistics of the values of a series.
struct Own {
    /// Median standard uncertainty.
    sigma: f64,
    /// Least size that is found.
    limit: f64,
    per_unit: Option<[f64; 2]>,
}

impl Own {
    fn of(found: &BTreeMap<String, Finding>, settings: &Settings) -> Self {
        let sigma = median(found.values().filter_map(|found| found.sigma)).unwrap_or(0.0);
        let smallest = found.values().map(|found| found.value.abs()).fold(f64::INFINITY, f64::min);
        let rms = median(found.values().filter_map(|found| found.rms_per_unit));
        let max = median(found.values().filter_map(|found| found.max_per_unit));
        Self {
            sigma,
            limit: smallest.max(settings.detectable_sigmas * sigma),
            per_unit: rms.zip(max).map(|(rms, max)| [rms, max]),
        }
    }
}

/// Names that substitute for this effect: in recordings without it, and rarely beside it.
fn substitutes<'a>(
    number: &ParameterKey,
    found: &BTreeMap<String, Finding>,
    recordings: &'a [Recording],
    settings: &Settings,
) -> Vec<&'a EffectName> {
    let has = |recording: &Recording| found.contains_key(&recording.key);
    let is_near = |joint: Option<i64>| match (number.joint, joint) {
        (Some(own), Some(other)) => (own - other).abs() <= 1,
        _ => true,
    };
    let mut names: Vec<&EffectName> = recordings
        .iter()
        .filter(|recording| !has(recording))
        .flat_map(|recording| &recording.named)
        .filter(|name| {
            is_near(name.joint) && (&name.effect, name.joint) != (&number.effect, number.joint)
        })
        .collect();
    names.sort_unstable();
    names.dedup();
    let with = recordings.iter().filter(|recording| has(recording)).count().max(1) as f64;
    let beside = |name: &EffectName| {
        recordings
            .iter()
            .filter(|recording| has(recording) && recording.named.contains(name))
            .count() as f64
    };
    names.retain(|name| beside(name) <= settings.beside_share * with);
    names
}

/// Median.
#[must_use]
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
