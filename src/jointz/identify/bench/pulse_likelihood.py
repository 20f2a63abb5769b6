"""Stiffness, damping and inertia of a bench load from one pulse, noise in both records."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.signal import savgol_filter

from jointz.core.errors import DataError
from jointz.identify.bench.bench_records import BenchTrial, EvenRecord, even_records
from jointz.identify.record.block_regression import t_factor
from jointz.kernels.series.second_order import LikelihoodFit, PulseSignals, maximise_likelihood
from jointz.kernels.series.second_order_recursion import REACH
from jointz.results.bench.bench_fits import PulseFit, estimate
from jointz.results.series.joint_fit import FitSeries

Signal = Literal["response", "raw"]

#: Torque beside the window that a lag may need, s; taken where the record has it.
_LARGEST_LAG_S = 0.02
#: Half-width of the local cubic that start values come from, s.
_SMOOTH_S = 0.01
#: A free lag is searched from each of these, s.
_START_LAGS_S = (0.0, 0.003, 0.007)
#: Whitened residuals this many times their size say that noise or model is wrong.
_LARGE_CHI_SQUARE = 1.5
_LEAST_SD_SHARE = 1e-9  # of the range: a record without noise still has digits
_LARGEST_CONDITION = 1e6
_CI_LEVEL = 0.95
_PARAMETERS = ("stiffness", "damping", "inertia", "torque_lag")


@dataclass(frozen=True, slots=True)
class NoiseLevels:
    """White noise of the two records."""

    angle_sd_rad: float  # may be zero; larger by sqrt(2) after subtraction of an unperturbed record
    torque_sd_nm: float  # likewise


def fit_pulse(
    time_s: np.ndarray,
    angle: np.ndarray,
    torque: np.ndarray,
    *,
    onset_s: float | None = None,
    window_s: float = 0.25,
    signal: Signal = "response",
    noise: NoiseLevels | None = None,
    lag: tuple[float, float] | None = None,
) -> PulseFit:
    """Fit K, B, J and the torque's lag to one pulse by errors-in-variables likelihood.

    Parameters
    ----------
    time_s : (n,) float, s
        Time stamps; 20 ms before and after the window are used where they are there.
    angle : (n,) float, rad
        Angle.
    torque : (n,) float, N*m
        Torque, on the same clock.
    onset_s : float, optional
        Beginning of the window; the first time stamp by default.
    window_s : float
        Length of the window. 100 ms hardly decide B and J; 250 ms do.
    signal : {"response", "raw"}
        ``response``: perturbed minus unperturbed, at rest at ``onset_s``. ``raw``: as
        recorded; initial angle and velocity and an offset of the torque are free.
    noise : NoiseLevels, optional
        Noise of both records; read off the record's fourth differences by default.
    lag : tuple of float, optional
        Value and sd of the torque's lag, s, where it is known; free by default. An sd of
        zero holds it.

    Returns
    -------
    PulseFit
        Estimates and intervals.

    Raises
    ------
    DataError
        When the record cannot be used or the window leaves it.
    EstimationError
        ``constant_angle`` or ``constant_torque``.

    Notes
    -----
    The true torque at every sample is unknown and profiled out, with torque linear
    between samples; see :mod:`jointz.kernels.series.second_order`. With noise of the encoder
    only, the RMSE is within 5 % of the Cramer-Rao bound. A lag between samples
    is a windowed sinc, which leaves white noise white wherever a load can move.
    Where the residuals are larger than the noise says, intervals are widened by them.

    It misleads where the load has friction (0.15 N*m in a 7 N*m pulse move J by some
    percent: use :func:`jointz.identify.bench.full_record.fit_full_record`), where the noise of
    the torque is slow, and where the subtraction leaves motion before the onset. An error
    of the torque's gain moves K, B and J one to one and is not in the intervals.

    Examples
    --------
    >>> t = np.arange(250) / 900.0
    >>> w = 2.0 * np.pi * 4.0
    >>> angle = 0.01 * (1.5 - 2.0 * np.cos(w * t) + 0.5 * np.cos(2.0 * w * t))
    >>> acceleration = 0.02 * w**2 * (np.cos(w * t) - np.cos(2.0 * w * t))
    >>> torque = 100.0 * angle + 0.03 * acceleration
    >>> fit = fit_pulse(t, angle, torque, noise=NoiseLevels(1e-5, 0.01))
    >>> round(fit.parameter("stiffness").value)
    100
    """
    even = even_records([BenchTrial(time_s, angle, torque)])[0]
    start_s = float(even.time_s[0]) if onset_s is None else onset_s
    record, first = _window(even, start_s, window_s, at_rest=signal == "response")
    if lag is not None and lag[1] < 0.0:
        raise DataError(f"fit_pulse: expected an sd of the lag >= 0, got {lag[1]:g} s.")
    levels = noise or _estimated_noise(even)
    best = _best_of_starts(record, levels, lag)
    return _result(best, record, even.time_s[first], levels=levels, lag=lag, signal=signal)


def _window(
    even: EvenRecord, start_s: float, window_s: float, *, at_rest: bool
) -> tuple[PulseSignals, int]:
    """Return the window, and its first sample in the record."""
    step = even.step_s
    first = int(np.ceil((start_s - even.time_s[0]) / step - 1e-6))
    count = int(window_s / step + 1e-6) + 1
    if first < 0 or first + count > even.time_s.size:
        raise DataError(
            f"fit_pulse: expected a record from {start_s:.6g} s over {window_s:g} s, got "
            f"{even.time_s[0]:.6g} to {even.time_s[-1]:.6g} s. Give a longer record or a shorter "
            "window."
        )
    beside = int(np.ceil(_LARGEST_LAG_S / step)) + REACH
    before = min(beside, first)
    torque = even.torque[first - before : first + count + beside]
    # At rest there is no torque before the record; raw records end the search for a lag there.
    missing = beside - before if at_rest else 0
    padded = np.concatenate([np.zeros(missing), torque])
    angle = even.angle[first : first + count].copy()
    if not at_rest:
        angle -= angle.mean()
        padded -= padded.mean()
    return PulseSignals(angle, padded, before + missing, step, at_rest), first


def _estimated_noise(even: EvenRecord) -> NoiseLevels:
    sds = (
        max(even.noise_sd(values), _LEAST_SD_SHARE * float(np.ptp(values)))
        for values in (even.angle, even.torque)
    )
    return NoiseLevels(*sds)


def _best_of_starts(
    record: PulseSignals, levels: NoiseLevels, lag: tuple[float, float] | None
) -> LikelihoodFit:
    """Return the likeliest fit; a free lag is searched further where the first is none."""
    fits: list[LikelihoodFit] = []
    for start_lag in _START_LAGS_S if lag is None else (lag[0],):
        fit = maximise_likelihood(
            record,
            _start(record, start_lag),
            noise_sd=(levels.angle_sd_rad, levels.torque_sd_nm),
            lag_prior=lag,
        )
        fits.append(fit)
        if fit.converged and fit.chi_square < _LARGE_CHI_SQUARE * fit.n_residuals:
            break
    return min(fits, key=lambda fit: (not fit.converged, fit.chi_square))


def _smooth_motion(record: PulseSignals) -> np.ndarray:
    """Return (3, n): angle, velocity, acceleration of a local cubic."""
    half = max(3, round(_SMOOTH_S / record.step_s))
    width = min(2 * half + 1, (record.angle.size - 1) // 2 * 2 + 1)
    angle, step_s = record.angle, record.step_s
    return np.stack([savgol_filter(angle, width, 3, deriv=k, delta=step_s) for k in range(3)])


def _start(record: PulseSignals, lag_s: float) -> np.ndarray:
    """Return K, B, J, lag, offset from a regression on the smoothed motion."""
    motion = _smooth_motion(record)
    torque = _shifted_torque(record, lag_s)
    columns = np.column_stack([*motion, np.ones(torque.size)])
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    K, B, J, offset = np.linalg.lstsq(columns / size, torque, rcond=None)[0] / size
    scale = np.std(torque) / np.maximum(np.std(motion, axis=1), 1e-300)
    K, J = max(K, 1e-2 * scale[0]), max(J, 1e-2 * scale[2])
    return np.array([K, max(B, 0.0), J, lag_s, 0.0 if record.at_rest else offset])


def _shifted_torque(record: PulseSignals, lag_s: float) -> np.ndarray:
    at = record.lead + lag_s / record.step_s + np.arange(record.angle.size)
    return np.asarray(np.interp(at, np.arange(record.torque.size), record.torque))


def _result(
    fit: LikelihoodFit,
    record: PulseSignals,
    start_s: float,
    *,
    levels: NoiseLevels,
    lag: tuple[float, float] | None,
    signal: Signal,
) -> PulseFit:
    freedom = fit.n_residuals - int(np.count_nonzero(np.diag(fit.covariance)))
    reduced = fit.chi_square / max(freedom, 1)
    names = _PARAMETERS if lag is None or lag[1] > 0.0 else _PARAMETERS[:3]
    covariance = max(reduced, 1.0) * fit.covariance[: len(names), : len(names)]
    usable = fit.converged and fit.condition_number < _LARGEST_CONDITION
    sds = np.sqrt(np.diag(covariance)) if usable else np.full(len(names), np.inf)
    common: dict[str, Any] = {"ci_level": _CI_LEVEL, "ci_method": "information of the likelihood"}
    factor = t_factor(_CI_LEVEL, max(freedom, 1))
    time = start_s + record.step_s * np.arange(record.angle.size)
    torque = _shifted_torque(record, float(fit.values[3]))
    torque = torque - fit.values[4]
    modelled = fit.values[:3] @ _smooth_motion(record)
    residual = torque - modelled
    return PulseFit(
        parameters=tuple(
            estimate(name, float(value), float(sd), t_factor=factor, common=common)
            for name, value, sd in zip(names, fit.values, sds, strict=False)
        ),
        lag_model="delay" if lag is None else "given",
        filter_time_s=0.0,
        vaf_pct=float(100.0 * (1.0 - np.sum(residual**2) / np.sum(torque**2))),
        residual_sd_nm=float(np.std(residual)),
        n_samples=record.angle.size,
        rate_hz=1.0 / record.step_s,
        condition_number=fit.condition_number,
        covariance=tuple(tuple(row) for row in covariance.tolist()) if usable else (),
        settings={
            "signal": signal,
            "angle_sd_rad": levels.angle_sd_rad,
            "torque_sd_nm": levels.torque_sd_nm,
            "lag_s": None if lag is None else lag[0],
            "lag_sd_s": None if lag is None else lag[1],
            "chi_square_per_freedom": reduced,
            "ci_level": _CI_LEVEL,
        },
        warnings=_warnings(fit, reduced),
        series=FitSeries(tuple(time.tolist()), tuple(torque.tolist()), tuple(modelled.tolist())),
    )


def _warnings(fit: LikelihoodFit, reduced: float) -> tuple[str, ...]:
    notes = []
    if not fit.converged:
        notes.append("undecided: the search for the largest likelihood did not end")
    elif fit.condition_number >= _LARGEST_CONDITION:
        notes.append("undecided: the window does not tell the parameters apart; take a longer one")
    if reduced > _LARGE_CHI_SQUARE:
        notes.append(
            f"residuals are {np.sqrt(reduced):.1f} times the noise: friction, slow noise, motion "
            "before the onset or wrong noise levels; intervals were widened"
        )
    return tuple(notes)
