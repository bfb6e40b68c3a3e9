//! Programs contain what was requested: the text itself, and every value read back by an independent parser.

use physics::JointKind;
use proptest::prelude::*;

use super::{Approach, Axis, Krl, Program, ProgramRequest, Rapid};
use crate::model::ModelFile;
use crate::model::presets::preset;
use crate::series::{Channel, RequiredData, read_text};

fn robot(name: &str) -> ModelFile {
    preset(name).unwrap().model().unwrap().file
}

/// The robot on a track that is the model's first joint.
fn on_a_track() -> ModelFile {
    let mut file = robot("irb1600-6-145");
    let mut track = file.joints[0].clone();
    (track.kind, track.limits, track.axis) = (JointKind::Prismatic, [0.0, 4000.0], [1.0, 0.0, 0.0]);
    file.joints.insert(0, track);
    file
}

fn axes(list: &str) -> Vec<Axis> {
    list.split(',').map(|name| name.parse().unwrap()).collect()
}

fn tour(joints: usize) -> ProgramRequest {
    ProgramRequest {
        name: "poses".to_owned(),
        home: vec![0.0; joints],
        poses: vec![vec![0.1; joints], (0..joints).map(|joint| 0.2 - 0.1 * joint as f64).collect()],
        approach: Approach::Direct,
        pause_s: 2.5,
        axes: Vec::new(),
    }
}

const BOTH: Approach = Approach::BothWays { turn_rad: 0.05, slide_m: 0.02 };

#[test]
fn rapid_contains_the_requested_tour() {
    let tour = ProgramRequest { approach: BOTH, ..tour(6) };
    let program = Program::new(&tour, &robot("irb1600-6-145")).unwrap();
    let options = Rapid { output: Some("doMeasure".to_owned()), ..Rapid::default() };
    insta::assert_snapshot!(program.rapid(&options).unwrap(), @r#"
        MODULE poses_mod
            ! stops: 4; robot: ABB IRB 1600-6/1.45, nominal; made by trued, to be tried slowly first
            LOCAL CONST speeddata speed := [100.0,20.0,100.0,20.0];

            PROC poses()
                MoveAbsJ [[0.0,0.0,0.0,0.0,0.0,0.0],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                ! stop 1 of 4: pose 1, all joints from below
                MoveAbsJ [[2.86479,2.86479,2.86479,2.86479,2.86479,2.86479],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                MoveAbsJ [[5.72958,5.72958,5.72958,5.72958,5.72958,5.72958],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                TPWrite "stop 1 of 4: pose 1, all joints from below";
                WaitTime \InPos, 0;
                SetDO doMeasure, 1;
                WaitTime 2.5;
                SetDO doMeasure, 0;
                ! stop 2 of 4: pose 1, all joints from above
                MoveAbsJ [[8.59437,8.59437,8.59437,8.59437,8.59437,8.59437],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                MoveAbsJ [[5.72958,5.72958,5.72958,5.72958,5.72958,5.72958],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                TPWrite "stop 2 of 4: pose 1, all joints from above";
                WaitTime \InPos, 0;
                SetDO doMeasure, 1;
                WaitTime 2.5;
                SetDO doMeasure, 0;
                ! stop 3 of 4: pose 2, all joints from below
                MoveAbsJ [[8.59437,2.86479,-2.86479,-8.59437,-14.32394,-20.05352],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                MoveAbsJ [[11.45916,5.72958,0.0,-5.72958,-11.45916,-17.18873],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                TPWrite "stop 3 of 4: pose 2, all joints from below";
                WaitTime \InPos, 0;
                SetDO doMeasure, 1;
                WaitTime 2.5;
                SetDO doMeasure, 0;
                ! stop 4 of 4: pose 2, all joints from above
                MoveAbsJ [[14.32394,8.59437,2.86479,-2.86479,-8.59437,-14.32394],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                MoveAbsJ [[11.45916,5.72958,0.0,-5.72958,-11.45916,-17.18873],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
                TPWrite "stop 4 of 4: pose 2, all joints from above";
                WaitTime \InPos, 0;
                SetDO doMeasure, 1;
                WaitTime 2.5;
                SetDO doMeasure, 0;
                MoveAbsJ [[0.0,0.0,0.0,0.0,0.0,0.0],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs, speed, fine, tool0;
            ENDPROC
        ENDMODULE
        "#);
}

#[test]
fn krl_contains_the_requested_tour_in_two_files() {
    let tour = ProgramRequest { axes: axes("E1,A1,A2,A3,A4,A5,A6"), ..tour(7) };
    let tour = ProgramRequest { poses: tour.poses[..1].to_vec(), ..tour };
    let files = Program::new(&tour, &on_a_track())
        .unwrap()
        .krl(&Krl { output: Some(17), ..Krl::default() });
    let files = files.unwrap();
    insta::assert_snapshot!(format!("{}\n---\n{}", files.src, files.dat), @r#"
        &ACCESS RVP
        &REL 1
        DEF poses()
        ; stops: 1; robot: ABB IRB 1600-6/1.45, nominal; made by trued, to be tried slowly first
        BAS(#INITMOV,0)
        BAS(#TOOL,0)
        BAS(#VEL_PTP,20.0)
        BAS(#ACC_PTP,20.0)
        PTP XREST
        ; stop 1 of 1: pose 1
        PTP XSTOP1
        WAIT SEC 0.0
        $OUT[17]=TRUE
        WAIT SEC 2.5
        $OUT[17]=FALSE
        PTP XREST
        END

        ---
        &ACCESS RVP
        &REL 1
        DEFDAT poses
        DECL E6AXIS XREST={A1 0.0,A2 0.0,A3 0.0,A4 0.0,A5 0.0,A6 0.0,E1 0.0}
        DECL E6AXIS XSTOP1={A1 5.72958,A2 5.72958,A3 5.72958,A4 5.72958,A5 5.72958,A6 5.72958,E1 100.0}
        ENDDAT
        "#);
}

#[test]
fn all_reasons_against_a_tour_are_reported_at_once() {
    let mut poses = tour(6).poses;
    poses[0][4] = 2.1;
    poses[1][1] = 2.09;
    poses.push(vec![0.0; 5]);
    let wrong = ProgramRequest {
        name: "1st".to_owned(),
        poses,
        approach: BOTH,
        pause_s: f64::NAN,
        ..tour(6)
    };
    let limits = Program::new(&wrong, &robot("irb1600-6-145")).unwrap_err().plain();
    let slides = Program::new(&tour(7), &on_a_track()).unwrap_err().plain();
    let mut seven = on_a_track();
    seven.joints[0] = seven.joints[1].clone();
    let seven = Program::new(&tour(7), &seven).unwrap_err().plain();
    let few = ProgramRequest { axes: axes("A1,A2,A2"), ..tour(6) };
    let few = Program::new(&few, &robot("ur10e")).unwrap_err().plain();
    let tiny_approach =
        ProgramRequest { approach: Approach::BothWays { turn_rad: 1e-9, slide_m: 1.0 }, ..tour(6) };
    let tiny_approach = Program::new(&tiny_approach, &robot("ur10e")).unwrap_err().plain();
    insta::assert_snapshot!([limits, slides, seven, few, tiny_approach].join("\n---\n"), @r#"
        error: `name`: is "1st", which no controller takes
        --> 1st
         = note: expected a letter, then letters, digits or _: at most 24

        error: `pause`: is NaN s
        --> 1st
         = note: expected 0 to 3600 s

        error: `pose 1`: joint 5 is at 120.32113697747288 deg
        --> 1st
         = note: expected -115 to 115 deg, the model's limits
         = help: leave the pose out, or move it

        error: `pose 2, coming from above`: joint 2 is at 122.61296815799616 deg
        --> 1st
         = note: expected -90 to 120 deg, the model's limits
         = help: come from nearer, or move the pose

        error: `pose 3`: has 5 joint positions
        --> 1st
         = note: expected 6, as the model has joints
        ---
        error: `axes`: are not given, and joint 1 is linear: it could be a robot axis or an external axis
        --> poses
         = help: state the axis of each joint, such as E1,A1,A2,A3,A4,A5,A6 for a robot on a track
        ---
        error: `axes`: are not given, and the model has 7 joints instead of six
        --> poses
         = help: state the axis of each joint, such as E1,A1,A2,A3,A4,A5,A6 for a robot on a track
        ---
        error: `axes`: are 3
        --> poses
         = note: expected one axis for each of the model's 6 joints

        error: `axes`: include A2 twice
        --> poses
         = note: expected each axis once
        ---
        error: `approach`: joint 1 begins 0.000000057295779513082324 away
        --> poses
         = note: expected a distance of 0.001 deg (mm) or more
        "#);
}

#[test]
fn programs_that_no_controller_accepts_are_refused() {
    let program = Program::new(&tour(6), &robot("ur10e")).unwrap();
    let rapid = Rapid {
        speed_mm_s: 0.0,
        turn_deg_s: f64::NAN,
        tool: "tool0, fine".to_owned(),
        output: Some(String::new()),
    };
    assert_eq!(program.rapid(&rapid).unwrap_err().len(), 4);
    let krl = Krl { percent: 120.0, tool: 17, output: Some(0) };
    assert_eq!(program.krl(&krl).unwrap_err().len(), 3);
    let odd = ModelFile { name: "Größe\nPTP XREST".to_owned(), ..robot("ur10e") };
    let src = Program::new(&tour(6), &odd).unwrap().krl(&Krl::default()).unwrap().src;
    assert!(src.contains("Gr??e?PTP XREST"), "a name is no line of a program:\n{src}");
    for name in ["A0", "A7", "E", "X1", ""] {
        assert!(name.parse::<Axis>().is_err(), "{name}");
    }
    assert_eq!(" e3".parse::<Axis>(), Ok(Axis::External(3)));
}

/// Positions in the order of the model's joints, as a RAPID controller would be sent to them.
fn by_rapid(text: &str, axes: &[Axis]) -> Vec<Vec<f64>> {
    let moves = text.lines().filter_map(|line| line.trim().strip_prefix("MoveAbsJ [["));
    let numbers = |list: &str| -> Vec<f64> {
        list.split(',').map(|number| number.parse().unwrap()).collect()
    };
    moves
        .map(|line| {
            let (robot, rest) = line.split_once("],[").unwrap();
            let (external, _) = rest.split_once("]]").unwrap();
            let (robot, external) = (numbers(robot), numbers(external));
            assert_eq!((robot.len(), external.len()), (6, 6));
            let used = |axis: &Axis| match axis {
                Axis::Robot(number) => robot[number - 1],
                Axis::External(number) => external[number - 1],
            };
            let unused = (1..=6).filter(|number| !axes.contains(&Axis::External(*number)));
            assert!(unused.into_iter().all(|number| external[number - 1] == 9e9));
            axes.iter().map(used).collect()
        })
        .collect()
}

/// The same of a KRL controller: the source's moves, to the points of the data list.
fn by_krl(src: &str, dat: &str, axes: &[Axis]) -> Vec<Vec<f64>> {
    let point = |name: &str| {
        let line = dat.lines().find_map(|line| {
            line.strip_prefix("DECL E6AXIS ")?.strip_prefix(name)?.strip_prefix("={")
        });
        let pairs = line
            .unwrap()
            .strip_suffix('}')
            .unwrap()
            .split(',')
            .map(|pair| pair.split_once(' ').unwrap());
        let pairs: Vec<(String, f64)> =
            pairs.map(|(axis, value)| (axis.to_owned(), value.parse().unwrap())).collect();
        let text_of =
            |axis: &Axis| pairs.iter().find(|(name, _)| *name == axis.to_string()).unwrap().1;
        axes.iter().map(text_of).collect()
    };
    src.lines().filter_map(|line| line.strip_prefix("PTP ")).map(point).collect()
}

/// The requested motion, computed from the tour alone: degrees and mm.
fn wanted(tour: &ProgramRequest, kinds: &[JointKind]) -> Vec<Vec<f64>> {
    let unit = |q: &[f64], away: f64| -> Vec<f64> {
        let value = |(q, kind): (&f64, &JointKind)| match kind {
            JointKind::Revolute => (q + 0.05 * away).to_degrees(),
            JointKind::Prismatic => (q + 0.02 * away) * 1e3,
        };
        q.iter().zip(kinds).map(value).collect()
    };
    let mut way = vec![unit(&tour.home, 0.0)];
    for pose in &tour.poses {
        match tour.approach {
            Approach::Direct => way.push(unit(pose, 0.0)),
            Approach::BothWays { .. } => {
                way.extend([-1.0, 0.0, 1.0, 0.0].map(|away| unit(pose, away)));
            }
        }
    }
    way.push(unit(&tour.home, 0.0));
    way
}

fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    pairs.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

proptest! {
    #[test]
    fn every_value_is_read_back_from_both_languages(
        shares in prop::collection::vec(prop::array::uniform7(0.03..0.97), 1..12),
        both in any::<bool>(),
    ) {
        let model = on_a_track();
        let place = |share: &[f64; 7]| -> Vec<f64> {
            let value = |(joint, share): (&crate::model::JointEntry, &f64)| {
                let [low, high] = joint.limits;
                let value = low + (high - low) * share;
                if joint.kind == JointKind::Prismatic { value * 1e-3 } else { value.to_radians() }
            };
            model.joints.iter().zip(share).map(value).collect()
        };
        let tour = ProgramRequest {
            poses: shares.iter().map(place).collect(),
            approach: if both { BOTH } else { Approach::Direct },
            axes: axes("E1,A1,A2,A3,A4,A5,A6"),
            ..tour(7)
        };
        let kinds: Vec<JointKind> = model.joints.iter().map(|joint| joint.kind).collect();
        let program = Program::new(&tour, &model).map_err(|faults| TestCaseError::fail(faults.plain()))?;
        let wanted = wanted(&tour, &kinds);
        let rapid = by_rapid(&program.rapid(&Rapid::default()).unwrap(), &tour.axes);
        let files = program.krl(&Krl::default()).unwrap();
        let krl = by_krl(&files.src, &files.dat, &tour.axes);
        prop_assert!(apart(&rapid, &wanted) < 1e-5);
        prop_assert_eq!(&krl, &rapid);

        // The list for the measurements has the same values, and the direction of the last step.
        let csv = program.recording(&[Channel::Position(0)]).to_csv();
        let list = read_text("poses.csv", &String::from_utf8(csv).unwrap(), None, None, RequiredData::Path).unwrap();
        let mut stops = rapid.iter().enumerate().filter(|(index, _)| if both { index % 4 != 1 && index % 4 != 3 } else { true });
        stops.next();
        for (row, (index, stop)) in stops.take(list.len()).enumerate() {
            for (joint, value) in stop.iter().enumerate() {
                let si = if kinds[joint] == JointKind::Prismatic { value * 1e-3 } else { value.to_radians() };
                prop_assert!((list.input(joint).unwrap()[row] - si).abs() < 1e-12);
                let came = (value - rapid[index - 1][joint]).total_cmp(&0.0) as i8;
                let direction = list.column(Channel::Direction(joint)).unwrap()[row];
                prop_assert!(came == 0 || f64::from(came) == direction);
            }
        }
    }

    #[test]
    fn a_pose_at_a_limit_stays_within_it(limit in 0.5..3.0_f64) {
        let mut model = robot("ur10e");
        model.joints[0].limits = [-limit.to_degrees(), limit.to_degrees()];
        for side in [-1.0, 1.0] {
            let mut tour = tour(6);
            tour.poses = vec![vec![side * limit, 0.0, 0.0, 0.0, 0.0, 0.0]];
            // To degrees and back may leave the limit by a bit: then it is refused, never passed on.
            if let Ok(program) = Program::new(&tour, &model) {
                let found = program.stops()[0].at[0];
                prop_assert!(found.abs() <= limit.to_degrees() && (found.abs() - limit.to_degrees()).abs() < 2e-5);
            }
        }
    }
}

#[test]
fn a_joint_that_rests_keeps_the_direction_of_its_last_motion() {
    let mut tour = tour(6);
    let pose = |first: f64| vec![first, 0.0, 0.0, 0.0, 0.0, 0.0];
    tour.poses = [0.2, 0.2, 0.1, 0.1, 0.3].map(pose).to_vec();
    let program = Program::new(&tour, &robot("ur10e")).unwrap();
    let directions: Vec<i8> = program.stops().iter().map(|stop| stop.direction[0]).collect();
    assert_eq!(directions, [1, 1, -1, -1, 1]);
    assert!(program.stops().iter().all(|stop| stop.direction[1] == 0), "never moved: unknown");
}

#[test]
fn the_list_is_a_recording_of_poses_that_waits_for_its_measurements() {
    let program =
        Program::new(&ProgramRequest { approach: BOTH, ..tour(6) }, &robot("ur10e")).unwrap();
    let list =
        program.recording(&[Channel::Position(0), Channel::Position(1), Channel::Position(2)]);
    insta::assert_snapshot!(String::from_utf8(list.to_csv()).unwrap(), @r#"
        t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,d1,d2,d3,d4,d5,d6,x_mm,y_mm,z_mm
        0.0,5.72958,5.72958,5.72958,5.72958,5.72958,5.72958,1.0,1.0,1.0,1.0,1.0,1.0,,,
        1.0,5.72958,5.72958,5.72958,5.72958,5.72958,5.72958,-1.0,-1.0,-1.0,-1.0,-1.0,-1.0,,,
        2.0,11.45916,5.72958,0.0,-5.72958,-11.45916,-17.18873,1.0,1.0,1.0,1.0,1.0,1.0,,,
        3.0,11.45916,5.72958,0.0,-5.72958,-11.45916,-17.18873,-1.0,-1.0,-1.0,-1.0,-1.0,-1.0,,,
        "#);
    insta::assert_snapshot!(list.about_toml(), @r#"
        schema = "trued.recording/1"
        kind = "poses"
        approach = "columns"
        "#);
}
