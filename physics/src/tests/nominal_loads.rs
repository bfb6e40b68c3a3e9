//! Error of taking loads and effects on the nominal geometry instead of the deflected arm
//! (docs/decisions/0002).
//!
//! `cargo test -p physics nominal_loads -- --nocapture` prints the figures.

use super::effect;
use crate::deviation::Deviation;
use crate::effects::conformance::scene;
use crate::{AnyEffect, Arm, Chain, Inputs, Loads, Memory, Signals, Wrench};
use glam::DVec3;

/// Joint stiffness, kNm/rad; joints 2 to 5 from the thesis, 1 and 6 of similar size.
const STIFFNESS: [f64; 6] = [400.0, 451.5, 90.3, 9.13, 3.05, 3.0];

fn effects(arm: &Arm) -> Vec<AnyEffect> {
    let mut all = vec![
        effect(arm, "axis_shift", 2, &[("shift", &[4e-4, 0.0, -3e-4])]),
        effect(arm, "base_compliance", None, &[("compliance", &[2e-7])]),
    ];
    for (i, stiffness) in STIFFNESS.into_iter().enumerate() {
        let compliance = [1e-3 / stiffness];
        all.push(effect(arm, "joint_offset", i, &[("offset", &[5e-4])]));
        all.push(effect(arm, "joint_compliance", i, &[("compliance", &compliance)]));
    }
    all
}

/// Tool position with effects evaluated on the geometry of `chain`.
fn bent(arm: &Arm, effects: &[AnyEffect], inputs: &Inputs, chain: &Chain) -> Chain {
    let loads = Loads::on(arm, chain, inputs.wrench_base);
    let signals = Signals { arm, inputs, chain, loads: &loads };
    let mut deviation = Deviation::default();
    for effect in effects {
        deviation.add(&effect.predict(&signals, &Memory::default()));
    }
    Chain::real(arm, &inputs.q, &deviation)
}

/// Results for one set of poses, each in µm and sorted.
#[derive(Default)]
struct Campaign {
    /// Distance of the tool from its nominal position.
    deviation: Vec<f64>,
    /// Distance to the position with loads and effects evaluated on the actual geometry.
    cost: Vec<f64>,
    /// The same with loads evaluated on the result of a first pass.
    cost_of_two_passes: Vec<f64>,
}

/// Poses and directions spread evenly by irrational steps, from −1 to 1.
fn spread(n: u32, k: usize) -> f64 {
    let roots = [2.0, 3.0, 5.0, 6.0, 7.0, 10.0, 11.0, 13.0, 14.0];
    (f64::from(n) * f64::sqrt(roots[k])).fract() * 2.0 - 1.0
}

fn campaign(force_n: f64) -> Campaign {
    let scene = scene();
    let arm = &scene.arm;
    let effects = effects(arm);
    let mut campaign = Campaign::default();
    for n in 0..1000 {
        let mut inputs = scene.inputs;
        for (i, range) in [3.0, 1.0, 0.9, 2.0, 1.5, 3.0].into_iter().enumerate() {
            inputs.q[i] = range * spread(n, i);
        }
        let force = DVec3::new(spread(n, 6), spread(n, 7), spread(n, 8)).normalize() * force_n;
        inputs.wrench_base = Wrench { force, moment: DVec3::ZERO };
        let nominal = Chain::nominal(arm, &inputs.q);
        let once = bent(arm, &effects, &inputs, &nominal);
        let twice = bent(arm, &effects, &inputs, &once);
        let settled = (0..30).fold(twice, |chain, _| bent(arm, &effects, &inputs, &chain));
        let um = |a: &Chain, b: &Chain| {
            (a.base_from_tool.origin - b.base_from_tool.origin).length() * 1e6
        };
        campaign.deviation.push(um(&once, &nominal));
        campaign.cost.push(um(&settled, &once));
        campaign.cost_of_two_passes.push(um(&settled, &twice));
    }
    for all in [&mut campaign.deviation, &mut campaign.cost, &mut campaign.cost_of_two_passes] {
        all.sort_by(f64::total_cmp);
    }
    campaign
}

fn line(all: &[f64]) -> String {
    let quantile = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
    [0.5, 0.95, 1.0].map(|share| format!("{:8.2}", quantile(share))).join(" ")
}

#[test]
fn loads_on_the_nominal_geometry_cost_a_small_share_of_the_deviation() {
    println!("median, 95 %, largest, µm");
    for force_n in [0.0, 100.0, 300.0, 1000.0] {
        let Campaign { deviation, cost, cost_of_two_passes } = campaign(force_n);
        println!("{force_n:5.0} N  deviation {}", line(&deviation));
        println!("         cost      {}", line(&cost));
        println!("         two passes{}", line(&cost_of_two_passes));
        let share = cost[500] / deviation[500];
        let bound = if force_n > 300.0 { 0.04 } else { 0.01 };
        assert!(share < bound, "at {force_n} N the median cost is {share} of the deviation");
    }
}
