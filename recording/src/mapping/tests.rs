//! Tables of other programs read through mappings.

use super::*;
use crate::faults::Faults;
use crate::series::{Channel, Recording, RecordingKind, RequiredData, read_text};
use proptest::prelude::*;

fn apply(mapping: &str, text: &str) -> Result<Recording, Faults> {
    let mapping = Mapping::parse("m.toml", mapping)?;
    read_text("x.csv", text, Some(&mapping), None, RequiredData::Path)
}

#[test]
fn unit_sign_scale_offset_order_and_skipped_rows_are_applied() {
    let mapping = r#"
        schema = "trued.mapping/1"
        skip_rows = 2
        comment = "%"
        decimal = ","
        separator = ";"
        [columns]
        t_s = { from = "time", unit = "ms" }
        "q*_deg" = { from = "axis*", order = [2, 1], sign = [-1, 1], scale = 2.0, offset = [0.5, 0.0] }
        x_mm = { from = "x", unit = "m" }
        temp_C = { constant = 21.5 }
    "#;
    let text = "made by\nsomebody\n% remark\ntime;axis1;axis2;x\n0;10,5;20;1,25\n1000;11;21;1,5\n";
    let recording = apply(mapping, text).unwrap();
    let deg =
        |joint, row: usize| recording.column(Channel::Command(joint)).unwrap()[row].to_degrees();
    assert_eq!(recording.t_s, [0.0, 1.0]);
    assert!((deg(0, 0) - (-2.0 * 20.0 + 0.5)).abs() < 1e-12);
    assert!((deg(1, 0) - 21.0).abs() < 1e-12);
    assert_eq!(recording.column(Channel::Position(0)).unwrap(), [1.25, 1.5]);
    assert_eq!(recording.column(Channel::Ambient).unwrap(), [21.5, 21.5]);
}

#[test]
fn columns_are_named_by_number_without_a_header() {
    let mapping = r#"
        schema = "trued.mapping/1"
        header = false
        separator = "space"
        [columns]
        t_s = { per_row = 0.25 }
        "q*_rad" = { from = [2, 1] }
    "#;
    let recording = apply(mapping, "1 2\n3 4\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 0.25]);
    assert_eq!(recording.column(Channel::Command(0)).unwrap(), [2.0, 4.0]);
    assert_eq!(recording.column(Channel::Command(1)).unwrap(), [1.0, 3.0]);
}

#[test]
fn without_a_header_commas_between_semicolons_or_tabulators_are_decimal_commas() {
    let mapping = "schema = \"trued.mapping/1\"\nheader = false\n[columns]\n\
                   t_s = { per_row = 1 }\nq1_rad = { from = 1 }\nq2_rad = { from = 2 }";
    for text in [
        "12,5;3,5\n13,5;4,5\n",
        "12,5;3,5;4,5;nan\n13,5;4,5;1,5;2,5\n",
        "12,5\t3,5\tok\n13,5\t4,5\tok\n",
        "12,5 ; 3,5\n13,5 ; 4,5\n",
        "12.5,\t3.5,\t1\n13.5,\t4.5,\t1\n",
        "12.5\t,3.5\t,1\n13.5\t,4.5\t,1\n",
        "12.5,3.5,\"7;8\"\n13.5,4.5,\"9\"\n",
        "12.5,3.5,a;b\n13.5,4.5,\n",
    ] {
        let recording = apply(mapping, text).unwrap_or_else(|faults| panic!("{text}\n{faults}"));
        assert_eq!(recording.column(Channel::Command(0)).unwrap(), [12.5, 13.5], "{text}");
        assert_eq!(recording.column(Channel::Command(1)).unwrap(), [3.5, 4.5], "{text}");
    }
}

#[test]
fn rows_are_chosen_and_repeated_times_left_out() {
    let mapping = r#"
        schema = "trued.mapping/1"
        repeated_time = "drop"
        keep = { arm = ["1"] }
        [columns]
        t_s = { from = "t" }
        segment = { from = "run", labels = true }
        q1_rad = { from = "q" }
    "#;
    let text = "t,run,arm,q\n1,a,1,1\n1,a,1,2\n2,a,2,3\n2,a,1,4\n1,b,1,5\n";
    let recording = apply(mapping, text).unwrap();
    assert_eq!(recording.column(Channel::Command(0)).unwrap(), [1.0, 4.0, 5.0]);
    assert_eq!(recording.segment, [0, 0, 1]);
    assert_eq!(recording.notes.len(), 3, "{:?}", recording.notes);
}

#[test]
fn texts_become_numbers_as_said_or_as_their_combinations_appear() {
    let mapping = |numbers: &str| {
        format!(
            r#"
        schema = "trued.mapping/1"
        [columns]
        t_s = {{ per_row = 1.0 }}
        segment = {{ from = ["run", "kind"], labels = true }}
        station = {{ from = "run", numbers = {{ {numbers} }} }}
        q1_rad = {{ from = ["q", "q"], sum = true, sign = -1 }}
    "#
        )
    };
    let text = "run,kind,q\na,x,1\na,y,2\nb,x,3\na,x,4\nc,x,5\n";
    let recording = apply(&mapping("a = 7, b = 8, c = 7"), text).unwrap();
    assert_eq!(recording.segment, [0, 1, 2, 0, 3]);
    assert_eq!(recording.column(Channel::Command(0)).unwrap()[1], -4.0);
    assert_eq!(recording.column(Channel::Station).unwrap(), [7.0, 7.0, 8.0, 7.0, 7.0]);
    let missing = apply(&mapping("a = 7, b = 8"), text).unwrap_err().to_string();
    for part in ["`run`: no number is defined for \"c\"", "x.csv:6:1", "one of: a, b", "`keep`"] {
        assert!(missing.contains(part), "{part} in\n{missing}");
    }
    let half = apply(&mapping("a = 7.5, b = 8, c = 7"), text).unwrap_err().to_string();
    assert!(half.contains("`station`: is 7.5") && half.contains("a whole number"), "{half}");
}

#[test]
fn faults_of_a_mapping_are_reported_together() {
    let mapping = r#"schema = "trued.mapping/1"
[columns]
t_s = { from = "t", unit = "deg" }
"q*_deg" = { from = "a*" }
x_deg = { from = "x" }
y_mm = { from = "y", constant = 1 }
"#;
    insta::assert_snapshot!(Mapping::parse("m.toml", mapping).unwrap_err(), @r#"
        error: `columns.t_s.unit`: is "deg"
         --> m.toml:3:28
          |
        3 | t_s = { from = "t", unit = "deg" }
          |                            ^^^^^ expected a unit of the same quantity as `t_s`

        error: `columns.q*_deg`: has one column per joint
         --> m.toml:4:12
          |
        4 | "q*_deg" = { from = "a*" }
          |            ^^^^^^^^^^^^^^^ expected `joints = N` at the top, or `order` here

        error: `columns.x_deg`: has a unit that does not fit
         --> m.toml:5:9
          |
        5 | x_deg = { from = "x" }
          |         ^^^^^^^^^^^^^^ expected `x_mm` or `x_m`

        error: `columns.y_mm`: has 2 sources
         --> m.toml:6:8
          |
        6 | y_mm = { from = "y", constant = 1 }
          |        ^^^^^^^^^^^^^^^^^^^^^^^^^^^^
          |
          = help: give exactly one of `from`, `constant`, `per_row`
        "#);
}

#[test]
fn a_column_of_theirs_that_is_not_there_is_reported() {
    let mapping = "schema = \"trued.mapping/1\"\n[columns]\nt_s = { from = \"tme\" }\nq1_rad = { from = \"q\" }";
    insta::assert_snapshot!(apply(mapping, "time,q\n1,2\n").unwrap_err(), @r#"
        error: `tme`: is not a column of this file
        --> x.csv
         = note: expected one of: time, q
         = help: did you mean `time`?

        error: `t_s`: is missing
        --> x.csv
         = note: expected time in s
         = help: rename the column, or use a mapping
        "#);
}

#[test]
fn a_name_that_appears_twice_in_the_header_is_refused_where_it_is_used() {
    let table = "t_s,J1,x,x\n0,1,10,77\n1,2,20,88\n";
    let mapping = |more: &str, columns: &str| {
        format!(
            "schema = \"trued.mapping/1\"\n{more}\n[columns]\nt_s = {{ from = \"t_s\" }}\nq1_deg = {{ from = \"J1\" }}\n{columns}"
        )
    };
    for mapping in [
        mapping("", "x_mm = { from = \"x\" }"),
        mapping("", "x_mm = { from = [\"J1\", \"x\"], sum = true }"),
        mapping("", "segment = { from = \"x\", labels = true }"),
        mapping("keep = { x = [\"10\"] }", ""),
        mapping(
            "",
            "orientation = { from = [\"t_s\", \"J1\", \"x\"], convention = \"xyz\", unit = \"deg\" }",
        ),
    ] {
        let message = apply(&mapping, table).unwrap_err().to_string();
        assert!(
            message.contains("`x`: appears twice in the header") && message.contains("x.csv:1:10"),
            "{mapping}\n{message}"
        );
    }
    assert!(apply(&mapping("", ""), table).is_ok());
}

#[test]
fn a_time_that_runs_back_is_reported_with_the_place_in_their_column() {
    let mapping = "schema = \"trued.mapping/1\"\n[columns]\nt_s = { from = \"time\" }\nq1_deg = { from = \"q\" }";
    let message = apply(mapping, "q,time\n1,5\n2,4\n").unwrap_err().to_string();
    assert!(message.contains("decreases: 4 after 5") && message.contains("x.csv:3:3"), "{message}");
}

fn real(mapping: &str, data: &str, need: RequiredData) -> Option<Recording> {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = std::env::var_os("TRUED_DATA")
        .map_or_else(|| root.join("../shared/data"), std::path::PathBuf::from);
    let file = folder.join(data);
    if !file.is_file() {
        eprintln!("SKIPPED: {} is not there (set TRUED_DATA)", file.display());
        return None;
    }
    let mapping = root.join("deploy/mappings").join(format!("{mapping}.mapping.toml"));
    match crate::series::read(&file, Some(&mapping), need) {
        Ok(recording) => Some(recording),
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn the_ur10e_runs_are_read_through_their_mapping() {
    for run in ["20_01_17-ptp_10_points", "20_02_19_14harm50secLoad", "20_01_22-joint_1"] {
        let file = format!("ur10e/ur-{run}.csv");
        let Some(recording) = real("ur10e", &file, RequiredData::Measurement) else { return };
        assert_eq!(recording.joint_count(), 6);
        assert!(recording.len() > 4000);
        assert!(recording.input(5).unwrap().iter().all(|q| q.abs() < 6.3));
        assert!(recording.column(Channel::Current(5)).is_some());
    }
}

#[test]
fn the_kuka_link_encoders_are_read_through_their_mapping() {
    let file = "kuka-link-encoder/traj_A.csv";
    let Some(recording) = real("kuka-link-encoder", file, RequiredData::Measurement) else {
        return;
    };
    assert_eq!((recording.len(), recording.joint_count()), (2501, 6));
    let motor = recording.column(Channel::Motor(1)).unwrap();
    let link = recording.column(Channel::Link(1)).unwrap();
    let apart = motor.iter().zip(link).map(|(m, l)| (m - l).abs()).fold(0.0, f64::max);
    assert!(apart < 0.3_f64.to_radians(), "{apart}");
    assert!(recording.column(Channel::Link(3)).is_none());
    assert!(recording.column(Channel::Torque(0)).unwrap()[0] > 500.0);
}

#[test]
fn tracker_poses_keep_the_distances_of_their_reflectors() {
    for (mapping, file, rows, nests, distance_mm) in [
        ("irb120-tracker", "irb120-tracker/poses_1000.csv", 1000, 3, 150.345),
        ("kuka-3smr", "kuka-3smr/poses_36.csv", 36, 0, 244.055),
    ] {
        let Some(recording) = real(mapping, file, RequiredData::Measurement) else { return };
        assert_eq!((recording.len(), recording.joint_count()), (rows, 6));
        assert_eq!(
            (recording.target_count(), recording.metadata.kind),
            (3 + nests, RecordingKind::Poses)
        );
        assert_eq!(
            recording.metadata.targets_on_link.values().filter(|link| **link == 0).count(),
            nests
        );
        let place = |target, row: usize| {
            [0, 1, 2].map(|axis| recording.column(Channel::Target(target, axis)).unwrap()[row])
        };
        for row in 0..rows {
            let (a, b) = (place(0, row), place(1, row));
            let squares = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>();
            assert!((squares.sqrt() * 1e3 - distance_mm).abs() < 0.2, "row {row}");
        }
    }
}

#[test]
fn both_motoman_arms_are_read_through_their_mappings() {
    let file = "motoman-leica/leica_poses_all.csv";
    for (arm, rows, segments) in [("right", 420, 11), ("left", 208, 1)] {
        let mapping = format!("motoman-leica-{arm}");
        let Some(recording) = real(&mapping, file, RequiredData::Measurement) else { return };
        assert_eq!((recording.len(), recording.joint_count()), (rows, 7));
        assert_eq!(recording.segment.iter().max(), Some(&(segments - 1)));
        assert_eq!(recording.sigma(Channel::Target(0, 2)), Some(6e-6));
    }
}

proptest! {
    #[test]
    fn no_mapping_makes_the_reader_panic(cut in 0_usize..400, byte in any::<u8>(), text in "[ -~\n]{0,80}") {
        let mut mapping = include_str!("../../../deploy/mappings/kuka-link-encoder.mapping.toml")
            .to_owned().into_bytes();
        let offset = cut % mapping.len();
        mapping[offset] = byte;
        let _ = apply(&String::from_utf8_lossy(&mapping), &text);
        let _ = apply(&text, "t,q\n1,2\n");
    }
}

#[test]
fn a_unit_in_the_name_of_a_source_column_that_is_read_in_another_is_refused() {
    let read = |from: &str, unit: &str| {
        let mapping = format!(
            "schema = \"trued.mapping/1\"\njoints = 1\n[columns]\nt_s = {{ from = \"t\" }}\nq1_deg = {{ from = \"q\" }}\n\
             x_mm = {{ from = \"{from}\"{unit} }}\ny_mm = {{ from = \"y\" }}\nz_mm = {{ from = \"z\" }}\n"
        );
        let text = format!("t,q,{from},y,z\n0,1,2,3,4\n1,2,2,3,4\n");
        apply(&mapping, &text).map_err(|faults| faults.plain())
    };
    let x = |recording: &Recording| recording.column(Channel::Position(0)).unwrap()[0];
    for name in ["x [m]", "x (m)", "x_m"] {
        let fault = read(name, "").unwrap_err();
        assert!(fault.contains("has the unit m in its name, but is read in mm"), "{fault}");
        assert!((x(&read(name, ", unit = \"m\"").unwrap()) - 2.0).abs() < 1e-12);
    }
    for name in ["x [mm]", "x_mm", "x", "x (filtered)", "x_s"] {
        assert!((x(&read(name, "").unwrap()) - 2e-3).abs() < 1e-12, "{name}");
    }
}
