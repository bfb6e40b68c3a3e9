//! A solver's answer, `trued.diagnosis/1`, as far as it is needed for the score.
//!
//! Accepts any text without panic: the result is the usable part of it, or the reason why it is not an answer.

use serde_json::Value;
use thiserror::Error;

/// Overall verdict of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No deviation from the model beyond noise.
    Consistent,
    /// The findings explain the deviation.
    MissingPhysics,
    /// A significant deviation that no known effect explains.
    UnknownStructure,
    /// Indistinguishable candidates, or insufficient data.
    Undetermined,
}

impl Verdict {
    /// Whether its findings are claims.
    #[must_use]
    pub fn makes_claims(self) -> bool {
        matches!(self, Self::MissingPhysics | Self::UnknownStructure)
    }
}

/// A reported effect.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportedEffect {
    /// Name in the model format.
    pub name: String,
    /// 1-based.
    pub joint: Option<usize>,
}

/// One parameter with its interval.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportedParameter {
    /// Key in the model format.
    pub key: String,
    /// Index in the key's list.
    pub index: usize,
    /// In the key's unit.
    pub value: f64,
    /// Lower and upper limit of the 95 % confidence interval.
    pub ci95: Option<(f64, f64)>,
}

/// One finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The reported effect.
    pub effect: ReportedEffect,
    /// `new` or `revised`.
    pub change: String,
    /// Posterior probability of the effect.
    pub confidence: Option<f64>,
    /// Its parameters.
    pub parameters: Vec<ReportedParameter>,
    /// Alternative effects.
    pub alternatives: Vec<ReportedEffect>,
}

/// An answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Overall verdict.
    pub verdict: Verdict,
    /// Most important first.
    pub findings: Vec<Finding>,
    /// Covariates on which an unexplained deviation depends.
    pub depends_on: Vec<String>,
}

/// Why a text is not an answer.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum AnswerError {
    /// Not JSON.
    #[error("is no JSON: {0}")]
    NotJson(String),
    /// Another schema.
    #[error("its `schema` is no trued.diagnosis/1")]
    Schema,
    /// The requested domain is missing.
    #[error("it says nothing of the {0} domain")]
    NoDomain(&'static str),
    /// An unknown verdict.
    #[error("its `verdict` is `{0}`")]
    Verdict(String),
}

impl Answer {
    /// Parses an answer of a domain; one without domains is accepted for any.
    ///
    /// # Errors
    /// The reason why the text is not an answer.
    pub fn parse(text: &str, domain: &'static str) -> Result<Self, AnswerError> {
        let whole: Value =
            serde_json::from_str(text).map_err(|error| AnswerError::NotJson(error.to_string()))?;
        if whole["schema"].as_str() != Some("trued.diagnosis/1") {
            return Err(AnswerError::Schema);
        }
        let domain_entry = match whole["domains"].as_array() {
            Some(domains) => domains.iter().find(|d| d["domain"].as_str() == Some(domain)),
            None => Some(&whole).filter(|d| d["domain"].as_str().is_none_or(|name| name == domain)),
        };
        let body = domain_entry.ok_or(AnswerError::NoDomain(domain))?;
        let verdict_text = body["verdict"].as_str().unwrap_or_default();
        let verdict = match verdict_text {
            "consistent" => Verdict::Consistent,
            "missing_physics" => Verdict::MissingPhysics,
            "unknown_structure" => Verdict::UnknownStructure,
            "undetermined" => Verdict::Undetermined,
            _ => return Err(AnswerError::Verdict(verdict_text.to_owned())),
        };
        let covariates = body["unexplained"]["depends_on"].as_array();
        let covariates =
            covariates.into_iter().flatten().filter_map(Value::as_str).map(str::to_owned);
        let lists = ["findings", "minor"].iter().filter_map(|key| body[*key].as_array());
        let findings = lists.flatten().filter_map(parse_finding);
        Ok(Self { verdict, findings: findings.collect(), depends_on: covariates.collect() })
    }

    /// All reported effects in order: findings first, then their alternatives.
    pub fn reported_effects(&self) -> impl Iterator<Item = &ReportedEffect> {
        let selected = self.findings.iter().map(|finding| &finding.effect);
        selected.chain(self.findings.iter().flat_map(|finding| &finding.alternatives))
    }
}

fn parse_effect(value: &Value) -> Option<ReportedEffect> {
    let joint = value["joint"].as_u64().and_then(|joint| usize::try_from(joint).ok());
    Some(ReportedEffect { name: value["effect"].as_str()?.to_owned(), joint })
}

fn parse_finding(value: &Value) -> Option<Finding> {
    let parameters = value["parameters"].as_object();
    let alternatives = value["alternatives"].as_array();
    Some(Finding {
        effect: parse_effect(value)?,
        change: value["change"].as_str().unwrap_or("new").to_owned(),
        confidence: value["confidence"].as_f64(),
        parameters: parameters
            .into_iter()
            .flatten()
            .flat_map(|(key, value)| parse_parameters(key, value))
            .collect(),
        alternatives: alternatives.into_iter().flatten().filter_map(parse_effect).collect(),
    })
}

/// Parses a value, or a list of values with a list of intervals.
fn parse_parameters(key: &str, value: &Value) -> Vec<ReportedParameter> {
    let pair = |value: &Value| Some((value[0].as_f64()?, value[1].as_f64()?));
    let number = |index: usize, value: &Value, ci95: &Value| {
        Some(ReportedParameter {
            key: key.to_owned(),
            index,
            value: value.as_f64()?,
            ci95: pair(ci95),
        })
    };
    match value["value"].as_array() {
        Some(list) => {
            let each = list.iter().enumerate();
            each.filter_map(|(place, x)| number(place, x, &value["ci95"][place])).collect()
        }
        None => number(0, &value["value"], &value["ci95"]).into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ANSWER: &str = r#"{"schema": "trued.diagnosis/1", "verdict": "missing_physics", "domain": "position",
        "findings": [{"effect": "axis_tilt", "joint": 3, "change": "new", "confidence": 0.9,
            "parameters": {"tilt_mrad": {"value": [0.1, 0.2], "ci95": [[0.0, 0.2], [0.1, 0.3]]}},
            "alternatives": [{"effect": "joint_offset", "joint": 2}]}],
        "unexplained": {"depends_on": ["q2", "v3"]}}"#;

    #[test]
    fn an_answer_by_the_contract_is_read() {
        let answer = Answer::parse(ANSWER, "position").expect("an answer");
        assert_eq!(answer.verdict, Verdict::MissingPhysics);
        let finding = &answer.findings[0];
        assert_eq!((finding.effect.name.as_str(), finding.effect.joint), ("axis_tilt", Some(3)));
        assert_eq!(finding.parameters[1].ci95, Some((0.1, 0.3)));
        assert_eq!(answer.reported_effects().count(), 2);
        assert_eq!(answer.depends_on, ["q2", "v3"]);
    }

    #[test]
    fn of_several_domains_the_one_that_was_asked_is_read() {
        let both = format!(
            r#"{{"schema": "trued.diagnosis/1", "domains": [{{"domain": "torque", "verdict": "consistent"}}, {ANSWER}]}}"#
        );
        assert_eq!(Answer::parse(&both, "position").map(|a| a.findings.len()), Ok(1));
        assert_eq!(Answer::parse(&both, "torque").map(|a| a.verdict), Ok(Verdict::Consistent));
        let torque =
            r#"{"schema": "trued.diagnosis/1", "domain": "torque", "verdict": "consistent"}"#;
        assert_eq!(Answer::parse(torque, "position"), Err(AnswerError::NoDomain("position")));
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(at in 0..ANSWER.len(), with in ".{0,3}") {
            let _ = Answer::parse(&format!("{}{with}{}", &ANSWER[..at], &ANSWER[at..]), "torque");
            let _ = Answer::parse(&ANSWER[..at], "position");
        }
    }
}
