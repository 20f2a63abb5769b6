"""Frequency at which the gain of a torque loop has fallen, and its error."""

from dataclasses import dataclass

import numpy as np

from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.kernels.series.spectra import CrossSpectra, coherence_threshold

#: The gain at zero frequency is read off up to this share of the bandwidth.
_REFERENCE_SHARE = 0.3
_FEWEST_FOR_SLOPE = 4
#: Bins that must be coherent in that band.
_COHERENT_SHARE = 0.5
#: The command excites where its density is above this share of the largest.
_EXCITED = 1e-3
#: Gain and coherence are averaged over so much of a frequency to either side before the first
#: crossing is looked for and bins are weighted: one bin's lucky or unlucky gain decides neither.
_NEIGHBOURS = 0.1
#: Half-width of the line through the gain at the crossing, in widths of resolution, and at most
#: as a share of the crossing: the first to start with, the second where the gain scatters.
_LINE_REACH = 2.0
_NARROW_SHARE, _WIDE_SHARE = 0.3, 0.5
_WIDER = 1.3
#: The line's slope must be so many of its sd away from zero.
_CLEAR_SLOPE = 4.0
#: Neighbouring frequencies that share their noise, in widths of resolution: what the squared Hann
#: window makes of both estimators.
_SHARED = 4.0 / 3.0
_LOG_GAIN_OF_DB = np.log(10.0) / 20.0
_LEAST_SD = 1e-6
WHERE = "identify_bandwidth"
_LEAST_COHERENCE = 1e-3


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where the gain crosses its loss."""

    hz: float  # frequency of the crossing
    sd_hz: float  # sd of ``hz``, by noise
    reference_gain: float  # gain at zero frequency, N*m of torque per N*m of command
    # lowest and highest frequency of the bins behind ``reference_gain``
    reference_hz: tuple[float, float]


@dataclass(frozen=True, slots=True)
class _Gain:
    """Log gain of every bin."""

    spectra: CrossSpectra
    log: np.ndarray  # natural logarithm of the gain
    level: np.ndarray  # mean of ``log`` over neighbouring bins
    sd: np.ndarray  # sd of ``log``
    excited: np.ndarray  # bins that the command excites

    @property
    def cells(self) -> float:
        """How many neighbouring frequencies count as one."""
        f = self.spectra.frequency_hz
        return max(_SHARED * self.spectra.resolution_hz / float(f[1]), 1.0)


def excited_bins(spectra: CrossSpectra) -> np.ndarray:
    """Return where the command has power, (f,) bool, zero frequency left out."""
    power = spectra.auto_in
    return np.asarray((power > _EXCITED * power[1:].max()) & (spectra.frequency_hz > 0.0))


def check_coherent(spectra: CrossSpectra) -> None:
    """Refuse a pair of records that are hardly coherent."""
    excited = excited_bins(spectra)
    needed = coherence_threshold(spectra.n_averages)
    share = float(np.mean(spectra.coherence[excited] > needed))
    low = np.flatnonzero(excited)[: max(3, excited.sum() // 8)]
    at_low = float(np.mean(spectra.coherence[low] > needed))
    if share < 0.1 or at_low < _COHERENT_SHARE:
        raise EstimationError(
            Failure.NOT_COHERENT.value,
            f"{WHERE}: command uncorrelated with torque: coherent at {100 * share:.0f} % of the "
            f"excited frequencies, at {100 * at_low:.0f} % of the lowest. Check that the columns "
            "belong to one record and that the loop was closed.",
        )


def find_crossing(spectra: CrossSpectra, drop_db: float) -> Crossing:
    """Return where the gain has lost ``drop_db``, counted from the gain at zero frequency.

    The log gain is unbiased where noise is smaller than the gain, the gain is
    not. Bins are weighted by their neighbours' mean coherence: a bin's own goes
    with its noise.
    """
    gain = _gain(spectra)
    start_hz, low = _first_below(gain, drop_db)
    log_reference, reference_var = _low_gain(gain, low)
    target = log_reference - drop_db * _LOG_GAIN_OF_DB
    hz, slope, log_var = _refine(gain, target, start_hz)
    sd_hz = float(np.sqrt(log_var + reference_var) / abs(slope))
    f = spectra.frequency_hz
    band = (float(f[low[0]]), float(f[low[-1]]))
    return Crossing(hz, sd_hz, float(np.exp(log_reference)), band)


def rough_crossing_hz(spectra: CrossSpectra, drop_db: float) -> float:
    """Return about where the gain has lost ``drop_db``, however badly the spectra resolve it."""
    return _first_below(_gain(spectra), drop_db)[0]


def _first_below(gain: _Gain, drop_db: float) -> tuple[float, np.ndarray]:
    """Return the first frequency below the loss, and the bins that make the reference."""
    spectra, f = gain.spectra, gain.spectra.frequency_hz
    lowest = np.flatnonzero(gain.excited)[0]
    top_hz = hz = 0.0
    for _ in range(3):
        low = np.flatnonzero(gain.excited & (f <= max(top_hz, f[2])))
        if not low.size:
            raise _not_excited(f"below {f[lowest]:.3g} Hz")
        target = _low_gain(gain, low)[0] - drop_db * _LOG_GAIN_OF_DB
        below = np.flatnonzero((gain.level < target) & (f > f[low[0]]))
        dark = low[0] + np.flatnonzero(
            ~gain.excited[low[0] : below[0] + 1 if below.size else f.size]
        )
        if dark.size and dark[0] < np.argmax(spectra.auto_in):
            raise _not_excited(f"at {f[dark[0]]:.3g} Hz")
        if dark.size or not below.size:
            top = dark[0] - 1 if dark.size else np.flatnonzero(gain.excited)[-1]
            raise _above_band(spectra, float(f[top]), drop_db)
        hz = float(f[below[0]])
        top_hz = _REFERENCE_SHARE * hz
    return hz, low


def _gain(spectra: CrossSpectra) -> _Gain:
    n, c = spectra.n_averages, spectra.coherence
    excited = excited_bins(spectra)
    log = np.log(np.maximum(np.abs(spectra.response), 1e-300))
    # Unrelated records have a coherence of 1/n.
    known = np.maximum(_over_neighbours(spectra, (n * c - 1.0) / (n - 1.0), excited), 0.0)
    known = np.clip(known, _LEAST_COHERENCE, 1.0)
    sd = np.maximum(np.sqrt((1.0 - known) / (2.0 * n * known)), _LEAST_SD)
    return _Gain(spectra, log, _over_neighbours(spectra, log, excited), sd, excited)


def _over_neighbours(spectra: CrossSpectra, values: np.ndarray, excited: np.ndarray) -> np.ndarray:
    """Return the mean over excited frequencies near by, at least over one width of resolution."""
    f = spectra.frequency_hz
    half = np.maximum(_NEIGHBOURS * f, 0.5 * spectra.resolution_hz)
    first, end = np.searchsorted(f, f - half), np.searchsorted(f, f + half, side="right")
    total = np.concatenate([[0.0], np.cumsum(np.where(excited, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(excited)])
    return np.asarray((total[end] - total[first]) / np.maximum(count[end] - count[first], 1))


def _low_gain(gain: _Gain, low: np.ndarray) -> tuple[float, float]:
    """Return the log gain at zero frequency, and its variance.

    It is a line in f^2, as of a first-order loop far below its bandwidth.
    """
    log, weight = gain.log[low], 1.0 / gain.sd[low] ** 2
    if low.size < _FEWEST_FOR_SLOPE:
        return float(np.average(log, weights=weight)), gain.cells / float(weight.sum())
    f = gain.spectra.frequency_hz
    square = (f[low] / f[low[-1]]) ** 2
    design = np.column_stack([np.ones_like(square), square])
    inverse = np.linalg.inv(design.T @ (weight[:, None] * design))
    level = float((inverse @ (design.T @ (weight * log)))[0])
    return level, gain.cells * float(inverse[0, 0])


def _refine(gain: _Gain, target: float, start_hz: float) -> tuple[float, float, float]:
    """Return where a line through the gain crosses, its slope per Hz, and the line's variance.

    The line is as short as its slope allows: the gain is not straight.
    """
    reach = min(_LINE_REACH * gain.spectra.resolution_hz, _NARROW_SHARE * start_hz)
    longest = max(reach, _WIDE_SHARE * start_hz)
    while reach <= longest:
        hz, slope, inverse = _line(gain, target, start_hz, reach)
        if slope < -_CLEAR_SLOPE * np.sqrt(inverse[1, 1]):
            return hz, slope, float(inverse[0, 0])
        reach *= _WIDER
    raise EstimationError(
        Failure.NOT_COHERENT.value,
        f"{WHERE}: the gain scatters so much near {start_hz:.3g} Hz that its slope, and with it "
        "the bandwidth, cannot be told. Command more, or record longer.",
    )


def _line(
    gain: _Gain, target: float, start_hz: float, reach_hz: float
) -> tuple[float, float, np.ndarray]:
    """Return where a weighted line crosses, its slope, and the covariance of level and slope."""
    f, hz = gain.spectra.frequency_hz, start_hz
    for _ in range(3):
        near = np.flatnonzero(gain.excited & (np.abs(f - hz) <= max(reach_hz, 1.01 * f[1])))
        x = f[near] - hz
        weight = 1.0 / gain.sd[near] ** 2
        design = np.column_stack([np.ones_like(x), x])
        normal = design.T @ (weight[:, None] * design)
        level, slope = np.linalg.solve(normal, design.T @ (weight * gain.log[near]))
        if slope >= 0.0:
            break
        hz = float(np.clip(hz + (target - level) / slope, f[near[0]], f[near[-1]]))
    return hz, float(slope), gain.cells * np.linalg.inv(normal)


def _above_band(spectra: CrossSpectra, top_hz: float, drop_db: float) -> EstimationError:
    return EstimationError(
        Failure.ABOVE_BAND.value,
        f"{WHERE}: the gain does not fall by {drop_db:g} dB inside the excited band, which ends "
        f"at {top_hz:.4g} Hz (half the sampling rate: {spectra.frequency_hz[-1]:.4g} Hz). Command "
        "higher frequencies, and sample faster if need be.",
    )


def _not_excited(at: str) -> EstimationError:
    return EstimationError(
        Failure.ABOVE_BAND.value,
        f"{WHERE}: the command does not excite {at}: the gain at zero frequency, from which the "
        "loss counts, cannot be followed to the bandwidth. Command lower frequencies too.",
    )
