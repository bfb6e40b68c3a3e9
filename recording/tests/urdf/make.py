"""Writes the reference numbers of Pinocchio that tests/urdf.rs compares with.

    python3 -m venv venv && venv/bin/pip install pin==4.1.0
    venv/bin/python recording/tests/urdf/make.py

For each robot and pose: `q`, the rows of the tip's homogeneous placement in the base link's frame (`tip`), the torques that
hold the arm against gravity (`gravity`), and the rows of the joint-space inertia (`inertia`), all SI.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).parent
POSES = 6
ROBOTS = [("six", "foot", "tool"), ("scara", "base", "flange"), ("seven", "seat", "tip")]


def chain_of(model, base, tip):
    """Indices of the joints between two links, base first."""
    joints, joint = [], model.frames[model.getFrameId(tip)].parentJoint
    stop = model.frames[model.getFrameId(base)].parentJoint
    while joint != stop:
        joints.insert(0, joint)
        joint = model.parents[joint]
    return joints


def lines(name, base, tip, rng):
    model = pin.buildModelFromUrdf(str(HERE / f"{name}.urdf"))
    model.gravity.linear = np.array([0, 0, -9.80665])
    data = model.createData()
    slots = [model.joints[joint].idx_v for joint in chain_of(model, base, tip)]
    for _ in range(POSES):
        position = np.zeros(model.nv)
        position[slots] = rng.uniform(-2, 2, len(slots))
        if name == "scara":
            position[slots[2]] = rng.uniform(-0.02, 0.18)
        q = pin.integrate(model, pin.neutral(model), position)
        pin.framesForwardKinematics(model, data, q)
        placement = data.oMf[model.getFrameId(base)].actInv(data.oMf[model.getFrameId(tip)])
        gravity = pin.computeGeneralizedGravity(model, data, q)
        inertia = pin.crba(model, data, q)
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        yield "q", position[slots]
        yield "tip", placement.homogeneous[:3]
        yield "gravity", gravity[slots]
        yield "inertia", inertia[np.ix_(slots, slots)]


def main():
    rng = np.random.default_rng(8)
    for name, base, tip in ROBOTS:
        with open(HERE / f"{name}.txt", "w", encoding="ascii") as out:
            for key, values in lines(name, base, tip, rng):
                out.write(key + " " + " ".join(repr(float(v)) for v in np.ravel(values)) + "\n")


main()
