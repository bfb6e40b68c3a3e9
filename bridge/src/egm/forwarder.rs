//! Handling of datagrams by the EGM bridge, without sockets.
//!
//! Feedback and unknown fields are forwarded byte for byte; of a target only the joint positions are changed, never speeds; nothing is sent before the first datagram of the
//! controller; in case of any fault the application's target is forwarded unchanged, or nothing is sent. No allocation except the transport's.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use physics::Arm;
use recording::bridge::Guidance;
use trued_client::{JOINTS_MAX, RobotState};

use super::force::ForceForwarder;
use super::joints::Order;
use super::messages::{
    MCI_ERROR, MCI_RUNNING, MCI_STOPPED, PathCorrMessage, Posture, RobotMessage,
};
use super::path::Path;
use super::screened::{Screened, read};
use crate::counts::{Count, Counts};
use crate::feed::Feed;
use crate::joining::Joining;
use crate::link::Link;
use crate::sequence::{Sequence, Standing};
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
    pub order: Order,
    /// Shadow mode: no correction is sent.
    pub is_shadow: bool,
    /// Least time between two path corrections, ns.
    pub path_period_ns: u64,
    /// Rules for the runs of the controller and their datagrams.
    pub runs: RunRules,
}

/// The bridge between controller and application.
pub struct Forwarder<L = Joining> {
    settings: Settings,
    arm: Arm,
    feed: Feed<L>,
    force: Option<ForceForwarder>,
    counts: Arc<Counts>,
    path: Path,
    robot: Option<Robot>,
    /// Another mechanical unit, and the number of its datagrams since the last one of the unit that
    /// is served.
    other_unit: Option<(SocketAddr, u32)>,
    robot_sequence: Sequence,
    application_sequence: Sequence,
}

/// State of the controller's run.
#[derive(Debug, Clone, Copy)]
struct Robot {
    address: SocketAddr,
    last_ns: u64,
    is_guided: bool,
    /// Consecutive messages in a state in which the robot is not guided.
    not_guided: u32,
    /// Measured position, in the arm's order, rad.
    stands: Option<[f64; JOINTS_MAX]>,
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
        feed: Feed<L>,
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
    pub fn of_robot(&mut self, datagram: &[u8], from: SocketAddr, now_ns: u64) -> bool {
        if from.ip() != self.settings.robot {
            return self.drop(Count::Foreign);
        }
        if !self.is_served(from, now_ns) {
            return self.drop(Count::OtherUnit);
        }
        let Some(message) = RobotMessage::read(datagram).ok().filter(|_| !datagram.is_empty())
        else {
            return self.drop(Count::Broken);
        };
        if self.robot.is_some_and(|robot| robot.address != from) {
            self.robot_sequence = Sequence::counting(self.settings.runs.sequence);
        }
        let standing = self.robot_sequence.judge(message.header.seqno, datagram);
        let lost = match standing {
            Standing::Repeated => return self.drop(Count::Repeated),
            Standing::Old => return self.drop(Count::Old),
            Standing::First => 0,
            Standing::Next { lost } => lost,
        };
        self.counts.one(Count::Robot);
        self.counts.add(Count::RobotMissed, u64::from(lost));
        self.note(&message, standing, from, now_ns);
        if let (Some(way), Some(wrench)) = (&mut self.force, message.force.wrench()) {
            way.take(&wrench, lost, now_ns, &self.counts);
        }
        true
    }

    /// Whether this is the mechanical unit that is served: the configured one; otherwise the
    /// present one, until it has been silent for a while and another one has sent several datagrams
    /// in a row.
    /// another one has sent several datagrams in a row.
    fn is_served(&mut self, from: SocketAddr, now_ns: u64) -> bool {
        if let Some(port) = self.settings.robot_port {
            return from.port() == port;
        }
        let Some(robot) = self.robot else { return true };
        if robot.address == from {
            self.other_unit = None;
            return true;
        }
        let seen = self.other_unit.filter(|(address, _)| *address == from).map_or(0, |(_, n)| n);
        self.other_unit = Some((from, seen + 1));
        self.is_over(&robot, now_ns) && seen + 1 >= self.settings.runs.unit_taken_after
    }

    /// Whether the controller has been silent for long enough to end a run.
    fn is_over(&self, robot: &Robot, now_ns: u64) -> bool {
        now_ns.saturating_sub(robot.last_ns) >= self.settings.runs.ends_after_ns()
    }

    /// Updates the state of the run by a message of the controller.
    fn note(&mut self, message: &RobotMessage, standing: Standing, from: SocketAddr, now_ns: u64) {
        let lost = if let Standing::Next { lost } = standing { lost } else { 0 };
        let silent = self.robot.is_some_and(|robot| self.is_over(&robot, now_ns));
        let before = self.robot.filter(|robot| {
            // A silence during which the controller continued to count is a network failure.
            standing != Standing::First && robot.address == from && (!silent || lost > 0)
        });
        // It may have restarted nevertheless: the position of the robot decides.
        let is_doubtful = silent || lost >= self.settings.runs.doubtful_lost;
        let is_guided = is_guided(self.settings.guidance, message.mci_state);
        let measured = self.settings.order.rad(&message.feedback);
        let planned = self.settings.order.rad(&message.planned);
        let (has_target, was_answered) =
            before.map_or((false, true), |before| (before.has_target, before.is_answered));
        if before.is_none() {
            self.counts.one(Count::Sessions);
            self.path = Path::new(self.settings.path_period_ns);
        }
        let stands = measured.or(planned);
        let by_joints = self.settings.guidance == Guidance::Joints;
        let begins = before.is_none_or(|before| !before.is_guided) || (is_doubtful && by_joints);
        if is_guided && begins {
            self.start(stands);
        }
        let not_guided = before.map_or(0, |before| before.not_guided) + 1;
        if is_guided && has_target && !was_answered {
            self.counts.one(Count::Silent);
        }
        self.robot = Some(Robot {
            address: from,
            last_ns: now_ns,
            is_guided,
            not_guided: if is_guided { 0 } else { not_guided },
            stands,
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
    fn start(&mut self, stands: Option<[f64; JOINTS_MAX]>) {
        match stands.filter(|_| self.settings.guidance == Guidance::Joints) {
            Some(stands) => self.feed.start_at(&stands),
            None => self.feed.start_at_zero(),
        }
    }

    /// Processes a datagram of the application; returns what may be answered.
    pub fn of_application(
        &mut self,
        datagram: &[u8],
        from: SocketAddr,
        now_ns: u64,
    ) -> Option<Screened> {
        let refused = |what| {
            self.counts.one(what);
            None
        };
        if Some(from) != self.settings.application {
            return refused(Count::Foreign);
        }
        if self.robot.is_none_or(|robot| self.is_over(&robot, now_ns)) {
            return refused(Count::Early);
        }
        let (header, screened) = match read(self.settings.guidance, datagram) {
            Some(read) if !datagram.is_empty() => read,
            _ => return refused(Count::Broken),
        };
        let is_repeated = match self.application_sequence.judge(header.seqno, datagram) {
            Standing::Old => return refused(Count::Old),
            Standing::Repeated => {
                self.counts.one(Count::Repeated);
                true
            }
            Standing::Next { lost } => {
                self.counts.add(Count::ApplicationMissed, u64::from(lost));
                false
            }
            Standing::First => false,
        };
        self.counts.one(Count::Application);
        Some(match screened {
            Screened::Joints { planned, .. } => Screened::Joints { planned, is_repeated },
            other => other,
        })
    }

    /// Corrects a classified datagram in place; returns its destination.
    pub fn answer(&mut self, datagram: &mut [u8], screened: &Screened) -> Option<SocketAddr> {
        let robot = self.robot.as_mut()?;
        (robot.has_target, robot.is_answered) = (true, true);
        let robot = *robot;
        match screened {
            Screened::Joints { planned, is_repeated } if !self.is_passed(planned, &robot) => {
                self.correct_joints(datagram, planned, *is_repeated);
            }
            Screened::Offset(message) if robot.is_guided => {
                let offset_mm = self.offset_mm(&robot);
                if let Some(offset) = message.offset {
                    let [x, y, z] = offset.mm;
                    offset.put(datagram, [x, y + offset_mm.0, z + offset_mm.1]);
                }
            }
            Screened::AsItIs => self.counts.one(Count::NotCorrected),
            Screened::Joints { planned, .. } => {
                self.counts.one(Count::Plain);
                if let Some(q) = self.settings.order.rad(planned) {
                    self.feed.pass(&q);
                }
            }
            Screened::Offset(_) | Screened::SpeedAlone => self.counts.one(Count::Plain),
        }
        self.counts.one(Count::Sent);
        Some(robot.address)
    }

    /// Whether a joint target is sent as commanded: the robot is not guided, and the first target
    /// that it follows has to be the application's own. A correction in force continues until the
    /// robot is at rest without it, because the message that starts the guidance may have been
    /// lost.
    fn is_passed(&self, planned: &Posture, robot: &Robot) -> bool {
        if robot.is_guided {
            return false;
        }
        let (q, stands) = (self.settings.order.rad(planned), robot.stands);
        let (Some(q), Some(stands)) = (q, stands.filter(|_| self.feed.is_correcting())) else {
            return true;
        };
        robot.not_guided >= self.settings.runs.stopped_after
            && self.feed.is_at_target(&q[..self.arm.count()], &stands)
    }

    fn correct_joints(&mut self, datagram: &mut [u8], planned: &Posture, is_repeated: bool) {
        let Some(q) = self.settings.order.rad(planned) else {
            self.counts.one(Count::NotCorrected);
            return;
        };
        let q = &q[..self.arm.count()];
        let made = if is_repeated { self.feed.repeat(q) } else { self.feed.command(q) };
        self.counts.answer(&made);
        if self.settings.is_shadow || made.is_zero() {
            return;
        }
        let put = |i: usize, degrees: f64| match made.rad[i] {
            0.0 => degrees,
            rad => degrees + rad.to_degrees(),
        };
        self.settings.order.put(datagram, planned, put);
    }

    /// A path correction of the bridge itself, if no application guides the controller: its length
    /// in `to`, and its destination.
    pub fn own_answer(&mut self, to: &mut [u8], now_ns: u64) -> Option<(usize, SocketAddr)> {
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
        self.counts.one(Count::Sent);
        Some((length, robot.address))
    }

    /// Component of the correction across the path, mm.
    fn offset_mm(&mut self, robot: &Robot) -> (f64, f64) {
        let Some(q) = robot.q else {
            self.counts.one(Count::NotCorrected);
            return (0.0, 0.0);
        };
        let q = &q[..self.arm.count()];
        let made = self.feed.command(q);
        self.counts.answer(&made);
        let (y, z) = self.path.across_mm(&self.arm, q, &made.rad);
        if self.settings.is_shadow { (0.0, 0.0) } else { (y, z) }
    }

    /// Source of corrections.
    pub fn link(&mut self) -> &mut L {
        self.feed.link()
    }

    /// Nothing was received for a while: checks the connection to the daemon.
    pub fn idle(&mut self) {
        self.feed.link().look();
    }

    /// Counts a datagram that could not be sent.
    pub fn not_sent(&self) {
        self.counts.one(Count::NotSent);
    }

    /// Counts a target that was superseded by a newer one before it was answered.
    pub fn superseded(&self) {
        self.counts.one(Count::Superseded);
    }

    fn drop(&self, what: Count) -> bool {
        self.counts.one(what);
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
