//! WAV files: whole numbers of 8 to 32 bits and 32-bit floats; full scale is 1 unless told otherwise.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hound::{SampleFormat, WavReader};

use super::{Grid, Options, Record, Wave, Waves, columns, pick};
use crate::faults::{Fault, Faults};

pub(super) fn waves(name: &str, bytes: &[u8], options: &Options) -> Result<Waves, Faults> {
    let mut faults = Faults::of(name);
    columns::check(options, &mut faults);
    let mut reader = match WavReader::new(bytes) {
        Ok(reader) => reader,
        Err(error) => {
            let fault = Fault::new("", format!("cannot be read as WAV: {error}"));
            faults.push(fault.expected("PCM of 8 to 32 bits, or 32-bit floats"));
            return faults.or(None);
        }
    };
    let spec = reader.spec();
    let count = usize::from(spec.channels);
    let full_scale = options.full_scale.unwrap_or(1.0);
    let mut notes = vec![if options.full_scale.is_some() {
        format!("full scale stands for {full_scale}")
    } else {
        "full scale is taken as 1: the file says no unit".to_owned()
    }];
    let mut channels: Vec<Vec<f64>> = vec![Vec::new(); count];
    let mut broken = None;
    {
        let mut at = 0;
        let mut take = |value: f64| {
            if let Some(channel) = channels.get_mut(at % count.max(1)) {
                channel.push(value);
            }
            at += 1;
        };
        match spec.sample_format {
            SampleFormat::Float => {
                for sample in reader.samples::<f32>() {
                    match sample {
                        Ok(value) => take(full_scale * f64::from(value)),
                        Err(error) => {
                            broken = Some(error);
                            break;
                        }
                    }
                }
            }
            SampleFormat::Int => {
                let one = full_scale / 2f64.powi(i32::from(spec.bits_per_sample) - 1);
                for sample in reader.samples::<i32>() {
                    match sample {
                        Ok(value) => take(one * f64::from(value)),
                        Err(error) => {
                            broken = Some(error);
                            break;
                        }
                    }
                }
            }
        }
    }
    let whole = channels.iter().map(Vec::len).min().unwrap_or(0);
    if let Some(error) = broken {
        notes.push(format!("ends early, after {whole} samples: {error}"));
    }
    record(channels, whole, spec.sample_rate, options, faults, notes)
}

fn record(
    channels: Vec<Vec<f64>>,
    whole: usize,
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
    if whole == 0 || rate_hz == 0 {
        let fault = Fault::new("", format!("holds {whole} samples at {rate_hz} Hz"));
        faults.push(fault.expected("samples, and a rate above 0"));
        return faults.or(None);
    }
    let waves = channels.into_iter().zip(&names).enumerate().filter(|(at, _)| taken(at));
    let waves = waves.map(|(_, (mut values, name))| {
        values.truncate(whole);
        Wave::new(name, "1", values)
    });
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
