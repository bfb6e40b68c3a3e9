//! The force processor: analyses force samples, publishes verdicts and spectra, passes the newest wrench to the cycle and the sensor status to the supervisor.
//!
//! Thread `vibration`, at the rate of the blocks. After [`VibrationThread::join`] nothing is allocated
//! except the transport's one block per message; an unreadable block is counted and reported. While
//! blocks arrive, it waits at most `LOOK_EVERY_NS`.

use crate::exchange::{Exchange, SensorStatus, count};
use crate::pacer::sleep_until;
use crate::sensor_inputs::MeasuredWrench;
use crate::spectra::Spectra;
use crate::verdicts;
use shm_schema::{
    DaemonPorts, FORCE_CHANNELS_MAX, FORCE_SAMPLES_MAX, ForceBlock, Payload, PortError, Publisher,
    SensorFault, Subscriber, Verdict, monotonic_ns,
};
use spectrum::{Block, DisplaySpectrum, Health, SensorStream, State, Verdicts, VibrationMonitor};
use std::sync::atomic::Ordering::Relaxed;

/// Polling interval of the thread, ns.
const POLL_EVERY_NS: u64 = 500_000;
/// Polling interval if no block has arrived for [`SILENT_AFTER_NS`], ns.
const SILENT_POLL_EVERY_NS: u64 = 5_000_000;
/// A sensor without blocks for this long counts as silent, ns.
const SILENT_AFTER_NS: u64 = 1_000_000_000;
/// Largest number of blocks taken in one poll: a sender without pauses must not keep the thread from
/// requests of the supervisor.
const BLOCKS_PER_POLL: usize = 64;
/// Interval of the sensor status, ns.
const STATUS_EVERY_NS: u64 = 20_000_000;

/// Processing of the force samples.
pub enum ForceProcessor {
    /// No force stream: a wrench is passed on unchanged.
    None,
    /// Sensor and stream are monitored.
    Sensor(Box<SensorStream>),
    /// Vibrations are monitored too.
    Watch(Box<VibrationMonitor>),
}

impl ForceProcessor {
    /// Takes a block; returns whether it was valid, and new verdicts.
    fn push(&mut self, block: &Block<'_>) -> (bool, Verdicts) {
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
pub struct ClockTolerance {
    /// Ahead of it, ns.
    pub ahead_ns: u64,
    /// From the last sample to the block's arrival, ns.
    pub late_ns: u64,
}

impl ClockTolerance {
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
    pub clock: Option<ClockTolerance>,
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
    verdicts_sent: u64,
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
        overview: Option<Box<DisplaySpectrum>>,
    ) -> Result<Self, PortError> {
        Ok(Self {
            blocks: ports.subscriber()?,
            verdicts: ports.publisher()?,
            spectra: Spectra::join(ports, overview)?,
            force_processor,
            rules: BlockRules::default(),
            clock_faults: [(SensorFault::InFuture, 0), (SensorFault::Late, 0)],
            interleaved: vec![0.0; FORCE_CHANNELS_MAX * FORCE_SAMPLES_MAX],
            verdicts_sent: 0,
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
        while exchange.is_running() {
            self.take_requests(exchange);
            let mut blocks = 0;
            while blocks < BLOCKS_PER_POLL
                && let Some(block) = self.blocks.take_next()
            {
                self.process_block(exchange, &block);
                blocks += 1;
            }
            self.send_sensor_status(exchange);
            let now_ns = monotonic_ns();
            self.spectra.send_if_due(now_ns);
            heard_ns = if blocks > 0 { now_ns } else { heard_ns };
            let silent = now_ns - heard_ns > SILENT_AFTER_NS;
            if blocks < BLOCKS_PER_POLL {
                sleep_until(now_ns + if silent { SILENT_POLL_EVERY_NS } else { POLL_EVERY_NS });
            }
        }
    }

    fn take_requests(&mut self, exchange: &Exchange) {
        while let Some(known) = exchange.monitor_inputs.pop() {
            if let ForceProcessor::Watch(watch) = &mut self.force_processor {
                watch.set_process_state(known.state);
                watch.set_gear_frequencies(known.wheels.into_iter().flatten());
                watch.set_modes(known.modes.into_iter().flatten());
            }
        }
        if let Some(ports) = exchange.new_ports[1].pop()
            && let (Ok(blocks), Ok(verdicts), Ok(spectra)) =
                (ports.subscriber(), ports.publisher(), ports.publisher())
        {
            (self.blocks, self.verdicts) = (blocks, verdicts);
            self.spectra.rejoin(spectra);
        }
    }

    fn process_block(&mut self, exchange: &Exchange, block: &ForceBlock) {
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
        let (is_good, news) = self.force_processor.push(&samples);
        if is_good {
            self.spectra.push_block(&samples);
        }
        self.publish_verdicts(exchange, &news);
        if is_good {
            count(&exchange.counters.force_blocks);
            exchange.newest_wrench.force_push(self.wrench_of(block, now_ns));
        }
        if readable {
            exchange.record_block(block);
        }
    }

    /// The wrench of a block, and whether it may be used.
    fn wrench_of(&mut self, block: &ForceBlock, now_ns: u64) -> MeasuredWrench {
        let mut measured = mean_wrench(block);
        let Some(clock) = &self.rules.clock else { return self.with_channel_faults(measured) };
        let length_ns = (1e9 * f64::from(block.samples) / block.rate_hz) as u64;
        let fault = clock.fault(block.t_ns, length_ns, now_ns);
        for (known, until_ns) in &mut self.clock_faults {
            if Some(*known) == fault {
                *until_ns = now_ns.saturating_add(CLOCK_FAULT_HELD_NS);
            }
        }
        // A block cannot have been measured after its arrival, whatever its time stamp.
        measured.t_ns = measured.t_ns.min(now_ns);
        measured.faulty = fault.is_some();
        self.with_channel_faults(measured)
    }

    /// The same, marked as faulty if a channel has a fault.
    fn with_channel_faults(&self, measured: MeasuredWrench) -> MeasuredWrench {
        if self.rules.use_faulty_channels {
            return measured;
        }
        let health = self.force_processor.health();
        let no_measurement =
            |faults: &spectrum::Faults| NO_MEASUREMENT.iter().any(|fault| faults.contains(*fault));
        let faulty = measured.faulty || health.channel.iter().any(no_measurement);
        MeasuredWrench { faulty, ..measured }
    }

    fn publish_verdicts(&mut self, exchange: &Exchange, news: &Verdicts) {
        if news.is_empty() {
            return;
        }
        let health = self.force_processor.health();
        for verdict in news {
            self.verdicts_sent += 1;
            let message = verdicts::verdict(verdict, &health, self.verdicts_sent);
            self.verdicts.send(&message);
            // If a ring is full, the verdict is missing there; it has been published.
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
        let line = line.map(|line| verdicts::verdict(&line, &health, self.verdicts_sent));
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
fn mean_wrench(block: &ForceBlock) -> MeasuredWrench {
    let mut wrench = [0.0; FORCE_CHANNELS_MAX];
    for (channel, mean) in wrench.iter_mut().enumerate() {
        let samples = block.channel(channel);
        if !samples.is_empty() {
            *mean = samples.iter().sum::<f64>() / samples.len() as f64;
        }
    }
    let half_ns = (0.5e9 * f64::from(block.samples) / block.rate_hz) as u64;
    let in_base = block.flags & ForceBlock::IN_BASE != 0;
    MeasuredWrench { wrench, in_base, t_ns: block.t_ns.saturating_add(half_ns), faulty: false }
}
