"""Bench trial inside one frequency band, and the samples where friction may hold its load.

Both records pass the same Gaussian low-pass; the friction's sign passes it too.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, binary_opening

from jointz.identify.bench.bench_records import EvenRecord

#: Standard deviation of the Gaussian low-pass in frequency, Hz (-3 dB at 0.83 of it), and the
#: largest share of the sampling rate it may take.
BAND_HZ = 40.0
_BAND_SHARE = 0.1
#: The direction of motion is read from a wider band: a reversal is sharp.
_SPEED_BAND = 2.25
#: Below this share of the RMS speed friction may hold the load: its torque is then unknown.
_SLOW_SHARE = 0.08
#: The direction must be this many sds of the speed's noise above it.
_SLOW_NOISE = 6.0
_SIGN_SHARE = 0.25  # of the slow speed: width of the smoothed sign
#: A fast reversal is slow for less than this, s, and its friction is known.
_SHORTEST_STICK_S = 0.003
#: Reach of the filter, in sds of its kernel: beside a stick, and at an end of the record.
_REACH = 4.0
_EDGE_REACH = 8.0
_EDGE_S = 0.01  # for the lag


@dataclass(frozen=True, slots=True)
class BandRecord:
    """A trial inside the band, ready for the regression."""

    omega: np.ndarray  # (f,) rad/s: angular frequencies of the spectra
    window: np.ndarray  # (f,) gain of the low-pass
    angle: np.ndarray  # (f,) spectrum of the angle, unfiltered, rad
    direction: np.ndarray  # (f,) spectrum of the sign of the velocity, unfiltered
    torque: np.ndarray  # (n,) measured torque, filtered, N*m
    inside: np.ndarray  # (n,) bool: samples away from the ends
    keep: np.ndarray  # (n,) bool: samples of ``inside`` that the fit takes
    angle_noise_sd: float  # rad: sd of the white noise of the angle
    torque_noise_nm2: float  # N^2*m^2: variance of the torque's white noise after the filter
    step_s: float  # time between samples


def band_hz(step_s: float) -> float:
    """Return the standard deviation of the Gaussian low-pass, Hz."""
    return min(BAND_HZ, _BAND_SHARE / step_s)


def band_record(record: EvenRecord, *, friction: bool) -> BandRecord:
    """Return a trial's spectra, filtered torque and usable samples."""
    n, band = record.angle.size, band_hz(record.step_s)
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, record.step_s)
    window = np.exp(-0.5 * (omega / (2.0 * np.pi * band)) ** 2)
    angle = np.fft.rfft(record.angle - record.angle.mean())
    torque = np.fft.irfft(window * np.fft.rfft(record.torque - record.torque.mean()), n)
    noise = record.noise_sd(record.angle)
    kernel_s = 1.0 / (2.0 * np.pi * band)
    inside = np.zeros(n, dtype=bool)
    edge = int(np.ceil((_EDGE_REACH * kernel_s + _EDGE_S) / record.step_s))
    inside[edge : n - edge] = True
    keep = inside.copy()
    direction = np.zeros_like(angle)
    if friction:
        speed_window = np.exp(-0.5 * (omega / (2.0 * np.pi * band * _SPEED_BAND)) ** 2)
        velocity = np.fft.irfft(1j * omega * speed_window * angle, n)
        noise_gain = np.sqrt(np.mean((omega * speed_window) ** 2))
        slow = max(_SLOW_SHARE * float(np.std(velocity)), _SLOW_NOISE * noise * float(noise_gain))
        direction = np.fft.rfft(np.tanh(velocity / (_SIGN_SHARE * slow)))
        keep &= ~_may_stick(np.abs(velocity) < slow, record.step_s, kernel_s)
    passed = float(np.mean(window**2)) * record.noise_sd(record.torque) ** 2
    return BandRecord(
        omega, window, angle, direction, torque, inside, keep, noise, passed, record.step_s
    )


def _may_stick(slow: np.ndarray, step_s: float, kernel_s: float) -> np.ndarray:
    """Return the samples that lasting sticks reach through the filter."""
    shortest = max(1, round(_SHORTEST_STICK_S / step_s))
    reach = int(np.ceil(_REACH * kernel_s / step_s))
    sticks = binary_opening(slow, np.ones(shortest, dtype=bool))
    return np.asarray(binary_dilation(sticks, np.ones(2 * reach + 1, dtype=bool)))
