"""Writes the reference numbers of SciPy and pyFRF that tests/reference.rs compares with.

    python3 -m venv venv && venv/bin/pip install scipy==1.17.1 pyFRF==1.5.0
    venv/bin/python spectrum/tests/reference/make.py

Each line is a name and its numbers; complex spectra are two lines, .re and .im.
"""

from pathlib import Path

import numpy as np
import scipy.signal as sig
from pyFRF import FRF

HERE = Path(__file__).parent
RATE = 1000.0


def write(path, rows):
    with open(HERE / path, "w", encoding="ascii") as out:
        for name, values in rows:
            values = np.asarray(values)
            if np.iscomplexobj(values):
                parts = [(name + ".re", values.real), (name + ".im", values.imag)]
            else:
                parts = [(name, values)]
            for part, numbers in parts:
                out.write(part + " " + " ".join(repr(float(v)) for v in numbers) + "\n")


def spectra():
    rng = np.random.default_rng(3)
    n = 250
    t = np.arange(n) / RATE
    x = np.round(3 * np.sin(2 * np.pi * 72 * t) + 40 * t + rng.normal(size=n) + 5, 6)
    y = np.round(0.6 * np.roll(x, 3) + np.cos(2 * np.pi * 130 * t) + rng.normal(size=n), 6)
    rows = [("x", x), ("y", y)]
    rows.append(("detrend_linear", sig.detrend(x, type="linear")))
    rows.append(("detrend_constant", sig.detrend(x, type="constant")))
    rows.append(("welch_default", sig.welch(x, RATE, nperseg=64)[1]))
    rows.append(("welch_linear_spectrum", sig.welch(x, RATE, nperseg=64, noverlap=48, detrend="linear", scaling="spectrum")[1]))
    rows.append(("welch_odd", sig.welch(x, RATE, nperseg=45, noverlap=10, detrend=False)[1]))
    rows.append(("welch_boxcar", sig.welch(x, RATE, window="boxcar", nperseg=64, noverlap=0)[1]))
    rows.append(("welch_frequency", sig.welch(x, RATE, nperseg=64)[0]))
    rows.append(("csd", sig.csd(x, y, RATE, nperseg=64)[1]))
    rows.append(("csd_linear", sig.csd(x, y, RATE, nperseg=64, noverlap=16, detrend="linear")[1]))
    rows.append(("coherence", sig.coherence(x, y, RATE, nperseg=64)[1]))
    write("scipy.txt", rows)


def response_functions():
    rng = np.random.default_rng(5)
    n, hits = 128, 4
    t = np.arange(n) / RATE
    force = np.round(np.array([np.exp(-(((t - 0.004) / 0.0015) ** 2)) * (80 + 20 * k) for k in range(hits)]), 6)
    mode = np.exp(-0.05 * 2 * np.pi * 120 * t) * np.sin(2 * np.pi * 120 * t)
    clean = np.array([np.convolve(f, mode)[:n] for f in force])
    accel = np.round(clean + 0.3 * rng.normal(size=clean.shape), 6)
    tools = {}
    for estimator in ("H1", "H2"):
        frf = FRF(int(RATE), exc_type="f", resp_type="a", window="none", weighting="linear", fft_len=n, nperseg=n, noverlap=0, frf_estimator=estimator)
        for f, a in zip(force, accel):
            frf.add_data(f, a)
        tools[estimator] = frf
    rows = [(f"force{k}", force[k]) for k in range(hits)] + [(f"response{k}", accel[k]) for k in range(hits)]
    for estimator, frf in tools.items():
        rows.append((estimator, np.asarray(frf.get_FRF(frf_estimator=estimator, frf_form="accelerance")).ravel()))
    rows.append(("receptance", np.asarray(tools["H1"].get_FRF(frf_estimator="H1", frf_form="receptance")).ravel()[1:]))
    rows.append(("coherence", np.asarray(tools["H1"].get_coherence()).ravel()))
    write("pyfrf.txt", rows)


spectra()
response_functions()
