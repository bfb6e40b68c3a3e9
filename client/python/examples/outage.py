"""What a loop is told when the daemon goes, comes back, is another one, or may not be joined; and that it goes on.

python outage.py CELL [SECONDS]: prints each change.
"""

import sys
import time

import trued


def main(cell: str = "cell-1", seconds: str = "60") -> None:
    end = time.monotonic() + float(seconds)
    q_cmd = [0.0, -0.5, 0.7, 0.0, 0.4, 0.0]
    client = None
    said = None
    while time.monotonic() < end:
        told, words = "ok", ""
        try:
            if client is None:
                client = trued.Client(cell, timeout=0.2)
            client.send(q_cmd)
        except trued.TruedError as error:
            told, words = error.kind, str(error)
        if client is not None:
            client.target_for(q_cmd)  # whatever is said: there is always something to publish
        if told != said:
            print(f"{told}: {words}", flush=True)
            said = told
        time.sleep(0.001)


if __name__ == "__main__":
    main(*sys.argv[1:])
