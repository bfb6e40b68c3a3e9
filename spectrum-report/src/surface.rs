//! Stylus profiles of a surface, separated into waviness and roughness, as JSON (`trued.surface/1`), text and HTML page.
//!
//! [`read`] takes one profile of heights over even steps; a profile with a gap, an uneven step or an unknown unit is rejected, never repaired. [`analyse`] takes
//! the form out, separates waviness from roughness by the Gaussian filter of ISO 16610-21, and gives the parameters of ISO 21920-2 with the lines of the
//! spectrum; every figure states the length it was taken over. Modules in the order in which to read them: `input`, `analysis`, `result`, `text`, `page`.
//!
//! ```no_run
//! use std::fs;
//!
//! use spectrum_report::surface::{Format, Settings, analyse, read};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let profile = read("milled.csv", &Format::default())?;
//! let analysis = analyse(vec![profile], &Settings::default())?;
//! for profile in &analysis.profiles {
//!     let wavelengths_um: Vec<f64> = profile.lines.iter().map(|line| line.wavelength_um()).collect();
//!     println!("{}: Rq {:.3} µm, lines at {wavelengths_um:.0?} µm", profile.name, profile.roughness.rms);
//! }
//! println!("{}", analysis.text(None));
//! fs::write("surface.json", analysis.json()?)?;
//! fs::write("surface.html", analysis.page().render())?;
//! # Ok(())
//! # }
//! ```

mod analysis;
mod input;
mod page;
mod result;
mod text;

pub(crate) use analysis::lines_of;
pub use analysis::{Analysis, ExplainedLine, ProfileAnalysis, Segments, Spectra, analyse};
pub use input::{Format, Profile, read};
pub use result::Report;
use spectrum::surface::{MachiningConditions, SeparationSettings};

/// How profiles are analysed.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Wavelength that separates roughness from waviness, mm; above 0. Default 0.8. Origin: ISO 21920-3.
    pub cut_off_mm: f64,
    /// Shorter wavelengths are removed as noise of the instrument, µm; above 0. Default: none.
    pub short_cut_off_um: Option<f64>,
    /// Degree of the polynomial that is taken out as the form: 0 the mean, 1 a line, 2 an arc. Default 1.
    pub form_degree: u8,
    /// Lengths of the segments for which parameters are also given, mm; above 0. Default 2.5 and 0.25.
    pub segments_mm: Vec<f64>,
    /// The cut, which gives lines their frequency in time and their possible causes. Default: unknown.
    pub machining: MachiningConditions,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            cut_off_mm: 0.8,
            short_cut_off_um: None,
            form_degree: 1,
            segments_mm: vec![2.5, 0.25],
            machining: MachiningConditions::default(),
        }
    }
}

impl Settings {
    fn parting(&self) -> SeparationSettings {
        SeparationSettings {
            form_degree: usize::from(self.form_degree),
            short_cut_off_mm: self.short_cut_off_um.map(|um| 1e-3 * um),
            cut_off_mm: self.cut_off_mm,
        }
    }
}
