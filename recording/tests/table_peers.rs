//! Comparison of tables in many formats with pandas, and of orientations with scipy.
//!
//! The formats are generated here: every pair of separator and decimal mark, thousands, quotes,
//! line ends, lines above and below the header, clocks. Needs `python3` with `venv` and the package
//! registry; otherwise the test is SKIPPED.
#![expect(clippy::expect_used, clippy::print_stderr, reason = "a test says what failed")]

mod python;

use std::fmt::Write as _;

use recording::mapping::Mapping;
use recording::series::{self, Channel, RequiredData};
use recording::unit::Unit;
use serde_json::{Value, json};

use python::{answer, environment, scratch};

const ROWS: u32 = 40;
/// Most that a component of a rotation may differ.
const AGREES: f64 = 1e-12;

/// Results of pandas or scipy for these jobs; `None`, with a message, if they are not available.
fn peers(jobs: &[Value]) -> Option<Vec<Value>> {
    let python = match environment("tables", &["pandas>=2.2,<4", "scipy>=1.11,<2"]) {
        Ok(python) => python,
        Err(why) => {
            eprintln!("SKIPPED: tables beside pandas and scipy: {why}");
            return None;
        }
    };
    let text: String = jobs.iter().fold(String::new(), |text, job| text + &job.to_string() + "\n");
    let answers = answer(&python, "tables/read.py", text);
    let answers: Vec<Value> =
        answers.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(answers.len(), jobs.len(), "the peer answers each job");
    Some(answers)
}

/// Numbers that look random: a Weyl sequence within ±`size`.
fn weyl(index: u32, size: f64) -> f64 {
    ((f64::from(index) * 0.618_033_988_749_895).fract() - 0.5) * 2.0 * size
}

/// How a file is written.
#[derive(Debug, Clone, Copy)]
struct Form {
    separator: char,
    decimal: char,
    thousands: Option<char>,
    quoted: bool,
    end: &'static str,
    /// Lines above the header, and whether units are below it.
    above: usize,
    units: bool,
    clock: Option<&'static str>,
}

fn number(value: f64, form: Form) -> String {
    let text = format!("{value:.4}");
    let (whole, decimals) = text.split_once('.').expect("decimals");
    let digits = whole.trim_start_matches('-');
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.extend(form.thousands);
        }
        grouped.push(digit);
    }
    let sign = if value < 0.0 { "-" } else { "" };
    format!("{sign}{grouped}{}{decimals}", form.decimal)
}

/// A time of day, `at` quarters of a minute and some after 23:57 of the last of February.
fn stamp(row: u32, form: Form) -> String {
    let Some(clock) = form.clock else { return number(f64::from(row) * 0.125, form) };
    let ms = (23 * 3600 + 57 * 60) * 1000 + row * 15_007;
    let (day, month) = if ms < 86_400_000 { (28, 2) } else { (1, 3) };
    let ms = ms % 86_400_000;
    let (hour, minute, second) = (ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60);
    clock
        .replace("%Y", "2026")
        .replace("%m", &format!("{month:02}"))
        .replace("%d", &format!("{day:02}"))
        .replace("%H", &format!("{hour:02}"))
        .replace("%I", &format!("{:02}", (hour + 11) % 12 + 1))
        .replace("%M", &format!("{minute:02}"))
        .replace("%S", &format!("{second:02}"))
        .replace("%f", &format!("{:03}", ms % 1000))
        .replace("%p", if hour < 12 { "AM" } else { "PM" })
}

fn written(form: Form) -> String {
    let cell = |text: &str| if form.quoted { format!("\"{text}\"") } else { text.to_owned() };
    let line = |cells: [&str; 3]| cells.map(cell).join(&form.separator.to_string()) + form.end;
    let mut text = String::new();
    for index in 0..form.above {
        let _ = write!(text, "line {index} of somebody{}", form.end);
    }
    text += &line(["t_s", "q1_deg", "x_mm"]);
    if form.units {
        text += &line(["s", "deg", "mm"]);
    }
    for row in 0..ROWS {
        // The largest have thousands, and some whole values end in three noughts.
        let x = if row % 8 == 3 { f64::from(row) * 1000.0 } else { weyl(row, 3e6) };
        text += &line([&stamp(row, form), &number(weyl(row + 7, 180.0), form), &number(x, form)]);
    }
    text
}

fn forms() -> Vec<Form> {
    let mut forms = Vec::new();
    let clocks = [
        None,
        Some("%Y-%m-%d %H:%M:%S.%f"),
        Some("%d.%m.%Y %H:%M:%S.%f"),
        Some("%m/%d/%Y %I:%M:%S.%f %p"),
    ];
    for separator in [',', ';', '\t', '|'] {
        for decimal in ['.', ','] {
            for grouped in [false, true] {
                let quoted = separator == ',' && (decimal == ',' || grouped);
                let thousands = grouped.then_some(if decimal == '.' { ',' } else { '.' });
                let index = forms.len();
                let end = if index % 3 == 0 { "\r\n" } else { "\n" };
                let clock = clocks[(index + index / 4) % clocks.len()];
                let (above, units) = (if index % 5 == 2 { 2 } else { 0 }, index % 4 == 1);
                forms.push(Form {
                    separator,
                    decimal,
                    thousands,
                    quoted,
                    end,
                    above,
                    units,
                    clock,
                });
            }
        }
    }
    forms
}

#[test]
fn every_form_of_table_is_read_as_pandas_reads_it() {
    let folder = scratch().join("tables-peers");
    std::fs::create_dir_all(&folder).expect("a folder");
    let forms = forms();
    let mut jobs = Vec::new();
    for (index, form) in forms.iter().enumerate() {
        let file = folder.join(format!("{index}.csv"));
        let mark = if index % 2 == 0 { "\u{feff}" } else { "" };
        std::fs::write(&file, mark.to_owned() + &written(*form)).expect("written");
        let mut skip: Vec<usize> = (0..form.above).collect();
        skip.extend(form.units.then_some(form.above + 1));
        jobs.push(json!({
            "file": file, "separator": form.separator, "decimal": form.decimal,
            "thousands": form.thousands, "skip": skip, "clock": form.clock,
        }));
    }
    let Some(answers) = peers(&jobs) else { return };
    for (index, (form, expected)) in forms.iter().zip(answers).enumerate() {
        let clock = form.clock.map(|clock| format!(", format = \"{clock}\"")).unwrap_or_default();
        let separator =
            if form.separator == '\t' { "tab".to_owned() } else { form.separator.to_string() };
        let mapping = format!(
            "schema = \"trued.mapping/1\"\nseparator = \"{separator}\"\ndecimal = \"{}\"\nskip_rows = {}\n[columns]\n\
             t_s = {{ from = \"t_s\"{clock} }}\nq1_deg = {{ from = \"q1_deg\" }}\nx_mm = {{ from = \"x_mm\" }}\n",
            form.decimal, form.above
        );
        let mapping = Mapping::parse("m.toml", &mapping).expect("a mapping");
        let file = folder.join(format!("{index}.csv"));
        let text = recording::files::read_text(&file).expect("a text");
        let read = series::read_text("x.csv", &text, Some(&mapping), None, RequiredData::Path)
            .unwrap_or_else(|faults| panic!("{form:?}\n{faults}"));
        let column = |channel| read.column(channel).expect("there");
        let ours = [&read.t_s, column(Channel::Command(0)), column(Channel::Position(0))];
        let theirs: Vec<Vec<f64>> = serde_json::from_value(expected).expect("columns");
        for ((ours, theirs), unit) in ours.into_iter().zip(theirs).zip(["s", "deg", "mm"]) {
            let unit = Unit::from_name(unit).expect("a unit");
            let theirs: Vec<f64> = theirs.into_iter().map(|value| unit.to_si(value)).collect();
            assert_eq!(ours, theirs, "{form:?}");
        }
    }
    eprintln!("{} forms of {ROWS} rows, the same bits", forms.len());
}

#[test]
fn every_orientation_is_the_rotation_that_scipy_makes_of_it() {
    let conventions = ["ZYX", "xyz", "XYZ", "ZYZ", "zyx", "YXZ", "XZX", "yzy", "rotation_vector"];
    let mut jobs = Vec::new();
    for convention in conventions {
        for row in 0..ROWS {
            let numbers = [0, 1, 2].map(|k| weyl(3 * row + k, 180.0));
            jobs.push(json!({ "convention": convention, "numbers": numbers }));
        }
    }
    let Some(answers) = peers(&jobs) else { return };
    let mut most: f64 = 0.0;
    for (convention, (jobs, answers)) in
        conventions.iter().zip(jobs.chunks(ROWS as usize).zip(answers.chunks(ROWS as usize)))
    {
        let mapping = format!(
            "schema = \"trued.mapping/1\"\n[columns]\nt_s = {{ per_row = 1.0 }}\nq1_deg = {{ constant = 0.0 }}\n\
             orientation = {{ from = [\"a\", \"b\", \"c\"], convention = \"{convention}\", unit = \"deg\" }}\n"
        );
        let mapping = Mapping::parse("m.toml", &mapping).expect("a mapping");
        let mut text = "a,b,c\n".to_owned();
        for job in jobs {
            let numbers: Vec<f64> =
                serde_json::from_value(job["numbers"].clone()).expect("numbers");
            let _ = writeln!(text, "{},{},{}", numbers[0], numbers[1], numbers[2]);
        }
        let read = series::read_text("x.csv", &text, Some(&mapping), None, RequiredData::Path)
            .expect("read");
        let part = |k: usize, row: usize| {
            read.column(Channel::Orientation(k)).and_then(|c| c.get(row)).copied().expect("a part")
        };
        for (row, theirs) in answers.iter().enumerate() {
            let [w, x, y, z] = [0, 1, 2, 3].map(|k| part(k, row));
            let ours = glam::DMat3::from_quat(glam::DQuat::from_xyzw(x, y, z, w)).transpose();
            let theirs: Vec<f64> = serde_json::from_value(theirs.clone()).expect("a matrix");
            let apart = ours.to_cols_array().into_iter().zip(theirs).map(|(a, b)| (a - b).abs());
            most = apart.fold(most, f64::max);
            assert!(most < AGREES, "{convention}, row {row}");
        }
    }
    eprintln!("{} orientations, at most {most:.1e} apart", jobs.len());
}
