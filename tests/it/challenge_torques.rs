//! `trued challenge --domain torque`: comparison of two formulations of drive torques; the seal;
//! injection into recordings.

use ::challenge::arm::{JOINTS, Joints};
use ::challenge::case::{ModelledEffect, Tier};
use ::challenge::case_files::File;
use ::challenge::effect::{BlindCase, EffectKind};
use ::challenge::rng::Rng;
use ::challenge::scene::Excitation;
use ::challenge::torque::candidates::is_observable;
use ::challenge::torque::case::{Noise, TorqueCase};
use ::challenge::torque::kinds::{Effect, Kind};
use ::challenge::torque::laws::{SampledMotion, recorded_torques};
use ::challenge::torque::motion::Motion;
use ::challenge::torque::rig::Rig;
use ::challenge::torque::{case_files, generate};
use recording::series::{Channel, RequiredData as Wanted, read};

use crate::program::Place;

/// Rows that are simulated for each that is compared.
const FINER: usize = 2;

/// A case whose model has viscous friction and a spring on joint `joint`, with rising temperature.
fn case(rig: Rig, joint: usize) -> TorqueCase {
    let range = rig.ranges[joint];
    let mut rng = Rng::new(12, 0);
    let motion = Motion::random(&rig.ranges, (6.0, 1000.0), true, Excitation::Full, &mut rng);
    let modelled =
        [(Kind::ViscousFriction, vec![8.0]), (Kind::Spring, vec![20.0, range.centre + 0.01])];
    let modelled = modelled.map(|(kind, parameters)| {
        let nominal = Effect::of(kind, joint, &parameters);
        ModelledEffect { true_effect: nominal.clone(), nominal, sigma: vec![0.1] }
    });
    let quiet = Noise {
        sigma: [0.0; JOINTS],
        quantum: [0.0; JOINTS],
        autocorrelation: 0.0,
        encoder_quantum: 0.0,
        gaps: 0,
    };
    TorqueCase {
        tier: Tier::Single,
        rig,
        motion,
        excitation: Excitation::Full,
        noise: quiet,
        modelled: modelled.to_vec(),
        hidden: Vec::new(),
        seed: 1,
    }
}

fn sizes(case: &TorqueCase, kind: Kind, joint: usize) -> Vec<f64> {
    let range = case.rig.ranges[joint];
    match kind {
        Kind::StribeckFriction => vec![7.0, 0.15 * range.max_speed],
        Kind::AsymmetryBoth => vec![3.0, -4.0],
        Kind::LoadFriction | Kind::DriveGain => vec![0.15],
        Kind::FrictionTemperature => vec![0.03],
        Kind::GravityTorque => vec![4.0, -7.0],
        Kind::GravityMoment => vec![0.8, -0.5, 0.3],
        Kind::TorqueRipple => vec![5.0, 11.0, 0.6],
        Kind::Spring => vec![30.0, range.centre - 0.1],
        Kind::SpringHardening => vec![5.0 / range.half_range.powi(3)],
        Kind::Hysteresis => vec![9.0, 0.05 * range.half_range],
        Kind::TorqueDelay => vec![4e-3],
        Kind::Payload => {
            let [x, y, z] = case.rig.tcp();
            vec![2.5, x + 0.04, y - 0.03, z + 0.05]
        }
        _ => vec![6.0],
    }
}

fn simulated(case: &TorqueCase, effects: &[Effect]) -> Vec<Joints> {
    let place = Place::new();
    let mut model = case_files::model(case);
    for effect in effects {
        model.push_str(&case_files::effect(effect, case.rig.is_prismatic, &[]));
    }
    place.file("model.toml", &model);
    place.file("motion.csv", &case_files::command(case, &case.motion, FINER));
    place.succeed(&["simulate", "--model", "model.toml", "--out", "seen", "motion.csv", "-q"]);
    let recording = read(&place.path("seen.csv"), None, Wanted::Measurement).expect("a recording");
    let columns: Vec<&[f64]> = (0..case.rig.count())
        .map(|i| recording.column(Channel::Torque(i)).expect("there"))
        .collect();
    let row = |row: usize| std::array::from_fn(|i| columns.get(i).map_or(0.0, |c| c[row]));
    case_files::commanded(&case.motion, FINER).into_iter().map(row).collect()
}

/// Root mean square of the difference of two lists, all joints, over the selected rows.
fn apart(a: &[Joints], b: &[Joints], requested: &[bool]) -> f64 {
    let kept = a.iter().zip(b).zip(requested).filter(|(_, is_evaluated)| **is_evaluated);
    let squares = kept.flat_map(|((a, b), _)| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)));
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

/// Rows at which no joint reverses, starts or stops: there a sign changes between two rows.
fn steady(case: &TorqueCase, ride: &SampledMotion) -> Vec<bool> {
    let sign = |row: usize, i: usize| {
        let v = ride.states[row][i][1];
        if v.abs() < 1e-5 { 0.0 } else { v.signum() }
    };
    let rows = ride.states.len();
    let is_steady = |row: usize| {
        let neighbours = row.saturating_sub(6)..(row + 7).min(rows);
        (0..case.rig.count())
            .all(|i| neighbours.clone().all(|other| sign(other, i) == sign(row, i)))
    };
    (0..rows).map(is_steady).collect()
}

/// How far the two may be apart, as a share of the effect.
fn may_be_apart(kind: Kind) -> f64 {
    match kind {
        // The first loading of slipping springs differs from that after a reversal.
        Kind::Hysteresis => 0.2,
        _ => 0.01,
    }
}

#[test]
fn every_effect_of_torques_is_the_same_in_two_formulations_that_share_nothing() {
    let mut rng = Rng::new(5, 0);
    let rigs = [
        (Rig::linear_axis(true, &mut rng), 0),
        (Rig::pendulum(true, &mut rng), 0),
        (Rig::arm(true, &mut rng), 1),
    ];
    let mut faults = Vec::new();
    for (rig, joint) in rigs {
        let case = case(rig, joint);
        let name = &case.rig.arm.name;
        let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
        let exact = |effects: &[Effect]| recorded_torques(&case.rig, &case.motion, &ride, effects);
        let (exact_nominal, theirs) = (exact(&case.nominal()), simulated(&case, &[]));
        let is_evaluated = steady(&case, &ride);
        let whole = apart(&exact_nominal, &vec![[0.0; JOINTS]; exact_nominal.len()], &is_evaluated);
        let rigid = apart(&exact_nominal, &theirs, &is_evaluated);
        // Rates of the commands are differences of rows there.
        if rigid > 2e-3 * whole {
            faults.push(format!("{name}: masses {rigid:.2e} of {whole:.2e}"));
        }
        for kind in Kind::DICTIONARY {
            if kind == Kind::Spring || !is_observable(&case, kind, joint) {
                continue;
            }
            let joint = if kind.spec().per_joint { joint } else { 0 };
            let effect = Effect::of(kind, joint, &sizes(&case, kind, joint));
            let all: Vec<Effect> = case.nominal().into_iter().chain([effect.clone()]).collect();
            let with = exact(&all);
            let size = apart(&with, &exact_nominal, &is_evaluated);
            let difference = apart(&with, &simulated(&case, &[effect]), &is_evaluated);
            if size < 0.02 || difference > may_be_apart(kind) * size + 1.5 * rigid {
                faults.push(format!(
                    "{name}, {kind:?}: {difference:.2e} of {size:.2e}, masses {rigid:.1e}"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn every_model_and_recording_of_torques_that_is_handed_out_reads_and_repeats() {
    reads_and_repeats(|index| {
        case_files::files(&generate::generate_case(8, index, Tier::mixed(index)).case)
    });
}

/// Holds it of twenty cases of a challenge, each as its files.
pub(crate) fn reads_and_repeats(files: impl Fn(usize) -> [File; 3]) {
    for index in 0..20 {
        let place = Place::new();
        for (name, text) in files(index) {
            place.file(name, &text);
        }
        place.succeed(&["simulate", "--out", "again", "-q", "recording.csv"]);
    }
    assert_eq!(files(3), files(3));
}
