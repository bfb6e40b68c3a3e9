//! The lines to be matched: given, from profiles, or from a recording over its path.

use super::Gears;
use crate::commands::spectrum::Spectrum;
use crate::commands::surface::profile_lines;
use crate::exit::Failure;

/// A line over the path.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// The source of the line.
    pub(super) source: String,
    pub(super) cycles_per_mm: f64,
    /// How far it may be from where it reads, as a part.
    pub(super) uncertainty: f64,
    /// With its unit; `None` if the line was given.
    pub(super) amplitude: Option<(f64, String)>,
}

/// All lines, with remarks on them.
pub(super) struct Lines {
    pub(super) lines: Vec<Line>,
    pub(super) notes: Vec<String>,
}

pub(super) fn given(asked: &Gears) -> Result<Lines, Failure> {
    let told = asked.lines.iter().map(|cycles_per_mm| Line {
        source: "given".to_owned(),
        cycles_per_mm: *cycles_per_mm,
        uncertainty: 0.0,
        amplitude: None,
    });
    let mut all = Lines { lines: told.collect(), notes: Vec::new() };
    for path in &asked.profile {
        let (length_mm, lines) = profile_lines(&asked.heights, path)?;
        let source = path.display().to_string();
        if lines.is_empty() {
            all.notes.push(format!("{source}: no line stands over its surroundings"));
        }
        all.lines.extend(lines.iter().map(|line| Line {
            source: source.clone(),
            cycles_per_mm: line.cycles_per_mm,
            uncertainty: line.tolerance(length_mm) / line.cycles_per_mm,
            amplitude: Some((line.amplitude, "µm".to_owned())),
        }));
    }
    if let Some(path) = &asked.force {
        recorded(asked, path, &mut all)?;
    }
    Ok(all)
}

fn recorded(asked: &Gears, path: &std::path::Path, all: &mut Lines) -> Result<(), Failure> {
    let file = path.display().to_string();
    let model = asked.reading.model.as_deref();
    let lines = match Spectrum::lines_over_path(path, model, &asked.signal)? {
        Ok(lines) => lines,
        Err(missing) => return Err(Failure::input(format!("{file}: {missing}"))),
    };
    if lines.is_empty() {
        all.notes.push(format!("{file}: no line over the path stands over its surroundings"));
    } else if lines.iter().any(|line| line.one_feed) {
        all.notes.push(format!(
            "{file}: at one feed alone a line over the path may as well be a line in time"
        ));
    }
    all.lines.extend(lines.into_iter().map(|found| Line {
        source: format!("{file}, {}", found.channel),
        cycles_per_mm: found.line.frequency,
        uncertainty: 0.5 * found.step_per_mm / found.line.frequency,
        amplitude: Some((found.line.amplitude, found.unit)),
    }));
    Ok(())
}
