//! The cycle's side of the shared memory: commands in, corrected targets out.
//!
//! Promises: numbers and times are put on every message here; what cannot be read is counted and passed over.
//! Never: an equation.

use crate::exchange::{Exchange, count};
use crate::pacer::Pacer;
use shm_schema::{
    Command, Corrected, DaemonPorts, Payload, PortError, Publisher, RobotState, SendOutcome,
    Subscriber, monotonic_ns,
};
use std::sync::atomic::Ordering::Relaxed;

/// The robot's side, as the cycle sees it.
#[derive(Debug)]
pub struct Robot {
    commands: Subscriber<Command>,
    states: Subscriber<RobotState>,
    targets: Publisher<Corrected>,
    pacer: Pacer,
    published: u64,
    last_seq: (u64, u64),
}

impl Robot {
    /// Makes the ports, in the thread that will use them.
    ///
    /// # Errors
    /// Where the transport refuses a port.
    pub fn join(ports: &DaemonPorts, pacer: Pacer) -> Result<Self, PortError> {
        Ok(Self {
            commands: ports.subscriber()?,
            states: ports.subscriber()?,
            targets: ports.publisher()?,
            pacer,
            published: 0,
            last_seq: (0, 0),
        })
    }

    /// Changes over to the ports of a new epoch.
    ///
    /// # Errors
    /// Where the transport refuses a port; the old ones then stay.
    pub fn rejoin(&mut self, ports: &DaemonPorts) -> Result<(), PortError> {
        let (commands, states, targets) =
            (ports.subscriber()?, ports.subscriber()?, ports.publisher()?);
        (self.commands, self.states, self.targets) = (commands, states, targets);
        Ok(())
    }

    /// The newest command with the time at which it was taken; none if none comes until the deadline.
    pub fn newest_command(
        &mut self,
        exchange: &Exchange,
        deadline_ns: u64,
    ) -> Option<(Command, u64)> {
        let commands = &mut self.commands;
        let (command, received_ns) = self.pacer.wait_for(deadline_ns, || commands.take_newest())?;
        exchange.counters.last_command_ns.store(received_ns, Relaxed);
        count(&exchange.counters.commands);
        if command.check().is_err() {
            count(&exchange.counters.malformed);
            return None;
        }
        let (session, seq) = self.last_seq;
        if command.session == session {
            let lost = command.seq.saturating_sub(seq).saturating_sub(1);
            exchange.counters.commands_lost.fetch_add(lost, Relaxed);
        }
        self.last_seq = (command.session, command.seq);
        Some((command, received_ns))
    }

    /// The newest measurement of the robot itself, if there is a new one.
    pub fn newest_state(&mut self) -> Option<RobotState> {
        self.states.take_newest().filter(|state| state.check().is_ok())
    }

    /// Publishes a target; `made` has everything but number and time.
    pub fn publish(&mut self, exchange: &Exchange, made: &mut Corrected) {
        self.published += 1;
        made.seq = self.published;
        made.made_ns = monotonic_ns();
        if self.targets.send(made) == SendOutcome::Lost {
            count(&exchange.counters.corrected_lost);
        }
    }
}
