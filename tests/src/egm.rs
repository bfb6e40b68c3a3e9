//! An EGM robot and an application in one thread, with the bridge between them: one cycle after the other.
//!
//! The messages are made and read by `prost`, not by the bridge's own code.

#[path = "../../bridge/tests/proto/mod.rs"]
pub mod proto;

use crate::place::TestDirectory;
use crate::process::Process;
use prost::Message;
use std::ffi::OsStr;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

/// Time limit of waiting for a datagram, generous for a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// `EgmMCIState` of a robot that is guided.
pub const RUNNING: i32 = 3;
/// State of a robot that is not guided.
pub const STOPPED: i32 = 2;

/// The bridge's configuration for this robot and, if given, the application.
#[must_use]
pub fn config(
    accuracy: &str,
    guidance: &str,
    application: Option<SocketAddr>,
    more: &str,
) -> String {
    let application = application
        .map(|address| format!("[application]\naddress = \"{address}\"\n"))
        .unwrap_or_default();
    format!(
        "schema = \"trued.bridge-egm/1\"\ncell = \"cell.toml\"\nabsolute_accuracy = \"{accuracy}\"\n\
         guidance = \"{guidance}\"\n[robot]\naddress = \"127.0.0.1\"\nlisten = \"127.0.0.1:0\"\n{application}{more}"
    )
}

/// Starts a bridge with that configuration; `before` precedes the arguments. Returns its addresses.
pub fn bridge(
    program: &str,
    before: &[&str],
    protocol: &str,
    place: &TestDirectory,
    config: &str,
) -> (Process, SocketAddr) {
    place.write("bridge.toml", config);
    let file = place.file("bridge.toml");
    let mut arguments: Vec<&OsStr> = before.iter().map(OsStr::new).collect();
    arguments.extend(["bridge", protocol, "--config"].map(OsStr::new));
    arguments.push(file.as_os_str());
    let process = Process::start(program, &arguments, place);
    assert!(process.wait_for_output("ready", PATIENCE), "{:#?}", process.lines());
    let address = process
        .lines()
        .iter()
        .find_map(|line| line.strip_prefix("ready: listening on ")?.parse().ok());
    (process, address.expect("an address"))
}

/// A socket of this machine.
#[must_use]
pub fn socket() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    socket.set_read_timeout(Some(PATIENCE)).expect("a time limit");
    socket
}

/// The robot's side.
#[derive(Debug)]
pub struct EgmRobot {
    /// Its socket.
    pub socket: UdpSocket,
    /// Where the bridge listens.
    pub bridge: SocketAddr,
    /// Number of its next message.
    pub seqno: u32,
    /// Its joint positions, degrees.
    pub joints: Vec<f64>,
    /// Reading of its force sensor, N and Nm.
    pub force: Option<[f64; 6]>,
    /// `EgmMCIState`.
    pub mci_state: i32,
}

impl EgmRobot {
    /// A robot that is guided.
    #[must_use]
    pub fn new(bridge: SocketAddr, joints: &[f64]) -> Self {
        let joints = joints.to_vec();
        Self { socket: socket(), bridge, seqno: 0, joints, force: None, mci_state: RUNNING }
    }

    /// Its next message.
    #[must_use]
    pub fn message(&mut self) -> Vec<u8> {
        self.seqno += 1;
        let joints = proto::Joints { joints: self.joints.clone() };
        let posture = proto::Posture { joints: Some(joints), ..proto::Posture::default() };
        let header =
            proto::Header { seqno: Some(self.seqno), tm: Some(4 * self.seqno), mtype: Some(2) };
        proto::Robot {
            header: Some(header),
            feedback: Some(posture.clone()),
            planned: Some(posture),
            motor_state: Some(proto::State { state: 1 }),
            mci_state: Some(proto::State { state: self.mci_state }),
            mci_convergence_met: Some(false),
            rapid_state: Some(proto::State { state: 2 }),
            force: self
                .force
                .map(|force| proto::Force { is_active: Some(true), force: force.to_vec() }),
            utilization_rate: Some(1.0),
            move_index: None,
        }
        .encode_to_vec()
    }

    /// Sends its position.
    pub fn say(&mut self) {
        let message = self.message();
        self.socket.send_to(&message, self.bridge).expect("a datagram goes out");
    }

    /// The target received; `None` if none arrives.
    #[must_use]
    pub fn hear(&self) -> Option<proto::Sensor> {
        proto::Sensor::decode(&receive_datagram(&self.socket)?.0[..]).ok()
    }
}

/// A datagram and its sender.
#[must_use]
pub fn receive_datagram(socket: &UdpSocket) -> Option<(Vec<u8>, SocketAddr)> {
    let mut bytes = [0; 4096];
    let (length, from) = socket.recv_from(&mut bytes).ok()?;
    Some((bytes[..length].to_vec(), from))
}

/// The speed reference of every target, deg/s.
#[must_use]
pub fn speeds() -> proto::SpeedRef {
    proto::SpeedRef {
        joints: Some(proto::Joints { joints: vec![1.5, -0.1, 0.0, 7.25, 0.0, 1e-9] }),
    }
}

/// A target as the application sends it, degrees, with a speed reference.
#[must_use]
pub fn target(seqno: u32, joints: &[f64]) -> proto::Sensor {
    let joints = proto::Joints { joints: joints.to_vec() };
    proto::Sensor {
        header: Some(proto::Header { seqno: Some(seqno), tm: None, mtype: Some(3) }),
        planned: Some(proto::Posture { joints: Some(joints), ..proto::Posture::default() }),
        speed_ref: Some(speeds()),
        later: Some("a field of a later version".to_owned()),
    }
}

/// The joints of a target, degrees.
#[must_use]
pub fn joints(sensor: &proto::Sensor) -> Vec<f64> {
    let joints = sensor.planned.as_ref().and_then(|planned| planned.joints.as_ref());
    joints.map(|joints| joints.joints.clone()).unwrap_or_default()
}

/// Both sides of a bridge.
#[derive(Debug)]
pub struct BridgeRig {
    /// The robot.
    pub robot: EgmRobot,
    /// The application's socket.
    pub application: UdpSocket,
}

impl BridgeRig {
    /// One cycle: the robot sends its position, the application answers, the robot receives the
    /// result and moves there.
    pub fn cycle(&mut self, target_deg: &[f64]) -> Option<Vec<f64>> {
        self.robot.say();
        let (feedback, bridge) = receive_datagram(&self.application)?;
        let feedback_read = proto::Robot::decode(&feedback[..]).ok()?;
        assert_eq!(feedback_read.header?.seqno, Some(self.robot.seqno), "feedback in its order");
        let answer = target(self.robot.seqno, target_deg).encode_to_vec();
        self.application.send_to(&answer, bridge).ok()?;
        let answer = self.robot.hear()?;
        assert_eq!(
            answer.header.as_ref()?.seqno,
            Some(self.robot.seqno),
            "the answer to this target"
        );
        assert_eq!(answer.speed_ref, Some(speeds()), "speeds pass as they were sent");
        assert_eq!(answer.later.as_deref(), Some("a field of a later version"));
        self.robot.joints = joints(&answer);
        Some(self.robot.joints.clone())
    }
}
