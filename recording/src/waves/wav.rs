//! WAV files: PCM of 8 to 64 bits and IEEE floats of 32 and 64 bits, in RIFF (little-endian), RIFX (big-endian) and RF64 files.
//!
//! After Microsoft's *Multiple Channel Audio Data and WAVE Files* and EBU Tech 3306 (RF64). A
//! sample fills whole bytes; if fewer of its bits are valid, they are the highest, and the rest is
//! zero: this is checked, so that a file with the valid bits at the other end is refused instead of
//! read as noise. Full scale is 1 unless stated otherwise.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use super::wav_chunks::{ChunkError, Coding, Format, Source, Wav};
use super::{Grid, Options, Record, Wave, Waves, columns, pick};
use crate::faults::{Fault, Faults};

/// Frames that are decoded at a time.
const FRAMES: usize = 1 << 14;

/// Reads all samples of a file in memory.
pub(super) fn waves(name: &str, bytes: &[u8], options: &Options) -> Result<Waves, Faults> {
    let opened = open(name, &bytes, options);
    let mut values = vec![Vec::new(); opened.as_ref().map_or(0, |wav| wav.channels.len())];
    let read = opened.and_then(|mut wav| {
        let channels: Vec<usize> = (0..wav.channels.len()).collect();
        let mut frames = Vec::new();
        wav.layout.parts(&bytes, &channels, 0..wav.layout.frames, &mut frames, |part| {
            for frame in part.chunks_exact(channels.len()) {
                values.iter_mut().zip(frame).for_each(|(to, value)| to.push(*value));
            }
        })?;
        wav.channels.iter_mut().zip(values).for_each(|(wave, values)| wave.values = values);
        let record = Record { grid: wav.grid, channels: wav.channels, auxiliary: BTreeMap::new() };
        let (file, responses) = (PathBuf::new(), Vec::new());
        Ok(Waves { file, records: vec![record], responses, about: None, notes: wav.notes })
    });
    read.map_err(|why| match why {
        WavError::Faults(faults) => faults,
        WavError::Io(error) => {
            let mut faults = Faults::new(name);
            faults.push(Fault::new("", format!("cannot be read: {error}")));
            faults
        }
    })
}

/// Why samples could not be read.
#[derive(Debug)]
pub(super) enum WavError {
    Faults(Faults),
    Io(std::io::Error),
}

impl From<std::io::Error> for WavError {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

/// A file whose samples were checked but not stored.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) layout: Layout,
    pub(super) grid: Grid,
    /// The requested ones, without values.
    pub(super) channels: Vec<Wave>,
    pub(super) notes: Vec<String>,
}

/// Positions of the samples, and the meaning of full scale.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    format: Format,
    data_at: u64,
    pub(super) frames: usize,
    full_scale: f64,
    /// The positions of the chosen channels in a frame.
    chosen: Vec<usize>,
}

/// Opens a file; its samples are read once if the format does not guarantee that they are valid.
pub(super) fn open(name: &str, bytes: &dyn Source, options: &Options) -> Result<Opened, WavError> {
    let mut faults = Faults::new(name);
    columns::check(options, &mut faults);
    let wav = match Wav::read(bytes) {
        Ok(wav) => wav,
        Err(ChunkError::Io(error)) => return Err(WavError::Io(error)),
        Err(ChunkError::Fault(fault)) => {
            faults.push(*fault);
            return Err(WavError::Faults(faults));
        }
    };
    let Wav { format, data, mut notes } = wav;
    let full_scale = options.full_scale.unwrap_or(1.0);
    notes.push(if options.full_scale.is_some() {
        format!("full scale is {full_scale}")
    } else {
        "the file states no unit; full scale is taken as 1".to_owned()
    });
    let frame = format.channels * format.sample_bytes;
    let frames = usize::try_from((data.end - data.start) / frame as u64).unwrap_or(usize::MAX);
    let names: Vec<String> = (1..=format.channels).map(|number| number.to_string()).collect();
    let chosen = match options.columns.as_slice() {
        [] => (0..names.len()).collect(),
        requested => pick::columns(&names, requested, &mut faults),
    };
    let channels =
        chosen.iter().map(|channel| Wave::new(&names[*channel], "1", Vec::new())).collect();
    let layout = Layout { format, data_at: data.start, frames, full_scale, chosen };
    layout.check(bytes, &mut faults)?;
    let rate_hz = f64::from(format.rate_hz);
    if frames == 0 || format.rate_hz == 0 {
        let fault = Fault::new("", format!("contains {frames} samples at {rate_hz} Hz"));
        faults.push(fault.expected("samples, and a rate above 0"));
    }
    let grid = columns::requested_grid(options).unwrap_or(Grid::Time { start_s: 0.0, rate_hz });
    faults.into_result(Some(Opened { layout, grid, channels, notes })).map_err(WavError::Faults)
}

impl Layout {
    /// Passes the samples of some of the chosen channels to `each`, one part of the frames after
    /// the other, interleaved. `part` is the buffer for decoding.
    pub(super) fn parts(
        &self,
        bytes: &dyn Source,
        channels: &[usize],
        frames: Range<usize>,
        part: &mut Vec<f64>,
        mut each: impl FnMut(&[f64]),
    ) -> std::io::Result<()> {
        let places: Vec<usize> =
            channels.iter().filter_map(|channel| self.chosen.get(*channel).copied()).collect();
        self.raw(bytes, frames, |raw| {
            part.clear();
            decode(raw, &self.format, &places, self.full_scale, part);
            each(part);
        })
    }

    /// Passes the bytes of frames to `each`, one part after the other.
    fn raw(
        &self,
        bytes: &dyn Source,
        frames: Range<usize>,
        mut each: impl FnMut(&[u8]),
    ) -> std::io::Result<()> {
        let frame = self.format.channels * self.format.sample_bytes;
        let end = frames.end.min(self.frames);
        let mut raw = vec![0; frame * FRAMES.min(end.saturating_sub(frames.start))];
        let mut frame_index = frames.start;
        while frame_index < end {
            let count = FRAMES.min(end - frame_index);
            let Some(raw) = raw.get_mut(..frame * count) else { break };
            bytes.read_at(self.data_at + (frame as u64) * (frame_index as u64), raw)?;
            each(raw);
            frame_index += count;
        }
        Ok(())
    }

    /// Checks that unused bits are zero, and floats are finite.
    fn check(&self, bytes: &dyn Source, faults: &mut Faults) -> std::io::Result<()> {
        let Format { coding, sample_bytes, valid_bits, .. } = self.format;
        let bits = 8 * sample_bytes as u32;
        let spare = bits - valid_bits;
        match coding {
            Coding::Pcm if spare > 0 => {
                let mut used = 0;
                self.raw(bytes, 0..self.frames, |raw| {
                    let samples = raw.chunks_exact(sample_bytes);
                    used |= samples.fold(0, |used, sample| used | whole(sample, &self.format));
                })?;
                if used & ((1 << spare) - 1) != 0 {
                    let what = format!(
                        "states that {valid_bits} of {bits} bits per sample are valid, but the lowest {spare} are not zero"
                    );
                    let fault = Fault::new("fmt", what)
                        .expected("valid bits left-justified, followed by zeros")
                        .help("export it again with samples of whole bytes without spare bits");
                    faults.push(fault);
                }
            }
            Coding::Pcm => {}
            Coding::Float => {
                let all: Vec<usize> = (0..self.format.channels).collect();
                let (mut sound, mut part) = (true, Vec::new());
                self.raw(bytes, 0..self.frames, |raw| {
                    part.clear();
                    decode(raw, &self.format, &all, 1.0, &mut part);
                    sound &= part.iter().all(|value| value.is_finite());
                })?;
                if !sound {
                    let fault = Fault::new("", "contains samples that are not finite");
                    faults.push(fault.expected("finite samples"));
                }
            }
        }
        Ok(())
    }
}

/// The samples at some positions of each frame, as shares of full scale times its value.
fn decode(raw: &[u8], format: &Format, places: &[usize], full_scale: f64, to: &mut Vec<f64>) {
    match format.sample_bytes {
        1 => decode_of::<1>(raw, format, places, full_scale, to),
        2 => decode_of::<2>(raw, format, places, full_scale, to),
        3 => decode_of::<3>(raw, format, places, full_scale, to),
        4 => decode_of::<4>(raw, format, places, full_scale, to),
        5 => decode_of::<5>(raw, format, places, full_scale, to),
        6 => decode_of::<6>(raw, format, places, full_scale, to),
        7 => decode_of::<7>(raw, format, places, full_scale, to),
        _ => decode_of::<8>(raw, format, places, full_scale, to),
    }
}

/// The same, for samples of `N` bytes.
fn decode_of<const N: usize>(
    raw: &[u8],
    format: &Format,
    places: &[usize],
    full_scale: f64,
    to: &mut Vec<f64>,
) {
    to.reserve(raw.len() / (N * format.channels) * places.len());
    let frames = raw.chunks_exact(N * format.channels);
    let frames = frames.map(|frame| frame.as_chunks::<N>().0);
    let value = |sample: &[u8; N]| full_scale * decoded(sample, format);
    let first = places.first().copied().unwrap_or(0);
    let run = first..first + places.len();
    if places.iter().copied().eq(run.clone()) {
        // Neighbours need no lookup for each sample.
        let runs = frames.filter_map(|samples| samples.get(run.clone()));
        runs.for_each(|samples| to.extend(samples.iter().map(value)));
        return;
    }
    for samples in frames {
        to.extend(places.iter().filter_map(|place| Some(value(samples.get(*place)?))));
    }
}

/// The bits of a sample as an integer.
fn whole(sample: &[u8], format: &Format) -> u64 {
    let fold = |bits: u64, byte: &u8| bits << 8 | u64::from(*byte);
    match format.big_endian {
        true => sample.iter().fold(0, fold),
        false => sample.iter().rev().fold(0, fold),
    }
}

/// A sample as a share of full scale.
#[inline]
fn decoded(sample: &[u8], format: &Format) -> f64 {
    let bits = whole(sample, format);
    match (format.coding, sample.len()) {
        (Coding::Float, 4) => f64::from(f32::from_bits(bits as u32)),
        (Coding::Float, _) => f64::from_bits(bits),
        // 8-bit samples are unsigned.
        (Coding::Pcm, 1) => (bits as f64 - 128.0) / 128.0,
        (Coding::Pcm, bytes) => {
            let up = 64 - 8 * bytes as u32;
            ((bits << up) as i64) as f64 / 2f64.powi(63)
        }
    }
}
