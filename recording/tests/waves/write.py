"""Writes WAV files by soundfile and UFF 58 files by pyuff, and says what these read in them: one JSON object per line in and out."""

import json
import sys

import numpy as np
import pyuff
import soundfile


def signal(job):
    """Shares of full scale, of which some are its ends."""
    values = np.random.default_rng(job["seed"]).uniform(-1.0, 1.0, (job["samples"], job["channels"]))
    values[0], values[1], values[2] = -1.0, 0.0, 1.0 - 2.0**-31
    return values


def texts(values):
    """The shortest that read back to the same bits."""
    return [repr(value) for value in values.astype(float).tolist()]


def wav(job):
    form = dict(format=job["format"], subtype=job["subtype"], endian=job["endian"])
    with soundfile.SoundFile(job["file"], "w", job["rate_hz"], job["channels"], **form) as file:
        file.write(signal(job))
        if job["title"]:
            file.title = job["title"]
    values, rate_hz = soundfile.read(job["file"], dtype="float64", always_2d=True)
    return {"rate_hz": rate_hz, "channels": [texts(channel) for channel in values.T]}


def uff(job):
    steps = np.arange(job["samples"]) / job["rate_hz"]
    file = pyuff.UFF(job["file"])
    for at, values in enumerate(signal(job).T):
        made = pyuff.prepare_58(
            binary=job["binary"],
            func_type=1,
            rsp_node=at + 1,
            rsp_dir=(1, 2, 3, -1, -2, -3)[at % 6],
            ref_node=1,
            ref_dir=-3,
            num_pts=len(values),
            ord_data_type=4 if job["double"] else 2,
            data=values,
            x=steps,
            abscissa_spacing=1,
            abscissa_min=0.0,
            abscissa_inc=1.0 / job["rate_hz"],
            abscissa_spec_data_type=17,
            abscissa_axis_units_lab="s",
            ordinate_spec_data_type=12,
            ordinate_axis_units_lab="m/s^2",
            orddenom_spec_data_type=0,
            orddenom_axis_units_lab="NONE",
        )
        file.write_sets([made], mode="add", force_double=job["double"])
    read = pyuff.UFF(job["file"]).read_sets()
    read = read if isinstance(read, list) else [read]
    return {
        "rate_hz": 1.0 / read[0]["abscissa_inc"],
        "channels": [texts(np.real(one["data"])) for one in read],
    }


for line in sys.stdin:
    task = json.loads(line)
    print(json.dumps(wav(task) if "subtype" in task else uff(task)))
