//! What the answer says of fleets whose truth is known.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use trends::{Answer, Settings, evaluate, read};

use crate::written::{Finding, Folder, Recorded, backlash};

const DAYS: i64 = 60;

/// A robot that records each day; `of` gives what is found on a day.
fn robot(
    name: &'static str,
    seed: u64,
    of: impl Fn(i64, &mut dyn FnMut(f64) -> f64) -> Vec<Finding>,
) -> Vec<Recorded> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = move |sigma: f64| Normal::new(0.0, sigma).unwrap().sample(&mut rng);
    (0..DAYS)
        .map(|day| Recorded {
            robot: name,
            day: Some(day),
            ambient_c: None,
            findings: Some(of(day, &mut noise)),
        })
        .collect()
}

fn offset(value: f64) -> Finding {
    Finding {
        effect: "joint_offset",
        joint: Some(3),
        parameter: "offset_mrad",
        value,
        sigma: 0.005,
        claimed: true,
        says: "stands off",
    }
}

fn reported(recordings: &[Recorded], settings: &Settings) -> Answer {
    let folder = Folder::with(recordings);
    evaluate(&read(std::slice::from_ref(&folder.0), settings).unwrap(), settings)
}

/// What a diagnosis finds of a width: nothing below five standard uncertainties.
fn found(width: f64, noise: &mut dyn FnMut(f64) -> f64) -> Vec<Finding> {
    let value = width + noise(0.008);
    if value > 0.04 { vec![backlash(value)] } else { Vec::new() }
}

#[test]
fn play_that_grows_from_nothing_is_reported_with_robot_joint_rate_and_onset() {
    let worn = robot("B", 1, |day, noise| {
        let mut all = found(0.02 * (day - 24).max(0) as f64, noise);
        all.push(offset(0.2 + noise(0.005)));
        all
    });
    let still =
        robot("A", 2, |_, noise| vec![offset(-0.3 + noise(0.005)), backlash(0.2 + noise(0.008))]);
    let settings = Settings { tolerance_mm: Some(0.6), ..Settings::default() };
    let answer = reported(&[worn, still].concat(), &settings);
    assert_eq!(answer.alerts.len(), 1, "{:#?}", answer.alerts);
    let alert = &answer.alerts[0];
    assert_eq!(
        (alert.robot.as_str(), alert.effect.as_str(), alert.joint, alert.kind),
        ("B", "backlash", Some(2), "growth")
    );
    // Day 25 is the first that differs: the 26th recording.
    assert!(alert.since.recording.abs_diff(26) <= 2, "{:?}", alert.since);
    let [low, high] = alert.since.recording_ci95;
    assert!((low..=high).contains(&26), "{:?}", alert.since);
    let rate = alert.per_month.unwrap();
    assert!(rate.ci95[0] < 0.02 * 30.436_875 && 0.02 * 30.436_875 < rate.ci95[1], "{rate:?}");
    assert!((alert.size_now.as_ref().unwrap().max - 0.6 * 0.7).abs() < 0.01);
    // Largest error 0.6 mm per mrad: 1 mrad, which 0.02 mrad a day reach 50 days after day 24.
    assert_eq!(
        alert.reaches_tolerance.as_ref().unwrap().day.as_deref().map(|day| &day[..7]),
        Some("2026-03")
    );
}

/// Median of the onsets over noise: weak wear, 0.1 of the scatter a day.
#[test]
fn the_onset_of_weak_wear_is_not_systematically_early() {
    let onsets: Vec<i64> = (0..7)
        .filter_map(|seed| {
            let worn = robot("B", seed, |day, noise| {
                found(0.2 + 0.0008 * (day - 24).max(0) as f64, noise)
            });
            let answer = reported(&worn, &Settings::default());
            answer.alerts.first().map(|alert| {
                let [low, high] = alert.since.recording_ci95;
                assert!((low..=high).contains(&alert.since.recording), "{:?}", alert.since);
                alert.since.recording as i64 - 26
            })
        })
        .collect();
    let mut sorted = onsets.clone();
    sorted.sort_unstable();
    assert!(onsets.len() >= 3, "{onsets:?}");
    assert!(sorted[sorted.len() / 2].abs() <= 6, "{onsets:?}");
}

#[test]
fn a_step_is_reported_as_a_step_and_a_repair_as_a_decrease() {
    let stepped =
        robot("A", 3, |day, noise| vec![offset(if day < 30 { 0.2 } else { 0.24 } + noise(0.005))]);
    let repaired = robot("B", 4, |day, noise| found(if day < 40 { 0.3 } else { 0.0 }, noise));
    let answer = reported(&[stepped, repaired].concat(), &Settings::default());
    assert_eq!(answer.alerts.len(), 1, "{:#?}", answer.alerts);
    let alert = &answer.alerts[0];
    assert_eq!((alert.robot.as_str(), alert.kind, alert.since.recording), ("A", "step", 31));
    assert!((alert.step.unwrap().value - 0.04).abs() < 0.005);
    assert_eq!(answer.decreases.len(), 1);
    assert_eq!(
        (answer.decreases[0].robot.as_str(), answer.decreases[0].since.recording),
        ("B", 41)
    );
}

#[test]
fn another_name_in_place_of_an_effect_is_no_sign_that_it_is_gone() {
    let hysteresis = Finding { effect: "hysteresis", parameter: "amplitude_mrad", ..backlash(0.2) };
    let renamed = |named: bool| {
        let hysteresis = hysteresis.clone();
        robot("A", 5, move |day, noise| match (day % 5 == 0 || day > 50, named) {
            (true, true) => vec![hysteresis.clone()],
            (true, false) => Vec::new(),
            (false, _) => vec![backlash(0.2 + noise(0.008))],
        })
    };
    let answer = reported(&renamed(true), &Settings::default());
    assert!(answer.alerts.is_empty() && answer.decreases.is_empty(), "{answer:#?}");
    let vanished = reported(&renamed(false), &Settings::default());
    assert_eq!(vanished.decreases.len(), 1, "without another name it is gone: {vanished:#?}");
}

#[test]
fn what_follows_the_temperature_is_no_growth() {
    let ambient = |day: i64| 20.0 + 0.2 * (day - 30).max(0) as f64 + (day % 3) as f64;
    let follows = |stated: bool| {
        let mut all = robot("A", 6, |day, noise| {
            vec![offset(0.2 + 0.02 * (ambient(day) - 20.0) + noise(0.005))]
        });
        for recorded in &mut all {
            recorded.ambient_c = recorded.day.filter(|_| stated).map(ambient);
        }
        all
    };
    assert!(reported(&follows(true), &Settings::default()).alerts.is_empty());
    assert_eq!(
        reported(&follows(false), &Settings::default()).alerts.len(),
        1,
        "the cause was not recorded"
    );
}

#[test]
fn the_order_of_files_and_folders_changes_nothing() {
    let worn = robot("B", 7, |day, noise| found(0.01 * day as f64, noise));
    let still = robot("A", 8, |_, noise| vec![offset(0.2 + noise(0.005))]);
    let (one, two) = (Folder::with(&worn), Folder::new());
    for (number, recorded) in still.iter().enumerate() {
        crate::written::write(
            &two.0.join(format!("{number}.parquet")),
            &format!("still-{number}"),
            recorded,
        );
    }
    let settings = Settings::default();
    let json = |folders: &[&Folder]| {
        let folders: Vec<_> = folders.iter().map(|folder| folder.0.clone()).collect();
        serde_json::to_string(&evaluate(&read(&folders, &settings).unwrap(), &settings)).unwrap()
    };
    assert_eq!(json(&[&one, &two]), json(&[&two, &one]));
    assert_eq!(json(&[&one, &two]), json(&[&one, &two, &one]), "a folder twice");
}

#[test]
fn two_names_for_one_wear_are_one_alert() {
    let hysteresis = |value: f64| Finding {
        effect: "hysteresis",
        parameter: "amplitude_mrad",
        ..backlash(value)
    };
    let worn = robot("A", 9, |day, noise| {
        let width = 0.2 + 0.01 * day as f64 + noise(0.008);
        vec![if day % 3 == 0 { hysteresis(width) } else { backlash(width) }]
    });
    let answer = reported(&worn, &Settings::default());
    assert_eq!(answer.alerts.len(), 1, "{answer:#?}");
    assert_eq!(answer.alerts[0].effect, "backlash");
    assert_eq!(answer.alerts[0].also, ["hysteresis.amplitude_mrad"]);
}

#[test]
fn forty_robots_that_do_not_change_raise_no_alarm() {
    for (seed, recordings) in [(1, 12), (2, 30), (3, 60)] {
        let answer = trends::evaluate(&crate::still::fleet(seed, recordings), &Settings::default());
        assert!(answer.series > 180, "{recordings} recordings: {} series", answer.series);
        assert!(answer.alerts.is_empty(), "{recordings} recordings: {:#?}", answer.alerts);
    }
}

#[test]
fn two_waves_of_one_gear_are_two_series() {
    let wave = |cycles: f64, says: &'static str, amplitude: f64| {
        let amplitude = Finding {
            effect: "transmission_error",
            joint: Some(3),
            parameter: "amplitude_mrad",
            value: amplitude,
            sigma: 0.01,
            claimed: true,
            says,
        };
        let cycles = Finding { parameter: "cycles_per_rev", value: cycles, ..amplitude.clone() };
        [amplitude, cycles]
    };
    let worn = robot("A", 10, |day, noise| {
        let slow = wave(2.0, "slow", 0.5 + noise(0.01));
        let fast = wave(23.1, "fast", 0.2 + 0.005 * day as f64 + noise(0.01));
        [slow, fast].concat()
    });
    let answer = reported(&worn, &Settings::default());
    assert_eq!(answer.series, 2, "{answer:#?}");
    assert_eq!(answer.alerts.len(), 1, "{answer:#?}");
    assert_eq!(answer.alerts[0].form, Some(23));
}
