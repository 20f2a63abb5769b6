"""
Trap 13: is that the bandwidth or the window?
=============================================

A spectral window of T seconds cannot see anything narrower than about 1/T. With MATLAB's default
of 30 lags at 1 kHz that is 33 Hz, and a torque loop of 10 Hz reads as one of more than twice as
much. Of the published bandwidths, 17 and 27 Hz, the second may be such a reading.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import butter, lfilter

import jointz
from jointz.core.errors import EstimationError

RATE = 1000.0

# %%
# First-order loops of known bandwidth, 30 s of white noise each. The naive reading: smooth the
# spectra with 30 lags under a Hann window, as ``spa`` does, and see where the gain has lost 3 dB.


def naive_reading(command, torque, lags=30):
    """Return the -3 dB frequency from correlations of few lags, as Blackman and Tukey."""
    n = command.size
    gain_at = np.fft.rfftfreq(8192, 1 / RATE)
    spectra = []
    for other in (torque, command):
        full = np.fft.irfft(np.fft.rfft(other, 2 * n) * np.conj(np.fft.rfft(command, 2 * n)), 2 * n)
        kept = np.concatenate([full[: lags + 1], np.zeros(8192 - 2 * lags - 1), full[-lags:]])
        taper = np.hanning(2 * lags + 1)
        kept[: lags + 1] *= taper[lags:]
        kept[-lags:] *= taper[:lags]
        spectra.append(np.fft.rfft(kept))
    gain = np.abs(spectra[0] / spectra[1])
    return gain_at[np.argmax(gain < gain[0] / np.sqrt(2))]


truths = np.array([1.0, 5.0, 10.0, 17.2, 26.8, 40.0])
naive, ours, refused = [], [], []
for truth in truths:
    command = np.random.default_rng(13).standard_normal(30_000)
    torque = lfilter(*butter(1, truth, fs=RATE), command)
    naive.append(naive_reading(command, torque))
    ours.append(
        jointz.identify_bandwidth(command=command, torque=torque, rate_hz=RATE).bandwidth_hz
    )
    try:
        jointz.identify_bandwidth(
            command=command,
            torque=torque,
            rate_hz=RATE,
            method="blackman_tukey",
            window_s=0.03,
        )
        refused.append(False)
    except EstimationError as problem:
        refused.append(True)
        print(f"{truth:4.1f} Hz with 30 lags: refused ({problem.code})")

figure, axes = plt.subplots()
axes.plot(truths, naive, "s-", color="C3", label="30 lags, read off")
axes.plot(truths, ours, "o-", color="C0", label="identify_bandwidth")
axes.axline((0, 0), slope=1, color="0.5", linestyle=":")
axes.set(xlabel="True bandwidth (Hz)", ylabel="Reading (Hz)", xlim=(0, None), ylim=(0, None))
axes.legend()
print("read off with 30 lags:", np.round(naive, 1), "Hz; here:", np.round(ours, 1), "Hz")

# %%
# The short window reads every loop as a fast one, and none below about 20 Hz: a reading of 27 Hz
# may be a loop of half of it, one of 17 Hz cannot come from this window.
# :func:`jointz.identify_bandwidth` chooses its window by the bandwidth it finds, states its
# resolution, and refuses what lies below.
