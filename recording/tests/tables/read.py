"""Columns of tables as pandas reads them, and orientations as scipy makes them: one JSON object per line in and out."""

import json
import sys
import warnings

import pandas
from scipy.spatial.transform import Rotation

# pandas 3 calls the option that reads decimals exactly a thing of the past, and offers no other.
warnings.simplefilter("ignore")


def table(job):
    frame = pandas.read_csv(
        job["file"],
        sep=job["separator"],
        decimal=job["decimal"],
        thousands=job["thousands"],
        skiprows=job["skip"],
        encoding="utf-8-sig",
        float_precision="round_trip",
        dtype={"t_s": str} if job["clock"] else None,
    )
    if job["clock"]:
        stamps = pandas.to_datetime(frame["t_s"], format=job["clock"])
        nanoseconds = (stamps - stamps[0]).astype("timedelta64[ns]").astype("int64")
        frame["t_s"] = nanoseconds / 1e9
    return [frame[name].astype(float).tolist() for name in ("t_s", "q1_deg", "x_mm")]


def orientation(job):
    convention, numbers = job["convention"], job["numbers"]
    if convention == "rotation_vector":
        rotation = Rotation.from_rotvec(numbers, degrees=True)
    else:
        rotation = Rotation.from_euler(convention, numbers, degrees=True)
    return rotation.as_matrix().ravel().tolist()


for line in sys.stdin:
    job = json.loads(line)
    print(json.dumps(table(job) if "file" in job else orientation(job)))
