//! Number and unit formats of waveform tables.

use super::tests::parsed;
use super::*;

#[test]
fn numbers_with_thousands_and_typographic_minus_signs_are_rows_of_the_table() {
    let mut thousands = "time [s];F [N]\n".to_owned();
    for i in 0..20 {
        let force = if i < 10 { "1.588,66" } else { "588,66" };
        thousands += &format!("0,{i:03};{force}\n");
    }
    let waves = parsed(&thousands, &Options::default()).unwrap();
    let channel = &waves.records[0].channels[0];
    assert_eq!((channel.name.as_str(), channel.unit.as_str()), ("F [N]", "N"));
    assert_eq!(channel.values, [[1588.66; 10], [588.66; 10]].concat());
    let minus = "time;acc\nms;g\n0;\u{2212}0,9090\n1;\u{2212}0,3475\n2;0,1012\n3;0,2\n";
    let waves = parsed(minus, &Options::default()).unwrap();
    assert_eq!(waves.records[0].grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
    let channel = &waves.records[0].channels[0];
    assert_eq!((channel.unit.as_str(), &channel.values[..2]), ("g", &[-0.909, -0.3475][..]));
}

#[test]
fn dots_that_may_group_thousands_are_refused_until_a_cell_shows_the_decimal_mark() {
    let dots = "Zeit [ms];a [N]\n0;5.596\n1;7.210\n2;7.980\n";
    let fault = parsed(dots, &Options::default()).unwrap_err().to_string();
    assert!(fault.contains("`5.596` is ambiguous: 5596 or 5.596"), "{fault}");
    let values = |last: &str| {
        let waves = parsed(&format!("{dots}{last}"), &Options::default());
        waves.map(|waves| waves.records[0].channels[0].values.clone())
    };
    assert_eq!(values("3;7.61\n").unwrap(), [5.596, 7.21, 7.98, 7.61]);
    assert!(values("3;7,61\n").is_err(), "a decimal comma does not say that dots group thousands");
}

#[test]
fn a_line_of_units_counts_beside_a_column_of_text_too() {
    let read = |head: &str| {
        let text = format!("{head};remark\nms;kN;-\n0;1,5;a\n1;2,5;b\n2;3,5;c\n");
        parsed(&text, &Options::default()).unwrap().records.swap_remove(0)
    };
    for (head, name) in [("time;F", "F [kN]"), ("time [ms];F_kN", "F_kN")] {
        let record = read(head);
        assert_eq!(record.grid, Grid::Time { start_s: 0.0, rate_hz: 1000.0 });
        let force = &record.channels[0];
        assert_eq!((force.name.as_str(), force.quantity()), (name, Some((Quantity::Force, 1e3))));
        assert_eq!(force.values, [1.5, 2.5, 3.5]);
    }
}

#[test]
fn a_time_has_the_unit_of_its_name_or_is_a_date_and_an_unknown_unit_is_refused() {
    let read = |head: &str, times: [&str; 4]| {
        let rows: String = times.iter().map(|time| format!("{time},1.5\n")).collect();
        parsed(&format!("{head},a\n{rows}"), &Options::default())
    };
    let grid = |head: &str, times| read(head, times).unwrap().records[0].grid;
    let even = ["0", "1", "2", "3"];
    let of_rate = |rate_hz: f64| Grid::Time { start_s: 0.0, rate_hz };
    assert_eq!(grid("Time (ms)", even), of_rate(1000.0));
    assert_eq!(grid("Time (10 ms)", even), of_rate(100.0));
    let minutes = ["0", "0.0005", "0.001", "0.0015"];
    let Grid::Time { rate_hz, .. } = grid("time [min]", minutes) else { panic!("no time") };
    assert!((rate_hz - 1.0 / 0.03).abs() < 1e-9, "{rate_hz}");
    let dates = [
        "2026-11-26T14:00:00.000",
        "2026-11-26T14:00:00.001",
        "2026-11-26T14:00:00.002",
        "2026-11-26T14:00:00.003",
    ];
    assert_eq!(grid("t_s", dates), of_rate(1000.0));
    for unit in ["ticks", "samples", "d"] {
        let fault = read(&format!("Time ({unit})"), even).unwrap_err().to_string();
        assert!(fault.contains("is a time in an unknown unit"), "{fault}");
    }
    let text = "Time (ticks),a\n0,1.5\n1,2.5\n2,3.5\n";
    let options = Options { rate_hz: Some(500.0), ..Options::default() };
    assert_eq!(parsed(text, &options).unwrap().records[0].grid, of_rate(500.0));
}

#[test]
fn cells_that_have_no_name_are_refused_unless_they_are_a_comment() {
    let read = |text: &str| parsed(text, &Options::default()).map_err(|faults| faults.to_string());
    let commas = read("t_s,a\n0,000,1,5\n0,001,1,7\n0,002,2,0\n").unwrap_err();
    assert!(commas.contains("has 2 names above rows of 4 cells"), "{commas}");
    assert!(commas.contains("decimal commas"), "{commas}");
    let rows = "0,1\n1,2\n2,3\n3,4\n4,5\n5,6\n";
    let number = read(&format!("t_s,a\n{rows}6,7,0.1\n")).unwrap_err();
    assert!(number.contains("this row has 3 fields"), "{number}");
    let comment = read(&format!("t_s,a\n{rows}6,7,door open\n")).unwrap();
    assert_eq!(comment.records[0].channels[0].values.len(), 7);
}

#[test]
fn a_time_since_an_epoch_gives_the_rate_without_jitter() {
    let rows = |cell: fn(u64) -> String| (0..50).map(cell).collect::<String>();
    let nanoseconds = rows(|k| format!("{},{k}\n", 1_732_880_000_123_456_789 + 500 * k));
    let seconds = rows(|k| format!("1732880000.{:07},{k}\n", 5 * k));
    for text in [
        format!("t_ns,acceleration\n{nanoseconds}"),
        format!("t_s,acceleration\n{seconds}"),
        format!("when,acceleration\n{seconds}"),
    ] {
        let waves = super::parse(
            std::path::Path::new("a.csv"),
            text.clone().into_bytes(),
            &super::Options::default(),
        );
        let waves = waves.unwrap_or_else(|faults| panic!("{text}\n{faults}"));
        let super::Grid::Time { rate_hz, .. } = waves.records[0].grid else { panic!("{waves:?}") };
        assert!((rate_hz - 2e6).abs() < 1e-3, "{rate_hz}");
        assert!(!waves.notes.iter().any(|note| note.contains("deviate")), "{:?}", waves.notes);
    }
}

#[test]
fn positions_that_do_not_increase_are_told_by_what_they_do_and_a_length_asks_for_no_rate() {
    use crate::faults::Setting;
    let table = |head: &str, x: fn(i32) -> i32| {
        let rows: String = (0..9).map(|k| format!("{},{k}\n", x(k))).collect();
        parsed(&format!("{head},z_um\n{rows}"), &Options::default()).unwrap_err().list()[0].clone()
    };
    let lengths = table("x_um", |k| -k);
    assert_eq!(lengths.message, "decreases in every row");
    assert_eq!(lengths.settings, [Setting::Spacing]);
    assert!(!lengths.help.contains("rate"), "{lengths:?}");
    assert_eq!(table("x_um", |_| 3).message, "is the same in all rows");
    assert_eq!(table("t_s", |k| -k).settings, [Setting::SamplingRate]);
    let single = parsed("t_s,a_V\n0,1\n", &Options::default()).unwrap_err();
    assert_eq!(single.list()[0].message, "has a single row");
}

#[test]
fn a_mapping_belongs_to_tables_and_not_to_a_wav_file_of_the_same_name() {
    let folder = std::env::temp_dir().join(format!("trued-beside-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("hit.wav");
    let head = b"RIFF\x34\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0data\x10\0\0\0";
    let samples: Vec<u8> = (0..8_i16).flat_map(i16::to_le_bytes).collect();
    std::fs::write(&path, [&head[..], &samples].concat()).unwrap();
    let mapping = folder.join("hit.mapping.toml");
    std::fs::write(&mapping, "schema = \"trued.mapping/1\"\n").unwrap();
    let beside = read(&path, &Options::default()).map(|waves| waves.records[0].len());
    let stored = Stored::open(&path, &Options::default()).map(|stored| stored.map(|s| s.len()));
    let given = Options { mapping: Some(mapping), ..Options::default() };
    let refused = read(&path, &given).unwrap_err().to_string();
    let checked = crate::check::validate_file(&path, None, None).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!((beside.unwrap(), stored.unwrap()), (8, Some(8)));
    assert_eq!((checked.kind, checked.faults.len()), ("WAV", 0));
    assert!(refused.contains("is WAV, which no mapping describes"), "{refused}");
}
