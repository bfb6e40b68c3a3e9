#!/usr/bin/env python3
"""Writes the seeds of the shared-memory targets: messages as a sound client sends them, by the offsets of shm-schema/tests/layout.rs."""
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
    (HERE / target / name).write_bytes(data)


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
current = "trued.current/1\ncontract 3\nlayout de7cb6dd56dab584\ntransport 0.10.0\nprogram 0.1.0\nepoch 0000000000000abc\npid 42\n"
write("messages", "current", b"\x06" + current.encode())
