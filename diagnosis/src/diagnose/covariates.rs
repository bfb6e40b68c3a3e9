//! Covariates of a pose, scaled to −1 to 1, by their names in docs/reference/results.md: `q1`, `v1`, `direction_1`, `tau1`, `temp_C`, `t_s` …
//!
//! They are computed from the inputs and the nominal model, not from measurements of the tool. Constant covariates are omitted.

use crate::campaign::Campaign;
use crate::least_squares::visit_poses;
use physics::{Inputs, Model};

/// One covariate over all poses.
#[derive(Clone, Debug)]
pub(super) struct Covariate {
    /// Name as in docs/reference/results.md.
    pub(super) name: String,
    /// Its joint, from 0; `None` for the whole robot.
    pub(super) joint: Option<usize>,
    /// Scaled value at each pose, −1 to 1.
    pub(super) values: Vec<f64>,
    /// The value before scaling, SI, is `middle + half · value`.
    pub(super) centre: f64,
    pub(super) half_range: f64,
}

impl Covariate {
    fn of(name: String, joint: Option<usize>, raw: &[f64]) -> Option<Self> {
        let sound = raw.iter().copied().filter(|x| x.is_finite());
        let (low, high) = sound
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (f64::min(l, x), f64::max(h, x)));
        let (centre, half_range) = (0.5 * (high + low), 0.5 * (high - low));
        if half_range <= 1e-9 * centre.abs().max(1e-6) {
            return None;
        }
        let scaled = |x: &f64| if x.is_finite() { (x - centre) / half_range } else { 0.0 };
        let values = raw.iter().map(scaled).collect();
        Some(Self { name, joint, values, centre, half_range })
    }

    /// Chebyshev polynomials `T_1` to `T_count` at a pose.
    pub(super) fn chebyshev(&self, pose: usize, count: usize) -> impl Iterator<Item = f64> {
        let x = self.values[pose].clamp(-1.0, 1.0);
        // T_{k+1} = 2 x T_k − T_{k−1}
        let next = move |(before, now): &(f64, f64)| Some((*now, 2.0 * x * now - before));
        std::iter::successors(Some((1.0, x)), next).map(|(_, now)| now).take(count)
    }
}

/// All covariates that vary over the campaign.
pub(super) fn all_covariates(campaign: &Campaign, model: &Model) -> Vec<Covariate> {
    let joints = model.arm.count();
    let poses = &campaign.poses;
    let mut loads = vec![vec![0.0; poses.len()]; joints];
    visit_poses(&physics::Model::nominal(model.arm), campaign, None, |pose, evaluation, _| {
        (0..joints).for_each(|joint| loads[joint][pose] = evaluation.loads.torque(joint));
    });
    let mut covariates = Vec::new();
    let mut add = |name: String, joint: Option<usize>, value: &dyn Fn(usize, &Inputs) -> f64| {
        let raw: Vec<f64> =
            poses.iter().enumerate().map(|(k, pose)| value(k, &pose.inputs)).collect();
        covariates.extend(Covariate::of(name, joint, &raw));
    };
    let speeds: Vec<Vec<f64>> = (0..joints).map(|joint| speeds(campaign, joint)).collect();
    for joint in 0..joints {
        let (of_joint, n) = (Some(joint), joint + 1);
        add(format!("q{n}"), of_joint, &|_, inputs| inputs.q[joint]);
        add(format!("v{n}"), of_joint, &|k, _| speeds[joint][k]);
        add(format!("a{n}"), of_joint, &|k, _| {
            let before = k.checked_sub(1).filter(|_| poses[k].inputs.dt_s > 0.0);
            before.map_or(0.0, |b| (speeds[joint][k] - speeds[joint][b]) / poses[k].inputs.dt_s)
        });
        add(format!("direction_{n}"), of_joint, &|_, inputs| inputs.direction[joint]);
        add(format!("tau{n}"), of_joint, &|k, _| loads[joint][k]);
        add(format!("temp{n}_C"), of_joint, &|_, inputs| inputs.joint_celsius[joint]);
    }
    for axis in 0..3 {
        add("wrench".to_owned(), None, &|_, inputs| inputs.wrench_base.force[axis]);
        add("wrench".to_owned(), None, &|_, inputs| inputs.wrench_base.moment[axis]);
    }
    add("temp_C".to_owned(), None, &|_, inputs| inputs.ambient_celsius);
    add("spindle_rpm".to_owned(), None, &|_, inputs| inputs.spindle_rpm);
    add("t_s".to_owned(), None, &|_, inputs| inputs.time_s);
    covariates
}

/// Speeds of a joint on paths, rad/s or m/s; zero at settled poses.
fn speeds(campaign: &Campaign, joint: usize) -> Vec<f64> {
    let speed = |pose: &crate::Pose| {
        let inputs = &pose.inputs;
        let moving = pose.arrival == crate::Arrival::FromPrevious && inputs.dt_s > 0.0;
        if moving { (inputs.q[joint] - inputs.q_before[joint]) / inputs.dt_s } else { 0.0 }
    };
    campaign.poses.iter().map(speed).collect()
}
