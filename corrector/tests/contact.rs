//! The corrector in contact: a simulated surface, a robot that lags, a model that is inaccurate.
#![expect(clippy::expect_used, reason = "in a test a panic is the message")]

mod support;

use corrector::{CycleInputs, GateState, Outcome, Settings, WrenchSample};
use glam::DVec3;
use physics::{Arm, Chain, Inputs, JOINTS_MAX, Joints, Memories, Model, Wrench};
use std::collections::VecDeque;
use support::{DT_NS, Run, effect, envelope, six};

const Q: [f64; 6] = [0.3, 0.2, 0.1, 0.4, 0.9, 0.2];
/// Cycles until the robot has followed a command: 20 ms.
const LAG_CYCLES: usize = 20;
/// Force of a cut on a robot that is exactly at its command, N.
const FORCE_N: f64 = 100.0;

fn compliant(arm: Arm, factor: f64) -> Model {
    let each = [3e-6, 4e-6, 4e-6, 1e-5, 1e-5, 2e-5];
    let effect = |(i, c): (usize, &f64)| {
        effect(&arm, "load_compliance", Some(i), &[("compliance", &[c * factor])])
    };
    let effects: Vec<_> = each.iter().enumerate().map(effect).collect();
    Model::new(arm, &effects).expect("room")
}

struct Cell {
    run: Run,
    truth: Model,
    normal: DVec3,
    stiffness: f64,
    compliance: f64,
    /// Targets that were sent and not reached yet.
    sent: VecDeque<Joints>,
    /// White noise on the measured force, N, and slow change of the surface as a share.
    noise_n: f64,
    wander: f64,
    cycle: u64,
    force_n: f64,
}

impl Cell {
    /// `model_factor`: the model's compliance over the true one.
    fn new(stiffness: f64, model_factor: f64, settings: Settings) -> Self {
        let run = Run::new(compliant(six(), model_factor), settings);
        let normal = DVec3::new(0.6, -0.48, 0.64);
        let mut cell = Self {
            run,
            truth: compliant(six(), 1.0),
            normal,
            stiffness,
            compliance: 0.0,
            sent: VecDeque::from(vec![joints(&Q); LAG_CYCLES]),
            noise_n: 0.0,
            wander: 0.0,
            cycle: 0,
            force_n: 0.0,
        };
        cell.compliance = (cell.height(&joints(&Q), 1.0) - cell.height(&joints(&Q), 0.0)).abs();
        cell
    }

    /// Position of the real tool along the normal, with `force_n` on it.
    fn height(&self, q: &Joints, force_n: f64) -> f64 {
        let mut inputs = Inputs::at_rest(*q);
        inputs.wrench_base = Wrench { force: self.normal * force_n, moment: DVec3::ZERO };
        self.normal
            .dot(self.truth.evaluate(&inputs, &Memories::default()).real.base_from_tool.origin)
    }

    /// Series stiffness times the model's compliance.
    fn loop_gain(&self, model_factor: f64) -> f64 {
        let k = self.stiffness;
        model_factor * self.compliance * k / (1.0 + k * self.compliance)
    }

    fn step(&mut self) -> Outcome {
        self.cycle += 1;
        let t_s = self.cycle as f64 * 1e-3;
        let target = self.sent.pop_front().expect("a target");
        let commanded = self.normal.dot(Chain::nominal(&six(), &joints(&Q)).base_from_tool.origin);
        let wave = 1.0 + self.wander * (2.0 * t_s).sin();
        let depth = FORCE_N * (1.0 / self.stiffness + self.compliance) * t_s.min(1.0) * wave;
        // The surface is `depth` above the commanded height; the tool is deflected by compliance
        // times force.
        let unloaded = self.height(&target, 0.0);
        let pressed = (commanded + depth - unloaded).max(0.0);
        self.force_n = pressed / (1.0 / self.stiffness + self.compliance);
        let hash = self.cycle.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 11;
        let noise = self.noise_n * (hash as f64 / (1_u64 << 52) as f64 - 1.0);
        let wrench = Wrench { force: self.normal * (self.force_n + noise), moment: DVec3::ZERO };
        let sample = WrenchSample { wrench, in_base: true, age_ns: DT_NS, faulty: false };
        self.run.world = CycleInputs { wrench: Some(sample), ..CycleInputs::default() };
        let outcome = self.run.cycle(&Q);
        self.sent.push_back(outcome.added_to(&Q));
        outcome
    }

    /// Distance of the tool from its desired position, along the normal, m.
    fn error(&self) -> f64 {
        let commanded = self.normal.dot(Chain::nominal(&six(), &joints(&Q)).base_from_tool.origin);
        self.height(&self.sent[0], self.force_n) - commanded
    }
}

fn joints(q: &[f64; 6]) -> Joints {
    let mut all = [0.0; JOINTS_MAX];
    all[..6].copy_from_slice(q);
    all
}

fn settings() -> Settings {
    Settings::with_envelope(envelope())
}

struct Seen {
    last: Outcome,
    largest_n: f64,
    /// Peak to peak over the last two seconds, N.
    swing_n: f64,
}

fn watched(cell: &mut Cell, seconds: u64) -> Seen {
    let (mut largest_n, mut low, mut high) = (0.0_f64, f64::INFINITY, 0.0_f64);
    let mut last = Outcome::default();
    for k in 0..seconds * 1000 {
        last = cell.step();
        largest_n = largest_n.max(cell.force_n);
        if k + 2000 >= seconds * 1000 {
            (low, high) = (low.min(cell.force_n), high.max(cell.force_n));
        }
    }
    Seen { last, largest_n, swing_n: high - low }
}

const STIFFNESSES: [f64; 5] = [1e5, 3e5, 1e6, 3e6, 1e7];
const MODEL_FACTORS: [f64; 3] = [0.7, 1.0, 1.3];

#[test]
fn no_contact_makes_the_loop_grow_or_cycle_and_its_gain_is_found() {
    let (mut opened, mut closed) = (0, 0);
    for stiffness in STIFFNESSES {
        for factor in MODEL_FACTORS {
            let mut cell = Cell::new(stiffness, factor, settings());
            let gain = cell.loop_gain(factor);
            let observed = watched(&mut cell, 10);
            let case = format!(
                "{stiffness:e} N/m, model {factor}, gain {gain:.3}, {:?}",
                observed.last.gate
            );
            assert!(observed.swing_n < 0.01 * FORCE_N, "{case}: swings {} N", observed.swing_n);
            // With half a share the force grows by 1/(1 - 1.3/2) at most; with a share of one and a
            // gain below one half, at most to twice its value.
            assert!(observed.largest_n < 3.0 * FORCE_N, "{case}: {} N", observed.largest_n);
            let found = observed.last.loop_gain;
            // The equation neglects the robot's lag.
            assert!((found - gain).abs() < 0.01 + 0.06 * gain, "{case}: found {found}");
            match observed.last.gate {
                GateState::Open => opened += 1,
                GateState::GainTooHigh => closed += 1,
                _ => {}
            }
            assert!(
                gain > 0.56 && observed.last.gate == GateState::GainTooHigh || gain < 0.56,
                "{case}"
            );
            assert!(gain < 0.44 && observed.last.gate == GateState::Open || gain > 0.44, "{case}");
        }
    }
    assert!(opened > 3 && closed > 3, "{opened} opened, {closed} closed");
}

#[test]
fn a_rough_cut_on_any_contact_stays_bounded() {
    for stiffness in STIFFNESSES {
        for factor in MODEL_FACTORS {
            let mut cell = Cell::new(stiffness, factor, settings());
            (cell.noise_n, cell.wander) = (40.0, 0.2);
            let gain = cell.loop_gain(factor);
            let observed = watched(&mut cell, 12);
            let case = format!(
                "{stiffness:e} N/m, model {factor}, gain {gain:.3}, {:?}",
                observed.last.gate
            );
            assert!(observed.largest_n < 4.0 * FORCE_N, "{case}: {} N", observed.largest_n);
            assert!(!(gain > 0.7 && observed.last.gate == GateState::Open), "{case}");
        }
    }
}

#[test]
fn an_open_gate_takes_the_deflection_out() {
    let mut cell = Cell::new(1e5, 1.0, settings());
    let mut largest = 0.0_f64;
    for _ in 0..10_000 {
        cell.step();
        largest = largest.max(cell.error().abs());
    }
    assert!(cell.error().abs() < 0.03 * largest, "{} of {largest} m", cell.error());
}

#[test]
fn a_stiffer_contact_than_the_one_found_brings_the_share_back_to_a_half() {
    let mut cell = Cell::new(1e5, 1.3, settings());
    assert_eq!(watched(&mut cell, 8).last.gate, GateState::Open);
    // The tool runs into a hard surface.
    cell.stiffness = 1e7;
    let observed = watched(&mut cell, 12);
    assert_eq!(observed.last.gate, GateState::Partly);
    assert!(observed.last.loop_gain < 0.44, "what was found, though it holds no longer");
    assert!(observed.swing_n < 0.01 * cell.force_n, "{} of {} N", observed.swing_n, cell.force_n);
}

#[test]
fn a_known_process_stiffness_opens_or_closes_the_gate_by_the_models_compliance() {
    for (stiffness, expected) in [(5e4, GateState::Open), (3e6, GateState::GainTooHigh)] {
        let mut with = settings();
        with.wrench.process_stiffness = Some(stiffness);
        let observed = watched(&mut Cell::new(stiffness, 1.0, with), 4);
        assert_eq!(observed.last.gate, expected);
        assert_eq!(observed.last.loop_gain < 0.5, expected == GateState::Open);
        assert!(observed.swing_n < 0.01 * FORCE_N);
    }
}

#[test]
fn a_lost_force_stream_fades_out_and_comes_back_without_a_jump() {
    let mut cell = Cell::new(1e5, 1.0, settings());
    watched(&mut cell, 8);
    let mut last = cell.run.cycle(&Q);
    let mut sizes = Vec::new();
    for k in 0..3000_u64 {
        let stale = (500..1800).contains(&k);
        let sample = cell.run.world.wrench.as_mut().expect("a sample");
        sample.age_ns = if stale { 80_000_000 } else { DT_NS };
        let outcome = cell.run.cycle(&Q);
        for i in 0..6 {
            let moved = (outcome.correction[i] - last.correction[i]).abs();
            assert!(moved <= envelope().rate() * 1e-3 * (1.0 + 1e-9), "{k}: {moved}");
        }
        sizes.push(outcome.correction[..6].iter().map(|c| c.abs()).sum::<f64>());
        assert_eq!(outcome.gate == GateState::Stale, stale, "{k}");
        last = outcome;
    }
    assert!(sizes[1700] < 1e-9 && sizes[400] > 1e-4 && sizes[2900] > 1e-4 * 0.4);
}

#[test]
fn a_sensor_with_a_fault_closes_the_gate_by_name_however_fresh_its_readings_are() {
    let mut cell = Cell::new(1e5, 1.0, settings());
    watched(&mut cell, 8);
    let with = cell.run.cycle(&Q);
    let mut last = with;
    for k in 0..1500 {
        let sample = cell.run.world.wrench.as_mut().expect("a sample");
        (sample.faulty, sample.age_ns) = (true, DT_NS);
        let outcome = cell.run.cycle(&Q);
        for i in 0..6 {
            let moved = (outcome.correction[i] - last.correction[i]).abs();
            assert!(moved <= envelope().rate() * 1e-3 * (1.0 + 1e-9), "{k}: {moved}");
        }
        assert_eq!(outcome.gate, GateState::SensorFault, "{k}");
        last = outcome;
    }
    let size = |outcome: &Outcome| outcome.correction[..6].iter().map(|c| c.abs()).sum::<f64>();
    assert!(size(&with) > 1e-4 && size(&last) < 1e-9, "{} {}", size(&with), size(&last));
}

#[test]
fn one_broken_reading_does_not_poison_the_filter() {
    let mut cell = Cell::new(1e5, 1.0, settings());
    watched(&mut cell, 8);
    let good = cell.run.world.wrench.expect("a sample");
    let before = cell.run.cycle(&Q);
    for invalid in [f64::NAN, f64::INFINITY, 1e308, -1e200] {
        let wrench = Wrench { force: DVec3::splat(invalid), ..good.wrench };
        cell.run.world.wrench = Some(WrenchSample { wrench, ..good });
        cell.run.cycle(&Q);
    }
    cell.run.world.wrench = Some(good);
    let after = (0..1000).map(|_| cell.run.cycle(&Q)).last().expect("a cycle");
    let change =
        (0..6).map(|i| (after.correction[i] - before.correction[i]).abs()).fold(0.0, f64::max);
    assert!(change < 1e-5, "{change}");
}
