"""Stiffness, damping and inertia of a bench load from whole trials, without subtraction."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from jointz.core.errors import DataError
from jointz.identify.bench.bench_band import BandRecord, band_hz, band_record
from jointz.identify.bench.bench_lag import LARGEST_CONDITION, LagChoice, LagKind, choose_lag
from jointz.identify.bench.bench_records import BenchTrial, EvenRecord, even_records
from jointz.identify.bench.bench_regression import (
    LONGEST_LAG_S,
    SHORTEST_LAG_S,
    LoadModel,
    LoadRegression,
)
from jointz.identify.record.block_regression import t_factor
from jointz.identify.record.joint_record import PARAMETERS, check_level
from jointz.results.bench.bench_fits import FullRecordFit, estimate
from jointz.results.estimates import ParameterEstimate
from jointz.results.series.joint_fit import FitSeries

_WHERE = "fit_full_record"
#: Below this share of samples with known friction, a note is made.
_FEW_KEPT = 0.3
#: Angle noise that would take this share off inertia, were it not corrected, is noted.
_NOISE_SHARE = 0.003
#: A direction that is one and the same is an offset.
_LEAST_DIRECTION_SD = 0.05
#: A load is explained if the residual, less what noise of the angle adds to it,
#: has at most so many times the power of the torque's white noise.
_MOST_UNEXPLAINED = 1.5
_SERIES_S = 3.0
_DAMPING = 1  # its place among the parameters
_SERIES_POINTS = 1500


@dataclass(frozen=True, slots=True)
class Impedance:
    """Known impedance to subtract, such as the intrinsic one of the actuator.

    Parameters
    ----------
    stiffness, damping, inertia : float
        N*m/rad, N*m*s/rad, kg*m^2.
    stiffness_sd, damping_sd, inertia_sd : float
        Their standard deviations.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    inertia: float = 0.0
    stiffness_sd: float = 0.0
    damping_sd: float = 0.0
    inertia_sd: float = 0.0


def fit_full_record(
    trials: Sequence[BenchTrial],
    *,
    friction: bool = True,
    lag_s: float | tuple[float, float] | None = None,
    lag_model: LagKind | None = None,
    intrinsic: Impedance | None = None,
    torque_gain_sd: float = 0.0,
    angle_gain_sd: float = 0.0,
    ci_level: float = 0.95,
) -> FullRecordFit:
    """Fit K, B, J, Coulomb friction and the torque's lag to all samples of all trials.

    Parameters
    ----------
    trials : sequence of BenchTrial
        Trials of one load, of one or more references; nothing subtracted, nothing cut.
    friction : bool
        Whether a torque of constant size against the motion is part of the model.
    lag_s : float or tuple of float, optional
        Known lag of the torque record, positive where it is late, or the lag and its sd;
        estimated by default. Without an sd it is held.
    lag_model : {"delay", "first_order", "mixed"}, optional
        What the lag is; tested by default (a given lag is a delay then).
    intrinsic : Impedance, optional
        Subtracted from the estimates, its sd added to theirs.
    torque_gain_sd, angle_gain_sd : float
        Relative sd of what is left of the gains after calibration. It is common to
        all samples, so no residual shows it; it enters the intervals.
    ci_level : float
        Level of the intervals.

    Returns
    -------
    FullRecordFit
        Estimates, intervals, and which lag was chosen.

    Raises
    ------
    DataError
        When a record cannot be used, or an argument makes no sense.
    EstimationError
        ``constant_angle`` or ``constant_torque``.

    Notes
    -----
    ``torque(t + lag) = K*angle + B*velocity + J*acceleration + c*sign(velocity) + offset``,
    one offset a trial, inside a band of 40 Hz, where the angle's noise is small and is
    corrected. Samples near low speed that lasts are left out: static friction there
    takes any value up to c. If the rest does not decide K, B, J and the lag, and a model without
    friction explains all samples within the noise, friction is left out of the model. Intervals
    come from a block sandwich over blocks of 1 s or more and Student's t.

    A first-order filter that is taken for a delay of the same lag raises J by 0.2-0.5 %.
    So both are fitted, with a test whether the filter's spread differs from either; where
    neither is refused, or both are, delay and filter are fitted together. The intervals hold
    what the other kind would change.

    The lag is searched from -10 to 20 ms. A spring with little inertia moves in step with
    its torque: its lag T and a damping K*T are then one and the same. Where a lag 2 ms from
    the best one fits nearly as well, lag and damping are ``undecided``, the lag is held at
    the value nearest to zero that is not refused (or at the known one), and the intervals of
    the others take in all lags that are not refused.

    It misleads when the torque has a gain error (K and J take it one to one), when the
    load is not linear, when the angle is late too (only the difference of the lags is
    seen), and when there are no transients: a single sine cannot tell K from J.

    Source: SCIENCE, section 4 "Bench"; equation (2.1) of the dissertation.

    Examples
    --------
    >>> t = np.arange(9000) / 900.0
    >>> angle = 0.03 * np.sin(7.0 * t) + 0.01 * np.sin(40.0 * t)
    >>> torque = 160.0 * angle - 0.04 * (1.47 * np.sin(7.0 * t) + 16.0 * np.sin(40.0 * t))
    >>> fit = fit_full_record([BenchTrial(t, angle, torque)], friction=False)
    >>> round(fit.parameter("stiffness").value, 2)
    160.0
    """
    check_level(_WHERE, ci_level)
    known = _known_lag(lag_s)
    if min(torque_gain_sd, angle_gain_sd) < 0.0:
        raise DataError(
            f"{_WHERE}: expected gain sds >= 0, got {torque_gain_sd:g} and {angle_gain_sd:g}. Give "
            "relative sds, such as 0.01."
        )
    even = even_records(trials)
    records = [band_record(record, friction=friction) for record in even]
    notes: list[str] = []
    friction = friction and _friction_can_be_told(records, notes)
    chosen = choose_lag(LoadModel(records, friction), known_s=known, kind=lag_model)
    if friction and not _decided(chosen):
        without = _without_friction(even, records, known_s=known, kind=lag_model)
        if without is not None:
            chosen, records, friction = without[0], without[1], False
            notes.append(
                "no friction shows where the load is slow or at rest, within the noise of the "
                "torque: it was left out of the model"
            )
    regression = chosen.regression
    notes += _quality_notes(records, chosen)
    if chosen.kind == "mixed" and lag_model is None:
        notes.append(_mixed_note(chosen))
    values, covariance = _calibrated(
        regression, chosen.covariance, intrinsic=intrinsic, gain_sd=(torque_gain_sd, angle_gain_sd)
    )
    if any(trial.angle_per_torque_sd for trial in trials):
        twisted = [replace(t, angle=t.angle - t.angle_per_torque_sd * t.torque) for t in trials]
        bands = [band_record(record, friction=friction) for record in even_records(twisted)]
        other = choose_lag(LoadModel(bands, friction), known_s=known, kind=chosen.kind)
        covariance = covariance + _twist_covariance(chosen, other)
    held = known is not None and known[1] == 0.0
    names = [*PARAMETERS, *["coulomb_friction"] * friction, *["torque_lag"] * (not held)]
    covariance = _of_parameters(covariance, chosen, len(names))
    complete = bool(np.isfinite(covariance).all())
    return FullRecordFit(
        parameters=_parameters(
            dict(zip(names, values, strict=False)),
            np.sqrt(np.diag(covariance)),
            n_blocks=chosen.n_blocks,
            n_fitted=len(chosen.covariance),
            ci_level=ci_level,
        ),
        lag_model="given" if held and lag_model is None else chosen.kind,
        filter_time_s=regression.lag.filter_time_s,
        vaf_pct=100.0 * (1.0 - _power(regression.residual) / _power(regression.measured)),
        residual_sd_nm=float(np.std(regression.residual)),
        n_samples=regression.residual.size,
        rate_hz=1.0 / even[0].step_s,
        condition_number=regression.condition_number,
        covariance=tuple(tuple(row) for row in covariance.tolist()) if complete else (),
        settings={
            "n_trials": len(records),
            "friction": friction,
            "lag_s": known[0] if known else None,
            "lag_sd_s": known[1] if known else None,
            "band_sd_hz": band_hz(even[0].step_s),
            "torque_gain_sd": torque_gain_sd,
            "angle_gain_sd": angle_gain_sd,
            "intrinsic": asdict(intrinsic) if intrinsic else None,
            "ci_level": ci_level,
            "within_noise": _is_within_noise(regression, records),
        },
        warnings=tuple(notes),
        series=_series(even[0], records[0], regression),
    )


def _decided(chosen: LagChoice) -> bool:
    """Return whether the records decide K, B, J and the lag."""
    well = chosen.regression.condition_number <= LARGEST_CONDITION
    return well and chosen.n_blocks > 0 and chosen.range_s is None


def _is_within_noise(regression: LoadRegression, records: Sequence[BandRecord]) -> bool:
    """Return whether the load leaves no more of the torque than white noise of both signals."""
    noise = sum(record.torque_noise_nm2 * record.keep.sum() for record in records)
    return bool(regression.cost <= _MOST_UNEXPLAINED * noise)


def _without_friction(
    even: Sequence[EvenRecord],
    records: Sequence[BandRecord],
    *,
    known_s: tuple[float, float] | None,
    kind: LagKind | None,
) -> tuple[LagChoice, list[BandRecord]] | None:
    """Return the fit to all samples without friction; None if they show any, or decide nothing.

    Where friction may hold the load, its torque is unknown and the samples are left out. If a
    model without friction leaves the torque's noise only, there as elsewhere, none held it. What
    friction would change at the same lag is added to the covariance.
    """
    every = [band_record(record, friction=False) for record in even]
    chosen = choose_lag(LoadModel(every, friction=False), known_s=known_s, kind=kind)
    regression = chosen.regression
    if not _decided(chosen) or not _is_within_noise(regression, every):
        return None
    with_friction = LoadModel(records, friction=True).fit_at(regression.lag)
    moved = np.zeros(len(chosen.covariance))
    moved[:3] = with_friction.values[:3] - regression.values[:3]
    return replace(chosen, covariance=chosen.covariance + np.outer(moved, moved)), every


def _twist_covariance(chosen: LagChoice, other: LagChoice) -> np.ndarray:
    """Return the covariance by one sd of torque seen as angle: the square of the change."""
    moved = np.zeros(len(chosen.covariance))
    n = chosen.regression.values.size
    moved[:n] = other.regression.values - chosen.regression.values
    if moved.size > n:
        moved[n] = other.regression.lag.total_s - chosen.regression.lag.total_s
    return np.outer(moved, moved)


def _known_lag(lag_s: float | tuple[float, float] | None) -> tuple[float, float] | None:
    if lag_s is None:
        return None
    value, sd = lag_s if isinstance(lag_s, tuple) else (lag_s, 0.0)
    if not sd >= 0.0:
        raise DataError(f"{_WHERE}: expected an sd of the lag >= 0, got {sd:g} s.")
    return value, sd


def _of_parameters(covariance: np.ndarray, chosen: LagChoice, count: int) -> np.ndarray:
    """Return the covariance of the decided parameters; infinite for the others."""
    out = np.full((count, count), np.inf)
    if chosen.contradicted:
        return out
    if chosen.n_blocks > 0 and chosen.regression.condition_number <= LARGEST_CONDITION:
        n = min(count, len(covariance))
        out[:n, :n] = covariance[:n, :n]
        if chosen.range_s is not None:  # a lag is a damping
            out[_DAMPING, :] = out[:, _DAMPING] = np.inf
        if chosen.at_end:  # what a longer lag would change of all but K is unknown
            out[_DAMPING:, :] = out[:, _DAMPING:] = np.inf
    return out


def _friction_can_be_told(records: Sequence[BandRecord], notes: list[str]) -> bool:
    """Return whether the motion reverses where friction is known."""
    for record in records:
        direction = np.fft.irfft(record.window * record.direction, record.torque.size)
        if record.keep.any() and np.std(direction[record.keep]) > _LEAST_DIRECTION_SD:
            return True
    notes.append(
        "the direction of motion is smaller than the noise of the angle, or never reverses: "
        "friction was left out of the model"
    )
    for record in records:
        record.keep[:] = record.inside
    return False


def _calibrated(
    regression: LoadRegression,
    covariance: np.ndarray,
    *,
    intrinsic: Impedance | None,
    gain_sd: tuple[float, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Subtract the intrinsic impedance; add the error of the calibration to the covariance.

    Rows beyond the values' belong to the lag; the first of them is its total where that is
    free.
    """
    by_torque = np.zeros(len(covariance))
    by_torque[: regression.values.size] = regression.values
    by_angle = np.zeros(len(covariance))
    by_angle[:3] = regression.values[:3]
    known = intrinsic or Impedance()
    known_sds = np.zeros(len(covariance))
    known_sds[:3] = known.stiffness_sd, known.damping_sd, known.inertia_sd
    values = np.append(regression.values, regression.lag.total_s)
    values[:3] -= known.stiffness, known.damping, known.inertia
    added = gain_sd[0] ** 2 * np.outer(by_torque, by_torque)
    added += gain_sd[1] ** 2 * np.outer(by_angle, by_angle) + np.diag(known_sds**2)
    return values, covariance + added


def _parameters(
    values: dict[str, float],
    sds: np.ndarray,
    *,
    n_blocks: int,
    n_fitted: int,
    ci_level: float,
) -> tuple[ParameterEstimate, ...]:
    """Return the estimates; an infinite sd leaves one undecided."""
    freedom = max(n_blocks - n_fitted, 1)
    common: dict[str, Any] = {
        "ci_level": ci_level,
        "ci_method": (
            f"sandwich over {n_blocks} blocks, calibration sd added, Student's t with {freedom} "
            "degrees of freedom"
        ),
    }
    factor = t_factor(ci_level, freedom)
    return tuple(
        estimate(name, float(value), float(sd), t_factor=factor, common=common)
        for (name, value), sd in zip(values.items(), sds, strict=True)
    )


def _quality_notes(records: Sequence[BandRecord], chosen: LagChoice) -> list[str]:
    notes, regression = [], chosen.regression
    if chosen.n_blocks == 0:
        notes.append("undecided: the records are too short for an interval; record longer")
    if regression.condition_number > LARGEST_CONDITION:
        notes.append(
            "undecided: the motion is too simple to tell the parameters apart, such as one sine; "
            "add pulses"
        )
    if chosen.contradicted:
        notes.append(
            "undecided: the records contradict the known lag of the torque by more than 4.5 sd and "
            "2 ms. Check its sign and the clocks of torque and angle; a reflex looks like a lag"
        )
    if chosen.at_end:
        notes.append(
            "damping and inertia are undecided: the lag that fits best is at an end of the search, "
            f"{1e3 * SHORTEST_LAG_S:.0f} to {1e3 * LONGEST_LAG_S:.0f} ms: torque and angle may not "
            "share a clock. Shift one of them, or give the lag where it is known"
        )
    if chosen.range_s is not None:
        low, high = (1e3 * t for t in chosen.range_s)
        held = round(1e3 * regression.lag.total_s, 1) + 0.0  # no -0
        notes.append(
            f"damping and lag are undecided: lags from {low:.0f} to {high:.0f} ms fit alike, as a "
            f"load with little inertia lets them; held at {held:g} ms. Give the lag where it is "
            "known"
        )
    kept = regression.residual.size / sum(record.torque.size for record in records)
    if kept < _FEW_KEPT:
        notes.append(
            f"friction may hold the load most of the time: only {kept:.0%} of the samples were used"
        )
    share = regression.noise_share
    if share > _NOISE_SHARE:
        notes.append(
            f"noise of the angle would take {share:.1%} off inertia; corrected with the noise's sd "
            "out of the record, so expect a tenth of it to remain"
        )
    return notes


def _mixed_note(chosen: LagChoice) -> str:
    sd = float(np.sqrt(chosen.covariance[-1, -1]))
    spread = chosen.regression.lag.spread_s2
    low, high = (1e3 * np.sqrt(max(spread + s * sd, 0.0)) for s in (-2.0, 2.0))
    return (
        f"the lag holds a first-order filter of {low:.1f} to {high:.1f} ms besides a delay, or the "
        "data do not tell; both were fitted"
    )


def _power(x: np.ndarray) -> float:
    return float(np.mean(x**2))


def _series(even: EvenRecord, record: BandRecord, regression: LoadRegression) -> FitSeries:
    """Return the middle of the first trial, thinned; samples left out are not drawn."""
    count = int(record.keep.sum())
    time = even.time_s[record.keep]
    middle = float(np.median(time)) if count else 0.0
    shown = np.flatnonzero(np.abs(time - middle) <= _SERIES_S / 2.0)
    shown = shown[:: max(1, shown.size // _SERIES_POINTS)]
    measured = regression.measured[:count]
    columns = (time, measured, measured - regression.residual[:count])
    return FitSeries(*(tuple(column[shown].tolist()) for column in columns))
