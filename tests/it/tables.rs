//! Tables of other programs: the output of `check`, refused tables, and duplicate columns.

use crate::program::Place;

const POSES: &str = "t,J1,J2,J3,J4,J5,J6,X,Y,Z,Rx,Ry,Rz\n\
    0,5,-15,10,20,-30,8,900,60,1050,175.0,4.0,2.0\n\
    1,8,-18,10,20,-30,8,905,75,1048,174.0,4.5,6.0\n";
const MAPPING: &str = r#"schema = "trued.mapping/1"
joints = 6
[columns]
t_s = { from = "t" }
"q*_deg" = { from = "J*" }
x_mm = { from = "X" }
y_mm = { from = "Y" }
z_mm = { from = "Z" }
orientation = { from = ["Rx", "Ry", "Rz"], convention = "xyz", unit = "deg" }
[recording]
kind = "poses"
measuring_frame = "base"
"#;

#[test]
fn check_shows_the_first_rows_of_a_mapping_as_they_are_understood() {
    let place = Place::new();
    place.file("poses.csv", POSES);
    place.file("poses.mapping.toml", MAPPING);
    let done = place.succeed(&["check", "poses.mapping.toml", "--json", "check.json"]);
    let line = |name: &str| {
        let found = done.out.lines().find(|line| line.trim_start().starts_with(name));
        found.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).unwrap_or_default()
    };
    assert_eq!(line("column"), "column from row 1 row 2");
    assert_eq!(line("q2_deg"), "q2_deg J2 -15 -18");
    assert_eq!(line("x_mm"), "x_mm X 900 905");
    // scipy 1.17.1: Rotation.from_euler("xyz", [175, 4, 2], degrees=True).as_quat() begins with 0.99826099.
    assert!(line("ox").starts_with("ox Rx 0.99826099"), "{}", done.out);
    let report = place.json("check.json");
    let column = |name: &str| {
        let columns = report["files"][0]["columns"].as_array().unwrap();
        columns.iter().find(|column| column["name"] == name).cloned().unwrap_or_default()
    };
    assert_eq!(column("z_mm")["first"], serde_json::json!([1050.0, 1048.0]));
    assert_eq!(column("q1_deg")["from"], "J1");
    // Without a recording, the mapping alone is checked; with one that it does not fit, the faults
    // are the recording's.
    place.file("alone.mapping.toml", MAPPING);
    place.succeed(&["check", "alone.mapping.toml"]);
    place.file("poses.csv", &POSES.replace("Rx", "RX"));
    let done = place.run(&["check", "poses.mapping.toml"]);
    assert_eq!(done.code, Some(1));
    assert!(done.out.contains("did you mean `RX`?"), "{}", done.out);
}

#[test]
fn thousands_that_may_be_decimals_are_refused_with_line_column_and_way_out() {
    let place = Place::new();
    let text = "t_s;q1_deg;x_mm;y_mm;z_mm\n0;5,5;1.042;88,5;1.075\n1;7,5;1.051;88,5;1.080\n";
    place.file("poses.csv", text);
    place.file("poses.toml", "schema = \"trued.recording/1\"\nkind = \"poses\"\n");
    let done = place.run(&["check", "poses.csv"]);
    assert_eq!(done.code, Some(1));
    for part in ["poses.csv:2:7", "`1.042` is ambiguous: 1042 or 1.042", "`thousands = \".\"`"] {
        assert!(done.out.contains(part), "{part} in\n{}", done.out);
    }
    let stated = "schema = \"trued.mapping/1\"\ndecimal = \",\"\nthousands = \".\"\n";
    place.file("poses.mapping.toml", stated);
    let done = place.succeed(&["check", "poses.csv"]);
    let fields: Vec<&str> = done.out.split_whitespace().collect();
    assert!(fields.windows(4).any(|w| w == ["x_mm", "x_mm", "1042", "1051"]), "{}", done.out);
}

#[test]
fn readings_under_two_names_are_reported_by_check_and_refused_by_a_fit() {
    let place = Place::new();
    let mut text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg".to_owned();
    for target in 1..=2 {
        for axis in ["x", "y", "z"] {
            text += &format!(",target{target}_{axis}_mm");
        }
    }
    text.push('\n');
    for row in 0..40 {
        let joints = [0, 1, 2, 3, 4, 5].map(|joint| f64::from(row * (joint + 1) % 17));
        let place = [900.0, 10.0, 1000.0].map(|mm| mm + f64::from(row * 7 % 31) * 0.25);
        let numbers: Vec<String> =
            joints.iter().chain(&place).chain(&place).map(f64::to_string).collect();
        text += &format!("{row},{}\n", numbers.join(","));
    }
    place.file("twins.csv", &text);
    place.file("twins.toml", "schema = \"trued.recording/1\"\nkind = \"poses\"\n");
    let done = place.succeed(&["check", "twins.csv"]);
    assert!(
        done.out.contains("`target2` has exactly the same values as `target1`"),
        "{}",
        done.out
    );
    let model = ["--model", "irb1600-6-145"];
    for command in [&["diagnose", "--out", "said"][..], &["calibrate", "--out", "new.toml"]] {
        let done = place.run(&[command, &model, &["twins.csv"]].concat());
        assert_eq!(done.code, Some(2), "{command:?}: {done:#?}");
        assert!(done.err.contains("has exactly the same values as `target1`"), "{}", done.err);
    }
    assert_eq!(place.names(), ["twins.csv", "twins.toml"]);
}
