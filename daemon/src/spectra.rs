//! Force spectra for displays (`/spectrum`), while they are read.
//!
//! Part of the thread `vibration`. Verdicts do not use them; without a reader each block costs one check of the number of readers.

use shm_schema::{DaemonPorts, PortError, Publisher, SendOutcome, Spectrum, monotonic_ns};
use spectrum::{Block, DisplaySpectrum};

/// Least time between two spectra, ns.
const EVERY_NS: u64 = 100_000_000;

/// Publishes spectra.
pub(crate) struct Spectra {
    port: Publisher<Spectrum>,
    /// `None`: the cell has no force stream of a known rate.
    overview: Option<Box<DisplaySpectrum>>,
    message: Box<Spectrum>,
    due_ns: u64,
}

impl Spectra {
    /// Creates the port, in the thread that will use it.
    pub(crate) fn join(
        ports: &DaemonPorts,
        overview: Option<Box<DisplaySpectrum>>,
    ) -> Result<Self, PortError> {
        let bins = overview.as_ref().map(|overview| overview.bins());
        let message = bins.map_or_else(Spectrum::default, |bins| Spectrum {
            window_s: bins.window_s,
            first_hz: bins.first_hz,
            bin_hz: bins.bin_hz,
            bins: bins.count as u32,
            ..Spectrum::default()
        });
        Ok(Self { port: ports.publisher()?, overview, message: Box::new(message), due_ns: 0 })
    }

    /// Continues on the ports of another epoch.
    pub(crate) fn rejoin(&mut self, port: Publisher<Spectrum>) {
        self.port = port;
    }

    /// Number of spectra sent.
    pub(crate) fn sent(&self) -> u64 {
        self.message.seq
    }

    /// Takes a block that the sensor's checks have accepted.
    pub(crate) fn push_block(&mut self, block: &Block<'_>) {
        let Some(overview) = &mut self.overview else { return };
        if self.port.has_reader() {
            overview.push(block);
        } else {
            overview.clear();
        }
    }

    /// Sends a spectrum if one is due and there are new samples since the previous one.
    pub(crate) fn send_if_due(&mut self, now_ns: u64) {
        let Some(overview) = &mut self.overview else { return };
        if now_ns < self.due_ns || overview.end_ns() == self.message.t_ns {
            return;
        }
        if !overview.amplitudes(&mut self.message.amplitude_n) {
            return;
        }
        self.due_ns = now_ns.saturating_add(EVERY_NS);
        self.message.t_ns = overview.end_ns();
        self.message.made_ns = monotonic_ns();
        self.message.seq += 1;
        // The last reader may have disconnected since: then it is not counted.
        if self.port.send(&self.message) == SendOutcome::NoReader {
            self.message.seq -= 1;
        }
    }
}
