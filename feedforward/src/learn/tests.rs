//! Learning on a joint that is integrated in time: it converges, never diverges, and leaves noise alone.

use super::*;
use crate::settings::settings;
use crate::virtual_joint::{JOINT, STEP_S, VirtualJoint, corners, differences, largest, rms};
use proptest::prelude::*;

fn previewed(plants: &Plants, path: &[f64]) -> Vec<f64> {
    let first = crate::preview(plants, None, STEP_S, &[path.to_vec()], &settings());
    first.expect("previewed").commanded.remove(0)
}

/// White noise with a standard deviation and a seed.
struct Noise(u64);

impl Noise {
    fn next(&mut self, sigma: f64) -> f64 {
        let mut uniform = || {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        let sum: f64 = (0..12).map(|_| uniform()).sum();
        sigma * (sum - 6.0)
    }
}

struct Cell<'a> {
    truth: VirtualJoint,
    plants: &'a Plants,
    path: &'a [f64],
    noise: Noise,
    sigma: f64,
}

impl Cell<'_> {
    fn measure(&mut self, commanded: &[f64]) -> MeasuredErrors {
        let reached = self.truth.run(STEP_S, commanded);
        let error = differences(self.path, &reached)
            .iter()
            .map(|e| e + self.noise.next(self.sigma))
            .collect();
        MeasuredErrors {
            joints: vec![Some((MeasuredQuantity::Link, error))],
            clock_offset_s: 0.0,
            late_s: 0.0,
        }
    }

    fn next(&mut self, commanded: &[f64], runs: usize) -> NextRun {
        let measured: Vec<MeasuredErrors> = (0..runs).map(|_| self.measure(commanded)).collect();
        let (wanted, commanded) = (&[self.path.to_vec()][..], &[commanded.to_vec()][..]);
        let runs = Runs { step_s: STEP_S, wanted, commanded, measured: &measured };
        learn(self.plants, &[], &runs, &settings()).expect("learns")
    }

    fn error(&self, commanded: &[f64]) -> Vec<f64> {
        differences(self.path, &self.truth.run(STEP_S, commanded))
    }
}

#[test]
fn three_runs_after_a_preview_leave_a_tenth() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 0.8), (0.05, 0.7), (0.0, 0.5), (-0.08, 0.6)]);
    for sign in [-1.0, 1.0] {
        let believed = JOINT.believed(1.0 + 0.03 * sign);
        let plants = believed.plants(0.03);
        let mut cell =
            Cell { truth: JOINT, plants: &plants, path: &path, noise: Noise(3), sigma: 1e-5 };
        let before = cell.error(&path);
        let mut commanded = previewed(&plants, &path);
        for _ in 0..3 {
            commanded = cell.next(&commanded, 1).commanded.remove(0);
        }
        let after = cell.error(&commanded);
        assert!(
            largest(&after) < largest(&before) / 10.0,
            "{} {}",
            largest(&before),
            largest(&after)
        );
    }
}

#[test]
fn the_plant_is_identified_from_a_run() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 0.8), (0.05, 0.7)]);
    let believed = JOINT.believed(0.8);
    let plants = believed.plants(0.1);
    let mut cell =
        Cell { truth: JOINT, plants: &plants, path: &path, noise: Noise(7), sigma: 1e-5 };
    let commanded = previewed(&plants, &path);
    let learned = cell.next(&commanded, 1).joints.remove(0).expect("learned");
    let found = learned.identified.expect("the model explains it far worse").plant;
    let assert_near = |found: f64, truth: f64, share: f64| {
        assert!((found / truth - 1.0).abs() < share, "{found} {truth}");
    };
    assert_near(found.modes[0].frequency_hz.value, JOINT.frequency_hz, 0.01);
    assert_near(found.delays_s[0].value + found.lags_s[0].value, JOINT.delay_s + JOINT.lag_s, 0.01);
}

#[test]
fn differences_between_runs_are_reported_and_not_learned() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 1.0)]);
    let plants = JOINT.plants(0.03);
    let mut cell =
        Cell { truth: JOINT, plants: &plants, path: &path, noise: Noise(5), sigma: 2e-4 };
    let mut commanded = previewed(&plants, &path);
    for _ in 0..6 {
        let next = cell.next(&commanded, 4);
        let reported =
            next.joints[0].as_ref().and_then(|joint| joint.repeatability).expect("of four runs");
        assert!((reported / 2e-4 - 1.0).abs() < 0.05, "{reported}");
        commanded = next.commanded.into_iter().next().expect("one joint");
    }
    // Noise copied into the commands six times would give 2e-4 or more.
    let rest = cell.error(&commanded);
    let still = &rest[rest.len() - 100..];
    assert!(rms(still) < 1e-4, "{}", rms(still));
}

#[test]
fn from_a_motor_encoder_only_a_joint_without_modes_learns_delay_and_lag() {
    let path = corners(STEP_S, &[(0.1, 1.0), (-0.1, 1.0)]);
    let with_mode = JOINT.plants(0.03);
    let mut plants = with_mode.clone();
    plants.joints[0].modes.clear();
    let motor = VirtualJoint { participation: 0.0, ..JOINT };
    let error = differences(&path, &motor.run(STEP_S, &path));
    let measured = [MeasuredErrors {
        joints: vec![Some((MeasuredQuantity::Motor, error.clone()))],
        clock_offset_s: 0.0,
        late_s: 0.0,
    }];
    let (wanted, commanded) = (&[path.clone()][..], &[path.clone()][..]);
    let next = learn(
        &plants,
        &[],
        &Runs { step_s: STEP_S, wanted, commanded, measured: &measured },
        &settings(),
    )
    .expect("learns");
    let runs = Runs { step_s: STEP_S, wanted, commanded, measured: &measured };
    let refused = learn(&with_mode, &[], &runs, &settings());
    assert_eq!(refused, Err(FeedforwardError::NothingMeasured));
    let after = differences(&path, &motor.run(STEP_S, &next.commanded[0]));
    assert!(rms(&after) < rms(&error) / 5.0, "{} {}", rms(&error), rms(&after));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn it_never_diverges_with_a_model_that_is_off_by_thirty_percent(
        off_by in prop::array::uniform4(-0.3..0.3_f64), speeds in prop::array::uniform4(-0.2..0.2_f64), seed in any::<u64>(),
    ) {
        let truth = VirtualJoint {
            delay_s: JOINT.delay_s * (1.0 + off_by[0]),
            lag_s: JOINT.lag_s * (1.0 + off_by[1]),
            frequency_hz: JOINT.frequency_hz * (1.0 + off_by[2]),
            damping_ratio: JOINT.damping_ratio * (1.0 + off_by[3]),
            ..JOINT
        };
        let path = corners(STEP_S, &speeds.map(|speed| (speed, 0.6)));
        let plants = JOINT.plants(0.05);
        let noise = 2e-5;
        let mut cell = Cell { truth, plants: &plants, path: &path, noise: Noise(seed), sigma: noise };
        let mut commanded = path.clone();
        let mut before = rms(&cell.error(&commanded));
        for _ in 0..8 {
            commanded = cell.next(&commanded, 1).commanded.remove(0);
            let now = rms(&cell.error(&commanded));
            prop_assert!(now <= 1.01 * before + noise, "{now} after {before}");
            before = now;
        }
    }
}
