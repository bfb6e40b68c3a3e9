"""Time of `trued spectrum` beside SciPy's short-time Fourier transform, by turns: `stft.py TRUED [SECONDS]`. Needs numpy, scipy and soundfile.

Makes a WAV file of six channels at 50 kHz, 16 bits per sample, 600 s unless SECONDS says otherwise: noise, tooth passing, two stretches of chatter. SciPy's side reads it by
soundfile and computes `scipy.signal.stft` of each channel with segments of 4096 samples. Prints each pair and the medians: elapsed time, s.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time

import numpy
import scipy.signal
import soundfile

TRUED = sys.argv[1]
SECONDS = int(sys.argv[2]) if len(sys.argv) > 2 else 600
PAIRS = 3
RATE_HZ = 50_000
SEGMENT = 4096
# Amplitude of each channel relative to the first.
CHANNELS = numpy.array([1.0, 0.8, 0.5, 0.2, 0.1, 0.05])


def write(path):
    """The recording, second by second."""
    random = numpy.random.default_rng(1)
    with soundfile.SoundFile(path, "w", RATE_HZ, len(CHANNELS), "PCM_16") as file:
        for second in range(SECONDS):
            t_s = second + numpy.arange(RATE_HZ) / RATE_HZ
            cuts = 0.01 * SECONDS < second < 0.99 * SECONDS
            chatters = any(begin * SECONDS <= second < (begin + 0.03) * SECONDS for begin in (0.2, 0.5))
            tones = [(0.2 * cuts, 400.0), (0.05 * cuts, 800.0), (0.1 * (cuts and chatters), 72.3)]
            wave = sum(amplitude * numpy.sin(2 * numpy.pi * hz * t_s) for amplitude, hz in tones)
            noise = 0.01 * random.standard_normal((RATE_HZ, len(CHANNELS)))
            file.write(noise + wave[:, None] * CHANNELS)


def timed(work):
    """Elapsed time, s."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def scipy_side(path):
    """Elapsed times of reading and of the transforms, s."""
    held = []
    reading = timed(lambda: held.append(soundfile.read(path)))
    samples, rate_hz = held[0]
    transforms = timed(
        lambda: [scipy.signal.stft(channel, rate_hz, nperseg=SEGMENT) for channel in samples.T]
    )
    return reading, transforms


with tempfile.TemporaryDirectory() as folder:
    wav = os.path.join(folder, "six.wav")
    write(wav)
    pairs = []
    for _ in range(PAIRS):
        command = [TRUED, "spectrum", "-q", wav]
        trued = timed(lambda: subprocess.run(command, stdout=subprocess.DEVNULL, check=False))
        pairs.append((trued, *scipy_side(wav)))
        print("trued {:.2f} s; reading {:.2f} s, stft {:.2f} s".format(*pairs[-1]), flush=True)
    trued, reading, transforms = (statistics.median(times) for times in zip(*pairs))
    print(f"medians: trued {trued:.2f} s; reading and stft {reading + transforms:.2f} s, stft {transforms:.2f} s")
