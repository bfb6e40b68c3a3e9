//! The client of the robot's control loop: sends commanded joint targets, receives corrected ones.

use std::time::{Duration, Instant};

use shm_schema::{
    Cell, Command, Corrected, Horizon, JOINTS_MAX, JoinedEpoch, Payload, PeerPublisher,
    PeerSubscriber, PortError, Request, Response, RobotState, Role, Status, Verdict, monotonic_ns,
    new_session,
};

use crate::horizon::fill;
use crate::link::{Connection, ConnectionEvent, Link, NEW_EPOCH_AFTER, Ports};
use crate::monitor::{MonitorPorts, RequestSender};
use crate::output::Output;
use crate::requests::requests;
use crate::{
    ConnectError, DisconnectReason, InvalidTarget, RequestError, SendError, Setpoint, Target,
};

/// Time for which an answer is awaited by spinning, before the wait sleeps between polls.
const SPIN: Duration = Duration::from_micros(200);
const POLL_SLEEP: Duration = Duration::from_micros(50);
/// Polls between two readings of the clock, while spinning.
const POLLS_PER_CLOCK: u32 = 8;

struct CellPorts {
    commands: PeerPublisher<Command>,
    corrected: PeerSubscriber<Corrected>,
    state: PeerPublisher<RobotState>,
    horizons: PeerPublisher<Horizon>,
    monitor: MonitorPorts,
}

impl Ports for CellPorts {
    const ROLE: Role = Role::Cell;
    fn open(joined: &JoinedEpoch) -> Result<Self, PortError> {
        Ok(Self {
            commands: joined.publisher()?,
            corrected: joined.subscriber()?,
            state: joined.publisher()?,
            horizons: joined.publisher()?,
            monitor: MonitorPorts::open(joined)?,
        })
    }
}

/// The connection of the robot's loop to the daemon, one per cell. Can move between threads; not shared.
pub struct Client {
    link: Link<CellPorts>,
    output: Output,
    request_sender: RequestSender,
    session: u64,
    sent: Option<Command>,
    seq: u64,
    state_seq: u64,
    horizon: Box<Horizon>,
    newest: Option<Corrected>,
    epoch: u64,
    /// Time since which commands have been sent in this epoch without an answer.
    unanswered_since_ns: Option<u64>,
    status: Option<Status>,
}

impl Client {
    /// Connects to the cell's daemon within `limit`.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect(cell: &str, limit: Duration) -> Result<Self, ConnectError> {
        Self::connect_to(&Cell::new(cell)?, limit)
    }

    /// The same for a cell in another directory.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect_to(cell: &Cell, limit: Duration) -> Result<Self, ConnectError> {
        let start = Instant::now();
        let mut client = Self {
            link: Link::connect(cell, limit)?,
            output: Output::new(),
            request_sender: RequestSender::new(),
            session: new_session(),
            sent: None,
            seq: 0,
            state_seq: 0,
            horizon: Box::default(),
            newest: None,
            epoch: 0,
            unanswered_since_ns: None,
            status: None,
        };
        // The status contains the correction limits; without them nothing is corrected.
        while client.status().is_none() {
            if start.elapsed() > limit {
                let pid = match client.connection() {
                    Connection::Connected { pid, .. } => pid,
                    Connection::Lost => 0,
                };
                return Err(ConnectError::Silent { pid, limit });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(client)
    }

    /// Age limit of the daemon's answers in [`target_for`](Self::target_for); default 10 ms.
    /// Use at least two of the daemon's cycles.
    pub fn set_fresh(&mut self, fresh: Duration) {
        self.output.fresh_ns = u64::try_from(fresh.as_nanos()).unwrap_or(u64::MAX);
    }

    /// Sends a commanded target; returns its number.
    ///
    /// # Errors
    /// [`SendError`]; the loop continues with [`target_for`](Self::target_for) in any case.
    pub fn send(&mut self, setpoint: &Setpoint) -> Result<u64, SendError> {
        let now_ns = monotonic_ns();
        let mut command = setpoint.command(self.seq + 1, self.session, now_ns)?;
        command.feed_override = self.output.feed_override();
        command.flags |= Command::HAS_FEED_OVERRIDE;
        self.check_silence(now_ns);
        let ports = self.link.ports_for_sending()?;
        self.seq += 1;
        self.sent = Some(command);
        SendError::from_outcome(ports.commands.send(&command)).map(|()| command.seq)
    }

    /// Requests a new epoch if no command of this epoch has been answered for a while: if the shared-memory files were removed between the two joins, both ends use
    /// different memory, which no error reports.
    fn check_silence(&mut self, now_ns: u64) {
        if self.newest.is_some() || self.link.ports().is_none() {
            self.unanswered_since_ns = None;
            return;
        }
        let since_ns = *self.unanswered_since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns) > NEW_EPOCH_AFTER.as_nanos() as u64 {
            self.unanswered_since_ns = Some(now_ns);
            // A caller that never asks for an answer has not read those that arrived.
            self.take_newest();
            if self.newest.is_none() {
                self.link.request_new_epoch();
            }
        }
    }

    /// Starts a new run: the path history is reset.
    /// The correction continues from the last one sent.
    pub fn start_anew(&mut self) {
        (self.session, self.seq) = (new_session(), 0);
    }

    /// Starts a new run. The robot is at its command plus this correction, rad or m. An empty list means zero: the robot's program was
    /// restarted, and the controller's sum of corrections with it.
    pub fn start_from(&mut self, correction: &[f64]) {
        self.start_anew();
        self.output.start_from(correction);
    }

    /// The last target sent, for a loop that must send something and has no command; `None` before the first target.
    #[must_use]
    pub fn last_target(&self) -> Option<Target> {
        self.output.sent()
    }

    /// The correction in the last target, rad or m.
    #[must_use]
    pub fn last_correction(&self) -> [f64; JOINTS_MAX] {
        self.output.correction()
    }

    /// The feed override of the last target; 1 is the programmed feed.
    #[must_use]
    pub fn last_feed_override(&self) -> f64 {
        self.output.feed_override()
    }

    /// Sets the feed override in use at the robot, above 0 to 1; the output continues from it. Without this call it starts at the cell's override for a missing force.
    pub fn start_feed(&mut self, feed_override: f64) {
        self.output.start_feed(feed_override);
    }

    /// Sends the measured state of the robot; `seq`, `session` and `sent_ns` are filled in.
    ///
    /// # Errors
    /// See [`SendError`].
    pub fn send_state(&mut self, state: &RobotState) -> Result<(), SendError> {
        let joints = state.joints as usize;
        if joints == 0 || joints > JOINTS_MAX {
            return Err(InvalidTarget::Joints(joints).into());
        }
        let (seq, session) = (self.state_seq + 1, self.session);
        let ports = self.link.ports_for_sending()?;
        self.state_seq = seq;
        let message = RobotState { seq, session, sent_ns: monotonic_ns(), ..*state };
        SendError::from_outcome(ports.state.send(&message))
    }

    /// Sends the setpoints that follow the next command, in order and one command period apart, rad or m: call it before [`send`](Self::send).
    /// Of more than [`HORIZON_POINTS_MAX`](crate::HORIZON_POINTS_MAX) points the first are sent; returns their number. It replaces the last horizon; an empty one states that
    /// no setpoint is known ahead.
    ///
    /// # Errors
    /// [`SendError`]: [`SendError::HorizonNotFinite`] if a number of the points to be sent is not finite, [`SendError::InvalidTarget`] if they do not have 1 to 16 joints.
    pub fn set_horizon<const N: usize>(&mut self, points: &[[f64; N]]) -> Result<usize, SendError> {
        self.set_horizon_flat(points.as_flattened(), N)
    }

    /// The same for a number of joints known only at run time: all joints of the first point, then those of the next one.
    ///
    /// # Errors
    /// As [`set_horizon`](Self::set_horizon); [`SendError::Invalid`] if the last point is not complete.
    pub fn set_horizon_flat(&mut self, points: &[f64], joints: usize) -> Result<usize, SendError> {
        let count = fill(&mut self.horizon, points, joints)?;
        let ports = self.link.ports_for_sending()?;
        let horizon = &mut *self.horizon;
        horizon.seq += 1;
        horizon.session = self.session;
        horizon.command_seq = self.seq + 1;
        horizon.sent_ns = monotonic_ns();
        SendError::from_outcome(ports.horizons.send(horizon)).map(|()| count)
    }

    /// The newest corrected target of this daemon, however old.
    pub fn newest(&mut self) -> Option<Corrected> {
        self.take_newest();
        self.newest
    }

    /// Reads the newest corrected target, if one has arrived.
    fn take_newest(&mut self) {
        if let Connection::Connected { epoch, .. } = self.connection()
            && epoch != self.epoch
        {
            self.epoch = epoch;
            (self.newest, self.unanswered_since_ns) = (None, None);
        }
        if let Some(ports) = self.link.ports()
            && let Some(fresh) = ports.corrected.take_newest()
            && fresh.check().is_ok()
        {
            self.newest = Some(fresh);
        }
    }

    /// The answer to the command with this number; waits for at most `limit`.
    pub fn wait_corrected(&mut self, seq: u64, limit: Duration) -> Option<Corrected> {
        let start = Instant::now();
        let wanted = (self.session, seq);
        let ours = |c: &Corrected| (c.command_session, c.command_seq) == wanted;
        loop {
            // Reading the clock takes as long as polling for a message.
            for _ in 0..POLLS_PER_CLOCK {
                self.take_newest();
                if let Some(answer) = self.newest.as_ref().filter(|answer| ours(answer)) {
                    return Some(*answer);
                }
            }
            match start.elapsed() {
                spent if spent >= limit => return None,
                spent if spent < SPIN => std::hint::spin_loop(),
                spent => std::thread::sleep(POLL_SLEEP.min(limit - spent)),
            }
        }
    }

    /// Sends a command and awaits its answer for at most `limit`; in any case returns a target, as
    /// [`target_for`](Self::target_for) does.
    ///
    /// # Errors
    /// [`InvalidTarget`] if the command is not 1 to 16 finite numbers.
    pub fn exchange(&mut self, q_cmd: &[f64], limit: Duration) -> Result<Target, InvalidTarget> {
        if let Ok(seq) = self.send(&Setpoint::new(q_cmd)) {
            let _ = self.wait_corrected(seq, limit);
        }
        self.target_for(q_cmd, monotonic_ns())
    }

    /// The joint target to send to the robot for `q_cmd` at `now_ns` (`CLOCK_MONOTONIC`), whatever the state of the daemon: `q_cmd` plus a
    /// correction that continues from the last one sent, within the daemon's limits over the elapsed time.
    ///
    /// It approaches the daemon's correction while an answer is fresh, and equals it bit for bit once reached; without
    /// a fresh answer it is ramped to zero. A finite `q_cmd` is never changed, not even outside the model's limits: the controller
    /// monitors its own joint limits.
    ///
    /// # Errors
    /// [`InvalidTarget`] if `q_cmd` is not 1 to 16 finite numbers. The state is then unchanged; [`last_target`](Self::last_target)
    /// is the target sent last.
    pub fn target_for(&mut self, q_cmd: &[f64], now_ns: u64) -> Result<Target, InvalidTarget> {
        let newest = self.newest();
        if let Some(status) = self.link.ports().and_then(|ports| ports.monitor.status()) {
            self.take_status(status);
        }
        self.output.target(q_cmd, newest.as_ref(), self.sent.as_ref(), now_ns)
    }

    /// The newest status.
    pub fn status(&mut self) -> Option<Status> {
        if let Some(status) = self.link.ports().and_then(|ports| ports.monitor.status()) {
            self.take_status(status);
        }
        self.status
    }

    fn take_status(&mut self, status: Status) {
        self.output.set_bounds(&status.bounds);
        self.output.set_feed_bounds(&status.feed_bounds);
        self.status = Some(status);
    }

    /// The next vibration verdict not yet taken.
    pub fn vibration(&mut self) -> Option<Verdict> {
        self.link.ports().and_then(|ports| ports.monitor.vibration())
    }

    /// State of the connection.
    pub fn connection(&mut self) -> Connection {
        self.link.refresh();
        self.link.connection()
    }

    /// Why there is no connection; `None` while connected.
    pub fn disconnect_reason(&mut self) -> Option<DisconnectReason> {
        self.link.disconnect_reason()
    }

    /// Events of the connection since the last call, oldest first.
    pub fn next_event(&mut self) -> Option<ConnectionEvent> {
        self.link.next_event()
    }

    fn request(&mut self, request: Request, limit: Duration) -> Result<Response, RequestError> {
        self.request_sender.request(&mut self.link.ports_for_sending()?.monitor, request, limit)
    }
}

requests!(Client);
