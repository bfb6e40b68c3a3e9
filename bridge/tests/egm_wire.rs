//! Comparison of the reader of EGM messages with `prost`: the same values, the same decision on
//! invalid messages, and in a corrected datagram nothing else is changed.

mod proto;

use bridge::egm::DecodeError;
use bridge::egm::messages::{Header, PathCorrMessage, Posture, RobotMessage, SensorMessage};
use proptest::prelude::*;
use prost::Message;
use proto::partial;

fn joints() -> impl Strategy<Value = Option<proto::Joints>> {
    let some =
        prop::collection::vec(any::<f64>(), 0..9).prop_map(|joints| proto::Joints { joints });
    prop::option::of(some)
}

fn header() -> impl Strategy<Value = Option<proto::Header>> {
    let one = || prop::option::of(any::<u32>());
    let some = (one(), one(), prop::option::of(0..6))
        .prop_map(|(seqno, tm, mtype)| proto::Header { seqno, tm, mtype });
    prop::option::of(some)
}

fn posture() -> impl Strategy<Value = Option<proto::Posture>> {
    let pose = prop::option::of(any::<[f64; 3]>().prop_map(|[x, y, z]| proto::Pose {
        pos: Some(proto::Cartesian { x, y, z }),
        orient: Some(proto::Quaternion { u0: x, u1: y, u2: z, u3: 1.0 }),
    }));
    let clock =
        prop::option::of(any::<(u64, u64)>().prop_map(|(sec, usec)| proto::Clock { sec, usec }));
    let some = (joints(), pose, joints(), clock).prop_map(|(joints, cartesian, external, time)| {
        proto::Posture { joints, cartesian, external, time }
    });
    prop::option::of(some)
}

prop_compose! {
    fn robot()(
        header in header(),
        feedback in posture(),
        planned in posture(),
        mci_state in prop::option::of(0..4),
        convergence in any::<Option<bool>>(),
        force in prop::option::of((any::<Option<bool>>(), prop::collection::vec(any::<f64>(), 0..7))),
        utilization_rate in any::<Option<f64>>(),
    ) -> proto::Robot {
        proto::Robot {
            header,
            feedback,
            planned,
            motor_state: Some(proto::State { state: 1 }),
            mci_state: mci_state.map(|state| proto::State { state }),
            mci_convergence_met: convergence,
            rapid_state: None,
            force: force.map(|(is_active, force)| proto::Force { is_active, force }),
            utilization_rate,
            move_index: Some(3),
        }
    }
}

prop_compose! {
    fn sensor()(header in header(), planned in posture(), speed in joints(), later in any::<Option<String>>()) -> proto::Sensor {
        proto::Sensor { header, planned, speed_ref: Some(proto::SpeedRef { joints: speed }), later }
    }
}

/// Bits, so that NaN compare too.
fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn of_joints(joints: Option<&proto::Joints>) -> Vec<u64> {
    joints.map(|joints| bits(&joints.joints)).unwrap_or_default()
}

fn same_header(ours: &Header, theirs: Option<&proto::Header>) -> bool {
    let theirs = theirs.cloned().unwrap_or_default();
    (ours.seqno, ours.tm, ours.mtype) == (theirs.seqno, theirs.tm, theirs.mtype.map(|m| m as u32))
}

fn same_joints(
    ours: &Posture,
    joints: Option<&proto::Joints>,
    external: Option<&proto::Joints>,
) -> bool {
    (bits(ours.joints.values()), bits(ours.external.values()))
        == (of_joints(joints), of_joints(external))
}

fn same_posture(ours: &Posture, theirs: Option<&partial::Posture>) -> bool {
    let theirs = theirs.cloned().unwrap_or_default();
    same_joints(ours, theirs.joints.as_ref(), theirs.external.as_ref())
}

/// Compares the decisions of `prost` and of our reader on the same bytes. Two differences are
/// intended: groups, and more joints than any robot has.
fn judge_alike(bytes: &[u8]) -> Result<(), TestCaseError> {
    let excused = |broken: &DecodeError| {
        matches!(
            broken,
            DecodeError::TooManyJoints | DecodeError::WrongType { wire_type: 3 | 4, .. }
        )
    };
    match (RobotMessage::read(bytes), partial::Robot::decode(bytes)) {
        (Ok(ours), Ok(theirs)) => {
            prop_assert!(same_header(&ours.header, theirs.header.as_ref()));
            prop_assert!(same_posture(&ours.feedback, theirs.feedback.as_ref()));
            prop_assert!(same_posture(&ours.planned, theirs.planned.as_ref()));
        }
        (Err(ours), Ok(theirs)) => {
            // An invalid force is refused by our reader; `prost` does not validate it.
            let force =
                proto::Robot::decode(bytes).is_err() || proto::OldRobot::decode(bytes).is_err();
            prop_assert!(excused(&ours) || force, "{ours:?} for {theirs:?}");
        }
        (Ok(ours), Err(theirs)) => prop_assert!(false, "{ours:?}, and prost: {theirs}"),
        (Err(_), Err(_)) => {}
    }
    match (SensorMessage::read(bytes), partial::Sensor::decode(bytes)) {
        (Ok(ours), Ok(theirs)) => {
            prop_assert!(same_header(&ours.header, theirs.header.as_ref()));
            prop_assert!(same_posture(&ours.planned, theirs.planned.as_ref()));
        }
        (Err(ours), Ok(theirs)) => prop_assert!(excused(&ours), "{ours:?} for {theirs:?}"),
        (Ok(ours), Err(theirs)) => prop_assert!(false, "{ours:?}, and prost: {theirs}"),
        (Err(_), Err(_)) => {}
    }
    let _ = PathCorrMessage::read(bytes);
    Ok(())
}

/// A damaged datagram.
fn spoilt(mut bytes: Vec<u8>, offset: usize, byte: u8, cut: usize) -> Vec<u8> {
    if !bytes.is_empty() {
        let offset = offset % bytes.len();
        bytes[offset] ^= byte;
        bytes.truncate(bytes.len() - cut % bytes.len());
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn a_robots_message_reads_as_prost_reads_it(robot in robot()) {
        let read = RobotMessage::read(&robot.encode_to_vec()).unwrap();
        prop_assert!(same_header(&read.header, robot.header.as_ref()));
        for (ours, theirs) in [(&read.feedback, &robot.feedback), (&read.planned, &robot.planned)] {
            let theirs = theirs.clone().unwrap_or_default();
            prop_assert!(same_joints(ours, theirs.joints.as_ref(), theirs.external.as_ref()));
            prop_assert_eq!(ours.has_pose, theirs.cartesian.is_some());
        }
        prop_assert_eq!(read.mci_state, robot.mci_state.map(|state| state.state as u32));
        let force = robot.force.unwrap_or_default();
        prop_assert_eq!(bits(read.force.values.values()), bits(&force.force));
        let is_six = force.force.len() == 6 && force.is_active != Some(false);
        prop_assert_eq!(read.force.wrench().is_some(), is_six);
    }

    #[test]
    fn a_corrected_target_is_the_same_message_with_other_joints(sensor in sensor(), joints in any::<[f64; 9]>()) {
        let mut bytes = sensor.encode_to_vec();
        let read = SensorMessage::read(&bytes).unwrap();
        prop_assert!(same_header(&read.header, sensor.header.as_ref()));
        let count = read.planned.joints.values().len();
        read.planned.joints.write(&mut bytes, &joints[..count]);
        let mut wanted = sensor;
        if let Some(planned) = wanted.planned.as_mut().and_then(|planned| planned.joints.as_mut()) {
            planned.joints.copy_from_slice(&joints[..count]);
        }
        prop_assert_eq!(bytes, wanted.encode_to_vec());
    }

    #[test]
    fn spoilt_messages_get_the_verdict_of_prost(robot in robot(), offset in any::<usize>(), byte in any::<u8>(), cut in 0_usize..40) {
        judge_alike(&spoilt(robot.encode_to_vec(), offset, byte, cut))?;
    }

    #[test]
    fn spoilt_targets_get_the_verdict_of_prost(sensor in sensor(), offset in any::<usize>(), byte in any::<u8>(), cut in 0_usize..40) {
        judge_alike(&spoilt(sensor.encode_to_vec(), offset, byte, cut))?;
    }

    #[test]
    fn any_bytes_get_the_verdict_of_prost(bytes in prop::collection::vec(prop_oneof![0_u8..0x40, any::<u8>()], 0..60)) {
        judge_alike(&bytes)?;
    }

    #[test]
    fn our_own_path_correction_is_what_prost_reads(mm in any::<[f64; 3]>(), seqno in any::<u32>(), tm in any::<Option<u32>>(), age in any::<u32>()) {
        let mut bytes = [0; 128];
        let header = Header { seqno: Some(seqno), tm, mtype: Some(4) };
        let length = PathCorrMessage::write(&mut bytes, header, mm, age).unwrap();
        let read = proto::SensorPathCorr::decode(&bytes[..length]).unwrap();
        prop_assert_eq!(read.header.unwrap(), proto::Header { seqno: Some(seqno), tm, mtype: Some(4) });
        let corr = read.path_corr.unwrap();
        let pos = corr.pos.unwrap();
        prop_assert_eq!((bits(&[pos.x, pos.y, pos.z]), corr.age), (bits(&mm), age));
        let ours = PathCorrMessage::read(&bytes[..length]).unwrap();
        prop_assert_eq!(bits(&ours.offset.unwrap().mm), bits(&mm));
        prop_assert!(PathCorrMessage::write(&mut bytes[..length - 1], header, mm, age).is_none());
    }
}

#[test]
fn a_force_is_read_in_both_layouts() {
    let force = [1.0, -2.0, 3.0, 0.1, 0.2, -0.3];
    let old = proto::OldRobot {
        force: Some(proto::OldForce { force: force.to_vec() }),
        ..proto::OldRobot::default()
    };
    let new = |is_active| proto::Robot {
        force: Some(proto::Force { is_active, force: force.to_vec() }),
        ..proto::Robot::default()
    };
    let wrench = |bytes: &[u8]| RobotMessage::read(bytes).unwrap().force.wrench();
    assert_eq!(wrench(&old.encode_to_vec()), Some(force));
    assert_eq!(wrench(&new(None).encode_to_vec()), Some(force));
    assert_eq!(wrench(&new(Some(true)).encode_to_vec()), Some(force));
    assert_eq!(wrench(&new(Some(false)).encode_to_vec()), None, "force control is idle");
}

#[test]
fn packed_joints_are_joints_too() {
    let joints = vec![1.0, 2.0, 3.0];
    let packed = proto::PackedJoints { joints: joints.clone() }.encode_to_vec();
    // planned { joints { packed } }
    let planned = [&[0x0a, packed.len() as u8], &packed[..]].concat();
    let mut message = [&[0x12, planned.len() as u8], &planned[..]].concat();
    let read = SensorMessage::read(&message).unwrap();
    assert_eq!(read.planned.joints.values(), joints);
    read.planned.joints.write(&mut message, &[7.0, 8.0, 9.0]);
    assert_eq!(SensorMessage::read(&message).unwrap().planned.joints.values(), [7.0, 8.0, 9.0]);
}
