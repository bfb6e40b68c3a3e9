//! From hits or response functions to modes, with warnings.

use report::{fixed, pluralise, significant};
use spectrum::Complex;
use spectrum::frf::{COHERENCE_HITS, Estimator, Frf, Response};
use spectrum::modal::{
    FittedMode, MeasuredReceptance, MergedMode, UnresolvedPeak, identify_modes, merge_modes,
    unresolved_peaks,
};
use spectrum::tap::{DetectedHit, TapConfig, TapRecord, evaluate_tap_test};

use super::Settings;
use super::input::{Content, Hits, Source};
use crate::error::Error;

/// Modes of an impact test, with their sources.
pub struct Analysis {
    /// The hits, if records were given.
    pub test: Option<Test>,
    /// The response functions: one of all hits, or those given.
    pub functions: Vec<Function>,
    /// Their modes in one list.
    pub modes: Vec<MergedMode>,
    /// Modes were searched between these frequencies, Hz.
    pub band_hz: [f64; 2],
    /// Warnings, as text.
    pub warnings: Vec<String>,
    pub(super) files: Vec<String>,
    pub(super) settings: Settings,
}

/// The hits and their evaluation.
pub struct Test {
    /// The records.
    pub hits: Hits,
    /// Hits found in them, and their mean response function.
    pub tap: spectrum::tap::TapTest,
}

/// A response function with its modes.
pub struct Function {
    /// What it is called.
    pub name: String,
    /// Its values.
    pub frf: Frf,
    /// Which noise averages out.
    pub estimator: Estimator,
    /// Modes that were fitted to it.
    pub modes: Vec<FittedMode>,
    /// Peaks that look like modes and that no fit explains.
    pub unresolved: Vec<UnresolvedPeak>,
    between_hits_s: Option<f64>,
}

/// Finds the hits of an impact test, estimates the response function and fits its modes.
///
/// # Errors
/// [`Error::Input`] where no hit can be used.
pub fn analyse(source: Source, settings: &Settings) -> Result<Analysis, Error> {
    let Source { files, content, .. } = source;
    let settings = *settings;
    let function = |name: String, frf: Frf| Function {
        name,
        frf,
        estimator: settings.estimator,
        modes: Vec::new(),
        unresolved: Vec::new(),
        between_hits_s: None,
    };
    let (test, mut functions) = match content {
        Content::Functions(given) => {
            (None, given.into_iter().map(|one| function(one.name, one.frf)).collect())
        }
        Content::Hits(hits) => {
            let test = Test::of(&settings, hits)?;
            let name = format!("mean of {}", pluralise(test.tap.frf.hits, "hit"));
            let frf = test.tap.frf.clone();
            let between_hits_s = test.tap.min_hit_interval_s();
            (Some(test), vec![Function { between_hits_s, ..function(name, frf) }])
        }
    };
    let band_hz = settings.band_hz.unwrap_or_else(|| band_hz(&settings, test.as_ref(), &functions));
    for one in &mut functions {
        one.identify_modes(band_hz, settings.coherence_least);
    }
    let lists: Vec<Vec<FittedMode>> = functions.iter().map(|one| one.modes.clone()).collect();
    let modes = merge_modes(&lists);
    let warnings = Vec::new();
    let mut analysis = Analysis { test, functions, modes, band_hz, warnings, files, settings };
    analysis.warnings = analysis.warnings();
    Ok(analysis)
}

impl Analysis {
    /// Whether a mode shows the three signs, coherence among them.
    #[must_use]
    pub fn is_verified(&self, mode: &MergedMode) -> bool {
        let coherent =
            |one: &FittedMode| one.coherence.is_some_and(|c| c >= self.settings.coherence_least);
        mode.observations.iter().any(|(_, one)| one.meets_all_criteria && coherent(one))
    }

    /// The function that shows a mode most clearly.
    #[must_use]
    pub fn most_accurate<'a>(&self, mode: &'a MergedMode) -> Option<&'a FittedMode> {
        let sigma = |observation: &&(usize, FittedMode)| observation.1.frequency_sigma_hz;
        let best = mode.observations.iter().min_by(|a, b| sigma(a).total_cmp(&sigma(b)));
        best.map(|(_, one)| one)
    }

    /// The force at a mode against its strongest, dB.
    #[must_use]
    pub fn force_db(&self, mode: &MergedMode) -> Option<f64> {
        self.test.as_ref().map(|test| test.tap.force_db(mode.frequency_hz))
    }

    fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        match &self.test {
            Some(test) => {
                let used = test.tap.frf.hits;
                if used < COHERENCE_HITS {
                    warnings.push(format!(
                        "{} used: the coherence of fewer than {COHERENCE_HITS} is meaningless (of one it is 1 by construction), \
                         so the modes are unverified; record at least {COHERENCE_HITS}",
                        pluralise(used, "hit")
                    ));
                }
                warnings.extend(test.hits.notes.iter().cloned());
            }
            None => warnings.push(
                "coherence of response functions is not read, so the modes are unverified"
                    .to_owned(),
            ),
        }
        warnings.extend(self.modes.iter().flat_map(|mode| self.reservations(mode)));
        warnings.extend(
            self.functions.iter().flat_map(|one| one.unresolved_warnings(self.settings.misfit)),
        );
        warnings
    }

    /// Warnings about one mode.
    fn reservations(&self, mode: &MergedMode) -> Vec<String> {
        let mut reservations = Vec::new();
        let mode_name = format!("mode at {} Hz", fixed(mode.frequency_hz, 1));
        if let Some(db) = self.force_db(mode).filter(|db| *db < self.settings.weak_db) {
            reservations.push(format!(
                "{mode_name}: weakly excited; the force there is {db:.0} dB relative to its maximum"
            ));
        }
        if !mode.meets_all_criteria {
            reservations.push(format!(
                "{mode_name}: found only by the fit, within the peak of its neighbour"
            ));
        }
        let Some(one) = self.most_accurate(mode) else { return reservations };
        if let Some(half_power) = one.damping_half_power {
            let apart = (half_power - one.damping).abs();
            if apart > self.settings.damping_disagrees * one.damping + 2.0 * one.damping_sigma {
                reservations.push(format!(
                    "{mode_name}: damping is {} % by the fit but {} % by the half-power width; check its peak",
                    significant(100.0 * one.damping, 2),
                    significant(100.0 * half_power, 2)
                ));
            }
        }
        if one.carry_over > self.settings.carried_most {
            reservations.push(format!(
                "{mode_name}: {} % of the vibration remains at the next hit, and its modal mass and stiffness are uncertain by as much; wait {} s \
                 between hits",
                significant(100.0 * one.carry_over, 2),
                significant(one.ring_down_s(self.settings.rung_down), 2)
            ));
        }
        reservations
    }
}

impl Test {
    fn of(settings: &Settings, hits: Hits) -> Result<Self, Error> {
        let config = TapConfig {
            rate_hz: hits.rate_hz,
            response: hits.response,
            block_s: settings.block_s,
            windows: settings.windows,
        };
        let records: Vec<TapRecord<'_>> = hits
            .records
            .iter()
            .map(|record| TapRecord { force: &record.force, response: &record.response })
            .collect();
        let tap = evaluate_tap_test(&records, &config).map_err(|error| {
            let files: Vec<&str> = hits.records.iter().map(|record| record.file.as_str()).collect();
            Error::input(format!("{}: {error}", files.join(", ")))
        })?;
        Ok(Self { hits, tap })
    }

    /// File and time of a hit, s.
    #[must_use]
    pub fn hit_location(&self, hit: &DetectedHit) -> (&str, f64) {
        let record = self.hits.records.get(hit.record);
        let start_s = record.map_or(0.0, |record| record.start_s);
        let file = record.map_or("", |record| record.file.as_str());
        (file, start_s + hit.at as f64 / self.hits.rate_hz)
    }
}

impl Function {
    fn identify_modes(&mut self, band_hz: [f64; 2], least_coherence: f64) {
        let receptance = self.frf.per_force(self.estimator, Response::Displacement);
        let measured = MeasuredReceptance {
            frequency_hz: &self.frf.frequency_hz,
            receptance: &receptance,
            coherence: self.frf.coherence.as_deref(),
            window_decay_per_s: self.frf.window_decay_per_s,
            hit_interval_s: self.between_hits_s,
        };
        let found = identify_modes(&measured, band_hz, least_coherence);
        self.unresolved = unresolved_peaks(&measured, band_hz, least_coherence, &found);
        self.modes = found;
    }

    /// Modes that it may hide, as text.
    fn unresolved_warnings(&self, misfit: f64) -> Vec<String> {
        let (bin_hz, record_s) = (self.bin_hz(), 1.0 / self.bin_hz());
        let longer = |s: f64| match self.between_hits_s {
            Some(_) => format!("wait at least {} s between hits", significant(s, 2)),
            None => format!("record at least {} s per hit", significant(s, 2)),
        };
        let mut warnings = Vec::new();
        for one in &self.unresolved {
            let beside = one.neighbour_hz.map_or_else(String::new, |hz| {
                format!(", {} Hz from another,", significant((hz - one.frequency_hz).abs(), 2))
            });
            warnings.push(format!(
                "{}: the peak at {} Hz{beside} is not resolved with a bin width of {} Hz and is not listed as a mode: {}",
                self.name,
                fixed(one.frequency_hz, 1),
                significant(bin_hz, 2),
                longer(one.record_s)
            ));
        }
        for one in self.modes.iter().filter(|one| one.residual > misfit) {
            warnings.push(format!(
                "{}: one mode at {} Hz fits its peak only to {} %: noise, or two modes that records of {} s do not separate; record \
                 more hits, and {}",
                self.name,
                fixed(one.frequency_hz, 1),
                significant(100.0 * one.residual, 2),
                significant(record_s, 2),
                longer(2.0 * record_s)
            ));
        }
        warnings
    }

    /// Width of its bins, Hz.
    fn bin_hz(&self) -> f64 {
        match self.frf.frequency_hz.as_slice() {
            [first, second, ..] => second - first,
            _ => 0.0,
        }
    }

    /// Frequency and value as measured, within a band.
    pub fn within(
        &self,
        band_hz: [f64; 2],
    ) -> impl Iterator<Item = (usize, f64, Complex<f64>)> + '_ {
        let all = self.frf.frequency_hz.iter().zip(self.frf.h(self.estimator)).enumerate();
        let inside = move |f: f64| (band_hz[0]..=band_hz[1]).contains(&f);
        all.map(|(i, (f, h))| (i, *f, *h)).filter(move |(_, f, _)| inside(*f))
    }

    /// What the function is called and its unit.
    #[must_use]
    pub fn kind(&self) -> (&'static str, &'static str) {
        match self.frf.response {
            Response::Displacement => ("receptance", "m/N"),
            Response::Velocity => ("mobility", "m/sN"),
            Response::Acceleration => ("accelerance", "m/s²N"),
        }
    }
}

/// From a few bins on, as far as the hammer excites, or as the functions reach.
fn band_hz(settings: &Settings, test: Option<&Test>, functions: &[Function]) -> [f64; 2] {
    let starts =
        functions.iter().filter_map(|one| one.frf.frequency_hz.get(settings.bins_below).copied());
    let ends = functions.iter().filter_map(|one| one.frf.frequency_hz.last().copied());
    let low = starts.fold(f64::INFINITY, f64::min);
    let high = match test {
        Some(test) => test.tap.excited_to_hz(settings.excited_db),
        None => ends.fold(0.0, f64::max),
    };
    [if low.is_finite() { low } else { 0.0 }, high]
}
