#!/usr/bin/env python3
"""Writes the seeds that are messages: of shared memory as a sound client sends them, by the offsets of shm-schema/tests/layout.rs; of bridges and their configurations; answers and requests in JSON."""
import json
import pathlib
import struct

HERE = pathlib.Path(__file__).parent / "seeds"


def command(seq, q, flags=0, wrench=(0.0,) * 6, session=7):
    t_ns = seq * 1_000_000
    head = struct.pack("=QQQQIII16bI", seq, session, t_ns, t_ns, 1, 6, flags, *[0] * 16, 0)
    joints = struct.pack("=16d", *q, *[0.0] * 10)
    return head + joints + struct.pack("=6d", *wrench) + struct.pack("=17d", *[20.0] * 17)


def force(seq, samples):
    count = len(samples)
    head = struct.pack("=QQQQQdIIII", seq, 7, seq * 10_000_000, 0, (seq - 1) * count, 1000.0, 1, 3, count, 0)
    data = [x * scale for scale in (1.0, 0.5, -0.2) for x in samples]
    return head + struct.pack(f"={len(data)}d", *data)


def write(target, name, data):
    (HERE / target).mkdir(exist_ok=True)
    (HERE / target / name).write_bytes(data)


def varint(number):
    low, rest = number & 0x7F, number >> 7
    return bytes([low | 0x80]) + varint(rest) if rest else bytes([low])


def field(number, value):
    """One field of a Protocol Buffers message: a number, a double, or bytes."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    if isinstance(value, float):
        return varint(number << 3 | 1) + struct.pack("<d", value)
    return varint(number << 3 | 2) + varint(len(value)) + value


def header(seqno, mtype):
    return field(1, field(1, seqno) + field(2, 4 * seqno) + field(3, mtype))


def joints(q, packed):
    return field(1, struct.pack(f"<{len(q)}d", *q)) if packed else b"".join(field(1, x) for x in q)


def telegram(axes, late, ipoc):
    names = " ".join(f'A{i}="{a}"' for i, a in enumerate(axes, 1))
    return f'<Rob Type="KUKA"><AIPos {names} /><ASPos {names} /><Delay D="{late}" /><IPOC>{ipoc}</IPOC></Rob>'.encode()


def swapped(text, *pairs):
    """The last of each, replaced; all must be there."""
    for old, new in pairs:
        before, after = text.rsplit(old, 1)
        text = before + new + after
    return text


path = [command(n, [0.1 + 1e-4 * n, -0.3, 0.2, 0.4, 0.9, 0.1]) for n in range(1, 9)]
write("commands", "path", b"".join(path))
cut = [command(n, [0.2, 0.1 + 1e-4 * n, 0.1, -0.4, 0.8, 0.3], 1, (80.0, -20.0, 10.0, 0.1, 0.2, 0.3)) for n in range(1, 5)]
write("commands", "cut", b"".join(cut))
write("commands", "anew", path[0] + path[2] + path[1] + command(1, [0.1, -0.3, 0.2, 0.4, 0.9, 0.1], session=8))
# One block is cut short: what is missing is filled up with zeros.
write("force", "block", force(1, [0.1 * (n % 7) for n in range(10)]))
write("force", "flat", force(3, [5.0] * 40))
sizes = {"state": (0, 440, 32), "request": (1, 512, 208), "response": (2, 288, 24), "verdict": (3, 160, 112), "status": (4, 1608, 224), "corrected": (5, 736, 56)}
versions = {"request": 3, "verdict": 2, "status": 3}
for name, (kind, size, layout) in sizes.items():
    data = bytearray(size)
    struct.pack_into("=II", data, layout, versions.get(name, 1), 6)
    write("messages", name, bytes([kind]) + bytes(data))
# Two points; the others, which are not set, are filled up with zeros.
horizon = struct.pack("=4Q2I32d", 1, 7, 2, 4, 1, 2, *(0.1 * i for i in range(32)))
write("messages", "horizon", b"\x08" + horizon)
current = "trued.current/1\ncontract 3\nlayout de7cb6dd56dab584\ntransport 0.10.0\nprogram 0.1.0\nepoch 0000000000000abc\npid 42\n"
write("messages", "current", b"\x06" + current.encode())
q = [10.0, 15.0, -10.0, 15.0, 45.0, 5.0]
postures = {False: field(1, joints(q, False)), True: field(1, joints(q, True)) + field(3, joints([7.0], True))}
force = field(1, 1) + field(2, struct.pack("<6d", 1, -2, 30, 0.1, 0.2, 0.3))
for name, posture in zip(("robot", "seven"), postures.values()):
    write("egm", name, b"\0" + header(7, 2) + field(2, posture) + field(3, posture) + field(5, field(1, 3)) + field(9, force))
    write("egm", f"{name}_target", b"\1" + header(7, 3) + field(2, posture))
offset = field(1, b"".join(field(i, x) for i, x in enumerate((0.0, 0.5, -0.25), 1))) + field(2, 48)
write("egm", "path", b"\2" + header(9, 4) + field(2, offset))
write("rsi", "telegram", telegram(q, 0, 123456))
write("rsi", "late", telegram([f"{x:.2f}" for x in q], 3, "0004208163635"))
deploy = HERE.parent.parent / "deploy"
rsi, xml = ((deploy / name).read_text() for name in ("bridge-rsi.toml", "rsi-ethernet.xml"))
bridge = lambda name, toml, xml: write("bridge", name, f"{toml}\f{xml}".encode())
bridge("axes", rsi, xml)
six = 'names = ["A1", "A2", "A3", "A4", "A5", "A6"]'
pose = swapped(rsi, ('"axes" ', '"pose" '), ('"AKorr"', '"RKorr"'), ("# frame", "frame"), (six, 'names = ["X", "Y", "Z", "A", "B", "C"]'))
corrections = [(f"AKorr.A{axis}", f"RKorr.{name}") for axis, name in enumerate("XYZABC", 1)]
bridge("pose", pose, swapped(xml, *corrections))
# Once accepted, though no answer went out, none that the controller could read, or not every joint's correction.
bridge("one_attribute_for_two_joints", swapped(rsi, (six, six.replace("A2", "A1"))), xml.replace("AKorr.A2", "FREE"))
constants = [f"Di{k}" for k in range(60)]
elements = "".join(f'<ELEMENT TAG="{tag}" TYPE="DOUBLE" INDX="8" HOLDON="1" />\n' for tag in constants)
others = "\n".join(f"{tag} = 1e308" for tag in constants)
bridge("constants_of_three_hundred_digits", f"{rsi}{others}\n", swapped(xml, ("</ELEMENTS>", elements + "</ELEMENTS>")))
bridge("a_clock_of_the_sites_own", rsi.replace("DiO", "IPOC"), xml.replace("DiO", "IPOC"))
bridge("a_tag_longer_than_a_datagram", rsi.replace("DiO", "D" * 20_000), xml.replace("DiO", "D" * 20_000))
finding = {
    "effect": "backlash", "joint": 3, "change": "new", "confidence": 0.9,
    "parameters": {"width_mrad": {"value": 0.41, "ci95": [0.38, 0.44]}, "by_pose": {"value": [0.1, 0.2], "ci95": [[0, 0.2], [0.1, 0.3]]}},
    "alternatives": [{"effect": "hysteresis", "joint": 3}],
}
body = {"domain": "position", "verdict": "missing_physics", "findings": [finding], "unexplained": {"depends_on": ["q2", "v3"]}}
torque = {"domain": "torque", "verdict": "consistent", "findings": []}
for name, more in {"one": body, "several": {"domains": [torque, body]}, "none": torque}.items():
    write("answer", name, json.dumps({"schema": "trued.diagnosis/1", **more}, indent=1).encode())
for name, wanted in {"tour": "tour, hanging load", "joint": "joint 2 alone", "warm": "warm-up"}.items():
    asked = {"name": wanted, "expected_separation": 12.5, "measure": ["x", "y", "z"]}
    write("request", name, json.dumps({"next_experiment": "do it", "experiment": asked}, indent=1).encode())
write("request", "nothing", b'{"next_experiment": null, "experiment": null}')
