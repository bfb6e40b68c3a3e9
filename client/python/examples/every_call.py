"""Everything that the library can do, once, with figures that are the same in every language.

python every_call.py CELL [TARGETS]

The cell: six joints, `run --lockstep`, mode "full", force of 3 channels at 10 kHz with the vibration monitor.
"""

import math
import sys
import time
from collections.abc import Callable

import numpy as np
import trued

JOINTS, BLOCKS, BLOCK = 6, 350, 100
MASK = 0xFFFF_FFFF_FFFF_FFFF


def target_of(k: int) -> np.ndarray:
    """The path: numbers that every language writes with the same bits."""
    base = np.array([200000, 300000, -200000, 300000, 800000, 100000])
    turn = (k + 500 * np.arange(JOINTS)) % 4000 - 2000
    q: np.ndarray = (base + 20 * np.abs(turn)) / 1048576.0
    return q


def hashed(value: int, numbers: np.ndarray) -> int:
    """FNV-1a over the bits of numbers."""
    for byte in numbers.astype("<f8").tobytes():
        value = ((value ^ byte) * 0x100000001B3) & MASK
    return value


def correct(client: trued.Client, targets: int) -> None:
    """Commands a path, and takes each answer."""
    value, corrected, took_ns, answers = 0xCBF29CE484222325, 0, [], []
    path = [target_of(k) for k in range(targets)]
    client.start_anew()
    for k, q in enumerate(path):
        start = trued.monotonic_ns()
        seq = client.send(q, t_ns=(k + 1) * 1_000_000)
        answer = client.wait_corrected(seq, 10.0)
        took_ns.append(trued.monotonic_ns() - start)
        answers.append(answer.correction)
        corrected += answer.status == "corrected"
        client.target_for(q)
    for joints in answers:
        value = hashed(value, joints)
    took_ns.sort()
    print(f"targets {targets}\ncorrected {corrected}\nhash {value:016x}")
    print(f"round_trip_us_p50 {took_ns[targets // 2] * 1e-3:.3f}")
    print(f"round_trip_us_p99 {took_ns[targets * 99 // 100] * 1e-3:.3f}")


def comes_to(holds: Callable[[], bool]) -> bool:
    """Waits until something holds."""
    for _ in range(10000):
        if holds():
            return True
        time.sleep(0.001)
    return False


def listen(force: trued.ForceSource, monitor: trued.Monitor) -> None:
    """Sends noise, then a tone of 72 Hz on y; the watch says what rings."""
    ringing: list[trued.Vibration] = []

    def hear() -> bool:
        while (said := monitor.vibration()) is not None:
            if said.state == "confirmed":
                ringing.append(said)
        return bool(ringing)

    def blocks_taken() -> int:
        status = monitor.status()
        return 0 if status is None else status.force_blocks

    # The first status comes a moment after connecting.
    if not comes_to(lambda: monitor.status() is not None):
        raise RuntimeError("no status came")
    before = blocks_taken()

    def taken(blocks: int) -> None:
        if not comes_to(lambda: blocks_taken() >= before + blocks):
            raise RuntimeError("the daemon does not take the force blocks")

    chance, start = 11, trued.monotonic_ns()
    for k in range(BLOCKS):
        samples = np.empty((BLOCK, 3))
        for i in range(3 * BLOCK):
            chance = (chance * 6364136223846793005 + 1442695040888963407) & MASK
            samples.flat[i] = (chance >> 11) / 9007199254740992.0 - 0.5
        if k > 200:
            t_s = (BLOCK * k + np.arange(BLOCK)) * 1e-4
            samples[:, 1] += 4.0 * np.sin(2.0 * math.pi * 72.0 * t_s)
        force.send(samples, start + k * 10_000_000, 10000.0)
        if k % 32 == 31:
            taken(k + 1)
        hear()
    taken(BLOCKS)
    comes_to(hear)
    print(f"force_blocks {BLOCKS}\nforce_lost {force.lost()}")
    rings = ringing[-1]
    print(f"rings_hz {rings.frequency_hz:.0f}\nrings_axis {['x', 'y', 'z', 'mx', 'my', 'mz'].index(rings.axis)}")


def ask(client: trued.Client, monitor: trued.Monitor) -> None:
    """Asks for everything that may be asked for."""

    def status() -> trued.Status:
        found = client.status()
        assert found is not None, "connected with a status"
        return found

    before = status()
    client.ping(timeout=10.0)
    client.bypass(True, timeout=10.0)
    bypassed = comes_to(lambda: status().bypassed)
    monitor.bypass(False, timeout=10.0)
    bypassed &= comes_to(lambda: not status().bypassed)
    client.reload()
    refused = False
    try:
        monitor.reload("/nowhere/model.toml")
    except trued.Refused:
        refused = True
    client.process_state(spindle_rpm=12000.0, teeth=2, timeout=10.0)
    client.send_state(np.zeros(JOINTS))
    # The setpoints after the next command: more than are sent.
    horizon = client.set_horizon([target_of(k) for k in range(1, 131)])
    print(f"joints {before.joints}\nmode {['shadow', 'limited', 'full'].index(before.mode)}")
    print(f"bypassed {int(bypassed)}\nreload_refused {int(refused)}")
    print(f"horizon {horizon}")


def steer(client: trued.Client, monitor: trued.Monitor) -> None:
    """Changes the mode and the recording, and back."""

    def comes_to_be(mode: str, recorder: str) -> bool:
        def is_so() -> bool:
            status = client.status()
            return status is not None and (status.mode, status.recorder) == (mode, recorder)

        return comes_to(is_so)

    done = comes_to_be("full", "recording")
    client.mode("limited", timeout=10.0)
    done &= comes_to_be("limited", "recording")
    monitor.mode("shadow", timeout=10.0)
    client.mark("part 7", timeout=10.0)
    monitor.mark("part 8", timeout=10.0)
    client.record("keep", timeout=10.0)
    monitor.record("stop", timeout=10.0)
    done &= comes_to_be("shadow", "stopped")
    refused = False
    try:
        monitor.mark("part 9", timeout=10.0)
    except trued.Refused:
        refused = True
    client.record("start", timeout=10.0)
    monitor.arm(True, timeout=10.0)
    done &= comes_to_be("full", "recording")
    print(f"steered {int(done)}\nmark_refused {int(refused)}")


def measure(cell: str, client: trued.Client) -> None:
    """Sends measured points of the tool. The cell has no [measured]: they are taken, and nothing is trimmed."""
    with trued.Instrument(cell, timeout=10.0) as instrument:
        instrument.send(np.array([1.0, 0.5, 0.25]))
        instrument.send((1.0, 0.5, 0.25), trued.monotonic_ns())
        assert instrument.connection().is_connected
        status = client.status()
        assert status is not None, "connected with a status"
        print(f"points_sent 2\npoints_lost {instrument.lost()}")
        print(f"trim_state {int(status.trim_state != 'off')}\ntrim_points {status.trim_measurements}")


def main(cell: str = "cell-1", targets: str = "10000") -> None:
    with (
        trued.Client(cell, timeout=10.0) as client,
        trued.Monitor(cell, timeout=10.0) as monitor,
        trued.ForceSource(cell, timeout=10.0) as force,
    ):
        correct(client, int(targets))
        listen(force, monitor)
        ask(client, monitor)
        steer(client, monitor)
        measure(cell, client)


if __name__ == "__main__":
    main(*sys.argv[1:])
