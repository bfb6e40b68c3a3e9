//! Forwards the controller's measured force to the vibration monitor.
//!
//! It never waits; if another force source is connected to the cell, no force is sent, which is
//! reported once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};

use recording::series::CoordinateFrame;
use trued_client::{ForceSamples, ForceSource, Samples, WrenchFrame};

use crate::counts::{Count, Counts};
use crate::daemon_link::{LinkEvent, retry_connect};

/// Samples per block: 16 ms.
const BLOCK_SAMPLES: usize = 4;
const CHANNELS: usize = 6;

/// Connection to the vibration monitor.
pub struct ForceForwarder {
    source: Option<ForceSource>,
    joined: Receiver<ForceSource>,
    stop: Arc<AtomicBool>,
    frame: WrenchFrame,
    rate_hz: f64,
    block: [f64; BLOCK_SAMPLES * CHANNELS],
    filled: usize,
    first_ns: u64,
}

impl ForceForwarder {
    /// Starts joining in a thread; `rate_hz` is the controller's, `frame` the axes of the force.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        cell: &str,
        rate_hz: f64,
        frame: CoordinateFrame,
        events: Sender<LinkEvent>,
    ) -> std::io::Result<Self> {
        let (tell, joined) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let (cell, until) = (cell.to_owned(), Arc::clone(&stop));
        std::thread::Builder::new().name("trued-force".to_owned()).spawn(move || {
            let found =
                retry_connect(|within| ForceSource::connect(&cell, within), &events, &until);
            if let Some(source) = found {
                // The receiver is gone if the bridge has ended.
                let _ = tell.send(source);
            }
        })?;
        let frame = match frame {
            CoordinateFrame::Tool => WrenchFrame::Tool,
            CoordinateFrame::Base => WrenchFrame::Base,
        };
        let block = [0.0; BLOCK_SAMPLES * CHANNELS];
        Ok(Self { source: None, joined, stop, frame, rate_hz, block, filled: 0, first_ns: 0 })
    }

    /// Adds a sample received at `now_ns`; if samples were lost before it, the earlier ones are
    /// sent first.
    pub fn add_sample(
        &mut self,
        wrench: &[f64; CHANNELS],
        lost: u32,
        now_ns: u64,
        counts: &Counts,
    ) {
        if lost > 0 {
            self.send(counts);
        }
        if self.filled == 0 {
            self.first_ns = now_ns;
        }
        let start = self.filled * CHANNELS;
        if let Some(place) = self.block.get_mut(start..start + CHANNELS) {
            place.copy_from_slice(wrench);
            self.filled += 1;
        }
        if self.filled == BLOCK_SAMPLES {
            self.send(counts);
        }
    }

    fn send(&mut self, counts: &Counts) {
        if self.source.is_none() {
            self.source = self.joined.try_recv().ok();
        }
        let samples = std::mem::take(&mut self.filled);
        let Some(source) = self.source.as_mut().filter(|_| samples > 0) else { return };
        let sent = source.send(&ForceSamples {
            t_ns: self.first_ns,
            rate_hz: self.rate_hz,
            channels: CHANNELS,
            frame: self.frame,
            samples: Samples::F64(&self.block[..samples * CHANNELS]),
        });
        counts.add(if sent.is_ok() { Count::Forces } else { Count::ForcesLost }, samples as u64);
    }
}

impl Drop for ForceForwarder {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
    }
}
