//! The page of `trued calibrate`: validation, results of each joint, undetermined parameters.

use std::path::Path;

use diagnosis::hold_out::PositionErrors;
use report::{
    Axis, Cell, Column, Histogram, Number, Page, Role, Table, Tone, pluralise, shell_word,
    significant,
};

use super::fixed_objects::{lines, object_parameters as numbers_around};
use super::models::{ApproachErrors, CalibrationResult, RecordingErrors};
use super::result::motion_kind;
use super::text::{effect_name, model_name, tolerance_text};
use super::{MODELS, mm};
use crate::drawings::{
    JointEffect, RankedEffect, arm_with_errors, dominant_joints, effects_by_joint, ranking,
};
use crate::entries::FittedEffect;

/// Largest number of outliers in the table.
const OUTLIERS: usize = 50;
/// Caption of the distribution of errors.
const SPREAD: &str =
    "Distance between measured and predicted points for each model, on held-out poses.";
/// Meaning of the [`MODELS`].
const MODELS_EXPLAINED: &str = "Nominal: the given model. Calibrated: with the fitted geometry of every joint. Advanced: with the geometry and all effects that the data support; this is the resulting model.";
/// Roles of the [`MODELS`] in figures.
const ROLES: [Role; 3] = [Role::Before, Role::Calibrated, Role::After];

impl CalibrationResult {
    /// The page. `written`: the file to which the model was written.
    #[must_use]
    pub fn page(&self, written: Option<&Path>) -> Page {
        render(self, written)
    }
}

/// Renders the page.
fn render(found: &CalibrationResult, written: Option<&Path>) -> Page {
    let names: Vec<&str> =
        (0..found.campaign.recordings.len()).map(|place| found.recording_name(place)).collect();
    let page = Page::new(format!("Calibration of {}", found.base.file.name))
        .kicker("trued calibrate")
        .robot(found.base.file.identity().to_string());
    let mut page = next_step(
        main_figure(verdict(page, found, written).numbers(key_figures(found)), found),
        found,
        written,
    );
    page = objections_and_warnings(page, found)
        .section("Validation")
        .text(MODELS_EXPLAINED)
        .table(&error_table(found));
    if !found.tool_errors.is_empty() {
        page = page.figure(SPREAD, &histogram(found));
    }
    if found.recording_errors.len() > 1 {
        page = page.table(&recording_table(found));
    }
    if !found.station_errors.is_empty() {
        page = page.table(&station_table(found));
    }
    if !found.approach_errors.is_empty() {
        page = page.folded("Errors by approach direction of a joint", |page| {
            page.table(&approach_table(&found.approach_errors))
        });
    }
    page = identified_effects(page, found);
    let by_themselves = found.sweeps_and_loads.lines();
    if !by_themselves.is_empty() {
        page = page
            .section("Single-joint and load tests")
            .text("Independent estimates from runs in which one joint moves alone, and from poses measured with and without a load, to compare with the full calibration.")
            .list(&by_themselves);
    }
    page = undetermined_section(page, found);
    let seed =
        found.seed.map_or("none: defined by the recordings".to_owned(), |seed| seed.to_string());
    page.section("Data").facts([
        ("Recordings", names.join(", ")),
        ("Split", found.split.description.clone()),
        ("Seed", seed),
        (
            "Model written",
            format!("{}, fitted to {}", model_name(written), pluralise(found.poses, "pose")),
        ),
    ])
}

fn verdict(page: Page, found: &CalibrationResult, written: Option<&Path>) -> Page {
    let [nominal, calibrated, advanced] = found.errors.each_ref().map(|e| mm(e.mean()));
    let sentence = format!(
        "On {} not used in any fit, the mean tool error of the new model is {} mm, and 95 % of the errors are within {} mm; the mean was {} mm with the given \
         model, and {} mm with calibrated geometry alone.",
        pluralise(found.split.training.iter().filter(|trains| !**trains).count(), "pose"),
        significant(advanced, 3),
        significant(mm(found.errors[2].quantile(0.95)), 3),
        significant(nominal, 3),
        significant(calibrated, 3),
    );
    match found.rejection_reasons.as_slice() {
        [] => match found.tolerance() {
            None => {
                page.verdict(Tone::Good, "calibrated and validated on held-out poses", &sentence)
            }
            Some(tolerance) => {
                let (tone, headline) = match tolerance.met {
                    true => (Tone::Good, "calibrated, within the tolerance"),
                    false => (Tone::Bad, "calibrated, but outside the tolerance"),
                };
                let against = tolerance_text(tolerance);
                page.verdict(tone, headline, &format!("Tolerance of {against}. {sentence}"))
            }
        },
        [reason, ..] => {
            let written =
                if written.is_some() { "model written anyway" } else { "no model written" };
            page.verdict(
                Tone::Bad,
                &format!("not validated, {written}"),
                &format!("{reason} {sentence}"),
            )
        }
    }
}

/// The arm with the errors at its tool; if no point was measured, the distribution of errors.
fn main_figure(page: Page, found: &CalibrationResult) -> Page {
    let arm = &found.base.physics.arm;
    let lit = dominant_joints(arm.count(), &displacements(found));
    let Some((drawing, factor)) = arm_with_errors(arm, &found.campaign, &found.tool_errors, &lit)
    else {
        return page.figure(SPREAD, &histogram(found));
    };
    let red =
        if lit.is_empty() { "" } else { " Red: joints with the largest effects at the tool." };
    let caption = format!(
        "Tool errors on held-out poses: measured minus model, magnified {} times, with the given model (before) and the new model (after).{red}",
        significant(factor, 1)
    );
    page.figure(&caption, &drawing)
}

fn next_step(page: Page, found: &CalibrationResult, written: Option<&Path>) -> Page {
    let Some(model) = written else {
        return page.next(
            "Read why the model was rejected (below), correct the causes, and measure again.",
            None,
        );
    };
    if found.tolerance().is_some_and(|tolerance| !tolerance.met) {
        return page.next(
            "The tolerance is not met. Measure more poses, spread over the whole workspace and approached from both sides, with firm targets and instrument, and calibrate with all recordings together; until then use the model only where its error is acceptable.",
            Some(&format!("trued plan --model {} --out more-poses", shell_word(&model.display().to_string()))),
        );
    }
    page.next(
        "Plan a check of ten poses with the new model, and measure them after a collision or a repair.",
        Some(&format!("{} --out check", found.check_command(model))),
    )
}

/// Displacement of the tool by each effect, mm.
fn displacements(found: &CalibrationResult) -> Vec<JointEffect> {
    let known = found.entries.iter().filter(|entry| !entry.is_empty());
    known
        .map(|entry| JointEffect {
            effect: effect_name(entry.kind()),
            joint: entry.joint(),
            size: mm(entry.share_m),
        })
        .collect()
}

fn identified_effects(page: Page, found: &CalibrationResult) -> Page {
    let mut page = page.section("Identified effects");
    let name = |entry: &FittedEffect| {
        let whose = entry.joint().map_or(String::new(), |joint| format!(", joint {joint}"));
        format!("{}{whose}", effect_name(entry.kind()))
    };
    let known = || found.entries.iter().filter(|entry| !entry.is_empty());
    let ranked =
        known().map(|entry| RankedEffect { name: name(entry), size: Some(mm(entry.share_m)) });
    let axis = Axis::new("Effect at the tool", "mm RMS");
    if let Some(bars) = ranking("Effect of each term at the tool", axis, ranked) {
        page = page.figure(
            "RMS displacement of the measured points by each effect: compared with the same model without it, with measuring frames and targets estimated again; largest first.",
            &bars,
        );
    }
    let caption =
        "RMS displacement of the measured points, after registration of frames and targets, mm";
    page = page.table(&effects_by_joint(
        caption,
        found.base.physics.arm.count(),
        &displacements(found),
    ));
    page = page.folded("Parameters", |page| {
        page.table(&parameter_table(found)).text("± is the standard uncertainty; `–` means that the data do not determine the parameter, which kept its value.")
    });
    let around = lines(&numbers_around(&found.fit));
    if !around.is_empty() {
        page = page
            .text("Measuring frames, targets and contacted surfaces, estimated in the base frame:")
            .list(&around);
    }
    let nests = found.frame_drift();
    if nests.is_empty() { page } else { page.list(&nests) }
}

/// Objections to the model, and warnings.
fn objections_and_warnings(mut page: Page, found: &CalibrationResult) -> Page {
    for reason in &found.rejection_reasons {
        page = page.note(Tone::Bad, "Validation failed", reason);
    }
    if let Some((first, others)) = found.warnings.split_first() {
        page = page.note(Tone::Caution, "Warnings", first);
        if !others.is_empty() {
            page = page.list(others);
        }
    }
    page
}

/// Key figures without a tone: an improvement is not necessarily sufficient.
fn key_figures(found: &CalibrationResult) -> Vec<Number> {
    let figure = |k: usize| {
        let errors = &found.errors[k];
        let note = format!("95 % within {} mm", significant(mm(errors.quantile(0.95)), 3));
        Number::new(format!("Mean error, {}", MODELS[k]), mm(errors.mean()), "mm").note(note)
    };
    let effects = found.entries.iter().filter(|entry| !entry.is_empty()).count();
    vec![figure(0), figure(1), figure(2), Number::text("Effects in the model", effects.to_string())]
}

fn error_table(found: &CalibrationResult) -> Table {
    let heads = ["Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)", "Points"];
    // The smallest error matters most: one more digit for it.
    let heads = heads.map(|head| Column::new(head).digits(4));
    let table = Table::new("Errors on held-out poses", heads);
    MODELS.iter().zip(&found.errors).fold(table, |table, (name, errors)| {
        let points = Cell::from(errors.sorted_m.len() as f64);
        table.row(std::iter::once(Cell::from(*name)).chain(error_cells(errors)).chain([points]))
    })
}

fn histogram(found: &CalibrationResult) -> report::Svg {
    let plot = Histogram::new("Held-out errors", Axis::new("Error", "mm").log());
    let named = MODELS.iter().zip(ROLES).zip(&found.errors);
    named
        .fold(plot, |plot, ((name, role), errors)| {
            plot.values(*name, errors.sorted_m.iter().map(|error| mm(*error))).role(role)
        })
        .render()
}

/// Mean, median, 95 % quantile and maximum, mm.
fn error_cells(errors: &PositionErrors) -> [Cell; 4] {
    [errors.mean(), errors.quantile(0.5), errors.quantile(0.95), errors.max()]
        .map(|error| Cell::from(mm(error)))
}

fn recording_table(found: &CalibrationResult) -> Table {
    let heads =
        ["Recording", "Poses", "Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)"];
    let table = Table::new("Errors on held-out poses, by recording", heads);
    let rows = |one: &RecordingErrors, table: Table| {
        MODELS.iter().zip(&one.errors).fold(table, |table, (name, errors)| {
            let head = [
                found.recording_name(one.recording).into(),
                motion_kind(one.planar).into(),
                (*name).into(),
            ];
            table.row(head.into_iter().chain(error_cells(errors)))
        })
    };
    found.recording_errors.iter().fold(table, |table, one| rows(one, table))
}

fn station_table(found: &CalibrationResult) -> Table {
    let heads = [
        "Station",
        "Recording",
        "Nominal, mean (mm)",
        "Calibrated, mean (mm)",
        "Advanced, mean (mm)",
        "Advanced, 95 % (mm)",
        "Advanced, largest (mm)",
        "Points",
    ];
    let table = Table::new("Held-out errors by station of the instrument", heads);
    found.station_errors.iter().fold(table, |table, one| {
        let [nominal, calibrated, advanced] = &one.errors;
        let means = [nominal, calibrated, advanced].map(PositionErrors::mean);
        let cells = means.into_iter().chain([advanced.quantile(0.95), advanced.max()]);
        let named =
            [Cell::from((one.frame + 1).to_string()), found.recording_name(one.recording).into()];
        let points = Cell::from(advanced.sorted_m.len() as f64);
        table.row(named.into_iter().chain(cells.map(|error| Cell::from(mm(error)))).chain([points]))
    })
}

fn approach_table(approached: &[ApproachErrors]) -> Table {
    let heads =
        ["Joint", "Arrived", "Model", "Mean (mm)", "Median (mm)", "95 % (mm)", "Largest (mm)"];
    let mut table = Table::new("Held-out errors by approach direction of a joint", heads);
    for one in approached {
        for (side, way) in ["rising", "falling"].into_iter().enumerate() {
            for (name, errors) in MODELS.iter().zip(&one.errors) {
                let head = [(one.joint + 1).to_string().into(), way.into(), (*name).into()];
                table = table.row(head.into_iter().chain(error_cells(&errors[side])));
            }
        }
    }
    table
}

fn parameter_table(found: &CalibrationResult) -> Table {
    let heads = [
        Column::new("Joint"),
        Column::new("Effect"),
        Column::new("Parameter"),
        Column::new("Value"),
        Column::new("±"),
        Column::new("Effect at the tool (mm)"),
    ];
    let mut table = Table::new("Parameters, in the units of the model file", heads);
    let mut entries: Vec<&FittedEffect> = found.entries.iter().collect();
    entries.sort_by(|a, b| {
        (a.joint(), b.share_m)
            .partial_cmp(&(b.joint(), a.share_m))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    for entry in entries {
        for number in &entry.parameters {
            let joint = entry.joint().map_or("robot".to_owned(), |joint| joint.to_string());
            let index = number.index.map(|index| format!(" {index}")).unwrap_or_default();
            let sigma = number.sigma.map_or("–".to_owned(), |sigma| significant(sigma, 2));
            table = table.row([
                joint.into(),
                effect_name(entry.kind()).into(),
                format!("{}{index}", number.key).into(),
                significant(number.value, 4).into(),
                sigma.into(),
                mm(entry.share_m).into(),
            ]);
        }
    }
    table
}

fn undetermined_section(mut page: Page, found: &CalibrationResult) -> Page {
    let undetermined = found.undetermined_sentences();
    if !undetermined.is_empty() {
        page = page
            .section("Not identifiable from these data")
            .text("These parameters cannot be identified individually: of all values that explain the readings equally well, the model contains the smallest. Other poses, a known measuring frame or known reflector positions may determine them. Summary:")
            .list(found.undetermined_by_reason())
            .folded("All parameters", |page| page.list(undetermined));
    }
    if !found.outliers.is_empty() {
        let heads = ["Recording", "Row", "Error (mm)"];
        let title =
            format!("{} with a weight below one half", pluralise(found.outliers.len(), "pose"));
        let outliers = found.outliers.iter().take(OUTLIERS);
        let table = outliers.fold(Table::new(title, heads), |table, outlier| {
            table.row([
                found.recording_name(outlier.recording).into(),
                (outlier.row as f64).into(),
                mm(outlier.error_m).into(),
            ])
        });
        page = page.section("Outliers").table(&table);
    }
    page
}
