//! Candidate effects of cutter and force sensor, with their parameters.
//!
//! A candidate has several forms: one direction or all; one common factor for all directions; a sensor error on one axis or on all. Signs as in
//! docs/reference/effects.md. An effect that this recording cannot show is not a candidate, and the reason is listed.

use physics::{AnyEffect, Model};

use crate::engine::dictionary::{
    CandidateDictionary, CandidateTerm, CoefficientForm, ParameterBounds,
};
use crate::engine::regression_data::Regressor;

use super::case::{Case, NuisanceColumns, UncertainParameter};
use super::cut_model::{
    BIAS, CHATTER, CHIP, CROSS_TALK, EDGE, PARAMETERS, PERMANENT_TONE, ROTATION, RUNOUT, SCALE,
    Slot, WEAR,
};

/// Kind of an oscillation that is not an effect of docs/reference/effects.md: present whether the tool cuts or not.
pub(super) const PERMANENT_TONE_KIND: &str = "";
/// Largest relative scale or cross-talk error of a sensor, and largest rotation, rad.
pub(super) const SENSOR_ERROR_MOST: f64 = 0.5;
/// Largest number of segments for which an amplifier drift is fitted per segment.
const SEGMENTS_WITH_DRIFT_MOST: usize = 16;
/// Prior standard deviation of the relative error of the recorded spindle speed.
const SPEED_SIGMA: f64 = 1e-3;

/// Kinds of effects with their parameters.
pub(super) const KINDS: [(&str, Slot); 9] = [
    ("cutting_force", CHIP),
    ("edge_force", EDGE),
    ("tool_wear", WEAR),
    ("runout", RUNOUT),
    ("wrench_bias", BIAS),
    ("wrench_scale", SCALE),
    ("wrench_misalignment", ROTATION),
    ("cross_talk", CROSS_TALK),
    ("chatter", CHATTER),
];

/// Parameters of a kind; those of [`PERMANENT_TONE_KIND`] for any other name.
pub(super) fn parameters_of_kind(kind: &str) -> Slot {
    KINDS.iter().find(|(name, _)| *name == kind).map_or(PERMANENT_TONE, |(_, slot)| *slot)
}

/// Parameters that the model states with an uncertainty; `sigma`: standard uncertainty of each value of each effect.
pub(super) fn uncertain_parameters(model: &Model, sigma: &[Vec<f64>]) -> Vec<UncertainParameter> {
    let of_effect = |(effect, sigma): (&AnyEffect, &Vec<f64>)| -> Vec<UncertainParameter> {
        let kind = effect.spec().kind;
        let known =
            KINDS.iter().find(|(name, _)| *name == kind && !matches!(kind, "runout" | "chatter"));
        let Some((_, slot)) = known else { return Vec::new() };
        let open = sigma.iter().take(slot.count).enumerate().filter(|(_, sigma)| **sigma > 0.0);
        open.map(|(k, sigma)| UncertainParameter { parameter: slot.from + k, sigma: *sigma })
            .collect()
    };
    model.effects().zip(sigma).flat_map(of_effect).collect()
}

/// Sets up the library: a column for each parameter, for proportional changes, for the spindle and for the drift.
pub(super) fn library(case: &mut Case) {
    let mut directions: Vec<Vec<(usize, f64)>> = (0..PARAMETERS).map(|k| vec![(k, 1.0)]).collect();
    let mut proportional = Vec::new();
    for (from, coefficients) in case.coefficients() {
        proportional.push(directions.len());
        let largest = coefficients.abs().max_element().max(f64::MIN_POSITIVE);
        let part = |k: usize| (from + k, coefficients[k] / largest);
        directions.push((0..3).map(part).collect());
    }
    let common = directions.len();
    directions.push((0..3).map(|k| (SCALE.from + k, 1.0)).collect());
    let mut prior = vec![0.0; directions.len()];
    let anyway = nuisance_columns(case, &mut directions, &mut prior);
    case.nuisance = anyway;
    let columns = vec![Regressor::default(); directions.len()];
    let mut library =
        CandidateDictionary { columns, prior, terms: Vec::new(), untested: Vec::new() };
    let mut put = |kind: &'static str, columns: Vec<usize>, stem: &'static [&'static str]| {
        library.terms.push(CandidateTerm {
            kind,
            joint: None,
            recording: None,
            signs: vec![ParameterBounds::Any; columns.len()],
            columns,
            form: CoefficientForm::Plain(stem),
            corrects_stated: false,
            settings: Vec::new(),
        });
    };
    const AXES: [&[&str]; 3] = [&["x"], &["y"], &["z"]];
    const PARTS: [&[&str]; 3] = [&["tangential"], &["radial"], &["axial"]];
    for ((kind, slot), proportional) in KINDS.into_iter().zip(proportional) {
        (0..3).for_each(|k| put(kind, vec![slot.from + k], PARTS[k]));
        put(kind, vec![proportional], &["all alike"]);
        put(kind, vec![slot.from, slot.from + 1], &["tangential", "radial"]);
        put(kind, (0..3).map(|k| slot.from + k).collect(), &["tangential", "radial", "axial"]);
    }
    for (kind, slot) in [KINDS[4], KINDS[5], KINDS[6]] {
        (0..3).for_each(|k| put(kind, vec![slot.from + k], AXES[k]));
        if kind == "wrench_scale" {
            put(kind, vec![common], &["all alike"]);
        }
        for (k, other) in [(0, 1), (0, 2), (1, 2)] {
            put(kind, vec![slot.from + k, slot.from + other], &["two"]);
        }
        put(kind, (0..3).map(|k| slot.from + k).collect(), &["x", "y", "z"]);
    }
    let leaks: Vec<usize> = (0..9).filter(|k| k % 4 != 0).map(|k| CROSS_TALK.from + k).collect();
    const LEAKS: [&[&str]; 6] = [&["xy"], &["xz"], &["yx"], &["yz"], &["zx"], &["zy"]];
    leaks.iter().zip(LEAKS).for_each(|(leak, stem)| put("cross_talk", vec![*leak], stem));
    for (k, leak) in leaks.iter().enumerate() {
        leaks[..k].iter().for_each(|other| put("cross_talk", vec![*other, *leak], &["two"]));
    }
    put("cross_talk", leaks, &["xy", "xz", "yx", "yz", "zx", "zy"]);
    put("tool_wear", vec![WEAR.from], &["growth"]);
    put("runout", vec![RUNOUT.from, RUNOUT.from + 1], &["radial", "phase"]);
    let is_doubted = |column: &usize| {
        directions[*column].iter().any(|(parameter, _)| {
            case.uncertain_parameters.iter().any(|one| one.parameter == *parameter)
        })
    };
    for family in &mut library.terms {
        family.corrects_stated = family.columns.iter().any(is_doubted);
    }
    case.library = library;
    case.column_parameters = directions;
}

/// Columns of nuisance parameters: spindle, amplifier drift, and parameters that the model states with an uncertainty.
fn nuisance_columns(
    case: &Case,
    directions: &mut Vec<Vec<(usize, f64)>>,
    prior: &mut Vec<f64>,
) -> NuisanceColumns {
    let mut put = |parameter: usize, weight: f64| {
        directions.push(vec![(parameter, 1.0)]);
        prior.push(weight);
        directions.len() - 1
    };
    let [phases, speed, drifts, bends] = case.nuisance_offsets();
    let mut spindle: Vec<usize> = (phases..speed).map(|parameter| put(parameter, 0.0)).collect();
    spindle.push(put(speed, 1.0 / (SPEED_SIGMA * SPEED_SIGMA)));
    // With more segments, the number of drift columns would outweigh their benefit.
    let last = if speed - phases <= SEGMENTS_WITH_DRIFT_MOST { bends } else { drifts };
    let drift = (drifts..last).map(|parameter| put(parameter, 0.0)).collect();
    // Columns of curvature are used in the estimation of the noise only, so that a curved drift is not taken for autocorrelation.
    (bends..bends + last - drifts).for_each(|parameter| {
        put(parameter, 0.0);
    });
    let of_model = case.uncertain_parameters.iter();
    let uncertain =
        of_model.map(|stated| put(stated.parameter, 1.0 / (stated.sigma * stated.sigma)));
    NuisanceColumns { spindle, drift, uncertain_parameters: uncertain.collect() }
}

/// Adds an oscillation as a candidate: in the cut only, or always; on each axis, or on all.
pub(super) fn add_oscillation(case: &mut Case, tone_hz: f64) {
    const AXES: [&[&str]; 3] = [&["x"], &["y"], &["z"]];
    case.model.tone_hz = tone_hz;
    case.library.terms.retain(|family| family.settings.is_empty());
    for (kind, slot) in [("chatter", CHATTER), (PERMANENT_TONE_KIND, PERMANENT_TONE)] {
        let mut forms: Vec<(Vec<usize>, &'static [&'static str])> =
            (0..3).map(|k| (vec![slot.from + 2 * k, slot.from + 2 * k + 1], AXES[k])).collect();
        forms.push(((slot.from..slot.from + slot.count).collect(), &["x", "y", "z"]));
        for (columns, stem) in forms {
            case.library.terms.push(CandidateTerm {
                kind,
                joint: None,
                recording: None,
                signs: vec![ParameterBounds::Any; columns.len()],
                columns,
                form: CoefficientForm::Plain(stem),
                corrects_stated: false,
                settings: vec![("frequency", tone_hz)],
            });
        }
    }
}

/// Sets the limits of the parameters: wear does not decrease below zero, tangential coefficients do not become negative, and sensor errors are at
/// most [`SENSOR_ERROR_MOST`].
pub(super) fn set_parameter_limits(case: &mut Case, stated_wear: f64) {
    let coefficients = case.coefficients();
    let is_of_sensor = |column: usize| {
        let number =
            case.column_parameters[column].first().map_or(PARAMETERS, |(parameter, _)| *parameter);
        let holds = |slot: Slot| (slot.from..slot.from + slot.count).contains(&number);
        [SCALE, ROTATION, CROSS_TALK].into_iter().any(holds)
    };
    let bounds = |column: usize| -> ParameterBounds {
        let tangential = coefficients.iter().find(|(from, _)| *from == column);
        match tangential {
            Some((_, stated)) => ParameterBounds::AtLeast(-stated.x),
            None if column == WEAR.from => ParameterBounds::AtLeast(-stated_wear),
            None if is_of_sensor(column) => {
                ParameterBounds::Within([-SENSOR_ERROR_MOST, SENSOR_ERROR_MOST])
            }
            None => ParameterBounds::Any,
        }
    };
    for family in &mut case.library.terms {
        family.signs = family.columns.iter().map(|column| bounds(*column)).collect();
    }
}

/// Removes parameters without influence on the counted rows and forms that are then duplicates; lists why an effect cannot be shown.
pub(super) fn remove_unobservable(case: &mut Case) {
    let is_there = |column: &usize| {
        let parts = &case.library.columns[*column].parts;
        parts.iter().any(|(axis, values)| {
            case.measured[*axis].is_some()
                && values
                    .iter()
                    .zip(&case.table.counts[*axis])
                    .any(|(x, counts)| *counts && *x != 0.0)
        })
    };
    let is_observable: Vec<bool> = (0..case.library.columns.len()).map(|k| is_there(&k)).collect();
    let mut kept: Vec<CandidateTerm> = Vec::new();
    let has_runout = case.model.cutter.teeth > 1;
    for mut family in std::mem::take(&mut case.library.terms) {
        if family.kind == "runout" && !has_runout {
            continue;
        }
        let signs = std::mem::take(&mut family.signs);
        let pairs = family.columns.iter().copied().zip(signs).filter(|(k, _)| is_observable[*k]);
        (family.columns, family.signs) = pairs.unzip();
        let is_new =
            kept.iter().all(|one| one.kind != family.kind || one.columns != family.columns);
        if !family.columns.is_empty() && is_new {
            kept.push(family);
        }
    }
    let cutter = &case.model.cutter;
    for (kind, _) in KINDS.iter().filter(|(kind, _)| *kind != "chatter") {
        if kept.iter().any(|family| family.kind == *kind) {
            continue;
        }
        let why = match *kind {
            "tool_wear" => "no edge force is stated that could grow",
            "runout" if cutter.turning => "a turning tool does not rotate",
            "runout" => "the tool has one tooth, or no shear coefficient is stated",
            _ => "not observable in the recorded channels",
        };
        case.library.untested.push((kind, None, why));
    }
    case.library.terms = kept;
}
