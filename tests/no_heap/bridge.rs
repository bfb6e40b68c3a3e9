//! A bridge handles a datagram without allocation: reading, checking, changing in place, writing an
//! answer.
//!
//! Without a daemon: allocations of a command are counted in `cycle` and in the client's own tests.

use crate::heap_of;
use bridge::Counts;
use bridge::corrections::Corrections;
use bridge::daemon_link::DaemonLink;
use bridge::egm::forwarder::{Forwarder, Settings};
use bridge::egm::joints::JointOrder;
use bridge::egm::messages::{Header, PathCorrMessage, SensorMessage};
use bridge::rsi::answer::Answerer;
use bridge::settings::RunRules;
use prost::Message;
use recording::bridge::{EthernetConfig, Guidance, RsiConfig};
use recording::model::presets::preset;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;
use tests::egm::{EgmRobot, target};
use tests::place::MODEL;

const CYCLES: u32 = 1000;
const MS: u64 = 1_000_000;
const POSE: [f64; 6] = [10.0, 15.0, -10.0, 15.0, 45.0, 5.0];

fn address() -> SocketAddr {
    "127.0.0.1:6510".parse().unwrap()
}

/// No daemon of that name runs.
fn feed() -> Corrections {
    let (news, _) = channel();
    let fresh = Duration::from_millis(10);
    Corrections::with_link(
        DaemonLink::start("no-heap-nobody", Duration::ZERO, fresh, 1.0, news).unwrap(),
    )
}

#[test]
fn an_egm_cycle_takes_nothing_from_the_heap() {
    let arm = preset(MODEL).unwrap().model().unwrap().physics.arm;
    let settings = Settings {
        robot: address().ip(),
        robot_port: None,
        application: Some(address()),
        guidance: Guidance::Joints,
        order: JointOrder { count: 6, seventh_after: None },
        is_shadow: false,
        path_period_ns: 48 * MS,
        runs: RunRules::default(),
    };
    let mut forwarder = Forwarder::new(settings, arm, feed(), None, Arc::new(Counts::default()));
    let mut robot = EgmRobot::new(address(), &POSE);
    let feedback: Vec<Vec<u8>> = (0..CYCLES).map(|_| robot.message()).collect();
    let mut targets: Vec<Vec<u8>> =
        (0..CYCLES).map(|number| target(number, &POSE).encode_to_vec()).collect();
    let mut sent = 0;
    let counted = heap_of(|| {
        for (k, (feedback, target)) in (0..).zip(feedback.iter().zip(&mut targets)) {
            let now_ns = k * 4 * MS;
            forwarder.receive_from_robot(feedback, address(), now_ns);
            if let Some(screened) = forwarder.receive_from_application(target, address(), now_ns) {
                sent += u32::from(forwarder.answer(target, &screened).is_some());
            }
            if let Ok(message) = SensorMessage::read(target) {
                message.planned.joints.write(target, &POSE);
            }
            forwarder.check_connection();
            let mut message = [0; 128];
            let header = Header { seqno: Some(1), tm: None, mtype: Some(4) };
            PathCorrMessage::write(&mut message, header, [0.0, 1.0, 2.0], 1);
        }
    });
    assert_eq!((sent, counted.count_total), (CYCLES, 0));
}

#[test]
fn an_rsi_cycle_takes_nothing_from_the_heap() {
    let arm = preset(MODEL).unwrap().model().unwrap().physics.arm;
    let xml = include_str!("../../deploy/rsi-ethernet.xml");
    let ethernet = EthernetConfig::parse("ethernet.xml", xml).unwrap();
    let text = include_str!("../../deploy/bridge-rsi.toml").replace("192.168.1.2", "127.0.0.1");
    let config = RsiConfig::parse("bridge.toml", &text, ethernet).unwrap();
    let mut answerer = Answerer::new(config, arm, feed(), Arc::new(Counts::default()));
    let telegram = |k: u32| {
        format!(
            "<Rob Type=\"KUKA\"><ASPos A1=\"10\" A2=\"15\" A3=\"-10\" A4=\"15\" A5=\"45\" A6=\"5\" />\
             <Delay D=\"0\" /><IPOC>{}</IPOC></Rob>",
            123_456 + 4 * k
        )
    };
    let telegrams: Vec<String> = (0..CYCLES).map(telegram).collect();
    let (mut sent, mut buffer) = (0, [0; 1000]);
    let counted = heap_of(|| {
        for telegram in &telegrams {
            if let Some(request) = answerer.receive(telegram.as_bytes(), address()) {
                sent += u32::from(answerer.answer(&request, &mut buffer).is_some());
            }
        }
    });
    assert_eq!((sent, counted.count_total), (CYCLES, 0));
}
