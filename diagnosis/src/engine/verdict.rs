//! The verdict of a diagnosis: consistent, missing physics, unknown structure, or undetermined; and which findings are claimed.
//!
//! Computes no fit. Findings that cannot be distinguished from alternatives are not claimed.

/// What a recording says of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing above the noise.
    Consistent,
    /// The findings explain the mismatch.
    MissingPhysics,
    /// There is structure that no known effect explains.
    UnknownStructure,
    /// Candidates alike, or too little to say anything.
    Undetermined,
}

impl Verdict {
    /// As in the contract.
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
    /// Share of what stands above the noise on the test set, as energy, that findings must explain beside unexplained structure; no unit, 0 to 1.
    pub(crate) explained_least: f64,
    /// Share of all gain in log-likelihood that may lie with ambiguous findings; no unit, 0 to 1. Default 0.5: most of what is explained is explained by findings that are clear.
    pub(crate) ambiguous_most: f64,
    /// Gain in log-likelihood of an unambiguous finding beside which ambiguous ones are told as sets; above 0. Default 20: odds of 5e8, whatever else is unclear.
    pub(crate) sure_gain: f64,
    /// Posterior probability from which a finding is claimed; no unit, 0 to 1. Default 0.5: it is likelier than all else (docs/diagnosis.md).
    pub(crate) claimed_least: f64,
}

impl VerdictSettings {
    /// Of positions: 0.999, since what is not explained is a small part of the errors of a whole arm's geometry.
    pub(crate) const POSITION: Self =
        Self { explained_least: 0.999, ambiguous_most: 0.5, sure_gain: 20.0, claimed_least: 0.5 };
    /// Of torques and forces: 0.98, since the band-limited motion leaves about a hundredth of dry friction unexplained where a joint reverses.
    pub(crate) const DRIVE_OR_CUT: Self = Self { explained_least: 0.98, ..Self::POSITION };
}

/// A finding, for the verdict.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weight {
    /// Its gain in log-likelihood.
    pub(crate) gain: f64,
    /// Whether an alternative explains as much.
    pub(crate) is_ambiguous: bool,
}

/// The verdict on `findings` that explain the share `explained` of what stands above the noise on the test set; none: all of it.
pub(crate) fn decide_verdict(
    findings: &[Weight],
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

fn is_clear(findings: &[Weight], settings: &VerdictSettings) -> bool {
    let gains =
        |of: bool| findings.iter().filter(move |one| one.is_ambiguous == of).map(|one| one.gain);
    let (ambiguous, clear): (f64, f64) = (gains(true).sum(), gains(false).sum());
    let surest = gains(false).fold(0.0, f64::max);
    ambiguous <= settings.ambiguous_most * (ambiguous + clear) || surest >= settings.sure_gain
}

/// Findings that are claimed, and those that are too improbable for that. Where nothing is claimed, all stand as sets of what is alike.
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
        let weight = |(gain, is_ambiguous): &(f64, bool)| Weight {
            gain: *gain,
            is_ambiguous: *is_ambiguous,
        };
        let findings: Vec<Weight> = findings.iter().map(weight).collect();
        decide_verdict(&findings, explained, &SETTINGS)
    }

    #[test]
    fn a_finding_is_claimed_from_a_half_on_and_an_undetermined_set_holds_all() {
        let found = vec![0.98, 0.49, 0.5, 0.0];
        let (claims, candidates) =
            claimed(Verdict::MissingPhysics, found.clone(), &SETTINGS, |one| *one);
        assert_eq!((claims, candidates), (vec![0.98, 0.5], vec![0.49, 0.0]));
        let (set, candidates) =
            claimed(Verdict::Undetermined, found.clone(), &SETTINGS, |one| *one);
        assert_eq!((set, candidates), (found, Vec::new()));
    }

    #[test]
    fn what_is_alike_takes_no_claim_from_a_finding_that_is_sure_by_itself() {
        assert_eq!(verdict(&[(400.0, true)], None), Verdict::Undetermined);
        assert_eq!(verdict(&[(400.0, true), (60.0, false)], None), Verdict::MissingPhysics);
        assert_eq!(verdict(&[(400.0, true), (9.0, false)], None), Verdict::Undetermined);
        assert_eq!(verdict(&[(9.0, true), (12.0, false)], None), Verdict::MissingPhysics);
    }

    #[test]
    fn structure_that_findings_leave_is_unknown_unless_it_is_a_small_share() {
        assert_eq!(verdict(&[], None), Verdict::Consistent);
        assert_eq!(verdict(&[], Some(0.0)), Verdict::UnknownStructure);
        assert_eq!(verdict(&[(60.0, false)], Some(0.9)), Verdict::UnknownStructure);
        assert_eq!(verdict(&[(60.0, false)], Some(0.9999)), Verdict::MissingPhysics);
    }
}
