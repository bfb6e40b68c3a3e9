//! Tables written by the same library, and corrupted files.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use proptest::prelude::*;

use crate::files::FileError;
use crate::series::{Channel, Recording, RequiredData, read};

const SCHEMA: &str = "message recording {
    required double t_s; optional int32 segment; required float q1_deg; required int64 q2_deg;
    optional double x_mm; optional double y_mm; optional double z_mm; optional binary note (STRING);
}";

/// Four rows in two groups; the first of each has no y.
fn written(schema: &str, compression: Compression) -> Vec<u8> {
    let schema = Arc::new(parse_message_type(schema).expect("a schema"));
    let how = Arc::new(WriterProperties::builder().set_compression(compression).build());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, how).expect("a writer");
    for group in 0..2 {
        let mut rows = writer.next_row_group().expect("a group");
        let t = 2.0 * f64::from(group);
        let all = Some(&[1_i16, 1][..]);
        let mut place = 0;
        while let Some(mut column) = rows.next_column().expect("a column") {
            let done = match place {
                0 => column.typed::<DoubleType>().write_batch(&[t, t + 1.0], None, None),
                1 => column.typed::<Int32Type>().write_batch(&[0, 0], all, None),
                2 => column.typed::<FloatType>().write_batch(&[0.5, 0.1], None, None),
                3 => column.typed::<Int64Type>().write_batch(&[90, -90], None, None),
                5 => column.typed::<DoubleType>().write_batch(&[7.25], Some(&[0, 1]), None),
                7 => column.typed::<ByteArrayType>().write_batch(
                    &["warm".into(), "a, b".into()],
                    all,
                    None,
                ),
                _ => column.typed::<DoubleType>().write_batch(&[1.5, t], all, None),
            };
            assert_eq!(done.expect("written"), if place == 5 { 1 } else { 2 });
            column.close().expect("closed");
            place += 1;
        }
        rows.close().expect("closed");
    }
    writer.into_inner().expect("bytes")
}

fn taken(name: &str, bytes: &[u8]) -> Result<Recording, FileError> {
    taken_as(name, bytes, RequiredData::Measurement)
}

fn taken_as(name: &str, bytes: &[u8], need: RequiredData) -> Result<Recording, FileError> {
    let file = format!("trued-{name}-{}.parquet", std::process::id());
    let path: PathBuf = std::env::temp_dir().join(file);
    fs::write(&path, bytes).expect("a file");
    let read = read(&path, None, need);
    fs::remove_file(&path).expect("gone");
    read
}

#[test]
fn numbers_of_every_width_are_read_and_nulls_were_not_taken() {
    let zstd = Compression::ZSTD(ZstdLevel::default());
    for how in [Compression::UNCOMPRESSED, Compression::SNAPPY, zstd] {
        let read = taken("widths", &written(SCHEMA, how)).expect("sound");
        assert_eq!(read.t_s, [0.0, 1.0, 2.0, 3.0]);
        let column = |channel| read.column(channel).expect("there").to_vec();
        assert_eq!(column(Channel::Command(0))[1], f64::from(0.1_f32).to_radians());
        assert_eq!(column(Channel::Command(1))[3], (-90.0_f64).to_radians());
        let y = column(Channel::Position(1));
        assert!(y[0].is_nan() && y[2].is_nan(), "{y:?}");
        assert!((y[3] - 7.25e-3).abs() < 1e-15);
        let (name, cells) = &read.other[0];
        assert_eq!((name.as_str(), cells[1].as_str()), ("note", "a, b"));
    }
}

#[test]
fn a_missing_column_and_a_date_are_reported_with_their_name() {
    let message_of = |schema: &str| {
        let error = taken("faults", &written(schema, Compression::SNAPPY)).expect_err("faults");
        let FileError::Content(faults) = error else { unreachable!("a fault of content") };
        faults.plain().to_string()
    };
    let no_time = message_of(&SCHEMA.replace("double t_s", "double when"));
    assert!(no_time.contains("t_s") && no_time.contains("is missing"), "{no_time}");
    let date = "int64 q2_deg (TIMESTAMP(MILLIS,true))";
    let dated = message_of(&SCHEMA.replace("int64 q2_deg", date));
    assert!(
        dated.contains("q2_deg") && dated.contains("a recording has times in seconds"),
        "{dated}"
    );
}

#[test]
fn integers_without_a_sign_keep_their_size_and_half_floats_and_durations_are_refused() {
    let write = |schema: &str, pandas: Option<&str>| {
        let schema = Arc::new(parse_message_type(schema).expect("a schema"));
        let metadata = pandas.map(|text| vec![KeyValue::new("pandas".to_owned(), text.to_owned())]);
        let how = WriterProperties::builder().set_key_value_metadata(metadata).build();
        let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(how)).unwrap();
        let mut rows = writer.next_row_group().unwrap();
        let mut column = rows.next_column().unwrap().expect("t_s");
        column.typed::<Int64Type>().write_batch(&[0, 1], None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().expect("q1_deg");
        column.typed::<Int32Type>().write_batch(&[-1, i32::MIN], None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().expect("q2_deg");
        column.typed::<Int64Type>().write_batch(&[-1, 5], None, None).unwrap();
        column.close().unwrap();
        rows.close().unwrap();
        writer.into_inner().unwrap()
    };
    let schema = "message recording {
        required int64 t_s; required int32 q1_deg (INTEGER(32,false)); required int64 q2_deg (INTEGER(64,false));
    }";
    let recording = taken_as("unsigned", &write(schema, None), RequiredData::Path).unwrap();
    let degrees = |joint| {
        let values = recording.column(Channel::Command(joint)).unwrap();
        values.iter().map(|value| value.to_degrees().round()).collect::<Vec<f64>>()
    };
    assert_eq!(degrees(0), [4_294_967_295.0, 2_147_483_648.0]);
    assert_eq!(degrees(1), [u64::MAX as f64, 5.0]);
    let pandas = r#"{"columns": [{"field_name": "t_s", "numpy_type": "timedelta64[ns]"}]}"#;
    let error = taken("durations", &write(schema, Some(pandas))).expect_err("a duration");
    assert!(error.to_string().contains("is a duration"), "{error}");
}

#[test]
fn what_is_cut_off_is_reported_as_damaged() {
    let whole = written(SCHEMA, Compression::SNAPPY);
    for length in [0, 4, whole.len() / 2, whole.len() - 1] {
        let error = taken("cut", &whole[..length]).expect_err("damaged");
        assert!(error.to_string().contains("cannot be read as Parquet"), "{length}: {error}");
    }
}

#[test]
fn a_foreign_column_keeps_its_cells_and_is_a_number_only_where_each_cell_is_one() {
    let cells = |all: [&str; 3]| all.map(str::to_owned).to_vec();
    let mut recording = Recording::new(vec![0.0, 0.5, 1.0]);
    recording.set(Channel::Command(0), vec![0.1, f64::NAN, -0.0]);
    recording.other = vec![
        ("count".to_owned(), cells(["18446744073709551615", "1", ""])),
        ("stamp.ns".to_owned(), cells(["1000000000000000007", "", "-3"])),
        ("residual".to_owned(), cells(["1e-7", "", "0.25"])),
        ("part no".to_owned(), cells(["007", "8", "9"])),
        ("status".to_owned(), cells(["corrected", "", "NaN"])),
    ];
    let bytes = recording.to_parquet().expect("a table");
    assert_eq!(bytes, recording.to_parquet().expect("a table"), "the same bytes each time");
    let back = taken_as("foreign", &bytes, RequiredData::Path).expect("sound");
    assert_eq!(back.other, recording.other);
    assert_eq!(back.to_csv(), recording.to_csv());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_is_written_reads_back_to_the_same_bits(
        rows in prop::collection::vec((any::<i32>(), prop::option::of(any::<f64>().prop_filter("finite", |x| x.is_finite())), 0..3_i64), 1..40),
    ) {
        let times = (0..rows.len()).map(|row| row as f64 * 0.1);
        let mut recording = Recording::new(times.collect());
        let mut segment = 0;
        recording.segment = rows.iter().map(|(.., step)| { segment += step; segment }).collect();
        recording.set(Channel::Command(0), rows.iter().map(|row| f64::from(row.0) * 1e-9).collect());
        recording.set(Channel::Torque(0), rows.iter().map(|row| row.1.unwrap_or(f64::NAN)).collect());
        let back = taken_as("back", &recording.to_parquet().expect("a table"), RequiredData::Path).expect("sound");
        prop_assert_eq!(&back.segment, &recording.segment);
        for channel in [Channel::Command(0), Channel::Torque(0)] {
            let bits = |recording: &Recording| -> Vec<u64> {
                recording.column(channel).expect("there").iter().map(|x| x.to_bits()).collect()
            };
            prop_assert_eq!(bits(&back), bits(&recording));
        }
    }

    #[test]
    fn no_byte_makes_it_panic(offset in 0..2000_usize, byte in any::<u8>()) {
        let mut bytes = written(SCHEMA, Compression::SNAPPY);
        let offset = offset % bytes.len();
        bytes[offset] = byte;
        let _ = taken("bytes", &bytes);
    }
}

#[test]
fn integers_of_nanoseconds_since_1970_keep_every_digit() {
    for kind in ["int64 t_ns", "int64 t_ns (INTEGER(64,false))"] {
        let schema = format!("message m {{ required {kind}; required int64 q; }}");
        let schema = Arc::new(parse_message_type(&schema).expect("a schema"));
        let how = Arc::new(WriterProperties::builder().build());
        let mut writer = SerializedFileWriter::new(Vec::new(), schema, how).unwrap();
        let mut rows = writer.next_row_group().unwrap();
        for values in [[1_732_880_000_123_456_789, 1_732_880_000_123_706_789], [1, 2]] {
            let mut column = rows.next_column().unwrap().expect("a column");
            column.typed::<Int64Type>().write_batch(&values, None, None).unwrap();
            column.close().unwrap();
        }
        rows.close().unwrap();
        let path = std::env::temp_dir().join(format!("trued-epoch-{}.parquet", std::process::id()));
        let mapping = path.with_extension("mapping.toml");
        fs::write(&path, writer.into_inner().unwrap()).unwrap();
        let columns = "t_s = { from = \"t_ns\", unit = \"ns\" }\nq1_deg = { from = \"q\" }\n";
        let text = format!("schema = \"trued.mapping/1\"\n[columns]\n{columns}");
        fs::write(&mapping, text).unwrap();
        let recording = read(&path, None, RequiredData::Path);
        fs::remove_file(&path).unwrap();
        fs::remove_file(&mapping).unwrap();
        assert_eq!(recording.unwrap().t_s, [0.0, 250e-6], "{kind}");
    }
}
