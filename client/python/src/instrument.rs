//! Sends measured points of the tool to the trim.

use pyo3::prelude::*;

use crate::errors::Kind;
use crate::held::Held;
use crate::told::Connection;

/// Sends measured points of the tool: one instrument per cell.
#[pyclass(module = "trued", frozen)]
pub(crate) struct Instrument {
    held: Held<trued_client::Instrument>,
}

#[pymethods]
impl Instrument {
    #[new]
    #[pyo3(signature = (cell, timeout = 2.0, *, runtime_dir = None))]
    fn new(py: Python<'_>, cell: &str, timeout: f64, runtime_dir: Option<&str>) -> PyResult<Self> {
        let connect = trued_client::Instrument::connect_to;
        Ok(Self { held: Held::connect(py, cell, timeout, runtime_dir, connect)? })
    }

    /// Sends a point in the instrument's own coordinates, m; without a time the daemon takes the latency that its cell states.
    #[pyo3(signature = (point_m, t_ns = None))]
    fn send(&self, py: Python<'_>, point_m: [f64; 3], t_ns: Option<u64>) -> PyResult<()> {
        let sent = self.held.with(py, |instrument| instrument.send(point_m, t_ns))?;
        sent.map_err(|e| e.raise(py))
    }

    /// Points lost so far.
    fn lost(&self, py: Python<'_>) -> PyResult<u64> {
        self.held.with(py, |instrument| instrument.lost())
    }

    fn connection(&self, py: Python<'_>) -> PyResult<Connection> {
        self.held.with(py, |instrument| {
            let away = instrument.disconnect_reason();
            Connection::new(instrument.connection(), away)
        })
    }

    fn next_event(&self, py: Python<'_>) -> PyResult<Option<Connection>> {
        self.held.with(py, |instrument| instrument.next_event().map(Connection::from))
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
