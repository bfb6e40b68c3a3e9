//! Handling of datagrams by the EGM bridge, without sockets.
//!
//! Feedback and unknown fields are forwarded byte for byte; only the joint positions of a target are changed, never its speeds; nothing is sent before the first datagram of the
//! controller; on any fault the application's target is forwarded unchanged, or nothing is sent. No allocation except the transport's.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use physics::Arm;
use recording::bridge::Guidance;
use trued_client::{JOINTS_MAX, RobotState};

use super::classification::{ClassifiedTarget, classify};
use super::force::ForceForwarder;
use super::joints::JointOrder;
use super::messages::{
    MCI_ERROR, MCI_RUNNING, MCI_STOPPED, PathCorrMessage, Posture, RobotMessage,
};
use super::path::Path;
use crate::corrections::Corrections;
use crate::counts::{Count, Counts};
use crate::daemon_link::DaemonLink;
use crate::link::Link;
use crate::sequence::{Sequence, SequencePosition};
use crate::settings::RunRules;

/// Settings of the bridge.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The controller.
    pub robot: IpAddr,
    /// The port of its mechanical unit; `None`: the first that sends, as long as it continues.
    pub robot_port: Option<u16>,
    /// The application, if there is one.
    pub application: Option<SocketAddr>,
    /// The kind of target that is corrected.
    pub guidance: Guidance,
    /// Order of the arm's joints in messages.
    pub order: JointOrder,
    /// Shadow mode: no correction is sent.
    pub is_shadow: bool,
    /// Least time between two path corrections, ns.
    pub path_period_ns: u64,
    /// Rules for the runs of the controller and their datagrams.
    pub runs: RunRules,
}

/// The bridge between controller and application.
pub struct Forwarder<L = DaemonLink> {
    settings: Settings,
    arm: Arm,
    feed: Corrections<L>,
    force: Option<ForceForwarder>,
    counts: Arc<Counts>,
    path: Path,
    robot: Option<RobotRun>,
    /// Another mechanical unit, and the number of its datagrams since the last one of the unit that
    /// is served.
    other_unit: Option<(SocketAddr, u32)>,
    robot_sequence: Sequence,
    application_sequence: Sequence,
}

/// State of the controller's run.
#[derive(Debug, Clone, Copy)]
struct RobotRun {
    address: SocketAddr,
    last_ns: u64,
    is_guided: bool,
    /// Consecutive messages in a state in which the robot is not guided.
    not_guided: u32,
    /// Measured joint positions, in the arm's order, rad.
    position: Option<[f64; JOINTS_MAX]>,
    /// The newest planned (otherwise measured) joints, in the arm's order, rad.
    q: Option<[f64; JOINTS_MAX]>,
    /// Whether the application has sent a target in this run, and since the controller's last
    /// message.
    has_target: bool,
    is_answered: bool,
    tm: Option<u32>,
}

impl<L: Link> Forwarder<L> {
    /// Before the first datagram.
    #[must_use]
    pub fn new(
        settings: Settings,
        arm: Arm,
        feed: Corrections<L>,
        force: Option<ForceForwarder>,
        counts: Arc<Counts>,
    ) -> Self {
        Self {
            path: Path::new(settings.path_period_ns),
            settings,
            arm,
            feed,
            force,
            counts,
            robot: None,
            other_unit: None,
            robot_sequence: Sequence::counting(settings.runs.sequence),
            application_sequence: Sequence::counting(settings.runs.sequence),
        }
    }

    /// Processes a datagram of the controller; returns whether it is forwarded to the application.
    pub fn receive_from_robot(&mut self, datagram: &[u8], from: SocketAddr, now_ns: u64) -> bool {
        if from.ip() != self.settings.robot {
            return self.discard(Count::Foreign);
        }
        if !self.is_served(from, now_ns) {
            return self.discard(Count::OtherUnit);
        }
        let Some(message) = RobotMessage::read(datagram).ok().filter(|_| !datagram.is_empty())
        else {
            return self.discard(Count::Broken);
        };
        if self.robot.is_some_and(|robot| robot.address != from) {
            self.robot_sequence = Sequence::counting(self.settings.runs.sequence);
        }
        let standing = self.robot_sequence.classify(message.header.seqno, datagram);
        let lost = match standing {
            SequencePosition::Repeated => return self.discard(Count::Repeated),
            SequencePosition::Old => return self.discard(Count::Old),
            SequencePosition::First => 0,
            SequencePosition::Next { lost } => lost,
        };
        self.counts.increment(Count::Robot);
        self.counts.add(Count::RobotMissed, u64::from(lost));
        self.update_run(&message, standing, from, now_ns);
        if let (Some(way), Some(wrench)) = (&mut self.force, message.force.wrench()) {
            way.add_sample(&wrench, lost, now_ns, &self.counts);
        }
        true
    }

    /// Whether this is the mechanical unit that is served: the configured one; otherwise the
    /// present one, until it has been silent for a while and another one has sent several datagrams
    /// in a row.
    fn is_served(&mut self, from: SocketAddr, now_ns: u64) -> bool {
        if let Some(port) = self.settings.robot_port {
            return from.port() == port;
        }
        let Some(robot) = self.robot else { return true };
        if robot.address == from {
            self.other_unit = None;
            return true;
        }
        let datagrams =
            self.other_unit.filter(|(address, _)| *address == from).map_or(0, |(_, n)| n);
        self.other_unit = Some((from, datagrams + 1));
        self.is_silent(&robot, now_ns) && datagrams + 1 >= self.settings.runs.unit_switch_after
    }

    /// Whether the controller has been silent for long enough to end a run.
    fn is_silent(&self, robot: &RobotRun, now_ns: u64) -> bool {
        now_ns.saturating_sub(robot.last_ns) >= self.settings.runs.ends_after_ns()
    }

    /// Updates the state of the run by a message of the controller.
    fn update_run(
        &mut self,
        message: &RobotMessage,
        standing: SequencePosition,
        from: SocketAddr,
        now_ns: u64,
    ) {
        let lost = if let SequencePosition::Next { lost } = standing { lost } else { 0 };
        let silent = self.robot.is_some_and(|robot| self.is_silent(&robot, now_ns));
        let before = self.robot.filter(|robot| {
            // A silence during which the controller continued to count is a network failure.
            standing != SequencePosition::First && robot.address == from && (!silent || lost > 0)
        });
        // It may have restarted nevertheless: the position of the robot decides.
        let is_doubtful = silent || lost >= self.settings.runs.doubtful_lost;
        let is_guided = is_guided(self.settings.guidance, message.mci_state);
        let measured = self.settings.order.rad(&message.feedback);
        let planned = self.settings.order.rad(&message.planned);
        let (has_target, was_answered) =
            before.map_or((false, true), |before| (before.has_target, before.is_answered));
        if before.is_none() {
            self.counts.increment(Count::Sessions);
            self.path = Path::new(self.settings.path_period_ns);
        }
        let position = measured.or(planned);
        let by_joints = self.settings.guidance == Guidance::Joints;
        let begins = before.is_none_or(|before| !before.is_guided) || (is_doubtful && by_joints);
        if is_guided && begins {
            self.start(position);
        }
        let not_guided = before.map_or(0, |before| before.not_guided) + 1;
        if is_guided && has_target && !was_answered {
            self.counts.increment(Count::Silent);
        }
        self.robot = Some(RobotRun {
            address: from,
            last_ns: now_ns,
            is_guided,
            not_guided: if is_guided { 0 } else { not_guided },
            position,
            q: planned.or(measured),
            has_target,
            is_answered: false,
            tm: message.header.tm,
        });
        if let Some(q_measured) = measured {
            let joints = self.arm.count() as u32;
            let flags = RobotState::HAS_Q;
            let state =
                RobotState { joints, flags, q_measured, t_ns: now_ns, ..RobotState::default() };
            self.feed.link().send_state(&state);
        }
    }

    /// The robot starts to be guided, from its present position. Along a path corrections
    /// accumulate from zero.
    fn start(&mut self, position: Option<[f64; JOINTS_MAX]>) {
        match position.filter(|_| self.settings.guidance == Guidance::Joints) {
            Some(position) => self.feed.start_at(&position),
            None => self.feed.start_at_zero(),
        }
    }

    /// Processes a datagram of the application; returns what may be answered.
    pub fn receive_from_application(
        &mut self,
        datagram: &[u8],
        from: SocketAddr,
        now_ns: u64,
    ) -> Option<ClassifiedTarget> {
        let refused = |what| {
            self.counts.increment(what);
            None
        };
        if Some(from) != self.settings.application {
            return refused(Count::Foreign);
        }
        if self.robot.is_none_or(|robot| self.is_silent(&robot, now_ns)) {
            return refused(Count::Early);
        }
        let (header, screened) = match classify(self.settings.guidance, datagram) {
            Some(read) if !datagram.is_empty() => read,
            _ => return refused(Count::Broken),
        };
        let is_repeated = match self.application_sequence.classify(header.seqno, datagram) {
            SequencePosition::Old => return refused(Count::Old),
            SequencePosition::Repeated => {
                self.counts.increment(Count::Repeated);
                true
            }
            SequencePosition::Next { lost } => {
                self.counts.add(Count::ApplicationMissed, u64::from(lost));
                false
            }
            SequencePosition::First => false,
        };
        self.counts.increment(Count::Application);
        Some(match screened {
            ClassifiedTarget::Joints { planned, .. } => {
                ClassifiedTarget::Joints { planned, is_repeated }
            }
            other => other,
        })
    }

    /// Corrects a classified datagram in place; returns its destination.
    pub fn answer(
        &mut self,
        datagram: &mut [u8],
        screened: &ClassifiedTarget,
    ) -> Option<SocketAddr> {
        let robot = self.robot.as_mut()?;
        (robot.has_target, robot.is_answered) = (true, true);
        let robot = *robot;
        match screened {
            ClassifiedTarget::Joints { planned, is_repeated }
                if !self.passes_unchanged(planned, &robot) =>
            {
                self.correct_joints(datagram, planned, *is_repeated);
            }
            ClassifiedTarget::Offset(message) if robot.is_guided => {
                let offset_mm = self.offset_mm(&robot);
                if let Some(offset) = message.offset {
                    let [x, y, z] = offset.mm;
                    offset.put(datagram, [x, y + offset_mm.0, z + offset_mm.1]);
                }
            }
            ClassifiedTarget::Unchanged => self.counts.increment(Count::NotCorrected),
            ClassifiedTarget::Joints { planned, .. } => {
                self.counts.increment(Count::Plain);
                if let Some(q) = self.settings.order.rad(planned) {
                    self.feed.store_uncorrected(&q);
                }
            }
            ClassifiedTarget::Offset(_) | ClassifiedTarget::SpeedOnly => {
                self.counts.increment(Count::Plain);
            }
        }
        self.counts.increment(Count::Sent);
        Some(robot.address)
    }

    /// Whether a joint target is sent as commanded: the robot is not guided, and the first target
    /// that it follows has to be the application's own. A correction in force continues until the
    /// robot is at rest without it, because the message that starts the guidance may have been
    /// lost.
    fn passes_unchanged(&self, planned: &Posture, robot: &RobotRun) -> bool {
        if robot.is_guided {
            return false;
        }
        let (q, position) = (self.settings.order.rad(planned), robot.position);
        let (Some(q), Some(position)) = (q, position.filter(|_| self.feed.is_correcting())) else {
            return true;
        };
        robot.not_guided >= self.settings.runs.stopped_after
            && self.feed.is_at_target(&q[..self.arm.count()], &position)
    }

    fn correct_joints(&mut self, datagram: &mut [u8], planned: &Posture, is_repeated: bool) {
        let Some(q) = self.settings.order.rad(planned) else {
            self.counts.increment(Count::NotCorrected);
            return;
        };
        let q = &q[..self.arm.count()];
        let made = if is_repeated { self.feed.repeat(q) } else { self.feed.command(q) };
        self.counts.count_answer(&made);
        if self.settings.is_shadow || made.is_zero() {
            return;
        }
        let put = |i: usize, degrees: f64| match made.rad[i] {
            0.0 => degrees,
            rad => degrees + rad.to_degrees(),
        };
        self.settings.order.write_joints(datagram, planned, put);
    }

    /// A path correction of the bridge itself, if no application guides the controller: its length
    /// in `to`, and its destination.
    pub fn own_path_correction(
        &mut self,
        to: &mut [u8],
        now_ns: u64,
    ) -> Option<(usize, SocketAddr)> {
        let is_ours =
            self.settings.guidance == Guidance::Path && self.settings.application.is_none();
        let robot = self.robot.filter(|robot| is_ours && robot.is_guided && !robot.is_answered)?;
        if !self.path.is_due(now_ns) {
            return None;
        }
        let (y, z) = self.offset_mm(&robot);
        let header = self.path.header(robot.tm);
        let length = PathCorrMessage::write(to, header, [0.0, y, z], Path::AGE_MS)?;
        if let Some(robot) = &mut self.robot {
            robot.is_answered = true;
        }
        self.counts.increment(Count::Sent);
        Some((length, robot.address))
    }

    /// Component of the correction across the path, mm.
    fn offset_mm(&mut self, robot: &RobotRun) -> (f64, f64) {
        let Some(q) = robot.q else {
            self.counts.increment(Count::NotCorrected);
            return (0.0, 0.0);
        };
        let q = &q[..self.arm.count()];
        let made = self.feed.command(q);
        self.counts.count_answer(&made);
        let (y, z) = self.path.across_mm(&self.arm, q, &made.rad);
        if self.settings.is_shadow { (0.0, 0.0) } else { (y, z) }
    }

    /// Source of corrections.
    pub fn link(&mut self) -> &mut L {
        self.feed.link()
    }

    /// Nothing was received for a while: checks the connection to the daemon.
    pub fn check_connection(&mut self) {
        self.feed.link().check_connection();
    }

    /// Counts a datagram that could not be sent.
    pub fn count_not_sent(&self) {
        self.counts.increment(Count::NotSent);
    }

    /// Counts a target that was superseded by a newer one before it was answered.
    pub fn count_superseded(&self) {
        self.counts.increment(Count::Superseded);
    }

    fn discard(&self, what: Count) -> bool {
        self.counts.increment(what);
        false
    }
}

/// Whether the controller reports that targets move the robot, or does not report it. Path
/// corrections apply before the state is known.
fn is_guided(guidance: Guidance, mci_state: Option<u32>) -> bool {
    match guidance {
        Guidance::Joints => mci_state.is_none_or(|state| state == MCI_RUNNING),
        Guidance::Path => !matches!(mci_state, Some(MCI_ERROR | MCI_STOPPED)),
    }
}

#[cfg(test)]
mod tests;
