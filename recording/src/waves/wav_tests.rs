//! WAV files of every format, built byte by byte: correct samples, or the correct error.

use super::*;

const PCM: u16 = 1;
const FLOAT: u16 = 3;

/// Properties of a file.
#[derive(Clone, Copy)]
struct Made {
    mark: &'static [u8; 4],
    big_endian: bool,
    tag: u16,
    bytes: usize,
    valid: Option<u16>,
    /// Content before `data`, with its padding.
    before: &'static [u8],
    data_size: Option<u32>,
    extra: usize,
}

impl Made {
    const fn of(tag: u16, bytes: usize) -> Self {
        Self {
            mark: b"RIFF",
            big_endian: false,
            tag,
            bytes,
            valid: None,
            before: b"",
            data_size: None,
            extra: 0,
        }
    }

    fn put(&self, to: &mut Vec<u8>, number: u64, bytes: usize) {
        let all = number.to_le_bytes();
        let mut bytes = all[..bytes].to_vec();
        if self.big_endian {
            bytes.reverse();
        }
        to.extend(bytes);
    }

    /// One channel at 8 kHz.
    fn file(&self, samples: &[u64]) -> Vec<u8> {
        let mut data = Vec::new();
        samples.iter().for_each(|sample| self.put(&mut data, *sample, self.bytes));
        let mut format = Vec::new();
        let bits = 8 * self.bytes as u64;
        let tag = if self.valid.is_some() { 0xfffe } else { self.tag };
        for (number, bytes) in [
            (u64::from(tag), 2),
            (1, 2),
            (8000, 4),
            (8000 * self.bytes as u64, 4),
            (self.bytes as u64, 2),
            (bits, 2),
        ] {
            self.put(&mut format, number, bytes);
        }
        if let Some(valid) = self.valid {
            self.put(&mut format, 22 + self.extra as u64, 2);
            self.put(&mut format, u64::from(valid), 2);
            self.put(&mut format, 4, 4);
            self.put(&mut format, u64::from(self.tag), 4);
            self.put(&mut format, 0, 2);
            self.put(&mut format, 0x10, 2);
            format.extend([0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71]);
            format.extend(vec![0; self.extra]);
        }
        let mut all = self.mark.to_vec();
        self.put(&mut all, 1000, 4);
        all.extend(b"WAVE");
        if self.mark == b"RF64" {
            all.extend(b"ds64");
            self.put(&mut all, 28, 4);
            for number in [1000, data.len() as u64, samples.len() as u64] {
                self.put(&mut all, number, 8);
            }
            self.put(&mut all, 0, 4);
        }
        all.extend(b"fmt ");
        self.put(&mut all, format.len() as u64, 4);
        all.extend(format);
        all.extend(self.before);
        all.extend(b"data");
        let size = self.data_size.unwrap_or(data.len() as u32);
        self.put(&mut all, u64::from(size), 4);
        all.extend(data);
        all
    }
}

fn read(file: &[u8]) -> Result<Waves, String> {
    parse(Path::new("made.wav"), file.to_vec(), &Options::default()).map_err(|e| e.to_string())
}

fn values(made: &Made, samples: &[u64]) -> Vec<f64> {
    let waves = read(&made.file(samples)).unwrap();
    waves.records[0].channels[0].values.clone()
}

/// A half, minus a half, and the lowest number.
fn pcm(bytes: usize) -> [u64; 3] {
    let one = 1_u64 << (8 * bytes - 1);
    [one / 2, (one / 2).wrapping_neg(), one]
}

#[test]
fn whole_numbers_of_every_width_are_shares_of_full_scale() {
    for bytes in [2, 3, 4, 8] {
        assert_eq!(values(&Made::of(PCM, bytes), &pcm(bytes)), [0.5, -0.5, -1.0], "{bytes} bytes");
    }
    assert_eq!(values(&Made::of(PCM, 1), &[192, 64, 0]), [0.5, -0.5, -1.0], "without a sign");
}

#[test]
fn floats_of_both_widths_are_what_they_are() {
    let single = [0.25_f32, -3.5].map(|x| u64::from(x.to_bits()));
    assert_eq!(values(&Made::of(FLOAT, 4), &single), [0.25, -3.5]);
    let double = [0.1_f64, -1e-12].map(f64::to_bits);
    assert_eq!(values(&Made::of(FLOAT, 8), &double), [0.1, -1e-12]);
}

#[test]
fn valid_bits_are_the_upper_ones_and_others_are_refused() {
    for (bytes, valid) in [(4, 24), (3, 20), (2, 12), (4, 20)] {
        let made = Made { valid: Some(valid), ..Made::of(PCM, bytes) };
        assert_eq!(values(&made, &pcm(bytes)), [0.5, -0.5, -1.0], "{valid} in {bytes} bytes");
        // At the lower end, as some programs write them.
        let lower = [1 << (valid - 2), 3];
        let fault = read(&made.file(&lower)).unwrap_err();
        assert!(fault.contains("lowest") && fault.contains("are not zero"), "{fault}");
    }
    let all = Made { valid: Some(0), ..Made::of(PCM, 2) };
    assert_eq!(values(&all, &pcm(2)), [0.5, -0.5, -1.0], "zero means all");
}

#[test]
fn an_extensible_format_may_be_longer_and_of_floats() {
    let made = Made { valid: Some(32), extra: 10, ..Made::of(FLOAT, 4) };
    assert_eq!(values(&made, &[u64::from(0.25_f32.to_bits())]), [0.25]);
}

#[test]
fn big_endian_and_large_files_are_read() {
    let big = Made { mark: b"RIFX", big_endian: true, ..Made::of(PCM, 3) };
    assert_eq!(values(&big, &pcm(3)), [0.5, -0.5, -1.0]);
    let large = Made { mark: b"RF64", data_size: Some(u32::MAX), ..Made::of(PCM, 2) };
    assert_eq!(values(&large, &pcm(2)), [0.5, -0.5, -1.0]);
}

#[test]
fn a_file_from_a_pipe_is_read_to_its_end_and_reports_it() {
    let large = Made { mark: b"RF64", data_size: Some(u32::MAX), ..Made::of(PCM, 2) };
    let mut file = large.file(&pcm(2));
    let at = file.windows(4).position(|four| four == b"ds64").expect("ds64") + 8;
    file[at..at + 24].fill(0);
    let waves = read(&file).unwrap();
    assert_eq!(waves.records[0].channels[0].values, [0.5, -0.5, -1.0]);
    for size in [u32::MAX, 0] {
        let made = Made { data_size: Some(size), ..Made::of(PCM, 2) };
        let waves = read(&made.file(&pcm(2))).unwrap();
        assert_eq!(waves.records[0].channels[0].values, [0.5, -0.5, -1.0]);
        assert!(waves.notes.iter().any(|note| note.contains("pipe")), "{:?}", waves.notes);
    }
}

#[test]
fn a_chunk_of_odd_size_is_followed_by_a_byte_and_one_without_it_is_refused() {
    let padded = Made { before: b"note\x05\0\0\0abcde\0", ..Made::of(PCM, 2) };
    assert_eq!(values(&padded, &pcm(2)), [0.5, -0.5, -1.0]);
    let unpadded = Made { before: b"note\x05\0\0\0abcde", ..Made::of(PCM, 2) };
    let fault = read(&unpadded.file(&pcm(2))).unwrap_err();
    assert!(fault.contains("`note`") && fault.contains("even"), "{fault}");
}

#[test]
fn an_odd_chunk_without_padding_is_recognised_by_the_data_that_follow_it() {
    // The size of `data` begins with a letter, so that `ata@` follows a padding byte.
    let unpadded = Made { before: b"note\x03\0\0\0abc", ..Made::of(PCM, 2) };
    let fault = read(&unpadded.file(&[0; 32])).unwrap_err();
    assert!(fault.contains("`note`") && fault.contains("even"), "{fault}");
}

#[test]
fn what_stands_behind_the_samples_is_no_sample_and_reported_where_it_is_no_metadata() {
    let with_tail = |made: Made, tail: &[u8]| read(&[made.file(&pcm(2)).as_slice(), tail].concat());
    let list = b"LIST\x06\0\0\0INFO\x07\x08";
    let has_note = |waves: &Waves, what: &str| waves.notes.iter().any(|note| note.contains(what));
    let waves = with_tail(Made::of(PCM, 2), list).unwrap();
    assert_eq!((waves.records[0].len(), has_note(&waves, "skipped")), (3, false), "{waves:?}");
    let waves = with_tail(Made { data_size: Some(4), ..Made::of(PCM, 2) }, &[1; 20]).unwrap();
    assert_eq!(waves.records[0].len(), 2);
    assert!(
        has_note(&waves, "skipped 22 bytes after the samples that are not a chunk"),
        "{waves:?}"
    );
    let waves = with_tail(Made::of(PCM, 2), b"data\x02\0\0\0\x01\x02").unwrap();
    assert!(has_note(&waves, "a second `data` chunk"), "{waves:?}");
    let empty = [Made::of(PCM, 2).file(&[]).as_slice(), list].concat();
    assert!(read(&empty).unwrap_err().contains("contains 0 samples"), "metadata are no samples");
}

#[test]
fn what_is_cut_off_is_reported_and_what_is_compressed_is_refused_with_the_reason() {
    let made = Made { data_size: Some(100), ..Made::of(PCM, 2) };
    let waves = read(&made.file(&pcm(2))).unwrap();
    assert_eq!(waves.records[0].len(), 3);
    assert!(waves.notes.iter().any(|note| note.contains("truncated")), "{:?}", waves.notes);
    for (tag, name) in [(6, "A-law"), (7, "µ-law"), (0x11, "ADPCM"), (0x55, "MP3")] {
        let fault = read(&Made::of(tag, 1).file(&[1, 2])).unwrap_err();
        assert!(fault.contains(name), "{fault}");
    }
    let whole = Made::of(PCM, 2).file(&pcm(2));
    for length in 0..44 {
        assert!(read(&whole[..length.max(4)]).is_err(), "{length} bytes");
    }
}
