//! Tables in the formats of spreadsheets, instruments and controllers: read correctly, or refused with reason and remedy.

use super::*;
use crate::mapping::Mapping;

/// A recording of `t_s`, `q1_deg` and `x_mm`, read by a mapping without columns if one is given.
fn read(mapping: &str, text: &str) -> Result<Recording, Faults> {
    let mapping = (!mapping.is_empty())
        .then(|| Mapping::parse("m.toml", &format!("schema = \"trued.mapping/1\"\n{mapping}")))
        .transpose()?;
    read_text("x.csv", text, mapping.as_ref(), None, RequiredData::Path)
}

/// Time in s and x in mm of each row.
fn rows(mapping: &str, text: &str) -> Vec<(f64, f64)> {
    let recording = read(mapping, text).unwrap_or_else(|faults| panic!("{text}\n{faults}"));
    let x = recording.column(Channel::Position(0)).unwrap().iter();
    recording.t_s.iter().copied().zip(x.map(|m| (m * 1e9).round() / 1e6)).collect()
}

fn message(mapping: &str, text: &str) -> String {
    match read(mapping, text) {
        Ok(recording) => panic!("{text} is read as {:?}", recording.column(Channel::Position(0))),
        Err(faults) => faults.to_string(),
    }
}

/// Asserts that a table is refused with these words.
#[track_caller]
fn assert_refused(mapping: &str, text: &str, part: &str) {
    match read(mapping, text) {
        Ok(recording) => panic!("{text} is read as {recording:?}"),
        Err(faults) => faults.assert_say(part),
    }
}

#[test]
fn numbers_of_many_notations_are_read_right() {
    for (mapping, text, x) in [
        ("", "t_s,q1_deg,x_mm\n0,1.5,1.042\n1,1.5,-88.5\n", [1.042, -88.5]),
        ("", "t_s;q1_deg;x_mm\n0;1,5;1,042\n1;1,5;-88,5\n", [1.042, -88.5]),
        ("", "t_s;q1_deg;x_mm\n0;1.5;1.042\n1;1.5;-88.5\n", [1.042, -88.5]),
        ("", "t_s\tq1_deg\tx_mm\n0\t1,5\t1,042\n1\t1,5\t-88,5\n", [1.042, -88.5]),
        ("", "t_s;q1_deg;x_mm\n0;1,5;1.042,25\n1;1,5;-1.088,50\n", [1042.25, -1088.5]),
        ("", "t_s;q1_deg;x_mm\n0;1.5;1,042.25\n1;1.5;-1,088.50\n", [1042.25, -1088.5]),
        ("", "t_s,q1_deg,x_mm\n0,1.5,\"1,042.25\"\n1,1.5,-88.5\n", [1042.25, -88.5]),
        ("", "t_s;q1_deg;x_mm\n0;1,5;1\u{a0}042,25\n1;1,5;\u{2212}88,5\n", [1042.25, -88.5]),
        ("", "t_s,q1_deg,x_mm\n0,1.5,1'042.25\n1,1.5,+88.5\n", [1042.25, 88.5]),
        (
            "decimal = \",\"\nthousands = \".\"",
            "t_s;q1_deg;x_mm\n0;1,5;1.042\n1;1,5;88,5\n",
            [1042.0, 88.5],
        ),
        ("thousands = \",\"", "t_s;q1_deg;x_mm\n0;1.5;1,042\n1;1;88.5\n", [1042.0, 88.5]),
        ("thousands = \"space\"", "t_s;q1_deg;x_mm\n0;1,5;1 042,5\n1;1;88,5\n", [1042.5, 88.5]),
        ("decimal = \".\"", "t_s;q1_deg;x_mm\n0;1.125;1.042\n1;2;88\n", [1.042, 88.0]),
        ("decimal = \",\"", "t_s,q1_deg,x_mm\n0,\"1,125\",\"1,042\"\n1,2,88\n", [1.042, 88.0]),
    ] {
        let x: Vec<(f64, f64)> = x.into_iter().enumerate().map(|(t, x)| (t as f64, x)).collect();
        assert_eq!(rows(mapping, text), x, "{mapping} {text}");
    }
}

#[test]
fn a_number_that_can_be_read_in_two_ways_is_refused_with_the_way_out() {
    let mixed = "t_s;q1_deg;x_mm\n0;5,5;1.042\n1;7,5;88,5\n";
    insta::assert_snapshot!(message("", mixed), @r#"
        error: `x_mm`: `1.042` is ambiguous: 1042 or 1.042
         --> x.csv:2:7
          |
        2 | 0;5,5;1.042
          |       ^^^^^ expected a number without thousands separators, with a comma as decimal mark
          |
          = help: state it in a mapping: `decimal = ","` and `thousands = "."` for 1042, `decimal = "."` for 1.042
        "#);
    for (mapping, text, part) in [
        ("decimal = \",\"", mixed, "`1.042` is ambiguous: 1042 or 1.042"),
        ("", "t_s;q1_deg;x_mm\n0;1.125;1.042\n1;2;88\n", "`1.042` is ambiguous: 1042 or 1.042"),
        ("", "t_s\tq1_deg\tx_mm\n0\t1\t1,042\n1\t2\t88\n", "`1,042` is ambiguous: 1042 or 1.042"),
        ("", "t_s,q1_deg,x_mm\n0,1.5,\"1,042\"\n", "x.csv:2:7"),
        (
            "",
            "t_s;q1_deg;x_mm\n0;1,5;88.5\n",
            "`88.5` has a decimal point, the file a decimal comma",
        ),
        (
            "decimal = \".\"",
            "t_s;q1_deg;x_mm\n0;1,5;88.5\n",
            "`1,5` has a decimal comma, the file a decimal point",
        ),
        (
            "decimal = \",\"\nthousands = \".\"",
            "t_s;q1_deg;x_mm\n0;1,5;88.5\n",
            "`88.5` has a decimal point",
        ),
        ("decimal = \".\"\nthousands = \".\"", "t_s,q1_deg,x_mm\n0,1,1\n", "is the decimal mark"),
        ("", "t_s,q1_deg,x_mm\n0,1,1 042.5\n", "is not a number"),
    ] {
        assert_refused(mapping, text, part);
    }
}

#[test]
fn columns_that_are_not_read_as_numbers_tell_no_decimal_mark() {
    let two_ways = "`1.042` is ambiguous: 1042 or 1.042";
    let remark = "t_s;q1_deg;x_mm;remark\n0;1;1.042;26.11\n1;2;2.500;\n2;3;88;\n";
    let firmware = "t_s;q1_deg;x_mm;fw\n0;1;5;10.120.130.140\n1;2;88.5;10.120.130.140\n";
    let labels = columns_with_x(" }\nsegment = { from = \"remark\", labels = true");
    for mapping in ["", &columns_with_x(""), &labels] {
        assert_refused(mapping, remark, two_ways);
    }
    for mapping in ["", &columns_with_x("")] {
        assert_eq!(rows(mapping, firmware), [(0.0, 5.0), (1.0, 88.5)], "{mapping}");
    }
    let grouped = "t_s\tq1_deg\tx_mm\n0\t1\t1.042.075\n";
    assert_refused("", grouped, "only if its point separates thousands");
    assert_eq!(rows("thousands = \".\"", grouped), [(0.0, 1_042_075.0)]);
}

#[test]
fn the_first_lines_of_spreadsheets_are_understood() {
    let expected = [(0.0, 1.5), (1.0, 2.5)];
    for (mapping, text) in [
        ("", "sep=;\nt_s;q1_deg;x_mm\n0;1;1,5\n1;2;2,5\n"),
        ("", "\"sep=|\"\r\nt_s|q1_deg|x_mm\r\n0|1|1.5\r\n1|2|2.5\r\n"),
        ("", "\u{feff}t_s,q1_deg,x_mm\n0,1,1.5\n1,2,2.5\n"),
        ("", "t_s,q1_deg,x_mm\ns,deg,mm\n0,1,1.5\n1,2,2.5\n"),
        ("", "t_s;q1_deg;x_mm\n[s];[°];[mm]\n0;1;1,5\n1;2;2,5\n"),
        ("units_row = true", "t_s,q1_deg,x_mm,at\ns,-,,Ort\n0,1,1.5,a\n1,2,2.5,b\n"),
        ("", "t_s,q1_deg,x_mm\n0,1,1.5\n1,2,2.5\n,,\n,,\n"),
        ("", "\u{a0}t_s , q1_deg ,x_mm\n 0,1, 1.5\u{a0}\n1,2,2.5\n"),
        ("skip_rows = 2", "made by\n\nt_s,q1_deg,x_mm\n0,1,1.5\n1,2,2.5\n"),
    ] {
        assert_eq!(rows(mapping, text), expected, "{text}");
    }
}

#[test]
fn a_last_line_without_an_end_is_left_out_only_where_it_is_seen_to_be_cut_off() {
    let kept = "the last line (3) has no line break: it was kept because it has all 3 fields, but its last field may be truncated";
    for (text, rows, part) in [
        ("t_s,q1_deg,note\n0,1,\n1,2,ok", 2, kept),
        ("t_s,q1_deg,note\n0,1,5\n1,2,7", 2, kept),
        ("t_s,q1_deg,note\n0,1,a\n1,2,", 2, kept),
        (
            "t_s,q1_deg,x_mm\n0,1,5\n1,2,-",
            1,
            "line 3 is truncated and was skipped: `-` is not a number",
        ),
        (
            "t_s,q1_deg,x_mm\n0,1,5\n1,2",
            1,
            "line 3 is truncated and was skipped: it has 2 of 3 fields",
        ),
        ("t_s,q1_deg,x_mm\n0,1,5\n1,2,6\n,,", 2, "skipped 1 empty rows at the end"),
        ("t_s,q1_deg,x_mm\n0,1,5\n1,2,6\n,,\n,", 2, "skipped 2 empty rows at the end"),
        ("t_s,q1_deg,x_mm\n0,1,5\n1,2,6\n,,\n2,", 2, "line 5 is truncated"),
    ] {
        let recording = read("", text).unwrap_or_else(|faults| panic!("{text}\n{faults}"));
        let notes = recording.notes.join("\n");
        assert!(recording.len() == rows && notes.contains(part), "{text}\n{notes}");
    }
    for text in ["t_s,q1_deg,x_mm\n0,1,5\n1,2,6\n  ", "t_s,q1_deg,x_mm\n0,1,5\n1,2,6\n# made by"] {
        let mapping = if text.contains('#') { "comment = \"#\"" } else { "" };
        let notes = read(mapping, text).unwrap().notes;
        assert!(notes.is_empty(), "{text} {notes:?}");
    }
}

/// A mapping of the columns by their names, with further settings of `x_mm`.
fn columns_with_x(more: &str) -> String {
    format!(
        "[columns]\nt_s = {{ from = \"t_s\" }}\nq1_deg = {{ from = \"q1_deg\" }}\nx_mm = {{ from = \"x_mm\"{more} }}"
    )
}

#[test]
fn a_line_of_units_that_contradicts_the_names_is_refused() {
    let text = "t_s,q1_deg,x_mm\ns,deg,m\n0,1,1.5\n";
    insta::assert_snapshot!(message("", text), @r#"
        error: `x_mm`: has the unit m, expected mm
         --> x.csv:2:7
          |
        2 | s,deg,m
          |       ^ expected mm
          |
          = help: rename the column, or state `unit = "m"` in a mapping
        "#);
    let columns = columns_with_x;
    assert!(message(&columns(""), text).contains("`x_mm`: has the unit m, expected mm"));
    assert_eq!(rows(&columns(", unit = \"m\""), text), [(0.0, 1500.0)]);
    assert_eq!(rows(&columns(", scale = 1000"), text), [(0.0, 1500.0)]);
    // A row of data is not a line of units, whatever text it contains.
    let data = read("", "t_s,q1_deg,x_mm,note\n1,,,mm\n2,,,mm\n").unwrap();
    assert_eq!(data.t_s, [1.0, 2.0]);
    let spelled_units = "t_s,q1_deg,x_mm\nSek,Grad,mm\n0,1,1.5\n";
    assert!(message("", spelled_units).contains("`Sek` is not a number"));
}

#[test]
fn a_unit_that_is_not_known_is_refused_unless_the_mapping_states_how_its_column_is_read() {
    let table = |unit: &str, column: &str| {
        format!("t_s,q1_deg,x_mm,{column}\ns,deg,mm,{unit}\n0,1,1.5,294.15\n")
    };
    for (text, part) in [
        (table("K", "temp_C"), "`temp_C`: has the unit K, which is not supported"),
        (table("K", "temp_C"), "`offset = -273.15`"),
        (table("V", "fx_N"), "`fx_N`: has the unit V, which is not supported"),
        (table("g", "ax_m_s2"), "state `scale = 9.80665` in a mapping"),
    ] {
        assert_refused("", &text, part);
    }
    let inches = "t_s,q1_deg,x_mm\ns,deg,inch\n0,1,1\n";
    let mapped = |more: &str| format!("units_row = true\n{}", columns_with_x(more));
    for mapping in ["units_row = true", &mapped("")] {
        assert_refused(mapping, inches, "`x_mm`: has the unit inch, which is not supported");
    }
    assert_refused(&mapped(""), inches, "the factor from inch to mm in a mapping (`scale`)");
    assert_eq!(rows(&mapped(", scale = 25.4"), inches), [(0.0, 25.4)]);
    assert_eq!(rows(&mapped(", unit = \"m\""), inches), [(0.0, 1000.0)]);
    let kelvin = columns_with_x(" }\ntemp_C = { from = \"temp\", unit = \"C\", offset = -273.15");
    let recording = read(&kelvin, &table("K", "temp")).unwrap();
    assert!((recording.column(Channel::Ambient).unwrap()[0] - 21.0).abs() < 1e-9);
    let g = columns_with_x(" }\nax_m_s2 = { from = \"ax\", scale = 9.80665");
    assert!(read(&g, &table("g", "ax")).is_ok());
    let clock = "units_row = true\n[columns]\nt_s = { from = \"t\", format = \"%H:%M:%S\" }\nq1_deg = { from = \"q\" }";
    assert!(read(clock, "t,q\nhh:mm:ss,deg\n00:00:01,1\n").is_ok());
}

#[test]
fn times_of_many_clocks_are_seconds_since_the_first_row() {
    let clock = |format: &str, from: &str| {
        let format =
            if format.is_empty() { String::new() } else { format!(", format = \"{format}\"") };
        format!(
            "[columns]\nt_s = {{ from = {from}{format} }}\nq1_deg = {{ from = \"q1_deg\" }}\nx_mm = {{ from = \"x_mm\" }}"
        )
    };
    let one = |format| clock(format, "\"t_s\"");
    for (mapping, head, first, second) in [
        (String::new(), "t_s", "2026-11-26 14:03:05.123", "2026-11-26 14:03:06.125"),
        (one(""), "t_s", "2026-11-26T23:59:59.5Z", "2026-11-27T00:00:00.502Z"),
        (one("%d.%m.%Y %H:%M:%S"), "t_s", "28.02.2027 23:59:59,999", "01.03.2027 00:00:01,001"),
        (
            one("%m/%d/%Y %I:%M:%S %p"),
            "t_s",
            "02/28/2027 11:59:59.999 PM",
            "03/01/2027 12:00:01.001 AM",
        ),
        (
            clock("%d.%m.%Y %H:%M:%S", "[\"day\", \"time\"]"),
            "day;time",
            "26.11.2026;9:00:00,000",
            "26.11.2026;9:00:01,002",
        ),
        (one("days"), "t_s", "46352,5", "46352,500011597222"),
    ] {
        let text = format!("{head};q1_deg;x_mm\n{first};1;1,5\n{second};2;2,5\n");
        let rows = rows(&mapping, &text);
        let step = rows[1].0 - rows[0].0;
        // A day as a 64-bit float resolves 0.6 µs.
        let resolved =
            if mapping.contains("days") { (step - 1.002).abs() < 1e-6 } else { step == 1.002 };
        assert!(rows[0].0 == 0.0 && resolved, "{first} to {second}: {rows:?}");
    }
}

#[test]
fn a_time_that_is_not_understood_is_refused() {
    let text =
        |first: &str, second: &str| format!("t_s;q1_deg;x_mm\n{first};1;1,5\n{second};2;2,5\n");
    let german = text("26.11.2026 14:03:05", "26.11.2026 14:03:06");
    insta::assert_snapshot!(message("", &german), @r#"
        error: `t_s`: `26.11.2026 14:03:05` has an unknown time format
         --> x.csv:2:1
          |
        2 | 26.11.2026 14:03:05;1;1,5
          | ^^^^^^^^^^^^^^^^^^^ expected seconds as a number, or ISO 8601
          |
          = help: state the format in a mapping, for example `format = "%d.%m.%Y %H:%M:%S"`
        "#);
    let stated = |more: &str| {
        format!("[columns]\nt_s = {{ from = \"t_s\"{more} }}\nq1_deg = {{ from = \"q1_deg\" }}")
    };
    for (mapping, text, part) in [
        (
            stated(", format = \"%m/%d/%Y\""),
            text("11/26/2026", "26/11/2026"),
            "`26/11/2026` does not match this time format",
        ),
        (stated(", format = \"%d. %b\""), german.clone(), "is \"%d. %b\""),
        (
            stated(", format = \"iso\", unit = \"ms\""),
            german.clone(),
            "no unit together with `format`",
        ),
        (stated(", unit = \"ms\""), text("2026-11-26", "2026-11-27"), "is not a number"),
        (stated(""), text("2026-11-26 10:00Z", "2026-11-26 11:00"), "time zone"),
        (stated(""), text("2026-10-25 02:59", "2026-10-25 02:00"), "decreases"),
        (stated(""), text("2026-10-25 02:59", ""), "is empty"),
        (stated(", format = \"%H:%M %p\""), german.clone(), "`%I` with `%p`, or `%H` without them"),
        (
            stated(""),
            text("2026-10-25 02:59Z", "2026-10-25 02:59:60Z"),
            "is a leap second, which is not supported",
        ),
        (
            stated(""),
            text("2026-10-25 02:59Z", "2026-10-25 03:59+01:99"),
            "does not match this time format",
        ),
    ] {
        assert_refused(&mapping, &text, part);
    }
}

#[test]
fn a_time_that_is_not_read_is_one_fault() {
    for text in [
        "t_s,q1_deg\n2026-12-31T23:59:59Z,1\n2026-12-31T23:59:60Z,2\n2027-01-01T00:00:00Z,3\n",
        "t_s,q1_deg\n2026-12-31T23:59:59Z,1\nsoon,2\n2027-01-01T00:00:00Z,3\n",
        "t_s,q1_deg\n0,1\nx,2\n2,3\n",
        "t_s,q1_deg\n0,1\ninf,2\n2,3\n",
        "t_s,q1_deg\n0,1\n,2\n2,3\n",
    ] {
        let faults = read("", text).unwrap_err();
        assert_eq!(faults.len(), 1, "{text}\n{faults}");
    }
    let first = "[columns]\nt_s = { from = \"t\", format = \"iso\" }\nq1_deg = { from = \"q\" }";
    let faults = read(first, "t,q\nsoon,1\n2026-12-31T23:59:59Z,2\n").unwrap_err();
    assert_eq!(faults.len(), 1, "{faults}");
}

#[test]
fn a_value_that_becomes_infinite_once_it_is_converted_is_refused_with_its_line() {
    let text = "t_s,q1_deg,x_mm\n0,1,1\n1,2,5\n";
    let scaled = columns_with_x(", scale = 1e308, offset = 1e308");
    assert_refused(&scaled, text, "`x_mm`: is too large");
    assert_refused(&scaled, text, "x.csv:2:5");
    let time = "[columns]\nt_s = { from = \"t_s\", scale = 1e308 }\nq1_deg = { from = \"q1_deg\" }";
    assert_refused(time, "t_s,q1_deg\n0,1\n2,2\n", "x.csv:3:1");
    let infinite = read("", "t_s,q1_deg,x_mm\n0,1,inf\n").unwrap_err();
    assert_eq!(infinite.len(), 1, "{infinite}");
}

#[test]
fn faults_stand_in_their_line_behind_comments_and_whatever_ends_lines() {
    let commented = "t_s,q1_deg\n# c1\n0,1\n# c2\n\n# c3\n1,x\n2,3\n";
    for end in ["\n", "\r\n", "\r"] {
        assert_refused("comment = \"#\"", &commented.replace('\n', end), "x.csv:7:3");
    }
    let text = "t_s,q1_deg\r0,1\r1,x\r";
    insta::assert_snapshot!(message("", text), @r#"
        error: `q1_deg`: `x` is not a number
         --> x.csv:3:3
          |
        3 | 1,x
          |   ^ expected a number
        "#);
    assert_eq!(rows("", "t_s,q1_deg,x_mm\r0,1,1.5\r1,2,2.5\r"), [(0.0, 1.5), (1.0, 2.5)]);
}

#[test]
fn several_columns_for_one_are_refused_without_a_rule() {
    let mapping = "[columns]\nt_s = { from = \"t_s\" }\nq1_deg = { from = [\"q1_deg\", \"x_mm\"] }";
    let text = "t_s,q1_deg,x_mm\n0,1,2\n";
    assert!(message(mapping, text).contains("has 2 columns for one quantity"));
}

#[test]
fn times_since_an_epoch_keep_every_digit_and_count_from_the_first_row() {
    let ns = "[columns]\nt_s = { from = \"t_ns\", unit = \"ns\" }\nq1_deg = { from = \"q\" }\nx_mm = { from = \"x\" }\n";
    let scaled = ns.replace("unit = \"ns\"", "scale = 1e-9");
    let nanoseconds =
        "t_ns,q,x\n1732880000123456789,0,1\n1732880000123706789,0,1\n1732880000123956789,0,1\n";
    let sum = "[columns]\nt_s = { from = [\"sec\", \"frac\"], sum = true }\nq1_deg = { from = \"q\" }\nx_mm = { from = \"x\" }\n";
    let comma = "t_s;q1_deg;x_mm\n1732880000,123456;0,5;1\n1732880000,123706;0,5;1\n1732880000,123956;0;1\n";
    for (mapping, text) in [
        (
            "",
            "t_s,q1_deg,x_mm\n1732880000.123456,0,1\n1732880000.123706,0,1\n1732880000.123956,0,1\n",
        ),
        (
            "",
            "t_s,q1_deg,x_mm\n1.732880000123456e9,0,1\n1732880000.123706,0,1\n1732880000.123956,0,1",
        ),
        ("", comma),
        (ns, nanoseconds),
        (scaled.as_str(), nanoseconds),
        (
            sum,
            "sec,frac,q,x\n1732880000,0.9999,0,1\n1732880001,0.00015,0,1\n1732880001,0.0004,0,1\n",
        ),
    ] {
        let recording = read(mapping, text).unwrap_or_else(|faults| panic!("{text}\n{faults}"));
        let off = [0.0, 0.000_25, 0.000_5].iter().zip(&recording.t_s).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-18, "{mapping} {text}: {:?}", recording.t_s);
        let says_so = recording.notes.iter().any(|note| note.contains("counts from an epoch"));
        assert!(says_so, "{text}: {:?}", recording.notes);
    }
}

#[test]
fn a_stated_offset_leads_back_from_the_epoch_and_short_times_stay_as_they_are() {
    let mapping = "[columns]\nt_s = { from = \"t\", offset = -1732880000 }\nq1_deg = { from = \"q\" }\nx_mm = { from = \"x\" }\n";
    let text = "t,q,x\n1732880002.5000005,0,1\n1732880002.5000015,0,1\n";
    let recording = read(mapping, text).unwrap();
    assert!((recording.t_s[0] - 2.5).abs() < 1e-6, "{:?}", recording.t_s);
    assert!((recording.t_s[1] - recording.t_s[0] - 1e-6).abs() < 1e-15, "{:?}", recording.t_s);
    let short = read("", "t_s,q1_deg,x_mm\n86400.5,0,1\n86400.75,0,1\n").unwrap();
    assert_eq!((short.t_s, short.notes), (vec![86400.5, 86400.75], Vec::<String>::new()));
}

#[test]
fn two_recordings_by_one_clock_since_an_epoch_get_common_times() {
    let table = |start: &str| format!("t_s,q1_deg,x_mm\n{start}.25,0,1\n{start}.5,0,1\n");
    let first = read("", &table("1732880000")).unwrap();
    let mut second = read("", &table("1732880002")).unwrap();
    second.count_from(first.epoch());
    assert_eq!((second.t_s.as_slice(), second.epoch()), ([2.0, 2.25].as_slice(), first.epoch()));
    second.count_from(None);
    assert_eq!((second.t_s[1], second.epoch()), (1_732_880_002.5, None));
}

#[test]
fn rows_with_separators_at_their_ends_are_read_and_further_fields_are_refused() {
    let ends = "t_s,q1_deg,x_mm\n0,1,2,\n1,1,3,,\n";
    assert_eq!(rows("", ends), [(0.0, 2.0), (1.0, 3.0)]);
    assert_refused("", "t_s,q1_deg,x_mm\n0,1,2,\n1,1,3,7\n", "this row has 4 fields");
    let unnamed = read("", "t_s,q1_deg,x_mm,\n0,1,2,\n1,1,3,\n").unwrap();
    assert_eq!(unnamed.notes, ["unused columns: one without a name"]);
}

#[test]
fn a_row_with_another_separator_is_told_as_such_and_not_as_a_time() {
    let text = "t_s,q1_deg,x_mm\n0.25;1.5;2.75\n1,1,3\n";
    let message = message("", text);
    assert!(message.contains("separated by `;`, those of the header by `,`"), "{message}");
    assert!(message.contains("this row has 1 field\n"), "{message}");
    assert!(!message.contains("time format"), "{message}");
}

#[test]
fn an_empty_file_and_a_time_that_is_none_are_told_as_what_they_are() {
    for text in ["", "\n\n"] {
        let faults = read("", text).unwrap_err();
        assert_eq!((faults.len(), faults.list()[0].message.as_str()), (1, "is empty"), "{text:?}");
    }
    assert_refused("", "t_s,q1_deg,x_mm\n0,1,2\nnan,1,3\n", "`t_s`: is `nan`");
}

#[test]
fn milliseconds_since_an_epoch_are_not_taken_for_seconds() {
    let text = "t_s,q1_deg,x_mm\n1732880000123,1,2\n1732880000127,1,3\n";
    assert_refused("", text, "later than any time in seconds since an epoch");
    let mapping = "[columns]\nt_s = { from = \"t\", unit = \"ms\" }\nq1_deg = { from = \"q\" }\nx_mm = { from = \"x\" }\n";
    let named = text.replace("t_s,q1_deg,x_mm", "t,q,x");
    assert_eq!(rows(mapping, &named), [(0.0, 2.0), (0.004, 3.0)]);
}
