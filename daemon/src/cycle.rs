//! The real-time cycle: receives a commanded joint target, computes and publishes its correction.
//!
//! A commanded joint target is received, validated, corrected by the model, limited, sent, and counted, in this order. Thread `cycle`, at the rate of the commands.
//! Nothing here allocates (the transport's one block per message aside), locks, logs or panics.

use crate::exchange::{CycleRecord, Exchange, LoadedModel, count};
use crate::robot::{Link, Ports, Robot};
use crate::sensor_inputs::SensorInputs;
use crate::tool_motion::PathPoint;
use crate::translate;
use corrector::{Corrector, CycleInputs, Outcome, Status};
use glam::DVec3;
use physics::{Chain, JOINTS_MAX, Joints};
use shm_schema::{Command, Corrected};
use std::sync::atomic::Ordering::Relaxed;

/// Interval at which requests of the supervisor are taken while no command arrives, ns.
const REQUESTS_EVERY_NS: u64 = 20_000_000;
/// Largest number of measured points taken in one cycle; the remaining ones are taken in the next.
const MEASURED_PER_CYCLE_MAX: usize = 64;

/// State of the cycle.
#[derive(Debug)]
pub struct Cycle<L = Ports> {
    /// Connection to the robot.
    pub robot: Robot<L>,
    /// The corrector.
    pub corrector: Corrector,
    /// The active model.
    pub model: Box<LoadedModel>,
    /// Sensor inputs.
    pub sensor_inputs: SensorInputs,
    /// Time without a command after which they count as stale, ns.
    pub stale_ns: u64,
    /// Expected time between commands, ns.
    pub period_ns: u64,
    /// Time is that of the commands (a replay).
    pub lockstep: bool,
}

impl<L: Link> Cycle<L> {
    /// Runs until the exchange is stopped.
    pub fn run(&mut self, exchange: &Exchange) {
        if let Some(instrument) = &self.sensor_inputs.instrument {
            instrument.publish(&exchange.counters.trim);
        }
        if let Some(feed) = &self.sensor_inputs.feed {
            feed.publish(&exchange.counters.feed, self.corrector.is_correcting());
        }
        if let Some(lead) = &self.sensor_inputs.lead {
            lead.publish_initial(self.model.filter.as_deref(), &exchange.counters.lead);
        }
        // Silence is counted once, when it begins.
        let mut stale_from_ns = None;
        while exchange.is_running() {
            count(&exchange.counters.iterations);
            self.take_requests(exchange);
            if let Some(received_ns) = self.step(exchange) {
                stale_from_ns = Some(received_ns + self.stale_ns).filter(|_| !self.lockstep);
            } else if stale_from_ns.is_some_and(|from_ns: u64| self.robot.link.now_ns() >= from_ns)
            {
                count(&exchange.counters.stale);
                stale_from_ns = None;
            }
        }
    }

    /// One cycle: command in, correction by the model, limited, sent. Returns the time at which the command was received; `None` if none arrived
    /// within the waiting time.
    fn step(&mut self, exchange: &Exchange) -> Option<u64> {
        let deadline_ns = self.robot.link.now_ns() + REQUESTS_EVERY_NS;
        let (command, received_ns) = self.robot.newest_command(exchange, deadline_ns)?;
        let now_ns = if self.lockstep { command.t_ns } else { received_ns };
        let state = self.robot.newest_state();
        let mut inputs =
            self.sensor_inputs.cycle_inputs(exchange, state.as_ref(), &command, now_ns);
        inputs.trim_m = self.trim_m(exchange, now_ns);
        inputs.lead = self.lead(exchange, &command);
        let target = translate::command(&command, now_ns, self.lockstep);

        let requested = self.corrector.correct(&self.model.physics, &target, &inputs, now_ns);
        let limited = self.corrector.limit(&self.model.physics, &requested);
        let feed_override = self.feed_override(&command, &inputs, &limited, now_ns);
        self.publish(exchange, &command, received_ns, &limited, feed_override);
        self.corrector.prepare(&self.model.physics);
        self.prepare_feed(exchange);
        self.store_prediction(exchange, now_ns, &limited);
        Some(received_ns)
    }

    /// Passes new measurements of the instrument to the trim; returns the displacement of the tool by
    /// the trim, base frame, m.
    fn trim_m(&mut self, exchange: &Exchange, now_ns: u64) -> DVec3 {
        let Some(instrument) = &mut self.sensor_inputs.instrument else { return DVec3::ZERO };
        instrument.begin_cycle();
        for _ in 0..MEASURED_PER_CYCLE_MAX {
            let Some(point) = self.robot.next_measured(exchange) else { break };
            instrument.add_point(&point, now_ns);
        }
        instrument.trim_m(now_ns, self.corrector.is_correcting())
    }

    /// Returns what is added to the command to compensate delay, lags and modes, rad or m.
    fn lead(&mut self, exchange: &Exchange, command: &Command) -> Joints {
        let Some(lead) = &mut self.sensor_inputs.lead else { return [0.0; JOINTS_MAX] };
        let filter = self.model.filter.as_deref_mut();
        if self.robot.newest_horizon(exchange, lead.horizon_mut()) {
            lead.check_horizon(filter.as_deref());
        }
        lead.step(filter, command, &exchange.counters.lead)
    }

    /// Stores the tool pose predicted for the target that was sent, for comparison with later measurements.
    fn store_prediction(&mut self, exchange: &Exchange, now_ns: u64, outcome: &Outcome) {
        let Some(instrument) = &mut self.sensor_inputs.instrument else { return };
        let accepted = outcome.status != Status::Rejected;
        let tool = accepted
            .then(|| self.corrector.tool_pose_with(&self.model.physics, &outcome.correction))
            .flatten();
        instrument.store_prediction(now_ns, tool.as_ref(), &exchange.counters.trim);
    }

    /// The feed override that keeps the force under its limit; 1 is the programmed feed.
    fn feed_override(
        &mut self,
        command: &Command,
        inputs: &CycleInputs,
        outcome: &Outcome,
        now_ns: u64,
    ) -> f64 {
        let Some(feed) = &mut self.sensor_inputs.feed else { return 1.0 };
        let accepted = outcome.status != Status::Rejected;
        let tool = accepted.then(|| Chain::tool_at(&self.model.physics.arm, &command.q).origin);
        feed.step(inputs, command, tool, now_ns, self.corrector.is_correcting())
    }

    /// Prepares the feed of later cycles.
    fn prepare_feed(&mut self, exchange: &Exchange) {
        if let Some(feed) = &mut self.sensor_inputs.feed {
            feed.prepare(&self.corrector, &self.model.physics);
            feed.publish(&exchange.counters.feed, self.corrector.is_correcting());
        }
    }

    fn publish(
        &mut self,
        exchange: &Exchange,
        command: &Command,
        received_ns: u64,
        outcome: &Outcome,
        feed_override: f64,
    ) {
        let mut message = Corrected {
            command_seq: command.seq,
            command_session: command.session,
            t_ns: command.t_ns,
            received_ns,
            model_epoch: self.model.epoch,
            feed_override,
            ..translate::corrected(outcome, self.model.physics.arm.count())
        };
        self.robot.publish(exchange, &mut message);
        self.count(exchange, command, &message, outcome);
    }

    fn count(
        &self,
        exchange: &Exchange,
        command: &Command,
        message: &Corrected,
        outcome: &Outcome,
    ) {
        let counters = &exchange.counters;
        count(&counters.cycles);
        counters.count_reason(message.reason);
        match outcome.status {
            Status::Rejected => count(&counters.rejected),
            Status::Held => count(&counters.held),
            _ => {}
        }
        let latency_ns = message.made_ns.saturating_sub(command.sent_ns);
        // The time stamp of a rejected command may be wrong: it gives no latency.
        if outcome.status != Status::Rejected {
            exchange.latency.record(latency_ns);
            if latency_ns > self.period_ns && !self.lockstep {
                count(&counters.missed_cycles);
            }
        }
        if outcome.status != Status::Rejected {
            let (session, t_ns, q) = (command.session, command.t_ns, command.q);
            // If the ring is full, the supervisor misses this point.
            let _ = exchange.path.push(PathPoint { session, t_ns, q });
        }
        counters.gate.store(message.wrench_gate, Relaxed);
        counters.loop_gain_bits.store(outcome.loop_gain.to_bits(), Relaxed);
        counters.model_epoch.store(message.model_epoch, Relaxed);
        let joints = self.model.physics.arm.count();
        counters.store_command(&command.q[..joints], &message.correction[..joints]);
        let status_and_reason = u64::from(message.status) << 32 | u64::from(message.reason);
        counters.last_status_and_reason.store(status_and_reason, Relaxed);
        exchange.record(|| {
            let (wrench, wrench_in_base) = self.sensor_inputs.wrench();
            let (command, corrected) = (*command, *message);
            let celsius = self.sensor_inputs.celsius();
            let instrument = self.sensor_inputs.instrument.as_ref();
            let trim = instrument.map(|instrument| instrument.record());
            CycleRecord { command, corrected, wrench, wrench_in_base, celsius, trim }
        });
    }

    /// Carries out requests of the supervisor, between two cycles.
    fn take_requests(&mut self, exchange: &Exchange) {
        if let Some(mut next) = exchange.next_model.pop() {
            if let (Some(filter), Some(before)) = (&mut next.filter, &self.model.filter) {
                filter.continue_from(before);
            }
            let old = std::mem::replace(&mut self.model, next);
            self.corrector.model_changed(&self.model.physics);
            if let Some(instrument) = &mut self.sensor_inputs.instrument {
                instrument.model_changed();
            }
            // The supervisor sends a model only while the ring has space for the replaced one.
            let _ = exchange.retired_models.push(old);
        }
        self.corrector.set_bypass(exchange.bypassed.load(Relaxed));
        self.corrector.set_mode(exchange.mode());
        if exchange.rearm_wrench.swap(false, Relaxed) {
            self.corrector.rearm_wrench();
        }
        if exchange.rearm_instrument.swap(false, Relaxed)
            && let Some(instrument) = &mut self.sensor_inputs.instrument
        {
            instrument.rearm();
        }
        if let Some(ports) = exchange.new_ports[0].pop() {
            // If the new ports are refused, the old ones stay in use, and the client sends another
            // rejoin request.
            let _ = self.robot.link.rejoin(&ports);
        }
    }
}
