"""The interface, with its types. SI: rad (m where a joint is prismatic), s, N, N m; other units stand in the names."""

from os import PathLike
from types import TracebackType
from typing import Final, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self

__all__ = [
    "Answer",
    "Client",
    "Connection",
    "Corrected",
    "ForceSource",
    "Instrument",
    "Monitor",
    "Status",
    "Target",
    "Vibration",
    "__version__",
    "contract",
    "monotonic_ns",
]

__version__: Final[str]

def monotonic_ns() -> int:
    """CLOCK_MONOTONIC, ns: the one clock of all times here."""

def contract() -> str:
    """The version of the library, with the contract that it shares with the daemon."""

@final
class Target:
    """A joint target, to be sent to the robot."""

    joints: Final[NDArray[np.float64]]
    source: Final[Literal["corrected", "last_correction", "ramping", "plain"]]
    feed_override: Final[float]

@final
class Corrected:
    """What the daemon answers to a command."""

    seq: Final[int]
    command_seq: Final[int]
    t_ns: Final[int]
    received_ns: Final[int]
    made_ns: Final[int]
    model_epoch: Final[int]
    status: Final[str]
    reason: Final[str]
    wrench_gate: Final[str]
    iterations: Final[int]
    correction: Final[NDArray[np.float64]]
    correction_rate: Final[NDArray[np.float64]]
    correction_acceleration: Final[NDArray[np.float64]]
    wanted: Final[NDArray[np.float64]]
    residual_m: Final[float]
    residual_rad: Final[float]
    feed_override: Final[float]

@final
class Status:
    """How the daemon is."""

    pid: Final[int]
    seq: Final[int]
    t_ns: Final[int]
    started_ns: Final[int]
    model_epoch: Final[int]
    model_hash: Final[int]
    cycles: Final[int]
    missed_cycles: Final[int]
    commands: Final[int]
    rejected: Final[int]
    held: Final[int]
    stale: Final[int]
    commands_lost: Final[int]
    corrected_lost: Final[int]
    force_blocks: Final[int]
    force_gaps: Final[int]
    force_refused: Final[int]
    malformed: Final[int]
    recorder_dropped: Final[int]
    latency_p50_ns: Final[int]
    latency_p99_ns: Final[int]
    latency_p999_ns: Final[int]
    latency_max_ns: Final[int]
    model_broken_since_ns: Final[int]
    model_measurements: Final[int]
    model_residual_m: Final[float]
    wrench_loop_gain: Final[float]
    spindle_rpm: Final[float]
    feed_mm_s: Final[float]
    health: Final[str]
    mode: Final[str]
    bypassed: Final[bool]
    joints: Final[int]
    wrench_gate: Final[str]
    recorder: Final[str]
    watch: Final[str]
    in_cut: Final[str]
    uncompensated_effects: Final[int]
    force_faults: Final[list[str]]
    q_min: Final[NDArray[np.float64]]
    q_max: Final[NDArray[np.float64]]
    correction_max: Final[NDArray[np.float64]]
    correction_rate_max: Final[NDArray[np.float64]]
    correction_jerk_max: Final[NDArray[np.float64]]
    message: Final[str]
    geometry_hash: Final[int]
    stale_temperatures: Final[int]
    robot_maker: Final[str]
    robot_type: Final[str]
    robot_serial: Final[str]
    q_command: Final[NDArray[np.float64]]
    correction: Final[NDArray[np.float64]]
    trim_state: Final[str]
    trim_reason: Final[str]
    trim_m: Final[tuple[float, float, float]]
    trim_found_m: Final[tuple[float, float, float]]
    trim_measurements: Final[int]
    trim_refused: Final[int]
    feed_state: Final[str]
    feed_reason: Final[str]
    feed_override: Final[float]
    feed_wanted: Final[float]
    feed_force_n: Final[float]
    feed_programmed_force_n: Final[float]
    feed_limit_n: Final[float]
    feed_speed_m_s: Final[float]
    feed_refused: Final[int]
    latency_sum_ns: Final[int]
    latency_counts: Final[list[int]]
    """Histogram of latencies since the start: the first entry counts those below 2**10 ns, entry n those from 2**(9 + n) to
    below 2**(10 + n) ns, the last one all longer ones."""
    lead_state: Final[str]
    """What the compensation of delay, lags and modes is computed from: "off", "nothing_in_time", "no_horizon", "short_horizon", "horizon"."""
    horizon_points: Final[int]
    """Setpoints after the last command that were known, of those that the lead uses."""
    horizon_points_used: Final[int]
    """Setpoints after a command that the lead uses."""
    horizons_refused: Final[int]
    """Horizons that were refused: a command differed from them, or no joint could follow them."""

@final
class Vibration:
    """One verdict on one line of the force spectrum."""

    state: Final[str]
    kind: Final[str]
    rivals: Final[list[str]]
    axis: Final[str]
    suspect_alias: Final[bool]
    advice: Final[str]
    sensor_faults: Final[list[str]]
    advice_lobe: Final[int]
    gear_joint: Final[int]
    gear_shaft: Final[int]
    seq: Final[int]
    t_ns: Final[int]
    made_ns: Final[int]
    event: Final[int]
    frequency_hz: Final[float]
    amplitude: Final[float]
    growth_per_s: Final[float]
    advice_rpm: Final[float]
    nearest_mode_hz: Final[float]
    mode_distance_hz: Final[float]
    nearest_harmonic_hz: Final[float]
    harmonic_distance_hz: Final[float]
    nearest_alias_hz: Final[float]
    alias_distance_hz: Final[float]
    sentence: Final[str]

@final
class Connection:
    """How the connection is, or what happened to it."""

    is_connected: Final[bool]
    pid: Final[int | None]
    epoch: Final[int | None]
    why: Final[str | None]
    words: Final[str]

@final
class Answer:
    """What the daemon answered to a request."""

    t_ns: Final[int]
    message: Final[str]

@final
class Client:
    """The robot's loop: commands out, corrected targets in. One per cell, used by one thread at a time."""

    def __new__(cls, cell: str, timeout: float = 2.0, *, runtime_dir: str | None = None) -> Self: ...
    def set_fresh(self, seconds: float) -> None:
        """How old an answer may be for `target_for`: 10 ms unless told otherwise."""

    def start_anew(self) -> None:
        """Begins another run: nothing of the path so far is remembered; the correction goes on."""

    def start_from(self, correction: list[float] | None = None) -> None:
        """Begins another run of a robot that stands at its command plus this correction."""

    def send(
        self,
        q: ArrayLike,
        *,
        t_ns: int = 0,
        wrench: tuple[float, ...] | list[float] | NDArray[np.float64] | None = None,
        wrench_in_base: bool = False,
        ambient_c: float | None = None,
        joints_c: ArrayLike | None = None,
        direction: list[int] | None = None,
        settled: bool = False,
    ) -> int:
        """Sends a commanded target; tells its number. Waits for nothing; raises NotSent."""

    def send_state(
        self,
        q: ArrayLike | None = None,
        *,
        tau: ArrayLike | None = None,
        ambient_c: float | None = None,
        t_ns: int = 0,
    ) -> None:
        """Sends what the robot measures of itself. Waits for nothing; raises NotSent."""

    def set_horizon(self, points: ArrayLike) -> int:
        """Sends the setpoints that follow the next command, one row per setpoint, one command period apart: call it before `send`.

        Of more than 128 the first are sent; tells how many were. It replaces the last horizon; an empty one says that no setpoint is
        known ahead. Waits for nothing; raises NotSent, and ValueError where a number is not finite: nothing was sent then.
        """

    def target_for(self, q_cmd: ArrayLike, now_ns: int | None = None) -> Target:
        """What to send to the robot for `q_cmd`, whatever has become of the daemon. Waits for nothing.

        A command that is not a number is a ValueError; nothing has changed then.
        """

    def last_target(self) -> Target | None:
        """What was sent to the robot last; None before the first target."""

    def exchange(self, q_cmd: ArrayLike, timeout: float) -> Target:
        """Sends and waits for the answer; answers like `target_for` in any case."""

    def newest(self) -> Corrected | None:
        """The newest answer of this daemon, however old; None before the first."""

    def wait_corrected(self, seq: int, timeout: float) -> Corrected:
        """The answer to the command of that number; raises TimedOut, or NotSent where the daemon is gone."""

    def status(self) -> Status | None:
        """The newest status; None before the first."""

    def vibration(self) -> Vibration | None:
        """The next verdict on vibration not yet taken."""

    def connection(self) -> Connection:
        """How the connection is."""

    def next_event(self) -> Connection | None:
        """What happened to the connection, oldest first."""

    def ping(self, timeout: float = 1.0) -> Answer:
        """Asks for a sign of life. Requests wait: not for the robot's loop. What is not done is raised."""

    def reload(self, path: str | PathLike[str] | None = None, timeout: float = 10.0) -> Answer:
        """Asks to load a model file and to swap it in; None: the one loaded now, read again."""

    def bypass(self, on: bool, timeout: float = 1.0) -> Answer:
        """Asks to ramp the correction out, or in again."""

    def arm(self, on: bool, timeout: float = 1.0) -> Answer:
        """Asks to go to shadow mode, or back to the configured one; where that is shadow, the answer is a refusal."""

    def mode(self, mode: Literal["shadow", "limited", "full"], timeout: float = 1.0) -> Answer:
        """Asks to go to a mode; beyond what the cell's configuration allows, the answer is a refusal."""

    def mark(self, text: str, timeout: float = 1.0) -> Answer:
        """Writes a marker into the recording; where nothing is recorded, the answer is a refusal."""

    def record(self, action: Literal["start", "stop", "keep"], timeout: float = 1.0) -> Answer:
        """Asks the recorder to start, to stop, or to keep the present recording."""

    def process_state(
        self,
        *,
        spindle_rpm: float = ...,
        teeth: int = 0,
        feed_mm_s: float = ...,
        in_cut: bool | None = None,
        holds_for: float | None = None,
        timeout: float = 1.0,
    ) -> Answer:
        """Tells what the process does, in place of what was told before; `holds_for` in s."""

    def measured(
        self,
        q: ArrayLike,
        point_m: tuple[float, float, float] | list[float] | NDArray[np.float64],
        sigma_m: float,
        *,
        direction: list[int] = ...,
        ambient_c: float = ...,
        timeout: float = 1.0,
    ) -> Answer:
        """Tells where the tool was measured; the answer says whether the model still holds."""

    def close(self) -> None:
        """Leaves the daemon, within about a second; once more is no error."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        kind: type[BaseException] | None = ...,
        error: BaseException | None = ...,
        traceback: TracebackType | None = ...,
    ) -> None: ...

@final
class Monitor:
    """Looks at a cell, and asks its daemon: any number of processes may."""

    def __new__(cls, cell: str, timeout: float = 2.0, *, runtime_dir: str | None = None) -> Self: ...
    def status(self) -> Status | None:
        """The newest status; None before the first."""

    def vibration(self) -> Vibration | None:
        """The next verdict on vibration not yet taken."""

    def connection(self) -> Connection:
        """How the connection is."""

    def next_event(self) -> Connection | None:
        """What happened to the connection, oldest first."""

    def ping(self, timeout: float = 1.0) -> Answer:
        """Asks for a sign of life. Requests wait: not for the robot's loop. What is not done is raised."""

    def reload(
        self, path: str | PathLike[str] | None = None, timeout: float = 10.0, *, other_robot: bool = False
    ) -> Answer:
        """Asks to load a model file and to swap it in; None: the one loaded now, read again.

        A model of another robot, or one whose limits the arm is already outside of, takes `other_robot` and shadow mode.
        """

    def bypass(self, on: bool, timeout: float = 1.0) -> Answer:
        """Asks to ramp the correction out, or in again."""

    def arm(self, on: bool, timeout: float = 1.0) -> Answer:
        """Asks to go to shadow mode, or back to the configured one; where that is shadow, the answer is a refusal."""

    def mode(self, mode: Literal["shadow", "limited", "full"], timeout: float = 1.0) -> Answer:
        """Asks to go to a mode; beyond what the cell's configuration allows, the answer is a refusal."""

    def mark(self, text: str, timeout: float = 1.0) -> Answer:
        """Writes a marker into the recording; where nothing is recorded, the answer is a refusal."""

    def record(self, action: Literal["start", "stop", "keep"], timeout: float = 1.0) -> Answer:
        """Asks the recorder to start, to stop, or to keep the present recording."""

    def process_state(
        self,
        *,
        spindle_rpm: float = ...,
        teeth: int = 0,
        feed_mm_s: float = ...,
        in_cut: bool | None = None,
        holds_for: float | None = None,
        timeout: float = 1.0,
    ) -> Answer:
        """Tells what the process does, in place of what was told before; `holds_for` in s."""

    def measured(
        self,
        q: ArrayLike,
        point_m: tuple[float, float, float] | list[float] | NDArray[np.float64],
        sigma_m: float,
        *,
        direction: list[int] = ...,
        ambient_c: float = ...,
        timeout: float = 1.0,
    ) -> Answer:
        """Tells where the tool was measured; the answer says whether the model still holds."""

    def close(self) -> None:
        """Leaves the daemon, within about a second; once more is no error."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        kind: type[BaseException] | None = ...,
        error: BaseException | None = ...,
        traceback: TracebackType | None = ...,
    ) -> None: ...

@final
class ForceSource:
    """Sends force blocks: one source per cell."""

    def __new__(cls, cell: str, timeout: float = 2.0, *, runtime_dir: str | None = None) -> Self: ...
    def send(
        self,
        samples: NDArray[np.float64] | NDArray[np.float32],
        t_ns: int,
        rate_hz: float,
        *,
        in_base: bool = False,
    ) -> None:
        """Sends one block, a row per sample, a column per channel, read where it lies. Raises NotSent where it is lost."""

    def lost(self) -> int:
        """Blocks lost so far."""

    def connection(self) -> Connection:
        """How the connection is."""

    def next_event(self) -> Connection | None:
        """What happened to the connection, oldest first."""

    def close(self) -> None:
        """Leaves the daemon, within about a second; once more is no error."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        kind: type[BaseException] | None = ...,
        error: BaseException | None = ...,
        traceback: TracebackType | None = ...,
    ) -> None: ...

@final
class Instrument:
    """Sends measured points of the tool: one instrument per cell."""

    def __new__(cls, cell: str, timeout: float = 2.0, *, runtime_dir: str | None = None) -> Self: ...
    def send(
        self,
        point_m: tuple[float, float, float] | list[float] | NDArray[np.float64],
        t_ns: int | None = None,
    ) -> None:
        """Sends a point in the instrument's own coordinates, three numbers, m; without a time the daemon takes the latency that its cell states."""

    def lost(self) -> int:
        """Points lost so far."""

    def connection(self) -> Connection:
        """How the connection is."""

    def next_event(self) -> Connection | None:
        """What happened to the connection, oldest first."""

    def close(self) -> None:
        """Leaves the daemon, within about a second; once more is no error."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        kind: type[BaseException] | None = ...,
        error: BaseException | None = ...,
        traceback: TracebackType | None = ...,
    ) -> None: ...
