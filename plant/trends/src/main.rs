//! `trued-trends`: the command line. All logic is in the library.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Parser;
use report::Provenance;
use trends::{Settings, TrendsError, evaluate, page, read, text, time};

/// Find effects that change over the recordings of a fleet: which effect, on which robot, since when
///
/// Reads the results of `trued diagnose --batch` in all folders. Exit codes: 0 no effect is growing, 1 an effect is growing, 2 the results cannot be used or a file would be
/// overwritten, 3 the page could not be written.
#[derive(Debug, Parser)]
#[command(name = "trued-trends", version)]
struct Options {
    /// Folders with results of `trued diagnose --batch`
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Allowed tool error, mm, above 0: predicts when a growing effect alone reaches it
    #[arg(long, value_name = "MM", value_parser = positive)]
    tolerance_mm: Option<f64>,
    /// Write a page with small multiples (HTML); an earlier page of trued is replaced, another file is not
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Let --page replace any file, except one that is read
    #[arg(long)]
    overwrite: bool,
    /// Print the result with its alerts as JSON (`trued.trends/1`)
    #[arg(long)]
    json: bool,
    /// Prior expected number of changed series in the whole fleet, above 0
    #[arg(long, value_name = "COUNT", value_parser = positive, default_value_t = Settings::default().expected_changes)]
    expected_changes: f64,
    /// Minimum posterior probability of a reported change, 0.5 to 1
    #[arg(long, value_name = "P", value_parser = probability, default_value_t = Settings::default().reported_probability)]
    probability: f64,
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err("expected a number above 0".to_owned())
    }
}

fn probability(text: &str) -> Result<f64, String> {
    let value = positive(text)?;
    if (0.5..=1.0).contains(&value) { Ok(value) } else { Err("expected 0.5 to 1".to_owned()) }
}

/// Why the program ends without an answer.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Input(#[from] TrendsError),
    #[error("{} already exists; nothing was written. Choose another name, or use --overwrite to replace it", .0.display())]
    Exists(PathBuf),
    #[error("{}: the page would overwrite a result that is read; choose another name", .0.display())]
    IsInput(PathBuf),
    #[error("cannot write {}: {why}; check that its folder exists and is writable", path.display())]
    Output { path: PathBuf, why: std::io::Error },
    #[error("cannot write to standard output: {0}")]
    Print(#[from] std::io::Error),
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(alerts) => ExitCode::from(u8::from(alerts > 0)),
        Err(failure) => {
            let text = failure.to_string();
            let _ = writeln!(std::io::stderr(), "error: {}", report::printable(&text, &[]));
            ExitCode::from(match failure {
                Failure::Input(_) | Failure::Exists(_) | Failure::IsInput(_) => 2,
                Failure::Output { .. } | Failure::Print(_) => 3,
            })
        }
    }
}

/// The number of alerts.
fn run(options: &Options) -> Result<usize, Failure> {
    let settings = Settings {
        expected_changes: options.expected_changes,
        reported_probability: options.probability,
        tolerance_mm: options.tolerance_mm,
        ..Settings::default()
    };
    if let Some(path) = &options.page {
        may_write(path, options)?;
    }
    let answer = evaluate(&read(&options.folders, &settings)?, &settings);
    let mut out = std::io::stdout().lock();
    if options.json {
        serde_json::to_writer_pretty(&mut out, &answer).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", report::printable(&text::text(&answer), &[]))?;
    }
    if let Some(path) = &options.page {
        write(path, &page::page(&answer, provenance()))?;
        if !options.json {
            writeln!(out, "page: {}", path.display())?;
        }
    }
    Ok(answer.alerts.len())
}

/// Bytes at the beginning of a page within which it names its author.
const HEAD_BYTES: u64 = 1024;

/// Checks, before anything is computed, that the page overwrites nothing: a page of trued may be replaced, another file with `--overwrite`, a result that is read never.
fn may_write(path: &Path, options: &Options) -> Result<(), Failure> {
    let fault = |why| Failure::Output { path: path.to_owned(), why };
    let found = match std::fs::metadata(path) {
        Ok(found) => found,
        Err(why) if why.kind() != ErrorKind::NotFound => return Err(fault(why)),
        // A link to nowhere is refused.
        Err(why) if path.is_symlink() => return Err(fault(why)),
        Err(_) => return Ok(()),
    };
    if found.is_dir() {
        return Err(fault(ErrorKind::IsADirectory.into()));
    }
    let place = path.canonicalize().map_err(fault)?;
    let mut folders = options.folders.iter().filter_map(|folder| folder.canonicalize().ok());
    if trends::is_result_name(&place) && folders.any(|folder| place.parent() == Some(&folder)) {
        return Err(Failure::IsInput(path.to_owned()));
    }
    let is_replaced = found.is_file() && found.len() > 0;
    if is_replaced && !options.overwrite && !is_page(path) {
        return Err(Failure::Exists(path.to_owned()));
    }
    Ok(())
}

/// Whether trued made this page: its beginning says so.
fn is_page(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    read.is_ok() && String::from_utf8_lossy(&head).contains(report::MADE_BY)
}

/// Whole or not at all, by a hidden file beside it; a pipe or a device is written directly.
fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let fault = |why| Failure::Output { path: path.to_owned(), why };
    let found = std::fs::metadata(path).ok();
    if found.as_ref().is_some_and(|found| !found.is_file()) {
        let file = File::options().write(true).open(path);
        return file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(fault);
    }
    // The file that a link names is replaced, not the link.
    let place = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = place.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let beside = place.with_file_name(format!(".{name}.{}.part", std::process::id()));
    let written = File::create_new(&beside).and_then(|mut file| {
        if let Some(found) = &found {
            file.set_permissions(found.permissions())?;
        }
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        std::fs::rename(&beside, &place)
    });
    written.map_err(|why| {
        if why.kind() != ErrorKind::AlreadyExists {
            // The first error is reported.
            let _ = std::fs::remove_file(&beside);
        }
        fault(why)
    })
}

/// When and by what the page is made. `SOURCE_DATE_EPOCH` fixes the time, so that the same results give the same bytes.
fn provenance() -> Provenance {
    let fixed =
        std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|seconds| seconds.parse::<i64>().ok());
    let now =
        || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() as i64);
    let arguments = std::env::args().skip(1).collect::<Vec<_>>().join(" ");
    Provenance {
        files: Vec::new(),
        date_utc: time::day(fixed.unwrap_or_else(now).saturating_mul(1_000_000)),
        version: format!("trued-trends {}", env!("CARGO_PKG_VERSION")),
        command: format!("trued-trends {arguments}"),
    }
}
