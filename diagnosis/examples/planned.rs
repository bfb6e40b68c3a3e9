//! Planned poses compared with random ones, and the check after a collision, on simulated campaigns with known truth; prints JSON.
//!
//! `cargo run --release -p diagnosis --example planned -- poses [SEEDS]`, `… -- check [SEEDS]`, `… -- real MODEL RECORDING MAPPING [SEEDS]`
#![expect(clippy::print_stdout, reason = "an example that prints")]

use diagnosis::hold_out::{HoldOutSplit, PositionErrors};
use diagnosis::plan::arm_constraints::ArmConstraints;
use diagnosis::plan::check::{Damage, ErrorRates, check_model, plan_check};
use diagnosis::plan::line_of_sight::LineOfSight;
use diagnosis::plan::working_zone::WorkingZone;
use diagnosis::plan::{
    Criterion, MeasurementKind, PlanSettings, Task, calibration_hypothesis, plan,
};
use diagnosis::{
    Campaign, Extrinsics, Fit, FitParameter, FitSettings, Hypothesis, Influence, MeasuringFrame,
    ReadingNoise, campaign_import, campaign_simulation, fit,
};
use glam::DVec3;
use physics::{Frame, Joints, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use recording::model::RobotModel;
use recording::model::presets::preset;
use recording::series::{self, RequiredData};
use serde_json::{Value, json};
use std::error::Error;
use std::path::Path;

type Fallible<T> = Result<T, Box<dyn Error>>;

/// Name of a criterion; held-out errors (mean, 95 %) and expected tool errors of its plans, one per seed, mm.
type Found = (&'static str, Vec<[f64; 2]>, Vec<f64>);

/// Standard uncertainty of a point measured by a laser tracker, m.
const SIGMA_M: f64 = 3e-5;
const POSES: usize = 30;

fn main() -> Fallible<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let count = |argument: Option<&&str>, usual: u64| {
        argument.map_or(Ok(usual), |argument| argument.parse::<u64>())
    };
    let found = match args.as_slice() {
        ["poses", rest @ ..] => {
            let seeds = count(rest.first(), 20)?;
            let each = CASES.iter().map(|case| case.against_chance(seeds));
            Value::Array(each.collect::<Fallible<_>>()?)
        }
        ["check", rest @ ..] => check(count(rest.first(), 1000)?)?,
        ["real", model, file, mapping, rest @ ..] => {
            real(model, file, mapping, count(rest.first(), 20)?)?
        }
        _ => {
            return Err(
                "poses [SEEDS] | check [SEEDS] | real MODEL RECORDING MAPPING [SEEDS]".into()
            );
        }
    };
    println!("{found:#}");
    Ok(())
}

fn robot(name: &str) -> Fallible<RobotModel> {
    preset(name).ok_or("no such preset")?.model().map_err(|faults| faults.plain().into())
}

/// Three reflectors on the tool, visible from all directions; tracker 2.5 arm lengths in front of the robot.
fn task(model: &Model) -> Task {
    let reach = ArmConstraints::of(&model.arm);
    let length = reach.link_radius_m / 0.08;
    let places = [[0.08, 0.0, 0.05], [-0.04, 0.07, 0.05], [-0.04, -0.07, 0.09]];
    let station = MeasuringFrame {
        measuring_from_base: Frame::IDENTITY,
        pivot: DVec3::new(0.5 * length, 0.0, 0.5 * length),
    };
    let surroundings = Extrinsics {
        frames: vec![FitParameter::unknown(station)],
        targets: places
            .iter()
            .map(|place| FitParameter::unknown(DVec3::from_array(*place)))
            .collect(),
        ..Extrinsics::default()
    };
    let sight = LineOfSight {
        instrument_base: DVec3::new(2.5 * length, -0.8 * length, 0.6 * length),
        range_m: [0.3, 30.0],
        acceptance_rad: 0.5,
        facing_tool: vec![None; places.len()],
    };
    Task {
        hypothesis: calibration_hypothesis(model, &[]),
        surroundings,
        measurement: MeasurementKind::Points { least: 3, orientation_rad: None },
        noise: ReadingNoise::Equal(SIGMA_M),
        sight: Some(sight),
        reach,
        both_directions: false,
        given_poses: Vec::new(),
        test_poses: Vec::new(),
    }
}

/// A random robot whose errors are all parameters of the hypothesis: geometry errors of typical size, positive compliances of a few mrad/kNm.
fn drawn(task: &Task, seed: u64) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let step: Vec<f64> = task
        .hypothesis
        .free
        .iter()
        .map(|free| {
            let share: f64 = rng.sample(StandardNormal);
            0.05 * free.sigma
                * if task.hypothesis.describe(free).contains("compliance") {
                    share.abs()
                } else {
                    share
                }
        })
        .collect();
    *task.hypothesis.stepped(&step).model
}

fn fitted(campaign: &Campaign, hypothesis: &Hypothesis, used: &[bool]) -> Fit {
    let settings = FitSettings::full(used, Influence::Huber);
    fit(campaign, hypothesis, &settings)
}

/// Mean and 95 % quantile of the target errors, mm: fitted to measurements at `stops`, evaluated without noise at `test_poses`.
fn held_out(
    task: &Task,
    truth: &Model,
    stops: &[Joints],
    test_poses: &[Joints],
    seed: u64,
) -> Fallible<[f64; 2]> {
    let made = campaign_simulation::simulate_readings(
        &task.campaign(stops),
        truth,
        &task.surroundings,
        1.0,
        seed,
    );
    let found = fitted(&made, &task.hypothesis, &vec![true; made.poses.len()]);
    let anywhere = Task { sight: None, ..task.clone() };
    let test_poses = campaign_simulation::simulate_readings(
        &anywhere.campaign(test_poses),
        truth,
        &task.surroundings,
        0.0,
        0,
    );
    let errors = PositionErrors::of(&found, &test_poses, &vec![true; test_poses.poses.len()]);
    Ok([1e3 * errors.mean(), 1e3 * errors.quantile(0.95)])
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// A comparison of planned and random poses.
#[derive(Clone, Copy)]
struct Case {
    model: &'static str,
    /// The robot that is measured; `None`: random errors that the parameters can represent.
    robot: Option<&'static str>,
    targets: usize,
    /// Whether test poses are in a box in front of the robot with the tool pointing down; otherwise in the whole workspace.
    is_zone: bool,
}

const fn within(model: &'static str, targets: usize, is_zone: bool) -> Case {
    Case { model, robot: None, targets, is_zone }
}

const CASES: [Case; 6] = [
    within("irb120", 3, false),
    within("irb120", 1, false),
    within("irb1600-6-145", 3, false),
    within("irb1600-6-145", 1, false),
    within("irb1600-6-145", 3, true),
    Case { robot: Some("irb1600-6-145-thesis"), ..within("irb1600-6-145", 3, false) },
];

impl Case {
    /// Test poses.
    fn test_poses(&self, task: &Task, seed: u64) -> Vec<Joints> {
        if !self.is_zone {
            return task.workspace(100, seed);
        }
        let corners = [DVec3::new(0.6, -0.25, 0.3), DVec3::new(0.95, 0.25, 0.6)];
        let zone = WorkingZone { corners, directions: vec![DVec3::NEG_Z] };
        zone.positions(&task.hypothesis.model.arm, &task.reach, 100, seed)
    }

    fn against_chance(self, seeds: u64) -> Fallible<Value> {
        let mut task = task(&robot(self.model)?.physics);
        task.surroundings.targets.truncate(self.targets);
        task.measurement = MeasurementKind::Points { least: self.targets, orientation_rad: None };
        task.test_poses = self.test_poses(&task, 99);
        let mut figures: [Found; 3] =
            ["random", "d", "zone"].map(|name| (name, Vec::new(), Vec::new()));
        for seed in 0..seeds {
            let truth = match self.robot {
                Some(name) => robot(name)?.physics,
                None => drawn(&task, seed),
            };
            let test_poses = self.test_poses(&task, 5000 + seed);
            for (name, errors, predicted) in &mut figures {
                let criterion = by_name(name);
                let settings = PlanSettings { count: POSES, criterion, candidates: 300, seed };
                let planned = plan(&task, None, &settings)?;
                let stops: Vec<Joints> = planned.poses.iter().map(|pose| pose.q).collect();
                predicted.extend(planned.poses.last().map(|pose| 1e3 * pose.tool_m[1]));
                errors.push(held_out(&task, &truth, &stops, &test_poses, seed)?);
            }
        }
        let shown = figures.into_iter().map(|(name, errors, predicted)| {
            let error_mm = |k: usize| middle(errors.iter().map(|e| e[k]).collect());
            json!({ "poses": name, "expected_tool_mm": middle(predicted), "held_out_mean_mm": error_mm(0), "held_out_p95_mm": error_mm(1) })
        });
        let shown: Vec<Value> = shown.collect();
        Ok(json!({
            "model": self.model,
            "robot": self.robot.unwrap_or("errors drawn within the model's form"),
            "targets": self.targets,
            "asked": if self.is_zone { "a zone" } else { "the workspace" },
            "count": POSES,
            "seeds": seeds,
            "medians": shown,
        }))
    }
}

fn by_name(name: &str) -> Criterion {
    match name {
        "random" => Criterion::Random,
        "zone" => Criterion::Zone,
        _ => Criterion::D,
    }
}

/// Poses of a real recording, selected by plan and at random; errors on the held-out half.
fn real(model: &str, file: &str, mapping: &str, seeds: u64) -> Fallible<Value> {
    let model = RobotModel::read(Path::new(model))?;
    let recording =
        series::read(Path::new(file), Some(Path::new(mapping)), RequiredData::Measurement)?;
    let campaign = campaign_import::campaign(&model.physics.arm, &[recording])?;
    let mut planning = task(&model.physics);
    planning.sight = None;
    planning.reach = ArmConstraints {
        margin_rad: 0.0,
        link_radius_m: 1e-6,
        base_radius_m: 1e-6,
        floor_m: None,
        ..planning.reach
    };
    planning.surroundings = diagnosis::initial_extrinsics::estimate_extrinsics(
        &campaign,
        &model.physics,
        &vec![true; campaign.poses.len()],
    );
    planning.measurement = MeasurementKind::Points { least: 1, orientation_rad: None };
    let mut shown = Vec::new();
    for count in [20, 30, 60] {
        let mut figures: Vec<(&str, Vec<f64>)> =
            ["random", "d", "zone"].map(|name| (name, Vec::new())).into();
        for seed in 0..seeds {
            // All criteria select from the same half; the other half is held out.
            let halves = HoldOutSplit::random(&campaign, 0.5, seed);
            let open: Vec<usize> =
                (0..campaign.poses.len()).filter(|pose| halves.training[*pose]).collect();
            planning.given_poses = open.iter().map(|pose| campaign.poses[*pose].inputs.q).collect();
            planning.test_poses = planning.given_poses.iter().step_by(5).copied().collect();
            for (name, errors) in &mut figures {
                let criterion = by_name(name);
                let settings = PlanSettings { count, criterion, candidates: 1, seed };
                let picks: Vec<Joints> =
                    plan(&planning, None, &settings)?.poses.iter().map(|pose| pose.q).collect();
                let used: Vec<bool> = campaign
                    .poses
                    .iter()
                    .zip(&halves.training)
                    .map(|(pose, open)| *open && picks.contains(&pose.inputs.q))
                    .collect();
                let found = fitted(&campaign, &planning.hypothesis, &used);
                errors.push(1e3 * PositionErrors::of(&found, &campaign, &halves.held_out()).mean());
            }
        }
        for (name, errors) in figures {
            shown
                .push(json!({ "count": count, "poses": name, "held_out_mean_mm": middle(errors) }));
        }
    }
    Ok(json!({ "recording": file, "seeds": seeds, "geometry_and_compliance": shown }))
}

/// Rate of false alarms for undamaged robots, and how often damage is detected and identified, with ten poses.
fn check(seeds: u64) -> Fallible<Value> {
    let model = robot("irb1600-6-145-thesis")?;
    let mut planning = task(&model.physics);
    planning.hypothesis = Hypothesis::fixed(model.physics);
    planning.surroundings.targets.iter_mut().for_each(|target| target.free = false);
    let terms = ErrorRates { alarm: 0.01, power: 0.9 };
    let settings = PlanSettings { count: 10, criterion: Criterion::D, candidates: 300, seed: 1 };
    let checkup = plan_check(&planning, &model.sigma, &settings, &terms)?;
    let measured = |truth: &Model, seed: u64| {
        campaign_simulation::simulate_readings(
            &planning.campaign(&checkup.poses),
            truth,
            &planning.surroundings,
            1.0,
            seed,
        )
    };
    let mut alarms = 0;
    for seed in 0..seeds {
        let truth = sound(&model, seed);
        alarms += usize::from(
            !check_model(&measured(&truth, seed), &model.physics, &model.sigma, &terms).holds,
        );
    }
    let mut results = Vec::new();
    for found in &checkup.detectable {
        let Some(size) = found.least else {
            results.push(json!({ "damage": found.damage.says(), "least": null }));
            continue;
        };
        let damages = (seeds / 10).max(20);
        let (mut noticed, mut named) = (0_u64, 0_u64);
        for seed in 0..damages {
            let truth = damaged(&sound(&model, seed), found.damage, size, seed)?;
            let judged = check_model(&measured(&truth, seed), &model.physics, &model.sigma, &terms);
            noticed += u64::from(!judged.holds);
            let truth = damaged(&sound(&model, seed), found.damage, 2.0 * size, seed)?;
            let judged = check_model(&measured(&truth, seed), &model.physics, &model.sigma, &terms);
            named += u64::from(
                judged.suspects.first().is_some_and(|first| first.damage == found.damage),
            );
        }
        let share = |count: u64| count as f64 / damages as f64;
        results.push(json!({ "damage": found.damage.says(), "least_mrad_or_mm": 1e3 * size, "seen": share(noticed), "named_first_at_twice": share(named) }));
    }
    Ok(
        json!({ "robots": seeds, "false_alarms": alarms, "asked": 0.01 * seeds as f64, "damage": results }),
    )
}

/// An undamaged robot: parameters drawn within their stated uncertainties.
fn sound(model: &RobotModel, seed: u64) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut truth = model.physics;
    for (effect, sigma) in model.sigma.iter().enumerate() {
        truth.change(effect, |effect| {
            for (value, sigma) in effect.values_mut().iter_mut().zip(sigma) {
                *value += sigma * rng.sample::<f64, _>(StandardNormal);
            }
        });
    }
    truth
}

/// Adds a damage of this size in a random direction.
fn damaged(sound: &Model, damage: Damage, size: f64, seed: u64) -> Fallible<Model> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut effect = damage.effect(sound).ok_or("no such damage")?;
    let direction: Vec<f64> = effect.values().iter().map(|_| rng.sample(StandardNormal)).collect();
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    effect.values_mut().iter_mut().zip(direction).for_each(|(value, x)| *value = size * x / length);
    let mut truth = *sound;
    truth.push(effect)?;
    Ok(truth)
}
