//! Sends force samples to the vibration monitor. A separate object, because force is usually
//! sampled by another thread or process than the robot's control loop.
//!
//! Invariant: sending never blocks; a block that cannot be sent is dropped and counted on both sides.

use std::time::Duration;

use shm_schema::{
    Cell, FORCE_SAMPLES_MAX, ForceBlock, JoinedEpoch, PortError, Role, monotonic_ns, new_session,
};

use crate::link::{Connection, ConnectionEvent, Link, Ports};
use crate::setpoint::WrenchFrame;
use crate::{ConnectError, DisconnectReason, SendError};

/// Samples in either precision; f32 is promoted.
#[derive(Debug, Clone, Copy)]
pub enum Samples<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

/// A block of evenly spaced samples.
#[derive(Debug, Clone, Copy)]
pub struct ForceSamples<'a> {
    /// Time of the first sample, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// 3 to 6: the first of `Fx Fy Fz Mx My Mz`, N and N·m.
    pub channels: usize,
    /// Axes of the samples.
    pub frame: WrenchFrame,
    /// Sample by sample, `channels` numbers each, as a driver delivers them; at most 512 samples.
    pub samples: Samples<'a>,
}

/// Sends force blocks: one source per cell.
pub struct ForceSource {
    link: Link<ForcePorts>,
    block: Box<ForceBlock>,
    lost: u64,
}

struct ForcePorts {
    blocks: shm_schema::PeerPublisher<ForceBlock>,
}

impl Ports for ForcePorts {
    const ROLE: Role = Role::Force;
    fn open(joined: &JoinedEpoch) -> Result<Self, PortError> {
        Ok(Self { blocks: joined.publisher()? })
    }
}

impl ForceSource {
    /// Connects to the cell's daemon within `limit`.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect(cell: &str, limit: Duration) -> Result<Self, ConnectError> {
        Self::connect_to(&Cell::new(cell)?, limit)
    }

    /// The same for a cell in another directory.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn connect_to(cell: &Cell, limit: Duration) -> Result<Self, ConnectError> {
        let link = Link::connect(cell, limit)?;
        let block = Box::new(ForceBlock { session: new_session(), ..ForceBlock::default() });
        Ok(Self { link, block, lost: 0 })
    }

    /// Sends one block.
    ///
    /// # Errors
    /// [`SendError::Invalid`] if the block is invalid (nothing is counted then);
    /// [`SendError::Disconnected`] and [`SendError::Lost`] if it is lost.
    pub fn send(&mut self, force: &ForceSamples<'_>) -> Result<(), SendError> {
        let samples = self.fill(force)?;
        let ports = self.link.ports_for_sending().map_err(SendError::Disconnected);
        let outcome =
            ports.and_then(|ports| SendError::from_outcome(ports.blocks.send(&self.block)));
        self.block.samples_before += samples as u64;
        self.lost += u64::from(outcome.is_err());
        outcome
    }

    /// Blocks lost so far.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// State of the connection as of the last call.
    #[must_use]
    pub fn connection(&self) -> Connection {
        self.link.connection()
    }

    /// Why there is no connection; `None` while connected.
    pub fn disconnect_reason(&mut self) -> Option<DisconnectReason> {
        self.link.disconnect_reason()
    }

    /// Events of the connection since the last call, oldest first.
    pub fn next_event(&mut self) -> Option<ConnectionEvent> {
        self.link.next_event()
    }

    /// Fills the next block; returns its number of samples per channel.
    fn fill(&mut self, force: &ForceSamples<'_>) -> Result<usize, SendError> {
        let numbers = match force.samples {
            Samples::F32(s) => s.len(),
            Samples::F64(s) => s.len(),
        };
        let invalid = |what, value, expected| Err(SendError::Invalid { what, value, expected });
        if !(3..=6).contains(&force.channels) {
            return invalid("the number of force channels", force.channels, "3 to 6");
        }
        let samples = numbers / force.channels;
        if !numbers.is_multiple_of(force.channels) {
            return invalid("the number of force values", numbers, "a multiple of the channels");
        }
        if samples == 0 || samples > FORCE_SAMPLES_MAX {
            return invalid("the number of force samples", samples, "1 to 512");
        }
        let block = &mut *self.block;
        block.flags = if force.frame == WrenchFrame::Base { ForceBlock::IN_BASE } else { 0 };
        match force.samples {
            Samples::F32(s) => {
                block.flags |= ForceBlock::INPUT_F32;
                transpose(
                    &mut block.data,
                    s.iter().map(|v| f64::from(*v)),
                    force.channels,
                    samples,
                );
            }
            Samples::F64(s) => {
                transpose(&mut block.data, s.iter().copied(), force.channels, samples);
            }
        }
        block.seq += 1;
        block.t_ns = force.t_ns;
        block.sent_ns = monotonic_ns();
        block.rate_hz = force.rate_hz;
        block.channels = force.channels as u32;
        block.samples = samples as u32;
        Ok(samples)
    }
}

/// Transposes sample-major values to channel-major order.
fn transpose(data: &mut [f64], values: impl Iterator<Item = f64>, channels: usize, samples: usize) {
    for (i, value) in values.enumerate() {
        if let Some(place) = data.get_mut((i % channels) * samples + i / channels) {
            *place = value;
        }
    }
}
