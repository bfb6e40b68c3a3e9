//! `docs/evidence.md` and its plots, made from real recordings and the blind challenge: what was
//! concealed, what the program reported, the error before and after, the reference figure, and
//! where the program is worse, gives no answer or is wrong.
//!
//! The program runs as its users run it, in a separate process, and its files are read back; every
//! sentence about a run is generated from that run by rule; the same data, program and seed give
//! the same bytes. The data are not changed.
//!
//! Read in this order: `sets` (what is run), `set_runner` (how), `case` (evaluation of a result),
//! `page` (the document).

mod case;
mod csv_table;
mod diagnosis_result;
mod distance;
mod page;
mod set_runner;
mod sets;

use std::fs;
use std::path::PathBuf;

use page::Section;
use set_runner::SetRunner;

/// Inputs of the document.
#[derive(Debug, Clone)]
pub struct EvidenceSettings {
    /// The program under test, built.
    pub program: PathBuf,
    /// The folder of recordings, one folder in it for each set.
    pub data: PathBuf,
    /// Output folder of `evidence.md` and `evidence/`.
    pub out: PathBuf,
    /// Folder of runs and their results; a run whose program, arguments and inputs are unchanged is
    /// not repeated.
    pub work: PathBuf,
    /// The only set to run; for the others stored results are used.
    pub only: Option<String>,
    /// Number of blind cases per domain; `None`: the challenge is not run.
    pub challenge: Option<u32>,
    /// Time limit of one run, s.
    pub limit_s: f64,
}

/// The names of all sets, in the order of the document.
#[must_use]
pub fn set_names() -> Vec<&'static str> {
    sets::SETS.iter().map(|set| set.name).collect()
}

/// Runs everything required and writes the document; returns whether every limit is met.
///
/// # Errors
/// An unknown set; a folder that cannot be read or written; a program that cannot be started.
pub fn generate(settings: &EvidenceSettings) -> Result<bool, String> {
    if let Some(only) = &settings.only
        && !set_names().contains(&only.as_str())
    {
        return Err(format!("{only}: no such set; expected one of {}", set_names().join(", ")));
    }
    let plots = settings.out.join("evidence");
    fs::create_dir_all(&plots).map_err(|why| format!("{}: {why}", plots.display()))?;
    let mut sections = Vec::new();
    for set in sets::SETS {
        let bench = SetRunner::new(settings, set.name)?;
        let missing = bench.missing_files(set.files);
        let cases = if missing.is_empty() { (set.run)(&bench)? } else { Vec::new() };
        let figure = bench.figure();
        if let Some(figure) = &figure {
            let path = plots.join(format!("{}.svg", set.name));
            fs::write(&path, figure.drawing.file())
                .map_err(|why| format!("{}: {why}", path.display()))?;
        }
        let caption = figure.map(|figure| figure.caption);
        sections.push(Section { set, missing, cases, caption });
    }
    let path = settings.out.join("evidence.md");
    fs::write(&path, page::render(&sections))
        .map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(sections.iter().flat_map(|section| &section.cases).all(case::Case::is_met))
}
