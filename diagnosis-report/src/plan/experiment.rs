//! The experiment proposed by a diagnosis, as a path to be run and measured.
//!
//! [`Request::parse`] reads it from `diagnosis.json`. It accepts any text: it returns the experiment, that none is proposed, or why the text is not a
//! diagnosis. The motion is the one that the diagnosis has evaluated, within the limits and speeds of its model. The robot's surroundings are not
//! considered; this is stated.

use diagnosis::diagnose::experiment::{self, MeasuredChannels, catalogue};
use physics::Arm;
use recording::series::{Channel, JOINTS_MAX, Recording, TARGETS_MAX};
use report::{TextLine, significant};
use serde::{Deserialize, Serialize};

/// Names of the files: the path with columns for the measurements, and its description.
pub const FILES: [&str; 2] = ["experiment.csv", "experiment.toml"];
/// Constraints that are not checked.
const NOT_CHECKED: &str = "obstacles around the robot, and collisions of the tool with floor, base or cables: run it slowly first, with a hand on the emergency stop";

/// An experiment: `trued.plan/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ExperimentReport<'a> {
    does: &'static str,
    experiment: &'a str,
    says: &'a str,
    expected_separation: f64,
    takes_s: f64,
    rows: usize,
    files: [String; 2],
    not_checked: [&'static str; 1],
}

/// A proposed experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Instructions for the technician.
    pub says: String,
    /// Name of the experiment in the menu.
    pub name: String,
    /// Expected separation of the alternatives, as a log-likelihood ratio.
    pub expected_separation: f64,
    /// Quantities to be measured.
    pub measured: MeasuredChannels,
}

/// The required keys of `diagnosis.json`: of its only domain, or of each of its domains.
#[derive(Deserialize)]
struct DiagnosisFile {
    #[serde(default)]
    domains: Vec<DomainEntry>,
    #[serde(flatten)]
    only: DomainEntry,
}

#[derive(Deserialize)]
struct DomainEntry {
    next_experiment: Option<String>,
    experiment: Option<ExperimentEntry>,
}

#[derive(Deserialize)]
struct ExperimentEntry {
    name: String,
    expected_separation: f64,
    measure: Vec<String>,
}

/// Why a text contains no usable experiment.
#[derive(Debug, thiserror::Error)]
pub enum NoRequest {
    /// Not JSON, or not of this form.
    #[error("not a diagnosis (`diagnosis.json` of `trued diagnose`): {0}")]
    NoDiagnosis(#[from] serde_json::Error),
    /// The request names a quantity that cannot be measured.
    #[error("`measure` lists `{0}`, which is not a measured column")]
    NotMeasured(String),
}

impl Request {
    /// Parses the text of a `diagnosis.json`; `None` if it proposes no experiment. Of several domains the first that proposes one counts.
    ///
    /// ```
    /// use diagnosis_report::plan::experiment::Request;
    ///
    /// assert_eq!(Request::parse("{}").expect("a diagnosis"), None);
    /// assert!(Request::parse("[1]").is_err());
    /// ```
    ///
    /// # Errors
    /// See [`NoRequest`].
    pub fn parse(text: &str) -> Result<Option<Self>, NoRequest> {
        let DiagnosisFile { domains, only } = serde_json::from_str(text)?;
        let proposal = |domain: DomainEntry| domain.experiment.zip(domain.next_experiment);
        let Some((entry, says)) = domains.into_iter().chain([only]).find_map(proposal) else {
            return Ok(None);
        };
        let measured = measured(&entry.measure)?;
        let ExperimentEntry { name, expected_separation, .. } = entry;
        Ok(Some(Self { says, name, expected_separation, measured }))
    }

    /// The experiment for this arm; `None` if this version has no experiment of that name.
    #[must_use]
    pub fn experiment(&self, arm: &Arm) -> Option<Experiment<'_>> {
        let motion = catalogue(arm).into_iter().find(|one| one.name == self.name)?;
        Some(Experiment { request: self, motion })
    }
}

/// A requested experiment with its motion.
#[derive(Clone, Debug)]
pub struct Experiment<'a> {
    request: &'a Request,
    /// The motion.
    pub motion: experiment::Experiment,
}

impl Experiment<'_> {
    /// The path with empty columns for the measurements.
    #[must_use]
    pub fn recording(&self) -> Recording {
        self.motion.recording(&self.request.measured, f64::NAN)
    }

    /// The result as an object; `files`: the paths of [`FILES`].
    #[must_use]
    pub fn report(&self, files: [String; 2]) -> ExperimentReport<'_> {
        ExperimentReport {
            does: "experiment",
            experiment: &self.motion.name,
            says: &self.request.says,
            expected_separation: self.request.expected_separation,
            takes_s: self.motion.takes_s(),
            rows: self.motion.rows.len(),
            files,
            not_checked: [NOT_CHECKED],
        }
    }

    /// The result in lines of text.
    #[must_use]
    pub fn text(&self, files: &[String; 2]) -> Vec<TextLine> {
        let (rows, takes_s) = (self.motion.rows.len(), significant(self.motion.takes_s(), 3));
        let [list, about] = files;
        vec![
            self.request.says.as_str().into(),
            format!("{rows} rows over {takes_s} s, written to {list} and {about}").into(),
            format!("not checked: {NOT_CHECKED}").into(),
            "record it, fill the empty columns, and give it to trued diagnose beside the first recording".into(),
        ]
    }
}

/// Finds columns by their names without units.
fn measured(names: &[String]) -> Result<MeasuredChannels, NoRequest> {
    let points = (0..TARGETS_MAX).flat_map(|t| (0..3).map(move |axis| Channel::Target(t, axis)));
    let all = (0..3).map(Channel::Position).chain(points);
    let all = all.chain((0..4).map(Channel::Orientation)).chain((0..JOINTS_MAX).map(Channel::Link));
    let all: Vec<Channel> = all.collect();
    let channel = |name: &String| {
        let found = all.iter().copied().find(|channel| channel.base() == *name);
        found.ok_or_else(|| NoRequest::NotMeasured(name.clone()))
    };
    Ok(MeasuredChannels { channels: names.iter().map(channel).collect::<Result<_, _>>()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROPOSAL: &str = r#"{"next_experiment": "Move.", "experiment":
        {"name": "joint 1 alone", "expected_separation": 35.0, "measure": ["ql1"]}}"#;

    #[test]
    fn an_experiment_is_found_in_whichever_domain_proposes_it() {
        let alone = Request::parse(PROPOSAL).expect("a diagnosis").expect("an experiment");
        assert_eq!((alone.name.as_str(), alone.says.as_str()), ("joint 1 alone", "Move."));
        let none = r#"{"next_experiment": null, "experiment": null}"#;
        for domains in [[PROPOSAL, none], [none, PROPOSAL]] {
            let text = format!(r#"{{"domains": [{}]}}"#, domains.join(", "));
            assert_eq!(Request::parse(&text).expect("a diagnosis"), Some(alone.clone()), "{text}");
        }
        let text = format!(r#"{{"domains": [{none}, {none}]}}"#);
        assert_eq!(Request::parse(&text).expect("a diagnosis"), None);
    }
}
