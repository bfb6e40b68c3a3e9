//! WAV files: PCM of 8 to 64 bits and IEEE floats of 32 and 64 bits, in RIFF (little-endian), RIFX (big-endian) and RF64 files.
//!
//! By Microsoft's *Multiple Channel Audio Data and WAVE Files* and EBU Tech 3306 (RF64). A sample fills whole bytes; where fewer of its
//! bits are valid, they are its highest, and the rest is zero: what they are is asserted, so that a file that has them at the other end is
//! refused instead of read as noise. Full scale is 1 unless stated otherwise.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::wav_chunks::{Coding, Format, Wav};
use super::{Grid, Options, Record, Wave, Waves, columns, pick};
use crate::faults::{Fault, Faults};

pub(super) fn waves(name: &str, bytes: &[u8], options: &Options) -> Result<Waves, Faults> {
    let mut faults = Faults::of(name);
    columns::check(options, &mut faults);
    let wav = match Wav::read(bytes) {
        Ok(wav) => wav,
        Err(fault) => {
            faults.push(*fault);
            return faults.or(None);
        }
    };
    let full_scale = options.full_scale.unwrap_or(1.0);
    let mut notes = wav.notes.clone();
    notes.push(if options.full_scale.is_some() {
        format!("full scale stands for {full_scale}")
    } else {
        "full scale is taken as 1: the file says no unit".to_owned()
    });
    match channels(&wav, full_scale) {
        Ok(channels) => record(channels, wav.format.rate_hz, options, faults, notes),
        Err(fault) => {
            faults.push(*fault);
            faults.or(None)
        }
    }
}

/// The samples of each channel, as many as all of them have.
fn channels(wav: &Wav<'_>, full_scale: f64) -> Result<Vec<Vec<f64>>, Box<Fault>> {
    let Format { channels: count, sample_bytes, .. } = wav.format;
    let frames = wav.data.len() / (count * sample_bytes);
    let mut channels = vec![Vec::with_capacity(frames); count];
    let mut used = 0;
    for frame in wav.data.chunks_exact(count * sample_bytes) {
        for (channel, sample) in channels.iter_mut().zip(frame.chunks_exact(sample_bytes)) {
            let (value, bits) = decoded(sample, &wav.format);
            used |= bits;
            channel.push(full_scale * value);
        }
    }
    let spare = 8 * sample_bytes as u32 - wav.format.valid_bits;
    if wav.format.coding == Coding::Pcm && spare > 0 && used & ((1 << spare) - 1) != 0 {
        let (bits, valid) = (8 * sample_bytes, wav.format.valid_bits);
        let what = format!(
            "says that {valid} of each sample's {bits} bits are valid, and its lowest {spare} are not zero"
        );
        let fault = Fault::new("fmt", what)
            .expected("valid bits at the upper end of a sample, zeros below them")
            .help("have it written anew, as samples of whole bytes without spare bits");
        return Err(Box::new(fault));
    }
    Ok(channels)
}

/// A sample as a share of full scale, and its bits as they are in the file.
fn decoded(sample: &[u8], format: &Format) -> (f64, u64) {
    let fold = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
    let bits = if format.big_endian {
        sample.iter().fold(0, fold)
    } else {
        sample.iter().rev().fold(0, fold)
    };
    let value = match (format.coding, format.sample_bytes) {
        (Coding::Float, 4) => f64::from(f32::from_bits(bits as u32)),
        (Coding::Float, _) => f64::from_bits(bits),
        // The one form without a sign.
        (Coding::Pcm, 1) => (bits as f64 - 128.0) / 128.0,
        (Coding::Pcm, bytes) => {
            let up = 64 - 8 * bytes as u32;
            ((bits << up) as i64) as f64 / 2f64.powi(63)
        }
    };
    (value, bits)
}

fn record(
    channels: Vec<Vec<f64>>,
    rate_hz: u32,
    options: &Options,
    mut faults: Faults,
    notes: Vec<String>,
) -> Result<Waves, Faults> {
    let names: Vec<String> = (1..=channels.len()).map(|number| number.to_string()).collect();
    let chosen = pick::columns(&names, &options.columns, &mut faults);
    let taken = |at: &usize| options.columns.is_empty() || chosen.contains(at);
    if channels.iter().flatten().any(|value| !value.is_finite()) {
        let fault = Fault::new("", "holds samples that are no finite numbers");
        faults.push(fault.expected("finite samples"));
    }
    let count = channels.first().map_or(0, Vec::len);
    if count == 0 || rate_hz == 0 {
        let fault = Fault::new("", format!("holds {count} samples at {rate_hz} Hz"));
        faults.push(fault.expected("samples, and a rate above 0"));
        return faults.or(None);
    }
    let waves = channels.into_iter().zip(&names).enumerate().filter(|(at, _)| taken(at));
    let waves = waves.map(|(_, (values, name))| Wave::new(name, "1", values));
    let rate_hz = f64::from(rate_hz);
    let grid = columns::asked(options).unwrap_or(Grid::Time { start_s: 0.0, rate_hz });
    let record = Record { grid, channels: waves.collect(), beside: BTreeMap::new() };
    let waves = Waves {
        file: PathBuf::new(),
        records: vec![record],
        responses: Vec::new(),
        about: None,
        notes,
    };
    faults.or(Some(waves))
}
