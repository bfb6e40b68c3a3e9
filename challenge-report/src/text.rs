//! The score as text: each figure with its number of cases.

use challenge::score::{Bin, ChallengeStatistics};
use report::TextTable;

use crate::ScoredChallenge;

impl ScoredChallenge {
    /// The score as text, its table at most `width_max` characters wide.
    #[must_use]
    pub fn text(&self, width_max: Option<usize>) -> String {
        let rows = rows(&self.figures);
        let table = rows
            .into_iter()
            .fold(TextTable::new(["", "figure", "of cases"]), |table, (what, figure, cases)| {
                table.row([what, figure, cases.to_string()])
            });
        let mut text = format!("\n{}", table.render(width_max));
        let unanswered = self.figures.unanswered;
        if unanswered > 0 {
            text += &format!(
                "{} without an answer; each counts as wrong\n",
                report::pluralise(unanswered, "case")
            );
        }
        text
    }
}

/// Each figure's name, its value, and the number of cases (claims, parameters) it is based on.
pub(crate) fn rows(f: &ChallengeStatistics) -> Vec<(String, String, usize)> {
    let mut rows = vec![("first answer right".to_owned(), share(f.first_right), f.counting)];
    for bin in &f.first_right_at_z {
        rows.push((
            format!("  where z is at least {}", bin.from),
            share(bin.first_right),
            bin.cases,
        ));
    }
    let nulls = format!("{} of {}", f.false_findings, f.nulls);
    let claim_count = f.calibration.iter().map(|bin| bin.claims).sum();
    for (what, figure, cases) in [
        ("truth among the first three", share(f.first_three_right), f.counting),
        ("joint right, given the effect", share(f.joint_right), f.counting),
        ("several effects, each named", share(f.all_named), f.counting),
        ("false findings on nulls", nulls, f.nulls),
        ("wrong names among names", share(f.named_wrong), f.named),
        ("unknown physics called unknown", share(f.unknown_recognised), f.unknown),
        ("  covariates named right", share(f.depends_on_right), f.unknown),
        ("alike and said to be so", share(f.undetermined_recognised), f.undetermined),
        ("95 % intervals hold, all", share(f.coverage95), f.counting),
        ("  where the effect was found", share(f.coverage95_found), f.intervals),
        ("share of the oracle's gain, median", number(f.gain_vs_oracle_median), f.counting),
        ("  worst tenth", number(f.gain_vs_oracle_p10), f.counting),
        ("confidence off by", share(f.calibration_error), claim_count),
        ("solver's time, median (s)", number(f.seconds_median), f.cases),
    ] {
        rows.push((what.to_owned(), figure, cases));
    }
    rows
}

/// `92.1 %`, or `–` for none.
pub(crate) fn share(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{:.1} %", 100.0 * value))
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3}"))
}

/// `0.4 to 0.8`, `160 and more`.
pub(crate) fn range(bin: &Bin) -> String {
    match bin.to {
        Some(to) => format!("{} to {to}", bin.from),
        None => format!("{} and more", bin.from),
    }
}
