//! Hits and response functions from files, in SI.

use std::path::Path;

use recording::unit::Quantity;
use recording::waves::{self, Grid, Options, Record, ResponseFunction, Wave, Waves};
use spectrum::Complex;
use spectrum::frf::{Frf, Response};

use crate::error::Error;

/// How the files of an impact test are read.
#[derive(Clone, Debug, Default)]
pub struct Channels {
    /// Columns of force and response, by name or by number from 1. Default: determined from their
    /// units.
    pub columns: Option<[String; 2]>,
    /// The quantity of the response, if its unit does not determine it; its values are then SI.
    pub response: Option<Response>,
    /// Force of one unit of the file, N; not 0. Default: determined from its unit.
    pub force_scale: Option<f64>,
    /// Response of one unit of the file, SI; not 0, with `response`. Default: determined from its
    /// unit.
    pub response_scale: Option<f64>,
    /// Samples per second, Hz; above 0. Default: that of the file.
    pub rate_hz: Option<f64>,
    /// Whether files are tables of a response function: frequency in Hz, real part, imaginary part; with `response`.
    pub are_functions: bool,
}

/// Content of the files of an impact test.
#[derive(Debug)]
pub struct Source {
    /// Names of the files, without folders.
    pub files: Vec<String>,
    /// Remarks on the files, as text.
    pub notes: Vec<String>,
    pub(super) content: Content,
}

impl Source {
    /// Whether response functions were measured by another program, which are taken as they are; otherwise there are records of hits.
    #[must_use]
    pub fn has_functions(&self) -> bool {
        matches!(self.content, Content::Functions(_))
    }
}

/// Records of hits, or response functions.
#[derive(Debug)]
pub(super) enum Content {
    Hits(Hits),
    Functions(Vec<MeasuredFunction>),
}

/// Records of hits, alike in rate and kind.
#[derive(Debug)]
pub struct Hits {
    /// Samples per second.
    pub rate_hz: f64,
    /// What the response is.
    pub response: Response,
    /// Force and response of each record, SI.
    pub records: Vec<HitRecord>,
    /// Column names of force and response, of the first record.
    pub columns: [String; 2],
    /// Assumptions.
    pub notes: Vec<String>,
}

/// One run of samples without a gap.
#[derive(Debug)]
pub struct HitRecord {
    /// The file's name.
    pub file: String,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// N.
    pub force: Vec<f64>,
    /// SI.
    pub response: Vec<f64>,
}

/// A response function that was measured elsewhere.
#[derive(Debug)]
pub struct MeasuredFunction {
    /// Name of the file, with the quantity if it states one.
    pub name: String,
    /// Its values.
    pub frf: Frf,
}

/// A file without usable content.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {what}")]
struct InvalidTapFile {
    file: String,
    what: String,
}

/// Reads records of hits, or response functions.
///
/// # Errors
/// [`Error::File`] if a file cannot be read; [`Error::Input`] if force or response cannot be
/// identified, or files do not belong together.
pub fn read(paths: &[impl AsRef<Path>], requested: &Channels) -> Result<Source, Error> {
    let mut hits: Option<Hits> = None;
    let (mut functions, mut notes, mut files) = (Vec::new(), Vec::new(), Vec::new());
    for path in paths.iter().map(AsRef::as_ref) {
        let unfit =
            |what: String| Error::input(InvalidTapFile { file: path.display().to_string(), what });
        files.extend(path.file_name().map(|name| name.to_string_lossy().into_owned()));
        let waves = waves::read(path, &options(requested))?;
        notes.extend(waves.notes.iter().map(|note| format!("{}: {note}", path.display())));
        if requested.are_functions && waves.responses.is_empty() {
            functions.push(table(requested, path, &waves).map_err(unfit)?);
        } else if waves.responses.is_empty() {
            take(requested, path, waves, &mut hits).map_err(unfit)?;
        } else {
            if !waves.records.is_empty() {
                let what = "also contains time records; only its response functions are used";
                notes.push(format!("{}: {what}", path.display()));
            }
            for function in &waves.responses {
                let mut assumed = Vec::new();
                functions.push(given(requested, path, function, &mut assumed).map_err(unfit)?);
                notes.extend(assumed.iter().map(|note| format!("{}: {note}", path.display())));
            }
        }
    }
    let content = match (hits, functions.is_empty()) {
        (Some(hits), true) => Content::Hits(hits),
        (None, false) => Content::Functions(functions),
        _ => {
            return Err(Error::input(
                "some files contain records of hits and some response functions; analyse them separately",
            ));
        }
    };
    Ok(Source { files, notes, content })
}

fn options(requested: &Channels) -> Options {
    if requested.are_functions {
        // A table of frequencies has no time: any rate leaves its rows unchanged.
        let columns = ["1", "2", "3"].map(str::to_owned).to_vec();
        return Options { columns, rate_hz: Some(1.0), ..Options::default() };
    }
    let columns = requested.columns.iter().flatten().cloned().collect();
    Options { columns, rate_hz: requested.rate_hz, ..Options::default() }
}

/// Takes the records of one file to those before; they must be alike.
fn take(
    requested: &Channels,
    path: &Path,
    waves: Waves,
    hits: &mut Option<Hits>,
) -> Result<(), String> {
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    for record in waves.records {
        let Grid::Time { rate_hz, start_s } = record.grid else {
            return Err("its samples are over a length, not over time; give --rate HZ".to_owned());
        };
        let ([force, response], kind, notes) = channels(requested, &record)?;
        let all = hits.get_or_insert_with(|| Hits {
            rate_hz,
            response: kind,
            records: Vec::new(),
            columns: [force.name.clone(), response.name.clone()],
            notes,
        });
        if (all.rate_hz / rate_hz - 1.0).abs() > 1e-6 {
            return Err(format!(
                "was sampled at {rate_hz} Hz, the first file at {} Hz; averaged hits must have the same sampling rate",
                all.rate_hz
            ));
        }
        if all.response != kind {
            return Err("its response is a different quantity than in the first file".to_owned());
        }
        let record = HitRecord {
            file: file.clone(),
            start_s,
            force: force.values,
            response: response.values,
        };
        all.records.push(record);
    }
    Ok(())
}

type ForceAndResponse = ([Wave; 2], Response, Vec<String>);

/// Force and response of a record in SI, by the requested columns or by their units.
fn channels(requested: &Channels, record: &Record) -> Result<ForceAndResponse, String> {
    let all = || record.channels.iter().map(|w| w.name.clone()).collect::<Vec<_>>().join(", ");
    let one = |what: &str, is: &dyn Fn(&Wave) -> bool| {
        let mut fitting = record.channels.iter().filter(|wave| is(wave));
        match (fitting.next(), fitting.next()) {
            (Some(wave), None) => Ok(wave),
            (found, _) => {
                let many = if found.is_some() { "several columns" } else { "no column" };
                Err(format!(
                    "{many} could be the {what} by their units; select with --force and --response (columns: {})",
                    all()
                ))
            }
        }
    };
    let (force, response) = if let (Some(_), [force, response]) =
        (&requested.columns, record.channels.as_slice())
    {
        (force, response)
    } else if requested.columns.is_some() {
        return Err("force and response are the same column".to_owned());
    } else {
        let force = one("force", &|wave| matches!(wave.quantity(), Some((Quantity::Force, _))))?;
        (force, one("response", &|wave| kind_of(wave).is_some())?)
    };
    let mut notes = Vec::new();
    let force_si = force_factor(requested, force, &mut notes)?;
    let (response_si, kind) = response_factor(requested, response, &mut notes)?;
    let scaled = |wave: &Wave, factor: f64| Wave {
        values: wave.values.iter().map(|x| factor * x).collect(),
        ..wave.clone()
    };
    Ok(([scaled(force, force_si), scaled(response, response_si)], kind, notes))
}

fn response_of(quantity: Quantity) -> Option<Response> {
    match quantity {
        Quantity::Acceleration => Some(Response::Acceleration),
        Quantity::Speed => Some(Response::Velocity),
        Quantity::Length => Some(Response::Displacement),
        _ => None,
    }
}

fn kind_of(wave: &Wave) -> Option<(Response, f64)> {
    wave.quantity().and_then(|(quantity, si)| Some((response_of(quantity)?, si)))
}

fn force_factor(
    requested: &Channels,
    force: &Wave,
    notes: &mut Vec<String>,
) -> Result<f64, String> {
    match (requested.force_scale, force.quantity()) {
        (Some(scale), _) => Ok(scale),
        (None, Some((Quantity::Force, si))) => Ok(si),
        (None, None) if force.unit == "1" => {
            notes.push(format!("column `{}` has no unit; N is assumed", force.name));
            Ok(1.0)
        }
        (None, Some(_)) => Err(format!(
            "the force, column `{}`, is in `{}`, which is not a unit of force",
            force.name, force.unit
        )),
        (None, None) => Err(format!(
            "the force, column `{}`, is in `{}`, an unknown unit; give --force-scale, N per unit",
            force.name, force.unit
        )),
    }
}

fn response_factor(
    requested: &Channels,
    response: &Wave,
    notes: &mut Vec<String>,
) -> Result<(f64, Response), String> {
    let (name, unit) = (&response.name, &response.unit);
    match (requested.response, kind_of(response)) {
        (Some(kind), _) if requested.response_scale.is_some() => {
            Ok((requested.response_scale.unwrap_or(1.0), kind))
        }
        (Some(stated), Some((kind, _))) if stated != kind => Err(format!(
            "the response, column `{name}`, is in `{unit}`, which contradicts --response-kind"
        )),
        (_, Some((kind, si))) => Ok((si, kind)),
        (Some(kind), None) if unit == "1" => {
            notes.push(format!("column `{name}` has no unit; SI is assumed"));
            Ok((1.0, kind))
        }
        (None, None) if unit == "1" => Err(format!(
            "the response, column `{name}`, has no unit; give --response-kind acceleration, velocity or displacement \
             (its values are then SI)"
        )),
        _ => Err(format!(
            "the response, column `{name}`, is in `{unit}`, expected m/s², g, m/s, mm/s, m, mm or um; or give \
             --response-scale with --response-kind"
        )),
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// A response function as a table.
fn table(requested: &Channels, path: &Path, waves: &Waves) -> Result<MeasuredFunction, String> {
    let ([record], Some(kind)) = (waves.records.as_slice(), requested.response) else {
        return Err("contains more than one table".to_owned());
    };
    let [frequency, re, im] = record.channels.as_slice() else {
        return Err(
            "has fewer than three columns; expected frequency in Hz, real part, imaginary part"
                .to_owned(),
        );
    };
    let is_frequency = |wave: &Wave| match wave.quantity() {
        Some((Quantity::Frequency, si)) => Some(si),
        None if wave.unit == "1" => Some(1.0),
        _ => None,
    };
    let frequency_si = is_frequency(frequency).ok_or_else(|| {
        format!("its first column is in `{}`; expected a frequency in Hz or kHz", frequency.unit)
    })?;
    for (wave, part) in [(re, "real"), (im, "imaginary")] {
        if names_another_part(&wave.name, part) {
            return Err(format!(
                "its column `{}` stands where the {part} part is expected; expected frequency, real part, imaginary part",
                wave.name
            ));
        }
    }
    let factor = function_factor(requested, re, kind)?;
    if factor.to_bits() != function_factor(requested, im, kind)?.to_bits() {
        return Err("its real and imaginary parts are in different units".to_owned());
    }
    let parts = re.values.iter().zip(&im.values);
    let values = parts.map(|(re, im)| factor * Complex::new(*re, *im)).collect();
    let frequency_hz = frequency.values.iter().map(|value| frequency_si * value).collect();
    function(stem(path), frequency_hz, values, kind)
}

/// Whether a column's name says that it holds another part of a complex number than `part`.
fn names_another_part(name: &str, part: &str) -> bool {
    let name = name.to_lowercase();
    let parts: [(&str, &[&str]); 3] = [
        ("real", &["real", "re"]),
        ("imaginary", &["imag", "imaginary", "im"]),
        ("", &["magnitude", "mag", "abs", "amplitude", "phase", "angle", "db"]),
    ];
    let words = || name.split(|c: char| !c.is_alphabetic());
    let others = parts.iter().filter(|(other, _)| *other != part);
    others.flat_map(|(_, names)| *names).any(|other| words().any(|word| word == *other))
}

/// SI value of one unit of a response function's column: by the scales, or by its unit, such as `g/N`; SI if it has none.
fn function_factor(requested: &Channels, wave: &Wave, kind: Response) -> Result<f64, String> {
    if requested.response_scale.is_some() || requested.force_scale.is_some() || wave.unit == "1" {
        let response = requested.response_scale.unwrap_or(1.0);
        return Ok(response / requested.force_scale.unwrap_or(1.0));
    }
    let end = |unit: &str| Wave::new("", unit, Vec::new());
    let ends = wave.unit.rsplit_once('/').map(|(response, force)| (end(response), end(force)));
    let known = ends.and_then(|(response, force)| match (kind_of(&response), force.quantity()) {
        (Some((found, response_si)), Some((Quantity::Force, force_si))) => {
            Some((found, response_si / force_si))
        }
        _ => None,
    });
    match known {
        Some((found, si)) if found == kind => Ok(si),
        Some(_) => Err(format!(
            "its column `{}` is in `{}`, which contradicts --response-kind",
            wave.name, wave.unit
        )),
        None => Err(format!(
            "its column `{}` is in `{}`, an unknown unit; expected one such as `m/s2/N`, or give --response-scale and --force-scale",
            wave.name, wave.unit
        )),
    }
}

/// A response function of a universal file.
fn given(
    requested: &Channels,
    path: &Path,
    given: &ResponseFunction,
    notes: &mut Vec<String>,
) -> Result<MeasuredFunction, String> {
    if let [Some((Quantity::Force, _)), _] = given.quantities() {
        return Err(
            "its response is a force; expected displacement, velocity or acceleration by force"
                .to_owned(),
        );
    }
    // Each end is judged as a column without samples.
    let end = |name: &str, unit: &str| Wave::new(name, unit, Vec::new());
    let response = end(&given.response, &given.response_unit);
    let reference = end(&given.reference, &given.reference_unit);
    let (response_si, kind) = response_factor(requested, &response, notes)?;
    let force_si = force_factor(requested, &reference, notes)?;
    let values =
        given.values.iter().map(|[re, im]| Complex::new(*re, *im) * (response_si / force_si));
    let name = format!("{} {} by {}", stem(path), given.response, given.reference);
    function(name, given.frequency_hz.clone(), values.collect(), kind)
}

fn function(
    name: String,
    frequency_hz: Vec<f64>,
    values: Vec<Complex<f64>>,
    kind: Response,
) -> Result<MeasuredFunction, String> {
    let grow = frequency_hz.windows(2).position(|pair| pair[1].is_nan() || pair[1] <= pair[0]);
    if let Some(row) = grow {
        return Err(format!("its frequencies do not increase after row {} of the data", row + 1));
    }
    if let Some(row) = values.iter().position(|h| !h.is_finite()) {
        return Err(format!("row {} of the response function is not a number", row + 1));
    }
    Ok(MeasuredFunction { name, frf: Frf::from_measured_function(frequency_hz, values, kind) })
}
