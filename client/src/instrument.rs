//! Sends measured points of the tool to the trim. A separate object, because an instrument has its own program and rate.
//!
//! Invariant: sending never blocks; a point that cannot be sent is dropped and counted.

use std::time::Duration;

use shm_schema::{
    Cell, JoinedEpoch, MeasuredPoint, PeerPublisher, PortError, Role, monotonic_ns, new_session,
};

use crate::link::{Connection, ConnectionEvent, Link, Ports};
use crate::{ConnectError, DisconnectReason, SendError};

/// Sends measured points: one instrument per cell.
pub struct Instrument {
    link: Link<InstrumentPorts>,
    session: u64,
    seq: u64,
    lost: u64,
}

struct InstrumentPorts {
    points: PeerPublisher<MeasuredPoint>,
}

impl Ports for InstrumentPorts {
    const ROLE: Role = Role::Instrument;
    fn open(joined: &JoinedEpoch) -> Result<Self, PortError> {
        Ok(Self { points: joined.publisher()? })
    }
}

impl Instrument {
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
        Ok(Self { link: Link::connect(cell, limit)?, session: new_session(), seq: 0, lost: 0 })
    }

    /// Sends a point in the instrument's own coordinates, m, that was measured at `t_ns` of `CLOCK_MONOTONIC`. Without a time the daemon assumes the configured
    /// latency. Send nothing while there is no measurement (beam interrupted).
    ///
    /// # Errors
    /// [`SendError::Disconnected`] and [`SendError::Lost`] if it is lost.
    pub fn send(&mut self, point_m: [f64; 3], t_ns: Option<u64>) -> Result<(), SendError> {
        self.seq += 1;
        let message = MeasuredPoint {
            seq: self.seq,
            session: self.session,
            t_ns: t_ns.unwrap_or(0),
            sent_ns: monotonic_ns(),
            flags: if t_ns.is_some() { MeasuredPoint::HAS_TIME } else { 0 },
            point_m,
            ..MeasuredPoint::default()
        };
        let ports = self.link.ports_for_sending().map_err(SendError::Disconnected);
        let outcome = ports.and_then(|ports| SendError::from_outcome(ports.points.send(&message)));
        self.lost += u64::from(outcome.is_err());
        outcome
    }

    /// Points lost so far.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// State of the connection as of the last call.
    #[must_use]
    pub fn connection(&self) -> Connection {
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
}
