//! Invalid recordings: a clear error without output, or `undetermined` with the reason; never a
//! finding.

use serde_json::Value;

use crate::diagnose::{BASE, path, recorded};
use crate::program::{Done, Place};

/// A table in memory: a header, and rows of numbers as text.
#[derive(Clone)]
struct Sheet {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Sheet {
    fn parse(text: &str) -> Self {
        let mut lines =
            text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self { header: lines.next().expect("a header"), rows: lines.collect() }
    }

    fn text(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows);
        lines.map(|line| line.join(",") + "\n").collect()
    }

    fn index(&self, name: &str) -> usize {
        self.header.iter().position(|column| column == name).expect(name)
    }

    /// The same with changed numbers in these columns, by row.
    fn with(&self, names: &[&str], change: impl Fn(usize, f64) -> f64) -> Self {
        let mut sheet = self.clone();
        for column in names.iter().map(|name| self.index(name)) {
            for (k, row) in sheet.rows.iter_mut().enumerate() {
                row[column] = change(k, row[column].parse().expect("a number")).to_string();
            }
        }
        sheet
    }

    fn value(&self, name: &str, row: usize) -> f64 {
        self.rows[row][self.index(name)].parse().expect("a number")
    }

    fn swapped(&self, one: &str, other: &str) -> Self {
        let (a, b) = (self.index(one), self.index(other));
        let mut sheet = self.clone();
        sheet.header.swap(a, b);
        sheet
    }
}

const JOINTS: [&str; 6] = ["q1_deg", "q2_deg", "q3_deg", "q4_deg", "q5_deg", "q6_deg"];
const TOOL: [&str; 3] = ["x_mm", "y_mm", "z_mm"];

fn recorded_sheet() -> (Place, Sheet) {
    let place = recorded("");
    let sheet = Sheet::parse(&place.read("seen.csv"));
    (place, sheet)
}

fn diagnose(place: &Place, name: &str, text: &str, model: &str) -> Done {
    place.file(&format!("{name}.csv"), text);
    let csv = format!("{name}.csv");
    place.run(&["diagnose", "--model", model, "--out", name, "--seed", "1", &csv])
}

fn result(place: &Place, name: &str, done: &Done) -> Value {
    assert_eq!(done.code, Some(0), "{name}: {done:#?}");
    place.json(&format!("{name}/diagnosis.json"))
}

/// A sentence with one of these words states why there is no result.
fn assert_undetermined(place: &Place, name: &str, text: &str, model: &str, arguments: &[&str]) {
    let result = result(place, name, &diagnose(place, name, text, model));
    assert_eq!(result["verdict"], "undetermined", "{name}: {result:#}");
    assert_eq!(result["findings"], Value::Array(Vec::new()), "{name}: {result:#}");
    let why = result["unexplained"]["says"].as_str().expect("a sentence");
    assert!(arguments.iter().any(|part| why.contains(part)), "{name}: {why}");
}

fn assert_nothing_found(place: &Place, name: &str, text: &str, part: &str) {
    let result = result(place, name, &diagnose(place, name, text, BASE));
    assert_eq!(result["findings"], Value::Array(Vec::new()), "{name}: {result:#}");
    let notes = result["notes"].to_string() + &result["verdict"].to_string();
    assert!(notes.contains(part), "{name}: {result:#}");
}

/// Numbers between −0.5 and 0.5 without any pattern.
fn chance(k: usize) -> f64 {
    let mixed = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((mixed ^ (mixed >> 32)) >> 11) as f64 / 9_007_199_254_740_992.0 - 0.5
}

#[test]
fn invalid_recordings_are_refused_without_output() {
    let (place, sheet) = recorded_sheet();
    let whole = sheet.text();
    let still = sheet.with(&["t_s"], |_, _| 1.0).text();
    let back = sheet.with(&["t_s"], |_, t| -t).text();
    let nan = sheet.with(&TOOL, |_, _| f64::NAN).text();
    let infinite = sheet.with(&["q2_deg"], |k, q| if k == 7 { f64::INFINITY } else { q }).text();
    let text_in_time = whole.replacen("0.02,", "soon,", 1);
    let joints_only: String = whole.replacen(",x_mm,y_mm,z_mm", ",a,b,c", 1);
    let files = [
        ("empty", ""),
        ("header", whole.lines().next().expect("a header")),
        ("half-a-header", &whole[..20]),
        ("bytes", "\u{1}\u{2}PAR1\u{0}\u{7f}"),
        ("still", &still),
        ("back", &back),
        ("nan", &nan),
        ("infinite", &infinite),
        ("words", &text_in_time),
        ("joints-only", &joints_only),
        ("a-joint-less", &whole.replacen("q6_deg", "other", 1)),
    ];
    for (name, text) in files {
        let done = diagnose(&place, name, text, BASE);
        assert_eq!(done.code, Some(2), "{name}: {done:#?}");
        assert!(!place.path(name).exists(), "{name}");
        assert!(!done.err.is_empty(), "{name}: says why");
    }
    let seven = diagnose(&place, "seven", &whole, "fr3");
    assert_eq!(seven.code, Some(2), "{seven:#?}");
}

#[test]
fn constant_and_meagre_recordings_are_not_judged() {
    let (place, sheet) = recorded_sheet();
    let check = |name, sheet: &Sheet, parts: &[&str]| {
        assert_undetermined(&place, name, &sheet.text(), BASE, parts);
    };
    let one = Sheet { rows: sheet.rows[..1].to_vec(), ..sheet.clone() };
    check("one-row", &one, &["record more"]);
    check("constant-joints", &sheet.with(&JOINTS, |_, _| 10.0), &["no joint moves"]);
    check("constant-tool", &sheet.with(&TOOL, |_, _| 500.0), &["never change"]);
    let few = sheet.with(&TOOL, |k, x| if k % 90 == 0 { x } else { f64::NAN });
    check("few-readings", &few, &["record more"]);
}

#[test]
fn columns_under_the_wrong_name_or_unit_are_not_judged() {
    let (place, sheet) = recorded_sheet();
    let check = |name: &str, sheet: &Sheet, parts: &[&str]| {
        assert_undetermined(&place, name, &sheet.text(), BASE, parts);
    };
    for (a, b) in [(1, 2), (1, 4), (2, 3), (2, 5), (3, 5), (4, 5)] {
        let swapped = sheet.swapped(JOINTS[a - 1], JOINTS[b - 1]);
        check(&format!("swapped-{a}-{b}"), &swapped, &["swapped", "single"]);
    }
    for joint in 1..=5 {
        let turned = sheet.with(&[JOINTS[joint - 1]], |_, q| -q);
        check(&format!("turned-{joint}"), &turned, &["opposite sign", "mirrored", "zero of"]);
    }
    check("radians", &sheet.with(&JOINTS, |_, q| q.to_radians()), &["radians, but degrees"]);
    let text = sheet.text().replace("_deg", "_rad");
    assert_undetermined(&place, "degrees", &text, BASE, &["degrees, but radians", "single"]);
    check("metres", &sheet.with(&TOOL, |_, x| 1e-3 * x), &["factor of 1000 too small"]);
    check("mirrored", &sheet.swapped("x_mm", "y_mm"), &["mirrored"]);
    check("one-axis-turned", &sheet.with(&["z_mm"], |_, z| -z), &["mirrored"]);
}

#[test]
fn another_robot_or_numbers_by_chance_are_not_judged() {
    let (place, sheet) = recorded_sheet();
    let text = sheet.text();
    for model in ["irb120", "kuka-kr240", "fanuc-r2000ib", "ur10e"] {
        assert_undetermined(&place, model, &text, model, &["of this robot", "the tool differs"]);
    }
    let random = sheet.with(&TOOL, |k, _| 1e3 * chance(k));
    assert_undetermined(&place, "random", &random.text(), BASE, &["single"]);
    let small = sheet.with(&TOOL, |k, _| 1e-2 * chance(k));
    assert_undetermined(&place, "small", &small.text(), BASE, &["single", "thousand"]);
    let mut shuffled = sheet.clone();
    let count = sheet.rows.len();
    for (k, row) in shuffled.rows.iter_mut().enumerate() {
        for name in TOOL {
            row[sheet.index(name)].clone_from(&sheet.rows[k * 397 % count][sheet.index(name)]);
        }
    }
    assert_undetermined(&place, "shuffled", &shuffled.text(), BASE, &["single"]);
}

#[test]
fn an_input_that_freezes_half_way_is_not_judged() {
    let (place, sheet) = recorded_sheet();
    let half = sheet.rows.len() / 2;
    for name in &JOINTS[..5] {
        let held = sheet.value(name, half);
        let frozen = sheet.with(&[name], |k, q| if k < half { q } else { held });
        let label = &name[..2];
        assert_undetermined(
            &place,
            label,
            &frozen.text(),
            BASE,
            &[&format!("joint {}", &name[1..2]), "single"],
        );
    }
}

#[test]
fn readings_that_freeze_or_are_cut_off_or_break_off_are_left_out_and_nothing_is_found() {
    let (place, sheet) = recorded_sheet();
    let half = sheet.rows.len() / 2;
    let held = sheet.value("y_mm", half);
    let frozen = sheet.with(&["y_mm"], |k, y| if k < half { y } else { held });
    assert_nothing_found(&place, "frozen", &frozen.text(), "y_mm is constant");
    let most = (0..sheet.rows.len()).map(|k| sheet.value("x_mm", k)).fold(f64::MIN, f64::max);
    let cut = sheet.with(&["x_mm"], |_, x| x.min(most - 40.0));
    assert_nothing_found(&place, "cut-off", &cut.text(), "x_mm is clipped");
    let text = sheet.text();
    assert_nothing_found(&place, "truncated", &text[..text.len() * 2 / 3], "consistent");
    let outliers = sheet.with(&TOOL, |k, x| if k % 50 == 3 { x + 30.0 } else { x });
    assert_nothing_found(&place, "outliers", &outliers.text(), "are outliers of the final model");
}

/// Joint positions on the link side, without other measurements.
#[test]
fn link_side_positions_of_another_joint_or_unit_are_not_judged() {
    let place = recorded("");
    let path = Sheet::parse(&path());
    let mut links = path.clone();
    for row in &mut links.rows {
        row.truncate(7);
        for joint in 0..6 {
            let value: f64 = row[1 + joint].parse().expect("a number");
            row.push((value + 1e-3 * chance(value.to_bits() as usize >> 1)).to_string());
        }
    }
    links.header.truncate(7);
    links.header.extend((1..=6).map(|joint| format!("ql{joint}_deg")));
    let check = |name: &str, sheet: &Sheet| {
        assert_undetermined(&place, name, &sheet.text(), BASE, &["joint"]);
    };
    assert_nothing_found(&place, "sound", &links.text(), "consistent");
    check("link-swapped", &links.swapped("ql2_deg", "ql3_deg"));
    check("link-turned", &links.with(&["ql4_deg"], |_, q| -q));
    let all = ["ql1_deg", "ql2_deg", "ql3_deg", "ql4_deg", "ql5_deg", "ql6_deg"];
    check("link-radians", &links.with(&all, |_, q| q.to_radians()));
    let random = all.iter().enumerate().fold(links.clone(), |sheet, (joint, name)| {
        sheet.with(&[name], |k, _| 90.0 * chance(k + 1000 * joint))
    });
    check("link-random", &random);
}
