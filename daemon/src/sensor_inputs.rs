//! Sensor inputs of the cycle: the newest wrench, temperatures, spindle speed.
//!
//! The newest value of each is used, with its age. It never waits.

use crate::exchange::Exchange;
use crate::feed::CellFeed;
use crate::instrument::Instrument;
use crate::lead::Lead;
use crate::temperatures::Temperatures;
use corrector::{CycleInputs, WrenchSample};
use glam::DVec3;
use physics::{JOINTS_MAX, Wrench};
use shm_schema::{Command, RobotState};
use std::sync::atomic::Ordering::Relaxed;

/// A wrench with its time.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredWrench {
    /// Force N, moment Nm, at the TCP.
    pub wrench: [f64; 6],
    /// In base axes; otherwise in tool axes.
    pub in_base: bool,
    /// When it was measured, `CLOCK_MONOTONIC`, ns.
    pub t_ns: u64,
    /// Whether its stream or one of its channels has a fault.
    pub faulty: bool,
}

/// Source of the wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WrenchSource {
    /// From force blocks.
    Force,
    /// From the commands.
    Command,
    /// No source.
    None,
}

/// The newest value of each input.
#[derive(Debug)]
pub struct SensorInputs {
    source: WrenchSource,
    measured: Option<MeasuredWrench>,
    temperatures: Temperatures,
    /// The instrument that measures the tool, if the cell has one.
    pub instrument: Option<Box<Instrument>>,
    /// The adaptation of the feed to the force, if configured.
    pub feed: Option<Box<CellFeed>>,
    /// The compensation of delay, lags and modes, if configured.
    pub lead: Option<Box<Lead>>,
}

impl SensorInputs {
    /// Without values yet. Temperatures are those of the newest message, as in a recording.
    pub fn new(source: WrenchSource) -> Self {
        Self {
            source,
            measured: None,
            temperatures: Temperatures::new(None),
            instrument: None,
            feed: None,
            lead: None,
        }
    }

    /// The same with an age limit for temperatures, ns.
    #[must_use]
    pub fn with_age_limit(self, limit_ns: u64) -> Self {
        Self { temperatures: Temperatures::new(Some(limit_ns)), ..self }
    }

    /// The same with an instrument, if the cell has one.
    #[must_use]
    pub fn with_instrument(self, instrument: Option<Box<Instrument>>) -> Self {
        Self { instrument, ..self }
    }

    /// The same with a feed adaptation, if configured.
    #[must_use]
    pub fn with_feed(self, feed: Option<Box<CellFeed>>) -> Self {
        Self { feed, ..self }
    }

    /// The same with a compensation of delay, lags and modes.
    #[must_use]
    pub fn with_lead(self, lead: Option<Box<Lead>>) -> Self {
        Self { lead, ..self }
    }

    /// Takes new values and returns the inputs valid at `now_ns` (`CLOCK_MONOTONIC`, or the
    /// command's time in lockstep).
    pub fn cycle_inputs(
        &mut self,
        exchange: &Exchange,
        state: Option<&RobotState>,
        command: &Command,
        now_ns: u64,
    ) -> CycleInputs {
        if let Some(state) = state {
            if state.has(RobotState::HAS_TEMPERATURE) {
                self.temperatures.update(&state.temperature_c, now_ns);
            }
            if state.has(RobotState::HAS_Q) {
                let joints = (state.joints as usize).min(JOINTS_MAX);
                exchange.positions.measured.store(&state.q_measured[..joints], now_ns);
            }
        }
        if command.has(Command::HAS_TEMPERATURE) {
            self.temperatures.update(&command.temperature_c, now_ns);
        }
        exchange.positions.commanded.store(command.joints(), now_ns);
        self.take_wrench(exchange, command, now_ns);
        let celsius = *self.temperatures.valid_at(now_ns);
        exchange.counters.stale_temperatures.store(self.temperatures.stale(), Relaxed);
        let mut joint_celsius = [f64::NAN; JOINTS_MAX];
        joint_celsius.copy_from_slice(&celsius[1..]);
        CycleInputs {
            wrench: self.measured.map(|measured| sample(&measured, now_ns)),
            ambient_celsius: celsius[0],
            joint_celsius,
            spindle_rpm: f64::from_bits(exchange.spindle_rpm_bits.load(Relaxed)),
            ..CycleInputs::default()
        }
    }

    /// The wrench used in the cycle; NaN if unknown.
    pub fn wrench(&self) -> ([f64; 6], bool) {
        self.measured.map_or(([f64::NAN; 6], false), |m| (m.wrench, m.in_base))
    }

    /// The temperatures used in the cycle, ambient and then one per joint, °C; NaN where unknown.
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
                self.measured = Some(MeasuredWrench {
                    wrench: command.wrench,
                    in_base,
                    t_ns: now_ns,
                    faulty: false,
                });
            }
            WrenchSource::Command | WrenchSource::None => {}
        }
    }
}

fn sample(measured: &MeasuredWrench, now_ns: u64) -> WrenchSample {
    let [fx, fy, fz, mx, my, mz] = measured.wrench;
    WrenchSample {
        wrench: Wrench { force: DVec3::new(fx, fy, fz), moment: DVec3::new(mx, my, mz) },
        in_base: measured.in_base,
        age_ns: now_ns.saturating_sub(measured.t_ns),
        faulty: measured.faulty,
    }
}
