//! Files that are not an arm are refused with all errors; deviations from the file are noted.

use super::{ChainEnds, Import, export, parse};
use crate::faults::Faults;

pub(super) const ARM: &str = r#"<robot name="two">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0.1 0 0" rpy="0 0 0.5"/>
      <mass value="3"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.05"/>
    </inertial>
  </link>
  <link name="hand"/>
  <joint name="turn" type="revolute">
    <origin xyz="0 0 0.5" rpy="0 0 0"/>
    <parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="10"/>
  </joint>
  <joint name="slide" type="prismatic">
    <origin xyz="0.3 0 0"/>
    <parent link="arm"/><child link="hand"/>
    <axis xyz="2 0 0"/>
    <limit lower="0" upper="0.4" velocity="0" effort="10"/>
  </joint>
</robot>
"#;

pub(super) fn read(text: &str) -> Result<Import, Faults> {
    parse("arm.urdf", text, &ChainEnds::default())
}

fn tip(text: &str, tip: &str) -> Result<Import, Faults> {
    parse("arm.urdf", text, &ChainEnds { base: None, tip: Some(tip) })
}

/// The faults of the arm after these changes.
fn faults(changes: &[(&str, &str)]) -> String {
    let text = changes.iter().fold(ARM.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    read(&text).unwrap_err().plain()
}

#[test]
fn an_arm_becomes_a_model_in_the_units_of_its_file() {
    let import = read(ARM).unwrap();
    insta::assert_snapshot!(import.model.file.to_toml(), @r#"
        schema = "trued.model/1"
        name = "two"
        gravity_m_s2 = [0.0, 0.0, -9.80665]

        [meta]
        "base_link" = "base"
        "source" = "two"
        "tip_link" = "hand"

        [[joint]]
        name = "turn"
        kind = "revolute"
        axis = [0.0, 0.0, 1.0]
        point_mm = [0.0, 0.0, 500.0]
        limits_deg = [-171.88733853924697, 171.88733853924697]
        max_speed_deg_s = 114.59155902616465
        link = { mass_kg = 3.0, com_mm = [100.0, 0.0, 500.0], inertia_kgm2 = [0.10000000000000002, 0.10000000000000002, 0.05, 0.0, 0.0, 0.0] }

        [[joint]]
        name = "slide"
        kind = "prismatic"
        axis = [1.0, 0.0, 0.0]
        point_mm = [300.0, 0.0, 500.0]
        limits_mm = [0.0, 400.0]

        [tool]
        tcp_mm = [300.0, 0.0, 500.0]
        "#);
    assert!(import.notes.is_empty());
}

#[test]
fn every_fault_of_the_numbers_is_reported_at_once_with_its_joint_or_link() {
    let found = faults(&[
        ("xyz=\"0 0 0.5\" rpy", "xyz=\"0 0,5\" rpy"),
        ("<axis xyz=\"0 0 1\"/>", "<axis xyz=\"0 0 0\"/>"),
        ("lower=\"-3\" upper=\"3\" velocity=\"2\"", "lower=\"3\" upper=\"-3\" velocity=\"fast\""),
        ("<mass value=\"3\"/>", "<mass value=\"3 kg\"/>"),
        ("izz=\"0.05\"", "izz=\"0,05\""),
        ("<limit lower=\"0\" upper=\"0.4\" velocity=\"0\" effort=\"10\"/>", ""),
    ]);
    insta::assert_snapshot!(found, @r#"
        error: `link arm: inertial mass value`: is "3 kg"
         --> arm.urdf:6:20
          |
        6 |       <mass value="3 kg"/>
          |                    ^^^^ expected a number below 1e12

        error: `link arm: inertial inertia izz`: is "0,05"
         --> arm.urdf:7:65
          |
        7 |       <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0,05"/>
          |                                                                 ^^^^ expected a number below 1e12

        error: `joint turn: origin xyz`: is "0 0,5"
          --> arm.urdf:12:18
           |
        12 |     <origin xyz="0 0,5" rpy="0 0 0"/>
           |                  ^^^^^ expected three numbers below 1e12, separated by spaces

        error: `joint turn: axis`: has no direction
          --> arm.urdf:14:5
           |
        14 |     <axis xyz="0 0 0"/>
           |     ^^^^^^^^^^^^^^^^^^^
           |
           = help: give a direction, such as xyz="0 0 1"

        error: `joint turn: limit`: has lower 3 above upper -3
          --> arm.urdf:15:5
           |
        15 |     <limit lower="3" upper="-3" velocity="fast" effort="10"/>
           |     ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: swap them: the lower limit comes first, in rad

        error: `joint turn: limit velocity`: is "fast"
          --> arm.urdf:15:43
           |
        15 |     <limit lower="3" upper="-3" velocity="fast" effort="10"/>
           |                                           ^^^^ expected a number

        error: `joint slide`: has no <limit>
          --> arm.urdf:17:3
           |
        17 |   <joint name="slide" type="prismatic">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: give <limit lower="…" upper="…" velocity="…" effort="…"/>, or the type "continuous"
        "#);
}

#[test]
fn every_fault_of_the_tree_is_reported_at_once() {
    let found = faults(&[
        ("<link name=\"hand\"/>", "<link name=\"hand\"/><link name=\"base\"/><link/>"),
        ("name=\"turn\" type=\"revolute\"", "name=\"turn\" type=\"hinge\""),
        ("<child link=\"hand\"/>", "<child link=\"hadn\"/>"),
        ("</robot>", "<joint name=\"more\" type=\"fixed\"><parent link=\"base\"/></joint></robot>"),
    ]);
    insta::assert_snapshot!(found, @r#"
        error: `link base`: appears twice in the file
          --> arm.urdf:10:22
           |
        10 |   <link name="hand"/><link name="base"/><link/>
           |                      ^^^^^^^^^^^^^^^^^^^
           |
           = help: give each link a unique name

        error: `link`: has no name
          --> arm.urdf:10:41
           |
        10 |   <link name="hand"/><link name="base"/><link/>
           |                                         ^^^^^^^
           |
           = help: give <link name="…">

        error: `joint turn`: is of type "hinge"
          --> arm.urdf:11:3
           |
        11 |   <joint name="turn" type="hinge">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: give type="revolute", "continuous", "prismatic" or "fixed"

        error: `joint slide`: has the child link `hadn`, which does not exist
          --> arm.urdf:17:3
           |
        17 |   <joint name="slide" type="prismatic">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: did you mean `hand`?

        error: `joint more`: has no <child link="…"/>
          --> arm.urdf:23:1
           |
        23 | <joint name="more" type="fixed"><parent link="base"/></joint></robot>
           | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: specify the link
        "#);
}

#[test]
fn what_a_serial_arm_cannot_have_is_refused_with_the_reason() {
    let mimic =
        faults(&[("<axis xyz=\"2 0 0\"/>", "<axis xyz=\"2 0 0\"/><mimic joint=\"turn\"/>")]);
    let floating = faults(&[("type=\"prismatic\"", "type=\"floating\"")]);
    let looped = faults(&[(
        "<parent link=\"base\"/><child link=\"arm\"/>",
        "<parent link=\"hand\"/><child link=\"arm\"/>",
    )]);
    let twice = faults(&[("<child link=\"arm\"/>", "<child link=\"hand\"/>")]);
    let fixed = faults(&[("revolute", "fixed"), ("prismatic", "fixed")]);
    insta::assert_snapshot!([mimic, floating, looped, twice, fixed].join("\n---\n"), @r#"
        error: `joint slide`: follows the joint `turn` (mimic) and is part of the chain
          --> arm.urdf:17:3
           |
        17 |   <joint name="slide" type="prismatic">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: joints of a model are independent; choose a chain without it, or remove its <mimic> if it has its own drive
        ---
        error: `joint slide`: is floating: it has more than one degree of freedom
          --> arm.urdf:17:3
           |
        17 |   <joint name="slide" type="floating">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: begin the chain after it, at the link `hand`
        ---
        error: `link arm`: is part of a loop of joints
         --> arm.urdf:3:3
          |
        3 |   <link name="arm">
          |   ^^^^^^^^^^^^^^^^^
          |
          = help: remove one joint of the loop; a serial arm is an open chain
        ---
        error: `joint slide`: moves the link `hand`, as joint `turn` does
          --> arm.urdf:17:3
           |
        17 |   <joint name="slide" type="prismatic">
           |   ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
           |
           = help: a link has one parent joint; correct the `child` of one of the two
        ---
        error: has no moving joint
        --> arm.urdf
         = help: give the URDF of an arm, or another base
        "#);
}

#[test]
fn a_branch_asks_for_a_chain_and_a_named_one_is_taken() {
    let finger = r#"<link name="finger"><inertial><mass value="1"/></inertial></link>
      <joint name="grip" type="continuous"><parent link="hand"/><child link="finger"/></joint>
      <link name="camera"/><joint name="look" type="fixed"><parent link="hand"/><child link="camera"/></joint></robot>"#;
    let text = ARM.replace("</robot>", finger);
    let all = read(&text).unwrap_err().plain();
    let wrong = tip(&text, "cmaera").unwrap_err().plain();
    let swapped = ChainEnds { base: Some("hand"), tip: Some("arm") };
    let swapped = parse("arm.urdf", &text, &swapped).unwrap_err().plain();
    insta::assert_snapshot!([all, wrong, swapped].join("\n---\n"), @r#"
        error: branches into 2 ends: `finger` (moving joints: 3), `camera` (moving joints: 2)
        --> arm.urdf
         = help: choose the chain by its tip, and if need be its base
        ---
        error: the robot has no link `cmaera`
        --> arm.urdf
         = help: did you mean `camera`?
        ---
        error: the joint `slide` moves the base `hand` against the rest of the chain to `arm`
        --> arm.urdf
         = help: check whether the base (the fixed link) and the tip (the moving link) are swapped
        "#);
    let import = tip(&text, "camera").unwrap();
    assert_eq!(import.model.file.joints.len(), 2);
    assert_eq!(import.model.file.joints[1].link.unwrap().mass_kg, 1.0);
    assert_eq!(
        import.notes,
        [
            "link finger has no <inertia>; imported as a point mass of 1 kg",
            "joint grip outside the chain: the masses there are placed as at joint position 0"
        ]
    );
    let import = tip(&text, "finger").unwrap();
    assert_eq!(import.model.file.joints.len(), 3);
    assert_eq!(import.model.file.joints[2].limits, [-360.0, 360.0]);
    assert!(import.notes.iter().any(|note| note.starts_with("joint grip is continuous")));
    let arm =
        parse("arm.urdf", &text, &ChainEnds { base: Some("arm"), tip: Some("camera") }).unwrap();
    assert_eq!((arm.model.file.joints.len(), arm.base.as_str()), (1, "arm"));
}

#[test]
fn anything_but_a_urdf_is_refused() {
    let texts = [
        "",
        "<robot",
        "<sdf version='1.7'/>",
        "<robot name='x'/>",
        "<robot><link name='a'/><xacro:macro name='b'/></robot>",
        "<robot xmlns:xacro='http://www.ros.org/wiki/xacro'><link name='a'/><xacro:include filename='b'/></robot>",
        "<!DOCTYPE robot [<!ENTITY a \"b\">]><robot/>",
    ];
    let found: Vec<String> = texts.iter().map(|text| read(text).unwrap_err().plain()).collect();
    insta::assert_snapshot!(found.join("\n---\n"), @r#"
        error: is not valid XML: the document does not have a root node
         --> arm.urdf:1:1
          |
        1 |
          | ^
        ---
        error: is not valid XML: the document does not have a root node
         --> arm.urdf:1:1
          |
        1 | <robot
          | ^
        ---
        error: `sdf`: the root element is <sdf>
         --> arm.urdf:1:1
          |
        1 | <sdf version='1.7'/>
          | ^^^^^^^^^^^^^^^^^^^^
          |
          = help: give a URDF: <robot> … </robot>
        ---
        error: `robot`: has no link
         --> arm.urdf:1:1
          |
        1 | <robot name='x'/>
          | ^^^^^^^^^^^^^^^^^
          |
          = help: give a complete URDF with links and the joints between them
        ---
        error: `robot xacro:macro`: is a xacro macro
         --> arm.urdf:1:24
          |
        1 | <robot><link name='a'/><xacro:macro name='b'/></robot>
          |                        ^^^^^^^^^^^^^^^^^^^^^^^
          |
          = help: expand the xacro first: `xacro FILE.urdf.xacro > FILE.urdf`
        ---
        error: `robot xacro:include`: is a xacro macro
         --> arm.urdf:1:68
          |
        1 | <robot xmlns:xacro='http://www.ros.org/wiki/xacro'><link name='a'/><xacro:include filename='b'/></robot>
          |                                                                    ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
          |
          = help: expand the xacro first: `xacro FILE.urdf.xacro > FILE.urdf`
        ---
        error: `robot`: has no link
         --> arm.urdf:1:35
          |
        1 | <!DOCTYPE robot [<!ENTITY a "b">]><robot/>
          |                                   ^^^^^^^^
          |
          = help: give a complete URDF with links and the joints between them
        "#);
}

#[test]
fn a_base_that_stands_turned_turns_gravity() {
    let wall = r#"<link name="hall"/><joint name="wall" type="fixed"><origin rpy="0 1.5707963267948966 0"/>
      <parent link="hall"/><child link="base"/></joint></robot>"#;
    let import =
        parse("x", &ARM.replace("</robot>", wall), &ChainEnds { base: Some("base"), tip: None })
            .unwrap();
    assert_eq!(
        import.model.file.gravity_m_s2.map(|g| (g * 1e9).round() / 1e9),
        [9.80665, 0.0, 0.0]
    );
    assert_eq!(
        import.notes,
        ["gravity points down in the frame of `hall`, but `base` is tilted relative to it"]
    );
    assert_eq!(export(&import.model).left_out[0].what, "gravity_m_s2");
}

#[test]
fn names_that_xml_would_trip_over_go_out_and_come_back() {
    let mut model = read(ARM).unwrap().model;
    for (joint, name) in model.file.joints.iter_mut().zip(["a<b>&\"c'", "a<b>&\"c'"]) {
        joint.name = name.to_owned();
    }
    model.file.meta.insert("base_link".to_owned(), "link_1".into());
    model.file.name = "\u{7}\u{fffe}".to_owned();
    let again = read(&export(&model).text).unwrap();
    let names: Vec<&str> =
        again.model.file.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["a<b>&\"c'", "a<b>&\"c'_"]);
    assert_eq!((again.base.as_str(), again.model.file.name.as_str()), ("link_1", "_"));
}
