//! Monitoring a cell and sending requests to its daemon, from any number of processes.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use trued_client::{Measured, ProcessState, RecorderAction};

use crate::held::{Held, Numbers, joints, limit, named, sides};
use crate::told::{Answer, Connection, Status, Vibration};

/// Looks and asks; never on the hot path.
#[pyclass(module = "trued", frozen)]
pub(crate) struct Monitor {
    held: Held<trued_client::Monitor>,
}

#[pymethods]
impl Monitor {
    #[new]
    #[pyo3(signature = (cell, timeout = 2.0, *, runtime_dir = None))]
    fn new(py: Python<'_>, cell: &str, timeout: f64, runtime_dir: Option<&str>) -> PyResult<Self> {
        let connect = trued_client::Monitor::connect_to;
        Ok(Self { held: Held::connect(py, cell, timeout, runtime_dir, connect)? })
    }

    /// The newest status; None before the first.
    fn status(&self, py: Python<'_>) -> PyResult<Option<Status>> {
        let found = self.held.with(py, |monitor| monitor.status())?;
        Ok(found.map(|status| Status::new(py, &status)))
    }

    /// The next verdict on vibration not yet taken.
    fn vibration(&self, py: Python<'_>) -> PyResult<Option<Vibration>> {
        self.held.with(py, |monitor| monitor.vibration().as_ref().map(Vibration::from))
    }

    /// State of the connection.
    fn connection(&self, py: Python<'_>) -> PyResult<Connection> {
        self.held
            .with(py, |monitor| Connection::new(monitor.connection(), monitor.disconnect_reason()))
    }

    /// Events of the connection, oldest first.
    fn next_event(&self, py: Python<'_>) -> PyResult<Option<Connection>> {
        self.held.with(py, |monitor| monitor.next_event().map(Connection::from))
    }

    /// Asks for a sign of life.
    #[pyo3(signature = (timeout = 1.0))]
    fn ping(&self, py: Python<'_>, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |monitor, limit| monitor.ping(limit))
    }

    /// Asks to load a model file and to swap it in; None: the one loaded now, read again. A model of another robot, or one whose limits the arm
    /// is already outside of, takes `other_robot` and shadow mode.
    #[pyo3(signature = (path = None, timeout = 10.0, *, other_robot = false))]
    fn reload(
        &self,
        py: Python<'_>,
        path: Option<PathBuf>,
        timeout: f64,
        other_robot: bool,
    ) -> PyResult<Answer> {
        self.held.request(py, timeout, |monitor, limit| {
            if other_robot {
                monitor.reload_other_robot(path.as_deref(), limit)
            } else {
                monitor.reload(path.as_deref(), limit)
            }
        })
    }

    /// Asks to ramp the correction out, or in again.
    #[pyo3(signature = (on, timeout = 1.0))]
    fn bypass(&self, py: Python<'_>, on: bool, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |monitor, limit| monitor.bypass(on, limit))
    }

    /// Asks to go to shadow mode, or back to the configured one; where that is shadow, the answer is a refusal.
    #[pyo3(signature = (on, timeout = 1.0))]
    fn arm(&self, py: Python<'_>, on: bool, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |monitor, limit| monitor.arm(on, limit))
    }

    /// Asks to go to a mode, `shadow`, `limited` or `full`; beyond what the configuration allows, the answer is a refusal.
    #[pyo3(signature = (mode, timeout = 1.0))]
    fn mode(&self, py: Python<'_>, mode: &str, timeout: f64) -> PyResult<Answer> {
        let mode = named("mode", trued_client::Mode::ALL, trued_client::Mode::name, mode)?;
        self.held.request(py, timeout, |monitor, limit| monitor.mode(mode, limit))
    }

    /// Writes a marker with this text into the recording; refused if nothing is being recorded.
    #[pyo3(signature = (text, timeout = 1.0))]
    fn mark(&self, py: Python<'_>, text: &str, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |monitor, limit| monitor.mark(text, limit))
    }

    /// Asks the recorder to `start`, to `stop`, or to `keep` the present recording.
    #[pyo3(signature = (action, timeout = 1.0))]
    fn record(&self, py: Python<'_>, action: &str, timeout: f64) -> PyResult<Answer> {
        let action = named("action", RecorderAction::ALL, RecorderAction::name, action)?;
        self.held.request(py, timeout, |monitor, limit| monitor.record(action, limit))
    }

    /// Reports the state of the process, replacing the previous one.
    #[pyo3(signature = (*, spindle_rpm = f64::NAN, teeth = 0, feed_mm_s = f64::NAN, in_cut = None, holds_for = None, timeout = 1.0))]
    #[expect(clippy::too_many_arguments, reason = "keywords, in Python")]
    fn process_state(
        &self,
        py: Python<'_>,
        spindle_rpm: f64,
        teeth: u32,
        feed_mm_s: f64,
        in_cut: Option<bool>,
        holds_for: Option<f64>,
        timeout: f64,
    ) -> PyResult<Answer> {
        let holds_for = holds_for.map(limit).transpose()?;
        let process = ProcessState { spindle_rpm, teeth, feed_mm_s, in_cut, holds_for };
        self.held.request(py, timeout, |monitor, limit| monitor.process_state(&process, limit))
    }

    /// Reports a measurement of the tool; the answer says whether the model still holds.
    #[pyo3(signature = (q, point_m, sigma_m, *, direction = Vec::new(), ambient_c = f64::NAN, timeout = 1.0))]
    #[expect(clippy::too_many_arguments, reason = "keywords, in Python")]
    fn measured(
        &self,
        py: Python<'_>,
        q: Numbers<'_>,
        point_m: [f64; 3],
        sigma_m: f64,
        direction: Vec<i64>,
        ambient_c: f64,
        timeout: f64,
    ) -> PyResult<Answer> {
        let (joints, direction) = (joints("q", &q)?.to_vec(), sides(&direction));
        self.held.request(py, timeout, |monitor, limit| {
            let (joints, direction) = (&joints, &direction);
            monitor.measured(&Measured { joints, direction, point_m, sigma_m, ambient_c }, limit)
        })
    }

    /// Leaves the daemon, within about a second; once more is no error.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.held.close(py)
    }

    fn __enter__(this: Py<Self>) -> Py<Self> {
        this
    }

    #[pyo3(signature = (*_raised))]
    fn __exit__(&self, py: Python<'_>, _raised: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.held.close(py)
    }
}
