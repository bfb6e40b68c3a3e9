//! A fleet in which nothing changes.
//!
//! Forty robots with six numbers each. A number has a level, a standard uncertainty as stated, scatter between recordings of none to three of these, some
//! recordings that miss it, some that lie near the limit of what is found, and some that follow the ambient temperature. Recordings come at uneven times.

use std::collections::BTreeMap;

use rand::{Rng, RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use trends::Settings;
use trends::results::{Finding, ParameterKey, Recording, Results, Robot, RobotCounts};

pub(crate) const ROBOTS: usize = 40;
const NUMBERS: i64 = 6;
const DAY_US: i64 = 86_400_000_000;

/// So many recordings of each robot.
pub(crate) fn fleet(seed: u64, visits: usize) -> Results {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut results =
        Results { counts: Vec::new(), recordings: BTreeMap::new(), numbers: BTreeMap::new() };
    for robot in 0..ROBOTS {
        let name = format!("R{robot:02}");
        let mut at_us = 0;
        let recordings: Vec<Recording> = (0..visits)
            .map(|visit| {
                at_us += DAY_US * rng.random_range(1..10);
                let season = (at_us as f64 / (365.0 * DAY_US as f64) * std::f64::consts::TAU).sin();
                let ambient_c = Some(22.0 + 4.0 * season + normal(&mut rng));
                Recording {
                    key: format!("{name}-{visit}"),
                    at_us,
                    files: format!("{visit}.csv"),
                    ambient_c,
                    named: Vec::new(),
                }
            })
            .collect();
        results.counts.push(RobotCounts {
            robot: name.clone(),
            recordings: visits,
            refused: 0,
            without_time: 0,
        });
        for joint in 1..=NUMBERS {
            let (number, found) = series(&name, joint, &recordings, &mut rng);
            if found.len() >= Settings::default().least_found {
                results.numbers.insert(number, found);
            }
        }
        let robot = Robot { name, domain: "position".to_owned(), unit: "mm".to_owned() };
        results.recordings.insert(robot, recordings);
    }
    results
}

/// A number that does not change.
fn series(
    robot: &str,
    joint: i64,
    recordings: &[Recording],
    rng: &mut ChaCha8Rng,
) -> (ParameterKey, BTreeMap<String, Finding>) {
    let sigma = 0.005;
    let scatter = sigma * rng.random_range(0.0..3.0);
    let limit = 5.0 * sigma;
    // One of three lies near the limit of what is found.
    let level = if joint % 3 == 0 {
        limit * rng.random_range(0.5..1.5)
    } else {
        rng.random_range(0.05..0.5)
    };
    let per_kelvin = if joint % 2 == 0 { sigma * rng.random_range(-0.5..0.5) } else { 0.0 };
    let missed = rng.random_range(0.0..0.1);
    let mut found = BTreeMap::new();
    for recording in recordings {
        let kelvin = recording.ambient_c.map_or(0.0, |celsius| celsius - 22.0);
        let value =
            level + per_kelvin * kelvin + (sigma * sigma + scatter * scatter).sqrt() * normal(rng);
        if value > limit && rng.random::<f64>() > missed {
            let per_unit = Some(0.5);
            found.insert(
                recording.key.clone(),
                Finding {
                    value,
                    sigma: Some(sigma),
                    rms_per_unit: per_unit,
                    max_per_unit: per_unit,
                },
            );
        }
    }
    let number = ParameterKey {
        robot: robot.to_owned(),
        domain: "position".to_owned(),
        effect: "joint_offset".to_owned(),
        joint: Some(joint),
        form: None,
        change: "new".to_owned(),
        parameter: "offset_mrad".to_owned(),
        index: None,
    };
    (number, found)
}

fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}
