//! A calibration in lines of text.

use std::collections::BTreeSet;
use std::path::Path;

use diagnosis::Reading;
use diagnosis::campaign::ToolPoint;
use glam::DVec3;
use report::{TextTable, fixed, pluralise, significant};

use super::fixed_objects::{lines, object_parameters};
use super::models::{CalibrationResult, Outlier};
use super::{MODELS, Tolerance, mm};
use crate::entries::FittedEffect;

/// Effects that move the tool by less than this fraction of the largest are not listed.
const LISTED_SHARE_LEAST: f64 = 0.02;
/// Largest number of effects listed per joint.
const EFFECTS_PER_JOINT_MOST: usize = 4;
/// Largest number of outliers listed one by one.
const OUTLIERS_LISTED_MOST: usize = 2;
/// Smallest noise for which a check is planned, mm; below the noise of any instrument.
const SIGMA_LEAST_MM: f64 = 1e-4;

impl CalibrationResult {
    /// The result as text; its table is at most `width_max` characters wide. `written`: the file to which the model was written.
    #[must_use]
    pub fn text(&self, written: Option<&Path>, width_max: Option<usize>) -> String {
        let mut table = TextTable::new(["held out, mm", "mean", "median", "95 %", "largest"]);
        for (name, errors) in MODELS.iter().zip(&self.errors) {
            let statistics =
                [errors.mean(), errors.quantile(0.5), errors.quantile(0.95), errors.max()];
            let cells = statistics.map(|error| fixed(mm(error), 3));
            table = table.row(std::iter::once((*name).to_owned()).chain(cells));
        }
        let mut text = format!(
            "{}: {}\n{}",
            self.base.file.name,
            self.split.description,
            table.render(width_max)
        );
        text += "effects, RMS displacement of the measured points after registration, mm\n";
        for line in effects_per_joint(self) {
            text += &format!("  {line}\n");
        }
        for line in
            lines(&object_parameters(&self.fit)).into_iter().chain(self.sweeps_and_loads.lines())
        {
            text += &format!("  {line}\n");
        }
        for sentence in self.frame_drift() {
            text += &format!("frame     {sentence}\n");
        }
        for sentence in self.undetermined_by_reason() {
            text += &format!("open      {sentence}\n");
        }
        let rest = |all: usize| if all > OUTLIERS_LISTED_MOST { "; …" } else { "" };
        if !self.outliers.is_empty() {
            let row = |outlier: &Outlier| {
                let name = self.recording_name(outlier.recording);
                format!("{name} row {} by {} mm", outlier.row, significant(mm(outlier.error_m), 2))
            };
            let some: Vec<String> =
                self.outliers.iter().take(OUTLIERS_LISTED_MOST).map(row).collect();
            let many = pluralise(self.outliers.len(), "outlier");
            text +=
                &format!("outliers  {many}: {}{}\n", some.join("; "), rest(self.outliers.len()));
        }
        if let Some(tolerance) = self.tolerance() {
            text += &format!("tolerance {}\n", tolerance_text(tolerance));
        }
        let poses = pluralise(self.poses, "pose");
        text += &format!("model     {}, fitted to {poses}", model_name(written));
        if let Some(path) = written {
            text += &format!("\ncheck     {}", self.check_command(path));
        }
        text
    }

    /// The command that plans a check with this model: targets at their fitted positions, and its held-out error per axis as the noise.
    #[must_use]
    pub fn check_command(&self, model: &Path) -> String {
        let [.., advanced] = &self.errors;
        let square = advanced.sorted_m.iter().map(|error| error * error).sum::<f64>();
        let axis_m = (square / (3 * advanced.sorted_m.len()).max(1) as f64).sqrt();
        let out = report::shell_word(&model.display().to_string());
        let mut text = format!(
            "trued plan --check --model {out} --sigma-mm {:.4}",
            mm(axis_m).max(SIGMA_LEAST_MM)
        );
        let targets = self.tool_targets();
        for target in &targets {
            let [x, y, z] = (*target * 1e3).to_array().map(|mm| format!("{mm:.3}"));
            // An ASCII minus sign, as the option requires.
            text += &format!(" --target={x},{y},{z}");
        }
        if !targets.is_empty() {
            text += " --targets-known";
        }
        text
    }

    /// Targets that were measured on the tool, tool frame, m; those on the base or on a link are numbered with them, but belong to no tool.
    fn tool_targets(&self) -> Vec<DVec3> {
        let readings = self.campaign.poses.iter().flat_map(|pose| &pose.seen);
        let on_tool: BTreeSet<usize> = readings
            .filter_map(|one| match one.reading {
                Reading::Point { place: ToolPoint::Target(target), .. } => Some(target),
                _ => None,
            })
            .collect();
        let targets = &self.fit.surroundings.targets;
        on_tool.into_iter().filter_map(|k| targets.get(k)).map(|target| target.value).collect()
    }
}

/// The file to which the model was written.
pub(super) fn model_name(written: Option<&Path>) -> String {
    written.map_or_else(|| "none".to_owned(), |path| path.display().to_string())
}

/// The evaluation of a tolerance as text.
pub(super) fn tolerance_text(tolerance: Tolerance) -> String {
    let Tolerance { tolerance_mm, p95_mm, met } = tolerance;
    let outcome = if met { "met" } else { "not met" };
    format!(
        "{} mm {outcome}: 95 % of the held-out errors are within {} mm",
        significant(tolerance_mm, 3),
        significant(p95_mm, 3)
    )
}

/// Lines of the significant effects per joint, largest displacement of the tool first.
fn effects_per_joint(found: &CalibrationResult) -> Vec<String> {
    let mut listed: Vec<&FittedEffect> =
        found.entries.iter().filter(|entry| !entry.is_empty()).collect();
    listed.sort_by(|a, b| b.share_m.total_cmp(&a.share_m));
    let share_min = LISTED_SHARE_LEAST * listed.first().map_or(0.0, |entry| entry.share_m);
    let mut joints: Vec<Option<usize>> = Vec::new();
    for entry in &listed {
        if !joints.contains(&entry.joint()) {
            joints.push(entry.joint());
        }
    }
    let line = |joint: Option<usize>| {
        let of_joint =
            listed.iter().filter(|entry| entry.joint() == joint && entry.share_m >= share_min);
        let effects = of_joint
            .map(|entry| format!("{} {}", effect_name(entry.kind()), displacement_text(entry)));
        let effects: Vec<String> = effects.take(EFFECTS_PER_JOINT_MOST).collect();
        let whose = joint.map_or("robot".to_owned(), |joint| format!("joint {joint}"));
        (!effects.is_empty()).then(|| format!("{whose}: {}", effects.join(", ")))
    };
    joints.into_iter().filter_map(line).collect()
}

/// Name of an effect for users.
pub(super) fn effect_name(kind: &str) -> String {
    match kind {
        "joint_polynomial" => "an unexplained remainder".to_owned(),
        _ => kind.replace('_', " "),
    }
}

fn displacement_text(entry: &FittedEffect) -> String {
    significant(mm(entry.share_m), 2)
}
