//! The experiment proposed by a diagnosis, as read from `diagnosis.json` by `trued plan --for`.
//!
//! Accepts any text: it returns the experiment, that none is proposed, or why the text is not a
//! diagnosis. Does not access files.

use diagnosis::diagnose::experiment::{Experiment, Measured, menu};
use physics::Arm;
use recording::series::{Channel, JOINTS_MAX, TARGETS_MAX};
use serde::Deserialize;

/// A proposed experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Asked {
    /// What a technician has to do.
    pub says: String,
    /// Which one of the menu.
    pub name: String,
    /// Expected separation of the alternatives, as a log-likelihood ratio.
    pub expected_separation: f64,
    /// What is to be measured.
    pub measured: Measured,
}

/// What is needed of `diagnosis.json`.
#[derive(Deserialize)]
struct Diagnosed {
    next_experiment: Option<String>,
    experiment: Option<Wanted>,
}

#[derive(Deserialize)]
struct Wanted {
    name: String,
    expected_separation: f64,
    measure: Vec<String>,
}

/// A text from which no experiment can be read.
#[derive(Debug, thiserror::Error)]
pub enum NotAsked {
    /// Not JSON, or not of this form.
    #[error("is no diagnosis: {0}")]
    NoDiagnosis(#[from] serde_json::Error),
    /// The request names a quantity that cannot be measured.
    #[error("`measure` names `{0}`, which is no measured column")]
    NotMeasured(String),
}

impl Asked {
    /// Reads the text of a `diagnosis.json`; `None` where it proposes no experiment.
    ///
    /// # Errors
    /// See [`NotAsked`].
    pub fn parse(text: &str) -> Result<Option<Self>, NotAsked> {
        let found: Diagnosed = serde_json::from_str(text)?;
        let (Some(wanted), Some(says)) = (found.experiment, found.next_experiment) else {
            return Ok(None);
        };
        let measured = measured(&wanted.measure)?;
        let Wanted { name, expected_separation, .. } = wanted;
        Ok(Some(Self { says, name, expected_separation, measured }))
    }

    /// The experiment of that name; none where this version has none.
    #[must_use]
    pub fn experiment(&self, arm: &Arm) -> Option<Experiment> {
        menu(arm).into_iter().find(|one| one.name == self.name)
    }
}

/// Columns by their names without units.
fn measured(names: &[String]) -> Result<Measured, NotAsked> {
    let points = (0..TARGETS_MAX).flat_map(|t| (0..3).map(move |axis| Channel::Target(t, axis)));
    let all = (0..3).map(Channel::Position).chain(points);
    let all = all.chain((0..4).map(Channel::Orientation)).chain((0..JOINTS_MAX).map(Channel::Link));
    let all: Vec<Channel> = all.collect();
    let channel = |name: &String| {
        let found = all.iter().copied().find(|channel| channel.base() == *name);
        found.ok_or_else(|| NotAsked::NotMeasured(name.clone()))
    };
    Ok(Measured { channels: names.iter().map(channel).collect::<Result<_, _>>()? })
}
