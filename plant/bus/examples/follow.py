"""Follow a cell over Zenoh so that every message is seen once and in order: `follow.py ENDPOINT GROUP/CELL FILE`.

Appends one line `STREAM NUMBER KIND` to FILE for each message and goes on where FILE ends. Uses the public package `eclipse-zenoh` alone. Messages that were missed, because this program, the
bridge or the network was down, are requested at the key `history` as soon as a number reveals the gap.
"""

import json
import os
import queue
import sys

import zenoh

endpoint, cell, path = sys.argv[1:4]
prefix = f"trued/{cell}"

# Where the file ends is where this goes on.
stream, following = None, 0
if os.path.exists(path) and (lines := open(path, encoding="utf-8").read().splitlines()):
    stream, following = int(lines[-1].split()[0]), int(lines[-1].split()[1]) + 1
kept = open(path, "a", encoding="utf-8")


def keep(message):
    """Notes a message; its number is the one that follows."""
    global following
    kept.write(f"{message['stream']} {message['number']} {message['kind']}\n")
    kept.flush()
    following = message["number"] + 1


def catch_up(session):
    """Asks for all that was missed, page by page."""
    global stream, following
    while True:
        of = "" if stream is None else f";stream={stream}"
        for reply in session.get(f"{prefix}/history?from={following}{of}", timeout=2.0):
            if reply.ok is not None:
                history = json.loads(bytes(reply.ok.payload))
                break
        else:
            return  # nobody answers; the next message tries again
        if history["stream"] != stream:
            # The spool was lost, or damaged at its end; what is kept of the former stream was received.
            stream, following = history["stream"], history["from"]
        if history["from"] > following:
            print(f"lost: {following} to {history['from'] - 1}, fell out of the budget", flush=True)
        for message in history["messages"]:
            keep(message)
        if following >= history["next"] or not history["messages"]:
            return


config = zenoh.Config()
config.insert_json5("mode", '"peer"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
config.insert_json5("listen/endpoints", "[]")
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config) as session:
    arrived = queue.Queue()
    subscriber = session.declare_subscriber(f"{prefix}/*", lambda sample: arrived.put(bytes(sample.payload)))
    print("ready", flush=True)
    catch_up(session)
    while True:
        message = json.loads(arrived.get())
        if (message["stream"], message["number"]) == (stream, following):
            keep(message)
        elif message["stream"] != stream or message["number"] > following:
            catch_up(session)
