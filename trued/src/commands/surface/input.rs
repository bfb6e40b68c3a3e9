//! Profiles out of files: one channel of heights over even steps, µm.

use std::path::{Path, PathBuf};

use recording::unit::Quantity;
use recording::waves::{self, Grid, Options, Record};
use tracing::warn;

use super::Surface;
use crate::exit::Failure;
use crate::input::unusable;

/// A profile as it was read.
#[derive(Debug)]
pub(super) struct Profile {
    pub(super) file: PathBuf,
    /// Name of the column of heights.
    pub(super) column: String,
    pub(super) spacing_mm: f64,
    pub(super) heights_um: Vec<f64>,
}

/// A file that holds no profile that can be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", file.display())]
struct Unfit {
    file: PathBuf,
    what: String,
}

pub(super) fn read(command: &Surface, path: &Path) -> Result<Profile, Failure> {
    let options = Options {
        step_mm: command.spacing_um.map(|um| 1e-3 * um),
        columns: command.column.iter().cloned().collect(),
        ..Options::default()
    };
    let waves = waves::read(path, &options).map_err(unusable)?;
    for note in &waves.notes {
        warn!("{}: {note}", path.display());
    }
    let unfit = |what: String| Failure::input(Unfit { file: path.to_owned(), what });
    let record = match waves.records.as_slice() {
        [record] => record,
        records => {
            let pieces = records.len();
            return Err(unfit(format!(
                "holds {pieces} pieces with gaps between them; expected one even profile, cut it or fill the gaps"
            )));
        }
    };
    let Grid::Length { step_mm, .. } = record.grid else {
        return Err(unfit(
            "no column tells the place along the profile; name it x_um or x_mm, or give --spacing-um".to_owned(),
        ));
    };
    let (column, heights_um) = heights(command, record).map_err(unfit)?;
    Ok(Profile { file: path.to_owned(), column, spacing_mm: step_mm, heights_um })
}

fn heights(command: &Surface, record: &Record) -> Result<(String, Vec<f64>), String> {
    let names = || record.channels.iter().map(|wave| wave.name.as_str()).collect::<Vec<_>>();
    let [wave] = record.channels.as_slice() else {
        return Err(format!(
            "several columns may be the heights: {}; say which with --column",
            names().join(", ")
        ));
    };
    let name = &wave.name;
    let um = match (wave.quantity(), command.unit) {
        (Some((Quantity::Length, si)), _) => 1e6 * si,
        // Among heights `nm` is no moment.
        (Some((Quantity::Moment, _)), None) if wave.unit == "nm" => 1e-3,
        (_, Some(unit)) if wave.unit == "1" => unit.um(),
        (None, None) if wave.unit == "1" => {
            return Err(format!(
                "column `{name}` names no unit; name it {name}_um or {name}_mm, or give --unit um"
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
