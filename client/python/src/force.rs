//! Sends force samples to the vibration monitor.

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use trued_client::{ForceSamples, Samples, WrenchFrame};

use crate::errors::Kind;
use crate::held::Held;
use crate::told::Connection;

/// Sends force blocks: one source per cell.
#[pyclass(module = "trued", frozen)]
pub(crate) struct ForceSource {
    held: Held<trued_client::ForceSource>,
}

/// A block as it lies in memory, in either precision.
#[derive(FromPyObject)]
enum Block<'py> {
    Double(PyReadonlyArray2<'py, f64>),
    Single(PyReadonlyArray2<'py, f32>),
}

#[pymethods]
impl ForceSource {
    #[new]
    #[pyo3(signature = (cell, timeout = 2.0, *, runtime_dir = None))]
    fn new(py: Python<'_>, cell: &str, timeout: f64, runtime_dir: Option<&str>) -> PyResult<Self> {
        let connect = trued_client::ForceSource::connect_to;
        Ok(Self { held: Held::connect(py, cell, timeout, runtime_dir, connect)? })
    }

    /// Sends one block; what cannot be handed over is lost, counted and raised.
    #[pyo3(signature = (samples, t_ns, rate_hz, *, in_base = false))]
    fn send(
        &self,
        py: Python<'_>,
        samples: Block<'_>,
        t_ns: u64,
        rate_hz: f64,
        in_base: bool,
    ) -> PyResult<()> {
        // Column by column is contiguous too, and would mix channels and samples up.
        let crooked = || {
            PyValueError::new_err("`samples` is not C-contiguous; use numpy.ascontiguousarray()")
        };
        let (by_sample, channels) = match &samples {
            Block::Double(all) => (all.is_c_contiguous(), all.shape()[1]),
            Block::Single(all) => (all.is_c_contiguous(), all.shape()[1]),
        };
        if !by_sample {
            return Err(crooked());
        }
        let samples = match &samples {
            Block::Double(all) => Samples::F64(all.as_slice().map_err(|_| crooked())?),
            Block::Single(all) => Samples::F32(all.as_slice().map_err(|_| crooked())?),
        };
        let frame = if in_base { WrenchFrame::Base } else { WrenchFrame::Tool };
        let block = ForceSamples { t_ns, rate_hz, channels, frame, samples };
        self.held.with(py, |source| source.send(&block))?.map_err(|e| e.raise(py))
    }

    /// Blocks lost so far.
    fn lost(&self, py: Python<'_>) -> PyResult<u64> {
        self.held.with(py, |source| source.lost())
    }

    fn connection(&self, py: Python<'_>) -> PyResult<Connection> {
        self.held.with(py, |source| {
            let away = source.disconnect_reason();
            Connection::new(source.connection(), away)
        })
    }

    fn next_event(&self, py: Python<'_>) -> PyResult<Option<Connection>> {
        self.held.with(py, |source| source.next_event().map(Connection::from))
    }

    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.held.close(py)
    }

    fn __enter__(this: Py<Self>) -> Py<Self> {
        this
    }

    #[pyo3(signature = (*_raised))]
    fn __exit__(&self, py: Python<'_>, _raised: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.held.close(py)
    }
}
