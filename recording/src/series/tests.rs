//! Recordings as they come from spreadsheets, trackers and controllers, good and bad.

use super::*;
use proptest::prelude::*;

fn parse(text: &str) -> Result<Recording, Faults> {
    read_text("run.csv", text, None, None, RequiredData::Path)
}

#[test]
fn a_spreadsheets_export_is_read_and_reported() {
    let text =
        "\u{feff}t_s;q1_deg;q2_mm;x_mm;remark\r\n0;1,5;10;;a\r\n0,001;-1,5;nan;2;b\r\n0,002;1";
    let recording = parse(text).unwrap();
    assert_eq!(recording.len(), 2);
    assert_eq!(recording.column(Channel::Command(0)).unwrap()[0], 1.5_f64.to_radians());
    assert!(recording.column(Channel::Command(1)).unwrap()[1].is_nan());
    assert!(recording.column(Channel::Position(0)).unwrap()[0].is_nan());
    assert_eq!(
        (recording.joint_kind(0), recording.joint_kind(1)),
        (JointKind::Revolute, JointKind::Prismatic)
    );
    assert_eq!(recording.units, FileUnits::WORKSHOP);
    let notes = recording.notes.join("\n");
    for part in ["semicolons", "line 4 is truncated", "unused columns: remark"] {
        assert!(notes.contains(part), "{notes}");
    }
}

#[test]
fn every_fault_of_a_table_is_reported_with_row_and_column() {
    let text = "t_s,segment,q1_deg,q2_rad,ow,ox,oy,oz,fx_Nm,d1\n\
                0,0,1,2,1,0,0,0,0,1\n\
                1,0,one,2,1,0,0,0,0,1\n\
                1,0,1,inf,1,0,0,0,0,2\n\
                0.5,1,1,1,1,0.1,0,0,0,1\n\
                0.6,1,1\n";
    insta::assert_snapshot!(parse(text).unwrap_err(), @r#"
        error: `fx_Nm`: has a unit that does not fit
         --> run.csv:1:39
          |
        1 | t_s,segment,q1_deg,q2_rad,ow,ox,oy,oz,fx_Nm,d1
          |                                       ^^^^^ expected `fx_N`

        error: `q1_deg`: `one` is not a number
         --> run.csv:3:5
          |
        3 | 1,0,one,2,1,0,0,0,0,1
          |     ^^^ expected a number

        error: `t_s`: repeats: 1 after 1
         --> run.csv:4:1
          |
        4 | 1,0,1,inf,1,0,0,0,0,2
          | ^ expected strictly increasing times within a segment

        error: `q2_rad`: is infinite
         --> run.csv:4:7
          |
        4 | 1,0,1,inf,1,0,0,0,0,2
          |       ^^^ expected a finite number, or nothing

        error: `d1`: is 2
         --> run.csv:4:21
          |
        4 | 1,0,1,inf,1,0,0,0,0,2
          |                     ^ expected -1, 0 or 1

        error: `ow`: the quaternion's length is 1.004987562112089
         --> run.csv:5:11
          |
        5 | 0.5,1,1,1,1,0.1,0,0,0,1
          |           ^ expected unit length within 1e-3

        error: this row has 3 fields
         --> run.csv:6:1
          |
        6 | 0.6,1,1
          | ^^^^^^^ expected 10, like the header
        "#);
}

#[test]
fn what_is_needed_depends_on_the_use() {
    let path = "t_s,q1_deg\n0,1\n";
    assert!(parse(path).is_ok());
    assert!(read_text("x", path, None, None, RequiredData::Measurement).is_err());
    let force = "t_s,fx_N\n0,1\n";
    assert!(parse(force).is_err());
    assert!(read_text("x", force, None, None, RequiredData::Measurement).is_ok());
    assert!(parse("t_s,q1_deg\n").is_err());
    assert!(parse("").is_err());
}

#[test]
fn a_link_side_that_was_measured_alone_along_a_path_is_predicted_from_the_motor() {
    let kind = |text: &str| parse(text).unwrap().input_kind();
    assert_eq!(kind("t_s,q1_deg,qa1_deg,ql1_deg\n0,1,1,1\n1,2,2,2\n"), InputKind::Motor);
    assert_eq!(kind("t_s,q1_deg,ql1_deg\n0,1,1\n1,2,2\n"), InputKind::Command);
    let with_tool = "t_s,q1_deg,qa1_deg,ql1_deg,x_mm\n0,1,1,1,5\n1,2,2,2,6\n";
    assert_eq!(kind(with_tool), InputKind::Command);
    assert_eq!(kind("t_s,qa1_deg\n0,1\n1,2\n"), InputKind::Motor);
}

#[test]
fn time_may_restart_with_a_segment_only() {
    assert!(parse("t_s,segment,q1_deg\n0,0,1\n1,0,1\n0,1,1\n").is_ok());
    assert!(parse("t_s,segment,q1_deg\n0,0,1\n1,0,1\n0,0,1\n").is_err());
}

#[test]
fn joints_must_fit_the_model() {
    let recording = parse("t_s,q1_deg,q2_mm\n0,1,1\n").unwrap();
    assert!(recording.check_joints(&[JointKind::Revolute, JointKind::Prismatic]).is_ok());
    assert_eq!(recording.check_joints(&[JointKind::Revolute]).unwrap_err().len(), 1);
    assert_eq!(recording.check_joints(&[JointKind::Prismatic; 3]).unwrap_err().len(), 2);
}

#[test]
fn the_toml_beside_is_read_in_si_and_all_its_faults_are_reported() {
    let text = r#"
schema = "trued.recording/1"
kind = "poses"
approach = "sequence"
sigma = { x_mm = 0.03, q1_deg = 0.1 }
target2_mm = [0.0, 0.0, 50.0]
heldout = [3, 7]
[cut]
teeth = 2
diameter_mm = 6.0
axial_depth_mm = 0.25
coefficients_N_per_mm2 = [800.0, 300.0, 150.0]
coefficients_N_per_mm = [8.0, 10.0, 2.0]
"#;
    let about = RecordingMetadata::parse("run.toml", text).unwrap();
    let mut recording = Recording::new(vec![0.0]);
    recording.metadata = about.clone();
    assert_eq!(RecordingMetadata::parse("again", &recording.about_toml()).unwrap(), about);
    assert_eq!(about.sigma[&Channel::Position(0)], 3e-5);
    assert_eq!(about.targets_tool[&1], [0.0, 0.0, 0.05]);
    assert_eq!(about.heldout, HeldOut::Segments(vec![3, 7]));
    assert_eq!(about.cut.unwrap().cutting_pa, [8e8, 3e8, 1.5e8]);
    let text = "schema = \"trued.recording/2\"\nkid = \"poses\"\nsigma = { x_deg = 1 }\nheldout = \"al\"\n";
    insta::assert_snapshot!(RecordingMetadata::parse("run.toml", text).unwrap_err(), @r#"
        error: `schema`: is "trued.recording/2"
         --> run.toml:1:10
          |
        1 | schema = "trued.recording/2"
          |          ^^^^^^^^^^^^^^^^^^^ expected "trued.recording/1"

        error: `kid`: is an unknown key
         --> run.toml:2:1
          |
        2 | kid = "poses"
          | ^^^
          |
          = help: did you mean `kind`?

        error: `sigma`: `x_deg` has a wrong unit
         --> run.toml:3:9
          |
        3 | sigma = { x_deg = 1 }
          |         ^^^^^^^^^^^^^ expected `x_mm` or `x_m`

        error: `heldout`: is of type string
         --> run.toml:4:11
          |
        4 | heldout = "al"
          |           ^^^^ expected a list of segments, or "all"
        "#);
}

#[cfg(not(feature = "parquet"))]
#[test]
fn parquet_states_the_remedy() {
    let error = read(Path::new("run.parquet"), None, RequiredData::Path).unwrap_err();
    assert!(error.to_string().contains("CSV"), "{error}");
}

#[test]
fn a_written_file_appears_whole_and_reads_back() {
    let dir = std::env::temp_dir().join(format!("trued-series-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let path = dir.join("run.csv");
    let mut recording = Recording::new(vec![0.0, 0.001]);
    recording.set(Channel::Command(0), vec![0.1, 0.2]);
    recording.set(Channel::Target(1, 2), vec![1.0 / 3.0, f64::NAN]);
    recording.other.push(("status".to_owned(), vec!["corrected".to_owned(), "a,\"b".to_owned()]));
    write(&path, &recording).unwrap();
    let back = read(&path, None, RequiredData::Measurement).unwrap();
    assert_eq!(back.to_csv(), recording.to_csv());
    assert_eq!(back.other, recording.other);
    std::fs::remove_dir_all(&dir).unwrap();
}

fn bits(samples: &[f64]) -> Vec<u64> {
    samples.iter().map(|sample| sample.to_bits()).collect()
}

proptest! {
    #[test]
    fn si_files_read_back_to_the_same_bits(
        values in prop::collection::vec(-1e3..1e3_f64, 1..20), start in -1e6..1e6_f64,
    ) {
        let t_s = (0..values.len()).map(|row| start + row as f64).collect();
        let mut recording = Recording::new(t_s);
        recording.set_joint_kind(1, JointKind::Prismatic);
        for channel in [
            Channel::Command(0), Channel::Command(1), Channel::Torque(1), Channel::Position(0),
            Channel::Target(0, 0), Channel::Wrench(4), Channel::Spindle,
        ] {
            recording.set(channel, values.clone());
        }
        let text = String::from_utf8(recording.to_csv()).unwrap();
        let back = parse(&text).unwrap();
        prop_assert_eq!(bits(&back.t_s), bits(&recording.t_s));
        for channel in recording.channels() {
            let (a, b) = (back.column(channel).unwrap(), recording.column(channel).unwrap());
            prop_assert_eq!(bits(a), bits(b), "{:?}", channel);
        }
    }

    #[test]
    fn workshop_files_that_were_read_write_back_to_the_same_bits(
        values in prop::collection::vec(-1e3..1e3_f64, 1..20),
    ) {
        let mut text = "t_s,q1_deg,x_mm,feed_mm_s\n".to_owned();
        for (row, value) in values.iter().enumerate() {
            text.push_str(&format!("{row},{value},{value},{value}\n"));
        }
        let first = parse(&text).unwrap();
        let second = parse(&String::from_utf8(first.to_csv()).unwrap()).unwrap();
        for channel in first.channels() {
            let (a, b) = (first.column(channel).unwrap(), second.column(channel).unwrap());
            prop_assert_eq!(bits(a), bits(b));
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "[ -~\n\r;,\t\u{e9}]{0,200}", offset in 0_usize..300, byte in any::<u8>()) {
        let _ = parse(&text).map_err(|faults| faults.plain());
        let mut good = b"t_s,segment,q1_deg,x_mm,ow,ox,oy,oz\n0,0,1,2,1,0,0,0\n1,0,3,4,1,0,0,0\n".to_vec();
        let offset = offset % good.len();
        good[offset] = byte;
        let _ = parse(&String::from_utf8_lossy(&good)).map_err(|faults| faults.styled());
        let _ = RecordingMetadata::parse("x", &text).map_err(|faults| faults.plain());
    }
}

#[test]
fn distances_and_touches_are_read_with_what_the_toml_says_of_them() {
    let table = "t_s,q1_deg,distance1_mm,distance3_m,touch_plane,touch_sphere\n\
                 0,1,500.5,,0,2\n1,2,,0.7,1,\n";
    let about = "schema = \"trued.recording/1\"\nsigma = { distance1_mm = 0.002 }\n\
                 target3_on_link = 2\n\
                 [distance1]\nanchor_mm = [900.0, 0.0, 100.0]\ntarget = 2\noffset_mm = \"fitted\"\n\
                 [distance3]\noffset_mm = 0.25\n\
                 [probe]\nradius_mm = 3.0\nsigma_mm = 0.004\ntarget = 1\n\
                 [plane1]\nnormal = [0, 0, 2]\n\
                 [sphere2]\nradius_mm = 12.7\n";
    let about = RecordingMetadata::parse("run.toml", about).unwrap();
    let recording =
        read_text("run.csv", table, None, Some(about), RequiredData::Measurement).unwrap();
    let gauges = &recording.metadata.gauges;
    assert_eq!(recording.metadata.targets_on_link[&2], 2);
    assert_eq!(gauges.distances[&0].target, Some(1));
    assert_eq!(gauges.distances[&0].offset_m, None);
    assert_eq!(gauges.distances[&2].offset_m, Some(0.25e-3));
    assert_eq!(gauges.planes[&0], TouchedPlane { normal: [0.0, 0.0, 1.0], offset_m: None });
    assert_eq!(gauges.spheres[&1].radius_m, Some(12.7e-3));
    assert_eq!(recording.target_count(), 2);
    assert_eq!(recording.sigma(Channel::Distance(0)), Some(2e-6));
    let again = RecordingMetadata::parse("again.toml", &recording.about_toml()).unwrap();
    assert_eq!(again, recording.metadata);
}

#[test]
fn every_fault_of_distances_and_touches_is_reported() {
    let table = "t_s,q1_deg,distance1_mm,touch_plane,touch_sphere\n0,1,-1,2,0.5\n";
    let about = "schema = \"trued.recording/1\"\n[distance2]\n[sphere1]\n";
    let about = RecordingMetadata::parse("run.toml", about).unwrap();
    let faults =
        read_text("run.csv", table, None, Some(about), RequiredData::Measurement).unwrap_err();
    let message = faults.to_string();
    for part in ["below zero", "distance2", "is 0.5", "[probe]", "[plane2]", "never contacted"] {
        assert!(message.contains(part), "{part} in\n{message}");
    }
    let about = "schema = \"trued.recording/1\"\n[probe]\nradius_mm = -1\n[plane1]\nnormal = [0, 0, 0]\n[distance1]\nofset_mm = 1\n";
    let message = RecordingMetadata::parse("run.toml", about).unwrap_err().to_string();
    for part in ["radius_mm", "no direction", "ofset_mm"] {
        assert!(message.contains(part), "{part} in\n{message}");
    }
}
