//! Fits against `scipy.optimize.least_squares`: the same problems, another kinematics, the same numbers to the last digit that is stated.
//!
//! Problems and solutions are made by `tests/reference/make.py`. A standard uncertainty is stated with two digits, and a number to the last digit of its
//! uncertainty; what is asked here is a thousandth of that and more.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

use diagnosis::{
    Anchor, Arrival, Campaign, Effort, Fit, Fitted, Hypothesis, Influence, Instrument, Noise,
    Observation, Place, Plane, Pose, Reading, Settings, Source, Station, Surroundings, fit,
};
use glam::DVec3;
use physics::frame::rotation_from_vector;
use physics::{AnyEffect, Frame, Given, Inputs, JOINTS_MAX, Model, Wrench};
use recording::model::presets::preset;
use std::collections::HashMap;

/// By how much a number may differ, as a share of its standard uncertainty; and an uncertainty, as a share of itself.
const SHARE: f64 = 1e-4;
const TARGET: DVec3 = DVec3::new(0.1, 0.02, 0.06);

/// One problem: its entries by name.
struct Problem(HashMap<&'static str, Vec<f64>>);

impl Problem {
    fn of(name: &str) -> Self {
        let line = |line: &'static str| {
            let mut words = line.split_whitespace();
            let key = words.next()?.strip_prefix(name)?.strip_prefix('.')?;
            Some((key, words.map(|word| word.parse().expect("a number")).collect()))
        };
        Self(include_str!("reference/scipy.txt").lines().filter_map(line).collect())
    }

    /// Joint positions and forces of each pose, with what is seen there.
    fn campaign(&self, surroundings: Surroundings, kinds: &[Reading]) -> Campaign {
        let numbers: usize = kinds.iter().map(Reading::count).sum();
        let (seen, noise) = (&self.0["seen"], &self.0["noise"]);
        let rows = self.0["q"].chunks(6).zip(self.0["force"].chunks(3)).enumerate();
        let pose = |(row, (position, force)): (usize, (&[f64], &[f64]))| {
            let mut q = [0.0; JOINTS_MAX];
            q[..6].copy_from_slice(position);
            let wrench_base = Wrench { force: DVec3::from_slice(force), moment: DVec3::ZERO };
            let inputs = Inputs { wrench_base, ..Inputs::at_rest(q) };
            let mut at = row * numbers;
            let observe = |kind: &Reading| {
                let here = at;
                at += kind.count();
                observed(*kind, &seen[here..at], &noise[here..at])
            };
            let seen = kinds.iter().map(observe).collect();
            Pose { inputs, arrival: Arrival::Settled, recording: 0, row, seen }
        };
        Campaign {
            poses: rows.map(pose).collect(),
            surroundings,
            instruments: vec![Instrument {
                name: "made".to_owned(),
                noise_is_known: true,
                ..Instrument::default()
            }],
            recordings: vec![Source::of_poses("made")],
        }
    }

    fn fit(&self, campaign: &Campaign, hypothesis: &Hypothesis) -> Fit {
        let used = vec![true; campaign.poses.len()];
        let settings =
            Settings { used: &used, influence: Influence::Equal, from: None, effort: Effort::Full };
        let found = fit(campaign, hypothesis, &settings);
        assert!(found.converged && found.undetermined.is_empty(), "{:?}", found.undetermined);
        assert!(found.factors.iter().all(|f| (f - 1.0).abs() < 1e-12), "{:?}", found.factors);
        let cost = self.0["cost"][0];
        assert!((found.sum / cost - 1.0).abs() < 1e-9, "{} for {cost}", found.sum);
        found
    }

    /// The number in place `place` of the solution against ours, in its standard uncertainty.
    fn assert_near(&self, place: usize, what: &str, ours: f64) {
        let (theirs, sigma) = (self.0["found"][place], self.0["sigma"][place]);
        let off = (ours - theirs).abs() / sigma;
        assert!(off < SHARE, "{what}: {ours}, not {theirs}: {off:e} of its uncertainty");
    }

    fn assert_sigma(&self, place: usize, what: &str, ours: f64) {
        let theirs = self.0["sigma"][place];
        assert!((ours / theirs - 1.0).abs() < SHARE, "± of {what}: {ours}, not {theirs}");
    }

    /// The effects' numbers, which stand first in the solution, in the order `wanted` (places among the free numbers).
    fn assert_robot(&self, found: &Fit, wanted: &[usize]) {
        let values = found.hypothesis.values();
        for (place, free) in wanted.iter().enumerate() {
            let what = found.hypothesis.describe(&found.hypothesis.free[*free]);
            self.assert_near(place, &what, values[*free]);
            let sigma = found.sigma(found.column_of(*free)).expect("determined");
            self.assert_sigma(place, &what, sigma);
        }
    }
}

fn observed(kind: Reading, seen: &[f64], noise: &[f64]) -> Observation {
    let sigma = match *noise {
        [one] => DVec3::splat(one),
        _ => DVec3::from_slice(noise),
    };
    let reading = match kind {
        Reading::Point { place, frame, .. } => {
            Reading::Point { place, frame, at: DVec3::from_slice(seen) }
        }
        Reading::Distance { place, anchor, .. } => {
            Reading::Distance { place, anchor, length_m: seen[0] }
        }
        Reading::Plane { place, plane, .. } => Reading::Plane { place, plane, radius_m: seen[0] },
        other => other,
    };
    let whitening = Noise::Axes(sigma).whitening(DVec3::ZERO).expect("sound");
    Observation { reading, whitening, instrument: 0 }
}

/// The arm with one effect after the other, all free from nothing: kind, stem, joint (from 1), count.
fn hypothesis(effects: &[(&str, &str, usize, usize)]) -> Hypothesis {
    let model: Model = preset("irb1600-6-145").expect("preset").model().expect("sound").physics;
    let mut hypothesis = Hypothesis::fixed(model);
    for (kind, stem, joint, count) in effects {
        let given: &[(&str, &[f64])] = &[(*stem, &[0.0; 3][..*count])];
        let effect = AnyEffect::build(kind, &model.arm, Some(joint - 1), Given(given));
        hypothesis.add(effect.expect(kind), &[]).expect("room");
    }
    hypothesis
}

fn known_target() -> Surroundings {
    Surroundings { targets: vec![Fitted::known(TARGET)], ..Surroundings::default() }
}

const PLACE: Place = Place::Target(0);
const OFFSETS: [(&str, &str, usize, usize); 4] = [
    ("joint_offset", "offset", 2, 1),
    ("joint_offset", "offset", 3, 1),
    ("joint_offset", "offset", 4, 1),
    ("joint_offset", "offset", 5, 1),
];

#[test]
fn points_in_an_unknown_frame_give_scipys_numbers() {
    let problem = Problem::of("points");
    let start = &problem.0["start"][9..];
    let frame =
        Frame::new(rotation_from_vector(DVec3::from_slice(start)), DVec3::from_slice(&start[3..]));
    let station = Station { measuring_from_base: frame, pivot: DVec3::ZERO };
    let around = Surroundings {
        frames: vec![Fitted::unknown(station)],
        targets: vec![Fitted::unknown(TARGET)],
        ..Surroundings::default()
    };
    let seen = [Reading::Point { place: PLACE, frame: 0, at: DVec3::ZERO }];
    let mut hypothesis = hypothesis(&[
        OFFSETS[0],
        OFFSETS[1],
        OFFSETS[2],
        OFFSETS[3],
        ("axis_shift", "shift", 3, 3),
        ("axis_tilt", "tilt", 4, 2),
        ("joint_compliance", "compliance", 2, 1),
        ("joint_compliance", "compliance", 3, 1),
    ]);
    // Along its own axis no shift shows; along the arm the zeros of joints 2 and 3 do the same.
    hypothesis.free.retain(|free| free.effect != 4 || free.value == 2);
    let found = problem.fit(&problem.campaign(around, &seen), &hypothesis);
    problem.assert_robot(&found, &[0, 1, 2, 3, 4, 5, 6, 7, 8]);
    let ours = found.surroundings.frames[0].value.measuring_from_base;
    let theirs = rotation_from_vector(DVec3::from_slice(&problem.0["found"][9..]));
    let turned = (ours.rotation - theirs).to_cols_array().into_iter().fold(0.0, f64::max);
    assert!(turned < SHARE * problem.0["sigma"][9], "{turned}");
    for k in 0..3 {
        problem.assert_near(12 + k, "the frame's origin", ours.origin[k]);
        problem.assert_near(15 + k, "the reflector", found.surroundings.targets[0].value[k]);
        let column = 6 + k;
        problem.assert_sigma(15 + k, "the reflector", found.sigma(column).expect("determined"));
    }
}

#[test]
fn distances_from_unknown_points_give_scipys_numbers() {
    let problem = Problem::of("distances");
    let anchors = problem.0["start"][4..].chunks(3).map(DVec3::from_slice);
    let unknown = |place| Anchor { place: Fitted::unknown(place), offset_m: Fitted::known(0.0) };
    let around = Surroundings { anchors: anchors.map(unknown).collect(), ..known_target() };
    let seen = [0, 1].map(|anchor| Reading::Distance { place: PLACE, anchor, length_m: 0.0 });
    let found = problem.fit(&problem.campaign(around, &seen), &hypothesis(&OFFSETS));
    problem.assert_robot(&found, &[0, 1, 2, 3]);
    for k in 0..6 {
        let anchor = found.surroundings.anchors[k / 3].place.value;
        problem.assert_near(4 + k, "a fixed point", anchor[k % 3]);
        problem.assert_sigma(4 + k, "a fixed point", found.sigma(k).expect("determined"));
    }
}

#[test]
fn contacts_with_unknown_planes_give_scipys_numbers() {
    let problem = Problem::of("planes");
    let walls = [DVec3::X, DVec3::Z].map(|normal| Fitted::unknown(Plane { normal, offset_m: 0.1 }));
    let around = Surroundings { planes: walls.to_vec(), ..known_target() };
    let seen = [0, 1].map(|plane| Reading::Plane { place: PLACE, plane, radius_m: 0.0 });
    let found = problem.fit(&problem.campaign(around, &seen), &hypothesis(&OFFSETS));
    problem.assert_robot(&found, &[0, 1, 2, 3]);
    let [x, z] = [0, 1].map(|plane| found.surroundings.planes[plane].value);
    for (place, ours) in [
        (4, x.normal.y / x.normal.x),
        (5, x.normal.z / x.normal.x),
        (6, x.offset_m),
        (7, z.normal.x / z.normal.z),
        (8, z.normal.y / z.normal.z),
        (9, z.offset_m),
    ] {
        problem.assert_near(place, "a plane", ours);
    }
}

#[test]
fn known_loads_give_scipys_compliances() {
    let problem = Problem::of("compliance");
    let station = Station { measuring_from_base: Frame::IDENTITY, pivot: DVec3::ZERO };
    let around = Surroundings { frames: vec![Fitted::known(station)], ..known_target() };
    let seen = [Reading::Point { place: PLACE, frame: 0, at: DVec3::ZERO }];
    let mut effects = vec![OFFSETS[0], OFFSETS[1], OFFSETS[3]];
    effects.extend([2, 3, 4, 5].map(|joint| ("joint_compliance", "compliance", joint, 1)));
    let found = problem.fit(&problem.campaign(around, &seen), &hypothesis(&effects));
    problem.assert_robot(&found, &[0, 1, 2, 3, 4, 5, 6]);
}
