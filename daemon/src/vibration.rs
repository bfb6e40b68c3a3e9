//! The force processor: analyses force samples, publishes verdicts and spectra, passes the newest wrench to the cycle and the sensor status to the supervisor.
//!
//! Thread `vibration`, at the rate of the blocks. After [`VibrationThread::join`] nothing is allocated
//! except the transport's one block per message; an unreadable block is counted and reported. While
//! blocks arrive, it waits at most `LOOK_EVERY_NS`.

use crate::exchange::{Exchange, SensorStatus, count};
use crate::pacer::sleep_until;
use crate::sensor_inputs::Measured;
use crate::spectra::Spectra;
use crate::verdicts;
use shm_schema::{
    DaemonPorts, FORCE_CHANNELS_MAX, FORCE_SAMPLES_MAX, ForceBlock, Payload, PortError, Publisher,
    SensorFault, Subscriber, Verdict, monotonic_ns,
};
use spectrum::{Block, Health, Overview, State, Stream, Verdicts, Watch};
use std::sync::atomic::Ordering::Relaxed;

/// Polling interval of the thread, ns.
const LOOK_EVERY_NS: u64 = 500_000;
/// Polling interval if no block has arrived for [`SILENT_AFTER_NS`], ns.
const SILENT_LOOK_EVERY_NS: u64 = 5_000_000;
/// A sensor without blocks for this long counts as silent, ns.
const SILENT_AFTER_NS: u64 = 1_000_000_000;
/// Limit on blocks taken in one poll: a sender without pause must not keep the thread from its
/// orders.
const BLOCKS_PER_LOOK: usize = 64;
/// Interval of the sensor status, ns.
const STATUS_EVERY_NS: u64 = 20_000_000;

/// Processing of the force samples.
pub enum ForceProcessor {
    /// No force stream: a wrench is passed on unchanged.
    None,
    /// Sensor and stream are monitored.
    Sensor(Box<Stream>),
    /// Vibrations are monitored too.
    Watch(Box<Watch>),
}

impl ForceProcessor {
    /// Takes a block; returns whether it was valid, and new verdicts.
    fn take(&mut self, block: &Block<'_>) -> (bool, Verdicts) {
        match self {
            Self::None => (block.channels > 0 && block.rate_hz > 0.0, Verdicts::default()),
            Self::Sensor(stream) => (stream.push(block), Verdicts::default()),
            Self::Watch(watch) => {
                let before = watch.health().blocks;
                let verdicts = watch.push(block);
                (watch.health().blocks != before, verdicts)
            }
        }
    }

    fn health(&self) -> Health {
        match self {
            Self::None => Health::default(),
            Self::Sensor(stream) => stream.health(),
            Self::Watch(watch) => watch.health(),
        }
    }
}

/// How long a fault of a block's clock is reported after the last such block, ns: as long as faults
/// of the stream itself.
const CLOCK_FAULT_HELD_NS: u64 = 1_000_000_000;
/// Faults of a channel with which its samples do not measure a load. A dead channel reads zero,
/// which corrects nothing.
const NO_MEASUREMENT: [spectrum::Fault; 2] = [spectrum::Fault::Stuck, spectrum::Fault::Saturated];

/// Largest difference between the stamps of blocks and this machine's `CLOCK_MONOTONIC`.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Ahead of it, ns.
    pub ahead_ns: u64,
    /// From the last sample to the block's arrival, ns.
    pub late_ns: u64,
}

impl Clock {
    /// The fault of the stamps of a block that arrived at `now_ns`.
    fn fault(&self, t_ns: u64, length_ns: u64, now_ns: u64) -> Option<SensorFault> {
        if t_ns > now_ns.saturating_add(self.ahead_ns) {
            Some(SensorFault::InFuture)
        } else if now_ns.saturating_sub(t_ns.saturating_add(length_ns)) > self.late_ns {
            Some(SensorFault::Late)
        } else {
            None
        }
    }
}

/// Conditions under which the wrench of a block is used.
#[derive(Clone, Copy, Debug, Default)]
pub struct BlockRules {
    /// `None`: blocks carry a recording's time.
    pub clock: Option<Clock>,
    /// The wrench is used although a channel is stuck or saturated.
    pub use_faulty_channels: bool,
}

/// State of the vibration thread.
pub struct VibrationThread {
    blocks: Subscriber<ForceBlock>,
    verdicts: Publisher<Verdict>,
    spectra: Spectra,
    force_processor: ForceProcessor,
    rules: BlockRules,
    /// Recent faults of the clock, each with the time until which it is reported.
    clock_faults: [(SensorFault, u64); 2],
    interleaved: Vec<f64>,
    said: u64,
    status_due_ns: u64,
}

impl VibrationThread {
    /// Creates the ports, in the thread that will use them. Without an `overview` no spectra are published.
    ///
    /// # Errors
    /// If the transport refuses a port.
    pub fn join(
        ports: &DaemonPorts,
        force_processor: ForceProcessor,
        overview: Option<Box<Overview>>,
    ) -> Result<Self, PortError> {
        Ok(Self {
            blocks: ports.subscriber()?,
            verdicts: ports.publisher()?,
            spectra: Spectra::join(ports, overview)?,
            force_processor,
            rules: BlockRules::default(),
            clock_faults: [(SensorFault::InFuture, 0), (SensorFault::Late, 0)],
            interleaved: vec![0.0; FORCE_CHANNELS_MAX * FORCE_SAMPLES_MAX],
            said: 0,
            status_due_ns: 0,
        })
    }

    /// The same with rules for the wrench of its blocks.
    #[must_use]
    pub fn with_rules(self, rules: BlockRules) -> Self {
        Self { rules, ..self }
    }

    /// Number of spectra sent.
    #[must_use]
    pub fn spectra_sent(&self) -> u64 {
        self.spectra.sent()
    }

    /// Runs until the exchange is stopped.
    pub fn run(&mut self, exchange: &Exchange) {
        let mut heard_ns = 0;
        while exchange.runs() {
            self.take_orders(exchange);
            let mut blocks = 0;
            while blocks < BLOCKS_PER_LOOK
                && let Some(block) = self.blocks.take_next()
            {
                self.listen(exchange, &block);
                blocks += 1;
            }
            self.send_sensor_status(exchange);
            let now_ns = monotonic_ns();
            self.spectra.send_if_due(now_ns);
            heard_ns = if blocks > 0 { now_ns } else { heard_ns };
            let silent = now_ns - heard_ns > SILENT_AFTER_NS;
            if blocks < BLOCKS_PER_LOOK {
                sleep_until(now_ns + if silent { SILENT_LOOK_EVERY_NS } else { LOOK_EVERY_NS });
            }
        }
    }

    fn take_orders(&mut self, exchange: &Exchange) {
        while let Some(known) = exchange.monitor_inputs.pop() {
            if let ForceProcessor::Watch(watch) = &mut self.force_processor {
                watch.process_state(known.state);
                watch.wheels(known.wheels.into_iter().flatten());
                watch.modes(known.modes.into_iter().flatten());
            }
        }
        if let Some(ports) = exchange.new_ports[1].pop()
            && let (Ok(blocks), Ok(verdicts), Ok(spectra)) =
                (ports.subscriber(), ports.publisher(), ports.publisher())
        {
            (self.blocks, self.verdicts) = (blocks, verdicts);
            self.spectra.move_to(spectra);
        }
    }

    fn listen(&mut self, exchange: &Exchange, block: &ForceBlock) {
        let now_ns = monotonic_ns();
        exchange.counters.last_block_ns.store(now_ns, Relaxed);
        let readable = block.check().is_ok();
        if !readable {
            count(&exchange.counters.malformed);
        }
        // An unreadable block counts as one without channels, hence of the wrong shape.
        let (channels, samples) =
            if readable { (block.channels as usize, block.samples as usize) } else { (0, 0) };
        for channel in 0..channels {
            for (i, value) in block.channel(channel).iter().enumerate() {
                self.interleaved[i * channels + channel] = *value;
            }
        }
        let samples = Block {
            session: block.session,
            seq: block.seq,
            samples_before: Some(block.samples_before),
            t_ns: block.t_ns,
            rate_hz: block.rate_hz,
            channels,
            samples: &self.interleaved[..channels * samples],
        };
        let (is_good, news) = self.force_processor.take(&samples);
        if is_good {
            self.spectra.take(&samples);
        }
        self.say(exchange, &news);
        if is_good {
            count(&exchange.counters.force_blocks);
            exchange.newest_wrench.force_push(self.measured(block, now_ns));
        }
        if readable {
            exchange.record_block(block);
        }
    }

    /// The wrench of a block, and whether it may be used.
    fn measured(&mut self, block: &ForceBlock, now_ns: u64) -> Measured {
        let mut measured = mean(block);
        let Some(clock) = &self.rules.clock else { return self.judged(measured) };
        let length_ns = (1e9 * f64::from(block.samples) / block.rate_hz) as u64;
        let fault = clock.fault(block.t_ns, length_ns, now_ns);
        for (known, until_ns) in &mut self.clock_faults {
            if Some(*known) == fault {
                *until_ns = now_ns.saturating_add(CLOCK_FAULT_HELD_NS);
            }
        }
        // Whatever its clock says, it was measured before it arrived.
        measured.t_ns = measured.t_ns.min(now_ns);
        measured.faulty = fault.is_some();
        self.judged(measured)
    }

    /// The same, marked by the state of its channels.
    fn judged(&self, measured: Measured) -> Measured {
        if self.rules.use_faulty_channels {
            return measured;
        }
        let health = self.force_processor.health();
        let no_measurement =
            |faults: &spectrum::Faults| NO_MEASUREMENT.iter().any(|fault| faults.contains(*fault));
        let faulty = measured.faulty || health.channel.iter().any(no_measurement);
        Measured { faulty, ..measured }
    }

    fn say(&mut self, exchange: &Exchange, news: &Verdicts) {
        if news.is_empty() {
            return;
        }
        let health = self.force_processor.health();
        for verdict in news {
            self.said += 1;
            let message = verdicts::verdict(verdict, &health, self.said);
            self.verdicts.send(&message);
            // Rings may be full: what is lost there was published anyway.
            let _ = exchange.new_verdicts.push(message);
            let _ = exchange.verdicts.push(message);
        }
    }

    /// Reports sensor and lines to the supervisor.
    fn send_sensor_status(&mut self, exchange: &Exchange) {
        let now_ns = monotonic_ns();
        if now_ns < self.status_due_ns {
            return;
        }
        self.status_due_ns = now_ns + STATUS_EVERY_NS;
        let health = self.force_processor.health();
        exchange.counters.force_gaps.store(health.lost_blocks, Relaxed);
        exchange.counters.force_refused.store(health.refused_blocks, Relaxed);
        let line = match &self.force_processor {
            ForceProcessor::Watch(watch) => most_advanced(&watch.lines()),
            ForceProcessor::None | ForceProcessor::Sensor(_) => None,
        };
        let line = line.map(|line| verdicts::verdict(&line, &health, self.said));
        let new_verdicts = self.clock_faults.iter().filter(|(_, until_ns)| *until_ns > now_ns);
        let clock_faults = new_verdicts.fold(0, |set, (fault, _)| set | fault.bit());
        let _ = exchange.sensor_status.push(SensorStatus { health, clock_faults, line });
    }
}

/// The line in the most advanced state; of several the loudest, forces before moments.
fn most_advanced(lines: &Verdicts) -> Option<spectrum::Verdict> {
    let rank = |line: &spectrum::Verdict| (line.state, line.axis.channel() < 3);
    lines
        .iter()
        .filter(|line| line.state != State::Over)
        .max_by(|a, b| rank(a).cmp(&rank(b)).then(a.amplitude_n.total_cmp(&b.amplitude_n)))
        .copied()
}

/// The block's mean, at its middle: the wrench for the cycle.
fn mean(block: &ForceBlock) -> Measured {
    let mut wrench = [0.0; FORCE_CHANNELS_MAX];
    for (channel, mean) in wrench.iter_mut().enumerate() {
        let samples = block.channel(channel);
        if !samples.is_empty() {
            *mean = samples.iter().sum::<f64>() / samples.len() as f64;
        }
    }
    let half_ns = (0.5e9 * f64::from(block.samples) / block.rate_hz) as u64;
    let in_base = block.flags & ForceBlock::IN_BASE != 0;
    Measured { wrench, in_base, t_ns: block.t_ns.saturating_add(half_ns), faulty: false }
}
