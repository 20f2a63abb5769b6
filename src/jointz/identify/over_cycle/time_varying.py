"""Impedance of a joint over the gait cycle, from continuous random perturbation."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import get_args

import numpy as np
import numpy.typing as npt

from jointz.core import provenance
from jointz.core.codes import Failure
from jointz.core.errors import EstimationError
from jointz.identify.over_cycle.time_varying_segments import (
    CycleSignals,
    PhaseEstimate,
    SegmentLayout,
    estimate_phase,
    filter_signals,
)
from jointz.identify.over_cycle.time_varying_strides import (
    ChosenStrides,
    TimeVaryingSettings,
    choose_strides,
    default_length_s,
    lay_out,
    locate_strikes,
)
from jointz.identify.preparation.cell_data import PARAMETERS
from jointz.identify.record.frequency_response_spectra import Input, TorqueSide, prepare_record
from jointz.identify.record.joint_record import (
    JointRecord,
    Samples,
    check_choice,
    gather_record,
    value_warnings,
)
from jointz.kernels.resampling import resample_weights
from jointz.results.series.time_varying_fit import ParameterCurve, PhaseResponses, TimeVaryingFit

_WHERE = "identify_time_varying"
#: Share of the input's power that must be left without what all strides have in common.
_REPEATED = 1e-3


def identify_time_varying(  # noqa: PLR0913 - the public signature of identify, and the strides
    recording: Samples | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    command: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    heel_strikes: npt.ArrayLike | None = None,
    input: Input = "torque",
    torque_acts_on: TorqueSide = "joint",
    segment_s: float = 0.1,
    n_phases: int = 50,
    cutoff_hz: float = 20.0,
    length_s: float | None = None,
    resamples: int = 1000,
    ci_level: float = 0.95,
    seed: int = 0,
) -> TimeVaryingFit:
    """Estimate impulse response, K, B, J at phases of the gait cycle.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``angle``, ``torque`` and, where there are, ``command``,
        ``time`` and ``contact``, in SI. Either this or the arrays.
    angle : (n,) float, rad, optional
        Joint angle.
    torque : (n,) float, N*m, optional
        Measured torque.
    command : (n,) float, N*m, optional
        Commanded random perturbation: the instrument of K, B, J, and needed where
        the device reacts to the joint.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; a gap is an error.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps.
    heel_strikes : (k,) float, s, optional
        Times of the heel strikes, on the clock of ``time`` (from 0 with
        ``rate_hz``). Otherwise found in the recording's channel ``contact`` (in
        a dataset also ``ground_reaction_force`` or ``cycle``).
    input : str
        What was perturbed. ``torque``: instrumental variables, with the
        command, else the measured torque. ``angle``: least squares of torque on
        angle, or the command as instrument where there is one.
    torque_acts_on : str
        ``joint``, or ``device``: the sign of the torque is turned.
    segment_s : float
        Length of the segments about each phase; K varies linearly inside.
    n_phases : int
        Phases, evenly over the cycle: (i + 1/2) / n_phases.
    cutoff_hz : float
        Low-pass filter on every signal, zero phase.
    length_s : float, optional
        Longest lag of the impulse response: by default 0.3 s for ``torque``,
        0.04 s to each side for ``angle``.
    resamples : int
        Bootstrap resamples of the strides.
    ci_level : float
        Level of the pointwise intervals.
    seed : int
        Of the resampling.

    Returns
    -------
    TimeVaryingFit
        Curves with bands, a phase without a decision ``undecided`` and None.

    Raises
    ------
    DataError
        When the samples or the strides cannot be trusted: missing channel,
        unequal lengths, NaN, gap, heel strikes out of order, fewer than 30 strides
        inside the accepted band of durations; a number outside its range.
    EstimationError
        ``no_heel_strikes``, ``constant_angle``, ``constant_torque``, or
        ``constant_command`` where the perturbation repeats with the stride.
    ValueError
        ``input`` or ``torque_acts_on`` is not one of the two words.

    Notes
    -----
    Ensemble and short-segment method: at every phase, the segments of all strides
    are taken in real time about it, their mean over strides is removed, and the
    rest is one sample of a joint whose stiffness is K + K'(t - centre):
    :mod:`jointz.kernels.series.ensemble_response` has the sources. Samples are weighed
    by the inverse covariance of the residual over a segment, so the slow
    variation of the movement from stride to stride hardly counts. Bands
    resample strides and hold noise only: not the lag between sensors (T reads as B +
    K T and J + B T), not the torque's gain, and not what happens faster than a
    segment. A value is the mean over its segment, weighed by information.

    With torque inside the joint, of muscle or of varying movement, least
    squares of torque on angle reads K far too low; see the page on time-varying
    impedance for figures.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> rng = np.random.default_rng(0)
    >>> torque = lfilter([0.1], [1.0, -0.9], rng.standard_normal(20_000))
    >>> angle = lfilter([3e-5], [1.0, -1.95, 0.953], torque)
    >>> fit = identify_time_varying(
    ...     angle=angle, torque=torque, rate_hz=500.0, heel_strikes=np.arange(0.0, 40.0, 1.0),
    ...     n_phases=4, resamples=200,
    ... )
    >>> fit.parameter("stiffness").n_decided, fit.n_used
    (4, 38)
    """
    check_choice("input", input, get_args(Input))
    check_choice("torque_acts_on", torque_acts_on, get_args(TorqueSide))
    settings = TimeVaryingSettings(
        input=input,
        torque_acts_on=torque_acts_on,
        segment_s=segment_s,
        length_s=default_length_s(input) if length_s is None else length_s,
        n_phases=n_phases,
        cutoff_hz=cutoff_hz,
        resamples=resamples,
        seed=seed,
        ci_level=ci_level,
    )
    arrays = {"angle": angle, "torque": torque, "command": command, "time": time}
    raw = gather_record(recording, arrays, rate_hz=rate_hz, where=_WHERE)
    settings.check(raw.rate_hz)
    record = prepare_record(raw, torque_acts_on)
    strikes = locate_strikes(recording, heel_strikes, record)
    return _estimate_cycle(record, choose_strides(record, strikes, settings), settings)


def _estimate_cycle(
    record: JointRecord, used: ChosenStrides, settings: TimeVaryingSettings
) -> TimeVaryingFit:
    """Return the curves of all phases."""
    gait = (np.arange(settings.n_phases) + 0.5) / settings.n_phases
    measured = "torque" if settings.input == "torque" else None
    instrument = "command" if "command" in record.channels else measured
    layout = lay_out(record, used, gait, settings)
    signals = filter_signals(
        record.channels, rate_hz=record.rate_hz, cutoff_hz=settings.cutoff_hz, instrument=instrument
    )
    _check_varies(signals, layout, instrument or "angle")
    weights = resample_weights(
        used.start_s.size, settings.resamples, np.random.default_rng(settings.seed)
    )
    estimates = [
        _estimate(signals, layout, phase, settings.input, weights)
        for phase in range(settings.n_phases)
    ]
    curves = tuple(_curve(estimates, k, n, settings.ci_level) for k, n in enumerate(PARAMETERS))
    n_used, n_excluded = used.start_s.size, sum(used.excluded.values())
    return TimeVaryingFit(
        estimator="least_squares" if instrument is None else "instrumental_variable",
        input=settings.input,
        gait_pct=tuple((100.0 * gait).tolist()),
        parameters=curves,
        response_of="admittance" if settings.input == "torque" else "impedance",
        responses=phase_responses(estimates, layout.response_lags, record.rate_hz),
        vaf_pct=tuple(e.response.vaf_pct if e else None for e in estimates),
        second_order_vaf_pct=tuple(e.fit.vaf_pct if e else None for e in estimates),
        status="ok" if all(c.n_decided == settings.n_phases for c in curves) else "undecided",
        n_used=n_used,
        n_excluded=n_excluded,
        excluded=used.excluded,
        stride_s=float(used.duration_s.mean()),
        segment_s=float(layout.offsets[-1] - layout.offsets[0]) / record.rate_hz,
        cutoff_hz=settings.cutoff_hz,
        rate_hz=record.rate_hz,
        ci_level=settings.ci_level,
        ci_method=f"percentiles of {settings.resamples} resamples of the strides",
        settings=asdict(settings)
        | {
            "instrument": instrument,
            "sha256": record.sha256,
            "jointz": provenance.software()["jointz"],
        },
        warnings=curve_warnings(
            curves, instrument=instrument, n_excluded=n_excluded, n_used=n_used
        ),
    )


def _check_varies(signals: CycleSignals, layout: SegmentLayout, name: str) -> None:
    """Raise EstimationError for a perturbation that repeats with the stride."""
    source = signals.angle if signals.instrument is None else signals.instrument
    cut = source[layout.centres]
    if float(np.sum((cut - cut.mean(axis=0)) ** 2)) > _REPEATED * float(np.sum(cut**2)):
        return
    code = {
        "command": Failure.CONSTANT_COMMAND,
        "torque": Failure.CONSTANT_TORQUE,
        "angle": Failure.CONSTANT_ANGLE,
    }[name]
    raise EstimationError(
        code.value,
        f"{_WHERE}: the {name} is the same in every stride, so nothing is left of it without the "
        "mean over strides. Perturb at random, independently of the stride.",
    )


def _estimate(
    signals: CycleSignals,
    layout: SegmentLayout,
    phase: int,
    perturbed: str,
    weights: np.ndarray,
) -> PhaseEstimate | None:
    """Return the estimate of a phase, None if its equations have no solution."""
    try:
        return estimate_phase(signals, layout, phase, perturbed=perturbed, resampling=weights)
    except (ValueError, np.linalg.LinAlgError):
        return None


#: Undecided: the interval reaches zero, or half of it is more than this share of the parameter's
#: size over the cycle.
_WIDEST = 0.5


def _curve(
    estimates: Sequence[PhaseEstimate | None], k: int, name: str, ci_level: float
) -> ParameterCurve:
    """Return a parameter over the cycle with its intervals."""
    tails = (0.5 * (1.0 - ci_level), 0.5 * (1.0 + ci_level))
    raw = [None if e is None else float(e.fit.values[k]) for e in estimates]
    ends = [None if e is None else np.quantile(e.fit.replicates[:, k], tails) for e in estimates]
    sizes = [abs(value) for value in raw if value is not None]
    widest = _WIDEST * float(np.median(sizes)) if sizes else 0.0
    rows: list[tuple[float | None, float | None, float | None, str]] = []
    for value, end in zip(raw, ends, strict=True):
        if end is None:
            rows.append((None, None, None, Failure.ILL_CONDITIONED.status))
        elif end[0] > 0.0 and 0.5 * (end[1] - end[0]) <= widest:
            rows.append((value, float(end[0]), float(end[1]), "ok"))
        else:
            rows.append((None, None, None, "undecided"))
    values, lows, highs, statuses = zip(*rows, strict=True)
    return ParameterCurve(
        name=name, value=values, ci_low=lows, ci_high=highs, status=statuses, raw=tuple(raw)
    )


def phase_responses(
    estimates: Sequence[PhaseEstimate | None], lags: np.ndarray, rate_hz: float
) -> PhaseResponses:
    """Return the impulse responses of all phases, per second instead of per step."""
    step_s = float(lags[1] - lags[0]) / rate_hz
    each = [None if e is None else e.response for e in estimates]
    return PhaseResponses(
        lag_s=tuple((lags / rate_hz).tolist()),
        response=tuple(tuple((r.response / step_s).tolist()) if r else () for r in each),
        sd=tuple(tuple((r.sd / step_s).tolist()) if r else () for r in each),
        n_kept=tuple(r.n_kept if r else 0 for r in each),
    )


def curve_warnings(
    curves: Sequence[ParameterCurve], *, instrument: str | None, n_excluded: int, n_used: int
) -> tuple[str, ...]:
    """Return warnings for readers of the curves."""
    notes = [
        f"{curve.name} is undecided at {len(curve.value) - curve.n_decided} of "
        f"{len(curve.value)} phases: take more strides, a longer segment or a larger perturbation"
        for curve in curves
        if curve.n_decided < len(curve.value)
    ]
    if any(0 < 2 * curve.n_decided < len(curve.value) for curve in curves):
        notes.append(
            "with most phases undecided the others passed by luck, and values read low: do not "
            "use them"
        )
    notes += _sign_notes(curves)
    if instrument == "torque":
        notes.append(
            "the measured torque is the instrument: a device that reacts to the joint biases K and "
            "J; give the commanded torque"
        )
    if instrument is None:
        notes.append(
            "least squares of torque on angle: torque inside the joint, and movement that varies "
            "between strides, bias K and J towards zero; give the command where there is one"
        )
    if n_excluded > n_used:
        notes.append(f"{n_excluded} of {n_used + n_excluded} strides were excluded")
    return tuple(notes)


def _sign_notes(curves: Sequence[ParameterCurve]) -> list[str]:
    """Return a warning if all of K, B and J are negative over most of the cycle."""
    raw = [[value for value in curve.raw if value is not None] for curve in curves]
    if not all(raw) or any(np.median(values) >= 0.0 for values in raw):
        return []
    return value_warnings([float(np.median(values)) for values in raw])
