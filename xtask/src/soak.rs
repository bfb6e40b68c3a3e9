//! Random faults over real processes, for an hour: all properties of `docs/faults.md`, combined and
//! repeated.
//!
//! Not part of CI.

use crate::comparisons::cargo;

/// Builds the cell's programs and runs them; returns whether all properties held.
pub(crate) fn run(arguments: &[&str]) -> Result<bool, String> {
    let [mut minutes, mut seed] = ["60".to_owned(), String::new()];
    let mut rest = arguments.iter();
    while let Some(option) = rest.next() {
        let value = rest.next().ok_or_else(|| format!("{option}: expected a number behind it"))?;
        match *option {
            "--minutes" => minutes = (*value).to_owned(),
            "--seed" => seed = (*value).to_owned(),
            _ => return Err(format!("{option}: expected --minutes N or --seed S")),
        }
    }
    cargo(&["build", "--quiet", "--package", "tests", "--bins"])?;
    let mut soak = vec!["run", "--quiet", "--package", "tests", "--bin", "soak", "--", &minutes];
    soak.extend(Some(seed.as_str()).filter(|seed| !seed.is_empty()));
    cargo(&soak)
}
