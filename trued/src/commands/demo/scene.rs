//! What the demo plays: the calibrated model, the true robot, the path, the cut that rings. All by seed.

use recording::model::RobotModel;
use recording::model::presets::preset;
use world::draw::{Calibration, TrueRobot, draw};
use world::extras::ExtraSize;
use world::joint_path::{JointPath, Sample};
use world::path::tool_along;
use world::ringing::Chatter;
use world::slots::Slots;
use world::workplace::workplace;

/// The daemon's model.
const PRESET: &str = "irb1600-6-145-thesis";
/// How long the robot stands before it sets off, so that the correction comes in and the watch learns its floor, s.
const DWELL_S: f64 = 1.5;
/// Time between commands, s.
pub(super) const TICK_S: f64 = 1e-3;
/// Every so many samples a pose, to weigh what the model lacks.
const POSES_EVERY: usize = 100;
/// Stiffness of the cut against a slow change of depth, N/µm: about 3 N over 0.25 mm (thesis 4.7 at 10 mm/s).
const PROCESS_STIFFNESS_N_PER_UM: f64 = 0.02;

/// What is played.
pub(super) struct Scene {
    /// The seed of all chance.
    pub(super) seed: u64,
    /// The short form.
    pub(super) quick: bool,
    /// The daemon's model.
    pub(super) model: RobotModel,
    /// The robot as it really is.
    pub(super) truth: TrueRobot,
    /// The commands, standing still at first.
    pub(super) path: JointPath,
    /// Samples before the robot sets off.
    pub(super) dwell: usize,
    /// Cutting forces that ring.
    pub(super) chatter: Chatter,
}

type Fault = Box<dyn std::error::Error + Send + Sync>;

impl Scene {
    pub(super) fn new(seed: u64, quick: bool) -> Result<Self, Fault> {
        let known = preset(PRESET).ok_or("the demo's preset is missing from this build")?;
        let model = known.model()?;
        let arm = &model.physics.arm;
        let rotation = tool_along(-glam::DVec3::Z, arm.tool.base_from_tool);
        let place = workplace(arm, rotation)?;
        let slots =
            if quick { Slots::quick(place.point_base) } else { Slots::thesis(place.point_base) };
        let path = JointPath::plan(arm, &slots.tool_path(rotation)?, TICK_S, Some(&place.q))?;
        let calibration = Calibration { model: &model.physics, sigmas: &model.sigma };
        let truth = draw(&calibration, &ExtraSize::default(), &path.poses(POSES_EVERY), seed)?;
        let cuts = 1 + path.samples.iter().filter_map(|s| s.wanted.cut).max().unwrap_or(0);
        // The last slot is the fastest, its middle leg the one that rings.
        let chatter = Chatter::at_72_hz(cuts.saturating_sub(2));
        let (path, dwell) = standing_first(path);
        Ok(Self { seed, quick, model, truth, path, dwell, chatter })
    }

    /// How long it takes, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.path.duration_s()
    }

    /// What is milled, in words.
    pub(super) fn what(&self) -> &'static str {
        if self.quick {
            "one U-shaped slot at 10 mm/s"
        } else {
            "four U-shaped slots at 1, 2, 5 and 10 mm/s"
        }
    }

    /// The model's text as the daemon reads it.
    pub(super) fn model_text(&self) -> &'static str {
        preset(PRESET).map_or("", |known| known.text)
    }

    /// The cell's configuration.
    pub(super) fn cell_toml(&self, name: &str) -> String {
        format!(
            r#"# The demo's cell; docs/cell.md says what each key means.
schema = "trued.cell/1"
cell = "{name}"
model = "model.toml"
mode = "full"

[cycle]
period_ms = 1.0
stale_ms = 50.0

[wrench]
source = "force"
process_stiffness_N_per_um = {PROCESS_STIFFNESS_N_PER_UM}

[force]
rate_Hz = 10000.0
channels = 3

[vibration]
enabled = true
spindle_rpm = 28000.0
teeth = 2

[recorder]
dir = "blackbox"
keep_files = 3
"#
        )
    }
}

/// The path with its first sample repeated in front.
fn standing_first(path: JointPath) -> (JointPath, usize) {
    let dwell = (DWELL_S / path.dt_s).round() as usize;
    let Some(first) = path.samples.first().copied() else { return (path, 0) };
    let standing = std::iter::repeat_n(first, dwell);
    let samples = standing.chain(path.samples.iter().copied()).enumerate();
    let samples: Vec<Sample> =
        samples.map(|(k, sample)| Sample { t_s: k as f64 * path.dt_s, ..sample }).collect();
    (JointPath { samples, ..path }, dwell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_has_a_scene() {
        for seed in 0..30 {
            let scene = Scene::new(seed, true).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            assert_eq!(scene.truth.extras.len(), 2);
        }
        for seed in 30..40 {
            assert!(Scene::new(seed, false).is_ok(), "seed {seed}, long form");
        }
    }
}
