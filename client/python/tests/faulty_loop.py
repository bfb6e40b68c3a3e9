"""A robot's loop with random faults: what it commands and would send to the robot is written to a file, one record per cycle,
for the test that judges it.

python faulty_loop.py CELL FILE CYCLES CALM SEED: CYCLES cycles with random faults, then CALM cycles without.
"""

import contextlib
import math
import random
import struct
import sys
import time

import numpy as np
import trued

PERIOD_NS = 1_000_000
MIDDLE = np.array([0.2, 0.3, -0.2, 0.3, 0.8, 0.1])
PHASES = 0.1 * np.arange(6)
CLOCKS_NS = (0, 300_000_000, 600_000_000, 2_000_000_000, 3_600_000_000_000)
MODES = {"shadow": 0, "limited": 1, "full": 2}
SOURCES = {"corrected": 0, "last_correction": 1, "ramping": 2, "plain": 3}
RECORD = struct.Struct("<QQII3d6d6d")


def path(t_s: float) -> np.ndarray:
    return MIDDLE + 0.05 * np.sin(2.0 * math.pi * (t_s / 5.0 + PHASES))


def no_number(client: trued.Client, chance: random.Random) -> None:
    """A NaN or infinite command has to return an error and change nothing."""
    before = client.last_target()
    with contextlib.suppress(ValueError):
        command = path(0.0)
        command[chance.randrange(6)] = chance.choice((math.nan, math.inf, -math.inf))
        client.target_for(command)
        raise SystemExit("no number was answered")
    after = client.last_target()
    if before is not None and not np.array_equal(before.joints, after.joints):
        raise SystemExit("what was sent last has changed")


def main(cell: str, file: str, faulty: str, calm: str, seed: str) -> None:
    chance = random.Random(int(seed))
    cycles = int(faulty) + int(calm)
    outside = joint = clock_ns = stamp_ns = 0
    phase_s = 0.0
    limits = (0, 0.0, 0.0, 0.0)
    with trued.Client(cell, timeout=10.0) as client, open(file, "wb") as out:
        due_ns = trued.monotonic_ns()
        for cycle in range(cycles):
            fault = chance.randrange(10_000) if cycle < int(faulty) else 10_000
            if cycle == int(faulty):
                clock_ns = outside = 0
            if fault < 3:
                time.sleep(chance.random() * 0.3)
            elif fault == 3:
                phase_s += 2.0 * chance.random()
            elif fault == 4:
                clock_ns = chance.choice(CLOCKS_NS)
            elif fault == 5:
                client.start_anew()
            elif 10 <= fault < 14:
                no_number(client, chance)
            elif 14 <= fault < 17:
                joint, outside = chance.randrange(6), 1 + chance.randrange(1000)
            due_ns = max(due_ns + PERIOD_NS, trued.monotonic_ns())
            while (early_ns := due_ns - trued.monotonic_ns()) > 0:
                time.sleep(early_ns * 1e-9)

            command = path(1e-9 * trued.monotonic_ns() + phase_s)
            if fault == 6:
                command[chance.randrange(6)] += 1.0
            if outside > 0:
                command[joint] += 7.0
                outside -= 1
            t_ns = due_ns + clock_ns  # of the cycle, as a cell's own clock would stamp it
            if not 20 <= fault < 40:
                try:
                    seq = client.send(command, t_ns=t_ns)
                    stamp_ns = t_ns
                    with contextlib.suppress(trued.TruedError):
                        client.wait_corrected(seq, 0.0005)
                except trued.MessageLost:
                    stamp_ns = t_ns
                except trued.NotSent:
                    pass
            now_ns = trued.monotonic_ns()
            target = client.target_for(command, now_ns)
            if status := client.status():
                first = (status.correction_max[0], status.correction_rate_max[0], status.correction_jerk_max[0])
                limits = (MODES[status.mode], *first)
            mode, angle, rate, jerk = limits
            source = SOURCES[target.source]
            out.write(RECORD.pack(now_ns, stamp_ns, mode, source, angle, rate, jerk, *command, *target.joints))


if __name__ == "__main__":
    main(*sys.argv[1:])
