//! The robot's side of a cell: commands out, corrected targets in.

use std::time::{Duration, Instant};

use shm_schema::{
    Cell, Command, Corrected, JOINTS_MAX, Joined, Payload, PeerPublisher, PeerSubscriber,
    PortError, Request, Response, RobotState, Role, Status, Verdict, monotonic_ns, new_session,
};

use crate::link::{Connection, ConnectionEvent, KNOCK_AFTER, Link, Ports};
use crate::monitor::{Asker, MonitorPorts};
use crate::output::Output;
use crate::requests::requests;
use crate::{AskError, Away, ConnectError, NotATarget, NotSent, Setpoint, Target};

/// An answer is awaited spinning for so long, then with naps.
const SPIN: Duration = Duration::from_micros(200);
const NAP: Duration = Duration::from_micros(50);
/// Looks between two looks at the clock, while spinning.
const LOOKS_PER_CLOCK: u32 = 8;

struct CellPorts {
    commands: PeerPublisher<Command>,
    corrected: PeerSubscriber<Corrected>,
    state: PeerPublisher<RobotState>,
    monitor: MonitorPorts,
}

impl Ports for CellPorts {
    const ROLE: Role = Role::Cell;
    fn open(joined: &Joined) -> Result<Self, PortError> {
        Ok(Self {
            commands: joined.publisher()?,
            corrected: joined.subscriber()?,
            state: joined.publisher()?,
            monitor: MonitorPorts::open(joined)?,
        })
    }
}

/// A cell's one connection to its daemon. May move between threads; not shared.
pub struct Client {
    link: Link<CellPorts>,
    output: Output,
    asker: Asker,
    session: u64,
    sent: Option<Command>,
    seq: u64,
    state_seq: u64,
    newest: Option<Corrected>,
    epoch: u64,
    /// Since when commands are sent in this epoch without any answer.
    unheard_since_ns: Option<u64>,
    status: Option<Status>,
}

impl Client {
    /// Joins the cell's daemon, within `limit`.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect(cell: &str, limit: Duration) -> Result<Self, ConnectError> {
        Self::connect_to(&Cell::new(cell)?, limit)
    }

    /// The same for a cell in a place of its own.
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

    /// How old a daemon's answer may be for [`target_for`](Self::target_for): 10 ms unless told
    /// otherwise. Not below two of the daemon's cycles.
    pub fn set_fresh(&mut self, fresh: Duration) {
        self.output.fresh_ns = u64::try_from(fresh.as_nanos()).unwrap_or(u64::MAX);
    }

    /// Sends a commanded target; tells its number.
    ///
    /// # Errors
    /// [`NotSent`]; the loop goes on with [`target_for`](Self::target_for) whatever it says.
    pub fn send(&mut self, setpoint: &Setpoint) -> Result<u64, NotSent> {
        let now_ns = monotonic_ns();
        let command = setpoint.command(self.seq + 1, self.session, now_ns)?;
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

    /// Begins another run: for the daemon the next command follows none, and nothing of the path so far is remembered.
    /// The correction goes on from what was sent last.
    pub fn start_anew(&mut self) {
        (self.session, self.seq) = (new_session(), 0);
    }

    /// Begins another run. The robot is at its command plus this correction, rad or m. An empty list means zero: the robot's program was
    /// restarted, and the controller's sum of corrections with it.
    pub fn start_from(&mut self, correction: &[f64]) {
        self.start_anew();
        self.output.start_from(correction);
    }

    /// What was sent last, for a loop that has to send something and has no command; none before the first target.
    #[must_use]
    pub fn last_target(&self) -> Option<Target> {
        self.output.sent()
    }

    /// The correction in what was sent last, rad or m.
    #[must_use]
    pub fn last_correction(&self) -> [f64; JOINTS_MAX] {
        self.output.correction()
    }

    /// Sends what the robot measures of itself; `seq`, `session` and `sent_ns` are filled in.
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

    /// The newest corrected target of this daemon, however old.
    pub fn newest(&mut self) -> Option<Corrected> {
        self.look();
        self.newest
    }

    /// Takes the newest corrected target where there is one not taken yet.
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

    /// The answer to the command of that number, awaited for at most `limit`.
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

    /// Sends a command and awaits its answer for at most `limit`; answers like
    /// [`target_for`](Self::target_for) in any case.
    ///
    /// # Errors
    /// [`NotATarget`] where the command is no set of 1 to 16 finite numbers.
    pub fn exchange(&mut self, q_cmd: &[f64], limit: Duration) -> Result<Target, NotATarget> {
        if let Ok(seq) = self.send(&Setpoint::new(q_cmd)) {
            let _ = self.wait_corrected(seq, limit);
        }
        self.target_for(q_cmd, monotonic_ns())
    }

    /// What to send to the robot for `q_cmd` at `now_ns` (`CLOCK_MONOTONIC`), whatever has become of the daemon: `q_cmd` plus a
    /// correction that goes on from what was sent last within the daemon's limits, over the time that has passed since.
    ///
    /// It goes towards the daemon's correction while an answer is fresh, and is that correction bit for bit once there; without
    /// a fresh answer it goes to zero. A finite `q_cmd` passes as it came, also outside the model's limits: those are the
    /// controller's to judge.
    ///
    /// # Errors
    /// [`NotATarget`] where `q_cmd` is no set of 1 to 16 finite numbers. Nothing has changed then; [`last_target`](Self::last_target)
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
        self.status = Some(status);
    }

    /// The next verdict on vibration not yet taken.
    pub fn vibration(&mut self) -> Option<Verdict> {
        self.link.ports().and_then(|ports| ports.monitor.vibration())
    }

    /// State of the connection.
    pub fn connection(&mut self) -> Connection {
        self.link.refresh();
        self.link.connection()
    }

    /// Why not connected; none while connected.
    pub fn away(&mut self) -> Option<Away> {
        self.link.away()
    }

    /// What happened to the connection since, oldest first.
    pub fn next_event(&mut self) -> Option<ConnectionEvent> {
        self.link.next_event()
    }

    fn ask(&mut self, request: Request, limit: Duration) -> Result<Response, AskError> {
        self.asker.ask(&mut self.link.ports_to_tell()?.monitor, request, limit)
    }
}

requests!(Client);
