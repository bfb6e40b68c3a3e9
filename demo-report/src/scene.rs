//! Scene of the demo: calibrated model, true robot and its hidden effect, path, the cut with vibration, measuring program. All by seed.
//!
//! The hidden effect is not reported here; see [`crate::diagnosis`].

use physics::Inputs;
use recording::model::RobotModel;
use recording::model::presets::preset;
use world::cell::work;
use world::cutter::Cutter;
use world::draw::{Calibration, TrueRobot, ambient_celsius, draw};
use world::hidden::{self, HiddenEffect, HiddenEffectContext};
use world::joint_path::{JointPath, Sample};
use world::path::tool_along;
use world::slots::Slots;
use world::structural_mode::Chatter;
use world::survey::survey;
use world::workplace::workplace;

use crate::error::Error;

/// The daemon's model.
const PRESET: &str = "irb1600-6-145-thesis";
/// Standstill before the robot starts moving, in which the correction ramps in and the monitor
/// learns its noise floor, s.
const DWELL_S: f64 = 1.5;
/// Time between commands, s.
pub(crate) const TICK_S: f64 = 1e-3;
/// Interval, in ticks, at which the hidden effect's influence is evaluated.
const EVALUATED_EVERY: usize = 100;
/// Standard uncertainty of a coordinate that the tracker measures, m.
pub(crate) const TRACKER_M: f64 = 2e-5;
/// Stiffness of the cut against a slow change of depth, N/µm: about 3 N over 0.25 mm (thesis 4.7 at 10 mm/s).
const PROCESS_STIFFNESS_N_PER_UM: f64 = 0.02;

/// The scene of the demonstration.
#[derive(Debug)]
pub struct Scene {
    /// The seed of all chance.
    pub(crate) seed: u64,
    /// The short form.
    pub(crate) quick: bool,
    /// The daemon's model.
    pub(crate) model: RobotModel,
    /// Its text as the daemon reads it.
    pub(crate) model_text: String,
    /// The robot as it really is.
    pub(crate) truth: TrueRobot,
    /// The effect that the daemon's model lacks.
    pub(crate) hidden: HiddenEffect,
    /// The measuring program.
    pub(crate) survey: Vec<Inputs>,
    /// The commands, beginning with the standstill.
    pub(crate) path: JointPath,
    /// The same without standstill.
    pub(crate) work: JointPath,
    /// Samples before the robot sets off.
    pub(crate) dwell: usize,
    /// Cutting forces that ring.
    pub(crate) chatter: Chatter,
}

type Fault = Box<dyn std::error::Error + Send + Sync>;

impl Scene {
    /// The scene of a seed; `quick`: one slot instead of four.
    ///
    /// # Errors
    /// The robot cannot mill it: a fault of this program.
    pub fn new(seed: u64, quick: bool) -> Result<Self, Error> {
        Self::draw(seed, quick).map_err(Error::Input)
    }

    /// The seed of all chance.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    fn draw(seed: u64, quick: bool) -> Result<Self, Fault> {
        let known = preset(PRESET).ok_or("the demo's preset is missing from this build")?;
        let model = known.model()?;
        let arm = &model.physics.arm;
        let rotation = tool_along(-glam::DVec3::Z, arm.tool.base_from_tool);
        let place = workplace(arm, rotation)?;
        let slots =
            if quick { Slots::quick(place.point_base) } else { Slots::thesis(place.point_base) };
        let path = JointPath::plan(arm, &slots.tool_path(rotation)?, TICK_S, Some(&place.q))?;
        let survey = survey(arm);
        let milling = work(&path, &Cutter::default(), EVALUATED_EVERY, ambient_celsius(seed));
        let stage = HiddenEffectContext {
            model: &model.physics,
            work: &milling,
            survey: &survey,
            noise_m: TRACKER_M,
        };
        let hidden = hidden::draw(&stage, seed)?;
        let model_text = model_without_hidden(&model, &hidden);
        let model = RobotModel::parse("the demo's model", &model_text)?;
        let calibration = Calibration { model: &model.physics, sigmas: &model.sigma };
        let mut truth = draw(&calibration, seed)?;
        truth.model.push(hidden.effect)?;
        let cuts = 1 + path.samples.iter().filter_map(|s| s.wanted.cut).max().unwrap_or(0);
        // The last slot is the fastest; the robot vibrates in its middle part.
        let chatter = Chatter::at_72_hz(cuts.saturating_sub(2));
        let work = path.clone();
        let (path, dwell) = with_initial_standstill(path);
        Ok(Self {
            seed,
            quick,
            model,
            model_text,
            truth,
            hidden,
            survey,
            path,
            work,
            dwell,
            chatter,
        })
    }

    /// Description of the milling, as text.
    pub(crate) fn description(&self) -> &'static str {
        if self.quick {
            "one U-shaped slot at 10 mm/s"
        } else {
            "four U-shaped slots at 1, 2, 5 and 10 mm/s"
        }
    }

    /// The path's first command, held for a second.
    pub(crate) fn standstill_path(&self) -> JointPath {
        let dt_s = self.work.dt_s;
        let ticks = (1.0 / dt_s).round() as usize;
        let first = self.work.samples.iter().take(1).cycle().take(ticks).enumerate();
        let samples = first.map(|(k, sample)| Sample { t_s: k as f64 * dt_s, ..*sample });
        JointPath { dt_s, samples: samples.collect() }
    }

    /// The cell's configuration.
    pub(crate) fn cell_toml(&self, name: &str) -> String {
        format!(
            r#"# The demo's cell; docs/reference/cell.md says what each key means.
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

/// The calibrated model without the hidden effect, as a file.
fn model_without_hidden(model: &RobotModel, hidden: &HiddenEffect) -> String {
    let mut file = model.file.clone();
    let lacks: Vec<usize> = model
        .entry_of
        .iter()
        .zip(&hidden.kept)
        .filter(|(_, kept)| !**kept)
        .map(|(index, _)| *index)
        .collect();
    let mut count = 0;
    file.effects.retain(|_| {
        count += 1;
        !lacks.contains(&(count - 1))
    });
    file.to_toml()
}

/// The path with its first sample repeated in front.
fn with_initial_standstill(path: JointPath) -> (JointPath, usize) {
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
        for seed in 0..8 {
            let scene = Scene::new(seed, true).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            let lacking = scene.model.physics.effects().len() + 1;
            assert_eq!(scene.truth.model.effects().len(), lacking);
        }
        for seed in 8..12 {
            assert!(Scene::new(seed, false).is_ok(), "seed {seed}, long form");
        }
    }
}
