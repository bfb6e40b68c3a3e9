//! An EGM controller and its application.

use super::{CYCLE_NS, ControllerCell, JITTER_NS, Summary, VirtualDaemon, model, oracle};
use crate::cell_loop::{JOINTS, path};
use crate::egm::proto;
use crate::oracle::Oracle;
use crate::rng::TestRng;
use bridge::Counts;
use bridge::corrections::Corrections;
use bridge::egm::forwarder::{Forwarder, Settings};
use bridge::egm::joints::JointOrder;
use bridge::settings::RunRules;
use prost::Message;
use recording::bridge::Guidance;
use std::net::SocketAddr;
use std::sync::Arc;

fn socket_address(address: &str) -> SocketAddr {
    address.parse().expect("an address")
}

/// The controller's states of motion.
const RUNNING: i32 = 3;
const STOPPED: i32 = 2;

pub(super) struct EgmCell {
    forwarder: Forwarder<VirtualDaemon>,
    oracle: Oracle,
    /// The oracle under the hypothesis that the last run continued the previous one, until that is
    /// refuted.
    goes_on: Option<Oracle>,
    chance: TestRng,
    summary: Summary,
    now_ns: u64,
    /// Time at rest of the application, ns.
    standing_ns: u64,
    robot_number: u32,
    application_number: u32,
    /// Position of the robot, rad.
    position: [f64; JOINTS],
    mci_state: i32,
    /// Whether the first target of a run is still to come.
    begins: bool,
    /// Datagrams of either side, for replays.
    feedback: Vec<Vec<u8>>,
    targets: Vec<Vec<u8>>,
}

impl EgmCell {
    pub(super) fn new(seed: u64) -> Self {
        let mut chance = TestRng::new(seed);
        let settings = Settings {
            robot: socket_address("10.0.0.1:6510").ip(),
            robot_port: None,
            application: Some(socket_address("10.0.0.3:6511")),
            guidance: Guidance::Joints,
            order: JointOrder { count: JOINTS, seventh_after: None },
            is_shadow: false,
            path_period_ns: 48_000_000,
            runs: RunRules::default(),
        };
        let feed = Corrections::with_link(VirtualDaemon::new(chance.next_u64()));
        let now_ns = 1 << 40;
        Self {
            forwarder: Forwarder::new(
                settings,
                model().arm,
                feed,
                None,
                Arc::new(Counts::default()),
            ),
            oracle: oracle(),
            goes_on: None,
            chance,
            summary: Summary { runs: 1, ..Summary::default() },
            now_ns,
            standing_ns: 0,
            robot_number: 0,
            application_number: 0,
            position: path(now_ns),
            mci_state: RUNNING,
            begins: true,
            feedback: Vec::new(),
            targets: Vec::new(),
        }
    }

    fn of_robot(&mut self, datagram: &[u8], from: &str, now_ns: u64) -> bool {
        self.forwarder.link().now_ns = now_ns;
        self.forwarder.receive_from_robot(datagram, socket_address(from), now_ns)
    }

    /// Handles a datagram of the application, and its effect on the robot.
    fn of_application(&mut self, original: &[u8], now_ns: u64) {
        self.forwarder.link().now_ns = now_ns;
        let mut datagram = original.to_vec();
        let from = socket_address("10.0.0.3:6511");
        let Some(screened) = self.forwarder.receive_from_application(&datagram, from, now_ns)
        else {
            return;
        };
        let Some(to) = self.forwarder.answer(&mut datagram, &screened) else { return };
        if to != socket_address("10.0.0.1:6510") {
            return self.summary.breaks(&format!("sent to {to}"));
        }
        self.arrives(&joints(original), &joints(&datagram), now_ns);
    }

    fn arrives(&mut self, command: &[f64; JOINTS], sent: &[f64; JOINTS], now_ns: u64) {
        self.summary.sent += 1;
        let correction: [f64; JOINTS] = std::array::from_fn(|i| sent[i] - command[i]);
        self.summary.largest = correction.iter().fold(self.summary.largest, |m, c| m.max(c.abs()));
        let is_guided = self.mci_state == RUNNING;
        if is_guided && std::mem::take(&mut self.begins) {
            self.begin(command, sent, &correction);
        }
        // Also while the robot is not guided: the target sent may be the first that it follows.
        self.judge(command, sent, now_ns);
        if is_guided {
            self.position = *sent;
        }
    }

    fn judge(&mut self, command: &[f64; JOINTS], sent: &[f64; JOINTS], now_ns: u64) {
        let goes_on = self.goes_on.take().and_then(|mut oracle| {
            oracle.take(now_ns, now_ns, command, sent).is_ok().then_some(oracle)
        });
        match (self.oracle.take(now_ns, now_ns, command, sent), goes_on) {
            (Ok(()), goes_on) => self.goes_on = goes_on,
            (Err(_), Some(goes_on)) => self.oracle = goes_on,
            (Err(violation), None) => self.summary.breaks(&violation),
        }
    }

    /// The first target that the robot follows in a run.
    fn begin(&mut self, command: &[f64; JOINTS], sent: &[f64; JOINTS], correction: &[f64; JOINTS]) {
        // Hardly further from the robot's position than the application's own target.
        let distance = |q: &[f64; JOINTS]| -> f64 {
            q.iter()
                .zip(self.position)
                .map(|(q, socket_address)| (q - socket_address) * (q - socket_address))
                .sum::<f64>()
                .sqrt()
        };
        if distance(sent) > 3.0 * distance(command) + 1e-12 {
            let message =
                format!("a run begins {:e} off, not {:e}", distance(sent), distance(command));
            self.summary.breaks(&message);
        }
        // Either without a correction, or with the last one, which continues; if that was zero too,
        // later targets decide.
        if *correction == [0.0; JOINTS] {
            self.goes_on = Some(self.oracle.clone());
            self.oracle.begin(correction);
        }
    }

    /// No datagrams for a while; the robot waits, and so does the application.
    fn silence(&mut self) {
        let silence_ns = self.chance.below(2_500_000_000);
        self.now_ns += silence_ns;
        self.standing_ns += silence_ns;
        // Whether the controller counted on or not: the same run up to a second; beyond it only if it
        // counted on.
        if silence_ns >= 900_000_000 || self.chance.below(2) == 0 {
            self.robot_number += 1 + self.chance.below(3000) as u32;
        }
    }

    /// The controller restarts: at once or later, at the robot's position or elsewhere, with the
    /// application's targets from there.
    fn another_run(&mut self) {
        self.now_ns += self.chance.below(3_000_000_000);
        self.robot_number = self.chance.below(10) as u32;
        self.begins = true;
        self.summary.runs += 1;
        let elsewhere = self.chance.below(2) == 0;
        if elsewhere {
            self.standing_ns += self.chance.below(2_000_000_000);
            self.position = path(self.now_ns + CYCLE_NS - self.standing_ns);
        }
    }

    /// The robot is not guided for a while.
    fn stop(&mut self) {
        self.mci_state = STOPPED;
        let cycles = self.chance.below(30);
        for _ in 0..cycles {
            self.cycle();
        }
        self.mci_state = RUNNING;
        self.begins = true;
    }

    /// Repeats an old datagram of either side, or reorders two.
    fn replay(&mut self, now_ns: u64) {
        let pick = |list: &[Vec<u8>], c: &mut TestRng| {
            (!list.is_empty()).then(|| list[c.below(list.len() as u64) as usize].clone())
        };
        if self.chance.below(2) == 0 {
            if let Some(old) = pick(&self.feedback, &mut self.chance) {
                self.of_robot(&old, "10.0.0.1:6510", now_ns);
            }
        } else if let Some(old) = pick(&self.targets, &mut self.chance) {
            self.of_application(&old, now_ns);
        }
    }

    /// Another mechanical unit, another machine, half a datagram.
    fn foreign(&mut self, now_ns: u64) {
        let feedback = feedback(self.chance.below(100_000) as u32, &[1.0; JOINTS], RUNNING);
        self.of_robot(&feedback, "10.0.0.1:6599", now_ns);
        self.of_robot(&feedback, "10.0.0.9:6510", now_ns);
        let half = feedback.len() / 2;
        self.of_robot(&feedback[..half], "10.0.0.1:6510", now_ns);
    }

    fn feedback_now(&self) -> Vec<u8> {
        feedback(self.robot_number, &self.position, self.mci_state)
    }
}

impl ControllerCell for EgmCell {
    fn fault(&mut self) {
        let now_ns = self.now_ns + 3_000_000;
        let c = &mut self.chance;
        match c.below(200) {
            0 => self.silence(),
            // Just after a restart of the numbering, another change of numbers is indistinguishable from lost datagrams.
            1 if self.robot_number > 500 => self.another_run(),
            2 => self.stop(),
            3 if self.robot_number > 500 => self.robot_number += c.below(5000) as u32,
            4..10 => self.replay(now_ns),
            10 => self.foreign(now_ns),
            11 => {
                let target = target(self.application_number, &[f64::NAN; JOINTS]);
                self.of_application(&target, now_ns);
            }
            12 => {
                // One joint beyond the model's limits, for one target.
                let mut q = path(now_ns - self.standing_ns);
                q[c.below(JOINTS as u64) as usize] += 7.0;
                self.application_number += 1;
                let target = target(self.application_number, &q);
                self.of_application(&target, now_ns);
            }
            _ => {}
        }
    }

    /// One cycle of the controller.
    fn cycle(&mut self) {
        if self.summary.broken.is_some() {
            return;
        }
        let jitter_ns = if self.forwarder.link().fails { self.chance.below(JITTER_NS) } else { 0 };
        self.now_ns += CYCLE_NS;
        let now_ns = self.now_ns + jitter_ns;
        self.robot_number = self.robot_number.wrapping_add(1);
        let feedback = self.feedback_now();
        let lost = self.forwarder.link().fails && self.chance.below(40) == 0;
        let passes = !lost && self.of_robot(&feedback, "10.0.0.1:6510", now_ns);
        self.feedback.push(feedback);
        if passes {
            self.application_number = self.application_number.wrapping_add(1);
            let target = target(self.application_number, &path(now_ns - self.standing_ns));
            self.targets.push(target.clone());
            if !(self.forwarder.link().fails && self.chance.below(40) == 0) {
                self.of_application(&target, now_ns + 200_000);
            }
        }
        for list in [&mut self.feedback, &mut self.targets] {
            if list.len() > 200 {
                list.remove(0);
            }
        }
    }

    fn daemon(&mut self) -> &mut VirtualDaemon {
        self.forwarder.link()
    }

    fn summary(&mut self) -> &mut Summary {
        &mut self.summary
    }
}

fn posture(q: &[f64; JOINTS]) -> proto::Posture {
    let joints = q.map(f64::to_degrees).to_vec();
    proto::Posture { joints: Some(proto::Joints { joints }), ..proto::Posture::default() }
}

fn feedback(number: u32, q: &[f64; JOINTS], state: i32) -> Vec<u8> {
    proto::Robot {
        header: Some(proto::Header { seqno: Some(number), tm: Some(number), mtype: Some(2) }),
        feedback: Some(posture(q)),
        mci_state: Some(proto::State { state }),
        ..proto::Robot::default()
    }
    .encode_to_vec()
}

fn target(number: u32, q: &[f64; JOINTS]) -> Vec<u8> {
    proto::Sensor {
        header: Some(proto::Header { seqno: Some(number), tm: None, mtype: Some(3) }),
        planned: Some(posture(q)),
        ..proto::Sensor::default()
    }
    .encode_to_vec()
}

/// The joints of a target, rad.
fn joints(datagram: &[u8]) -> [f64; JOINTS] {
    let sensor = proto::Sensor::decode(datagram).expect("a message");
    let degrees = sensor.planned.and_then(|planned| planned.joints).expect("joints").joints;
    std::array::from_fn(|i| degrees[i].to_radians())
}
