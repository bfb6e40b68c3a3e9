//! `trued-trends`: the command line. All logic is in the library.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Parser;
use report::Provenance;
use trends::{Settings, TrendsError, evaluate, page, read, text, time};

/// Find effects that change over the recordings of a fleet: which effect, on which robot, since when
///
/// Reads the results of `trued diagnose --batch` in all folders. Exit codes: 0 no effect is growing, 1 an effect is growing, 2 the results cannot be used, 3 the page could
/// not be written.
#[derive(Debug, Parser)]
#[command(name = "trued-trends", version)]
struct Options {
    /// Folders with results of `trued diagnose --batch`
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Allowed tool error, mm, above 0: predicts when a growing effect alone reaches it
    #[arg(long, value_name = "MM", value_parser = positive)]
    tolerance_mm: Option<f64>,
    /// Write a page with small multiples (HTML)
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
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
    #[error("cannot write {}: {why}", path.display())]
    Output { path: PathBuf, why: std::io::Error },
    #[error("cannot write to standard output: {0}")]
    Print(#[from] std::io::Error),
}

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(alerts) => ExitCode::from(u8::from(alerts > 0)),
        Err(failure) => {
            let _ = writeln!(std::io::stderr(), "error: {failure}");
            ExitCode::from(if matches!(failure, Failure::Input(_)) { 2 } else { 3 })
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
    let answer = evaluate(&read(&options.folders, &settings)?, &settings);
    let mut out = std::io::stdout().lock();
    if options.json {
        serde_json::to_writer_pretty(&mut out, &answer).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else {
        write!(out, "{}", text::text(&answer))?;
    }
    if let Some(path) = &options.page {
        write(path, &page::page(&answer, provenance()))?;
        if !options.json {
            writeln!(out, "page: {}", path.display())?;
        }
    }
    Ok(answer.alerts.len())
}

/// Whole or not at all.
fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let beside = path.with_extension("html.part");
    let written = std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|why| Failure::Output { path: path.to_owned(), why })
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
