//! Profiles from files: one channel of heights over even steps, µm.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use recording::unit::Quantity;
use recording::waves::{self, Grid, Options, Record};
use spectrum::surface::{Line, Parting, lines, part};
use tracing::warn;

use crate::exit::Failure;
use crate::input::unusable;

/// How a profile's table is read.
#[derive(Debug, Args)]
pub(in crate::commands) struct Heights {
    /// The heights' column, by name or by number from 1; needed where there are several
    #[arg(long, value_name = "C")]
    pub(super) column: Option<String>,
    /// Distance between two points, where no column tells it, µm
    #[arg(long, value_name = "UM")]
    pub(super) spacing_um: Option<f64>,
    /// Unit of heights whose column names none
    #[arg(long, value_name = "um|mm|nm", value_enum, hide_possible_values = true)]
    unit: Option<HeightUnit>,
}

/// A unit of heights.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HeightUnit {
    Um,
    Mm,
    Nm,
}

impl HeightUnit {
    fn um(self) -> f64 {
        match self {
            Self::Um => 1.0,
            Self::Mm => 1e3,
            Self::Nm => 1e-3,
        }
    }
}

/// A profile as it was read.
#[derive(Debug)]
pub(super) struct Profile {
    pub(super) file: PathBuf,
    /// Name of the column of heights.
    pub(super) column: String,
    pub(super) spacing_mm: f64,
    pub(super) heights_um: Vec<f64>,
}

/// A file without a usable profile.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", file.display())]
struct Unfit {
    file: PathBuf,
    what: String,
}

pub(super) fn read(command: &Heights, path: &Path) -> Result<Profile, Failure> {
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
            "no column holds the position along the profile; name it x_um or x_mm, or give --spacing-um".to_owned(),
        ));
    };
    let (column, heights_um) = heights(command, record).map_err(unfit)?;
    Ok(Profile { file: path.to_owned(), column, spacing_mm: step_mm, heights_um })
}

/// A profile's lines without its form (a straight line), strongest first, and its length in mm.
pub(in crate::commands) fn profile_lines(
    heights: &Heights,
    path: &Path,
) -> Result<(f64, Vec<Line>), Failure> {
    let profile = read(heights, path)?;
    let named =
        |error: &dyn std::fmt::Display| Failure::input(format!("{}: {error}", path.display()));
    let parting = Parting { form_degree: 1, short_cut_off_mm: None, cut_off_mm: 0.8 };
    let surface = part(&profile.heights_um, profile.spacing_mm, &parting);
    let surface = surface.map_err(|error| named(&error))?;
    let primary = &surface.primary[surface.evaluated.clone()];
    let found = lines(primary, profile.spacing_mm).map_err(|error| named(&error))?;
    Ok((surface.evaluated_mm(), found))
}

fn heights(command: &Heights, record: &Record) -> Result<(String, Vec<f64>), String> {
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
