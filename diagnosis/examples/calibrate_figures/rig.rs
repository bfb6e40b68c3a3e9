//! Simulated campaigns: random poses, each joint approached from a random side, three reflectors; frame and reflectors are to be fitted.

use diagnosis::{
    Arrival, Campaign, Extrinsics, FitParameter, Instrument, MeasuringFrame, Observation, Pose,
    Reading, ReadingNoise, RecordingInfo, ToolPoint,
};
use glam::{DMat3, DVec3};
use physics::{Frame, Inputs, JOINTS_MAX, Model};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use recording::model::presets::preset;
use std::error::Error;
use std::thread;

/// Reflectors on the tool, tool frame, m.
const TARGETS: [[f64; 3]; 3] = [[0.1, 0.0, 0.05], [-0.05, 0.09, 0.06], [-0.05, -0.08, 0.1]];

/// A preset model.
pub(crate) fn model(name: &str) -> Result<Model, Box<dyn Error>> {
    Ok(preset(name).ok_or("no such preset")?.model()?.physics)
}

/// A uniformly distributed number between `low` and `high`.
pub(crate) fn between(chance: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * chance.random::<f64>()
}

/// Random joint positions within `ranges_deg`, each joint approached from below or from above.
pub(crate) fn inputs(chance: &mut ChaCha8Rng, ranges_deg: &[[f64; 2]; 6]) -> Inputs {
    let mut q = [0.0; JOINTS_MAX];
    let mut direction = [0.0; JOINTS_MAX];
    for (joint, [low, high]) in ranges_deg.iter().enumerate() {
        q[joint] = between(chance, *low, *high).to_radians();
        direction[joint] = if chance.random::<bool>() { 1.0 } else { -1.0 };
    }
    Inputs { direction, ..Inputs::at_rest(q) }
}

/// A campaign at these inputs, without measured values. `noise` depends on the position of the reflector in the measuring frame, m.
pub(crate) fn campaign(
    arm: &physics::Arm,
    inputs: &[Inputs],
    noise: ReadingNoise,
) -> Option<Campaign> {
    let rotation = DMat3::from_rotation_z(2.1) * DMat3::from_rotation_x(0.02);
    let frame = Frame::new(rotation, DVec3::new(2.5, -0.6, -0.4));
    let station = MeasuringFrame { measuring_from_base: frame, pivot: DVec3::ZERO };
    let targets = TARGETS.map(DVec3::from_array);
    let surroundings = Extrinsics {
        frames: vec![FitParameter::unknown(station)],
        targets: targets.map(FitParameter::unknown).to_vec(),
        ..Extrinsics::default()
    };
    let pose = |(row, inputs): (usize, &Inputs)| {
        let tool = physics::Chain::nominal(arm, &inputs.q).base_from_tool;
        let observation = |(index, target): (usize, &DVec3)| {
            let (place, position) = (ToolPoint::Target(index), frame.point(tool.point(*target)));
            let reading = Reading::Point { place, frame: 0, at: position };
            Some(Observation { reading, whitening: noise.whitening(position)?, instrument: 0 })
        };
        let observations: Option<Vec<Observation>> =
            targets.iter().enumerate().map(observation).collect();
        let arrival = Arrival::Settled;
        Some(Pose { inputs: *inputs, arrival, recording: 0, row, seen: observations? })
    };
    let poses: Option<Vec<Pose>> = inputs.iter().enumerate().map(pose).collect();
    Some(Campaign {
        poses: poses?,
        surroundings,
        instruments: vec![Instrument {
            name: "tracker".to_owned(),
            noise_is_known: true,
            ..Instrument::default()
        }],
        recordings: vec![RecordingInfo::of_poses("made")],
    })
}

/// Results of `work` for every seed, in the order of the seeds; runs on all cores.
pub(crate) fn for_seeds<T: Send>(seeds: u64, work: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let cores = thread::available_parallelism().map_or(1, |n| n.get() as u64);
    let work = &work;
    let mut all: Vec<(u64, T)> = thread::scope(|scope| {
        let part = |core: u64| move || (core..seeds).step_by(cores as usize).map(|s| (s, work(s)));
        let threads: Vec<_> =
            (0..cores).map(|core| scope.spawn(move || part(core)().collect::<Vec<_>>())).collect();
        threads.into_iter().flat_map(|t| t.join().unwrap_or_default()).collect()
    });
    all.sort_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, found)| found).collect()
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}
