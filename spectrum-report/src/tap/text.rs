//! Result of an impact test as text.

use report::{TextTable, fixed, pluralise, significant};
use spectrum::modal::{FittedMode, MergedMode};

use super::analysis::{Analysis, Test};
use super::model_file::UpdatedModel;

impl Analysis {
    /// The result as text; its table is at most `width_max` characters wide. `renewed`: the model
    /// with the modes, if requested.
    #[must_use]
    pub fn text(&self, renewed: Option<&UpdatedModel>, width_max: Option<usize>) -> String {
        let mut text = self.test.as_ref().map(hits).unwrap_or_default();
        let [low, high] = self.band_hz.map(|hz| significant(hz, 3));
        let functions = match self.functions.as_slice() {
            [one] => format!("{} of the {}", one.kind().0, one.name),
            several => pluralise(several.len(), "response function"),
        };
        text += &format!("{functions}, {low} to {high} Hz\n");
        if self.modes.is_empty() {
            text += "no mode found\n";
        } else {
            text += &table(self).render(width_max);
        }
        if let Some(renewed) = renewed {
            text += &format!("{}\n", renewed.line(self));
        }
        text
    }
}

fn hits(test: &Test) -> String {
    let (found, used) = (test.tap.hits.len(), test.tap.frf.hits);
    let mut text = format!(
        "{} found, {used} used, each {} s at {} Hz; excitation up to {} Hz (−20 dB)\n",
        pluralise(found, "hit"),
        significant(test.tap.block_s, 3),
        significant(test.hits.rate_hz, 3),
        significant(test.tap.excited_to_hz(20.0), 3)
    );
    for hit in &test.tap.hits {
        if let Some(why) = hit.rejection {
            let (file, t_s) = test.hit_location(hit);
            text += &format!("rejected: {file} at {} s, {why}\n", fixed(t_s, 3));
        }
    }
    let decay = test.tap.windows.decay_per_s;
    if decay > 0.0 {
        text += &format!(
            "exponential window of {} 1/s, since {} % of the response remained at the end; damping corrected for it\n",
            significant(decay, 2),
            significant(100.0 * test.tap.windows.left_at_end, 2)
        );
    }
    text
}

fn table(analysis: &Analysis) -> TextTable {
    let heads =
        ["mode, Hz", "±", "damping, %", "±", "half power, %", "N/µm", "kg", "coherence", ""];
    analysis.modes.iter().fold(TextTable::new(heads), |table, mode| {
        let clearest = analysis.most_accurate(mode);
        let of = |value: &dyn Fn(&FittedMode) -> Option<f64>, digits: usize| {
            clearest.and_then(value).map_or_else(|| "–".to_owned(), |v| significant(v, digits))
        };
        let decimals = decimals(mode.frequency_sigma_hz);
        let percent = decimals_of_damping(mode);
        table.row([
            fixed(mode.frequency_hz, decimals),
            fixed(mode.frequency_sigma_hz, decimals),
            fixed(100.0 * mode.damping, percent),
            fixed(100.0 * mode.damping_sigma, percent),
            of(&|one| one.damping_half_power.map(|d| 100.0 * d), 2),
            of(&|one| Some(1e-6 * one.stiffness_n_per_m()), 3),
            of(&|one| Some(one.mass_kg), 3),
            of(&|one| one.coherence, 2),
            verdict(analysis, mode).to_owned(),
        ])
    })
}

pub(super) fn decimals_of_damping(mode: &MergedMode) -> usize {
    decimals(100.0 * mode.damping_sigma)
}

/// Decimals that show an uncertainty with one or two digits.
pub(super) fn decimals(sigma: f64) -> usize {
    let digits = (1.0 - sigma.max(1e-4).log10()).floor();
    if digits.is_finite() { digits.clamp(0.0, 4.0) as usize } else { 1 }
}

/// Reliability of a mode, in one word.
pub(super) fn verdict(analysis: &Analysis, mode: &MergedMode) -> &'static str {
    match (analysis.is_verified(mode), mode.meets_all_criteria) {
        (true, _) => "verified",
        (false, true) => "unverified",
        (false, false) => "by the fit only",
    }
}
