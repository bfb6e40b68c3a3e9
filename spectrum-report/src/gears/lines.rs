//! The lines to be matched: given, from profiles, or from recordings over their path.

use crate::error::Error;
use crate::surface::{Profile, lines_of};
use crate::vibration::{Source, lines_over_path};

/// A line over the path.
#[derive(Clone, Debug)]
pub struct Line {
    /// The source of the line, as text.
    pub source: String,
    /// Cycles per mm of path.
    pub cycles_per_mm: f64,
    /// Uncertainty of its frequency, relative to it; no unit.
    pub uncertainty: f64,
    /// Amplitude with its unit; `None` if the line was given.
    pub amplitude: Option<(f64, String)>,
}

/// All lines, with remarks on them.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    /// The lines.
    pub lines: Vec<Line>,
    /// Remarks, as text.
    pub notes: Vec<String>,
}

impl Lines {
    /// Lines that are given, cycles per mm; above 0.
    #[must_use]
    pub fn given(cycles_per_mm: &[f64]) -> Self {
        let line = |cycles_per_mm: &f64| Line {
            source: "given".to_owned(),
            cycles_per_mm: *cycles_per_mm,
            uncertainty: 0.0,
            amplitude: None,
        };
        Self { lines: cycles_per_mm.iter().map(line).collect(), notes: Vec::new() }
    }

    /// Adds the lines of a stylus profile.
    ///
    /// # Errors
    /// [`Error::Input`] if the profile is too short, or contains a value that is not finite.
    pub fn add_profile(&mut self, profile: &Profile) -> Result<(), Error> {
        let found = lines_of(profile)?;
        let source = profile.file.display().to_string();
        if found.lines.is_empty() {
            self.notes.push(format!("{source}: no line exceeds the floor of its spectrum"));
        }
        self.lines.extend(found.lines.iter().map(|line| Line {
            source: source.clone(),
            cycles_per_mm: line.cycles_per_mm,
            uncertainty: line.tolerance(found.length_mm) / line.cycles_per_mm,
            amplitude: Some((line.amplitude, "µm".to_owned())),
        }));
        Ok(())
    }

    /// Adds the lines of a recording over its path.
    ///
    /// # Errors
    /// [`Error::Input`] if the path is unknown or too short.
    pub fn add_recording(&mut self, recording: &Source) -> Result<(), Error> {
        let file = recording.file.display().to_string();
        let lines = lines_over_path(recording)?;
        if lines.is_empty() {
            self.notes
                .push(format!("{file}: no line over the path exceeds the floor of its spectrum"));
        } else if lines.iter().any(|line| line.one_feed) {
            self.notes.push(format!(
                "{file}: at a single feed, a line over the path cannot be distinguished from a line in time"
            ));
        }
        self.lines.extend(lines.into_iter().map(|found| Line {
            source: format!("{file}, {}", found.channel),
            cycles_per_mm: found.line.frequency,
            uncertainty: 0.5 * found.step_per_mm / found.line.frequency,
            amplitude: Some((found.line.amplitude, found.unit)),
        }));
        Ok(())
    }
}
