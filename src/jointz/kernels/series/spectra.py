"""Auto- and cross-spectra of two records, with what they can resolve and how sure they are.

Both estimators smooth: Welch's by averaging segments, Blackman and Tukey's by
cutting off the correlation. What lies closer together than ``resolution_hz`` is
one thing to them. The price of a fine resolution is variance: few averages.
"""

from dataclasses import dataclass

import numpy as np
from scipy import fft

#: Points of the Blackman-Tukey frequency grid in one width of resolution.
_GRID_POINTS = 16
_TINY = np.finfo(float).tiny
#: Probability with which unrelated records stay below the threshold of the coherence.
_COHERENCE_LEVEL = 0.99


@dataclass(frozen=True, slots=True)
class CrossSpectra:
    """One-sided spectral densities of an input and an output.

    ``frequency_hz`` (f,): frequencies, evenly spaced from zero; ``auto_in``, ``auto_out`` (f,):
    densities of input and output, unit^2/Hz; ``cross`` (f,): density of conj(input) * output;
    ``n_averages``: number of independent averages behind each density; ``resolution_hz``:
    equivalent noise bandwidth of the smoothing.
    """

    frequency_hz: np.ndarray
    auto_in: np.ndarray
    auto_out: np.ndarray
    cross: np.ndarray
    n_averages: float
    resolution_hz: float

    @property
    def response(self) -> np.ndarray:
        """Output over input (1.2): (f,) complex; too small where the input is noisy."""
        return np.asarray(self.cross / np.maximum(self.auto_in, _TINY))

    @property
    def coherence(self) -> np.ndarray:
        """Share of the output that is linear in the input, (f,), 0 to 1."""
        product = np.maximum(self.auto_in * self.auto_out, _TINY)
        return np.asarray(np.clip(np.abs(self.cross) ** 2 / product, 0.0, 1.0))

    def relative_sd(self) -> np.ndarray:
        """Return the sd of the gain over the gain, also the sd of the phase in rad.

        Bendat and Piersol 2010, Random Data, 4th ed., 9.90: sqrt((1 - c) / (2 n c)) with coherence
        c. Returns (f,): large, but finite, where nothing is coherent.
        """
        c = np.maximum(self.coherence, 1e-12)
        return np.asarray(np.sqrt((1.0 - c) / (2.0 * self.n_averages * c)))


def coherence_threshold(n_averages: float) -> float:
    """Return the coherence that unrelated records exceed with a probability of 1 %.

    For one frequency, ``n_averages`` independent averages: 1 - 0.01^(1/(n - 1)). Carter,
    Knapp and Nuttall 1973, doi:10.1109/TAU.1973.1162496.
    """
    if n_averages <= 1.0:
        return 1.0
    return float(1.0 - (1.0 - _COHERENCE_LEVEL) ** (1.0 / (n_averages - 1.0)))


def welch(x: np.ndarray, y: np.ndarray, *, rate_hz: float, window_s: float) -> CrossSpectra:
    """Return spectra by averaging half-overlapping segments under a Hann window.

    ``x``, ``y`` (n,): input and output; ``rate_hz``: sampling rate; ``window_s``: length of a
    segment. Returns densities at multiples of 1/window_s. Welch 1967, doi:10.1109/TAU.1967.1161901.
    """
    x, y = _checked(x, y, rate_hz)
    length = round(window_s * rate_hz)
    if not 4 <= length <= x.size:
        raise ValueError(
            f"welch: expected a window of 4 to {x.size} samples, got {length} ({window_s:g} s at "
            f"{rate_hz:g} Hz)"
        )
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    hop = max(1, length // 2)
    X, Y = (
        fft.rfft(np.lib.stride_tricks.sliding_window_view(z - z.mean(), length)[::hop] * taper)
        for z in (x, y)
    )
    count = X.shape[0]
    scale = 2.0 / (rate_hz * float(taper @ taper) * count)
    overlap = float(taper[hop:] @ taper[: length - hop]) / float(taper @ taper)
    return CrossSpectra(
        frequency_hz=fft.rfftfreq(length, 1.0 / rate_hz),
        auto_in=scale * np.sum(np.abs(X) ** 2, axis=0),
        auto_out=scale * np.sum(np.abs(Y) ** 2, axis=0),
        cross=scale * np.sum(X.conj() * Y, axis=0),
        n_averages=count / (1.0 + 2.0 * overlap**2 * (count - 1) / count),
        resolution_hz=rate_hz * float(taper @ taper) / float(taper.sum()) ** 2,
    )


def blackman_tukey(
    x: np.ndarray, y: np.ndarray, *, rate_hz: float, window_s: float
) -> CrossSpectra:
    """Return spectra of correlations up to a longest lag, under a Hann lag window.

    ``x``, ``y`` (n,): input and output; ``rate_hz``: sampling rate; ``window_s``: longest lag.
    Returns densities at 16 points a resolution, or finer. Blackman and Tukey 1958,
    doi:10.1002/j.1538-7305.1958.tb03874.x.
    """
    x, y = _checked(x, y, rate_hz)
    longest = round(window_s * rate_hz)
    if not 2 <= longest < x.size:
        raise ValueError(
            f"blackman_tukey: expected a longest lag of 2 to {x.size - 1} samples, got {longest} "
            f"({window_s:g} s at {rate_hz:g} Hz)"
        )
    window = 0.5 + 0.5 * np.cos(np.pi * np.arange(-longest, longest + 1) / longest)
    points = fft.next_fast_len(max(_GRID_POINTS * longest, 2 * longest + 1), real=True)
    padded = fft.next_fast_len(x.size + longest + 1, real=True)
    X, Y = (fft.rfft(z - z.mean(), padded) for z in (x, y))
    scale = 2.0 / (rate_hz * x.size)
    densities = [
        scale * _density(fft.irfft(product, padded), window, points)
        for product in (np.abs(X) ** 2, np.abs(Y) ** 2, X.conj() * Y)
    ]
    return CrossSpectra(
        frequency_hz=fft.rfftfreq(points, 1.0 / rate_hz),
        auto_in=np.maximum(densities[0].real, 0.0),
        auto_out=np.maximum(densities[1].real, 0.0),
        cross=densities[2],
        n_averages=x.size / float(window @ window),
        resolution_hz=rate_hz / float(window.sum()),
    )


def _checked(x: np.ndarray, y: np.ndarray, rate_hz: float) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if x.ndim != 1 or x.shape != y.shape:
        raise ValueError(
            f"spectra: expected two 1-d records of one length, got {x.shape} and {y.shape}"
        )
    if not rate_hz > 0.0:
        raise ValueError(f"spectra: expected rate_hz > 0, got {rate_hz}")
    return x, y


def _density(correlation: np.ndarray, window: np.ndarray, points: int) -> np.ndarray:
    """Return the spectrum of a circular correlation cut off by a lag window."""
    longest = window.size // 2
    windowed = np.zeros(points)
    windowed[: longest + 1] = correlation[: longest + 1] * window[longest:]
    windowed[-longest:] = correlation[-longest:] * window[:longest]
    return np.asarray(fft.rfft(windowed))
