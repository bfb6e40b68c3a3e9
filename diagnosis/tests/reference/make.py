"""Writes the problems and the solutions of SciPy that tests/reference.rs compares with.

    python3 -m venv venv && venv/bin/pip install scipy==1.17.1
    venv/bin/python diagnosis/tests/reference/make.py

The arm is the preset irb1600-6-145, here as a chain of homogeneous transforms from link to link, with errors between them; derivatives by
complex steps. Each line is a name and its numbers, SI. `NAME.q` joint positions, `NAME.seen` what was read, `NAME.noise` its standard deviations,
`NAME.start` and `NAME.found` the unknowns before and after, `NAME.sigma` their standard uncertainties, `NAME.cost` the sum of squares of data and
beliefs in units of the noise.
"""

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

HERE = Path(__file__).parent
G = 9.80665
# Mass, centre of mass at q = 0 (base frame), first joint that carries it.
BODIES = [
    (65.0, (0.060, 0.0, 0.5600), 1), (42.0, (0.150, 0.0, 0.8365), 2), (46.0, (0.170, 0.0, 1.2065), 3),
    (14.0, (0.560, 0.0, 1.1865), 4), (4.5, (0.752, 0.0, 1.1865), 5), (0.9 + 5.5, ((0.9 * 0.808 + 5.5 * 0.860) / 6.4, 0.0, 1.1865), 6),
]
# Where each joint's frame stands at q = 0 (base frame), all frames parallel to the base; the last is the flange.
PLACES = [(0, 0, 0.4865), (0.15, 0, 0.4865), (0.15, 0, 1.1865), (0.75, 0, 1.1865), (0.75, 0, 1.1865), (0.75, 0, 1.1865), (0.815, 0, 1.1865)]
AXES = "zyyxyx"
TOOL = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
# How widely each kind of number is believed to lie about nothing.
WIDTH = {"offset": 0.02, "tilt": 5e-3, "shift": 5e-3, "compliance": 2e-3}


def shift(v):
    t = np.eye(4, dtype=complex)
    t[:3, 3] = v
    return t


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    t = np.eye(4, dtype=complex)
    t[i, i], t[j, j], t[i, j], t[j, i] = c, c, -s, s
    return t


def vector_turn(v):
    """Rodrigues' formula; its series where the vector is short, so that complex steps pass."""
    v = np.asarray(v, dtype=complex)
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    square = v @ v
    if abs(square) < 1e-6:
        a, b = 1 - square / 6 + square**2 / 120, 0.5 - square / 24 + square**2 / 720
    else:
        angle = np.sqrt(square)
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / square
    t = np.eye(4, dtype=complex)
    t[:3, :3] = np.eye(3) + a * k + b * (k @ k)
    return t


def frames(q, errors):
    """Each joint's frame before it turns, and the flange's."""
    t, out = shift(PLACES[0]), []
    for i in range(6):
        t = t @ shift(errors.get(("shift", i + 1), (0, 0, 0)))
        out.append(t)
        tilt = vector_turn(errors.get(("tilt", i + 1), (0, 0, 0)))
        t = t @ tilt @ turn(AXES[i], q[i] + errors.get(("offset", i + 1), 0)) @ tilt.T
        t = t @ shift(np.subtract(PLACES[i + 1], PLACES[i]))
    return out + [t]


def loads(q, force):
    """What gravity and a force on the flange exert about each joint, on the nominal arm."""
    at = [t.real for t in frames(q, {})]
    torque = np.zeros(6)
    for i in range(6):
        axis = at[i][:3, "xyz".index(AXES[i])]
        pull = np.cross(at[6][:3, 3] - at[i][:3, 3], force)
        for mass, com, first in BODIES[i:]:
            # A body turns with its joint: its frame after the turn.
            body = at[first - 1] @ turn(AXES[first - 1], q[first - 1]).real
            centre = (body @ np.append(np.subtract(com, PLACES[first - 1]), 1))[:3]
            pull = pull + np.cross(centre - at[i][:3, 3], (0, 0, -mass * G))
        torque[i] = axis @ pull
    return torque


def tool_point(q, errors, compliance, torque, target):
    bent = np.array(q, dtype=complex)
    for joint, c in compliance.items():
        bent[joint - 1] = bent[joint - 1] + c * torque[joint - 1]
    return (frames(bent, errors)[6] @ np.append(TOOL @ np.asarray(target), 1))[:3]


def robot(names, x):
    """Errors and compliances from the unknowns: `offset2`, `shift3x`, `tilt4y`, `compliance2`."""
    errors, compliance = {}, {}
    for name, value in zip(names, x):
        kind = name.rstrip("xyz").rstrip("0123456789")
        joint = int(name[len(kind)])
        if kind == "compliance":
            compliance[joint] = value
        elif kind == "offset":
            errors["offset", joint] = value
        else:
            vector = list(errors.get((kind, joint), (0, 0, 0)))
            vector["xyz".index(name[-1])] = value
            errors[kind, joint] = vector
    return errors, compliance


def beliefs(names, x):
    return [value / WIDTH[name.rstrip("xyz").rstrip("0123456789")] for name, value in zip(names, x)]


def solve(name, q, noise, predict, seen, names, start_rest, forces=None):
    forces = np.zeros((len(q), 3)) if forces is None else forces
    torques = [loads(a, f) for a, f in zip(q, forces)]
    noise = np.broadcast_to(noise, np.shape(seen))

    def residuals(x):
        errors, compliance = robot(names, x[: len(names)])
        rows = [predict(a, errors, compliance, t, x[len(names):]) for a, t in zip(q, torques)]
        all_rows = np.concatenate([((np.array(rows) - seen) / noise).ravel(), beliefs(names, x[: len(names)])])
        return all_rows if np.iscomplexobj(x) else all_rows.real

    start = np.concatenate([np.zeros(len(names)), start_rest])
    found = least_squares(residuals, start, jac="cs", x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=500)
    # From there on in units of the uncertainties, so that nothing is left of how the unknowns are scaled.
    sigma = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    found = least_squares(residuals, found.x, jac="cs", x_scale=sigma, ftol=1e-15, xtol=1e-15, gtol=1e-15, max_nfev=500)
    r, jacobian = found.fun, found.jac
    last = np.linalg.lstsq(jacobian, -r, rcond=None)[0]
    found_x = found.x + last
    sigma = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    print(name, len(found_x), "unknowns, cost", 2 * found.cost, "last step in sigmas", np.max(np.abs(last / sigma)))
    rows = [("q", q), ("force", forces), ("seen", seen), ("noise", noise), ("start", start), ("found", found_x), ("sigma", sigma),
            ("cost", [2 * found.cost])]
    return [(f"{name}.{key}", values) for key, values in rows]


def poses(rng, count):
    reach = np.array([1.0, 0.6, 0.6, 1.5, 1.2, 1.5])
    return np.round(rng.uniform(-reach, reach, (count, 6)), 6)


TARGET = (0.1, 0.02, 0.06)


def truth_of(names, values, q, target, forces=None):
    errors, compliance = robot(names, values)
    forces = np.zeros((len(q), 3)) if forces is None else forces
    return np.array([tool_point(a, errors, compliance, loads(a, f), target).real for a, f in zip(q, forces)])


def points(rng):
    """A tracker: points in an unknown frame of a reflector of unknown place, blunter in one direction; geometry and one compliance."""
    names = ["offset2", "offset3", "offset4", "offset5", "shift3z", "tilt4y", "tilt4z", "compliance2", "compliance3"]
    values = [1e-3, -7e-4, 2e-3, 5e-4, -3e-4, 4e-4, -6e-4, 2e-6, 5e-6]
    q, noise = poses(rng, 60), np.array([2e-5, 3e-5, 5e-5])
    turned, origin = vector_turn((0.1, -0.2, 1.9)).real[:3, :3], np.array([2.0, -1.0, 0.4])
    seen = np.round(truth_of(names, values, q, TARGET) @ turned.T + origin + noise * rng.normal(size=(60, 3)), 9)

    def predict(a, errors, compliance, torque, rest):
        point = tool_point(a, errors, compliance, torque, rest[6:9])
        return vector_turn(rest[0:3])[:3, :3] @ point + rest[3:6]

    return solve("points", q, noise, predict, seen, names, [0.1, -0.2, 1.9, 2.0, -1.0, 0.4, *TARGET])


def distances(rng):
    """A ballbar on two fixed points of unknown place; the ball's place on the tool is known."""
    names = ["offset2", "offset3", "offset4", "offset5"]
    values = [1e-3, -7e-4, 2e-3, 5e-4]
    q, noise = poses(rng, 80), 1e-5
    anchors = np.array([[0.9, 0.4, 0.1], [0.6, -0.7, 0.2]])
    at = truth_of(names, values, q, TARGET)
    lengths = np.linalg.norm(at[:, None, :] - anchors, axis=2)
    seen = np.round(lengths + noise * rng.normal(size=(80, 2)), 9)

    def predict(a, errors, compliance, torque, rest):
        point = tool_point(a, errors, compliance, torque, TARGET)
        away = point - np.reshape(rest, (2, 3))
        return np.sqrt(np.sum(away * away, axis=1))

    return solve("distances", q, noise, predict, seen, names, (anchors + 0.003).ravel())


def planes(rng):
    """A probe on two planes of unknown tilt and place: the ball's radius is what was read."""
    names = ["offset2", "offset3", "offset4", "offset5"]
    values = [1e-3, -7e-4, 2e-3, 5e-4]
    q, noise = poses(rng, 80), 1e-5
    # Normals as (1, a, b) and (a, b, 1), made unit: the planes x = const and z = const, tilted a little.
    at = truth_of(names, values, q, TARGET)

    def heights(point, rest):
        n1 = np.array([1, rest[0], rest[1]]) / np.sqrt(1 + rest[0] ** 2 + rest[1] ** 2)
        n2 = np.array([rest[3], rest[4], 1]) / np.sqrt(1 + rest[3] ** 2 + rest[4] ** 2)
        return np.array([n1 @ point - rest[2], n2 @ point - rest[5]])

    known = [0.01, -0.02, 0.1, 0.015, 0.005, 0.2]
    seen = np.round([heights(p, known) for p in at] + noise * rng.normal(size=(80, 2)), 9)

    def predict(a, errors, compliance, torque, rest):
        return heights(tool_point(a, errors, compliance, torque, TARGET), rest)

    return solve("planes", q, noise, predict, seen, names, [0, 0, 0.1, 0, 0, 0.2])


def compliance(rng):
    """Loads on the flange, the tracker's frame and the reflector known: zeros and compliances."""
    names = ["offset2", "offset3", "offset5", "compliance2", "compliance3", "compliance4", "compliance5"]
    values = [1e-3, -7e-4, 5e-4, 2.2e-6, 1.1e-5, 1.1e-4, 3.3e-4]
    q, noise = poses(rng, 40), 3e-5
    forces = np.round(rng.uniform(-150, 150, (40, 3)), 3)
    at = truth_of(names, values, q, TARGET, forces)
    seen = np.round(at + noise * rng.normal(size=(40, 3)), 9)

    def predict(a, errors, compliance, torque, rest):
        return tool_point(a, errors, compliance, torque, TARGET)

    return solve("compliance", q, noise, predict, seen, names, [], forces)


def main():
    rng = np.random.default_rng(5)
    with open(HERE / "scipy.txt", "w", encoding="ascii") as out:
        for problem in (points, distances, planes, compliance):
            for name, values in problem(rng):
                out.write(name + " " + " ".join(f"{float(v):.16g}" for v in np.ravel(values)) + "\n")


main()
