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

#[test]
fn a_damaged_parquet_file_is_refused_with_our_message_alone() {
    let place = Place::new();
    place.file("tiny.csv", "t_s,q1_deg\n0,1\n1,2\n");
    place.succeed(&["convert", "tiny.csv", "--out", "tiny.parquet"]);
    let mut bytes = std::fs::read(place.path("tiny.parquet")).unwrap();
    // The type of the first page: data in place of its dictionary, on which the library panics.
    assert_eq!(bytes[4..6], [0x15, 0x04]);
    bytes[5] = 2;
    std::fs::write(place.path("damaged.parquet"), bytes).unwrap();
    let done = place.run(&["correct", "--model", "irb120", "damaged.parquet"]);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(done.err.contains("cannot be read as Parquet: its data are inconsistent"), "{done:#?}");
    assert!(done.err.starts_with("error: ") && !done.err.contains("panicked"), "{done:#?}");
}

#[test]
fn a_recording_that_is_given_twice_does_not_count_twice() {
    let place = Place::new();
    place.file("poses.csv", POSES);
    place.file("poses.mapping.toml", MAPPING);
    for again in ["poses.csv", "./poses.csv"] {
        let done = place.run(&["diagnose", "--model", "irb120", "poses.csv", again]);
        assert_eq!(done.code, Some(2), "{done:#?}");
        assert!(done.err.contains("is given twice"), "{done:#?}");
    }
}

#[test]
fn a_mapping_of_the_same_name_or_one_that_is_given_is_no_part_of_a_wav_file() {
    let place = Place::new();
    let head = b"RIFF\x24\x10\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x40\x1f\0\0\x80\x3e\0\0\x02\0\x10\0data\0\x10\0\0";
    let samples: Vec<u8> = (0..2048_i16).flat_map(|k| (k % 97).to_le_bytes()).collect();
    std::fs::write(place.path("hit.wav"), [&head[..], &samples].concat()).unwrap();
    place.file("hit.mapping.toml", MAPPING);
    let checked = place.succeed(&["check", "hit.wav"]);
    assert!(checked.out.contains("ok: hit.wav: WAV, 2048 samples"), "{checked:#?}");
    place.succeed(&["spectrum", "hit.wav"]);
    let done = place.run(&["spectrum", "hit.wav", "--mapping", "hit.mapping.toml"]);
    assert_eq!(done.code, Some(2), "{done:#?}");
    assert!(done.err.contains("is WAV, which no mapping describes"), "{done:#?}");
    assert!(done.err.contains("leave out the mapping (--mapping FILE)"), "{done:#?}");
}

#[test]
fn a_number_below_zero_is_answered_by_the_check_of_its_option() {
    let place = Place::new();
    place.file("poses.csv", POSES);
    for arguments in [
        &["spectrum", "--rate", "-5", "poses.csv"][..],
        &["simulate", "--model", "irb120", "--out", "made", "--noise", "-1", "poses.csv"],
        &["plan", "--model", "irb120", "--sigma-mm", "-1"],
        &["tap", "--rate", "-3", "poses.csv"],
        &["gears", "--model", "irb120", "--lines", "-1", "poses.csv"],
        &["surface", "--cut-off-mm", "-1", "poses.csv"],
        &["bench", "--seconds", "-1"],
    ] {
        let done = place.run(arguments);
        assert_eq!(done.code, Some(2), "{arguments:?}: {done:#?}");
        assert!(!done.err.contains("unexpected argument"), "{arguments:?}: {done:#?}");
    }
    assert_eq!(place.names(), ["poses.csv"]);
}

#[test]
fn a_pipe_is_read_once_and_from_its_beginning() {
    let place = Place::new();
    let joints: String =
        (0..40).map(|k| format!("{:.3},{k},0,0,0,30,0\n", 0.004 * f64::from(k))).collect();
    place.file("path.csv", &format!("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n{joints}"));
    let force: String =
        (0..2000).map(|k| format!("{:.4},{}\n", 5e-4 * f64::from(k), k % 40)).collect();
    place.file("force.csv", &format!("t_s,fx_N\n{force}"));
    for (arguments, file, part) in [
        (&["check", "/dev/stdin"][..], "path.csv", "path, 40 rows"),
        (&["simulate", "--model", "irb120", "--out", "made", "/dev/stdin"], "path.csv", "40 rows"),
        (&["correct", "--model", "irb120", "--out", "c.csv", "/dev/stdin"], "path.csv", "40 rows"),
        (&["spectrum", "/dev/stdin"], "force.csv", "1.00 s at 2000.0 Hz, fx_N"),
    ] {
        let done = place.run_fed(&place.read(file), arguments);
        assert_eq!(done.code, Some(0), "{arguments:?}: {done:#?}");
        assert!(done.out.contains(part), "{part} in {done:#?}");
    }
    let broken = place.run_fed(
        "t_s,q1_deg\n0,x\n",
        &["simulate", "--model", "irb120", "--out", "b", "/dev/stdin"],
    );
    assert!(broken.code == Some(2) && broken.err.contains("`x` is not a number"), "{broken:#?}");
}

#[test]
fn a_remedy_names_the_options_that_the_command_has() {
    let place = Place::new();
    place.file("path.csv", "t_s,q1_deg\n0,1\n0.1,2\n0.2,3\n");
    for (command, options) in [
        ("tap", "(--force C, --response C)"),
        ("spectrum", "(--column C)"),
        ("surface", "(--column C)"),
    ] {
        let done = place.run(&[command, "path.csv"]);
        assert_eq!(done.code, Some(2), "{done:#?}");
        assert!(done.err.contains(options), "{options} in {done:#?}");
    }
}
