//! Properties of real URDF files: placeholder masses, the controller's frames as leaves, invalid limits, and XML
//! that a strict parser would refuse.

use super::tests::{ARM, read};
use super::{ChainEnds, Import, parse};
use crate::faults::Faults;

/// The arm after one change.
fn changed(from: &str, to: &str) -> Result<Import, Faults> {
    assert!(ARM.contains(from), "{from}");
    read(&ARM.replacen(from, to, 1))
}

fn refusal(from: &str, to: &str) -> String {
    changed(from, to).unwrap_err().plain()
}

const MASS: &str = "<mass value=\"3\"/>";
const INERTIA: &str =
    "<inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.05\"/>";

#[test]
fn a_placeholder_inertia_is_a_point_mass_and_the_geometry_is_read_all_the_same() {
    let wanted = read(ARM).unwrap().model;
    let moments = |xx: &str, xy: &str, yy: &str, zz: &str| {
        format!(r#"<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>"#)
    };
    let forms = [
        (String::new(), "has no <inertia>"),
        ("<inertia ixx=\"1\"/>".to_owned(), "missing or non-finite moment"),
        (moments("nan", "0", "1", "1"), "missing or non-finite moment"),
        (moments("0", "0", "0", "0"), "has an inertia of zero"),
        (moments("1e-8", "1e-8", "1e-8", "1e-8"), "has an unphysical inertia"),
        (moments("-1", "0", "1", "1"), "has an unphysical inertia"),
        (moments("1", "0", "1", "3"), "has an unphysical inertia"),
        (moments("1", "5", "1", "1"), "has an unphysical inertia"),
    ];
    for (inertia, why) in forms {
        let import = changed(INERTIA, &inertia).unwrap();
        let mut file = import.model.file.clone();
        let body = file.joints[0].link.unwrap();
        assert_eq!((body.mass_kg, body.inertia_kgm2), (3.0, None), "{inertia}");
        file.joints[0].link = wanted.file.joints[0].link;
        assert_eq!(file, wanted.file, "{inertia}");
        let [note] = import.notes.as_slice() else { panic!("{:?}", import.notes) };
        assert!(note.starts_with("link arm has") && note.contains(why), "{note}");
        assert!(note.ends_with("imported as a point mass of 3 kg"), "{note}");
    }
}

#[test]
fn a_link_without_a_mass_is_none_and_that_is_reported() {
    for (mass, why) in [
        ("", "no finite mass"),
        ("<mass/>", "no finite mass"),
        ("<mass value=\"inf\"/>", "no finite mass"),
        ("<mass value=\"0\"/>", "a mass of 0 kg"),
        ("<mass value=\"-2\"/>", "a mass of -2 kg"),
    ] {
        let import = changed(MASS, mass).unwrap();
        assert_eq!(import.model.file.joints[0].link, None, "{mass}");
        assert_eq!(import.notes, [format!("link arm has {why}; imported without mass")]);
    }
}

/// The arm with the controller's frames as ROS-Industrial has them.
fn industrial() -> String {
    let frame = |name: &str, parent: &str, origin: &str| {
        format!(
            r#"<link name="{name}"/><joint name="to_{name}" type="fixed"><origin {origin}/>
            <parent link="{parent}"/><child link="{name}"/></joint>"#
        )
    };
    let frames = frame("base", "base_link", r#"xyz="0 0 0.45" rpy="0 0 3.141592653589793""#)
        + &frame("flange", "hand", r#"xyz="0.1 0 0""#)
        + &frame("tool0", "hand", r#"xyz="0.1 0 0" rpy="0 1.5707963267948966 0""#);
    ARM.replace("\"base\"", "\"base_link\"").replace("</robot>", &(frames + "</robot>"))
}

#[test]
fn the_controllers_base_is_a_fixed_leaf_that_can_be_named_and_its_difference_is_reported() {
    let text = industrial();
    let import = read(&text).unwrap();
    assert_eq!((import.base.as_str(), import.tip.as_str()), ("base_link", "tool0"));
    assert_eq!(
        import.notes,
        [
            "the base frame is `base_link`; `base` differs: in `base_link` it is at xyz 0.000 0.000 450.000 mm, \
             rpy 0.000 0.000 180.000 deg (state it as base to select it)",
            "the tip frame is `tool0`; `flange` differs: in `tool0` it is at xyz 0.000 0.000 0.000 mm, \
             rpy 0.000 -90.000 0.000 deg (state it as tip to select it)",
        ]
    );
    for tip in [None, Some("tool0")] {
        let import = parse("x", &text, &ChainEnds { base: Some("base"), tip }).unwrap();
        let file = &import.model.file;
        assert_eq!((import.base.as_str(), import.tip.as_str()), ("base", "tool0"));
        let [x, y, z] = file.joints[0].point_mm.unwrap();
        assert!((x, y) == (0.0, 0.0) && (z - 50.0).abs() < 1e-9, "{x} {y} {z}");
        let slide = file.joints[1].axis;
        assert!((slide[0] + 1.0).abs() < 1e-12 && slide[1].abs() < 1e-12, "{slide:?}");
        assert!((file.tool.tcp_mm[0] + 400.0).abs() < 1e-9, "{:?}", file.tool.tcp_mm);
        let centre = file.joints[0].link.unwrap().com_mm;
        assert!((centre[0] + 100.0).abs() < 1e-9 && (centre[2] - 50.0).abs() < 1e-9, "{centre:?}");
        assert!(import.notes[0].starts_with("the base frame is `base`; `base_link` differs"));
    }
}

#[test]
fn two_leaves_on_one_link_without_a_usual_name_are_left_to_the_user() {
    let text = industrial().replace("tool0", "left").replace("flange", "right");
    let message = read(&text).unwrap_err().plain();
    assert!(message.contains("branches into 2 ends"), "{message}");
}

#[test]
fn limits_that_are_none_are_refused_for_what_they_are() {
    let turn = "<limit lower=\"-3\" upper=\"3\" velocity=\"2\" effort=\"10\"/>";
    let slide = "<limit lower=\"0\" upper=\"0.4\" velocity=\"0\" effort=\"10\"/>";
    for (limit, with, why) in [
        (turn, "", "`joint turn`: has no <limit>"),
        (turn, "<limit velocity=\"2\"/>", "has neither `lower` nor `upper`, which means 0 to 0"),
        (turn, "<limit lower=\"0\" upper=\"0\"/>", "has lower and upper both at 0"),
        (turn, "<limit lower=\"3\" upper=\"-3\"/>", "has lower 3 above upper -3"),
        (turn, "<limit lower=\"1\"/>", "has no `upper`, which means 0: 1 to 0"),
        (turn, "<limit lower=\"-1,5\" upper=\"1,5\"/>", "limit lower`: is \"-1,5\""),
        (turn, "<limit lower=\"nan\" upper=\"3\"/>", "limit lower`: is \"nan\""),
        (slide, "<limit lower=\"-inf\" upper=\"inf\"/>", "is infinite: -inf to inf"),
    ] {
        let told = refusal(limit, with);
        assert!(told.contains(why), "{told}");
        assert_eq!(
            told.matches("error:").count(),
            1 + usize::from(with.contains("1,5\" upper")),
            "{told}"
        );
    }
    for (limit, low, high, why) in [
        ("<limit lower=\"-inf\" upper=\"inf\" velocity=\"inf\"/>", -360.0, 360.0, "infinite limit"),
        ("<limit lower=\"-1e16\" upper=\"1e16\"/>", -360.0, 360.0, "infinite limit"),
        ("<limit upper=\"3.141592653589793\"/>", 0.0, 180.0, "has no `lower` limit: 0"),
    ] {
        let import = changed(turn, limit).unwrap();
        assert_eq!(import.model.file.joints[0].limits, [low, high]);
        assert_eq!(import.model.file.joints[0].max_speed, None);
        assert!(import.notes[0].contains(why), "{:?}", import.notes);
    }
}

#[test]
fn what_a_strict_parser_of_xml_refuses_is_the_same_robot() {
    let wanted = read(ARM).unwrap();
    for (head, from, to) in [
        ("<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>\n", "", ""),
        ("\n<!-- first --><?xml version=\"1.0\"?>", "", ""),
        ("<!DOCTYPE robot SYSTEM \"urdf.dtd\">\n", "", ""),
        ("<!-- a -- b ---->", "", ""),
        ("", "<link name=\"hand\"/>", "<link name=\"hand\"><sensor:camera a:b=\"c:d\"/></link>"),
        (
            "",
            "<robot ",
            "<robot xmlns=\"http://www.ros.org\" xmlns:xacro=\"http://ros.org/wiki/xacro\" ",
        ),
    ] {
        let text = format!("{head}{}", ARM.replacen(from, to, 1));
        let import = read(&text).unwrap_or_else(|faults| panic!("{}", faults.plain()));
        assert_eq!((import.model.file, import.notes), (wanted.model.file.clone(), vec![]));
    }
    let entity = "<!DOCTYPE r [<!ENTITY up \"0 0 1\">]>\n".to_owned()
        + &ARM.replace("\"0 0 1\"", "\"&up;\"");
    let message = read(&entity).unwrap_err().plain();
    assert!(message.contains("entities of a DOCTYPE are not expanded"), "{message}");
    let two = read(&format!("{ARM}{ARM}")).unwrap_err().plain();
    assert!(two.contains("contains several <robot>"), "{two}");
}

#[test]
fn several_roots_are_reported_and_a_base_of_another_tree_is_refused() {
    let text = ARM.replace("</robot>", "<link name=\"world\"/></robot>");
    let import = read(&text).unwrap();
    assert_eq!(
        import.notes,
        ["the file has 2 roots (`base`, `world`); the chain belongs to `base`"]
    );
    let ends = ChainEnds { base: Some("world"), tip: Some("hand") };
    let message = parse("x", &text, &ends).unwrap_err().plain();
    assert!(message.contains("no joint connects the links `world` and `hand`"), "{message}");
}

#[test]
fn a_file_in_latin_1_is_read_and_an_assumed_encoding_is_reported() {
    let path = std::env::temp_dir().join(format!("trued-latin-{}.urdf", std::process::id()));
    let named = ARM.replace("name=\"turn\"", "name=\"Drehung f\u{fc}r A1\"");
    for (head, notes) in [("<?xml version=\"1.0\" encoding=\"latin1\"?>\n", 0), ("", 1)] {
        let text = format!("{head}{named}");
        let bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
        std::fs::write(&path, bytes).unwrap();
        let import = super::read(&path, &ChainEnds::default()).unwrap();
        assert_eq!(import.model.file.joints[0].name, "Drehung f\u{fc}r A1");
        assert_eq!(import.notes.len(), notes, "{:?}", import.notes);
    }
    std::fs::remove_file(path).unwrap();
}
