//! Sensor inputs of the cycle: the newest wrench, temperatures, spindle speed.
//!
//! Promises: the newest value is used; its age is always available. Never: a wait.

use crate::exchange::Exchange;
use crate::feed::CellFeed;
use crate::instrument::Instrument;
use crate::temperatures::Temperatures;
use corrector::{World, WrenchSample};
use glam::DVec3;
use physics::{JOINTS_MAX, Wrench};
use shm_schema::{Command, RobotState};
use std::sync::atomic::Ordering::Relaxed;

/// A wrench with its time.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Force N, moment Nm, at the TCP.
    pub wrench: [f64; 6],
    /// In base axes; else in tool axes.
    pub in_base: bool,
    /// When it was measured, `CLOCK_MONOTONIC`, ns.
    pub t_ns: u64,
    /// Its stream or one of its channels has a fault.
    pub faulty: bool,
}

/// Where the wrench comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrenchSource {
    /// From force blocks.
    Force,
    /// From the commands.
    Command,
    /// From nowhere.
    None,
}

/// The newest of everything.
#[derive(Debug)]
pub struct Senses {
    source: WrenchSource,
    measured: Option<Measured>,
    temperatures: Temperatures,
    /// What measures the tool, where the cell has it.
    pub instrument: Option<Box<Instrument>>,
    /// How the feed is adapted to the force, where it is.
    pub feed: Option<Box<CellFeed>>,
}

impl Senses {
    /// Nothing is known yet. Temperatures are those of the newest message, as in a recording.
    pub fn new(source: WrenchSource) -> Self {
        Self {
            source,
            measured: None,
            temperatures: Temperatures::new(None),
            instrument: None,
            feed: None,
        }
    }

    /// The same with temperatures that hold until they are older than that, ns.
    #[must_use]
    pub fn with_age_limit(self, limit_ns: u64) -> Self {
        Self { temperatures: Temperatures::new(Some(limit_ns)), ..self }
    }

    /// The same with what measures the tool, where the cell has it.
    #[must_use]
    pub fn with_instrument(self, instrument: Option<Box<Instrument>>) -> Self {
        Self { instrument, ..self }
    }

    /// The same with how the feed is adapted to the force, where it is.
    #[must_use]
    pub fn with_feed(self, feed: Option<Box<CellFeed>>) -> Self {
        Self { feed, ..self }
    }

    /// Takes what is new, and says what is known at `now_ns` (`CLOCK_MONOTONIC`, or the command's time in lockstep).
    pub fn world(
        &mut self,
        exchange: &Exchange,
        state: Option<&RobotState>,
        command: &Command,
        now_ns: u64,
    ) -> World {
        if let Some(state) = state {
            if state.has(RobotState::HAS_TEMPERATURE) {
                self.temperatures.take(&state.temperature_c, now_ns);
            }
            if state.has(RobotState::HAS_Q) {
                let joints = (state.joints as usize).min(JOINTS_MAX);
                exchange.positions.measured.tell(&state.q_measured[..joints], now_ns);
            }
        }
        if command.has(Command::HAS_TEMPERATURE) {
            self.temperatures.take(&command.temperature_c, now_ns);
        }
        exchange.positions.commanded.tell(command.joints(), now_ns);
        self.take_wrench(exchange, command, now_ns);
        let celsius = *self.temperatures.known(now_ns);
        exchange.counters.stale_temperatures.store(self.temperatures.stale(), Relaxed);
        let mut joint_celsius = [f64::NAN; JOINTS_MAX];
        joint_celsius.copy_from_slice(&celsius[1..]);
        World {
            wrench: self.measured.map(|measured| sample(&measured, now_ns)),
            ambient_celsius: celsius[0],
            joint_celsius,
            spindle_rpm: f64::from_bits(exchange.spindle_rpm_bits.load(Relaxed)),
            ..World::default()
        }
    }

    /// The wrench as it enters the cycle; NaN where none is known.
    pub fn wrench(&self) -> ([f64; 6], bool) {
        self.measured.map_or(([f64::NAN; 6], false), |m| (m.wrench, m.in_base))
    }

    /// The temperatures as they entered the cycle, ambient and then one per joint, °C; NaN where unknown.
    pub fn celsius(&self) -> [f64; JOINTS_MAX + 1] {
        self.temperatures.newest()
    }

    fn take_wrench(&mut self, exchange: &Exchange, command: &Command, now_ns: u64) {
        match self.source {
            WrenchSource::Force => {
                if let Some(newest) = exchange.newest_wrench.pop() {
                    self.measured = Some(newest);
                }
            }
            WrenchSource::Command if command.has(Command::HAS_WRENCH) => {
                let in_base = command.has(Command::WRENCH_IN_BASE);
                self.measured =
                    Some(Measured { wrench: command.wrench, in_base, t_ns: now_ns, faulty: false });
            }
            WrenchSource::Command | WrenchSource::None => {}
        }
    }
}

fn sample(measured: &Measured, now_ns: u64) -> WrenchSample {
    let [fx, fy, fz, mx, my, mz] = measured.wrench;
    WrenchSample {
        wrench: Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) },
        in_base: measured.in_base,
        age_ns: now_ns.saturating_sub(measured.t_ns),
        faulty: measured.faulty,
    }
}
