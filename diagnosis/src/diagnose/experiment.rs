//! Experiment design for indistinguishable hypotheses: the motion or load of a [`menu`] that discriminates them best.
//!
//! Every experiment of the menu is simulated with each of two hypotheses, at their estimated parameters; the other is then fitted to the simulated
//! data, with the measuring frame, the targets and all other free parameters. The residual is the expected separation, half the sum of squares; the
//! smaller of both directions counts (T-optimality, Atkinson and Fedorov 1975). Information of the present recording is not included.
//!
//! The result is an instruction for a technician, with the expected separation in log-likelihood.

mod menu;

pub use menu::{Experiment, Measured, Row, menu};

use super::judge::is_ambiguous;
use super::ready::set_moving;
use super::selection::{ALIKE, Rival, Selected, without};
use crate::campaign::{Campaign, Place, Reading};
use crate::fit::{Effort, Settings, compare, fit};
use crate::from_recording;
use crate::hypothesis::Hypothesis;
use crate::result::Fit;
use crate::robust::Influence;
use crate::simulate;
use physics::{AnyEffect, Model};
use recording::series::Channel;

/// Largest number of poses of an experiment whose measurements are simulated.
const READINGS: usize = 250;
/// Number of alternatives that are considered, those with the smallest loss in log-likelihood first.
const RIVALS: usize = 3;

/// An experiment that would distinguish alternatives.
#[derive(Clone, Debug)]
pub struct Proposed {
    /// The experiment.
    pub experiment: Experiment,
    /// Measured quantities: the same as in the recordings.
    pub measured: Measured,
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
fn relevant(own: &AnyEffect, alike: &[&Rival]) -> impl Fn(&Experiment) -> bool {
    let effects = std::iter::once(own).chain(alike.iter().map(|rival| &rival.effect));
    let joints: Vec<Option<usize>> = effects.map(AnyEffect::joint).collect();
    move |experiment| {
        let alone = experiment.name.strip_prefix("joint ");
        let Some(rest) = alone else { return true };
        let of = |joint: usize| rest.split(' ').next() == Some(&(joint + 1).to_string());
        joints.iter().any(|joint| joint.is_none_or(of))
    }
}

fn sentence(own: &AnyEffect, alike: &[&Rival], chosen: &Experiment, separation: f64) -> String {
    let name = |effect: &AnyEffect| {
        let whose = effect.joint().map_or(String::new(), |j| format!(" of joint {}", j + 1));
        format!("{}{whose}", effect.spec().kind.replace('_', " "))
    };
    let rivals: Vec<String> = alike.iter().map(|rival| name(&rival.effect)).collect();
    let again = (ALIKE / separation.max(1e-3)).ceil();
    let enough = match again {
        1.0 => String::new(),
        2.0..=20.0 => format!("; repeat it {again:.0} times"),
        _ => ", which is not enough; measure with less noise".to_owned(),
    };
    format!(
        "To distinguish {} from {}: {}. It takes about {:.0} min, with an expected log-likelihood ratio of {}{enough}.",
        name(own),
        rivals.join(", "),
        chosen.says,
        (chosen.takes_s() / 60.0).ceil(),
        format_args!("{separation:.*}", usize::from(separation < 10.0)),
    )
}

/// The measured columns of a recording.
fn measured(campaign: &Campaign) -> Measured {
    let mut channels: Vec<Channel> = Vec::new();
    for reading in campaign.poses.iter().flat_map(|p| p.seen.iter().map(|seen| &seen.reading)) {
        let own: Vec<Channel> = match reading {
            Reading::Point { place: Place::Tcp, .. } => (0..3).map(Channel::Position).collect(),
            Reading::Point { place: Place::Target(t), .. } => {
                (0..3).map(|axis| Channel::Target(*t, axis)).collect()
            }
            Reading::Orientation { .. } => (0..4).map(Channel::Orientation).collect(),
            Reading::JointPosition { joint, .. } => vec![Channel::Link(*joint)],
            _ => Vec::new(),
        };
        if own.first().is_some_and(|first| !channels.contains(first)) {
            channels.extend(own);
        }
    }
    channels.sort_unstable();
    Measured { channels }
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
    pub(super) fn proposed(&self, named: &[Selected]) -> Option<Proposed> {
        let open = named.iter().filter(|one| is_ambiguous(one, self.last));
        let one = open.max_by(|a, b| a.gain.total_cmp(&b.gain))?;
        let own = self.last.hypothesis.model.effects().nth(one.effect)?;
        let alike = one.rivals.iter().filter(|rival| rival.alike).take(RIVALS);
        let alike: Vec<&Rival> = alike.collect();
        let others: Vec<Fit> = alike.iter().filter_map(|rival| self.instead(one, rival)).collect();
        let measured = measured(self.campaign);
        let wanted = relevant(own, &alike);
        let tried = menu(&self.given.arm).into_iter().filter(wanted);
        let parted = tried.filter_map(|experiment| {
            let parts = others.iter().map(|other| self.separation(&experiment, &measured, other));
            let least =
                parts.collect::<Option<Vec<f64>>>()?.into_iter().fold(f64::INFINITY, f64::min);
            least.is_finite().then_some((experiment, least))
        });
        // Among equals the first, which is the simplest.
        let best = parted.reduce(|a, b| if b.1 > a.1 { b } else { a });
        let (experiment, separation) = best?;
        let says = sentence(own, &alike, &experiment, separation);
        Some(Proposed { experiment, measured, separation, says })
    }

    /// The fit of the recording with `rival` in place of `one`.
    fn instead(&self, one: &Selected, rival: &Rival) -> Option<Fit> {
        let mut hypothesis = without(self.last, self.given, &[one]);
        match rival.candidate.changes() {
            Some(place) => drop(hypothesis.revise(place)),
            None => hypothesis.add(rival.effect, rival.kept).ok()?,
        }
        Some(compare(self.campaign, &hypothesis, self.last, self.training))
    }

    /// The poses and measured quantities of an experiment, without values.
    fn carried_out(&self, experiment: &Experiment, measured: &Measured) -> Option<Campaign> {
        let recording = experiment.recording(measured, 1.0);
        let arm = &self.given.arm;
        let mut made = from_recording::campaign(arm, &[recording]).ok()?;
        set_moving(&mut made, arm.count());
        made.instruments.iter_mut().for_each(|instrument| instrument.noise_is_known = true);
        let around = &self.last.surroundings;
        for (own, known) in made.surroundings.targets.iter_mut().zip(&around.targets) {
            *own = *known;
        }
        if let (Some(own), Some(known)) =
            (made.surroundings.frames.first_mut(), around.frames.first())
        {
            *own = *known;
        }
        let count = made.poses.iter().filter(|pose| !pose.seen.is_empty()).count();
        let stride = count.div_ceil(READINGS).max(1);
        for (k, pose) in made.poses.iter_mut().enumerate() {
            if k % stride > 0 {
                pose.seen.clear();
            }
            for seen in &mut pose.seen {
                seen.whitening = self.whitening(&seen.reading)?;
            }
        }
        Some(made)
    }

    /// Whitening by the noise that the same quantity has in the recording.
    fn whitening(&self, reading: &Reading) -> Option<glam::DMat3> {
        let alike = |other: &Reading| match (reading, other) {
            (Reading::Point { place: a, .. }, Reading::Point { place: b, .. }) => a == b,
            (Reading::JointPosition { joint: a, .. }, Reading::JointPosition { joint: b, .. }) => {
                a == b
            }
            (Reading::Orientation { .. }, Reading::Orientation { .. }) => true,
            _ => false,
        };
        let mut all = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let found = all.find(|seen| alike(&seen.reading))?;
        Some(found.whitening * (1.0 / self.last.factors[found.instrument]))
    }

    /// Expected log-likelihood ratio of the two hypotheses, for the worse case of which of them is right.
    fn separation(&self, experiment: &Experiment, measured: &Measured, other: &Fit) -> Option<f64> {
        let made = self.carried_out(experiment, measured)?;
        let [own, other] = [&self.last.hypothesis, &other.hypothesis];
        let one = self.behind(&made, own, other);
        let two = self.behind(&made, other, own);
        Some(one.min(two) / self.last.design_effect.max(1.0))
    }

    /// Loss in log-likelihood of `wrong`, fitted to noise-free measurements simulated with `right`.
    fn behind(&self, made: &Campaign, right: &Hypothesis, wrong: &Hypothesis) -> f64 {
        let seen = simulate::readings(made, &right.model, &made.surroundings, 0.0, 0);
        let used = vec![true; seen.poses.len()];
        let settings = Settings {
            used: &used,
            influence: Influence::Equal,
            from: Some(&made.surroundings),
            effort: Effort::Sketch,
        };
        let own = fit(&seen, right, &settings);
        let against = compare(&seen, wrong, &own, &used);
        let with = compare(&seen, right, &own, &used);
        0.5 * (against.sum - with.sum).max(0.0)
    }
}

#[cfg(test)]
mod tests;
