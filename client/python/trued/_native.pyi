"""The interface, with its types. SI: rad (m where a joint is prismatic), s, N, N m; other units stand in the names."""

from os import PathLike
from types import TracebackType
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Self

__all__ = [
    "Answer",
    "Client",
    "Connection",
    "Corrected",
    "ForceSource",
    "Monitor",
    "Status",
    "Target",
    "Vibration",
    "contract",
    "monotonic_ns",
]

def monotonic_ns() -> int:
    """CLOCK_MONOTONIC, ns: the one clock of all times here."""

def contract() -> str:
    """The version of the library, with the contract that it shares with the daemon."""

@final
class Target:
    """A joint target that may be published."""

    @property
    def joints(self) -> NDArray[np.float64]: ...
    @property
    def source(self) -> Literal["corrected", "last_correction", "rejected", "blending", "ramping", "plain"]: ...

@final
class Corrected:
    """What the daemon answers to a command."""

    @property
    def seq(self) -> int: ...
    @property
    def command_seq(self) -> int: ...
    @property
    def t_ns(self) -> int: ...
    @property
    def received_ns(self) -> int: ...
    @property
    def made_ns(self) -> int: ...
    @property
    def model_epoch(self) -> int: ...
    @property
    def status(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def wrench_gate(self) -> str: ...
    @property
    def iterations(self) -> int: ...
    @property
    def joints(self) -> NDArray[np.float64]: ...
    @property
    def correction(self) -> NDArray[np.float64]: ...
    @property
    def correction_rate(self) -> NDArray[np.float64]: ...
    @property
    def correction_acceleration(self) -> NDArray[np.float64]: ...
    @property
    def wanted(self) -> NDArray[np.float64]: ...
    @property
    def residual_m(self) -> float: ...
    @property
    def residual_rad(self) -> float: ...

@final
class Status:
    """How the daemon is."""

    @property
    def pid(self) -> int: ...
    @property
    def seq(self) -> int: ...
    @property
    def t_ns(self) -> int: ...
    @property
    def started_ns(self) -> int: ...
    @property
    def model_epoch(self) -> int: ...
    @property
    def model_hash(self) -> int: ...
    @property
    def cycles(self) -> int: ...
    @property
    def missed_cycles(self) -> int: ...
    @property
    def commands(self) -> int: ...
    @property
    def rejected(self) -> int: ...
    @property
    def held(self) -> int: ...
    @property
    def stale(self) -> int: ...
    @property
    def commands_lost(self) -> int: ...
    @property
    def corrected_lost(self) -> int: ...
    @property
    def force_blocks(self) -> int: ...
    @property
    def force_gaps(self) -> int: ...
    @property
    def force_refused(self) -> int: ...
    @property
    def malformed(self) -> int: ...
    @property
    def recorder_dropped(self) -> int: ...
    @property
    def latency_p50_ns(self) -> int: ...
    @property
    def latency_p99_ns(self) -> int: ...
    @property
    def latency_p999_ns(self) -> int: ...
    @property
    def latency_max_ns(self) -> int: ...
    @property
    def model_broken_since_ns(self) -> int: ...
    @property
    def model_measurements(self) -> int: ...
    @property
    def model_residual_m(self) -> float: ...
    @property
    def wrench_loop_gain(self) -> float: ...
    @property
    def spindle_rpm(self) -> float: ...
    @property
    def feed_mm_s(self) -> float: ...
    @property
    def health(self) -> str: ...
    @property
    def mode(self) -> str: ...
    @property
    def bypassed(self) -> bool: ...
    @property
    def joints(self) -> int: ...
    @property
    def wrench_gate(self) -> str: ...
    @property
    def recorder(self) -> str: ...
    @property
    def watch(self) -> str: ...
    @property
    def in_cut(self) -> str: ...
    @property
    def uncompensated_effects(self) -> int: ...
    @property
    def force_faults(self) -> list[str]: ...
    @property
    def q_min(self) -> NDArray[np.float64]: ...
    @property
    def q_max(self) -> NDArray[np.float64]: ...
    @property
    def correction_max(self) -> NDArray[np.float64]: ...
    @property
    def correction_rate_max(self) -> NDArray[np.float64]: ...
    @property
    def correction_jerk_max(self) -> NDArray[np.float64]: ...
    @property
    def message(self) -> str: ...

@final
class Vibration:
    """One verdict on one line of the force spectrum."""

    @property
    def state(self) -> str: ...
    @property
    def kind(self) -> str: ...
    @property
    def rivals(self) -> list[str]: ...
    @property
    def axis(self) -> str: ...
    @property
    def suspect_alias(self) -> bool: ...
    @property
    def advice(self) -> str: ...
    @property
    def sensor_faults(self) -> list[str]: ...
    @property
    def advice_lobe(self) -> int: ...
    @property
    def gear_joint(self) -> int: ...
    @property
    def gear_shaft(self) -> int: ...
    @property
    def seq(self) -> int: ...
    @property
    def t_ns(self) -> int: ...
    @property
    def made_ns(self) -> int: ...
    @property
    def event(self) -> int: ...
    @property
    def frequency_hz(self) -> float: ...
    @property
    def amplitude(self) -> float: ...
    @property
    def growth_per_s(self) -> float: ...
    @property
    def advice_rpm(self) -> float: ...
    @property
    def nearest_mode_hz(self) -> float: ...
    @property
    def mode_distance_hz(self) -> float: ...
    @property
    def nearest_harmonic_hz(self) -> float: ...
    @property
    def harmonic_distance_hz(self) -> float: ...
    @property
    def nearest_alias_hz(self) -> float: ...
    @property
    def alias_distance_hz(self) -> float: ...
    @property
    def sentence(self) -> str: ...

@final
class Connection:
    """How the connection is, or what happened to it."""

    @property
    def is_connected(self) -> bool: ...
    @property
    def pid(self) -> int | None: ...
    @property
    def epoch(self) -> int | None: ...
    @property
    def why(self) -> str | None: ...
    @property
    def words(self) -> str: ...

@final
class Answer:
    """What the daemon answered to a request."""

    @property
    def t_ns(self) -> int: ...
    @property
    def message(self) -> str: ...

@final
class Client:
    """The robot's loop: commands out, corrected targets in. One per cell, used by one thread at a time."""

    def __new__(cls, cell: str, timeout: float = 2.0, *, runtime_dir: str | None = None) -> Self: ...
    def set_fresh(self, seconds: float) -> None:
        """How old an answer may be for `target_for`: 10 ms unless told otherwise."""

    def start_anew(self) -> None:
        """Begins another run: nothing of the path so far is remembered."""

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

    def target_for(self, q_cmd: ArrayLike, now_ns: int | None = None) -> Target:
        """What to publish for `q_cmd`, whatever has become of the daemon. Waits for nothing."""

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

    def reload(self, path: str | PathLike[str] | None = None, timeout: float = 10.0) -> Answer:
        """Asks to load a model file and to swap it in; None: the one loaded now, read again."""

    def bypass(self, on: bool, timeout: float = 1.0) -> Answer:
        """Asks to ramp the correction out, or in again."""
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
