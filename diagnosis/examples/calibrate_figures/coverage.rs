//! Coverage of 95 % confidence intervals over simulated campaigns with random true parameters: with the effects given, and after selection of the
//! effects.
//!
//! Frame and reflectors are fitted; the tracker's noise is larger across the beam than along it. Parameters that the poses do not determine are zero
//! in the truth as well, since their values are a convention.

use crate::rig::{self, between};
use diagnosis::hold_out::calibrate;
use diagnosis::hypothesis::{Hypothesis, describe, parameter_key};
use diagnosis::progress::ignore;
use diagnosis::uncertainty_propagation::tool_uncertainty;
use diagnosis::{
    Campaign, Extrinsics, Fit, FitSettings, Influence, Reading, ReadingNoise, campaign_simulation,
    fit, geometry,
};
use glam::DVec3;
use physics::frame::vector_from_rotation;
use physics::{AnyEffect, Inputs, Memories, Model, ParameterValues};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;
use serde_json::{Value, json};
use std::error::Error;

const POSES: usize = 80;
/// A laser tracker: 10 µm + 2 µm/m along the beam, 15 µm + 6 µm/m across.
const TRACKER: ReadingNoise = ReadingNoise::Tracker { along: (1e-5, 2e-6), across: (1.5e-5, 6e-6) };
const RANGES_DEG: [[f64; 2]; 6] = [
    [-80.0, 80.0],
    [-40.0, 50.0],
    [-60.0, 40.0],
    [-120.0, 120.0],
    [-100.0, 100.0],
    [-170.0, 170.0],
];
/// 95 % of a normal distribution lie within this many standard deviations.
const WITHIN: f64 = 1.959_964;
/// Compliance of joint 2 as a file states it, with its standard uncertainty, rad/Nm.
const STATED: (f64, f64) = (2.2e-6, 3e-7);

/// Linear effects, all of which the truth has: kind, stem, joint (from 0), range of the parameter, SI.
const EFFECTS: [(&str, &str, usize, [f64; 2]); 9] = [
    ("joint_compliance", "compliance", 2, [3e-6, 1e-5]),
    ("joint_compliance", "compliance", 4, [5e-5, 2e-4]),
    ("backlash", "width", 0, [5e-5, 2e-4]),
    ("backlash", "width", 1, [5e-5, 2e-4]),
    ("backlash", "width", 3, [1e-4, 4e-4]),
    ("backlash", "width", 4, [1e-4, 4e-4]),
    ("backlash", "width", 5, [2e-4, 6e-4]),
    ("joint_ratio", "ratio", 3, [-3e-4, 3e-4]),
    ("joint_ratio", "ratio", 4, [-3e-4, 3e-4]),
];
/// Waves: joint (from 0), cycles per revolution.
const WAVES: [(usize, f64); 2] = [(0, 9.923), (3, 7.857)];

/// Hypothesis with all effects of the truth free, linear parameters at zero.
fn open(nominal: &Model) -> Option<Hypothesis> {
    let mut hypothesis = geometry(nominal, &[]);
    let arm = nominal.arm;
    let build = |kind, joint, given: &[(&str, &[f64])]| {
        AnyEffect::build(kind, &arm, Some(joint), ParameterValues(given)).ok()
    };
    let first = hypothesis.model.effects().len();
    let stated = build("joint_compliance", 1, &[("compliance", &[STATED.0])])?;
    hypothesis.model.push(stated).ok()?;
    hypothesis.free_all(first, &[], &[STATED.1]);
    for (kind, stem, joint, _) in EFFECTS {
        hypothesis.add(build(kind, joint, &[(stem, &[0.0])])?, &[]).ok()?;
    }
    for (joint, cycles) in WAVES {
        let given: &[(&str, &[f64])] =
            &[("amplitude", &[1e-4]), ("cycles", &[cycles]), ("phase", &[0.0])];
        hypothesis.add(build("transmission_error", joint, given)?, &["cycles"]).ok()?;
    }
    Some(hypothesis)
}

/// Random true parameters for the hypothesis `open`; those with indices in `fixed` keep their values.
fn draw(open: &Hypothesis, fixed: &[usize], chance: &mut ChaCha8Rng) -> Model {
    let mut truth = *open.model;
    let drawn = open.free.iter().enumerate().filter(|(k, _)| !fixed.contains(k));
    for (_, free) in drawn {
        let Some(effect) = open.effect_of(free) else { continue };
        let (kind, joint) = (effect.spec().kind, effect.joint());
        let normal: f64 = chance.sample(StandardNormal);
        let listed = EFFECTS.iter().find(|e| e.0 == kind && Some(e.2) == joint);
        let stem = parameter_key(effect, free.value).map_or("", |key| key.parameter.stem);
        let value = match (kind, stem, listed) {
            (_, _, Some((.., [low, high]))) => between(chance, *low, *high),
            ("joint_offset", ..) => 2e-3 * normal,
            ("axis_tilt", ..) => 1e-3 * normal,
            ("axis_shift", ..) => 5e-4 * normal,
            (_, "amplitude", _) => between(chance, 1e-4, 3e-4),
            (_, "phase", _) => between(chance, -3.0, 3.0),
            _ => free.mean + free.sigma * normal,
        };
        truth.change(free.effect, |effect| effect.values_mut()[free.value] = value);
    }
    truth
}

fn empty(nominal: &Model) -> Option<Campaign> {
    let mut chance = ChaCha8Rng::seed_from_u64(77);
    let inputs: Vec<Inputs> = (0..POSES).map(|_| rig::inputs(&mut chance, &RANGES_DEG)).collect();
    rig::campaign(&nominal.arm, &inputs, TRACKER)
}

/// Normalised error of each fitted parameter (error divided by its standard uncertainty), with its column.
fn deviates(found: &Fit, truth: &Model, around: &Extrinsics) -> Vec<(usize, f64)> {
    let mut errors = off_surroundings(&found.surroundings, around);
    let truth = Hypothesis { model: Box::new(*truth), free: found.hypothesis.free.clone() };
    let pairs = found.hypothesis.values().into_iter().zip(truth.values());
    errors.extend(pairs.map(|(found, truth)| truth - found));
    same_waves(found, &truth, &mut errors);
    let deviate = |column: &usize| Some((*column, errors[*column] / found.sigma(*column)?));
    found.columns().iter().filter_map(deviate).collect()
}

/// True minus estimated extrinsic parameters, one per fitted parameter (one frame, reflectors).
fn off_surroundings(found: &Extrinsics, truth: &Extrinsics) -> Vec<f64> {
    let mut errors = Vec::new();
    for (found, truth) in found.frames.iter().zip(&truth.frames).filter(|(found, _)| found.free) {
        let (found_frame, true_frame) =
            (found.value.measuring_from_base, truth.value.measuring_from_base);
        let rotation = true_frame.rotation * found_frame.rotation.transpose();
        let turned = found.value.pivot + rotation * (found_frame.origin - found.value.pivot);
        errors.extend(vector_from_rotation(&rotation).to_array());
        errors.extend((true_frame.origin - turned).to_array());
    }
    for (found, truth) in found.targets.iter().zip(&truth.targets).filter(|(found, _)| found.free) {
        errors.extend((truth.value - found.value).to_array());
    }
    errors
}

/// Errors of amplitude and phase for equivalent representations of a wave: negative amplitude equals opposite phase, and phases are periodic.
fn same_waves(found: &Fit, truth: &Hypothesis, errors: &mut [f64]) {
    let (values, truths) = (found.hypothesis.values(), truth.values());
    for (k, free) in found.hypothesis.free.iter().enumerate() {
        let stem = |free: &diagnosis::FreeParameter| {
            let effect = found.hypothesis.effect_of(free)?;
            Some(parameter_key(effect, free.value)?.parameter.stem)
        };
        if stem(free) != Some("phase") {
            continue;
        }
        let same = |other: &diagnosis::FreeParameter| {
            other.effect == free.effect && stem(other) == Some("amplitude")
        };
        let Some(amplitude) = found.hypothesis.free.iter().position(same) else { continue };
        let sign = 1.0_f64.copysign(values[amplitude]);
        let half = if sign < 0.0 { std::f64::consts::PI } else { 0.0 };
        let (column, phase) = (found.column_of(amplitude), found.column_of(k));
        errors[column] = sign * truths[amplitude] - values[amplitude];
        let turn = truths[k] - values[k] - half;
        errors[phase] = libm::atan2(turn.sin(), turn.cos());
    }
}

/// Makes 5 % of the readings, selected at random, outliers by 0.25 mm to 30 mm.
fn spoil(campaign: &mut Campaign, chance: &mut ChaCha8Rng) {
    for observation in campaign.poses.iter_mut().flat_map(|pose| &mut pose.seen) {
        if chance.random::<f64>() >= 0.05 {
            continue;
        }
        if let Reading::Point { at, .. } = &mut observation.reading {
            let away = DVec3::from_array([0; 3].map(|_| chance.sample(StandardNormal)));
            *at += away.normalize_or(DVec3::X) * 10.0_f64.powf(between(chance, -3.6, -1.5));
        }
    }
}

/// Fit of a robot with all effects of the hypothesis, which shows the parameters that the poses do not determine.
fn pilot(empty: &Campaign, open: &Hypothesis, settings: &FitSettings<'_>) -> Fit {
    let drawn = draw(open, &[], &mut ChaCha8Rng::seed_from_u64(1));
    let made = campaign_simulation::simulate_readings(empty, &drawn, &empty.surroundings, 1.0, 1);
    fit(&made, open, settings)
}

/// Indices of the free parameters that a fit did not determine.
fn left_open(found: &Fit) -> Vec<usize> {
    let open = |k: &usize| found.sigma(found.column_of(*k)).is_none();
    (0..found.hypothesis.free.len()).filter(open).collect()
}

/// Coverage with the effects given, clean and with outliers.
pub(crate) fn fixed(campaigns: u64) -> Result<Value, Box<dyn Error>> {
    let nominal = rig::model("irb1600-6-145")?;
    let open = open(&nominal).ok_or("no hypothesis")?;
    let empty = empty(&nominal).ok_or("no campaign")?;
    let used = vec![true; POSES];
    let mut all = serde_json::Map::new();
    for (name, influence, known, outliers) in [
        ("clean", Influence::Redescending, true, false),
        ("clean_noise_unknown", Influence::Redescending, false, false),
        ("outliers", Influence::Redescending, true, true),
        ("outliers_noise_unknown", Influence::Redescending, false, true),
        ("outliers_huber", Influence::Huber, true, true),
    ] {
        let mut empty = empty.clone();
        empty.instruments[0].noise_is_known = known;
        let settings = FitSettings::full(&used, influence);
        let pilot = pilot(&empty, &open, &settings);
        let fixed = left_open(&pilot);
        let runs = rig::for_seeds(campaigns, |seed| {
            let mut chance = ChaCha8Rng::seed_from_u64(1000 + seed);
            let truth = draw(&open, &fixed, &mut chance);
            let mut made = campaign_simulation::simulate_readings(
                &empty,
                &truth,
                &empty.surroundings,
                1.0,
                seed,
            );
            if outliers {
                spoil(&mut made, &mut chance);
            }
            let found = fit(&made, &open, &settings);
            let same = found.columns() == pilot.columns();
            let deviates = deviates(&found, &truth, &empty.surroundings);
            (deviates, found.converged, same, found.factors[0], found.design_effect)
        });
        let converged = runs.iter().filter(|run| run.1).count();
        let same = runs.iter().filter(|run| run.2).count();
        let factor = rig::median(runs.iter().map(|run| run.3).collect());
        let inflated = runs.iter().filter(|run| run.4 > 1.0).count();
        let list: Vec<Vec<(usize, f64)>> = runs.into_iter().map(|run| run.0).collect();
        let mut figures = covered(&list, &|column| name_of(&pilot, column));
        figures["converged"] = converged.into();
        figures["same_numbers"] = same.into();
        figures["noise_factor"] = factor.into();
        figures["design_effect_above_one"] = inflated.into();
        all.insert(name.to_owned(), figures);
    }
    Ok(Value::Object(all))
}

fn name_of(found: &Fit, column: usize) -> String {
    let numbers = found.surroundings.parameters();
    let free = column.checked_sub(numbers.len()).and_then(|k| found.hypothesis.free.get(k));
    match (numbers.get(column), free) {
        (Some(number), _) => found.surroundings.describe(*number),
        (_, Some(free)) => {
            found.hypothesis.effect_of(free).map_or(String::new(), |e| describe(e, free.value))
        }
        _ => String::new(),
    }
}

/// Pooled coverage, the share of parameters with a coverage between 93 and 97 %, and the parameters outside.
fn covered(runs: &[Vec<(usize, f64)>], name: &dyn Fn(usize) -> String) -> Value {
    let width = runs.iter().flatten().map(|(column, _)| column + 1).max().unwrap_or(0);
    let mut counts = vec![(0.0, 0.0, 0.0); width];
    for (column, deviate) in runs.iter().flatten() {
        let one = &mut counts[*column];
        one.0 += f64::from(u8::from(deviate.abs() <= WITHIN));
        one.1 += 1.0;
        one.2 += deviate * deviate;
    }
    let pooled = counts.iter().map(|c| c.0).sum::<f64>() / counts.iter().map(|c| c.1).sum::<f64>();
    let numbers: Vec<(usize, f64, f64)> = (0..width)
        .filter(|k| counts[*k].1 > 0.0)
        .map(|k| (k, counts[k].0 / counts[k].1, (counts[k].2 / counts[k].1).sqrt()))
        .collect();
    let inside = numbers.iter().filter(|(_, share, _)| (0.93..=0.97).contains(share)).count();
    let outside = numbers.iter().filter(|(_, share, _)| !(0.93..=0.97).contains(share));
    let outside: Vec<Value> = outside
        .map(|(k, share, rms)| json!({ "number": name(*k), "covered": share, "rms_deviate": rms }))
        .collect();
    json!({
        "campaigns": runs.len(), "numbers": numbers.len(), "pooled": pooled,
        "share_of_numbers_within_93_to_97": inside as f64 / numbers.len() as f64,
        "outside": outside,
    })
}

/// Coverage after selection of the effects, for the parameters of true effects that were selected; and the ratio of the tool error to its expected
/// value.
pub(crate) fn selected(campaigns: u64) -> Result<Value, Box<dyn Error>> {
    let nominal = rig::model("irb1600-6-145")?;
    let open = open(&nominal).ok_or("no hypothesis")?;
    let mut empty = empty(&nominal).ok_or("no campaign")?;
    // Frame and reflectors are known here, since the tool error in the base frame is evaluated.
    empty.surroundings.frames[0].free = false;
    empty.surroundings.targets.iter_mut().for_each(|target| target.free = false);
    let used = vec![true; POSES];
    let settings = FitSettings::full(&used, Influence::Huber);
    let fixed = left_open(&pilot(&empty, &open, &settings));
    let poses: Vec<Inputs> = {
        let mut chance = ChaCha8Rng::seed_from_u64(78);
        (0..POSES).map(|_| rig::inputs(&mut chance, &RANGES_DEG)).collect()
    };
    let runs = rig::for_seeds(campaigns, |seed| {
        let mut chance = ChaCha8Rng::seed_from_u64(1000 + seed);
        let truth = draw(&open, &fixed, &mut chance);
        let made =
            campaign_simulation::simulate_readings(&empty, &truth, &empty.surroundings, 1.0, seed);
        let found = calibrate(&made, &nominal, &[], &used, &ignore).advanced;
        let position = |model: &Model, inputs: &Inputs| {
            model.evaluate(inputs, &Memories::default()).real.base_from_tool.origin
        };
        let model = &found.fit.hypothesis.model;
        let erred =
            poses.iter().map(|i| (position(model, i) - position(&truth, i)).length_squared());
        let expected = tool_uncertainty(&found.fit, &poses);
        let expected: f64 = expected.iter().map(|u| u * u).sum();
        (of_truth(&found.fit, &truth), erred.sum::<f64>(), expected, found.chosen.len())
    });
    let ratio = rig::median(runs.iter().map(|run| (run.1 / run.2).sqrt()).collect());
    let effects = rig::median(runs.iter().map(|run| run.3 as f64).collect());
    let deviates: Vec<f64> = runs.into_iter().flat_map(|run| run.0).collect();
    let inside = deviates.iter().filter(|deviate| deviate.abs() <= WITHIN).count();
    Ok(json!({
        "campaigns": campaigns, "effects_chosen": effects, "effects_of_the_truth": EFFECTS.len() + WAVES.len() + 1,
        "numbers": deviates.len(), "pooled": inside as f64 / deviates.len() as f64,
        "tool_error_over_expected": ratio,
    }))
}

/// Normalised errors of the linear parameters of true effects.
fn of_truth(found: &Fit, truth: &Model) -> Vec<f64> {
    let values = found.hypothesis.values();
    let numbers = found.hypothesis.free.iter().zip(values).enumerate();
    let deviate = |(k, (free, value)): (usize, (&diagnosis::FreeParameter, f64))| {
        let effect = found.hypothesis.effect_of(free)?;
        let true_effect = truth.effects().find(|true_effect| {
            (true_effect.spec().kind, true_effect.joint()) == (effect.spec().kind, effect.joint())
        })?;
        let kind = true_effect.spec().kind;
        let sigma = found.sigma(found.column_of(k)).filter(|_| kind != "transmission_error")?;
        Some((true_effect.values()[free.value] - value) / sigma)
    };
    numbers.filter_map(deviate).collect()
}
