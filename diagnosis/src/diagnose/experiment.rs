//! Experiment design for indistinguishable hypotheses: the motion or load of a [`catalogue`] that discriminates them best.
//!
//! Every experiment of the catalogue is simulated with each of two hypotheses, at their estimated parameters; the other is then fitted to the simulated
//! data, with the measuring frame, the targets and all other free parameters. The residual is the expected separation, half the sum of squares; the
//! smaller of both directions counts (T-optimality, Atkinson and Fedorov 1975). Information of the present recording is not included.
//!
//! The result is an instruction for a technician, with the expected separation in log-likelihood.

mod catalogue;

pub use catalogue::{Experiment, ExperimentRow, MeasuredChannels, catalogue};

use super::preparation::set_velocities;
use super::selection::{
    AlternativeEffect, INDISTINGUISHABLE_LOSS, SelectedEffect, hypothesis_without,
};
use super::verdict::is_ambiguous;
use crate::campaign::{Campaign, Reading, ToolPoint};
use crate::campaign_import;
use crate::campaign_simulation;
use crate::fit::{FitEffort, FitSettings, fit, refit_with_fixed_weights};
use crate::fit_result::Fit;
use crate::hypothesis::Hypothesis;
use crate::progress::StageProgress;
use crate::robust_weights::Influence;
use physics::{AnyEffect, Model};
use recording::series::Channel;

/// Largest number of poses of an experiment whose measurements are simulated.
const READINGS_MAX: usize = 250;
/// Number of alternatives that are considered, those with the smallest loss in log-likelihood first.
const ALTERNATIVES_MAX: usize = 3;

/// An experiment that would distinguish alternatives.
#[derive(Clone, Debug)]
pub struct ProposedExperiment {
    /// The experiment.
    pub experiment: Experiment,
    /// Measured quantities: the same as in the recordings.
    pub measured: MeasuredChannels,
    /// Expected log-likelihood ratio of the hypotheses.
    pub separation: f64,
    /// Instruction for the technician.
    pub says: String,
}

/// A recording and its fit, for which experiments are designed.
pub(super) struct Design<'a> {
    campaign: &'a Campaign,
    given: &'a Model,
    last: &'a Fit,
    training: &'a [bool],
}

/// Experiments with the joints in question; all of them if an effect concerns the whole robot.
fn relevant_experiments(
    effect: &AnyEffect,
    alternatives: &[&AlternativeEffect],
) -> impl Fn(&Experiment) -> bool {
    let effects = std::iter::once(effect).chain(alternatives.iter().map(|rival| &rival.effect));
    let joints: Vec<Option<usize>> = effects.map(AnyEffect::joint).collect();
    move |experiment| {
        let alone = experiment.name.strip_prefix("joint ");
        let Some(rest) = alone else { return true };
        let is_about = |joint: usize| rest.split(' ').next() == Some(&(joint + 1).to_string());
        joints.iter().any(|joint| joint.is_none_or(is_about))
    }
}

fn instruction_text(
    examined: &AnyEffect,
    alternatives: &[&AlternativeEffect],
    chosen: &Experiment,
    separation: f64,
) -> String {
    let name = |effect: &AnyEffect| {
        let whose = effect.joint().map_or(String::new(), |j| format!(" of joint {}", j + 1));
        format!("{}{whose}", effect.spec().kind.replace('_', " "))
    };
    let rivals: Vec<String> = alternatives.iter().map(|rival| name(&rival.effect)).collect();
    let again = (INDISTINGUISHABLE_LOSS / separation.max(1e-3)).ceil();
    let enough = match again {
        1.0 => String::new(),
        2.0..=20.0 => format!("; repeat it {again:.0} times"),
        _ => ", which is not enough; measure with less noise".to_owned(),
    };
    format!(
        "To distinguish {} from {}: {}. It takes about {:.0} min, with an expected log-likelihood ratio of {}{enough}.",
        name(examined),
        rivals.join(", "),
        chosen.says,
        (chosen.takes_s() / 60.0).ceil(),
        format_args!("{separation:.*}", usize::from(separation < 10.0)),
    )
}

/// The measured columns of a recording.
fn measured_channels(campaign: &Campaign) -> MeasuredChannels {
    let mut channels: Vec<Channel> = Vec::new();
    for reading in
        campaign.poses.iter().flat_map(|p| p.seen.iter().map(|observation| &observation.reading))
    {
        let own_channels: Vec<Channel> = match reading {
            Reading::Point { place: ToolPoint::Tcp, .. } => (0..3).map(Channel::Position).collect(),
            Reading::Point { place: ToolPoint::Target(t), .. } => {
                (0..3).map(|axis| Channel::Target(*t, axis)).collect()
            }
            Reading::Orientation { .. } => (0..4).map(Channel::Orientation).collect(),
            Reading::JointPosition { joint, .. } => vec![Channel::Link(*joint)],
            _ => Vec::new(),
        };
        if own_channels.first().is_some_and(|first| !channels.contains(first)) {
            channels.extend(own_channels);
        }
    }
    channels.sort_unstable();
    MeasuredChannels { channels }
}

impl<'a> Design<'a> {
    pub(super) fn of(
        campaign: &'a Campaign,
        given: &'a Model,
        last: &'a Fit,
        training: &'a [bool],
    ) -> Self {
        Self { campaign, given, last, training }
    }

    /// The experiment that best distinguishes the ambiguous effect with the largest gain from its nearest alternatives; `None` if no effect is
    /// ambiguous.
    pub(super) fn propose(
        &self,
        named: &[SelectedEffect],
        progress: StageProgress<'_>,
    ) -> Option<ProposedExperiment> {
        let open = named.iter().filter(|one| is_ambiguous(one, self.last));
        let one = open.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let effect = self.last.hypothesis.model.effects().nth(one.effect)?;
        let alternatives = one
            .alternatives
            .iter()
            .filter(|rival| rival.is_indistinguishable)
            .take(ALTERNATIVES_MAX);
        let alternatives: Vec<&AlternativeEffect> = alternatives.collect();
        let others: Vec<Fit> =
            alternatives.iter().filter_map(|rival| self.fit_with_alternative(one, rival)).collect();
        let measured = measured_channels(self.campaign);
        let wanted = relevant_experiments(effect, &alternatives);
        let tried: Vec<Experiment> =
            catalogue(&self.given.arm).into_iter().filter(wanted).collect();
        let steps = progress.steps(tried.len());
        let parted = tried.into_iter().filter_map(|experiment| {
            let parts = others.iter().map(|other| self.separation(&experiment, &measured, other));
            let parts: Option<Vec<f64>> = parts.collect();
            steps.step();
            let separation = parts?.into_iter().fold(f64::INFINITY, f64::min);
            separation.is_finite().then_some((experiment, separation))
        });
        // Among equals the first, which is the simplest.
        let best = parted.reduce(|a, b| if b.1 > a.1 { b } else { a });
        let (experiment, separation) = best?;
        let instruction = instruction_text(effect, &alternatives, &experiment, separation);
        Some(ProposedExperiment { experiment, measured, separation, says: instruction })
    }

    /// The fit of the recording with `rival` in place of `one`.
    fn fit_with_alternative(&self, one: &SelectedEffect, rival: &AlternativeEffect) -> Option<Fit> {
        let mut hypothesis = hypothesis_without(self.last, self.given, &[one]);
        match rival.candidate.changes() {
            Some(place) => drop(hypothesis.widen_priors(place)),
            None => hypothesis.add(rival.effect, rival.fixed).ok()?,
        }
        Some(refit_with_fixed_weights(self.campaign, &hypothesis, self.last, self.training))
    }

    /// The poses and measured quantities of an experiment, without values.
    fn simulated_campaign(
        &self,
        experiment: &Experiment,
        measured: &MeasuredChannels,
    ) -> Option<Campaign> {
        let recording = experiment.recording(measured, 1.0);
        let arm = &self.given.arm;
        let mut made = campaign_import::campaign(arm, &[recording]).ok()?;
        set_velocities(&mut made, arm.count());
        made.instruments.iter_mut().for_each(|instrument| instrument.noise_is_known = true);
        let around = &self.last.surroundings;
        for (simulated, known) in made.surroundings.targets.iter_mut().zip(&around.targets) {
            *simulated = *known;
        }
        if let (Some(simulated), Some(known)) =
            (made.surroundings.frames.first_mut(), around.frames.first())
        {
            *simulated = *known;
        }
        let count = made.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
        let stride = count.div_ceil(READINGS_MAX).max(1);
        for (k, pose) in made.poses.iter_mut().enumerate() {
            if k % stride > 0 {
                pose.seen.clear();
            }
            for observation in &mut pose.seen {
                observation.whitening = self.whitening(&observation.reading)?;
            }
        }
        Some(made)
    }

    /// Whitening by the noise that the same quantity has in the recording.
    fn whitening(&self, reading: &Reading) -> Option<glam::DMat3> {
        let is_same_kind = |other: &Reading| match (reading, other) {
            (Reading::Point { place: a, .. }, Reading::Point { place: b, .. }) => a == b,
            (Reading::JointPosition { joint: a, .. }, Reading::JointPosition { joint: b, .. }) => {
                a == b
            }
            (Reading::Orientation { .. }, Reading::Orientation { .. }) => true,
            _ => false,
        };
        let mut all = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let found = all.find(|observation| is_same_kind(&observation.reading))?;
        Some(found.whitening * (1.0 / self.last.factors[found.instrument]))
    }

    /// Expected log-likelihood ratio of the two hypotheses, for the worse case of which of them is right.
    fn separation(
        &self,
        experiment: &Experiment,
        measured: &MeasuredChannels,
        other: &Fit,
    ) -> Option<f64> {
        let made = self.simulated_campaign(experiment, measured)?;
        let [hypothesis, other] = [&self.last.hypothesis, &other.hypothesis];
        let one = self.expected_loss(&made, hypothesis, other);
        let two = self.expected_loss(&made, other, hypothesis);
        Some(one.min(two) / self.last.design_effect.max(1.0))
    }

    /// Loss in log-likelihood of `wrong`, fitted to noise-free measurements simulated with `right`.
    fn expected_loss(&self, made: &Campaign, right: &Hypothesis, wrong: &Hypothesis) -> f64 {
        let readings =
            campaign_simulation::simulate_readings(made, &right.model, &made.surroundings, 0.0, 0);
        let used = vec![true; readings.poses.len()];
        let settings = FitSettings {
            used: &used,
            influence: Influence::Equal,
            from: Some(&made.surroundings),
            effort: FitEffort::Sketch,
        };
        let reference = fit(&readings, right, &settings);
        let against = refit_with_fixed_weights(&readings, wrong, &reference, &used);
        let with = refit_with_fixed_weights(&readings, right, &reference, &used);
        0.5 * (against.sum_of_squares - with.sum_of_squares).max(0.0)
    }
}

#[cfg(test)]
mod tests;
