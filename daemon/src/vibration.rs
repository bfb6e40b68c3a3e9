//! Listens to the force samples: verdicts out, the newest wrench to the cycle.
//!
//! Thread `vibration`, at the pace of the blocks. Promises: after [`Listener::join`] nothing is allocated but the transport's one
//! block per verdict; a block that cannot be read is counted. Never: a wait longer than `LOOK_EVERY_NS`.

use crate::exchange::{Exchange, count};
use crate::pacer::sleep_until;
use crate::senses::Measured;
use shm_schema::{Advice, DaemonPorts};
use shm_schema::{
    FORCE_CHANNELS_MAX, FORCE_SAMPLES_MAX, ForceBlock, Payload, PortError, Publisher, Subscriber,
    Verdict, VibrationClass, VibrationState, monotonic_ns,
};
use spectrum::{Block, NearestLine, Watch};
use std::sync::atomic::Ordering::Relaxed;

/// How often the thread looks for blocks, ns.
const LOOK_EVERY_NS: u64 = 500_000;

/// The vibration thread's belongings.
pub struct Listener {
    blocks: Subscriber<ForceBlock>,
    verdicts: Publisher<Verdict>,
    watch: Option<Watch>,
    interleaved: Vec<f64>,
    last: (u64, u64),
    said: u64,
}

impl Listener {
    /// Makes the ports, in the thread that will use them. Without a watch, only the wrench is passed on.
    ///
    /// # Errors
    /// Where the transport refuses a port.
    pub fn join(ports: &DaemonPorts, watch: Option<Watch>) -> Result<Self, PortError> {
        Ok(Self {
            blocks: ports.subscriber()?,
            verdicts: ports.publisher()?,
            watch,
            interleaved: vec![0.0; FORCE_CHANNELS_MAX * FORCE_SAMPLES_MAX],
            last: (0, 0),
            said: 0,
        })
    }

    /// Runs until the exchange says stop.
    pub fn run(&mut self, exchange: &Exchange) {
        while exchange.runs() {
            self.take_orders(exchange);
            while let Some(block) = self.blocks.take_next() {
                self.listen(exchange, &block);
            }
            sleep_until(monotonic_ns() + LOOK_EVERY_NS);
        }
    }

    fn take_orders(&mut self, exchange: &Exchange) {
        if let (Some(state), Some(watch)) = (exchange.process_state.pop(), &mut self.watch) {
            watch.process_state(state);
        }
        if let Some(ports) = exchange.new_ports[1].pop()
            && let (Ok(blocks), Ok(verdicts)) = (ports.subscriber(), ports.publisher())
        {
            (self.blocks, self.verdicts) = (blocks, verdicts);
        }
    }

    fn listen(&mut self, exchange: &Exchange, block: &ForceBlock) {
        if block.check().is_err() || block.rate_hz.is_nan() || block.rate_hz <= 0.0 {
            count(&exchange.counters.malformed);
            return;
        }
        count(&exchange.counters.force_blocks);
        let (session, seq) = self.last;
        if session == block.session {
            let lost = block.seq.saturating_sub(seq).saturating_sub(1);
            exchange.counters.force_gaps.fetch_add(lost, Relaxed);
        }
        self.last = (block.session, block.seq);
        exchange.newest_wrench.force_push(mean(block));
        self.watch(exchange, block);
        exchange.record_block(block);
    }

    fn watch(&mut self, exchange: &Exchange, block: &ForceBlock) {
        let (channels, samples) = (block.channels as usize, block.samples as usize);
        for channel in 0..channels {
            for (i, value) in block.channel(channel).iter().enumerate() {
                self.interleaved[i * channels + channel] = *value;
            }
        }
        let Some(watch) = &mut self.watch else { return };
        let verdicts = watch.push(&Block {
            seq: block.seq,
            t_ns: block.t_ns,
            rate_hz: block.rate_hz,
            channels,
            samples: &self.interleaved[..channels * samples],
        });
        for verdict in &verdicts {
            self.said += 1;
            let message = translated(verdict, self.said);
            self.verdicts.send(&message);
            exchange.last_verdict.force_push(message);
            let _ = exchange.verdicts.push(message);
        }
    }
}

/// The block's mean, at its middle: what the cycle takes for the wrench.
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
    Measured { wrench, in_base, t_ns: block.t_ns.saturating_add(half_ns) }
}

fn translated(verdict: &spectrum::Verdict, seq: u64) -> Verdict {
    let at = |line: Option<NearestLine>| {
        line.map_or((f64::NAN, f64::NAN), |line| (line.frequency_hz, line.distance_hz))
    };
    let (nearest_mode_hz, mode_distance_hz) = at(verdict.mode);
    let (nearest_harmonic_hz, harmonic_distance_hz) = at(verdict.harmonic);
    let (nearest_alias_hz, alias_distance_hz) = at(verdict.alias);
    let (advice, advice_rpm) = advice(&verdict.advice);
    let rivals = verdict.rivals.iter().fold(0, |bits, rival| bits | 1 << class(rival).code());
    Verdict {
        seq,
        t_ns: verdict.t_ns,
        made_ns: monotonic_ns(),
        event: u64::from(verdict.line),
        frequency_hz: verdict.frequency_hz,
        amplitude: verdict.amplitude_n,
        advice_rpm,
        growth_per_s: verdict.growth_per_s,
        nearest_mode_hz,
        mode_distance_hz,
        nearest_harmonic_hz,
        harmonic_distance_hz,
        nearest_alias_hz,
        alias_distance_hz,
        state: state(verdict.state).code(),
        class: class(verdict.class).code(),
        rivals,
        axis: verdict.axis.channel() as u32,
        suspect_alias: u32::from(verdict.suspect_alias),
        advice: advice.code(),
        ..Verdict::default()
    }
}

fn state(state: spectrum::State) -> VibrationState {
    match state {
        spectrum::State::Warn => VibrationState::Warn,
        spectrum::State::Alarm => VibrationState::Alarm,
        spectrum::State::Confirmed => VibrationState::Confirmed,
        spectrum::State::Over => VibrationState::Over,
    }
}

fn class(class: spectrum::Class) -> VibrationClass {
    match class {
        spectrum::Class::Forced => VibrationClass::Forced,
        spectrum::Class::Chatter => VibrationClass::Chatter,
        spectrum::Class::ModeCoupling => VibrationClass::ModeCoupling,
        spectrum::Class::Gear => VibrationClass::Gear,
        spectrum::Class::Structural => VibrationClass::Structural,
        spectrum::Class::Electrical => VibrationClass::Electrical,
        spectrum::Class::Unknown => VibrationClass::Unknown,
    }
}

fn advice(advice: &spectrum::Advice) -> (Advice, f64) {
    use spectrum::Advice as From;
    match *advice {
        From::None => (Advice::None, f64::NAN),
        From::MoveOffMode { spindle_rpm } => (Advice::MoveOffMode, spindle_rpm),
        From::StabilityPocket { spindle_rpm, .. } => (Advice::StabilityPocket, spindle_rpm),
        From::ChangeCut => (Advice::ChangeCut, f64::NAN),
        From::ReduceDepth => (Advice::ReduceDepth, f64::NAN),
        From::SampleFaster => (Advice::SampleFaster, f64::NAN),
        From::CheckGear { .. } => (Advice::CheckGear, f64::NAN),
        From::CheckWiring => (Advice::CheckWiring, f64::NAN),
    }
}
