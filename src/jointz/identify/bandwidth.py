"""The bandwidth of a closed torque loop, out of command and measured torque."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import norm
from scipy.stats import t as student_t

from jointz.core import provenance
from jointz.core.bandwidth_fit import BandwidthFit
from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.frequency_response_curve import ResponseCurve
from jointz.identify.joint_record import JointRecord, check_choice, gather_record
from jointz.kernels.spectra import CrossSpectra, blackman_tukey, coherence_threshold, welch

Method = Literal["welch", "blackman_tukey"]


_WHERE = "identify_bandwidth"
#: Welch segments in the record, half-overlapping not counted; the lags of Blackman and Tukey span
#: two thirds of such a segment, which resolves the same.
_SEGMENTS = 16.0
_LONGEST_WINDOW_S = 4.0
_LAGS_OF_SEGMENT = 2.0 / 3.0
_FEWEST_AVERAGES = 4.0
#: Wanted bandwidth over resolution; the window is lengthened for it, to so many segments.
_RESOLVED = 10.0
_FEWEST_SEGMENTS = 5.0
_POORLY_RESOLVED = 6.0
_HANN_RESOLUTION = 1.5
#: The gain at zero frequency is read off up to this share of the bandwidth.
_REFERENCE_SHARE = 0.3
_FEWEST_FOR_SLOPE = 4
#: Bins that must be coherent in that band.
_COHERENT_SHARE = 0.5
#: The command excites where its density is above this share of the largest.
_EXCITED = 1e-3
_LOW_COHERENCE = 0.8
#: Half-width of the line through the gain at the crossing, in widths of resolution.
_LINE_REACH = 2.0
_WIDEST_BAND = 1e3


@dataclass(frozen=True, slots=True)
class _Crossing:
    hz: float
    sd_hz: float
    reference_gain: float
    reference_hz: tuple[float, float]


def identify_bandwidth(  # noqa: PLR0913 - the fixed public signature of identify
    recording: xr.Dataset | Mapping[str, npt.ArrayLike] | pd.DataFrame | None = None,
    *,
    command: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    method: Method = "welch",
    window_s: float | None = None,
    drop_db: float = 3.0,
    ci_level: float = 0.95,
) -> BandwidthFit:
    """Estimate at which frequency a torque loop has lost 3 dB.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``command``, ``torque`` and, where there is, ``time``, in SI.
        Either this or the arrays.
    command : (n,) float, N*m, optional
        Commanded torque.
    torque : (n,) float, N*m, optional
        Measured torque.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; a gap is an error.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps.
    method : str
        ``welch`` or ``blackman_tukey`` (MATLAB's ``spa``).
    window_s : float, optional
        Length of a Welch segment, or longest lag of Blackman and Tukey. By
        default a sixteenth of the record (two thirds of that for lags), 4 s at
        most: about 20 to 30 averages; where the bandwidth is then below ten
        times the resolution, up to a fifth of the record.
    drop_db : float
        Loss of gain that ends the bandwidth, dB.
    ci_level : float
        Level of the interval and of the band.

    Returns
    -------
    BandwidthFit
        Bandwidth, interval, resolution, coherence, response.

    Raises
    ------
    DataError
        When the samples cannot be trusted, or a window that does not fit.
    EstimationError
        ``constant_command``, ``constant_torque``, ``not_coherent``,
        ``below_resolution`` (the window is too short) or ``above_band`` (the
        gain does not fall inside the excited band below half the rate).
    ValueError
        Unknown method.

    Notes
    -----
    The gain |S_command,torque / S_command,command| counts from its value at
    zero frequency: 1/gain^2 is a line in f^2 below three tenths of the bandwidth,
    as of a first-order loop; a higher-order one is flatter. The crossing is that
    of a line through the log gain within two widths of resolution; its interval
    follows from the coherence (delta method).

    A long window resolves finely with few averages, so the gain scatters; a
    short one averages much, but reads no bandwidth smaller than its
    resolution: 30 lags at 1 kHz, the default of ``spa``, resolve 33 Hz and
    read 10 Hz as about 27 Hz. Such a reading is refused here. Noise in the
    command record lowers the gain everywhere and leaves the bandwidth as it
    is; a loop that saturates has a bandwidth for each amplitude.

    Examples
    --------
    >>> from scipy.signal import butter, lfilter
    >>> command = np.random.default_rng(0).standard_normal(30_000)
    >>> b, a = butter(1, 10.0, fs=1000.0)
    >>> fit = identify_bandwidth(command=command, torque=lfilter(b, a, command), rate_hz=1000.0)
    >>> abs(fit.bandwidth_hz - 10.0) < 0.3
    True
    """
    check_choice("method", method, get_args(Method))
    if not 0.0 < ci_level < 1.0:
        raise ValueError(f"ci_level: expected 0 < ci_level < 1, got {ci_level}")
    if not drop_db > 0.0:
        raise ValueError(f"drop_db: expected > 0 dB, got {drop_db}")
    given = {"command": command, "torque": torque, "time": time}
    record = gather_record(
        recording, given, rate_hz=rate_hz, where=_WHERE, required=("command", "torque")
    )
    _check_moves(record)
    chosen_s = window_s if window_s is not None else _window_s(record, method, drop_db)
    spectra = _spectra(record, method, chosen_s)
    _check_coherent(spectra)
    crossing = _find_crossing(spectra, drop_db)
    if crossing.hz < spectra.resolution_hz:
        raise _below_resolution(spectra, crossing.hz)
    wide = float(norm.ppf((1.0 + ci_level) / 2.0)) * crossing.sd_hz
    coherence = float(np.interp(crossing.hz, spectra.frequency_hz, spectra.coherence))
    return BandwidthFit(
        bandwidth_hz=crossing.hz,
        ci_low_hz=max(crossing.hz - wide, 0.0),
        ci_high_hz=crossing.hz + wide,
        ci_level=ci_level,
        drop_db=drop_db,
        reference_gain=crossing.reference_gain,
        reference_hz=crossing.reference_hz,
        resolution_hz=spectra.resolution_hz,
        coherence=coherence,
        response=_curve(spectra, ci_level),
        method=method,
        window_s=chosen_s,
        n_averages=spectra.n_averages,
        n_samples=record.time.size,
        rate_hz=record.rate_hz,
        ci_method="coherence and slope of the gain, delta method",
        settings={
            "window": "chosen from the record" if window_s is None else "given",
            "sha256": record.sha256,
            "jointz": provenance.software()["jointz"],
        },
        warnings=_warnings(crossing, spectra, coherence),
    )


def _check_moves(record: JointRecord) -> None:
    for name, code in (
        ("command", Failure.CONSTANT_COMMAND.value),
        ("torque", Failure.CONSTANT_TORQUE.value),
    ):
        values = record.channels[name]
        if np.ptp(values) <= 1e-12 * np.abs(values).max():
            raise EstimationError(
                code,
                f"the {name} is constant ({values[0]:.6g}): nothing to identify. Check the column.",
            )


def _window_s(record: JointRecord, method: Method, drop_db: float) -> float:
    """Choose a window: many averages, then as long as the bandwidth they show needs."""
    seconds = record.time.size / record.rate_hz
    many_s = min(seconds / _SEGMENTS, _LONGEST_WINDOW_S)
    share = 1.0 if method == "welch" else _LAGS_OF_SEGMENT
    spectra = _spectra(record, method, share * many_s)
    _check_coherent(spectra)
    roughly_hz = _find_crossing(spectra, drop_db).hz
    wanted_s = _HANN_RESOLUTION * _RESOLVED / roughly_hz
    return share * max(many_s, min(wanted_s, seconds / _FEWEST_SEGMENTS))


def _spectra(record: JointRecord, method: Method, window_s: float) -> CrossSpectra:
    estimate = welch if method == "welch" else blackman_tukey
    try:
        spectra = estimate(
            record.channels["command"],
            record.channels["torque"],
            rate_hz=record.rate_hz,
            window_s=window_s,
        )
    except ValueError as exc:
        raise DataError(f"{_WHERE}: {exc}. Choose another window_s, or record longer.") from exc
    if spectra.n_averages < _FEWEST_AVERAGES:
        raise DataError(
            f"{_WHERE}: a window of {window_s:.4g} s makes {spectra.n_averages:.1f} averages of "
            f"this record, at least {_FEWEST_AVERAGES:.0f} are needed. Shorten window_s, or record "
            "longer."
        )
    return spectra


def _check_coherent(spectra: CrossSpectra) -> None:
    """Refuse a pair of records of which nothing, or hardly anything, belongs together."""
    excited = _excited(spectra)
    needed = coherence_threshold(spectra.n_averages)
    share = float(np.mean(spectra.coherence[excited] > needed))
    low = np.flatnonzero(excited)[: max(3, excited.sum() // 8)]
    at_low = float(np.mean(spectra.coherence[low] > needed))
    if share < 0.1 or at_low < _COHERENT_SHARE:
        raise EstimationError(
            Failure.NOT_COHERENT.value,
            f"{_WHERE}: command uncorrelated with torque: coherent at {100 * share:.0f} % of the "
            f"excited frequencies, at {100 * at_low:.0f} % of the lowest. Check that the columns "
            "belong to one record and that the loop was closed.",
        )


def _excited(spectra: CrossSpectra) -> np.ndarray:
    """(f,) bool: where the command has power, zero frequency left out."""
    power = spectra.auto_in
    excited: np.ndarray = (power > _EXCITED * power[1:].max()) & (spectra.frequency_hz > 0.0)
    return excited


def _find_crossing(spectra: CrossSpectra, drop_db: float) -> _Crossing:
    """Count the loss from the gain of the lowest frequencies, then of those below the crossing."""
    f = spectra.frequency_hz
    excited = _excited(spectra)
    log_gain = np.log(np.maximum(np.abs(spectra.response), 1e-300))
    top_hz = hz = 0.0
    for _ in range(3):
        low = np.flatnonzero(excited & (f <= max(top_hz, f[2])))
        if not low.size:
            raise _above_band(spectra, drop_db)
        reference, reference_var = _low_gain(spectra, low)
        wanted = np.log(reference) - drop_db * np.log(10.0) / 20.0
        below = np.flatnonzero((log_gain < wanted) & (f > f[low[0]]))
        if not below.size or not excited[low[0] : below[0] + 1].all():
            raise _above_band(spectra, drop_db)
        hz = float(f[below[0]])
        top_hz = _REFERENCE_SHARE * hz
    hz, slope, log_var = _refine(spectra, log_gain, wanted, hz)
    sd_hz = float(np.sqrt(log_var + reference_var) / abs(slope))
    return _Crossing(hz, sd_hz, reference, (float(f[low[0]]), float(f[low[-1]])))


def _low_gain(spectra: CrossSpectra, low: np.ndarray) -> tuple[float, float]:
    """Return the gain at zero frequency, and the variance of its logarithm."""
    gain = np.maximum(np.abs(spectra.response[low]), 1e-300)
    weight = 1.0 / np.maximum(spectra.relative_sd()[low], 1e-6) ** 2
    mean = float(np.average(gain, weights=weight))
    if low.size >= _FEWEST_FOR_SLOPE:
        square = spectra.frequency_hz[low] ** 2
        design = np.column_stack([np.ones_like(square), square / square[-1]])
        inverse = np.linalg.inv(design.T @ (weight[:, None] * design))
        level = float((inverse @ (design.T @ (weight * (mean / gain) ** 2)))[0])
        if level > 0.0:
            return mean / np.sqrt(level), _cells(spectra) * float(inverse[0, 0])
    return mean, _cells(spectra) / float(weight.sum())


def _cells(spectra: CrossSpectra) -> float:
    """Return how many neighbouring frequencies share one width of resolution."""
    step = float(spectra.frequency_hz[1])
    return max(spectra.resolution_hz / step, 1.0)


def _refine(
    spectra: CrossSpectra, log_gain: np.ndarray, wanted: float, start_hz: float
) -> tuple[float, float, float]:
    """Return where a line through the gain crosses, its slope per Hz, and the line's variance."""
    f = spectra.frequency_hz
    hz = start_hz
    for _ in range(3):
        reach = min(_LINE_REACH * spectra.resolution_hz, 0.3 * hz)
        near = np.flatnonzero(np.abs(f - hz) <= max(reach, 1.01 * f[1]))
        near = near[f[near] > 0.0]
        x = f[near] - hz
        weight = 1.0 / np.maximum(spectra.relative_sd()[near], 1e-6) ** 2
        design = np.column_stack([np.ones_like(x), x])
        normal = design.T @ (weight[:, None] * design)
        level, slope = np.linalg.solve(normal, design.T @ (weight * log_gain[near]))
        if slope >= 0.0:
            break
        hz = float(np.clip(hz + (wanted - level) / slope, f[near[0]], f[near[-1]]))
    if slope >= 0.0:
        # Scatter hides the slope: the mean one from zero to the crossing is the best known.
        slope = wanted / hz if wanted < 0.0 else -1.0 / hz
    return hz, float(slope), _cells(spectra) * float(np.linalg.inv(normal)[0, 0])


def _above_band(spectra: CrossSpectra, drop_db: float) -> EstimationError:
    excited = spectra.frequency_hz[_excited(spectra)]
    top = float(excited[-1]) if excited.size else 0.0
    return EstimationError(
        Failure.ABOVE_BAND.value,
        f"{_WHERE}: the gain does not fall by {drop_db:g} dB inside the excited band, which ends "
        f"at {top:.4g} Hz (half the sampling rate: {spectra.frequency_hz[-1]:.4g} Hz). Command "
        "higher frequencies, and sample faster if need be.",
    )


def _below_resolution(spectra: CrossSpectra, hz: float) -> EstimationError:
    return EstimationError(
        Failure.BELOW_RESOLUTION.value,
        f"{_WHERE}: the bandwidth reads {hz:.3g} Hz, not above the resolution of "
        f"{spectra.resolution_hz:.3g} Hz: the window, not the actuator, would be measured. Choose "
        "a longer window_s, or record longer.",
    )


def _warnings(crossing: _Crossing, spectra: CrossSpectra, coherence: float) -> tuple[str, ...]:
    notes = []
    if crossing.hz < _POORLY_RESOLVED * spectra.resolution_hz:
        notes.append(
            f"the bandwidth is {crossing.hz / spectra.resolution_hz:.1f} times the resolution: "
            "smoothing reads it wrong by some percent; record longer, or choose a longer window_s"
        )
    if coherence < _LOW_COHERENCE:
        notes.append(
            f"the coherence at the bandwidth is {coherence:.2f}: noise, saturation or friction"
        )
    return tuple(notes)


def _curve(spectra: CrossSpectra, ci_level: float) -> ResponseCurve:
    shown = _excited(spectra)
    response, sd = spectra.response[shown], spectra.relative_sd()[shown]
    gain = np.abs(response)
    wide = float(student_t.ppf((1.0 + ci_level) / 2.0, max(2.0 * spectra.n_averages - 2.0, 1.0)))
    reach = np.exp(np.minimum(wide * sd, np.log(_WIDEST_BAND)))
    columns = {
        "frequency_hz": spectra.frequency_hz[shown],
        "gain": gain,
        "phase_rad": np.unwrap(np.angle(response)),
        "gain_low": gain / reach,
        "gain_high": gain * reach,
        "phase_sd_rad": np.minimum(sd, np.pi),
        "coherence": spectra.coherence[shown],
    }
    return ResponseCurve(**{name: tuple(v.tolist()) for name, v in columns.items()})
