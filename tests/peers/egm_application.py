"""The application behind the EGM bridge, by ABBRobotEGM: streams a path, and says what it sees of the robot.

usage: egm_application.py PORT CYCLES
On standard output: `listening`; then per cycle `cycle SEQNO TARGET.. SEEN..`, degrees, where SEEN is the feedback that
came after the target was sent: six numbers each, to the last bit.
"""

import sys

from ABBRobotEGM import EGM

START = [10.0, 15.0, -10.0, 15.0, 45.0, 5.0]
STEP = [0.004, 0.003, -0.002, 0.004, 0.003, 0.004]


def main(port, cycles):
    rows = []
    with EGM(port=port) as egm:
        print("listening", flush=True)
        target = None
        for cycle in range(cycles + 1):
            heard, state = egm.receive_from_robot(timeout=20)
            if not heard:
                sys.exit(f"cycle {cycle}: no word of the robot")
            if target is not None:
                rows.append((state.header.seqno, target, [float(q) for q in state.joint_angles]))
            target = [start + cycle * step for start, step in zip(START, STEP)]
            if cycle < cycles and not egm.send_to_robot(target):
                sys.exit(f"cycle {cycle}: not sent")
    for seqno, target, seen in rows:
        print("cycle", seqno, *[repr(number) for number in target + seen])


main(int(sys.argv[1]), int(sys.argv[2]))
