"""A batch diagnosis as tasks of Ray: `python diagnose.py MANIFEST DIR SHARDS`.

Each task starts the program `trued` (the environment variable TRUED, or the one on PATH) for one shard: the Python package holds the client of the daemon,
not the diagnosis. A task that dies with its machine is started again and goes on where it ended. DIR must be a folder that all machines share.
"""

import os
import subprocess
import sys

import ray


@ray.remote(num_cpus=1, max_retries=3, retry_exceptions=True)
def diagnose(manifest: str, folder: str, shard: str) -> int:
    command = [os.environ.get("TRUED", "trued"), "diagnose", "--batch", manifest, "--out", folder]
    done = subprocess.run(command + ["--shard", shard, "--resume", "--threads", "1"])
    # 1: done, and some recordings were refused; their results say why.
    if done.returncode > 1 or done.returncode < 0:
        raise RuntimeError(f"shard {shard}: exit code {done.returncode}")
    return done.returncode


def main() -> int:
    manifest, folder, shards = sys.argv[1], sys.argv[2], int(sys.argv[3])
    manifest, folder = os.path.abspath(manifest), os.path.abspath(folder)
    ray.init(runtime_env={"env_vars": {"TRUED": os.environ.get("TRUED", "trued")}})
    tasks = [diagnose.remote(manifest, folder, f"{k}/{shards}") for k in range(1, shards + 1)]
    return max(ray.get(tasks))


if __name__ == "__main__":
    sys.exit(main())
