//! The cell as a whole: physics, determinism.

use super::*;
use crate::draw::{Calibration, draw};
use crate::path::tool_along;
use crate::slots::Slots;
use crate::test_arm::{effect, irb1600};
use physics::Model;

fn path() -> JointPath {
    let arm = irb1600();
    let rotation = tool_along(-DVec3::Z, arm.tool.base_from_tool);
    let slots = Slots::quick(DVec3::new(0.8, 0.0, 0.4));
    JointPath::plan(&arm, &slots.tool_path(rotation).expect("sound"), 1e-3, None).expect("reach")
}

fn calibrated() -> Model {
    let arm = irb1600();
    let effects = [
        effect(&arm, "joint_offset", 0, "offset", 4e-4),
        effect(&arm, "joint_compliance", 1, "compliance", 2.2e-6),
        effect(&arm, "joint_compliance", 2, "compliance", 1.1e-5),
    ];
    Model::new(arm, &effects).expect("room")
}

fn truth(seed: u64) -> TrueRobot {
    let model = calibrated();
    let sigmas = [vec![5e-5], vec![1e-7], vec![5e-7]];
    let calibration = Calibration { model: &model, sigmas: &sigmas };
    draw(&calibration, seed).expect("sound")
}

fn run(truth: &TrueRobot, setup: Setup) -> Vec<Tick> {
    let mut cell = Cell::new(truth, setup);
    let mut ticks = Vec::new();
    while let Some(sample) = cell.next_command() {
        let q = sample.q;
        ticks.extend(cell.step(&q));
    }
    ticks
}

fn ringing(seed: u64) -> Setup {
    Setup { chatter: Some(Chatter::at_72_hz(1)), ..Setup::without_chatter(path(), seed) }
}

#[test]
fn a_seed_means_one_run_to_the_bit() {
    let one = run(&truth(5), ringing(5));
    assert_eq!(one, run(&truth(5), ringing(5)));
    let other = run(&truth(5), ringing(6));
    assert_ne!(one[100].forces_tool, other[100].forces_tool);
    assert_eq!(one[100].uncorrected, other[100].uncorrected, "the sensor's noise moves no robot");
    assert_ne!(one[100].uncorrected, run(&truth(6), ringing(5))[100].uncorrected);
}

#[test]
fn the_command_published_unchanged_leaves_both_robots_alike() {
    for tick in run(&truth(2), ringing(2)) {
        assert_eq!(tick.uncorrected, tick.corrected);
    }
}

#[test]
fn a_robot_like_the_controllers_errs_by_nothing_but_the_ringing() {
    let truth = TrueRobot { model: Model::nominal(irb1600()), ambient_celsius: 20.0 };
    let largest = |ticks: &[Tick], cut| {
        let of_cut = ticks.iter().filter(|tick| tick.cut == cut);
        of_cut.map(|tick| tick.errors_m().0).fold(0.0, f64::max)
    };
    let quiet = run(&truth, Setup::without_chatter(path(), 1));
    assert!(largest(&quiet, Some(1)) < 2e-12);
    let rings = run(&truth, ringing(1));
    assert!(largest(&rings, Some(0)) < 2e-12, "before the cut that rings");
    let swing = largest(&rings, Some(1));
    assert!((2e-6..8e-6).contains(&swing), "swings by {swing} m");
}

#[test]
fn forces_stand_in_cuts_alone_and_repeat_with_the_tooth_passing() {
    let silent = Setup { force_noise_n: 0.0, ..Setup::without_chatter(path(), 1) };
    let ticks = run(&truth(1), silent);
    for tick in ticks.iter().filter(|tick| tick.cut.is_none()) {
        assert_eq!(tick.forces_tool, [DVec3::ZERO; FORCES_PER_TICK]);
        assert_eq!(tick.wrench_base, Wrench::ZERO);
    }
    let steady: Vec<&Tick> =
        ticks.iter().filter(|t| t.cut == Some(1) && t.wrench_base.force.y.abs() > 0.0).collect();
    let middle = &steady[steady.len() / 2..steady.len() / 2 + 60];
    let samples: Vec<DVec3> = middle.iter().flat_map(|tick| tick.forces_tool).collect();
    // 75 samples at 10 kHz are 7 tooth passings at 933.3 Hz.
    for (now, later) in samples.iter().zip(&samples[75..]) {
        assert!((*now - *later).length() < 1e-6, "{now} then {later}");
    }
    let mean = samples[..525].iter().sum::<DVec3>() / 525.0;
    assert!((mean - middle[0].wrench_tool.force).length() < 1e-6, "the mean is the wrench");
}

#[test]
fn the_cut_pushes_against_the_feed_and_up() {
    let ticks = run(&truth(1), Setup::without_chatter(path(), 1));
    for (cut, feed) in [(0, DVec3::Y), (1, DVec3::X), (2, -DVec3::Y)] {
        let of_cut: Vec<&Tick> = ticks.iter().filter(|tick| tick.cut == Some(cut)).collect();
        let force = of_cut[of_cut.len() / 2].wrench_base.force;
        assert!(force.dot(feed) < 0.0 && force.z > 0.0, "cut {cut}: {force}");
        assert!((0.5..20.0).contains(&force.length()), "{force}");
        let tool = of_cut[of_cut.len() / 2].wrench_tool.force;
        assert!((tool.z + force.z).abs() < 1e-12, "the tool's z points down");
    }
}
