//! One effect at a time is concealed from the model: is it named? The truth is run forward by the same physics, so that this measures the choice and not the
//! physics; `trued challenge` measures both.
//!
//! `cargo run -p diagnosis --example concealed -- [CASES] [FIRST]`
#![expect(clippy::print_stdout, clippy::expect_used, reason = "an example that prints")]

use diagnosis::diagnose::diagnose;
use diagnosis::surroundings::{Fitted, Station, Surroundings};
use diagnosis::{
    Arrival, Campaign, Instrument, Noise, Observation, Place, Pose, Reading, Source, simulate,
};
use glam::DVec3;
use physics::frame::rotation_from_vector;
use physics::{AnyEffect, Frame, Given, Inputs, Model, Wrench};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::time::Instant;

const NOISE_M: f64 = 3e-5;

/// Kind, joint, values by stem.
type Hidden = (&'static str, Option<usize>, Vec<(&'static str, Vec<f64>)>);

fn main() {
    let mut args = std::env::args().skip(1).map(|a| a.parse::<u64>().expect("a number"));
    let (cases, first) = (args.next().unwrap_or(20), args.next().unwrap_or(1));
    let base = recording::model::presets::preset("irb1600-6-145").expect("preset");
    let model = base.model().expect("sound").physics;
    for seed in first..first + cases {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let campaign = poses(&mut rng, &model);
        let (truth, hidden) = conceal(&mut rng, &model);
        let readings = simulate::readings(&campaign, &truth, &campaign.surroundings, 1.0, seed);
        let start = Instant::now();
        let found = diagnose(readings, &model, &[], None, seed);
        let seconds = start.elapsed().as_secs_f64();
        let said: Vec<String> = found
            .findings
            .iter()
            .map(|one| {
                let rivals: Vec<String> = one
                    .rivals
                    .iter()
                    .map(|(r, _)| {
                        format!(
                            "{}{:?}:{:.1}",
                            r.effect.spec().kind,
                            r.effect.joint().map(|j| j + 1),
                            r.behind
                        )
                    })
                    .collect();
                format!(
                    "{} {:?} gain {:.0} {:?} rivals {rivals:?}",
                    one.effect.spec().kind,
                    one.effect.joint().map(|j| j + 1),
                    one.gain,
                    one.effect.values()
                )
            })
            .collect();
        let right = found.findings.first().is_some_and(|one| {
            hidden.as_ref().is_some_and(|h| {
                h.spec().kind == one.effect.spec().kind && h.joint() == one.effect.joint()
            })
        }) || (hidden.is_none() && found.findings.is_empty());
        println!(
            "{} seed {seed} {} {:.1} s: hid {:?}; said {}: {said:#?}; rms {:.4} {:.4} noise {:.4}; rest {:?}",
            if right { "RIGHT" } else { "WRONG" },
            if campaign.poses[1].arrival == Arrival::Settled { "poses" } else { "path" },
            seconds,
            hidden.as_ref().map(|h| (h.spec().kind, h.joint().map(|j| j + 1), h.values().to_vec())),
            found.verdict.name(),
            1e3 * found.proof.before,
            1e3 * found.proof.after,
            1e3 * found.proof.noise,
            found.unexplained.map(|u| (u.joint + 1, u.depends_on)),
        );
    }
}

fn conceal(rng: &mut ChaCha8Rng, model: &Model) -> (Model, Option<AnyEffect>) {
    let joint = rng.random_range(0..6_usize);
    let sized =
        |rng: &mut ChaCha8Rng, large: f64| large * 10.0_f64.powf(rng.random_range(-1.0..0.0));
    let a = sized(rng, 1.0);
    let phase = [rng.random_range(-3.0..3.0), rng.random_range(-3.0..3.0)];
    let (j1, all) = (Some(joint), None);
    let list: Vec<Hidden> = vec![
        ("joint_offset", j1, vec![("offset", vec![1e-3 * a])]),
        ("joint_ratio", j1, vec![("ratio", vec![1e-3 * a])]),
        ("backlash", j1, vec![("width", vec![8e-4 * a])]),
        ("hysteresis", j1, vec![("amplitude", vec![8e-4 * a]), ("reversal", vec![0.02])]),
        ("lost_motion", j1, vec![("width", vec![8e-4 * a]), ("torque", vec![8.0])]),
        ("joint_compliance", j1, vec![("compliance", vec![1e-5 * a])]),
        ("bearing_compliance", j1, vec![("compliance", vec![1e-5 * a])]),
        ("base_compliance", all, vec![("compliance", vec![5e-6 * a])]),
        ("tool_compliance", all, vec![("compliance", vec![2e-6 * a, 1e-6 * a, 1e-6 * a])]),
        ("axis_tilt", j1, vec![("tilt", vec![5e-4 * a, -3e-4 * a])]),
        ("axis_shift", j1, vec![("shift", vec![3e-4 * a, -2e-4 * a, 2e-4 * a])]),
        (
            "transmission_error",
            j1,
            vec![("amplitude", vec![3e-4 * a]), ("cycles", vec![7.0]), ("phase", vec![phase[0]])],
        ),
        (
            "transmission_error",
            j1,
            vec![("amplitude", vec![3e-4 * a]), ("cycles", vec![1.0]), ("phase", vec![phase[0]])],
        ),
        (
            "axis_wobble",
            j1,
            vec![
                ("amplitude", vec![2e-4 * a, 2e-4 * a]),
                ("phase", phase.to_vec()),
                ("cycles", vec![1.0]),
            ],
        ),
        ("thermal_zero", j1, vec![("drift", vec![5e-5 * a])]),
        ("thermal_growth", j1, vec![("growth", vec![2e-5 * a])]),
        ("joint_coupling", Some(5), vec![("ratio", vec![1e-3 * a]), ("from_joint", vec![5.0])]),
    ];
    let which = rng.random_range(0..=list.len());
    let Some((kind, joint, given)) = list.get(which) else { return (*model, None) };
    let given: Vec<(&str, &[f64])> = given.iter().map(|(k, v)| (*k, v.as_slice())).collect();
    match AnyEffect::build(kind, &model.arm, *joint, Given(&given)) {
        Ok(effect) => {
            let mut truth = *model;
            truth.push(effect).expect("room");
            (truth, Some(effect))
        }
        Err(_) => (*model, None),
    }
}

fn poses(rng: &mut ChaCha8Rng, model: &Model) -> Campaign {
    let path = rng.random_bool(0.5);
    let count = if path { 1500 } else { 300 };
    let frame =
        Frame::new(rotation_from_vector(DVec3::new(0.02, 0.01, 2.1)), DVec3::new(2.0, -1.0, 0.4));
    let station = Station { measuring_from_base: frame, pivot: DVec3::ZERO };
    let tool = model.arm.tool.tcp;
    let _ = tool;
    let targets =
        [DVec3::new(0.1, 0.0, 0.05), DVec3::new(-0.05, 0.09, 0.06), DVec3::new(-0.05, -0.08, 0.1)];
    let surroundings = Surroundings {
        frames: vec![Fitted::unknown(station)],
        targets: targets.iter().map(|p| Fitted::unknown(*p)).collect(),
        ..Surroundings::default()
    };
    let whitening = Noise::Equal(NOISE_M).whitening(DVec3::ZERO).expect("sound");
    let speeds: Vec<f64> = (0..6).map(|_| rng.random_range(0.2..1.0)).collect();
    let mut list: Vec<Pose> = Vec::new();
    for row in 0..count {
        let mut inputs = Inputs::at_rest([0.0; physics::JOINTS_MAX]);
        for joint in 0..6 {
            let span = [2.0, 1.2, 1.2, 3.0, 2.4, 3.0][joint];
            inputs.q[joint] = if path {
                0.5 * span * (speeds[joint] * 0.01 * f64::from(row) + joint as f64).sin()
            } else {
                span * rng.random_range(-0.5..0.5)
            };
        }
        inputs.time_s = f64::from(row) * if path { 0.01 } else { 10.0 };
        inputs.ambient_celsius =
            20.0 + 5.0 * (1.0 - (-f64::from(row) / f64::from(count) * 3.0).exp());
        let load = if path { 200.0 } else { if rng.random_bool(0.5) { 300.0 } else { 0.0 } };
        inputs.wrench_base = Wrench {
            force: DVec3::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), -1.0)
                * load,
            moment: DVec3::ZERO,
        };
        let arrival = if path && row > 0 { Arrival::FromBefore } else { Arrival::Settled };
        if let Some(before) = list.last() {
            inputs.q_before = before.inputs.q;
            inputs.dt_s = inputs.time_s - before.inputs.time_s;
        }
        for joint in 0..6 {
            let moved = inputs.q[joint] - inputs.q_before[joint];
            inputs.direction[joint] = if path {
                moved.signum()
            } else if rng.random_bool(0.5) {
                1.0
            } else {
                -1.0
            };
        }
        let seen = (0..3).map(|t| Observation {
            reading: Reading::Point { place: Place::Target(t), frame: 0, at: DVec3::ZERO },
            whitening,
            instrument: 0,
        });
        list.push(Pose { inputs, arrival, recording: 0, row: row as usize, seen: seen.collect() });
    }
    Campaign {
        poses: list,
        surroundings,
        instruments: vec![Instrument {
            name: "tracker".to_owned(),
            noise_is_known: true,
            ..Instrument::default()
        }],
        recordings: vec![Source::of_poses("made")],
    }
}
