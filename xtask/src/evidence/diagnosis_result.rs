//! One domain of the program's `diagnosis.json`, read back.
//!
//! It contains only numbers of that file.

use std::path::Path;

use report::significant;
use serde_json::Value;

use super::set_runner::json;

/// Largest number of values of one parameter that are listed individually.
const VALUES_LISTED: usize = 6;

/// One domain of a diagnosis.
pub(super) struct DiagnosisResult(Value);

/// One finding.
pub(super) struct FindingView<'a>(pub(super) &'a Value);

impl DiagnosisResult {
    /// The domain of the diagnosis in a folder; the only one, where `domain` is empty.
    pub(super) fn read(folder: &Path, domain: &str) -> Self {
        let whole = json(&folder.join("diagnosis.json"));
        let of_domain = whole["domains"]
            .as_array()
            .and_then(|all| all.iter().find(|one| one["domain"] == domain).cloned());
        Self(of_domain.unwrap_or(whole))
    }

    pub(super) fn verdict(&self) -> &str {
        self.0["verdict"].as_str().unwrap_or("no verdict")
    }

    pub(super) fn text(&self, key: &str) -> &str {
        self.0[key].as_str().unwrap_or("")
    }

    pub(super) fn number(&self, key: &str) -> f64 {
        self.0[key].as_f64().unwrap_or(f64::NAN)
    }

    pub(super) fn list(&self, key: &str) -> &[Value] {
        self.0[key].as_array().map_or(&[], Vec::as_slice)
    }

    pub(super) fn findings(&self) -> impl Iterator<Item = FindingView<'_>> {
        self.list("findings").iter().chain(self.list("minor")).map(FindingView)
    }

    /// The finding of an effect; of any joint if none is given.
    pub(super) fn finding(&self, effect: &str, joint: Option<u64>) -> Option<FindingView<'_>> {
        self.findings()
            .find(|one| one.effect() == effect && (joint.is_none() || one.joint() == joint))
    }

    /// A joint's validation, torques only.
    pub(super) fn joint(&self, joint: u64) -> Option<&Value> {
        self.list("joints").iter().find(|one| one["joint"] == joint)
    }

    /// Findings in short form: `coulomb friction 1, payload`.
    pub(super) fn names(&self, most: usize) -> String {
        let names: Vec<String> = self.findings().map(|one| one.name()).collect();
        match names.len() {
            0 => "no finding".to_owned(),
            count if count > most => {
                format!("{} and {} more", names[..most].join(", "), count - most)
            }
            _ => names.join(", "),
        }
    }

    /// The unexplained residual, as described by the program.
    pub(super) fn unexplained(&self) -> Option<&str> {
        self.0["unexplained"]["says"].as_str()
    }

    /// Effects that could not have been detected, grouped by reason.
    pub(super) fn not_tested(&self) -> Vec<String> {
        let mut reasons: Vec<(String, Vec<String>)> = Vec::new();
        for one in self.list("not_tested") {
            let why = of_any_joint(one["why"].as_str().unwrap_or(""));
            let name = FindingView(one).effect().replace('_', " ");
            match reasons.iter_mut().find(|(known, _)| *known == why) {
                Some((_, names)) if names.contains(&name) => {}
                Some((_, names)) => names.push(name),
                None => reasons.push((why, vec![name])),
            }
        }
        reasons.into_iter().map(|(why, names)| format!("{} ({why})", names.join(", "))).collect()
    }
}

impl<'a> FindingView<'a> {
    pub(super) fn effect(&self) -> &'a str {
        self.0["effect"].as_str().unwrap_or("")
    }

    pub(super) fn joint(&self) -> Option<u64> {
        self.0["joint"].as_u64()
    }

    pub(super) fn number(&self, key: &str) -> f64 {
        self.0[key].as_f64().unwrap_or(f64::NAN)
    }

    pub(super) fn statement(&self) -> &'a str {
        self.0["says"].as_str().unwrap_or("")
    }

    pub(super) fn condition(&self) -> &'a str {
        self.0["where"]["condition"].as_str().unwrap_or("")
    }

    pub(super) fn name(&self) -> String {
        let joint = self.joint().map_or(String::new(), |joint| format!(" {joint}"));
        format!("{}{joint}", self.effect().replace('_', " "))
    }

    /// A parameter with one number.
    pub(super) fn value(&self, key: &str) -> Option<f64> {
        self.0["parameters"][key]["value"].as_f64()
    }

    /// The same, and its interval.
    pub(super) fn parameter(&self, key: &str) -> Option<(f64, [f64; 2])> {
        let one = &self.0["parameters"][key];
        Some((one["value"].as_f64()?, [one["ci95"][0].as_f64()?, one["ci95"][1].as_f64()?]))
    }

    /// Whether it has a single value whose interval contains zero.
    pub(super) fn interval_contains_zero(&self) -> bool {
        let all = self.0["parameters"].as_object();
        let keys: Vec<&String> = all.into_iter().flat_map(serde_json::Map::keys).collect();
        let [key] = keys.as_slice() else { return false };
        self.parameter(key).is_some_and(|(_, [low, high])| low < 0.0 && 0.0 < high)
    }

    /// All parameters: `level_N 20.4 (19.9 to 20.9)`.
    pub(super) fn parameters(&self) -> String {
        let all = self.0["parameters"].as_object();
        let parameter_text = |(key, one): (&String, &Value)| {
            let value_text = |value: &Value, ci: &Value| {
                let number = |value: &Value| significant(value.as_f64().unwrap_or(f64::NAN), 3);
                if ci[0] == ci[1] {
                    return number(value);
                }
                format!("{} ({} to {})", number(value), number(&ci[0]), number(&ci[1]))
            };
            let values = match one["value"].as_array() {
                Some(list) if list.len() > VALUES_LISTED => {
                    let sizes = list.iter().filter_map(Value::as_f64).map(f64::abs);
                    let largest = significant(sizes.fold(0.0, f64::max), 3);
                    format!("of {} numbers, the largest {largest}", list.len())
                }
                Some(list) => {
                    let each = list
                        .iter()
                        .enumerate()
                        .map(|(k, value)| value_text(value, &one["ci95"][k]));
                    each.collect::<Vec<_>>().join("; ")
                }
                None => value_text(&one["value"], &one["ci95"]),
            };
            format!("{key} {values}")
        };
        all.into_iter().flatten().map(parameter_text).collect::<Vec<_>>().join(", ")
    }
}

/// `joint 3 never reverses` as `a joint never reverses`.
fn of_any_joint(why: &str) -> String {
    let words: Vec<&str> = why.split(' ').collect();
    let is_number =
        |k: usize| k > 0 && words[k - 1] == "joint" && words[k].chars().all(|c| c.is_ascii_digit());
    let mut text: Vec<&str> = Vec::new();
    for (k, word) in words.iter().enumerate() {
        match *word {
            "joint" if k + 1 < words.len() && is_number(k + 1) => text.extend(["a", "joint"]),
            _ if is_number(k) => {}
            word => text.push(word),
        }
    }
    text.join(" ")
}
