"""Latency of a cell alone and with views attached, by turns: `attached.py TRUED TRUED_PLANT ROBOT_LOOP`.

ROBOT_LOOP is the example `robot_loop` of the client library (10 000 cycles at 1 kHz); a block is three of them with a daemon of its own. Attached are `trued live`, `trued top` in a
terminal and `trued-plant bridge` at 10 Hz. Prints each block and the medians: latency since the start of the daemon at 50, 99, 99.9 % and the largest, µs, and late cycles.
"""

import json
import os
import pty
import statistics
import subprocess
import sys
import tempfile
import threading
import time

TRUED, PLANT, LOOP = sys.argv[1:4]
PAIRS = 5
CELL = 'schema = "trued.cell/1"\ncell = "cell-1"\nmodel = "irb1600-6-145-thesis"\nmode = "full"\n'

folder = tempfile.mkdtemp(dir="/dev/shm")
environment = dict(os.environ, TRUED_RUNTIME_DIR=folder, TERM="xterm", COLUMNS="100", LINES="30")
with open(f"{folder}/cell.toml", "w", encoding="utf-8") as file:
    file.write(CELL)


def start(*words, **pipes):
    """A process whose output nobody reads unless `pipes` say otherwise."""
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **pipes}
    return subprocess.Popen(words, env=environment, **pipes)


def drained(terminal):
    """Reads a terminal until it is closed, as a person's screen would."""
    try:
        while os.read(terminal, 65536):
            pass
    except OSError:
        pass


def views():
    ours, its = pty.openpty()
    threading.Thread(target=drained, args=(ours,), daemon=True).start()
    spool = f"{folder}/spool"
    return [
        start(TRUED, "live", "cell-1", "--listen", "127.0.0.1:18080", "--foxglove", "127.0.0.1:18765"),
        start(TRUED, "top", "cell-1", stdin=its, stdout=its),
        start(PLANT, "bridge", "cell-1", "--spool", spool, "--rate-hz", "10", "--listen", "tcp/127.0.0.1:17448"),
    ]


def block(is_attached):
    daemon = start(TRUED, "run", "--config", f"{folder}/cell.toml")
    time.sleep(2)
    attached = views() if is_attached else []
    time.sleep(1)
    for _ in range(3):
        subprocess.run([LOOP, "cell-1"], env=environment, check=True)
    said = subprocess.run([TRUED, "status", "cell-1", "--json", "-"], env=environment, capture_output=True, text=True, check=True)
    status = json.loads(said.stdout)
    assert all(view.poll() is None for view in attached), "a view ended"
    for process in attached + [daemon]:
        process.terminate()
        process.wait(10)
    latency = status["latency_us"]
    return [latency["p50"], latency["p99"], latency["p999"], latency["max"], status["counts"]["missed_cycles"]]


found = {False: [], True: []}
for pair in range(PAIRS):
    for is_attached in (False, True) if pair % 2 == 0 else (True, False):
        found[is_attached].append(block(is_attached))
        print("attached" if is_attached else "alone", found[is_attached][-1], flush=True)
for is_attached, blocks in found.items():
    medians = [round(statistics.median(column), 1) for column in zip(*blocks)]
    print("medians,", "attached:" if is_attached else "alone:", medians)
