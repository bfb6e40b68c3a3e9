"""A fleet over many recordings, of which one robot wears: a generator that shares no line with the product.

Forward kinematics of a six-axis arm from its dimensions, a play operator in one joint, constant zero offsets of each robot, measured points with normal noise.
Writes the nominal model, the recordings and the manifest `fleet.toml` for `trued diagnose --batch`. Standard library alone.
"""

import argparse
import datetime
import math
import random
from pathlib import Path

NOISE_MM = 0.03
ROWS = 120
EVERY_DAYS = 4
OFFSET_RAD = 0.25e-3


def turned(axis, angle, v):
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = v
    if axis == "x":
        return (x, c * y - s * z, s * y + c * z)
    if axis == "y":
        return (c * x + s * z, y, -s * x + c * z)
    return (c * x - s * y, s * x + c * y, z)


# From the flange back to the base: each joint's axis, and the way from the joint before it, mm.
CHAIN = [
    ("z", (0.0, 0.0, 486.5)),
    ("y", (150.0, 0.0, 0.0)),
    ("y", (0.0, 0.0, 700.0)),
    ("x", (0.0, 0.0, 0.0)),
    ("y", (600.0, 0.0, 0.0)),
    ("x", (65.0, 0.0, 0.0)),
]
TOOL_MM = (80.0, 0.0, 45.0)


def tool(q):
    v = TOOL_MM
    for (axis, way), angle in zip(reversed(CHAIN), reversed(q)):
        v = turned(axis, angle, v)
        v = tuple(a + b for a, b in zip(v, way))
    return v


def recording(rng, offsets, play, joint):
    """Rows of commanded joints (deg) and measured tool (mm)."""
    swing = [(60, 0.61), (35, 0.97), (35, 0.79), (90, 1.63), (70, 1.31), (120, 1.9)]
    phase = [rng.uniform(0, 6.28) for _ in swing]
    link = None
    rows = []
    for k in range(-20, ROWS):
        t = 0.05 * k
        motor = [math.radians(a * math.sin(w * t + p)) for (a, w), p in zip(swing, phase)]
        m = motor[joint]
        link = m if link is None else min(max(link, m - play / 2), m + play / 2)
        true = [a + o for a, o in zip(motor, offsets)]
        true[joint] += link - m
        point = [x + rng.gauss(0, NOISE_MM) for x in tool(true)]
        if k >= 0:
            rows.append((t, [math.degrees(a) for a in motor], point))
    return rows


def model():
    """The nominal arm: its joints in the zero configuration, base frame."""
    lines = ['schema = "trued.model/1"', 'name = "six-axis arm, nominal"', "gravity_m_s2 = [0.0, 0.0, -9.80665]"]
    axes = {"x": "[1.0, 0.0, 0.0]", "y": "[0.0, 1.0, 0.0]", "z": "[0.0, 0.0, 1.0]"}
    point = [0.0, 0.0, 0.0]
    for number, (axis, way) in enumerate(CHAIN, 1):
        point = [a + b for a, b in zip(point, way)]
        lines += ["[[joint]]", f'name = "{number}"', 'kind = "revolute"', f"axis = {axes[axis]}", f"point_mm = {point}"]
        lines += ["limits_deg = [-180.0, 180.0]", "max_speed_deg_s = 400.0"]
    tcp = [a + b for a, b in zip(point, TOOL_MM)]
    lines += ["[tool]", f"tcp_mm = {tcp}"]
    return "\n".join(lines) + "\n"


def write(folder, robot, visit, rows):
    stem = f"{robot}-{visit:03d}"
    with open(folder / f"{stem}.csv", "w") as file:
        file.write("t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n")
        for t, q, p in rows:
            file.write(",".join(f"{v:.9g}" for v in [t, *q, *p]) + "\n")
    sigma = f"sigma = {{ x_mm = {NOISE_MM}, y_mm = {NOISE_MM}, z_mm = {NOISE_MM} }}"
    (folder / f"{stem}.toml").write_text(f'schema = "trued.recording/1"\nmeasuring_frame = "base"\n{sigma}\n')
    day = EVERY_DAYS * visit
    when = datetime.datetime(2025, 1, 1, 6) + datetime.timedelta(days=day)
    return ["[[recording]]", f'robot = "{robot}"', f'files = ["{stem}.csv"]', f'recorded_at = "{when.isoformat()}Z"']


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--robots", type=int, default=4)
    parser.add_argument("--visits", type=int, default=50, help="recordings of each robot")
    parser.add_argument("--robot", default="R3", help="the one that wears")
    parser.add_argument("--joint", type=int, default=2, help="its worn joint")
    parser.add_argument("--onset", type=int, default=20, help="recordings before the first that is worn")
    parser.add_argument("--growth-mrad", type=float, default=0.02, help="play that each recording adds")
    parser.add_argument("--play-mrad", type=float, default=0.0, help="play before")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    rng = random.Random(asked.seed)
    asked.folder.mkdir(parents=True, exist_ok=True)
    (asked.folder / "nominal.toml").write_text(model())
    names = [f"R{number}" for number in range(1, asked.robots + 1)]
    manifest = ['schema = "trued.manifest/1"', "seed = 1"]
    for name in names:
        manifest += ["[[robot]]", f'name = "{name}"', 'model = "nominal.toml"']
    for name in names:
        offsets = [rng.choice([0.0, 1.0]) * rng.gauss(0, OFFSET_RAD) for _ in CHAIN]
        for visit in range(asked.visits):
            worn = max(0, visit - asked.onset + 1) if name == asked.robot else 0
            play = (asked.play_mrad + worn * asked.growth_mrad) * 1e-3
            manifest += write(asked.folder, name, visit, recording(rng, offsets, play, asked.joint - 1))
    (asked.folder / "fleet.toml").write_text("\n".join(manifest) + "\n")


main()
