//! Monitoring and requests: status, vibration verdicts, force spectra, requests. Any number per cell; not for use in the robot's control loop.

use std::path::Path;
use std::time::{Duration, Instant};

use shm_schema::{
    Cell, JoinedEpoch, Payload, PeerControl, PeerSubscriber, PortError, Request, Response, Role,
    Spectrum, Status, Verdict, monotonic_ns, new_session,
};

use crate::link::{Connection, ConnectionEvent, Link, Ports};
use crate::requests::{reload, requests};
use crate::{ConnectError, DisconnectReason, RequestError};

/// Polling interval for an answer.
const ANSWER_POLL_PERIOD: Duration = Duration::from_micros(200);

/// The ports of any client, as needed by a monitor.
pub(crate) struct MonitorPorts {
    status: PeerSubscriber<Status>,
    vibration: PeerSubscriber<Verdict>,
    control: PeerControl,
    /// Opened by the first reading, because the daemon computes spectra only while they are read.
    spectrum: Option<PeerSubscriber<Spectrum>>,
    joined: JoinedEpoch,
}

impl Ports for MonitorPorts {
    const ROLE: Role = Role::Monitor;
    fn open(joined: &JoinedEpoch) -> Result<Self, PortError> {
        Ok(Self {
            status: joined.subscriber()?,
            vibration: joined.subscriber()?,
            control: joined.control()?,
            spectrum: None,
            joined: joined.clone(),
        })
    }
}

impl MonitorPorts {
    /// The newest status since the last call.
    pub(crate) fn status(&mut self) -> Option<Status> {
        self.status.take_newest().filter(|s| s.check().is_ok())
    }

    /// The next verdict.
    pub(crate) fn vibration(&mut self) -> Option<Verdict> {
        self.vibration.take_next().filter(|v| v.check().is_ok())
    }

    /// The next spectrum; `None` also if all reader places are taken.
    fn spectrum(&mut self) -> Option<Spectrum> {
        if self.spectrum.is_none() {
            self.spectrum = self.joined.subscriber().ok();
        }
        self.spectrum.as_mut()?.take_next().filter(|s| s.check().is_ok())
    }

    fn request(&mut self, request: &Request, limit: Duration) -> Result<Response, RequestError> {
        let start = Instant::now();
        let mut pending = None;
        loop {
            if pending.is_none() {
                pending = self.control.send_request(request);
            }
            let answer = pending.as_ref().and_then(shm_schema::PendingResponse::answer);
            let ours = |a: &Response| (a.seq, a.session) == (request.seq, request.session);
            if let Some(answer) = answer.filter(|a| a.check().is_ok() && ours(a)) {
                return Ok(answer);
            }
            if start.elapsed() >= limit {
                return Err(RequestError::TimedOut { limit });
            }
            std::thread::sleep(ANSWER_POLL_PERIOD);
        }
    }
}

/// Sends requests with consecutive numbers.
pub(crate) struct RequestSender {
    seq: u64,
    session: u64,
}

impl RequestSender {
    pub(crate) fn new() -> Self {
        Self { seq: 0, session: new_session() }
    }

    pub(crate) fn request(
        &mut self,
        ports: &mut MonitorPorts,
        request: Request,
        limit: Duration,
    ) -> Result<Response, RequestError> {
        self.seq += 1;
        let request =
            Request { seq: self.seq, session: self.session, t_ns: monotonic_ns(), ..request };
        ports.request(&request, limit)
    }
}

/// Monitors a cell and sends requests to its daemon; any number of processes can do so.
pub struct Monitor {
    link: Link<MonitorPorts>,
    request_sender: RequestSender,
    status: Option<Status>,
}

impl Monitor {
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
        Ok(Self {
            link: Link::connect(cell, limit)?,
            request_sender: RequestSender::new(),
            status: None,
        })
    }

    /// The newest status, if any.
    pub fn status(&mut self) -> Option<Status> {
        let fresh = self.link.ports().and_then(MonitorPorts::status);
        self.status = fresh.or(self.status);
        self.status
    }

    /// The next vibration verdict not yet taken.
    pub fn vibration(&mut self) -> Option<Verdict> {
        self.link.ports().and_then(MonitorPorts::vibration)
    }

    /// The next spectrum of the force not yet taken: up to ten a second while force samples arrive, from the first call on. Each
    /// costs the daemon a transform of about a fifth of a second of samples, outside its real-time cycle; without a reader it computes none. At most four
    /// are buffered: a slow reader misses the older ones and delays no other process.
    pub fn spectrum(&mut self) -> Option<Spectrum> {
        self.link.ports().and_then(MonitorPorts::spectrum)
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

    /// As [`Monitor::reload`], for a model of another robot or one whose joint limits the arm already exceeds: in shadow mode only.
    ///
    /// # Errors
    /// See [`RequestError`]; a refusal is an answer, not an error.
    pub fn reload_other_robot(
        &mut self,
        path: Option<&Path>,
        limit: Duration,
    ) -> Result<Response, RequestError> {
        self.request(Request { other_robot: 1, ..reload(path)? }, limit)
    }

    fn request(&mut self, request: Request, limit: Duration) -> Result<Response, RequestError> {
        self.request_sender.request(self.link.ports_for_sending()?, request, limit)
    }
}

requests!(Monitor);
