//! Validation of a cell with its model: errors for which the daemon would not start.

use std::path::{Path, PathBuf};

use recording::cell::{CellConfig, Feed, FeedLimit, FeedMode};
use recording::check::Findings;
use recording::faults::{Fault, Faults, Location};
use recording::files::{FileError, read_text};
use recording::model::RobotModel;
use shm_schema::Cell;

use super::{deflection_limit_fault, force_processor, joint_kinds, settings};

/// Checks a cell, its model, and whether they match. The model is checked even if the cell cannot
/// be parsed.
///
/// ```
/// use std::path::Path;
///
/// assert!(daemon::setup::check::cell(Path::new("missing.toml")).is_err());
/// ```
///
/// # Errors
/// The cell's file cannot be read. Faults in it are among the findings.
pub fn cell(path: &Path) -> Result<Findings, FileError> {
    let text = read_text(path)?;
    let mut findings = Findings { kind: "cell", ..Findings::default() };
    let mut config = None;
    findings.take(CellConfig::read(path), |_, read| config = Some(read))?;
    let model_path = match &config {
        Some(config) => Some(config.model.clone()),
        None => named_model(path, &text),
    };
    let Some(model_path) = model_path else { return Ok(findings) };
    let name = path.display().to_string();
    let model = match RobotModel::read(&model_path) {
        Ok(model) => model,
        Err(FileError::Content(faults)) => {
            findings.faults.push(faults);
            return Ok(findings);
        }
        Err(error) => {
            let fault =
                Fault::new("model", error.to_string()).expected("a model file, or a preset");
            findings.faults.extend(with_places(&name, &text, vec![fault]));
            return Ok(findings);
        }
    };
    if let Some(config) = config {
        findings.faults.extend(with_places(&name, &text, startup_faults(&name, &config, &model)));
        let mode = format!("{:?}", config.mode).to_lowercase();
        let robot = &model.file.name;
        let feed = config.feed.map(feed_summary).unwrap_or_default();
        findings.summary = format!("`{}`, mode {mode}, with `{robot}`{feed}", config.cell);
    }
    Ok(findings)
}

/// Summary of the cell's feed adaptation.
fn feed_summary(feed: Feed) -> String {
    let limit = match feed.limit {
        FeedLimit::Force(n) => format!("{n} N"),
        FeedLimit::Deflection(m) => format!("{} mm of deflection", m * 1e3),
    };
    let (floor, lost) = (feed.floor * 1e2, feed.lost * 1e2);
    match feed.mode {
        FeedMode::Off => String::new(),
        FeedMode::Observe => format!("; the feed for {limit} is watched"),
        FeedMode::Adapt => format!(
            "; the feed is adapted to {limit}, from {floor} to 100 %; {lost} % without a force"
        ),
    }
}

/// Faults for which the daemon would refuse to start.
fn startup_faults(name: &str, config: &CellConfig, model: &RobotModel) -> Vec<Fault> {
    let arm = &model.physics.arm;
    let mut found = Vec::new();
    if let Err(faults) = config.check_against(name, &joint_kinds(arm)) {
        found.extend(faults.list().iter().cloned());
    }
    if let Err(error) = settings(config, arm, false) {
        found.push(Fault::new("envelope", error.to_string()));
    }
    if let Err(error) = force_processor(config, model) {
        found.push(Fault::new("vibration", error.to_string()));
    }
    found.extend(deflection_limit_fault(config, &model.physics));
    if let Err(error) = Cell::new(&config.cell) {
        found.push(Fault::new("cell", error.to_string()));
    }
    found
}

/// Errors that name a key, with the position of that key in the text.
fn with_places(name: &str, text: &str, found: Vec<Fault>) -> Option<Faults> {
    if found.is_empty() {
        return None;
    }
    let mut faults = Faults::new(name);
    for fault in found {
        let location = fault.location.clone().or_else(|| place_of(text, &fault.key));
        faults.push(Fault { location, ..fault });
    }
    faults.into_result::<()>(None).err()
}

/// Position of `table.key`, of a root key, or of a table's header.
fn place_of(text: &str, path: &str) -> Option<Location> {
    let (wanted, key) = path.split_once('.').unwrap_or(("", path));
    let mut table = String::new();
    for (number, line) in text.lines().enumerate() {
        let trimmed = line.trim_start();
        let start = line.len() - trimmed.len();
        if let Some(head) = trimmed.strip_prefix('[') {
            table = head.split(']').next().unwrap_or("").trim().to_owned();
            if wanted.is_empty() && table == key {
                return Some(Location::from_line(
                    number + 1,
                    line,
                    &(start..line.trim_end().len()),
                ));
            }
        } else if table == wanted && is_key(trimmed, key) {
            return Some(Location::from_line(number + 1, line, &(start..start + key.len())));
        }
    }
    None
}

fn is_key(line: &str, key: &str) -> bool {
    line.strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with('='))
}

/// The model that a cell names that cannot be parsed as a whole.
fn named_model(path: &Path, text: &str) -> Option<PathBuf> {
    let root = text.lines().map(str::trim_start).take_while(|line| !line.starts_with('['));
    let line = root.filter(|line| is_key(line, "model")).last()?;
    let name = line.split_once('=')?.1.trim_start().strip_prefix('"')?.split('"').next()?;
    let beside = path.parent().unwrap_or(Path::new("")).join(name);
    let is_preset = recording::model::presets::preset(name).is_some();
    Some(if is_preset && !beside.exists() { PathBuf::from(name) } else { beside })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_found_in_its_table_alone() {
        let text = "rate_mm_s = 1\n[wrench]\nrate_mm_s = 2\n[envelope] # x\n  rate_mm_s = 3\n";
        let place = |path| place_of(text, path).map(|place| (place.line, place.column));
        assert_eq!(place("envelope.rate_mm_s"), Some((5, 3)));
        assert_eq!(place("rate_mm_s"), Some((1, 1)));
        assert_eq!(place("envelope"), Some((4, 1)));
        assert_eq!(place("envelope.rate"), None);
    }
}
