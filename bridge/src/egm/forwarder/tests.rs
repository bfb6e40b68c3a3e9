//! Every rule of the EGM bridge, with datagrams built byte by byte; without a daemon, so that targets are forwarded unchanged.

use std::time::Duration;

use super::*;
use crate::corrections::stub::Corrected;
use crate::egm::messages::Header;
use crate::egm::wire::Writer;
use recording::model::presets::preset;

const MS: u64 = 1_000_000;
const ROBOT: &str = "192.168.125.1:6510";
const APPLICATION: &str = "127.0.0.1:6511";

fn socket_address(address: &str) -> SocketAddr {
    address.parse().unwrap()
}

fn forwarder(guidance: Guidance) -> (Forwarder, Arc<Counts>) {
    middle_over(guidance, Corrections::with_link(DaemonLink::nowhere()))
}

fn middle_over<L: Link>(guidance: Guidance, feed: Corrections<L>) -> (Forwarder<L>, Arc<Counts>) {
    let counts = Arc::new(Counts::default());
    let arm = preset("irb1600-6-145-thesis").unwrap().model().unwrap().physics.arm;
    let settings = Settings {
        robot: socket_address(ROBOT).ip(),
        robot_port: None,
        application: Some(socket_address(APPLICATION)),
        guidance,
        order: JointOrder { count: 6, seventh_after: None },
        is_shadow: false,
        path_period_ns: 48 * MS,
        runs: RunRules::default(),
    };
    (Forwarder::new(settings, arm, feed, None, Arc::clone(&counts)), counts)
}

fn message(field: u32, number: u32, mtype: u32, joints: &[f64], mci_state: Option<u64>) -> Vec<u8> {
    let mut bytes = vec![0; 400];
    let mut writer = Writer::new(&mut bytes);
    writer.message(1, |writer| {
        writer.varint(1, u64::from(number));
        writer.varint(3, u64::from(mtype));
    });
    writer.message(field, |writer| {
        writer.message(1, |writer| joints.iter().for_each(|joint| writer.double(1, *joint)));
    });
    if let Some(state) = mci_state {
        writer.message(5, |writer| writer.varint(1, state));
    }
    let length = writer.finish().unwrap();
    bytes.truncate(length);
    bytes
}

fn feedback(number: u32) -> Vec<u8> {
    message(2, number, 2, &[0.0; 6], Some(3))
}

fn target(number: u32) -> Vec<u8> {
    message(2, number, 3, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], None)
}

fn answered<L: Link>(
    forwarder: &mut Forwarder<L>,
    datagram: &[u8],
    ms: u64,
) -> Option<(Vec<u8>, SocketAddr)> {
    let mut datagram = datagram.to_vec();
    let screened =
        forwarder.receive_from_application(&datagram, socket_address(APPLICATION), ms * MS)?;
    let to = forwarder.answer(&mut datagram, &screened)?;
    Some((datagram, to))
}

#[test]
fn nothing_is_sent_before_the_controller_has_spoken_nor_after_it_fell_silent() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(answered(&mut forwarder, &target(0), 0).is_none());
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), MS));
    assert_eq!(answered(&mut forwarder, &target(1), 2), Some((target(1), socket_address(ROBOT))));
    assert!(answered(&mut forwarder, &target(2), 100).is_some());
    assert!(answered(&mut forwarder, &target(3), 1300).is_none());
    assert_eq!(counts.get(Count::Early), 2);
}

#[test]
fn foreign_datagrams_reach_nobody() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(!forwarder.receive_from_robot(&feedback(1), socket_address("192.168.125.2:6510"), 0));
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    assert!(
        forwarder
            .receive_from_application(&target(1), socket_address("127.0.0.1:7000"), MS)
            .is_none()
    );
    assert_eq!(counts.get(Count::Foreign), 2);
}

#[test]
fn a_second_mechanical_unit_is_refused_while_the_first_one_lives() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    let other = socket_address("192.168.125.1:51000");
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    for number in 2..200 {
        assert!(!forwarder.receive_from_robot(
            &feedback(7 * number),
            other,
            u64::from(number) * 4 * MS
        ));
        assert!(forwarder.receive_from_robot(
            &feedback(number),
            socket_address(ROBOT),
            u64::from(number) * 4 * MS
        ));
        let (_, to) = answered(&mut forwarder, &target(number), u64::from(number) * 4 + 1).unwrap();
        assert_eq!(to, socket_address(ROBOT));
    }
    assert_eq!((counts.get(Count::OtherUnit), counts.get(Count::Sessions)), (198, 1));
    // The first one is gone, and the other one continues.
    let passed = [3, 4, 5, 6]
        .map(|number| forwarder.receive_from_robot(&feedback(number), other, 2000 * MS));
    assert!(passed[3], "{passed:?}");
    assert_eq!(counts.get(Count::Sessions), 2);
}

#[test]
fn a_mechanical_unit_that_is_named_is_the_only_one() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    forwarder.settings.robot_port = Some(51_000);
    assert!(!forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address("192.168.125.1:51000"), MS));
    assert_eq!(counts.get(Count::OtherUnit), 1);
}

#[test]
fn broken_datagrams_reach_nobody_and_the_next_good_one_does() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    let good = target(1);
    for cut in [0, 1, 5, good.len() - 1] {
        assert!(answered(&mut forwarder, &good[..cut], 1).is_none(), "{cut} bytes");
        assert!(
            !forwarder.receive_from_robot(&feedback(2)[..cut], socket_address(ROBOT), MS),
            "{cut} bytes"
        );
    }
    for bad in [f64::NAN, f64::INFINITY] {
        let no_number = message(2, 2, 3, &[0.0, bad, 0.0, 0.0, 0.0, 0.0], None);
        assert!(answered(&mut forwarder, &no_number, 1).is_none());
    }
    assert_eq!(counts.get(Count::Broken), 10);
    assert!(answered(&mut forwarder, &good, 2).is_some());
}

#[test]
fn a_repeated_target_goes_out_again_and_an_overtaken_one_does_not() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    for (number, goes) in [(5, true), (5, true), (7, true), (6, false), (8, true)] {
        assert_eq!(answered(&mut forwarder, &target(number), 1).is_some(), goes, "number {number}");
    }
    let counted =
        [Count::Repeated, Count::Old, Count::ApplicationMissed].map(|what| counts.get(what));
    assert_eq!(counted, [1, 1, 1]);
}

#[test]
fn repeated_feedback_is_seen_once_and_missed_feedback_is_counted() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    let passed = [1, 1, 4, 3, 5]
        .map(|number| forwarder.receive_from_robot(&feedback(number), socket_address(ROBOT), MS));
    assert_eq!(passed, [true, false, true, false, true]);
    let counted = [Count::Repeated, Count::Old, Count::RobotMissed].map(|what| counts.get(what));
    assert_eq!(counted, [1, 1, 2]);
}

#[test]
fn an_application_that_says_nothing_leaves_the_robot_without_an_answer() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    for number in 1..=5 {
        assert!(forwarder.receive_from_robot(
            &feedback(number),
            socket_address(ROBOT),
            u64::from(number) * 4 * MS
        ));
        assert!(forwarder.own_path_correction(&mut [0; 200], u64::from(number) * 4 * MS).is_none());
        if number == 1 {
            assert!(answered(&mut forwarder, &target(1), 5).is_some());
        }
    }
    assert_eq!((counts.get(Count::Silent), counts.get(Count::Sent)), (3, 1));
}

#[test]
fn other_targets_are_forwarded_unchanged_and_counted() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    let others = [
        message(2, 1, 3, &[], None),
        message(2, 2, 3, &[1.0; 7], None),
        message(2, 3, 1, &[1.0; 6], None),
    ];
    for other in others {
        assert_eq!(answered(&mut forwarder, &other, 1).unwrap().0, other);
    }
    assert_eq!(counts.get(Count::NotCorrected), 3);
}

#[test]
fn a_speed_reference_alone_passes_as_it_is_and_is_no_corrected_target() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    // `EgmSensor.speedRef` is field 3: without `planned`, with an empty one, with a pose.
    let alone = message(3, 1, 3, &[1.5, 0.0, -2.0, 0.0, 0.0, 0.25], None);
    let mut beside_nothing = message(2, 2, 3, &[], None);
    beside_nothing.extend(&message(3, 2, 3, &[1.5; 6], None));
    for speeds in [alone, beside_nothing] {
        assert_eq!(answered(&mut forwarder, &speeds, 1).unwrap().0, speeds);
    }
    let counted =
        [Count::Plain, Count::NotCorrected, Count::Corrected].map(|what| counts.get(what));
    assert_eq!(counted, [2, 0, 0]);
}

#[test]
fn a_controller_that_restarts_is_a_new_run() {
    let (mut forwarder, counts) = forwarder(Guidance::Joints);
    let numbers = [(100, 0), (101, 4), (0, 8), (1, 12), (2, 16), (3, 20), (4, 24)];
    // Numbers that fall back, accepted at the fifth; a silence; no silence if it continued to
    // count.
    let numbers = numbers.into_iter().chain([(5, 1500), (60, 3000), (560, 3004)]);
    let passed: Vec<bool> = numbers
        .map(|(n, ms)| forwarder.receive_from_robot(&feedback(n), socket_address(ROBOT), ms * MS))
        .collect();
    assert_eq!(passed[..6], [true, true, false, false, false, false]);
    assert!(passed[6..].iter().all(|passed| *passed), "{passed:?}");
    assert_eq!(counts.get(Count::Sessions), 3);
}

#[test]
fn a_controller_that_waits_longer_keeps_its_run_where_the_configuration_says_so() {
    for (ends_after_s, sessions) in [(1, 2), (2, 1)] {
        let (mut forwarder, counts) = forwarder(Guidance::Joints);
        forwarder.settings.runs.ends_after = Duration::from_secs(ends_after_s);
        assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
        assert!(forwarder.receive_from_robot(&feedback(2), socket_address(ROBOT), 1500 * MS));
        assert_eq!(counts.get(Count::Sessions), sessions, "{ends_after_s} s");
    }
}

#[test]
fn of_a_path_y_and_z_are_changed_and_x_is_not() {
    let (mut forwarder, _) = forwarder(Guidance::Path);
    assert!(forwarder.receive_from_robot(&feedback(1), socket_address(ROBOT), 0));
    let mut bytes = vec![0; 100];
    let header = Header { seqno: Some(1), tm: None, mtype: Some(4) };
    let length = PathCorrMessage::write(&mut bytes, header, [0.5, 1.0, -2.0], 7).unwrap();
    bytes.truncate(length);
    // Without a daemon nothing is added.
    assert_eq!(answered(&mut forwarder, &bytes, 1).unwrap().0, bytes);
    assert!(answered(&mut forwarder, &target(2), 2).is_none(), "no path correction");
}

/// The bytes sent for a target of this number, after feedback of joints at `stands_deg` in a state
/// of motion.
fn sent(
    forwarder: &mut Forwarder<Corrected>,
    number: u32,
    stands_deg: [f64; 6],
    state: u64,
) -> Vec<u8> {
    let feedback = message(2, number, 2, &stands_deg, Some(state));
    assert!(forwarder.receive_from_robot(
        &feedback,
        socket_address(ROBOT),
        u64::from(4 * number) * MS
    ));
    answered(forwarder, &target(number), u64::from(4 * number) + 1).unwrap().0
}

#[test]
fn a_message_that_says_stopped_takes_no_correction_away_unless_the_robot_stands_without_it() {
    const RUNNING: u64 = 3;
    const STOPPED: u64 = 2;
    let commanded = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let corrected = [1.0 - 1e-3_f64.to_degrees(), 2.0, 3.0, 4.0, 5.0, 6.0];
    let (mut forwarder, counts) =
        middle_over(Guidance::Joints, Corrections::with_link(Corrected(-1e-3)));
    assert_ne!(sent(&mut forwarder, 1, corrected, RUNNING), target(1));
    // One old message, replayed; then a stop, with the robot at its last target.
    assert_ne!(sent(&mut forwarder, 2, [9.0; 6], STOPPED), target(2));
    assert_ne!(sent(&mut forwarder, 3, corrected, RUNNING), target(3));
    assert!((4..10).all(|k| sent(&mut forwarder, k, corrected, STOPPED) != target(k)));
    assert_ne!(sent(&mut forwarder, 10, corrected, RUNNING), target(10));
    // Moved by hand to the target itself.
    let moved: Vec<bool> =
        (11..16).map(|k| sent(&mut forwarder, k, commanded, STOPPED) == target(k)).collect();
    assert_eq!(moved, [false, false, true, true, true]);
    assert_eq!(sent(&mut forwarder, 16, commanded, RUNNING), target(16));
    assert_eq!(counts.get(Count::Plain), 3);
}

#[test]
fn many_missing_numbers_may_be_a_run_that_begins_elsewhere() {
    let commanded = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    for (number, is_corrected) in [(40, true), (60, false)] {
        let (mut forwarder, _) =
            middle_over(Guidance::Joints, Corrections::with_link(Corrected(-1e-3)));
        let _ = sent(&mut forwarder, 1, [9.0; 6], 3);
        let feedback = message(2, number, 2, &commanded, Some(3));
        assert!(forwarder.receive_from_robot(&feedback, socket_address(ROBOT), 400 * MS));
        let (sent, _) = answered(&mut forwarder, &target(2), 401).unwrap();
        assert_eq!(sent != target(2), is_corrected, "{number}");
    }
}
