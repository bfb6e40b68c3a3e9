"""Prints, for each URDF named on stdin, Pinocchio's link frames at random joint positions: tests/urdf_peers.rs reads it.

Lines, fields apart by tabs: `file`, its path, `loaded` or `refused`; for each pose `pose` and joint, position, …;
for each link `link`, its name, the rows of its placement in the root's frame (12 numbers, m).
"""

import sys

import numpy as np
import pinocchio as pin

POSES = 3


def main():
    rng = np.random.default_rng(31)
    for path in map(str.strip, sys.stdin):
        try:
            model = pin.buildModelFromUrdf(path)
        except Exception:  # Whatever it is: the file is refused.
            print("file", path, "refused", sep="\t")
            continue
        print("file", path, "loaded", sep="\t")
        data = model.createData()
        for _ in range(POSES):
            v = rng.uniform(-2, 2, model.nv)
            pin.framesForwardKinematics(model, data, pin.integrate(model, pin.neutral(model), v))
            joints = [(n, j) for n, j in zip(model.names, model.joints) if j.nv == 1 and j.idx_v >= 0]
            print("pose", *(word for n, j in joints for word in (n, repr(float(v[j.idx_v])))), sep="\t")
            for frame, place in zip(model.frames, data.oMf):
                if frame.type == pin.FrameType.BODY:
                    numbers = np.ravel(place.homogeneous[:3])
                    print("link", frame.name, *(repr(float(n)) for n in numbers), sep="\t")


main()
