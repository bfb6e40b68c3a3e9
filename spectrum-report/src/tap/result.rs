//! Output of an impact test: `trued.tap/1`.

use std::f64::consts::TAU;

use recording::model::ModeChange;
use recording::program;
use serde::Serialize;
use spectrum::frf::Estimator;
use spectrum::modal::{FittedMode, MergedMode};

use super::analysis::{Analysis, Function, Test};
use super::model_file::UpdatedModel;
use crate::error::Error;

/// Result of an impact test: `trued.tap/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
pub struct Report {
    estimator: &'static str,
    least_coherence: f64,
    band_Hz: [f64; 2],
    hits: Option<HitsReport>,
    response_functions: Vec<FunctionReport>,
    modes: Vec<ModeReport>,
    model: Option<ModelReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct HitsReport {
    rate_Hz: f64,
    force_column: String,
    response_column: String,
    used: usize,
    block_s: f64,
    force_window: bool,
    exponential_window_per_s: f64,
    response_left_at_end: f64,
    excited_to_Hz: f64,
    all: Vec<HitReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "N is the unit's name")]
struct HitReport {
    file: String,
    t_s: f64,
    peak_N: f64,
    contact_ms: f64,
    used: bool,
    refused: Option<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct FunctionReport {
    name: String,
    kind: &'static str,
    unit: &'static str,
    frequency_Hz: Vec<f64>,
    re: Vec<f64>,
    im: Vec<f64>,
    coherence: Option<Vec<f64>>,
    modes: Vec<FittedReport>,
    unresolved: Vec<UnresolvedReport>,
}

/// A peak that looks like a mode and that no fit explains.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct UnresolvedReport {
    frequency_Hz: f64,
    beside_Hz: Option<f64>,
    needs_record_s: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct ModeReport {
    frequency_Hz: f64,
    sigma_frequency_Hz: f64,
    damping_ratio: f64,
    sigma_damping_ratio: f64,
    verified: bool,
    three_signs: bool,
    force_dB: Option<f64>,
    direction: Option<[f64; 3]>,
    clearest: Option<FittedReport>,
    seen_in: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz and N are units' names")]
struct FittedReport {
    frequency_Hz: f64,
    sigma_frequency_Hz: f64,
    damping_ratio: f64,
    sigma_damping_ratio: f64,
    damping_ratio_half_power: Option<f64>,
    modal_mass_kg: f64,
    sigma_modal_mass_kg: f64,
    modal_stiffness_N_per_um: f64,
    phase_deg: f64,
    coherence: Option<f64>,
    left_at_next_hit: f64,
    three_signs: bool,
    residual: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct ModelReport {
    out: String,
    replaced: Vec<[f64; 2]>,
    added_Hz: Vec<f64>,
    kept_Hz: Vec<f64>,
}

impl Analysis {
    /// The result as an object. `renewed`: the model with the modes, if requested.
    #[must_use]
    pub fn report(&self, renewed: Option<&UpdatedModel>) -> Report {
        let direction = self.settings.direction;
        Report {
            estimator: match self.settings.estimator {
                Estimator::H1 => "h1",
                Estimator::H2 => "h2",
            },
            least_coherence: self.settings.coherence_least,
            band_Hz: self.band_hz,
            hits: self.test.as_ref().map(HitsReport::of),
            response_functions: self
                .functions
                .iter()
                .map(|one| FunctionReport::of(one, self.band_hz))
                .collect(),
            modes: self.modes.iter().map(|m| ModeReport::of(m, direction, self)).collect(),
            model: renewed.map(|renewed| ModelReport::of(renewed, self)),
            warnings: self.warnings.clone(),
        }
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self, renewed: Option<&UpdatedModel>) -> Result<String, Error> {
        let text = program::json("trued.tap/1", &self.report(renewed)).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

impl HitsReport {
    fn of(test: &Test) -> Self {
        let [force_column, response_column] = test.hits.columns.clone();
        let hit = |hit: &spectrum::tap::DetectedHit| {
            let (file, t_s) = test.hit_location(hit);
            HitReport {
                file: file.to_owned(),
                t_s,
                peak_N: hit.peak_n,
                contact_ms: 1e3 * hit.contact_s,
                used: hit.rejection.is_none(),
                refused: hit.rejection.map(|why| why.to_string()),
            }
        };
        Self {
            rate_Hz: test.hits.rate_hz,
            force_column,
            response_column,
            used: test.tap.frf.hits,
            block_s: test.tap.block_s,
            force_window: test.tap.windows.force,
            exponential_window_per_s: test.tap.windows.decay_per_s,
            response_left_at_end: test.tap.windows.left_at_end,
            excited_to_Hz: test.tap.excited_to_hz(20.0),
            all: test.tap.hits.iter().map(hit).collect(),
        }
    }
}

impl FunctionReport {
    fn of(one: &Function, band_hz: [f64; 2]) -> Self {
        let (kind, unit) = one.kind();
        let of = |value: fn((usize, f64, spectrum::Complex<f64>)) -> f64| {
            one.within(band_hz).map(value).collect::<Vec<f64>>()
        };
        let coherence = one.frf.coherence.as_ref().map(|coherence| {
            one.within(band_hz).filter_map(|(i, ..)| coherence.get(i).copied()).collect()
        });
        Self {
            name: one.name.clone(),
            kind,
            unit,
            frequency_Hz: of(|(_, f, _)| f),
            re: of(|(.., h)| h.re),
            im: of(|(.., h)| h.im),
            coherence,
            modes: one.modes.iter().map(FittedReport::of).collect(),
            unresolved: one
                .unresolved
                .iter()
                .map(|peak| UnresolvedReport {
                    frequency_Hz: peak.frequency_hz,
                    beside_Hz: peak.neighbour_hz,
                    needs_record_s: peak.record_s,
                })
                .collect(),
        }
    }
}

impl ModeReport {
    fn of(mode: &MergedMode, direction: Option<[f64; 3]>, analysis: &Analysis) -> Self {
        let name = |(function, _): &(usize, FittedMode)| {
            analysis.functions.get(*function).map_or_else(String::new, |one| one.name.clone())
        };
        Self {
            frequency_Hz: mode.frequency_hz,
            sigma_frequency_Hz: mode.frequency_sigma_hz,
            damping_ratio: mode.damping,
            sigma_damping_ratio: mode.damping_sigma,
            verified: analysis.is_verified(mode),
            three_signs: mode.meets_all_criteria,
            force_dB: analysis.force_db(mode),
            direction,
            clearest: analysis.most_accurate(mode).map(FittedReport::of),
            seen_in: mode.observations.iter().map(name).collect(),
        }
    }
}

impl FittedReport {
    fn of(mode: &FittedMode) -> Self {
        Self {
            frequency_Hz: mode.frequency_hz,
            sigma_frequency_Hz: mode.frequency_sigma_hz,
            damping_ratio: mode.damping,
            sigma_damping_ratio: mode.damping_sigma,
            damping_ratio_half_power: mode.damping_half_power,
            modal_mass_kg: mode.mass_kg,
            sigma_modal_mass_kg: mode.mass_sigma_kg,
            modal_stiffness_N_per_um: 1e-6 * mode.stiffness_n_per_m(),
            phase_deg: mode.phase_rad * 360.0 / TAU,
            coherence: mode.coherence,
            left_at_next_hit: mode.carry_over,
            three_signs: mode.meets_all_criteria,
            residual: mode.residual,
        }
    }
}

impl ModelReport {
    fn of(renewed: &UpdatedModel, analysis: &Analysis) -> Self {
        let pairs = || analysis.modes.iter().zip(&renewed.changes);
        let replaced = pairs().filter_map(|(mode, change)| match change {
            ModeChange::Replaced(before) => Some([before.frequency_hz, mode.frequency_hz]),
            ModeChange::Added => None,
        });
        let added = pairs().filter(|(_, change)| matches!(change, ModeChange::Added));
        Self {
            out: renewed.path.display().to_string(),
            replaced: replaced.collect(),
            added_Hz: added.map(|(mode, _)| mode.frequency_hz).collect(),
            kept_Hz: renewed.kept_hz.clone(),
        }
    }
}
