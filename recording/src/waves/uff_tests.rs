//! Synthetic universal files: assignment of functions to channels, continuation, refusals with reasons.

use std::fmt::Write as _;

use super::*;

/// A function as an instrument's software exports it.
#[derive(Clone)]
struct Made {
    kind: i64,
    texts: [&'static str; 2],
    date: &'static str,
    number: i64,
    component: &'static str,
    node: [i64; 2],
    /// Type of data and unit of abscissa and ordinate.
    axes: [(i64, &'static str); 2],
    start_s: f64,
    values: Vec<f64>,
    /// Zeros after the values, not counted in the header.
    filling: usize,
}

impl Made {
    /// Four samples at 1 kHz, starting with `first`.
    fn at(node: i64, direction: i64, first: f64) -> Self {
        Self {
            kind: 1,
            texts: ["NONE", "NONE"],
            date: "NONE",
            number: 0,
            component: "NONE",
            node: [node, direction],
            axes: [(17, "s"), (12, "m/s2")],
            start_s: 0.0,
            values: vec![first, 1.0, 2.0, 3.0],
            filling: 0,
        }
    }

    fn on(component: &'static str, text: &'static str, first: f64) -> Self {
        Self { component, texts: [text, "NONE"], ..Self::at(0, 0, first) }
    }

    fn write(&self, to: &mut String) {
        let Self { kind, texts, date, number, component, node: [node, direction], .. } = self;
        let even = format!("{:13.5e}{:13.5e}{:13.5e}", self.start_s, 1e-3, 0.0);
        let points = self.values.len();
        write!(
            to,
            "    -1\n    58\n{}\n{}\n{date}\nNONE\nNONE\n{kind:5}{number:10}    0         0 {component:<10}{node:10}{direction:4} \
             NONE               0   0\n         2{points:10}         1{even}\n",
            texts[0], texts[1]
        )
        .unwrap();
        for (kind, unit) in self.axes.into_iter().chain([(0, "NONE"); 2]) {
            writeln!(to, "{kind:10}    0    0    0 NONE                 {unit:<20}").unwrap();
        }
        let mut all = self.values.clone();
        all.resize(points + self.filling, 0.0);
        for line in all.chunks(6) {
            line.iter().for_each(|value| write!(to, "{value:13.5e}").unwrap());
            to.push('\n');
        }
        to.push_str("    -1\n");
    }
}

fn text(made: &[Made]) -> String {
    let mut text = String::new();
    made.iter().for_each(|one| one.write(&mut text));
    text
}

fn read(made: &[Made]) -> Result<Waves, String> {
    read_text(&text(made), &Options::default())
}

fn read_text(text: &str, options: &Options) -> Result<Waves, String> {
    parse(Path::new("made.uff"), text.as_bytes().to_vec(), options).map_err(|e| e.to_string())
}

/// Start of each record, with the first sample of each channel by its name.
fn shape(waves: &Waves) -> Vec<(f64, Vec<(&str, f64)>)> {
    let channel = |wave: &'_ Wave| wave.values[0];
    let record = |record: &'_ Record| {
        let Grid::Time { start_s, rate_hz } = record.grid else { panic!() };
        assert_eq!(rate_hz, 1000.0);
        start_s
    };
    let names = |record: &'_ Record| record.channels.iter().map(channel).collect::<Vec<_>>();
    waves
        .records
        .iter()
        .map(|r| {
            let named = r.channels.iter().map(|wave| wave.name.as_str()).zip(names(r));
            (record(r), named.collect())
        })
        .collect()
}

#[test]
fn sensors_exported_without_geometry_are_channels_of_one_record() {
    let by_entity =
        [Made::on("TABLE", "Accelerometer 1", 5.0), Made::on("SPINDLE", "Accelerometer 2", 7.0)];
    let waves = read(&by_entity).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("TABLE", 5.0), ("SPINDLE", 7.0)])]);
    let by_text = [Made::on("NONE", "Table", 5.0), Made::on("NONE", "Spindle", 7.0)];
    assert_eq!(shape(&read(&by_text).unwrap()), [(0.0, vec![("Table", 5.0), ("Spindle", 7.0)])]);
    let numbered = |number| Made { number, ..Made::on("NONE", "Time record", number as f64) };
    let waves = read(&[numbered(1), numbered(2)]).unwrap();
    let expected = vec![("Time record function 1", 1.0), ("Time record function 2", 2.0)];
    assert_eq!(shape(&waves), [(0.0, expected)]);
    let waves = read(&[Made::at(0, 0, 5.0), Made::at(0, 0, 7.0)]).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("0 #1", 5.0), ("0 #2", 7.0)])]);
    assert!(
        waves.notes.iter().any(|note| note.contains("have the same sensor name")),
        "{:?}",
        waves.notes
    );
}

#[test]
fn a_hammer_and_its_response_at_one_place_are_two_channels() {
    let force = |first| Made { axes: [(17, "s"), (13, "N")], ..Made::at(1, -3, first) };
    let hits = [force(1.0), Made::at(1, -3, 2.0), force(3.0), Made::at(1, -3, 4.0)];
    let waves = read(&hits).unwrap();
    let record = |a, b| (0.0, vec![("1-z (N)", a), ("1-z (m/s2)", b)]);
    assert_eq!(shape(&waves), [record(1.0, 2.0), record(3.0, 4.0)]);
    assert_eq!(waves.records[0].channels[0].axis, Some(2));
    let one = Options { columns: vec!["1-z (N)".to_owned()], ..Options::default() };
    let waves = read_text(&text(&hits), &one).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("1-z (N)", 1.0)]), (0.0, vec![("1-z (N)", 3.0)])]);
}

#[test]
fn a_function_that_begins_where_the_last_one_ends_continues_it_and_a_later_one_is_a_record() {
    let block = |component, start_s, first| Made { start_s, ..Made::on(component, "NONE", first) };
    let blocks =
        [block("A", 0.0, 1.0), block("B", 0.0, 2.0), block("A", 4e-3, 3.0), block("B", 4e-3, 4.0)];
    let waves = read(&blocks).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("A", 1.0), ("B", 2.0)])]);
    let values = &waves.records[0].channels[1].values;
    assert_eq!(values.as_slice(), [2.0, 1.0, 2.0, 3.0, 4.0, 1.0, 2.0, 3.0]);
    let gap = [block("A", 0.0, 1.0), block("A", 1.0, 2.0), block("B", 1.0, 3.0)];
    let record = |start, channels| (start, channels);
    assert_eq!(
        shape(&read(&gap).unwrap()),
        [record(0.0, vec![("A", 1.0)]), record(1.0, vec![("A", 2.0), ("B", 3.0)])]
    );
}

#[test]
fn what_is_measured_again_at_a_node_or_on_another_date_is_another_record() {
    let again = [Made::at(2, 1, 1.0), Made::at(2, 1, 2.0)];
    assert_eq!(
        shape(&read(&again).unwrap()),
        [(0.0, vec![("2+x", 1.0)]), (0.0, vec![("2+x", 2.0)])]
    );
    let dated = |date, first| Made { date, ..Made::on("NONE", "Hammer", first) };
    let waves = read(&[dated("01-Jan-26 10:00:00", 1.0), dated("01-Jan-26 10:00:09", 2.0)]);
    assert_eq!(waves.unwrap().records.len(), 2);
    let beside = Made { texts: ["Second sensor", "NONE"], ..Made::at(2, 1, 2.0) };
    let waves =
        read(&[Made { texts: ["First sensor", "NONE"], ..Made::at(2, 1, 1.0) }, beside]).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("2+x First sensor", 1.0), ("2+x Second sensor", 2.0)])]);
}

#[test]
fn other_id_lines_at_a_node_are_another_sensor_whenever_it_begins() {
    let sensor =
        |text, start_s, first| Made { texts: [text, "B"], start_s, ..Made::at(1, 1, first) };
    for start_s in [4e-3, 1.0] {
        let made = [sensor("Sensor A", 0.0, 5.0), sensor("Sensor B", start_s, 7.0)];
        let expected = [(0.0, vec![("1+x Sensor A", 5.0)]), (start_s, vec![("1+x Sensor B", 7.0)])];
        assert_eq!(shape(&read(&made).unwrap()), expected);
    }
    let dated = |date, text, start_s| Made { date, ..sensor(text, start_s, 5.0) };
    let runs =
        [dated("26-Nov-26 10:00:00", "Run 1", 0.0), dated("26-Nov-26 10:01:00", "Run 2", 4e-3)];
    assert_eq!(
        shape(&read(&runs).unwrap()),
        [(0.0, vec![("1+x", 5.0)]), (4e-3, vec![("1+x", 5.0)])]
    );
}

#[test]
fn functions_of_different_numbers_at_one_moment_are_two_sensors_and_on_one_day_are_noted() {
    let read_dated = |date| {
        let block = |number, first| Made { date, number, ..Made::at(1, 1, first) };
        read(&[block(1, 5.0), block(2, 7.0)]).unwrap()
    };
    let waves = read_dated("26-Nov-26 10:00:00");
    let expected = vec![("1+x function 1", 5.0), ("1+x function 2", 7.0)];
    assert_eq!(shape(&waves), [(0.0, expected)]);
    for date in ["26-Nov-26", "NONE"] {
        let waves = read_dated(date);
        assert_eq!(shape(&waves), [(0.0, vec![("1+x", 5.0)]), (0.0, vec![("1+x", 7.0)])]);
        assert!(
            waves.notes[0].contains("`1+x`") && waves.notes[0].contains("several"),
            "{waves:?}"
        );
    }
    let block = |date, number| Made { date, number, ..Made::at(1, 1, 5.0) };
    let waves = read(&[block("26-Nov-26 10:00:00", 1), block("26-Nov-26 10:00:09", 2)]).unwrap();
    assert_eq!((waves.records.len(), waves.notes.as_slice()), (2, &[][..]), "dated repeats");
}

#[test]
fn functions_each_at_its_own_node_and_time_are_a_record_each_in_little_memory() {
    let count = 20_000;
    let block = |node: i64| Made { start_s: node as f64, ..Made::at(node, 1, node as f64) };
    let waves = read(&(1..=count).map(block).collect::<Vec<_>>()).unwrap();
    assert_eq!(waves.records.len(), 20_000);
    let first = |record: &Record| record.channels[0].values[0];
    assert!(waves.records.iter().zip(1..).all(|(record, node)| first(record) == f64::from(node)));
}

#[test]
fn response_functions_are_named_as_channels_are() {
    let frf = |made: Made| Made { kind: 4, axes: [(18, "Hz"), (8, "m")], ..made };
    let names = |made: &[Made]| {
        let responses = read(made).unwrap().responses;
        responses.into_iter().map(|function| function.response).collect::<Vec<_>>()
    };
    let entities = [frf(Made::on("TABLE", "NONE", 1.0)), frf(Made::on("SPINDLE", "NONE", 2.0))];
    assert_eq!(names(&entities), ["TABLE", "SPINDLE"]);
    let at_node = |component| frf(Made { component, ..Made::at(1, 1, 1.0) });
    assert_eq!(names(&[at_node("TABLE"), at_node("SPINDLE")]), ["1+x TABLE", "1+x SPINDLE"]);
    assert_eq!(names(&[at_node("TABLE"), at_node("TABLE")]), ["1+x", "1+x"], "measured again");
    let unnamed = frf(Made::at(0, 0, 1.0));
    assert_eq!(names(&[unnamed.clone(), unnamed]), ["0 #1", "0 #2"]);
}

#[test]
fn an_exponent_of_three_digits_needs_no_letter() {
    let read = |line| uff_numbers::in_line(line).unwrap();
    assert_eq!(read("  1.00000-105  2.00000+100"), [1e-105, 2e100]);
    assert_eq!(read("-1.00000-105-2.00000E+00"), [-1e-105, -2.0]);
    assert_eq!(read("1.0-105.5-7.0E-01"), [1.0, -105.5, -0.7], "numbers that touch");
    assert_eq!(read("1.0E+00-105 17-100"), [1.0, -105.0, 17.0, -100.0]);
}

#[test]
fn measurements_that_cannot_be_paired_are_refused_with_the_way_out() {
    let three = [Made::at(1, 1, 1.0), Made::at(2, 1, 2.0), Made::at(1, 1, 3.0)];
    let fault = read(&three).unwrap_err();
    assert!(
        fault.contains("2 of `1+x` and 1 of `2+x`") && fault.contains("select one channel"),
        "{fault}"
    );
    let one = Options { columns: vec!["1+x".to_owned()], ..Options::default() };
    assert_eq!(read_text(&text(&three), &one).unwrap().records.len(), 2);
}

#[test]
fn channels_of_other_length_are_cut_and_none_is_dropped() {
    let mut long = Made::at(2, 1, 2.0);
    long.values.extend([4.0, 5.0]);
    let waves = read(&[Made::at(1, 1, 1.0), long]).unwrap();
    assert_eq!(shape(&waves), [(0.0, vec![("1+x", 1.0), ("2+x", 2.0)])]);
    assert_eq!(waves.records[0].len(), 4);
    let cut = "cut to the 4 samples that all channels have; longer: `2+x` (6)";
    assert!(waves.notes.iter().any(|note| note == cut), "{:?}", waves.notes);
}

#[test]
fn blocks_filled_up_with_zeros_hold_the_samples_that_their_header_counts() {
    for filling in [2, 8, 100] {
        let waves = read(&[Made { filling, ..Made::at(1, 1, 1.0) }]).unwrap();
        assert_eq!(waves.records[0].channels[0].values, [1.0, 1.0, 2.0, 3.0]);
        assert!(waves.notes[0].contains("padded with zeros"), "{:?}", waves.notes);
    }
    let more =
        text(&[Made::at(1, 1, 1.0)]).replacen("         4         1", "         3         1", 1);
    let fault = read_text(&more, &Options::default()).unwrap_err();
    assert!(fault.contains("contains 4 numbers, but its header states 3 points"), "{fault}");
    // Binary numbers padded to a multiple of 512 bytes.
    let whole = std::fs::read(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("src/waves/fixtures/hits-little-f64.uff"),
    );
    let whole = whole.unwrap();
    let first_end = whole.windows(7).skip(1000).position(|w| w == b"    -1\n").unwrap() + 1000;
    let filled = [&whole[..first_end], &[0; 100], &whole[first_end..]].concat();
    let read = |bytes| parse(Path::new("a.uff"), bytes, &Options::default()).unwrap();
    assert_eq!(read(filled).records, read(whole).records);
}

#[test]
fn binary_numbers_have_to_fill_the_bytes_that_their_dataset_states() {
    let header = text(&[Made::at(1, 1, 1.0)]);
    let header: Vec<&str> = header.lines().skip(2).take(11).collect();
    let read = |stated: usize, numbers: &[u8]| {
        let first = format!(
            "    -1\n    58b     1     2          11{stated:12}     0     0           0           0"
        );
        let text = format!("{first}\n{}\n", header.join("\n"));
        let bytes = [text.as_bytes(), numbers, b"\n    -1\n"].concat();
        let waves = parse(Path::new("made.uff"), bytes, &Options::default());
        waves.map(|waves| waves.records[0].channels[0].values.clone()).map_err(|e| e.to_string())
    };
    let values = [1.5, 1.0, 2.0, 3.0];
    let singles: Vec<u8> = values.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    let filled = [singles.as_slice(), &[0; 496]].concat();
    assert_eq!(read(16, &singles).unwrap(), values);
    assert_eq!(read(0, &singles).unwrap(), values, "none are stated");
    assert_eq!(read(512, &filled).unwrap(), values, "padded with zeros");
    let doubles: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
    let fault = read(32, &doubles).unwrap_err();
    assert!(fault.contains("states 32 bytes") && fault.contains("expected 16"), "{fault}");
    assert!(read(0, &doubles).unwrap_err().contains("contains more bytes"));
    assert!(read(8, &singles).unwrap_err().contains("states 8 bytes"));
}

#[test]
fn a_file_of_other_functions_alone_is_refused_by_their_names() {
    let block = |kind, axes| Made { kind, axes, ..Made::at(1, 1, 1.0) };
    let hz = [(18, "Hz"), (12, "m/s2")];
    let fault = read(&[block(2, hz), block(2, hz), block(9, hz)]).unwrap_err();
    assert!(fault.contains("auto spectrum (2), power spectral density (1)"), "{fault}");
    assert!(fault.contains("time responses") && fault.contains("export"), "{fault}");
    let beside = read(&[block(6, hz), Made::at(1, 1, 1.0)]).unwrap();
    assert!(beside.notes[0].contains("skipped: coherence (1)"), "{:?}", beside.notes);
}

#[test]
fn an_abscissa_that_is_no_time_is_never_read_as_time() {
    let over = |kind, abscissa| Made { kind, axes: [abscissa, (12, "g")], ..Made::at(1, 1, 1.0) };
    for (kind, abscissa) in [(0, (18, "Hz")), (1, (18, "NONE")), (0, (19, "rpm")), (1, (0, "deg"))]
    {
        let fault = read(&[over(kind, abscissa)]).unwrap_err();
        assert!(fault.contains("over an abscissa in"), "{fault}");
    }
    let waves = read(&[over(1, (0, "NONE"))]).unwrap();
    assert!(waves.notes[0].contains("s is assumed"), "{:?}", waves.notes);
    let response = read(&[over(4, (18, "rad/s"))]).unwrap();
    let step_hz = response.responses[0].frequency_hz[1];
    assert!((step_hz - 1e-3 / std::f64::consts::TAU).abs() < 1e-12, "{step_hz}");
}

#[test]
fn data_without_a_unit_are_in_the_units_of_dataset_164() {
    let without_unit = text(&[Made { axes: [(17, "NONE"), (12, "NONE")], ..Made::at(1, 1, 1.0) }]);
    let unit = |factors: &str| {
        let system = format!(
            "    -1\n   164\n         9USER                         2\n{factors}\n    -1\n"
        );
        let read = |text: String| {
            let waves = read_text(&text, &Options::default()).unwrap();
            let wave = &waves.records[0].channels[0];
            (wave.unit.clone(), wave.quantity().map(|(_, si)| si))
        };
        let before = read(system.clone() + &without_unit);
        assert_eq!(read(without_unit.clone() + &system), before, "behind the functions");
        before
    };
    let given = |length: &str| {
        format!(
            "  {length}  1.00000000000000000D+00  1.00000000000000000D+00\n  2.73160000000000025D+02"
        )
    };
    assert_eq!(unit(&given("1.00000000000000000D+00")), ("m/s^2".to_owned(), Some(1.0)));
    assert_eq!(unit(&given("1.00000000000000000D+03")), ("mm/s^2".to_owned(), Some(1e-3)));
    assert_eq!(unit(&given("3.93700787401574800D+01")), ("in/s^2".to_owned(), Some(0.0254)));
    let (name, si) = unit(&given("7.00000000000000000D+00"));
    assert_eq!(name, "1.4285714285714285e-1 m/s^2", "a multiple of the metre");
    assert!((7.0 * si.unwrap() - 1.0).abs() < 1e-12);
    assert_eq!(unit(&given("0.00000000000000000D+00")), ("1".to_owned(), None), "no factor");
    let wave = &read_text(&without_unit, &Options::default()).unwrap().records[0].channels[0];
    assert_eq!(wave.unit, "m/s^2");
}
