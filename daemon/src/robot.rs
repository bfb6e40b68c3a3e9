//! The cycle's connection to the robot: commands in, corrected targets out.
//!
//! Every message gets its number and time here; unreadable messages are counted and skipped. Time
//! and messages come through a [`Link`]: shared memory, or a simulation with its own time.

use crate::exchange::{Exchange, count};
use crate::pacer::Pacer;
use shm_schema::{
    Command, Corrected, DaemonPorts, Horizon, MeasuredPoint, Payload, PortError, Publisher,
    RobotState, SendOutcome, Subscriber, monotonic_ns,
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
    /// Reads the newest horizon, if there is a new one, as [`Horizon::copy_into`] does. False for a link without horizons.
    fn take_horizon(&mut self, _into: &mut Horizon) -> bool {
        false
    }
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
    inputs: InputPorts,
    targets: Publisher<Corrected>,
    pacer: Pacer,
}

#[derive(Debug)]
struct InputPorts {
    commands: Subscriber<Command>,
    states: Subscriber<RobotState>,
    horizons: Subscriber<Horizon>,
    measured: Subscriber<MeasuredPoint>,
}

impl InputPorts {
    fn open(ports: &DaemonPorts) -> Result<Self, PortError> {
        Ok(Self {
            commands: ports.subscriber()?,
            states: ports.subscriber()?,
            horizons: ports.subscriber()?,
            measured: ports.subscriber()?,
        })
    }
}

impl Link for Ports {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn wait_command(&mut self, deadline_ns: u64) -> Option<(Command, u64)> {
        let commands = &mut self.inputs.commands;
        self.pacer.wait_for(deadline_ns, || commands.take_newest())
    }

    fn take_state(&mut self) -> Option<RobotState> {
        self.inputs.states.take_newest()
    }

    fn take_horizon(&mut self, into: &mut Horizon) -> bool {
        self.inputs.horizons.read_newest(|horizon| horizon.copy_into(into)).is_some()
    }

    fn take_measured(&mut self) -> Option<MeasuredPoint> {
        self.inputs.measured.take_next()
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        self.targets.send(target)
    }

    fn rejoin(&mut self, ports: &DaemonPorts) -> Result<(), PortError> {
        let inputs = InputPorts::open(ports)?;
        self.targets = ports.publisher()?;
        self.inputs = inputs;
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
        let inputs = InputPorts::open(ports)?;
        let targets = ports.publisher()?;
        Ok(Self::with_link(Ports { inputs, targets, pacer }))
    }
}

impl<L: Link> Robot<L> {
    /// With this link.
    pub fn with_link(link: L) -> Self {
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

    /// Reads the newest horizon, if there is a new one that can be read; otherwise `into` is unchanged, or its number of points is zero.
    pub fn newest_horizon(&mut self, exchange: &Exchange, into: &mut Horizon) -> bool {
        if !self.link.take_horizon(into) {
            return false;
        }
        let readable = into.check().is_ok();
        if !readable {
            into.count = 0;
            count(&exchange.counters.malformed);
        }
        readable
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

    /// Publishes a target; number and time are set here.
    pub fn publish(&mut self, exchange: &Exchange, made: &mut Corrected) {
        self.published += 1;
        made.seq = self.published;
        made.made_ns = self.link.now_ns();
        if self.link.send(made) == SendOutcome::Lost {
            count(&exchange.counters.corrected_lost);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exchange::Exchange;
    use corrector::Mode;

    /// A link that has these horizons, the last one first.
    struct Horizons(Vec<Horizon>);

    impl Link for Horizons {
        fn now_ns(&self) -> u64 {
            0
        }
        fn wait_command(&mut self, _: u64) -> Option<(Command, u64)> {
            None
        }
        fn take_state(&mut self) -> Option<RobotState> {
            None
        }
        fn take_horizon(&mut self, into: &mut Horizon) -> bool {
            self.0.pop().map(|horizon| horizon.copy_into(into)).is_some()
        }
        fn send(&mut self, _: &Corrected) -> SendOutcome {
            SendOutcome::NoReader
        }
        fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
            Ok(())
        }
    }

    #[test]
    fn a_horizon_that_cannot_be_read_is_counted_and_leaves_no_points() {
        let good = Horizon { seq: 1, count: 3, ..Horizon::default() };
        let mut not_finite = Horizon { seq: 2, ..good };
        not_finite.points[2][5] = f64::NAN;
        let layout = Horizon { seq: 3, layout: good.layout + 1, ..good };
        let count = Horizon { seq: 4, count: u32::MAX, ..good };
        let exchange = Exchange::new(Mode::Shadow, false);
        for (refused, bad) in [not_finite, layout, count].into_iter().enumerate() {
            let mut robot = Robot::with_link(Horizons(vec![bad, good]));
            let mut newest = Horizon::default();
            assert!(robot.newest_horizon(&exchange, &mut newest));
            assert_eq!((newest.seq, newest.points().len()), (1, 3));
            assert!(!robot.newest_horizon(&exchange, &mut newest), "{}", bad.seq);
            assert_eq!(newest.points().len(), 0);
            assert!(!robot.newest_horizon(&exchange, &mut newest), "none is left");
            assert_eq!(exchange.counters.malformed.load(Relaxed), refused as u64 + 1);
        }
    }
}
