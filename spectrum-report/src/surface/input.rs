//! Profiles from files: one channel of heights over even steps, µm.

use std::path::{Path, PathBuf};

use recording::unit::Quantity;
use recording::waves::{self, Grid, Options, Record};

use crate::error::Error;

/// How the table of a profile is read.
#[derive(Clone, Debug, Default)]
pub struct Format {
    /// The column of the heights, by name or by number from 1. Default: none, if there is only one.
    pub column: Option<String>,
    /// Distance between two points, µm; above 0. Default: from the column of positions.
    pub spacing_um: Option<f64>,
    /// Length of one unit of heights whose column names no unit, µm; above 0. Default: none, which
    /// rejects such heights.
    pub unit_um: Option<f64>,
}

/// A profile: heights over even steps.
#[derive(Clone, Debug)]
pub struct Profile {
    /// Its file.
    pub file: PathBuf,
    /// Name of the column of heights.
    pub column: String,
    /// Distance between two points, mm.
    pub spacing_mm: f64,
    /// Heights, µm.
    pub heights_um: Vec<f64>,
    /// Remarks on the file, as text.
    pub notes: Vec<String>,
}

/// A file without a usable profile.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", file.display())]
struct InvalidProfile {
    file: PathBuf,
    what: String,
}

/// Reads a profile.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Input`] if it holds no profile, several, or one with
/// gaps, or if the unit of its heights is unknown.
pub fn read(path: impl AsRef<Path>, format: &Format) -> Result<Profile, Error> {
    let path = path.as_ref();
    let options = Options {
        step_mm: format.spacing_um.map(|um| 1e-3 * um),
        columns: format.column.iter().cloned().collect(),
        ..Options::default()
    };
    // A pipe can be read only once.
    if format.spacing_um.is_some() && path.is_file() {
        refuse_second_spacing(path, &options)?;
    }
    let waves = waves::read(path, &options)?;
    let unfit = |what: String| Error::input(InvalidProfile { file: path.to_owned(), what });
    let record = match waves.records.as_slice() {
        [record] => record,
        records => {
            let pieces = records.len();
            return Err(unfit(format!(
                "consists of {pieces} pieces with gaps; expected one evenly spaced profile: cut it, or fill the gaps"
            )));
        }
    };
    let Grid::Length { step_mm, .. } = record.grid else {
        return Err(unfit(
            "no column holds the position along the profile; name it x_um or x_mm, or give --spacing-um".to_owned(),
        ));
    };
    let (column, heights_um) = heights(format, record).map_err(unfit)?;
    Ok(Profile {
        file: path.to_owned(),
        column,
        spacing_mm: step_mm,
        heights_um,
        notes: waves.notes,
    })
}

/// A spacing is for heights alone: beside a column of positions one of the two would not count.
fn refuse_second_spacing(path: &Path, options: &Options) -> Result<(), Error> {
    let of_file = waves::read(path, &Options { step_mm: None, ..options.clone() });
    let grid = of_file.ok().and_then(|waves| Some(waves.records.first()?.grid));
    let Some(Grid::Length { step_mm, .. }) = grid else { return Ok(()) };
    let what = format!(
        "a column states the positions, {} µm apart: leave out --spacing-um, or remove the column",
        report::significant(1e3 * step_mm, 4)
    );
    Err(Error::input(InvalidProfile { file: path.to_owned(), what }))
}

fn heights(format: &Format, record: &Record) -> Result<(String, Vec<f64>), String> {
    let names = || record.channels.iter().map(|wave| wave.name.as_str()).collect::<Vec<_>>();
    let [wave] = record.channels.as_slice() else {
        return Err(format!(
            "several columns may be the heights: {}; choose one with --column",
            names().join(", ")
        ));
    };
    let name = &wave.name;
    let um = match (wave.quantity(), format.unit_um) {
        (Some((Quantity::Length, _)), Some(_)) => {
            let unit = &wave.unit;
            return Err(format!("column `{name}` states its unit, {unit}: leave out --unit"));
        }
        (Some((Quantity::Length, si)), None) => 1e6 * si,
        // Among heights `nm` is no moment.
        (Some((Quantity::Moment, _)), None) if wave.unit == "nm" => 1e-3,
        (_, Some(unit_um)) if wave.unit == "1" => unit_um,
        (None, None) if wave.unit == "1" => {
            return Err(format!(
                "column `{name}` states no unit; name it {name}_um or {name}_mm, or give --unit um"
            ));
        }
        _ => {
            let unit = &wave.unit;
            return Err(format!(
                "column `{name}` is in `{unit}`, expected heights in um, mm or nm"
            ));
        }
    };
    Ok((name.clone(), wave.values.iter().map(|z| um * z).collect()))
}
