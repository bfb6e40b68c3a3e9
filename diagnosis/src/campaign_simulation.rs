//! Simulation of a campaign for a known robot: same poses and instruments, simulated measurements.
//!
//! Noise is normal with the stated covariance of each measurement; the same seed gives the same bits.

use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::extrinsics::Extrinsics;
use crate::least_squares::visit_poses;
use glam::DVec3;
use physics::frame::rotation_from_vector;
use physics::{Evaluation, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

/// `campaign` with the values that would be measured of `model` with the extrinsic parameters `truth`; the noise is `scale` times the stated one.
#[must_use]
pub fn simulate_readings(
    campaign: &Campaign,
    model: &Model,
    truth: &Extrinsics,
    scale: f64,
    seed: u64,
) -> Campaign {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut made = campaign.clone();
    visit_poses(model, campaign, None, |pose, evaluation, _| {
        let commanded = campaign.poses[pose].inputs.q;
        for observation in &mut made.poses[pose].seen {
            let mut draw = || rng.sample::<f64, _>(StandardNormal);
            let normal = DVec3::new(draw(), draw(), draw()) * scale;
            let noise = match observation.reading.count() {
                1 => DVec3::X * (normal.x / observation.whitening.x_axis.x),
                _ => observation.whitening.inverse() * normal,
            };
            read(&mut observation.reading, evaluation, &commanded, truth, noise);
        }
    });
    made
}

fn read(
    reading: &mut Reading,
    evaluation: &Evaluation,
    commanded: &physics::Joints,
    truth: &Extrinsics,
    noise: DVec3,
) {
    let tool = &evaluation.real.base_from_tool;
    let point = |place: ToolPoint| match place {
        ToolPoint::Tcp => tool.origin,
        ToolPoint::Target(i) => tool.point(truth.targets[i].value),
    };
    match reading {
        Reading::Point { place, frame, at } => {
            *at = truth.frames[*frame].value.measuring_from_base.point(point(*place)) + noise;
        }
        Reading::Orientation { frame, measuring_from_tool } => {
            let station = truth.frames[*frame].value.measuring_from_base.rotation;
            *measuring_from_tool = rotation_from_vector(noise) * station * tool.rotation;
        }
        Reading::Distance { place, anchor, length_m } => {
            let fixed = &truth.anchors[*anchor];
            let distance = (point(*place) - fixed.place.value).length();
            *length_m = distance + fixed.offset_m.value + noise.x;
        }
        Reading::Plane { place, plane, radius_m } => {
            let plane = &truth.planes[*plane].value;
            *radius_m = plane.normal.dot(point(*place)) - plane.offset_m + noise.x;
        }
        Reading::Sphere { place, sphere, radius_m } => {
            let sphere = &truth.spheres[*sphere];
            let away = (point(*place) - sphere.centre.value).length();
            *radius_m = away - sphere.radius_m.value + noise.x;
        }
        Reading::JointPosition { joint, position } => {
            *position = commanded[*joint] + evaluation.deviation.joints[*joint] + noise.x;
        }
    }
}
