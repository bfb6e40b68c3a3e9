//! Results read back unchanged with the Parquet library; truncated files are recognised.

use super::*;

fn recorded() -> ResultHeader {
    ResultHeader {
        key: Key::of_bytes(b"a recording"),
        version: "trued 0".to_owned(),
        robot: "R07".to_owned(),
        serial: None,
        recorded_at_us: Some(1_700_000_000_000_000),
        files: "a.csv, b.csv".to_owned(),
        seed: 7,
    }
}

fn finding() -> Row {
    let fact = FindingParameter {
        effect: "backlash".to_owned(),
        joint: Some(3),
        change: "new".to_owned(),
        is_claimed: true,
        probability: Some(0.99),
        parameter: Some("width_mrad".to_owned()),
        index: None,
        value: Some(0.42),
        interval: Some([0.40, 0.44]),
        size_rms: Some(0.06),
        size_max: None,
    };
    Row {
        subject: Subject::Finding,
        finding: Some(fact),
        ..Row::refused("loses motion".to_owned())
    }
}

/// A file with these bytes, gone afterwards.
struct Written(std::path::PathBuf);

impl Written {
    fn of(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("trued-{name}-{}", std::process::id()));
        std::fs::write(&path, bytes).expect("written");
        Self(path)
    }
}

impl Drop for Written {
    fn drop(&mut self) {
        // Litter in the folder for temporary files is no failure of the test.
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn a_row_is_read_back_as_it_was_written() {
    let bytes = to_parquet(&recorded(), &[finding()]).expect("encoded");
    let file = Written::of("row", &bytes);
    let reader = SerializedFileReader::new(File::open(&file.0).expect("open")).expect("Parquet");
    let row = reader.get_row_iter(None).expect("rows").next().expect("a row").expect("read");
    let cell = |name: &str| {
        let found = row.get_column_iter().find(|(column, _)| *column == name);
        found.expect("the column").1.clone()
    };
    assert_eq!(cell("recorded_at"), Field::TimestampMicros(1_700_000_000_000_000));
    assert_eq!((cell("robot"), cell("serial")), (Field::Str("R07".to_owned()), Field::Null));
    assert_eq!((cell("joint"), cell("claimed")), (Field::Long(3), Field::Bool(true)));
    assert_eq!((cell("value"), cell("high")), (Field::Double(0.42), Field::Double(0.44)));
    assert_eq!((cell("size_max"), cell("verdict")), (Field::Null, Field::Null));
    assert_eq!(row.get_column_iter().count(), column_names().count());
    assert_eq!(refusal(&file.0), None, "a finding is no refusal");
}

#[test]
fn the_same_rows_give_the_same_bytes_and_another_number_does_not() {
    let bytes = |row: Row| to_parquet(&recorded(), &[row]).expect("encoded");
    assert_eq!(bytes(finding()), bytes(finding()));
    let mut other = finding();
    other.sentence.push('.');
    assert_ne!(bytes(finding()), bytes(other));
}

#[test]
fn a_result_that_is_cut_off_anywhere_is_not_whole() {
    let bytes = to_parquet(&recorded(), &[Row::refused("no row".to_owned())]).expect("encoded");
    let whole = Written::of("whole", &bytes);
    assert_eq!(key_of(&whole.0), Some(recorded().key.to_string()));
    assert_eq!(refusal(&whole.0).as_deref(), Some("no row"));
    for length in (0..bytes.len()).step_by(37).chain([bytes.len() - 1]) {
        let cut = Written::of("cut", &bytes[..length]);
        assert_eq!(key_of(&cut.0), None, "{length} of {} bytes", bytes.len());
    }
}
