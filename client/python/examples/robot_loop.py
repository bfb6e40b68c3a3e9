"""The robot's side of a cell in ten lines: what an integrator adds to a loop of his own.

python robot_loop.py CELL [CYCLES]
"""

import contextlib
import sys
import time

import numpy as np
import trued


def next_target(cycle: int) -> np.ndarray:
    """Stands for the cell's own path: joint 1 goes slowly to and fro."""
    step = cycle % 2000
    return np.array([0.0001 * (step if step < 1000 else 2000 - step), -0.5, 0.7, 0.0, 0.4, 0.0])


def publish_to_robot(q: np.ndarray) -> None:
    """Stands for the robot's own interface."""


def main(cell: str = "cell-1", cycles: str = "10000") -> None:
    with trued.Client(cell, timeout=2.0) as client:
        for cycle in range(int(cycles)):
            q_cmd = next_target(cycle)  # rad
            with contextlib.suppress(trued.NotSent):  # can fail without a daemon; the next line still works
                client.send(q_cmd)
            target = client.target_for(q_cmd)
            publish_to_robot(target.joints)
            time.sleep(0.001)


if __name__ == "__main__":
    main(*sys.argv[1:])
