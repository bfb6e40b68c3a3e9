//! The verdict of a diagnosis: consistent, missing physics, unknown structure, or undetermined; and which findings are claimed.
//!
//! Findings that cannot be distinguished from alternatives are not claimed, unless the verdict is undetermined; then they are returned as sets of
//! alternatives. No fit is computed.

/// Conclusion from a recording on a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Residuals are consistent with the noise.
    Consistent,
    /// The findings explain the difference between model and recording.
    MissingPhysics,
    /// A significant part of the difference is explained by no known effect.
    UnknownStructure,
    /// Findings cannot be distinguished from alternatives.
    Undetermined,
}

impl Verdict {
    /// Identifier in results (docs/reference/results.md).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::MissingPhysics => "missing_physics",
            Self::UnknownStructure => "unknown_structure",
            Self::Undetermined => "undetermined",
        }
    }
}

/// Thresholds of the verdict.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VerdictSettings {
    /// Share of the energy above the noise on the test set that findings must explain; below it there is unknown structure. No unit, 0 to 1.
    pub(crate) explained_least: f64,
    /// Largest share of the total gain in log-likelihood that ambiguous findings may have; no unit, 0 to 1. Default 0.5: unambiguous findings explain
    /// at least half.
    pub(crate) ambiguous_most: f64,
    /// An unambiguous finding with this gain in log-likelihood is claimed however much the ambiguous ones explain; above 0. Default 20: odds of 5e8.
    pub(crate) sure_gain: f64,
    /// Posterior probability from which a finding is claimed; no unit, 0 to 1. Default 0.5: more probable than all alternatives together
    /// (docs/diagnosis.md).
    pub(crate) claimed_least: f64,
}

impl VerdictSettings {
    /// For positions: 0.999, since unexplained structure is a small part of the errors of a whole arm's geometry.
    pub(crate) const POSITION: Self =
        Self { explained_least: 0.999, ambiguous_most: 0.5, sure_gain: 20.0, claimed_least: 0.5 };
    /// For torques and forces: 0.98, since the band-limited motion leaves about a hundredth of dry friction unexplained where a joint reverses.
    pub(crate) const DRIVE_OR_CUT: Self = Self { explained_least: 0.98, ..Self::POSITION };
}

/// A finding, for the verdict.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FindingEvidence {
    /// Its gain in log-likelihood.
    pub(crate) gain: f64,
    /// Whether an alternative explains as much.
    pub(crate) is_ambiguous: bool,
}

/// The verdict on `findings` that explain the share `explained` of the energy above the noise on the test set; `None`: all of it.
pub(crate) fn decide_verdict(
    findings: &[FindingEvidence],
    explained: Option<f64>,
    settings: &VerdictSettings,
) -> Verdict {
    match explained {
        None if findings.is_empty() => Verdict::Consistent,
        Some(_) if findings.is_empty() => Verdict::UnknownStructure,
        Some(share) if share < settings.explained_least => Verdict::UnknownStructure,
        _ if is_clear(findings, settings) => Verdict::MissingPhysics,
        _ => Verdict::Undetermined,
    }
}

fn is_clear(findings: &[FindingEvidence], settings: &VerdictSettings) -> bool {
    let gains = |is_ambiguous: bool| {
        findings.iter().filter(move |one| one.is_ambiguous == is_ambiguous).map(|one| one.gain)
    };
    let (ambiguous, clear): (f64, f64) = (gains(true).sum(), gains(false).sum());
    let surest = gains(false).fold(0.0, f64::max);
    ambiguous <= settings.ambiguous_most * (ambiguous + clear) || surest >= settings.sure_gain
}

/// Findings that are claimed, and those with too low a probability. If the verdict is undetermined, all are returned, as sets of alternatives.
pub(crate) fn claimed<T>(
    verdict: Verdict,
    findings: Vec<T>,
    settings: &VerdictSettings,
    probability: impl Fn(&T) -> f64,
) -> (Vec<T>, Vec<T>) {
    let is_claimed =
        |one: &T| verdict == Verdict::Undetermined || probability(one) >= settings.claimed_least;
    findings.into_iter().partition(is_claimed)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: VerdictSettings = VerdictSettings::POSITION;

    fn verdict(findings: &[(f64, bool)], explained: Option<f64>) -> Verdict {
        let weight = |(gain, is_ambiguous): &(f64, bool)| FindingEvidence {
            gain: *gain,
            is_ambiguous: *is_ambiguous,
        };
        let findings: Vec<FindingEvidence> = findings.iter().map(weight).collect();
        decide_verdict(&findings, explained, &SETTINGS)
    }

    #[test]
    fn a_finding_is_claimed_from_a_half_on_and_an_undetermined_set_holds_all() {
        let found = vec![0.98, 0.49, 0.5, 0.0];
        let (claimed_ones, candidates) =
            claimed(Verdict::MissingPhysics, found.clone(), &SETTINGS, |one| *one);
        assert_eq!((claimed_ones, candidates), (vec![0.98, 0.5], vec![0.49, 0.0]));
        let (set, candidates) =
            claimed(Verdict::Undetermined, found.clone(), &SETTINGS, |one| *one);
        assert_eq!((set, candidates), (found, Vec::new()));
    }

    #[test]
    fn ambiguous_findings_do_not_prevent_the_claim_of_one_that_is_certain() {
        assert_eq!(verdict(&[(400.0, true)], None), Verdict::Undetermined);
        assert_eq!(verdict(&[(400.0, true), (60.0, false)], None), Verdict::MissingPhysics);
        assert_eq!(verdict(&[(400.0, true), (9.0, false)], None), Verdict::Undetermined);
        assert_eq!(verdict(&[(9.0, true), (12.0, false)], None), Verdict::MissingPhysics);
    }

    #[test]
    fn structure_that_findings_do_not_explain_is_unknown_unless_its_share_is_small() {
        assert_eq!(verdict(&[], None), Verdict::Consistent);
        assert_eq!(verdict(&[], Some(0.0)), Verdict::UnknownStructure);
        assert_eq!(verdict(&[(60.0, false)], Some(0.9)), Verdict::UnknownStructure);
        assert_eq!(verdict(&[(60.0, false)], Some(0.9999)), Verdict::MissingPhysics);
    }
}
