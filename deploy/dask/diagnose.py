"""A batch diagnosis as tasks of Dask: `python diagnose.py MANIFEST DIR SHARDS [SCHEDULER]`.

Each task starts the program `trued` (the environment variable TRUED, or the one on PATH) for one shard: the Python package holds the client of the daemon,
not the diagnosis. Without SCHEDULER (as `tcp://host:8786`) the workers are those of this machine. DIR must be a folder that all workers share.
"""

import os
import subprocess
import sys

from dask.distributed import Client


def diagnose(shard: str, manifest: str, folder: str, program: str) -> int:
    command = [program, "diagnose", "--batch", manifest, "--out", folder]
    done = subprocess.run(command + ["--shard", shard, "--resume", "--threads", "1"])
    # 1: done, and some recordings were refused; their results say why.
    if done.returncode > 1 or done.returncode < 0:
        raise RuntimeError(f"shard {shard}: exit code {done.returncode}")
    return done.returncode


def main() -> int:
    manifest, folder, shards = sys.argv[1], sys.argv[2], int(sys.argv[3])
    manifest, folder = os.path.abspath(manifest), os.path.abspath(folder)
    program = os.environ.get("TRUED", "trued")
    cluster = {"address": sys.argv[4]} if len(sys.argv) > 4 else {"threads_per_worker": 1}
    with Client(**cluster) as client:
        every = [f"{k}/{shards}" for k in range(1, shards + 1)]
        files = {"manifest": manifest, "folder": folder, "program": program}
        tasks = client.map(diagnose, every, **files, pure=False, retries=3)
        return max(client.gather(tasks))


if __name__ == "__main__":
    sys.exit(main())
