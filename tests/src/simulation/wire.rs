//! The connection between daemon and client: time, messages in transit, and their faults.

use super::client::{Client, READ_AFTER_NS};
use super::invariant_monitor::InvariantMonitor;
use super::requests;
use crate::cell_loop::TICK_NS;
use crate::invalid_messages::{CommandSource, KINDS};
use crate::rng::TestRng;
use daemon::exchange::Exchange;
use daemon::robot::Link;
use physics::Model;
use shm_schema::{
    Command, Corrected, DaemonPorts, JointBounds, PortError, RobotState, SendOutcome,
};
use std::sync::Arc;

/// Transit time of a message without faults, ns.
const FLIGHT_NS: u64 = 2_000;
/// A process that is stopped, or a thread that is not woken, is away for up to this long, ns.
const AWAY_NS: u64 = 400_000_000;

/// When a run begins: late enough for clocks that are set back.
const START_NS: u64 = 1 << 53;

/// The wire.
pub(super) struct FaultyLink {
    /// The checks.
    pub(super) watch: InvariantMonitor,
    chance: TestRng,
    hostile: CommandSource,
    client: Client,
    exchange: Arc<Exchange>,
    models: [Model; 2],
    now_ns: u64,
    tick_due_ns: u64,
    read_due_ns: Option<u64>,
    /// Commands in transit, with the time of their arrival.
    to_daemon: Vec<(u64, Command)>,
    to_client: Vec<(u64, Corrected)>,
    /// As in shared memory: the newest wins.
    arrived: Option<Command>,
    /// Remaining ticks of this daemon, with faults and without.
    stormy: u64,
    calm: u64,
    /// This life ends with a calm.
    calms: bool,
}

impl FaultyLink {
    pub(super) fn new(seed: u64, bounds: &JointBounds) -> Self {
        let models = super::models();
        Self {
            watch: InvariantMonitor::new(bounds),
            chance: TestRng::new(seed),
            hostile: CommandSource::new(seed ^ 1),
            client: Client::new(bounds),
            exchange: Arc::new(Exchange::new(corrector::Mode::Full, false)),
            models,
            now_ns: START_NS,
            tick_due_ns: 0,
            read_due_ns: None,
            to_daemon: Vec::new(),
            to_client: Vec::new(),
            arrived: None,
            stormy: 0,
            calm: 0,
            calms: false,
        }
    }

    /// Another daemon starts, with these limits, for a number of ticks with faults and without;
    /// messages in transit do not reach it.
    pub(super) fn begin(
        &mut self,
        exchange: Arc<Exchange>,
        models: [Model; 2],
        bounds: JointBounds,
        ticks: [u64; 2],
    ) {
        self.watch.another_daemon(&bounds);
        (self.exchange, self.models) = (exchange, models);
        [self.stormy, self.calm] = ticks;
        self.calms = self.calm > 0;
        self.to_daemon.clear();
        self.to_client.clear();
        self.arrived = None;
        self.client.rejoined();
        // A status with the new daemon's limits arrives before its first answer.
        self.client.set_bounds(&bounds);
        self.watch.set_bounds(self.now_ns, &bounds);
        // The client runs alone for a while.
        let until_ns = self.now_ns + self.chance.below(AWAY_NS);
        self.pass(until_ns);
    }

    fn storms(&self) -> bool {
        self.stormy > 0
    }

    /// All that happens until then.
    fn pass(&mut self, until_ns: u64) {
        while let Some(at_ns) = self.next_event_ns().filter(|at_ns| *at_ns <= until_ns) {
            self.now_ns = self.now_ns.max(at_ns);
            self.happen();
        }
        self.now_ns = self.now_ns.max(until_ns);
    }

    fn next_event_ns(&self) -> Option<u64> {
        let arrivals = self.to_daemon.iter().map(|(at_ns, _)| *at_ns);
        arrivals.chain(self.read_due_ns).chain([self.tick_due_ns]).min()
    }

    /// What is due now.
    fn happen(&mut self) {
        let now_ns = self.now_ns;
        self.to_daemon.retain(|(at_ns, command)| {
            if *at_ns <= now_ns {
                self.arrived = Some(*command);
            }
            *at_ns > now_ns
        });
        if self.read_due_ns.is_some_and(|due_ns| due_ns <= now_ns) {
            self.read_due_ns = None;
            let (arrived, later) = self.to_client.iter().partition(|(at_ns, _)| *at_ns <= now_ns);
            let arrived: Vec<(u64, Corrected)> = arrived;
            self.to_client = later;
            let newest = arrived.last().map(|(_, answer)| *answer);
            if let Some(sent) = self.client.send(newest, now_ns) {
                self.watch.sent(now_ns, &sent, self.client.answered());
            }
        }
        if self.tick_due_ns <= now_ns {
            self.tick();
        }
    }

    /// The robot's loop commands.
    fn tick(&mut self) {
        let now_ns = self.now_ns;
        self.watch.summary.ticks += 1;
        match (self.stormy, self.calm) {
            (0, 0) => {}
            (0, _) => {
                self.calm -= 1;
                self.watch.calm(super::CALM_TICKS - self.calm);
            }
            (1, _) => {
                self.stormy = 0;
                self.client.start_anew(self.chance.next_u64());
            }
            _ => self.stormy -= 1,
        }
        self.tick_due_ns = self.tick_due_ns.max(now_ns.saturating_sub(TICK_NS)) + TICK_NS;
        self.read_due_ns = Some(now_ns + READ_AFTER_NS + self.jitter_ns());
        if self.storms() {
            self.client_trouble();
            requests::give(&mut self.chance, &self.exchange, &self.models);
        } else {
            requests::calm(&self.exchange);
        }
        if let Some(command) = self.client.command(now_ns, !self.storms()) {
            self.send(command);
        }
        requests::drain(&mut self.chance, &self.exchange, self.stormy > 0, &mut self.watch);
    }

    /// In storms of every other second reads are up to half a cycle late, each by another time.
    fn jitter_ns(&mut self) -> u64 {
        let jitters = self.storms() && (self.now_ns / 1_000_000_000).is_multiple_of(2);
        if jitters { self.chance.below(TICK_NS / 2) } else { 0 }
    }

    /// The client is late, stopped or restarted, its clock is set, or its commands go astray.
    fn client_trouble(&mut self) {
        match self.chance.below(400) {
            10 => self.client.go_astray(&mut self.chance),
            11 => {
                self.client.start_at_zero(self.chance.next_u64());
                self.watch.begins_at_zero();
            }
            0 => self.tick_due_ns += self.chance.below(AWAY_NS),
            1 => self.client.start_anew(self.chance.next_u64()),
            2 => self.client.set_clock(&mut self.chance),
            3..10 => self.tick_due_ns += self.chance.below(20 * TICK_NS),
            _ => {}
        }
    }

    /// Sends a command, normally or with a fault.
    fn send(&mut self, command: Command) {
        let arrives_ns = self.now_ns + FLIGHT_NS;
        if !self.storms() {
            self.to_daemon.push((arrives_ns, command));
            return;
        }
        let c = &mut self.chance;
        let held_up_ns = if c.below(30) == 0 { c.below(30 * TICK_NS) } else { 0 };
        match c.below(40) {
            0 => return,
            1 => self.to_daemon.push((arrives_ns + c.below(5 * TICK_NS), command)),
            2 => {
                (self.hostile.last, self.hostile.now_ns) = (command, Some(self.now_ns));
                let (bad, _, _) = self.hostile.next_invalid(c.below(KINDS));
                self.to_daemon.push((arrives_ns, bad));
                if c.below(2) == 0 {
                    return;
                }
            }
            3 => {
                let stale = self.now_ns.saturating_sub(c.below(40 * TICK_NS));
                self.to_daemon.push((arrives_ns, Command { sent_ns: stale, ..command }));
                return;
            }
            _ => {}
        }
        self.to_daemon.push((arrives_ns + held_up_ns, command));
    }
}

impl Link for FaultyLink {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_command(&mut self, deadline_ns: u64) -> Option<(Command, u64)> {
        if (self.stormy == 0 && self.calm == 0) || self.watch.summary.broken.is_some() {
            self.watch.end(&self.exchange, self.calms && self.watch.summary.broken.is_none());
            self.exchange.stop();
            return None;
        }
        if self.storms() && self.chance.below(500) == 0 {
            let until_ns = self.now_ns + self.chance.below(AWAY_NS);
            self.pass(until_ns);
        }
        while self.arrived.is_none() {
            let Some(at_ns) = self.next_event_ns().filter(|at_ns| *at_ns <= deadline_ns) else {
                self.now_ns = self.now_ns.max(deadline_ns);
                return None;
            };
            self.pass(at_ns);
        }
        let command = self.arrived.take()?;
        let received_ns = self.now_ns;
        // The correction takes its time.
        self.now_ns += 1_000 + self.chance.below(4_000);
        Some((command, received_ns))
    }

    fn take_state(&mut self) -> Option<RobotState> {
        (self.storms() && self.chance.below(100) == 0).then(|| self.hostile.any_state())
    }

    fn send(&mut self, target: &Corrected) -> SendOutcome {
        let calm = self.stormy == 0 && (1..super::CALM_TICKS / 3).contains(&self.calm);
        self.watch.published(target, calm, &self.exchange);
        let lost = self.storms() && self.chance.below(60) == 0;
        if !lost {
            let held_up = self.storms() && self.chance.below(60) == 0;
            let late_ns = if held_up { self.chance.below(30 * TICK_NS) } else { 0 };
            self.to_client.push((self.now_ns + FLIGHT_NS + late_ns, *target));
        }
        if lost { SendOutcome::Lost } else { SendOutcome::Delivered }
    }

    fn rejoin(&mut self, _: &DaemonPorts) -> Result<(), PortError> {
        Ok(())
    }
}
