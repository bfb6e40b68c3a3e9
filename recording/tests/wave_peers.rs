//! Waveforms in WAV and UFF 58 files as soundfile and pyuff write and read them.
//!
//! The files are written by these libraries, in every format that they can write with plain
//! samples. Needs `python3` with `venv` and the package registry; otherwise the test is SKIPPED.
#![expect(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test says what failed"
)]

mod python;

use std::path::PathBuf;

use recording::waves::{self, Grid, Options};
use serde_json::{Value, json};

use python::{answer, environment, scratch};

const SAMPLES: usize = 97;
/// A rate whose reciprocal is no short decimal number.
const RATE_HZ: f64 = 44_100.0;

/// Content of a file by the library that wrote it.
#[derive(serde::Deserialize)]
struct Found {
    rate_hz: f64,
    /// As texts, which `serde_json` cannot round.
    channels: Vec<Vec<String>>,
}

/// Results of the libraries for these jobs; `None`, with a message, if they are not available.
fn peers(jobs: &[Value]) -> Option<Vec<Found>> {
    let packages = ["soundfile>=0.12,<1", "pyuff==2.5.8", "numpy>=2,<3"];
    let python = match environment("waves", &packages) {
        Ok(python) => python,
        Err(why) => {
            eprintln!("SKIPPED: waveforms beside soundfile and pyuff: {why}");
            return None;
        }
    };
    let text: String = jobs.iter().fold(String::new(), |text, job| text + &job.to_string() + "\n");
    let answers = answer(&python, "waves/write.py", text);
    let found = answers.lines().map(|line| serde_json::from_str(line).expect("JSON"));
    let found: Vec<Found> = found.collect();
    assert_eq!(found.len(), jobs.len(), "the peer answers each job");
    Some(found)
}

/// An empty folder of this name.
fn folder(name: &str) -> PathBuf {
    let folder = scratch().join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Compares what is read of each file with the library's result.
fn compare(jobs: &[Value], found: Vec<Found>) {
    for (job, found) in jobs.iter().zip(found) {
        let file = PathBuf::from(job["file"].as_str().expect("a path"));
        let read = waves::read(&file, &Options::default());
        let read = read.unwrap_or_else(|error| panic!("{job}: {error}"));
        assert_eq!(read.records.len(), 1, "{job}");
        let record = &read.records[0];
        let Grid::Time { rate_hz, .. } = record.grid else { panic!("{job}: no time") };
        assert!((rate_hz / found.rate_hz - 1.0).abs() < 1e-5, "{job}: {rate_hz} Hz");
        assert_eq!(record.channels.len(), found.channels.len(), "{job}: {:?}", read.notes);
        for (ours, theirs) in record.channels.iter().zip(&found.channels) {
            let theirs = theirs.iter().map(|text| text.parse().expect("a number"));
            assert_eq!(ours.values, theirs.collect::<Vec<f64>>(), "{job}");
        }
    }
    eprintln!("{} files of {SAMPLES} samples, the same bits", jobs.len());
}

#[test]
fn every_form_of_wav_is_read_as_soundfile_reads_it() {
    let folder = folder("wav-peers");
    let subtypes = ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"];
    let forms = [("WAV", "LITTLE"), ("WAV", "BIG"), ("WAVEX", "LITTLE"), ("RF64", "FILE")];
    let mut jobs = Vec::new();
    for (format, endian) in forms {
        for subtype in subtypes {
            for channels in [1, 2, 3, 6] {
                let index = jobs.len();
                // A title is a chunk behind the samples, of odd size now and then.
                let title = ["", "a", "ab"][index % 3];
                jobs.push(json!({
                    "file": folder.join(format!("{index}.wav")), "seed": index, "samples": SAMPLES + index % 2, "channels": channels,
                    "rate_hz": RATE_HZ as u32, "format": format, "subtype": subtype, "endian": endian, "title": title,
                }));
            }
        }
    }
    if let Some(found) = peers(&jobs) {
        compare(&jobs, found);
    }
}

#[test]
fn every_form_of_universal_file_is_read_as_pyuff_reads_it() {
    let folder = folder("uff-peers");
    let mut jobs = Vec::new();
    // Four-byte binary numbers are left out: pyuff writes eight and cannot read them back.
    for (binary, double) in [(0, true), (0, false), (1, true)] {
        for channels in [1, 2, 5] {
            let index = jobs.len();
            jobs.push(json!({
                "file": folder.join(format!("{index}.uff")), "seed": index, "samples": SAMPLES + index % 6, "channels": channels,
                "rate_hz": RATE_HZ, "binary": binary, "double": double,
            }));
        }
    }
    if let Some(found) = peers(&jobs) {
        compare(&jobs, found);
    }
}
