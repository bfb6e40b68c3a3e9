"""A robot's loop at 1 kHz, by the clock: python kilohertz.py CELL SECONDS. Says how it went.

A cycle that begins late is made up for, as a robot's buffer would; `late` counts those that began a whole period late.
"""

import sys
import time

import numpy as np
import trued

PERIOD_NS = 1_000_000


def main(cell: str, seconds: str) -> None:
    cycles = int(float(seconds) * 1e9 / PERIOD_NS)
    answered = late = 0
    took_ns = []
    with trued.Client(cell, timeout=10.0) as client:
        q = np.array([0.2, 0.3, -0.2, 0.3, 0.8, 0.1])
        start = trued.monotonic_ns()
        cpu = time.process_time()
        for cycle in range(cycles):
            due = start + cycle * PERIOD_NS
            while (early := due - trued.monotonic_ns()) > 0:
                time.sleep(early * 1e-9)
            began = trued.monotonic_ns()
            late += began - due > PERIOD_NS
            q[0] = 0.2 + 1e-5 * (cycle % 1000)
            target = client.exchange(q, 0.01)
            answered += target.source == "corrected"
            took_ns.append(trued.monotonic_ns() - began)
        elapsed_s = (trued.monotonic_ns() - start) * 1e-9
        cpu_us = (time.process_time() - cpu) * 1e6 / cycles
    took_ns.sort()
    print(f"cycles {cycles}\nanswered {answered}\nrate_hz {cycles / elapsed_s:.1f}\nlate {late}")
    print(f"p50_us {took_ns[cycles // 2] * 1e-3:.1f}\np99_us {took_ns[cycles * 99 // 100] * 1e-3:.1f}")
    print(f"cpu_us {cpu_us:.1f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
