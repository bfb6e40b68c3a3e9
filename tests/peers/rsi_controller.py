"""A KUKA controller by RSIPI's EchoServer: it owns the clock, judges every answer, and adds up the corrections.

usage: rsi_controller.py CONFIG.xml CYCLES PID_OF_THE_BRIDGE
The server waits for an answer as long as it takes (the machine is shared); what is judged is what the answer holds. The
last part runs in real time, with faults. Says on standard output `name value` lines.
"""

import errno
import os
import signal
import socket
import sys
import time

from RSIPI.rsi_echo_server import EchoServer

AXES = ["A1", "A2", "A3", "A4", "A5", "A6"]
START = [10.0, 15.0, -10.0, 15.0, 45.0, 5.0]
STEP = 0.0005
STANDING = 800


def program(server, cycle, cycles):
    """The robot's own program: a slow motion of all axes, then a rest. What is corrected stands on top of it."""
    for axis, start in zip(AXES, START):
        correction = server.state["AIPos"][axis] - server.base_pose["AIPos"][axis]
        at = start + STEP * min(cycle, cycles - STANDING)
        server.base_pose["AIPos"][axis] = at
        server.state["AIPos"][axis] = server.state["ASPos"][axis] = at + correction


def corrections(server):
    return [server.state["AIPos"][axis] - server.base_pose["AIPos"][axis] for axis in AXES]


class Jumps:
    """The largest change of a correction from one cycle to the next."""

    def __init__(self, server):
        self.before, self.largest = corrections(server), 0.0

    def look(self, server):
        now = corrections(server)
        self.largest = max([self.largest] + [abs(a - b) for a, b in zip(now, self.before)])
        self.before = now


def say(name, *values):
    print(name, *values, flush=True)


def cycle_of(server):
    server.send_once()
    accepted = server.receive_and_process()
    if accepted is not True:
        server._apply_holdon_late_cycle()
    return accepted


def controller(config):
    """The emulator. Its port is fixed (50000) and in the range that sockets of others get by chance, so another program may have it for a while."""
    for _ in range(100):
        try:
            return EchoServer(config, delay_ms=4, mode="absolute", timeout_packets=1000)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            time.sleep(0.2)
    sys.exit("port 50000 stays in use")


def main(config, cycles, bridge):
    server = controller(config)
    for name in ("AIPos", "ASPos"):
        for axis, start in zip(AXES, START):
            server.state[name][axis] = server.base_pose[name][axis] = start
    server.delay_ms = 10.0
    jumps, accepted = Jumps(server), 0
    for cycle in range(cycles):
        program(server, cycle, cycles)
        accepted += cycle_of(server) is True
        jumps.look(server)
        if accepted <= cycle - 20:
            sys.exit(f"cycle {cycle}: no answers")
    say("accepted", accepted)
    say("faulty", server.faulty_packets)
    say("largest_jump", repr(jumps.largest))
    say("setpoint", *[f"{server.base_pose['AIPos'][axis]:.9f}" for axis in AXES])
    say("correction", *[repr(value) for value in corrections(server)])
    faults(server, bridge, Jumps(server))


def faults(server, bridge, jumps):
    # What is no telegram, and the same telegram twice: neither is answered.
    server.udp_socket.sendto(b"<Rob Type=\"KUKA\"><ASPos A1=", server.client_address)
    server.udp_socket.sendto(b"\x00\xff", server.client_address)
    text = server.send_once()
    server.udp_socket.sendto(text.encode(), server.client_address)
    say("twice_accepted", int(server.receive_and_process() is True))
    # What comes from elsewhere is not heard.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.2", 0))
        other.setblocking(False)
        other.sendto(text.encode(), server.client_address)
        for _ in range(20):
            cycle_of(server)
        try:
            other.recvfrom(4096)
            say("foreign_answered", 1)
        except BlockingIOError:
            say("foreign_answered", 0)
    accepted = sum(cycle_of(server) is True for _ in range(50))
    say("after_garbage_accepted", accepted)
    say("after_garbage_faulty", server.faulty_packets)
    # The bridge stands still for some cycles in real time: late by the controller's count, and no jump.
    server.delay_ms = 0.004
    os.kill(bridge, signal.SIGSTOP)
    for _ in range(8):
        cycle_of(server)
        jumps.look(server)
    os.kill(bridge, signal.SIGCONT)
    server.delay_ms = 10.0
    accepted = 0
    for _ in range(200):
        accepted += cycle_of(server) is True
        jumps.look(server)
        time.sleep(0.001)
    say("late_faulty", server.faulty_packets)
    say("late_accepted", accepted)
    say("late_jump", repr(jumps.largest))
    # The bridge dies: the controller holds the last correction (HOLDON = 1).
    stood = corrections(server)
    os.kill(bridge, signal.SIGKILL)
    server.delay_ms = 0.004
    for _ in range(100):
        cycle_of(server)
        jumps.look(server)
    say("dead_jump", repr(max(abs(a - b) for a, b in zip(stood, corrections(server)))))
    say("running", int(server.running))


main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
