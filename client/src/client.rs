//! The robot's side of a cell: commands out, corrected targets in.

use std::time::{Duration, Instant};

use shm_schema::{
    Cell, Command, Corrected, Horizon, JOINTS_MAX, Joined, Payload, PeerPublisher, PeerSubscriber,
    PortError, Request, Response, RobotState, Role, Status, Verdict, monotonic_ns, new_session,
};

use crate::horizon::fill;
use crate::link::{Connection, ConnectionEvent, KNOCK_AFTER, Link, Ports};
use crate::monitor::{Asker, MonitorPorts};
use crate::output::Output;
use crate::requests::requests;
use crate::{AskError, Away, ConnectError, NotATarget, NotSent, Setpoint, Target};

/// How long an answer is awaited by spinning, before sleeping.
const SPIN: Duration = Duration::from_micros(200);
const NAP: Duration = Duration::from_micros(50);
/// Polls between two readings of the clock, while spinning.
const LOOKS_PER_CLOCK: u32 = 8;

struct CellPorts {
    commands: PeerPublisher<Command>,
    corrected: PeerSubscriber<Corrected>,
    state: PeerPublisher<RobotState>,
    horizons: PeerPublisher<Horizon>,
    monitor: MonitorPorts,
}

impl Ports for CellPorts {
    const ROLE: Role = Role::Cell;
    fn open(joined: &Joined) -> Result<Self, PortError> {
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
    asker: Asker,
    session: u64,
    sent: Option<Command>,
    seq: u64,
    state_seq: u64,
    horizon: Box<Horizon>,
    newest: Option<Corrected>,
    epoch: u64,
    /// Since when commands are sent in this epoch without an answer.
    unheard_since_ns: Option<u64>,
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
            asker: Asker::new(),
            session: new_session(),
            sent: None,
            seq: 0,
            state_seq: 0,
            horizon: Box::default(),
            newest: None,
            epoch: 0,
            unheard_since_ns: None,
            status: None,
        };
        // The status brings the limits, without which there is no correction.
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
    /// [`NotSent`]; the loop continues with [`target_for`](Self::target_for) in any case.
    pub fn send(&mut self, setpoint: &Setpoint) -> Result<u64, NotSent> {
        let now_ns = monotonic_ns();
        let mut command = setpoint.command(self.seq + 1, self.session, now_ns)?;
        command.feed_override = self.output.feed_override();
        command.flags |= Command::HAS_FEED_OVERRIDE;
        self.mind_silence(now_ns);
        let ports = self.link.ports_to_tell()?;
        self.seq += 1;
        self.sent = Some(command);
        NotSent::unless_delivered(ports.commands.send(&command)).map(|()| command.seq)
    }

    /// Knocks where not one command of this epoch has had an answer for a while: what both ends joined may not be one memory, if its files were removed
    /// in between. No error tells.
    fn mind_silence(&mut self, now_ns: u64) {
        if self.newest.is_some() || self.link.ports().is_none() {
            self.unheard_since_ns = None;
            return;
        }
        let since_ns = *self.unheard_since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns) > KNOCK_AFTER.as_nanos() as u64 {
            self.unheard_since_ns = Some(now_ns);
            // Who never asked for an answer has not seen those that came.
            self.look();
            if self.newest.is_none() {
                self.link.knock();
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

    /// The last target sent, for a loop that must send something and has no command; none before the first target.
    #[must_use]
    pub fn last_target(&self) -> Option<Target> {
        self.output.sent()
    }

    /// The correction in the last target, rad or m.
    #[must_use]
    pub fn last_correction(&self) -> [f64; JOINTS_MAX] {
        self.output.correction()
    }

    /// The feed override in what was sent last; 1 is the programmed feed.
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
    /// See [`NotSent`].
    pub fn send_state(&mut self, state: &RobotState) -> Result<(), NotSent> {
        let joints = state.joints as usize;
        if joints == 0 || joints > JOINTS_MAX {
            return Err(NotATarget::Joints(joints).into());
        }
        let (seq, session) = (self.state_seq + 1, self.session);
        let ports = self.link.ports_to_tell()?;
        self.state_seq = seq;
        let message = RobotState { seq, session, sent_ns: monotonic_ns(), ..*state };
        NotSent::unless_delivered(ports.state.send(&message))
    }

    /// Sends the setpoints that follow the next command, in order and one command period apart, rad or m: call it before [`send`](Self::send).
    /// Of more than [`HORIZON_POINTS_MAX`](crate::HORIZON_POINTS_MAX) points the first are sent; returns how many were. It replaces the last horizon; an empty one says that
    /// no setpoint is known ahead.
    ///
    /// # Errors
    /// [`NotSent`]: [`NotSent::HorizonNotFinite`] if a number of the points to be sent is not finite, [`NotSent::NotATarget`] if they have not 1 to 16 joints.
    pub fn set_horizon<const N: usize>(&mut self, points: &[[f64; N]]) -> Result<usize, NotSent> {
        self.set_horizon_flat(points.as_flattened(), N)
    }

    /// The same for a number of joints that is not known to the compiler: all joints of the first point, then those of the next one.
    ///
    /// # Errors
    /// As [`set_horizon`](Self::set_horizon); [`NotSent::Invalid`] if the last point is not complete.
    pub fn set_horizon_flat(&mut self, points: &[f64], joints: usize) -> Result<usize, NotSent> {
        let count = fill(&mut self.horizon, points, joints)?;
        let ports = self.link.ports_to_tell()?;
        let horizon = &mut *self.horizon;
        horizon.seq += 1;
        horizon.session = self.session;
        horizon.command_seq = self.seq + 1;
        horizon.sent_ns = monotonic_ns();
        NotSent::unless_delivered(ports.horizons.send(horizon)).map(|()| count)
    }

    /// The newest corrected target of this daemon, however old.
    pub fn newest(&mut self) -> Option<Corrected> {
        self.look();
        self.newest
    }

    /// Takes the newest corrected target not yet taken.
    fn look(&mut self) {
        if let Connection::Connected { epoch, .. } = self.connection()
            && epoch != self.epoch
        {
            self.epoch = epoch;
            (self.newest, self.unheard_since_ns) = (None, None);
        }
        if let Some(ports) = self.link.ports()
            && let Some(fresh) = ports.corrected.take_newest()
            && fresh.check().is_ok()
        {
            self.newest = Some(fresh);
        }
    }

    /// The answer to the command with that number, awaited for at most `limit`.
    pub fn wait_corrected(&mut self, seq: u64, limit: Duration) -> Option<Corrected> {
        let start = Instant::now();
        let asked = (self.session, seq);
        let ours = |c: &Corrected| (c.command_session, c.command_seq) == asked;
        loop {
            // A look at the clock takes as long as a look at the message.
            for _ in 0..LOOKS_PER_CLOCK {
                self.look();
                if let Some(answer) = self.newest.as_ref().filter(|answer| ours(answer)) {
                    return Some(*answer);
                }
            }
            match start.elapsed() {
                spent if spent >= limit => return None,
                spent if spent < SPIN => std::hint::spin_loop(),
                spent => std::thread::sleep(NAP.min(limit - spent)),
            }
        }
    }

    /// Sends a command and awaits its answer for at most `limit`; in any case returns a target, as
    /// [`target_for`](Self::target_for) does.
    ///
    /// # Errors
    /// [`NotATarget`] if the command is not 1 to 16 finite numbers.
    pub fn exchange(&mut self, q_cmd: &[f64], limit: Duration) -> Result<Target, NotATarget> {
        if let Ok(seq) = self.send(&Setpoint::new(q_cmd)) {
            let _ = self.wait_corrected(seq, limit);
        }
        self.target_for(q_cmd, monotonic_ns())
    }

    /// The joint target to send to the robot for `q_cmd` at `now_ns` (`CLOCK_MONOTONIC`), whatever the state of the daemon: `q_cmd` plus a
    /// correction that continues from the last one sent, within the daemon's limits over the elapsed time.
    ///
    /// It approaches the daemon's correction while an answer is fresh, and equals it bit for bit once reached; without
    /// a fresh answer it is ramped to zero. A finite `q_cmd` is never changed, not even outside the model's limits: those are the
    /// controller's to judge.
    ///
    /// # Errors
    /// [`NotATarget`] if `q_cmd` is not 1 to 16 finite numbers. The state is then unchanged; [`last_target`](Self::last_target)
    /// is what was sent last.
    pub fn target_for(&mut self, q_cmd: &[f64], now_ns: u64) -> Result<Target, NotATarget> {
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

    /// The reason for not being connected; none while connected.
    pub fn away(&mut self) -> Option<Away> {
        self.link.away()
    }

    /// Events of the connection since the last call, oldest first.
    pub fn next_event(&mut self) -> Option<ConnectionEvent> {
        self.link.next_event()
    }

    fn ask(&mut self, request: Request, limit: Duration) -> Result<Response, AskError> {
        self.asker.ask(&mut self.link.ports_to_tell()?.monitor, request, limit)
    }
}

requests!(Client);
