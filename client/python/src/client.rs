//! The robot's loop: commands out, corrected targets in.

use std::path::PathBuf;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use trued_client::{
    Measured, ProcessState, RecorderAction, RobotState, SendError, Setpoint, WrenchFrame,
    monotonic_ns,
};

use crate::errors::{Kind, raised};
use crate::held::{Held, Numbers, Rows, joints, limit, named, rows, sides, slice};
use crate::told::{Answer, Connection, Corrected, Status, Target, Vibration};

/// A cell's one connection to its daemon.
#[pyclass(module = "trued", frozen)]
pub(crate) struct Client {
    held: Held<trued_client::Client>,
}

#[pymethods]
impl Client {
    #[new]
    #[pyo3(signature = (cell, timeout = 2.0, *, runtime_dir = None))]
    fn new(py: Python<'_>, cell: &str, timeout: f64, runtime_dir: Option<&str>) -> PyResult<Self> {
        let connect = trued_client::Client::connect_to;
        Ok(Self { held: Held::connect(py, cell, timeout, runtime_dir, connect)? })
    }

    /// How old an answer may be for `target_for`, s.
    fn set_fresh(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let fresh = limit(seconds)?;
        self.held.with(py, |client| client.set_fresh(fresh))
    }

    /// Begins another run: nothing of the path so far is remembered.
    fn start_anew(&self, py: Python<'_>) -> PyResult<()> {
        self.held.with(py, trued_client::Client::start_anew)
    }

    /// Starts a new run. The robot is at its command plus this correction, rad or m; without one, at its command: its program was restarted.
    #[pyo3(signature = (correction = None))]
    fn start_from(&self, py: Python<'_>, correction: Option<Vec<f64>>) -> PyResult<()> {
        self.held.with(py, |client| client.start_from(&correction.unwrap_or_default()))
    }

    /// Sends a commanded target; tells its number. Waits for nothing.
    #[pyo3(signature = (q, *, t_ns = 0, wrench = None, wrench_in_base = false, ambient_c = None, joints_c = None, direction = None, settled = false))]
    #[expect(clippy::too_many_arguments, reason = "keywords, in Python")]
    fn send(
        &self,
        py: Python<'_>,
        q: Numbers<'_>,
        t_ns: u64,
        wrench: Option<[f64; 6]>,
        wrench_in_base: bool,
        ambient_c: Option<f64>,
        joints_c: Option<Numbers<'_>>,
        direction: Option<Vec<i64>>,
        settled: bool,
    ) -> PyResult<u64> {
        let mut setpoint = Setpoint::new(joints("q", &q)?).at_ns(t_ns);
        if let Some(wrench) = wrench {
            let frame = if wrench_in_base { WrenchFrame::Base } else { WrenchFrame::Tool };
            setpoint = setpoint.wrench(wrench, frame);
        }
        if ambient_c.is_some() || joints_c.is_some() {
            let of_joints = joints_c.as_ref().map_or(Ok(&[][..]), |all| slice("joints_c", all))?;
            setpoint = setpoint.temperatures(ambient_c.unwrap_or(f64::NAN), of_joints);
        }
        if let Some(direction) = direction {
            setpoint = setpoint.direction(&sides(&direction));
        }
        if settled {
            setpoint = setpoint.settled();
        }
        self.held.with(py, |client| client.send(&setpoint))?.map_err(|e| e.raise(py))
    }

    /// Sends the measured state of the robot.
    #[pyo3(signature = (q = None, *, tau = None, ambient_c = None, t_ns = 0))]
    fn send_state(
        &self,
        py: Python<'_>,
        q: Option<Numbers<'_>>,
        tau: Option<Numbers<'_>>,
        ambient_c: Option<f64>,
        t_ns: u64,
    ) -> PyResult<()> {
        let mut state = RobotState {
            t_ns: if t_ns == 0 { monotonic_ns() } else { t_ns },
            ..RobotState::default()
        };
        if let Some(q) = &q {
            let q = joints("q", q)?;
            state.q_measured[..q.len()].copy_from_slice(q);
            (state.joints, state.flags) = (q.len() as u32, RobotState::HAS_Q);
        }
        if let Some(tau) = &tau {
            let tau = joints("tau", tau)?;
            state.tau[..tau.len()].copy_from_slice(tau);
            (state.joints, state.flags) =
                (state.joints.max(tau.len() as u32), state.flags | RobotState::HAS_TAU);
        }
        if let Some(ambient_c) = ambient_c {
            state.temperature_c = [f64::NAN; trued_client::JOINTS_MAX + 1];
            state.temperature_c[0] = ambient_c;
            state.flags |= RobotState::HAS_TEMPERATURE;
        }
        self.held.with(py, |client| client.send_state(&state))?.map_err(|e| e.raise(py))
    }

    /// Sends the setpoints that follow the next command, one row per setpoint, one command period apart; tells how many were sent. Waits for nothing.
    fn set_horizon(&self, py: Python<'_>, points: Rows<'_>) -> PyResult<usize> {
        let (points, joints) = rows("points", &points)?;
        let sent = self.held.with(py, |client| client.set_horizon_flat(&points, joints))?;
        sent.map_err(|e| e.raise(py))
    }

    /// What to send to the robot for `q_cmd`, whatever has become of the daemon. Waits for nothing; a command that is not a number is a ValueError.
    #[pyo3(signature = (q_cmd, now_ns = None))]
    fn target_for(
        &self,
        py: Python<'_>,
        q_cmd: Numbers<'_>,
        now_ns: Option<u64>,
    ) -> PyResult<Target> {
        let q_cmd = joints("q_cmd", &q_cmd)?;
        let now_ns = now_ns.unwrap_or_else(monotonic_ns);
        let found = self.held.with(py, |client| client.target_for(q_cmd, now_ns))?;
        Ok(Target::new(py, &found.map_err(|e| e.raise(py))?))
    }

    /// Sends and waits for the answer within the limit; answers like `target_for` in any case.
    fn exchange(&self, py: Python<'_>, q_cmd: Numbers<'_>, timeout: f64) -> PyResult<Target> {
        let (q_cmd, limit) = (joints("q_cmd", &q_cmd)?.to_vec(), limit(timeout)?);
        let found = self.held.wait(py, |client| client.exchange(&q_cmd, limit))?;
        Ok(Target::new(py, &found.map_err(|e| e.raise(py))?))
    }

    /// What was sent to the robot last; None before the first target.
    fn last_target(&self, py: Python<'_>) -> PyResult<Option<Target>> {
        let found = self.held.with(py, |client| client.last_target())?;
        Ok(found.map(|target| Target::new(py, &target)))
    }

    /// The newest answer of this daemon, however old; None before the first.
    fn newest(&self, py: Python<'_>) -> PyResult<Option<Corrected>> {
        let found = self.held.with(py, |client| client.newest())?;
        Ok(found.map(|corrected| Corrected::new(py, &corrected)))
    }

    /// The answer to the command of that number, within the limit.
    fn wait_corrected(&self, py: Python<'_>, seq: u64, timeout: f64) -> PyResult<Corrected> {
        let limit: Duration = limit(timeout)?;
        let found = self.held.wait(py, |client| {
            client.wait_corrected(seq, limit).ok_or_else(|| client.disconnect_reason())
        })?;
        match found {
            Ok(corrected) => Ok(Corrected::new(py, &corrected)),
            Err(Some(away)) => Err(SendError::from(away).raise(py)),
            Err(None) => Err(raised(py, "TimedOut", format!("no answer within {limit:?}"))),
        }
    }

    /// The newest status; None before the first.
    fn status(&self, py: Python<'_>) -> PyResult<Option<Status>> {
        let found = self.held.with(py, |client| client.status())?;
        Ok(found.map(|status| Status::new(py, &status)))
    }

    /// The next verdict on vibration not yet taken.
    fn vibration(&self, py: Python<'_>) -> PyResult<Option<Vibration>> {
        self.held.with(py, |client| client.vibration().as_ref().map(Vibration::from))
    }

    /// State of the connection.
    fn connection(&self, py: Python<'_>) -> PyResult<Connection> {
        self.held
            .with(py, |client| Connection::new(client.connection(), client.disconnect_reason()))
    }

    /// Events of the connection, oldest first.
    fn next_event(&self, py: Python<'_>) -> PyResult<Option<Connection>> {
        self.held.with(py, |client| client.next_event().map(Connection::from))
    }

    /// Asks for a sign of life.
    #[pyo3(signature = (timeout = 1.0))]
    fn ping(&self, py: Python<'_>, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |client, limit| client.ping(limit))
    }

    /// Asks to load a model file and to swap it in; None: the one loaded now, read again.
    #[pyo3(signature = (path = None, timeout = 10.0))]
    fn reload(&self, py: Python<'_>, path: Option<PathBuf>, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |client, limit| client.reload(path.as_deref(), limit))
    }

    /// Asks to ramp the correction out, or in again.
    #[pyo3(signature = (on, timeout = 1.0))]
    fn bypass(&self, py: Python<'_>, on: bool, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |client, limit| client.bypass(on, limit))
    }

    /// Asks to go to shadow mode, or back to the configured one; where that is shadow, the answer is a refusal.
    #[pyo3(signature = (on, timeout = 1.0))]
    fn arm(&self, py: Python<'_>, on: bool, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |client, limit| client.arm(on, limit))
    }

    /// Asks to go to a mode, `shadow`, `limited` or `full`; beyond what the configuration allows, the answer is a refusal.
    #[pyo3(signature = (mode, timeout = 1.0))]
    fn mode(&self, py: Python<'_>, mode: &str, timeout: f64) -> PyResult<Answer> {
        let mode = named("mode", trued_client::Mode::ALL, trued_client::Mode::name, mode)?;
        self.held.request(py, timeout, |client, limit| client.mode(mode, limit))
    }

    /// Writes a marker with this text into the recording; refused if nothing is being recorded.
    #[pyo3(signature = (text, timeout = 1.0))]
    fn mark(&self, py: Python<'_>, text: &str, timeout: f64) -> PyResult<Answer> {
        self.held.request(py, timeout, |client, limit| client.mark(text, limit))
    }

    /// Asks the recorder to `start`, to `stop`, or to `keep` the present recording.
    #[pyo3(signature = (action, timeout = 1.0))]
    fn record(&self, py: Python<'_>, action: &str, timeout: f64) -> PyResult<Answer> {
        let action = named("action", RecorderAction::ALL, RecorderAction::name, action)?;
        self.held.request(py, timeout, |client, limit| client.record(action, limit))
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
        self.held.request(py, timeout, |client, limit| client.process_state(&process, limit))
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
        self.held.request(py, timeout, |client, limit| {
            let (joints, direction) = (&joints, &direction);
            client.measured(&Measured { joints, direction, point_m, sigma_m, ambient_c }, limit)
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
