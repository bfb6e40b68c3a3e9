//! Checks of simulated robots: undamaged ones pass, damaged ones do not, and the damage is identified.

use super::*;
use crate::extrinsics::FitParameter;
use crate::plan::Criterion;
use crate::plan::tests::task;
use crate::{Extrinsics, campaign_simulation};
use recording::model::presets::preset;

const TERMS: ErrorRates = ErrorRates { alarm: 0.01, power: 0.9 };

/// The calibrated robot with its stated uncertainties; the tracker's frame is known or fitted.
fn cell(is_frame_known: bool) -> (Task, Vec<Vec<f64>>) {
    let model = preset("irb1600-6-145-thesis").expect("preset").model().expect("sound");
    let mut task = task();
    task.hypothesis = Hypothesis::fixed(model.physics);
    let Extrinsics { frames, targets, .. } = &mut task.surroundings;
    targets.iter_mut().for_each(|target| *target = FitParameter::known(target.value));
    frames.iter_mut().for_each(|frame| frame.free = !is_frame_known);
    (task, model.sigma)
}

fn ten(task: &Task, sigma: &[Vec<f64>]) -> PlannedCheck {
    planned(10, task, sigma)
}

fn planned(count: usize, task: &Task, sigma: &[Vec<f64>]) -> PlannedCheck {
    let settings = PlanSettings { count, criterion: Criterion::D, candidates: 200, seed: 1 };
    plan_check(task, sigma, &settings, &TERMS).expect("poses")
}

/// Measurements of a robot that deviates from the model within its stated uncertainty, with damage of size `change` (m or rad) in the first parameter
/// of `damage`.
fn shown(
    task: &Task,
    sigma: &[Vec<f64>],
    stops: &[Joints],
    damage: Option<(Damage, f64)>,
    seed: u64,
) -> Campaign {
    shown_at(task, sigma, stops, damage, 1.0, seed)
}

/// [`shown`] with the noise multiplied by `scale`.
fn shown_at(
    task: &Task,
    sigma: &[Vec<f64>],
    stops: &[Joints],
    damage: Option<(Damage, f64)>,
    scale: f64,
    seed: u64,
) -> Campaign {
    use rand::RngExt;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let watch = DamageModel::of(&task.hypothesis.model, sigma);
    let mut step: Vec<f64> = watch
        .hypothesis
        .free
        .iter()
        .map(|free| free.sigma * rng.sample::<f64, _>(rand_distr::StandardNormal))
        .collect();
    step[watch.stated..].fill(0.0);
    if let Some((damage, change)) = damage {
        let place = watch.damages.iter().find(|(found, ..)| *found == damage).expect("watched").1;
        step[place] = change;
    }
    let truth = watch.hypothesis.stepped(&step);
    campaign_simulation::simulate_readings(
        &task.campaign(stops),
        &truth.model,
        &task.surroundings,
        scale,
        seed,
    )
}

#[test]
fn a_sound_robot_passes_as_often_as_was_asked_and_a_damaged_one_does_not() {
    for known in [true, false] {
        let (task, sigma) = cell(known);
        let checkup = ten(&task, &sigma);
        let (mut alarms, mut detected) = (0, 0);
        const RUNS: u64 = 150;
        for seed in 0..RUNS {
            let sound = shown(&task, &sigma, &checkup.poses, None, seed);
            alarms +=
                usize::from(!check_model(&sound, &task.hypothesis.model, &sigma, &TERMS).holds);
        }
        // Requested rate: 1 in 100. Six or more of 150 occur in one of two hundred such tests.
        assert!(alarms < 6, "{known}: {alarms} of {RUNS}");
        let damage = Damage::Offset(3);
        let detectable = checkup
            .detectable
            .iter()
            .find(|d| d.damage == damage)
            .expect("there")
            .least
            .expect("seen");
        for seed in 0..100 {
            let bent = shown(&task, &sigma, &checkup.poses, Some((damage, detectable)), seed);
            detected +=
                usize::from(!check_model(&bent, &task.hypothesis.model, &sigma, &TERMS).holds);
        }
        // Requested power: 90 of 100, less three standard deviations.
        assert!(detected > 80, "{known}: {detected} of 100 at {detectable}");
    }
}

#[test]
fn a_model_without_uncertainty_is_judged_where_frame_and_targets_are_known() {
    let (task, sigma) = cell(true);
    let exact: Vec<Vec<f64>> = sigma.iter().map(|sigma| vec![0.0; sigma.len()]).collect();
    let checkup = ten(&task, &exact);
    let model = &task.hypothesis.model;
    let sound = shown(&task, &exact, &checkup.poses, None, 3);
    assert!(check_model(&sound, model, &exact, &TERMS).holds);
    let bent = shown(&task, &exact, &checkup.poses, Some((Damage::Offset(2), 2e-3)), 3);
    assert!(!check_model(&bent, model, &exact, &TERMS).holds);
}

#[test]
fn the_joint_or_the_tool_that_moved_is_named() {
    let (task, sigma) = cell(false);
    let checkup = ten(&task, &sigma);
    let mut named = 0;
    let damages = [
        (Damage::Offset(1), 2e-3),
        (Damage::Offset(2), 2e-3),
        (Damage::Offset(3), 3e-3),
        (Damage::Offset(4), 4e-3),
        (Damage::ToolShift, 1.5e-3),
        (Damage::Tilt(2), 3e-3),
    ];
    for (damage, size) in damages {
        let bent = shown(&task, &sigma, &checkup.poses, Some((damage, size)), 7);
        let judged = check_model(&bent, &task.hypothesis.model, &sigma, &TERMS);
        assert!(!judged.holds, "{damage:?}");
        let found = judged.suspects.iter().find(|suspect| suspect.damage == damage);
        assert!(found.is_some(), "{damage:?} is not among {:?}", judged.suspects);
        named += usize::from(judged.suspects[0].damage == damage);
        let found = found.expect("named");
        let size_found = found.size.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(
            (size_found - size).abs() < 5.0 * found.sigma + 0.1 * size,
            "{damage:?}: {size_found}"
        );
    }
    assert!(named >= 5, "{named} of {}", damages.len());
}

#[test]
fn a_frame_that_is_found_along_takes_the_first_joint_with_it() {
    let (task, sigma) = cell(false);
    let first = |checkup: &PlannedCheck| {
        checkup.detectable.iter().find(|d| d.damage == Damage::Offset(0)).expect("there").least
    };
    assert_eq!(first(&ten(&task, &sigma)), None);
    let (task, sigma) = cell(true);
    assert!(first(&ten(&task, &sigma)).is_some_and(|minimum| minimum < 1e-3));
}

#[test]
fn chosen_poses_show_smaller_damage_than_chance() {
    let (task, sigma) = cell(false);
    let worst = |detectable: &[DetectableDamage]| {
        detectable.iter().filter_map(|d| d.least).fold(0.0, f64::max)
    };
    let chosen = worst(&ten(&task, &sigma).detectable);
    let stops = task.random(10, 8).expect("drawn");
    let random =
        check_model(&shown(&task, &sigma, &stops, None, 1), &task.hypothesis.model, &sigma, &TERMS);
    assert!(chosen < 0.8 * worst(&random.detectable), "{chosen} {}", worst(&random.detectable));
}

#[test]
fn a_damage_that_is_none_of_the_known_is_seen_by_the_sum() {
    let (task, sigma) = cell(false);
    let checkup = ten(&task, &sigma);
    let mut odd = shown(&task, &sigma, &checkup.poses, None, 3);
    // A millimetre error in one reading of three poses each, which no joint damage explains.
    for (place, axis) in [(1, 0), (4, 2), (8, 1)] {
        if let Some(crate::Reading::Point { at, .. }) =
            odd.poses[place].seen.first_mut().map(|observation| &mut observation.reading)
        {
            at[axis] += 1e-3;
        }
    }
    let judged = check_model(&odd, &task.hypothesis.model, &sigma, &TERMS);
    assert!(!judged.holds && !judged.is_explained, "{judged:?}");
}

#[test]
fn noise_that_is_overstated_is_reported_and_chance_is_not() {
    let (task, sigma) = cell(false);
    // With ten poses, so few degrees of freedom remain that residuals of a quarter of the noise would not be significant.
    let checkup = planned(24, &task, &sigma);
    const RUNS: u64 = 100;
    let scatter = |scale: f64, seed: u64| {
        let campaign = shown_at(&task, &sigma, &checkup.poses, None, scale, seed);
        check_model(&campaign, &task.hypothesis.model, &sigma, &TERMS).scatter
    };
    // Requested rate: 1 in 200. Four or more of 100 occur in one of five hundred such tests.
    let chance = (0..RUNS).filter(|seed| scatter(1.0, *seed).is_some()).count();
    assert!(chance < 4, "{chance} of {RUNS}");
    // An undamaged robot, measured with a quarter of the stated noise.
    for seed in 0..10 {
        let model = &task.hypothesis.model;
        let stops = task.campaign(&checkup.poses);
        let campaign =
            campaign_simulation::simulate_readings(&stops, model, &task.surroundings, 0.25, seed);
        let found = check_model(&campaign, model, &sigma, &TERMS).scatter.expect("far too little");
        assert!((0.1..0.5).contains(&found), "{found} of 0.25 stated");
    }
}
