//! A cut with its modes: entered by hand, and from tap tests.

use std::path::{Path, PathBuf};

use recording::cut::{CutFile, CutMode};
use report::fixed;
use serde::Deserialize;

use crate::error::Error;

/// Two taps show the same mode if its frequencies differ by less than this many standard
/// uncertainties.
const SAME_SIGMAS: f64 = 3.0;

/// A cut with its modes.
#[derive(Debug)]
pub struct Cut {
    /// Path of its file.
    pub path: PathBuf,
    /// Its file.
    pub file: CutFile,
    /// Modes at the tip of the tool.
    pub modes: Vec<SourcedMode>,
    /// Warnings, as text.
    pub warnings: Vec<String>,
}

/// A mode and its source.
#[derive(Clone, Debug)]
pub struct SourcedMode {
    /// The mode.
    pub mode: CutMode,
    /// The result of the tap test. Default: none, if it was entered by hand.
    pub tap: Option<PathBuf>,
    sigma_hz: f64,
}

/// Modes, and warnings about them.
#[derive(Debug, Default)]
struct Modes {
    all: Vec<SourcedMode>,
    warnings: Vec<String>,
}

/// What is needed of a result of `trued tap`.
#[derive(Deserialize)]
struct Tap {
    schema: String,
    modes: Vec<TapMode>,
}

#[derive(Deserialize)]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct TapMode {
    frequency_Hz: f64,
    sigma_frequency_Hz: f64,
    damping_ratio: f64,
    verified: bool,
    direction: Option<[f64; 3]>,
    clearest: Option<BestFit>,
}

#[derive(Deserialize)]
#[expect(non_snake_case, reason = "N is the unit's name")]
struct BestFit {
    modal_stiffness_N_per_um: f64,
}

/// A tap test from which no modes can be taken.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", file.display())]
struct InvalidTapTest {
    file: PathBuf,
    what: String,
}

/// Reads a cut, with the results of the tap tests that its file names, relative to its folder.
///
/// # Errors
/// [`Error::File`] if the cut cannot be read; [`Error::Input`] if a tap test cannot be read or one of its
/// modes cannot be used, or if there is no mode.
pub fn read(path: impl AsRef<Path>) -> Result<Cut, Error> {
    let path = path.as_ref();
    let file = CutFile::read(path)?;
    let Modes { all, warnings } = modes(path, &file)?;
    Ok(Cut { path: path.to_owned(), file, modes: all, warnings })
}

fn modes(path: &Path, file: &CutFile) -> Result<Modes, Error> {
    let entered =
        file.modes.iter().map(|mode| SourcedMode { mode: *mode, tap: None, sigma_hz: 0.0 });
    let mut modes = Modes { all: entered.collect(), warnings: Vec::new() };
    for tap in &file.taps {
        let tap = path.parent().unwrap_or(Path::new("")).join(tap);
        let unfit = |what: String| Error::input(InvalidTapTest { file: tap.clone(), what });
        let text = std::fs::read_to_string(&tap).map_err(|error| {
            unfit(format!("cannot be read: {error}; expected what `trued tap --json` wrote"))
        })?;
        modes.add(&tap, &text).map_err(unfit)?;
    }
    if modes.all.is_empty() {
        return Err(Error::input(format!("{}: its tap tests contain no mode", path.display())));
    }
    modes.warn_of_duplicate_modes();
    Ok(modes)
}

impl Modes {
    fn add(&mut self, tap: &Path, text: &str) -> Result<(), String> {
        let found: Tap = serde_json::from_str(text)
            .map_err(|error| format!("is no result of a tap test: {error}"))?;
        if found.schema != "trued.tap/1" {
            return Err(format!("is of schema {}, expected trued.tap/1", found.schema));
        }
        for mode in found.modes {
            let mode_name = format!("{} Hz", fixed(mode.frequency_Hz, 1));
            let direction = mode.direction.ok_or_else(|| {
                format!(
                    "its mode at {mode_name} has no direction; run trued tap with --direction X,Y,Z"
                )
            })?;
            let stiffness = mode.clearest.ok_or_else(|| {
                format!("its mode at {mode_name} has no modal stiffness; run trued tap anew")
            })?;
            if !mode.verified {
                self.warnings
                    .push(format!("{}: the mode at {mode_name} is unverified", tap.display()));
            }
            self.all.push(SourcedMode {
                mode: CutMode {
                    frequency_hz: mode.frequency_Hz,
                    damping_ratio: mode.damping_ratio,
                    stiffness_n_per_m: 1e6 * stiffness.modal_stiffness_N_per_um,
                    direction,
                },
                tap: Some(tap.to_owned()),
                sigma_hz: mode.sigma_frequency_Hz,
            });
        }
        Ok(())
    }

    /// One mode in an oblique direction appears in the taps along both axes, and would count twice.
    fn warn_of_duplicate_modes(&mut self) {
        let taps = || self.all.iter().filter(|one| one.tap.is_some());
        let mut warnings = Vec::new();
        for (k, a) in taps().enumerate() {
            for b in taps().skip(k + 1).filter(|b| b.tap != a.tap) {
                let apart = (a.mode.frequency_hz - b.mode.frequency_hz).abs();
                if apart < SAME_SIGMAS * a.sigma_hz.hypot(b.sigma_hz) {
                    warnings.push(format!(
                        "the modes at {} and {} Hz of two tap tests may be one mode with an oblique direction; treated as two. Tap along its direction",
                        fixed(a.mode.frequency_hz, 1),
                        fixed(b.mode.frequency_hz, 1)
                    ));
                }
            }
        }
        self.warnings.extend(warnings);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tap(hz: f64, direction: &str, verified: bool) -> String {
        format!(
            r#"{{"schema": "trued.tap/1", "modes": [{{"frequency_Hz": {hz}, "sigma_frequency_Hz": 0.2, "damping_ratio": 0.02,
            "verified": {verified}, "direction": {direction}, "clearest": {{"modal_stiffness_N_per_um": 2.5}}, "more": 1}}]}}"#
        )
    }

    fn of(taps: &[(&str, String)]) -> Result<Modes, String> {
        let mut modes = Modes::default();
        for (name, text) in taps {
            modes.add(Path::new(name), text)?;
        }
        modes.warn_of_duplicate_modes();
        Ok(modes)
    }

    #[test]
    fn a_mode_of_a_tap_test_comes_with_its_stiffness_and_direction() {
        let modes = of(&[("x.json", tap(67.0, "[1,0,0]", true))]).unwrap();
        let mode = modes.all[0].mode;
        assert_eq!((mode.stiffness_n_per_m, mode.direction), (2.5e6, [1.0, 0.0, 0.0]));
        assert!(modes.warnings.is_empty());
    }

    #[test]
    fn a_mode_without_direction_and_another_schema_are_refused() {
        let message = of(&[("x.json", tap(67.0, "null", true))]).unwrap_err();
        assert!(message.contains("--direction"), "{message}");
        let other = tap(67.0, "null", true).replace("tap/1", "spectrum/1");
        assert!(of(&[("x.json", other)]).unwrap_err().contains("expected trued.tap/1"));
        assert!(of(&[("x.json", "{}".to_owned())]).is_err());
    }

    #[test]
    fn one_frequency_in_two_taps_is_reported() {
        let two =
            |hz| [("x.json", tap(67.0, "[1,0,0]", true)), ("y.json", tap(hz, "[0,1,0]", true))];
        assert!(of(&two(67.3)).unwrap().warnings[0].contains("may be one"));
        assert!(of(&two(69.0)).unwrap().warnings.is_empty());
    }
}
