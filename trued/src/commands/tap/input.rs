//! Hits and response functions from files, in SI.

use std::path::Path;

use recording::unit::Quantity;
use recording::waves::{self, Grid, Options, Record, ResponseFunction, Wave, Waves};
use spectrum::Complex;
use spectrum::frf::{Frf, Response};
use tracing::warn;

use super::Tap;
use crate::exit::Failure;
use crate::input::unusable;

/// What the files hold: records of hits, or response functions.
#[derive(Debug)]
pub(super) enum Source {
    Hits(Hits),
    Functions(Vec<Function>),
}

/// Records of hits, alike in rate and kind.
#[derive(Debug)]
pub(super) struct Hits {
    pub(super) rate_hz: f64,
    pub(super) response: Response,
    /// Force and response of each record, SI.
    pub(super) records: Vec<HitRecord>,
    /// Column names of force and response, of the first record.
    pub(super) columns: [String; 2],
    /// What was taken for granted.
    pub(super) notes: Vec<String>,
}

/// One run of samples without a gap.
#[derive(Debug)]
pub(super) struct HitRecord {
    /// The file's name.
    pub(super) file: String,
    /// Time of the first sample, s.
    pub(super) start_s: f64,
    pub(super) force: Vec<f64>,
    pub(super) response: Vec<f64>,
}

/// A response function that was measured elsewhere.
#[derive(Debug)]
pub(super) struct Function {
    pub(super) name: String,
    pub(super) frf: Frf,
}

/// A file that holds nothing that can be used.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {what}")]
struct Unfit {
    file: String,
    what: String,
}

pub(super) fn read(command: &Tap) -> Result<Source, Failure> {
    let mut hits: Option<Hits> = None;
    let mut functions = Vec::new();
    for path in &command.files {
        let unfit = |what: String| Failure::input(Unfit { file: path.display().to_string(), what });
        let waves = waves::read(path, &options(command)).map_err(unusable)?;
        for note in &waves.notes {
            warn!("{}: {note}", path.display());
        }
        if command.frf && waves.responses.is_empty() {
            functions.push(table(command, path, &waves).map_err(unfit)?);
        } else if waves.responses.is_empty() {
            take(command, path, waves, &mut hits).map_err(unfit)?;
        } else {
            if !waves.records.is_empty() {
                warn!(
                    "{}: holds records over time too; its response functions are taken",
                    path.display()
                );
            }
            for function in &waves.responses {
                functions.push(given(command, path, function).map_err(unfit)?);
            }
        }
    }
    match (hits, functions.is_empty()) {
        (Some(hits), true) => Ok(Source::Hits(hits)),
        (None, false) => Ok(Source::Functions(functions)),
        _ => Err(Failure::input(
            "some files hold records of hits and some response functions; analyse them apart",
        )),
    }
}

fn options(command: &Tap) -> Options {
    let named = [&command.force, &command.response];
    let columns = named.into_iter().flatten().cloned().collect();
    if command.frf {
        // A table of frequencies stands over no time: any rate lets its rows through as they are.
        let columns = ["1", "2", "3"].map(str::to_owned).to_vec();
        return Options { columns, rate_hz: Some(1.0), ..Options::default() };
    }
    Options { columns, rate_hz: command.rate, ..Options::default() }
}

/// Takes the records of one file to those before; they must be alike.
fn take(command: &Tap, path: &Path, waves: Waves, hits: &mut Option<Hits>) -> Result<(), String> {
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    for record in waves.records {
        let Grid::Time { rate_hz, start_s } = record.grid else {
            return Err("its samples stand over a length, not over time; give --rate HZ".to_owned());
        };
        let ([force, response], kind, notes) = channels(command, &record)?;
        let all = hits.get_or_insert_with(|| Hits {
            rate_hz,
            response: kind,
            records: Vec::new(),
            columns: [force.name.clone(), response.name.clone()],
            notes,
        });
        if (all.rate_hz / rate_hz - 1.0).abs() > 1e-6 {
            return Err(format!(
                "was sampled at {rate_hz} Hz, the first file at {} Hz; hits of one average must be sampled alike",
                all.rate_hz
            ));
        }
        if all.response != kind {
            return Err("its response is of another kind than the first file's".to_owned());
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

type Channels = ([Wave; 2], Response, Vec<String>);

/// Force and response of a record in SI, by the columns asked for or by their units.
fn channels(command: &Tap, record: &Record) -> Result<Channels, String> {
    let all = || record.channels.iter().map(|w| w.name.clone()).collect::<Vec<_>>().join(", ");
    let one = |what: &str, is: &dyn Fn(&Wave) -> bool| {
        let mut fitting = record.channels.iter().filter(|wave| is(wave));
        match (fitting.next(), fitting.next()) {
            (Some(wave), None) => Ok(wave),
            (found, _) => {
                let many = if found.is_some() { "several columns" } else { "no column" };
                Err(format!(
                    "{many} may be the {what} by the units; say which with --force and --response (columns: {})",
                    all()
                ))
            }
        }
    };
    let (force, response) = if let (Some(_), [force, response]) =
        (&command.force, record.channels.as_slice())
    {
        (force, response)
    } else if command.force.is_some() {
        return Err("force and response are the same column".to_owned());
    } else {
        let force = one("force", &|wave| matches!(wave.quantity(), Some((Quantity::Force, _))))?;
        (force, one("response", &|wave| kind_of(wave).is_some())?)
    };
    let mut notes = Vec::new();
    let force_si = force_factor(command, force, &mut notes)?;
    let (response_si, kind) = response_factor(command, response, &mut notes)?;
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

fn force_factor(command: &Tap, force: &Wave, notes: &mut Vec<String>) -> Result<f64, String> {
    match (command.force_scale, force.quantity()) {
        (Some(scale), _) => Ok(scale),
        (None, Some((Quantity::Force, si))) => Ok(si),
        (None, None) if force.unit == "1" => {
            notes.push(format!("column `{}` names no unit: taken as N", force.name));
            Ok(1.0)
        }
        _ => Err(format!(
            "the force, column `{}`, is in `{}`, expected a force; give --force-scale, N of one unit",
            force.name, force.unit
        )),
    }
}

fn response_factor(
    command: &Tap,
    response: &Wave,
    notes: &mut Vec<String>,
) -> Result<(f64, Response), String> {
    let asked = command.response_kind.map(super::Kind::response);
    let (name, unit) = (&response.name, &response.unit);
    match (asked, kind_of(response)) {
        (Some(kind), _) if command.response_scale.is_some() => {
            Ok((command.response_scale.unwrap_or(1.0), kind))
        }
        (Some(asked), Some((kind, _))) if asked != kind => Err(format!(
            "the response, column `{name}`, is in `{unit}`, which is another kind than --response-kind says"
        )),
        (_, Some((kind, si))) => Ok((si, kind)),
        (Some(kind), None) if unit == "1" => {
            notes.push(format!("column `{name}` names no unit: taken as SI"));
            Ok((1.0, kind))
        }
        (None, None) if unit == "1" => Err(format!(
            "the response, column `{name}`, names no unit; say --response-kind acceleration, velocity or displacement \
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
fn table(command: &Tap, path: &Path, waves: &Waves) -> Result<Function, String> {
    let ([record], Some(kind)) = (waves.records.as_slice(), command.response_kind) else {
        return Err("holds more than one table".to_owned());
    };
    let [frequency, re, im] = record.channels.as_slice() else {
        return Err(
            "has fewer than three columns; expected frequency in Hz, real part, imaginary part"
                .to_owned(),
        );
    };
    let factor = command.response_scale.unwrap_or(1.0) / command.force_scale.unwrap_or(1.0);
    let parts = re.values.iter().zip(&im.values);
    let values = parts.map(|(re, im)| factor * Complex::new(*re, *im)).collect();
    function(stem(path), frequency.values.clone(), values, kind.response())
}

/// A response function of a universal file.
fn given(command: &Tap, path: &Path, given: &ResponseFunction) -> Result<Function, String> {
    let [response, reference] = given.quantities();
    let asked = command.response_kind.map(super::Kind::response);
    let known = response.and_then(|(quantity, si)| Some((response_of(quantity)?, si)));
    let (kind, response_si) = match (asked, known) {
        (Some(asked), Some((kind, _))) if asked != kind => {
            return Err(format!(
                "its response is in `{}`, which is another kind than --response-kind says",
                given.response_unit
            ));
        }
        (_, Some(known)) => known,
        (Some(kind), None) => (kind, command.response_scale.unwrap_or(1.0)),
        (None, None) => {
            return Err("does not say what its response is; give --response-kind".to_owned());
        }
    };
    let force_si = match reference {
        Some((Quantity::Force, si)) => si,
        None => command.force_scale.unwrap_or(1.0),
        Some(_) => {
            let unit = &given.reference_unit;
            return Err(format!("its reference is in `{unit}`, expected a force"));
        }
    };
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
) -> Result<Function, String> {
    let grow = frequency_hz.windows(2).position(|pair| pair[1].is_nan() || pair[1] <= pair[0]);
    if let Some(row) = grow {
        return Err(format!("its frequencies do not grow after row {} of the numbers", row + 1));
    }
    if let Some(row) = values.iter().position(|h| !h.is_finite()) {
        return Err(format!("row {} of the response function is no number", row + 1));
    }
    Ok(Function { name, frf: Frf::given(frequency_hz, values, kind) })
}
