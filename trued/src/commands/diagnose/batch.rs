//! `trued diagnose --batch`: diagnoses each recording of a manifest independently, one Parquet file each.
//!
//! Options that affect a result are in the manifest, so that shards cannot differ; a recording that
//! cannot be diagnosed stops no other.

use std::path::{Path, PathBuf};

use batch::check::unusable_robots;
use batch::{DiagnosisError, Existing, Item, Job, Row, Shard, Summary, UndiagnosedRecording};
use clap::Args;
use diagnosis_report::progress::ignore;
use diagnosis_report::{ForceDiagnosis, Settings, diagnose};
use recording::files::FileError;
use recording::manifest::Manifest;
use report::pluralise;
use serde::Serialize;
use tracing::info;
use tracing::subscriber::{NoSubscriber, with_default};

use super::DiagnosisInput;
use super::rows::{MeanTemperatures, of_reports};
use crate::exit::{Answer, Failure, Outcome};
use crate::input::{FaultyFile, Reading, unusable};
use crate::output::{Console, Emphasis};
use crate::pages::Outputs;
use crate::progress;

/// Most recordings listed in the text; their results contain the reason.
const LISTED_MAX: usize = 10;

#[derive(Debug, Args)]
pub(super) struct Batch {
    /// Diagnose each recording of this manifest separately; writes one Parquet file for each to DIR (docs/batch.md)
    #[arg(long, value_name = "MANIFEST", help_heading = "Batches")]
    #[arg(conflicts_with_all = ["recordings", "model", "mapping", "seed", "band", "tolerance_mm", "apply"])]
    pub(super) batch: Option<PathBuf>,
    /// Process only shard I of N: recordings I, I + N, I + 2 N … of the manifest
    #[arg(long, value_name = "I/N", help_heading = "Batches")]
    #[arg(requires = "batch", conflicts_with_all = ["recordings", "model", "mapping", "seed", "band", "tolerance_mm", "apply"])]
    shard: Option<Shard>,
    /// Keep existing complete results and process the rest
    #[arg(long, help_heading = "Batches")]
    #[arg(requires = "batch", conflicts_with_all = ["overwrite", "recordings", "model", "mapping", "seed", "band", "tolerance_mm", "apply"])]
    resume: bool,
}

/// The report on a batch.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Report {
    /// Results that this run wrote.
    written: usize,
    /// Results that were there.
    kept: usize,
    /// Recordings whose content cannot be diagnosed; their results state why.
    refused: Vec<NotDiagnosed>,
    /// Recordings whose files cannot be read; they have no result.
    unread: Vec<NotDiagnosed>,
    /// All results in the folder.
    results: usize,
    /// The output of `sha256sum *.parquet | sha256sum` in the directory.
    digest_sha256: String,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct NotDiagnosed {
    /// Files as the manifest names them, joined by `, `.
    files: String,
    why: String,
}

impl NotDiagnosed {
    fn of(one: &UndiagnosedRecording) -> Self {
        Self { files: one.files.clone(), why: one.why.clone() }
    }
}

impl Batch {
    pub(super) fn run(&self, file: &Path, out: &Path, console: &mut Console) -> Outcome {
        let manifest = Manifest::read(file).map_err(unusable)?;
        // Absolute, so that messages name a file unambiguously.
        let base = std::path::absolute(file).map_err(Failure::system)?;
        let base = base.parent().unwrap_or(Path::new("/"));
        let faults = unusable_robots(&manifest, base, &file.display().to_string());
        if !faults.is_empty() {
            let texts = faults.into_iter().map(|faults| FaultyFile::of(faults).to_string());
            return Err(Failure::input(texts.collect::<Vec<_>>().join("\n")));
        }
        let mut outputs = console.outputs();
        outputs.check(&inputs(file, &manifest, base))?;
        let existing = match (self.resume, console.common().overwrite) {
            (true, _) => Existing::Keep,
            (false, true) => Existing::Replace,
            (false, false) => Existing::Refuse,
        };
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let job = Job { manifest: &manifest, base, shard, out, existing };
        let bar = progress::bar(console, job.count() as u64, "diagnosing recordings");
        let is_verbose = console.common().verbose > 0;
        let summary = batch::run(
            job,
            |item| {
                // With thousands of recordings, remarks on each are logged only on request.
                info!(recording = item.names(), robot = item.robot.name, "diagnosing");
                let silent = || with_default(NoSubscriber::default(), || rows(&manifest, item));
                let rows = if is_verbose { rows(&manifest, item) } else { silent() };
                rows.map_err(|failure| failed(&failure, item))
            },
            || bar.inc(1),
        );
        bar.finish_and_clear();
        let summary = summary.map_err(|error| match &error {
            batch::RunError::Exists { .. } => {
                Failure::input(format!("{error} (--resume, --overwrite, --out)"))
            }
            _ => Failure::system(error),
        })?;
        print_summary(&summary, out, outputs, console)
    }
}

/// Every file that a manifest names, and itself.
fn inputs(file: &Path, manifest: &Manifest, base: &Path) -> Vec<PathBuf> {
    let models = manifest.robots.iter().map(|robot| base.join(&robot.model));
    let mappings = manifest.robots.iter().filter_map(|robot| robot.mapping.as_ref());
    let files = manifest.recordings.iter().flat_map(|recording| &recording.files);
    let beside = files.map(|file| base.join(file));
    let mut all: Vec<PathBuf> =
        models.chain(mappings.map(|m| base.join(m))).chain(beside).collect();
    all.push(file.to_owned());
    all
}

/// The rows of a recording's diagnosis.
fn rows(manifest: &Manifest, item: &Item<'_>) -> Result<Vec<Row>, Failure> {
    let reading = Reading { model: Some(item.model.clone()), mapping: item.mapping.clone() };
    let seed = manifest.seed;
    match DiagnosisInput::of(&reading, &item.files)? {
        DiagnosisInput::Forces(alone) => {
            let (model, recording) = *alone;
            let temperatures = MeanTemperatures::of(std::slice::from_ref(&recording));
            let found = ForceDiagnosis::of(model, &recording, seed)?;
            Ok(of_reports(&[found.report()], &temperatures))
        }
        DiagnosisInput::Robot(model, recordings) => {
            let temperatures = MeanTemperatures::of(&recordings);
            let settings = Settings { seed, band_hz: manifest.band_hz, ..Settings::default() };
            let found = diagnose(*model, recordings, &settings, &ignore)?;
            Ok(of_reports(&found.reports(), &temperatures))
        }
    }
}

/// Why a recording is not diagnosed, with paths as in the manifest, so that the text does not
/// depend on the manifest's location.
fn failed(failure: &Failure, item: &Item<'_>) -> DiagnosisError {
    let message = item.as_named(&failure.to_string());
    let is_io = |error: &FileError| matches!(error, FileError::Io { .. });
    match failure {
        Failure::Input(error) if !error.downcast_ref::<FileError>().is_some_and(is_io) => {
            DiagnosisError::Refused(message)
        }
        _ => DiagnosisError::Unread(message),
    }
}

fn print_summary(
    summary: &Summary,
    out: &Path,
    outputs: Outputs,
    console: &mut Console,
) -> Outcome {
    let of = |all: &[UndiagnosedRecording]| all.iter().map(NotDiagnosed::of).collect();
    let digest = &summary.digest;
    let report = Report {
        written: summary.written,
        kept: summary.kept,
        refused: of(&summary.refused),
        unread: of(&summary.unread),
        results: digest.results,
        digest_sha256: digest.sha256.clone(),
    };
    console.write(outputs, "trued.batch/1", &report)?;
    let (written, kept) = (pluralise(summary.written, "result"), summary.kept);
    let head = console.paint(Emphasis::Strong, &format!("{written} written"));
    console.say(format!("{head}, {kept} kept, {} in {}", digest.results, out.display()))?;
    for (what, all) in [("refused", &summary.refused), ("not read", &summary.unread)] {
        for one in all.iter().take(LISTED_MAX) {
            let first = one.why.lines().find_map(|line| line.strip_prefix("error: "));
            let why = first.or_else(|| one.why.lines().next()).unwrap_or_default();
            console.say(format!("  {what}: {}: {why}", one.files))?;
        }
        if let Some(more) = all.len().checked_sub(LISTED_MAX).filter(|more| *more > 0) {
            console.say(format!("  {what}: {more} more"))?;
        }
    }
    console.say(format!("digest {}", digest.sha256))?;
    if !summary.unread.is_empty() {
        let unread = pluralise(summary.unread.len(), "recording");
        let why = format!(
            "no result for {unread} that could not be read; run the same command with --resume to retry"
        );
        return Err(Failure::system(why));
    }
    Ok(if summary.refused.is_empty() { Answer::Done } else { Answer::No })
}

/// The schema of the result.
#[cfg(feature = "schema")]
pub(super) fn result_schema() -> crate::schemas::ResultSchema {
    crate::schemas::ResultSchema::of::<Report>("batch", "trued.batch/1")
}
