"""Bandwidth of a closed torque loop from command and measured torque."""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from scipy.stats import norm

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.actuators.bandwidth_crossing import (
    WHERE,
    Crossing,
    check_coherent,
    excited_bins,
    find_crossing,
    rough_crossing_hz,
)
from jointz.identify.record.joint_record import (
    JointRecord,
    check_choice,
    check_level,
    gather_record,
    refuse_constant,
)
from jointz.identify.record.joint_signals import response_curve
from jointz.kernels.series.spectra import CrossSpectra, blackman_tukey, welch
from jointz.results.bench.bandwidth_fit import BandwidthFit

Method = Literal["welch", "blackman_tukey"]


#: Welch segments in the record, half-overlapping not counted; the lags of Blackman and Tukey span
#: two thirds of such a segment, which resolves the same.
_SEGMENTS = 16.0
_LONGEST_WINDOW_S = 4.0
_LAGS_OF_SEGMENT = 2.0 / 3.0
_FEWEST_AVERAGES = 4.0
#: Wanted bandwidth over resolution; the window is lengthened for it, to so many segments, and
#: again where the longer one shows a smaller bandwidth.
_RESOLVED = 10.0
_FEWEST_SEGMENTS = 5.0
_LENGTHENINGS = 4
_POORLY_RESOLVED = 6.0
_HANN_RESOLUTION = 1.5
#: A reading below so many widths of resolution is one of the window. So is one that half the
#: window moves far: smoothing changes the reading with the square of the resolution, so half the
#: window moves it by three times what smoothing still does, and that may be so much of it.
_REFUSED = 4.0
_HALVING = 3.0
_LARGEST_BIAS = 0.1
_LOW_COHERENCE = 0.8


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
        gain does not fall inside the excited band below half the rate, or that
        band lacks the low frequencies).
    ValueError
        Unknown method.

    Notes
    -----
    The gain ``|S_command,torque / S_command,command|`` counts from its value
    at zero frequency: the log gain is a line in f^2 below three tenths of the bandwidth,
    as of a first-order loop; a higher-order one is flatter. The crossing is that
    of a line through the log gain within two widths of resolution, more where the
    gain scatters; its interval follows from the coherence (delta method).

    A long window resolves finely with few averages, so the gain scatters; a
    short one averages much, but reads no bandwidth smaller than its
    resolution: 30 lags at 1 kHz, the default of ``spa``, resolve 33 Hz and
    read 10 Hz as about 27 Hz. A reading below four times the resolution is
    refused, and one below ten times that half the window moves by more than
    30 % and the noise. By a third of that move, towards where the longer
    window would read, the interval is longer than noise makes it. Where noise
    hides the slope of the gain at the crossing there is no reading either.

    Gain is averaged over a tenth of its frequency to either side before the
    crossing is looked for: a notch narrower than that is passed over. Noise in the
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
    check_level(WHERE, ci_level)
    if not 0.0 < drop_db < np.inf:
        raise ValueError(f"drop_db: expected > 0 dB, got {drop_db}")
    if window_s is not None and not 0.0 < window_s < np.inf:
        raise DataError(f"{WHERE}: window_s: expected > 0 s, got {window_s:g}")
    arrays = {"command": command, "torque": torque, "time": time}
    record = gather_record(
        recording, arrays, rate_hz=rate_hz, where=WHERE, required=("command", "torque")
    )
    refuse_constant(record, ("command", "torque"))
    chosen_s = window_s if window_s is not None else _window_s(record, method, drop_db)
    spectra = _spectra(record, method, chosen_s)
    check_coherent(spectra)
    rough_hz = rough_crossing_hz(spectra, drop_db)
    if rough_hz < _REFUSED * spectra.resolution_hz:
        raise _below_resolution(spectra, rough_hz)
    crossing = find_crossing(spectra, drop_db)
    if crossing.hz < _REFUSED * spectra.resolution_hz:
        raise _below_resolution(spectra, crossing.hz)
    bias_hz = _smoothing_bias_hz(
        record, crossing, spectra, method=method, window_s=chosen_s, drop_db=drop_db
    )
    wide = float(norm.ppf((1.0 + ci_level) / 2.0)) * crossing.sd_hz
    coherence = float(np.interp(crossing.hz, spectra.frequency_hz, spectra.coherence))
    shown = excited_bins(spectra)
    return BandwidthFit(
        bandwidth_hz=crossing.hz,
        ci_low_hz=max(crossing.hz - wide - max(bias_hz, 0.0), 0.0),
        ci_high_hz=crossing.hz + wide - min(bias_hz, 0.0),
        ci_level=ci_level,
        drop_db=drop_db,
        reference_gain=crossing.reference_gain,
        reference_hz=crossing.reference_hz,
        resolution_hz=spectra.resolution_hz,
        coherence=coherence,
        response=response_curve(
            spectra.frequency_hz[shown],
            spectra.response[shown],
            relative_sd=spectra.relative_sd()[shown],
            coherence=spectra.coherence[shown],
            n_averages=spectra.n_averages,
            ci_level=ci_level,
        ),
        method=method,
        window_s=chosen_s,
        n_averages=spectra.n_averages,
        n_samples=record.time.size,
        rate_hz=record.rate_hz,
        ci_method="coherence and slope of the gain, delta method; widened by what smoothing does",
        settings={
            "window": "chosen from the record" if window_s is None else "given",
            "smoothing_bias_hz": bias_hz,
            **record.origin(),
        },
        warnings=_warnings(crossing, spectra, coherence, bias_hz),
    )


def _window_s(record: JointRecord, method: Method, drop_db: float) -> float:
    """Choose a window: many averages, then as long as the bandwidth they show needs."""
    seconds = record.seconds
    share = 1.0 if method == "welch" else _LAGS_OF_SEGMENT
    chosen_s = min(seconds / _SEGMENTS, _LONGEST_WINDOW_S)
    for _ in range(_LENGTHENINGS):
        spectra = _spectra(record, method, share * chosen_s)
        check_coherent(spectra)
        roughly_hz = rough_crossing_hz(spectra, drop_db)
        wanted_s = min(_HANN_RESOLUTION * _RESOLVED / roughly_hz, seconds / _FEWEST_SEGMENTS)
        if wanted_s <= chosen_s:
            break
        chosen_s = wanted_s
    return share * chosen_s


def _smoothing_bias_hz(
    record: JointRecord,
    crossing: Crossing,
    spectra: CrossSpectra,
    *,
    method: Method,
    window_s: float,
    drop_db: float,
) -> float:
    """Return the bias by smoothing, from the reading with half the window."""
    # Noise alone moves a reading that is well resolved.
    resolved = crossing.hz >= _RESOLVED * spectra.resolution_hz
    half = _spectra(record, method, window_s / 2.0)
    try:
        moved_hz = find_crossing(half, drop_db).hz - crossing.hz
    except EstimationError as exc:
        if resolved:
            return 0.0
        raise _below_resolution(spectra, crossing.hz) from exc
    bias_hz = moved_hz / _HALVING
    if not resolved and abs(bias_hz) > _LARGEST_BIAS * crossing.hz + crossing.sd_hz:
        raise _below_resolution(spectra, crossing.hz)
    return bias_hz


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
        raise DataError(f"{WHERE}: {exc}. Choose another window_s, or record longer.") from exc
    if spectra.n_averages < _FEWEST_AVERAGES:
        raise DataError(
            f"{WHERE}: a window of {window_s:.4g} s makes {spectra.n_averages:.1f} averages of "
            f"this record, at least {_FEWEST_AVERAGES:.0f} are needed. Shorten window_s, or record "
            "longer."
        )
    return spectra


def _below_resolution(spectra: CrossSpectra, hz: float) -> EstimationError:
    return EstimationError(
        Failure.BELOW_RESOLUTION.value,
        f"{WHERE}: the bandwidth reads {hz:.3g} Hz, {hz / spectra.resolution_hz:.1f} times the "
        f"resolution of {spectra.resolution_hz:.3g} Hz: the window, not the actuator, would be "
        "measured; the true bandwidth may be far lower. Choose a longer window_s, or record "
        "longer; check the unit of time.",
    )


def _warnings(
    crossing: Crossing, spectra: CrossSpectra, coherence: float, bias_hz: float
) -> tuple[str, ...]:
    notes = []
    if crossing.hz < _POORLY_RESOLVED * spectra.resolution_hz:
        notes.append(
            f"the bandwidth is {crossing.hz / spectra.resolution_hz:.1f} times the resolution: "
            f"smoothing moves it by about {bias_hz:+.2g} Hz ({100 * bias_hz / crossing.hz:+.0f} "
            "%), by which the interval is widened; record longer, or choose a longer window_s"
        )
    if coherence < _LOW_COHERENCE:
        notes.append(
            f"the coherence at the bandwidth is {coherence:.2f}: noise, saturation or friction"
        )
    return tuple(notes)
