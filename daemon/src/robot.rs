//! The cycle's connection to the robot: commands in, corrected targets out.
//!
//! Every message gets its number and time here; unreadable messages are counted and skipped. Time
//! and messages come through a [`Link`]: shared memory, or a simulation with its own time.

use crate::exchange::{Exchange, count};
use crate::pacer::Pacer;
use shm_schema::{
    Command, Corrected, DaemonPorts, MeasuredPoint, Payload, PortError, Publisher, RobotState,
    SendOutcome, Subscriber, monotonic_ns,
};
use std::sync::atomic::Ordering::Relaxed;

/// Source and destination of messages, and the clock that they use.
pub trait Link {
    /// `CLOCK_MONOTONIC`, or its simulated equivalent, ns.
    fn now_ns(&self) -> u64;
    /// The newest command with the time at which it was found; `None` if none arrives until the
    /// deadline.
    fn wait_command(&mut self, deadline_ns: u64) -> Option<(Command, u64)>;
    /// The newest measurement of the robot itself, if there is a new one.
    fn take_state(&mut self) -> Option<RobotState>;
    /// The oldest measured point of the tool not yet taken; `None` for a link without an
    /// instrument.
    fn take_measured(&mut self) -> Option<MeasuredPoint> {
        None
    }
    /// Sends a target.
    fn send(&mut self, target: &Corrected) -> SendOutcome;
    /// Switches to the ports of a new epoch.
    ///
    /// # Errors
    /// If the transport refuses a port; the old ones then stay.
    fn rejoin(&mut self, ports: &DaemonPorts) -> Result<(), PortError>;
}

/// Shared memory.
#[derive(Debug)]
pub struct Ports {
    commands: Subscriber<Command>,
    states: Subscriber<RobotState>,
    measured: Subscriber<MeasuredPoint>,
    targets: Publisher<Corrected>,
    pacer: Pacer,
}

impl Link for Ports {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn wait_command(&mut self, deadline_ns: u64) -> Option<(Command, u64)> {
        let commands = &mut self.commands;
        self.pacer.wait_for(deadline_ns, || commands.take_newest())
    }

    fn take_state(&mut self) -> Option<RobotState> {
        self.states.take_newest()
    }

    fn take_measured(&mut self) -> Option<MeasuredPoint> {
        self.measured.take_next()
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        self.targets.send(target)
    }

    fn rejoin(&mut self, ports: &DaemonPorts) -> Result<(), PortError> {
        let (commands, states, measured) =
            (ports.subscriber()?, ports.subscriber()?, ports.subscriber()?);
        self.targets = ports.publisher()?;
        (self.commands, self.states, self.measured) = (commands, states, measured);
        Ok(())
    }
}

/// The robot, as seen by the cycle.
#[derive(Debug)]
pub struct Robot<L = Ports> {
    /// The link to it.
    pub link: L,
    published: u64,
    last_seq: (u64, u64),
}

impl Robot {
    /// Creates the ports, in the thread that will use them.
    ///
    /// # Errors
    /// If the transport refuses a port.
    pub fn join(ports: &DaemonPorts, pacer: Pacer) -> Result<Self, PortError> {
        let (commands, states, measured) =
            (ports.subscriber()?, ports.subscriber()?, ports.subscriber()?);
        let targets = ports.publisher()?;
        Ok(Self::over(Ports { commands, states, measured, targets, pacer }))
    }
}

impl<L: Link> Robot<L> {
    /// With this link.
    pub fn over(link: L) -> Self {
        Self { link, published: 0, last_seq: (0, 0) }
    }

    /// The newest command with the time at which it was taken; `None` if none arrives until the
    /// deadline.
    pub fn newest_command(
        &mut self,
        exchange: &Exchange,
        deadline_ns: u64,
    ) -> Option<(Command, u64)> {
        let (command, received_ns) = self.link.wait_command(deadline_ns)?;
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
        self.link.take_state().filter(|state| state.check().is_ok())
    }

    /// The oldest measured point of the tool not yet taken.
    pub fn next_measured(&mut self, exchange: &Exchange) -> Option<MeasuredPoint> {
        while let Some(point) = self.link.take_measured() {
            if point.check().is_ok() {
                return Some(point);
            }
            count(&exchange.counters.malformed);
        }
        None
    }

    /// Publishes a target; `made` has everything but number and time.
    pub fn publish(&mut self, exchange: &Exchange, made: &mut Corrected) {
        self.published += 1;
        made.seq = self.published;
        made.made_ns = self.link.now_ns();
        if self.link.send(made) == SendOutcome::Lost {
            count(&exchange.counters.corrected_lost);
        }
    }
}
