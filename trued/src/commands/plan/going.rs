//! Starting point of a plan: the model alone, or existing measurements.
//!
//! With recordings, targets and frame are taken from a fit, and the noise from its residuals. Gross
//! errors are always reported.

use diagnosis::from_recording::{self, Unusable};
use diagnosis::plan::{Task, believed};
use diagnosis::{Campaign, Effort, Fit, Influence, Settings, fit, gross};

use super::Input;
use super::files::Files;
use super::setup::Setup;
use crate::exit::Failure;

/// Default standard uncertainty of a length, m.
pub(super) const NOISE_M: f64 = 5e-5;

/// The task, and what is known so far.
pub(super) struct Going {
    pub(super) task: Task,
    pub(super) known: Option<(Campaign, Fit)>,
}

impl Going {
    pub(super) fn of(setup: &Setup, files: &Files, input: &Input) -> Result<Self, Failure> {
        setup.check()?;
        let model = &input.model;
        let arm = &model.physics.arm;
        let mut task = Task {
            hypothesis: believed(&model.physics, &model.sigma),
            surroundings: setup.surroundings()?,
            sees: setup.sees(),
            noise: setup.noise(NOISE_M),
            sight: setup.sight(),
            reach: setup.reach(arm),
            both_ways: files.both_ways(),
            among: Vec::new(),
            asked: Vec::new(),
        };
        let Some(campaign) = measured(input)? else { return Ok(Self { task, known: None }) };
        if let Some(fault) = gross::suspicions(&campaign, &model.physics).first() {
            return Err(Failure::input(format!(
                "what was measured does not fit the model: {}",
                fault.says
            )));
        }
        let used = vec![true; campaign.poses.len()];
        let settings =
            Settings { used: &used, influence: Influence::Huber, from: None, effort: Effort::Full };
        let found = fit(&campaign, &task.hypothesis, &settings);
        task.hypothesis.model = found.hypothesis.model.clone();
        task.surroundings = found.surroundings.clone();
        task.noise = setup.noise(shown_m(&campaign, &found).unwrap_or(NOISE_M));
        Ok(Self { task, known: Some((campaign, found)) })
    }
}

/// What was measured; none where the recordings have no value yet.
fn measured(input: &Input) -> Result<Option<Campaign>, Failure> {
    if input.recordings.is_empty() {
        return Ok(None);
    }
    match from_recording::campaign(&input.model.physics.arm, &input.recordings) {
        Ok(campaign) => Ok(Some(campaign)),
        Err(Unusable::NothingMeasured { .. }) => Ok(None),
        Err(error) => Err(Failure::input(error)),
    }
}

/// The standard uncertainty of a length from the fit's residuals, m.
fn shown_m(campaign: &Campaign, found: &Fit) -> Option<f64> {
    let mut seen = campaign.poses.iter().flat_map(|pose| &pose.seen);
    let length = seen.find(|seen| seen.reading.is_length())?;
    Some(found.factors.get(length.instrument)? / length.whitening.x_axis.length())
}
