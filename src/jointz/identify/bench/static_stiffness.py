"""Static stiffness of a bench (3.2.2): the slope of torque over angle, moved slowly."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.bench_estimates import NEGATIVE_STIFFNESS, bench_estimates, check_excited
from jointz.identify.bench.bench_records import FEWEST_SAMPLES, white_noise_sd
from jointz.identify.record.block_regression import BlockRegression, regress
from jointz.identify.record.joint_record import JointRecord, Samples, check_level, gather_record
from jointz.kernels.filtering import lowpass_zero_phase
from jointz.results.bench.stiffness_fit import LoopSeries, StiffnessFit

_WHERE = "identify_static_stiffness"
#: A slope that explains less of the torque is undecided, %.
_LEAST_VAF_PCT = 50.0
#: Length that the low-pass distorts at both ends of a record, in periods of its cut-off.
_EDGE_PERIODS = 4.5
#: Share of noise in the angle's variance: noted above the first, refused above the second.
_TOLD_NOISE_SHARE = 1e-3
_MOST_NOISE_SHARE = 0.05
_FEWEST_OF_A_DIRECTION = 0.05
_WORST_CONDITION = 1e6
_SERIES_POINTS = 1500


def identify_static_stiffness(
    recording: Samples | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    direction: npt.ArrayLike | None = None,
    cutoff_hz: float | None = None,
    ci_level: float = 0.95,
) -> StiffnessFit:
    """Fit the slope of torque over angle to a slow bench record.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``angle``, ``torque`` and, where there are, ``time`` and ``direction``,
        in SI. Either this or the arrays.
    angle : (n,) float, rad, optional
        Deflection of what is measured.
    torque : (n,) float, N*m, optional
        Torque on it.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; a gap is an error.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps.
    direction : (n,) float, optional
        Its sign says which way the **angle** goes: the slope of the angle, low-passed until
        its sign is no noise. Given, friction against the motion is fitted beside the
        stiffness: a constant one and a share of the torque. Samples where it is zero are
        left out: the angle stands, and friction may be anything.
    cutoff_hz : float, optional
        Zero-phase low-pass of angle and torque, as 3.2.3 has it, its ends cut off; none
        by default.
    ci_level : float
        Level of the intervals.

    Returns
    -------
    StiffnessFit
        ``stiffness`` and, with a direction, ``coulomb_friction`` and ``load_friction``.

    Raises
    ------
    DataError
        When the samples cannot be trusted (missing channel, NaN, gap, fewer than 50), or a
        setting is out of range.
    EstimationError
        ``constant_angle`` where the angle stands still or moves no more than its noise,
        ``constant_torque``, ``ill_conditioned``.

    Notes
    -----
    Ordinary least squares with an offset. Intervals from a block sandwich with blocks
    longer than the residual stays correlated
    (:func:`jointz.kernels.block_sandwich.block_sandwich`), Student's t: they do not know the
    gain of a sensor, and an error that comes back with every cycle (hysteresis without a
    ``direction``, cogging) moves the slope more than they say. Damping and inertia are
    taken to be nothing: move slowly. Noise of the angle lowers the slope by its share of
    the angle's variance, which is told where it matters.

    With a direction, loading and unloading weigh alike at every angle, and friction that is
    the same both ways cancels. The slope of the **command** is no such direction: the angle
    stands still while friction turns, and the stiffness reads high (1.7 to 2.6 % on the
    simulated bench of 3.2.2, 6 seeds; the angle's own direction leaves 0.1 to 0.9 %, mean
    0.4 %, in 10 seeds: cogging, and friction that grows with the speed). The intervals do
    not hold such an error: 8 of 10 of those held the truth.

    Examples
    --------
    >>> t = np.arange(6000) / 100.0
    >>> angle = 0.07 * np.sin(2 * np.pi * 0.1 * t)
    >>> noise = np.random.default_rng(0).normal(scale=0.1, size=t.size)
    >>> fit = identify_static_stiffness(angle=angle, torque=146.0 * angle + noise, rate_hz=100.0)
    >>> round(fit.parameter("stiffness").value)
    146
    """
    arrays = {"angle": angle, "torque": torque, "time": time, "direction": direction}
    record = gather_record(recording, arrays, rate_hz=rate_hz, where=_WHERE)
    check_level(_WHERE, ci_level)
    check_excited(_WHERE, record.channels)
    _check_direction(record)
    deflection, load, way = _prepared(record, cutoff_hz)
    columns = {"stiffness": deflection, "bias": np.ones(deflection.size)}
    if way is not None:
        columns |= {"coulomb_friction": way, "load_friction": way * np.abs(load)}
    fit = regress(load, columns, record.rate_hz, ci_level)
    if not fit.condition_number < _WORST_CONDITION:
        raise EstimationError(
            Failure.ILL_CONDITIONED,
            f"{_WHERE}: angle and friction cannot be told apart. Leave the direction out, or "
            "record torques of several sizes both ways.",
        )
    share = _noise_share(record, fit, deflection, cutoff_hz)
    vaf_pct = 100.0 * (1.0 - float(np.var(fit.residual) / np.var(load)))
    if vaf_pct < _LEAST_VAF_PCT and not fit.doubt:
        fit = replace(
            fit,
            doubt=f"the angle explains {max(vaf_pct, 0.0):.2g} % of the torque: check that angle "
            "and torque are not exchanged; move slowly, damping and inertia must not count",
        )
    kept = [i for i, name in enumerate(fit.names) if name != "bias"]
    half_width = np.full(len(fit.names), np.nan) if fit.doubt else fit.half_width
    return StiffnessFit(
        method="static",
        parameters=bench_estimates(
            {fit.names[i]: fit.values[i] for i in kept},
            half_width[kept],
            ci_level=ci_level,
            ci_method=fit.ci_method,
        ),
        vaf_pct=vaf_pct,
        frequency_hz=None,
        excursion_rad=float(np.ptp(deflection)),
        n_samples=load.size,
        rate_hz=record.rate_hz,
        ci_method=fit.ci_method,
        settings={
            "cutoff_hz": cutoff_hz,
            "friction": way is not None,
            "angle_noise_share": share,
            "ci_level": ci_level,
            **record.origin(),
        },
        warnings=_warnings(fit, share),
        series=_series(deflection, load, load - fit.residual),
    )


def _check_direction(record: JointRecord) -> None:
    if "direction" not in record.channels:
        return
    ways = np.sign(record.channels["direction"])
    rarer = min(float(np.mean(ways > 0)), float(np.mean(ways < 0)))
    if rarer < _FEWEST_OF_A_DIRECTION:
        raise DataError(
            f"{_WHERE}: direction: expected motion both ways, got {100.0 * rarer:.2g} % of "
            "the samples one way. Record a whole cycle, or leave the direction out.",
            channel="direction",
        )


def _spoilt_samples(record: JointRecord, cutoff_hz: float) -> int:
    """Return the samples that the low-pass spoils at either end; refuse a useless low-pass."""
    half = record.rate_hz / 2.0
    if not 0.0 < cutoff_hz < half:
        raise DataError(
            f"{_WHERE}: cutoff_hz: expected between 0 and half the sampling rate, {half:g} Hz, "
            f"got {cutoff_hz:g}."
        )
    edge = round(_EDGE_PERIODS / cutoff_hz * record.rate_hz)
    if record.time.size - 2 * edge < FEWEST_SAMPLES:
        raise DataError(
            f"{_WHERE}: cutoff_hz {cutoff_hz:g} spoils {_EDGE_PERIODS / cutoff_hz:.3g} s at "
            f"both ends of the record of {record.seconds:.3g} s. Record longer, or raise "
            "cutoff_hz."
        )
    return edge


def _prepared(
    record: JointRecord, cutoff_hz: float | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return angle, torque and the sign of the direction, low-passed if requested.

    Samples where the angle stands are left out: friction may be anything there.
    """
    angle, torque = record.channels["angle"], record.channels["torque"]
    way = np.sign(record.channels["direction"]) if "direction" in record.channels else None
    if cutoff_hz is not None:
        edge = _spoilt_samples(record, cutoff_hz)
        inside = slice(edge, record.time.size - edge)
        angle, torque = (
            lowpass_zero_phase(x, cutoff_hz=cutoff_hz, rate_hz=record.rate_hz)[inside]
            for x in (angle, torque)
        )
        way = None if way is None else way[inside]
    angle = angle - angle.mean()
    if way is None or way.all():
        return angle, torque, way
    moving = way != 0.0
    return angle[moving], torque[moving], way[moving]


def _noise_share(
    record: JointRecord, fit: BlockRegression, deflection: np.ndarray, cutoff_hz: float | None
) -> float:
    """Return the share of noise in the angle's variance; refuse a large one.

    Steps from level to level read as noise too, but noise would be seen in the residual.
    """
    noise_sd = white_noise_sd(record.channels["angle"])
    if cutoff_hz is not None:
        noise_sd *= float(np.sqrt(2.0 * cutoff_hz / record.rate_hz))
    moved = float(np.var(deflection))
    unexplained = float(np.var(fit.residual)) / max(
        float(np.var(fit.residual)) + moved * (fit.value("stiffness") ** 2), 1e-300
    )
    share = min(noise_sd**2 / moved, unexplained)
    if share > _MOST_NOISE_SHARE:
        raise EstimationError(
            Failure.CONSTANT_ANGLE,
            f"{_WHERE}: expected an angle that moves much more than its noise, got "
            f"{1000.0 * moved**0.5:.3g} mrad (rms) with noise of {1000.0 * noise_sd:.3g} mrad. "
            "Load the bench more, or give cutoff_hz.",
        )
    return share


def _warnings(fit: BlockRegression, share: float) -> tuple[str, ...]:
    warnings = [f"undecided: {fit.doubt}"] if fit.doubt else []
    warnings += [fit.caution] if fit.caution else []
    if fit.value("stiffness") < 0.0:
        warnings.append(NEGATIVE_STIFFNESS)
    if share > _TOLD_NOISE_SHARE:
        warnings.append(
            f"about {100.0 * share:.2g} % of the angle's variance is noise: the stiffness reads "
            "low by as much"
        )
    return tuple(warnings)


def _series(angle: np.ndarray, measured: np.ndarray, modelled: np.ndarray) -> LoopSeries:
    """Thin the loop for a figure."""
    shown = slice(None, None, max(1, -(-angle.size // _SERIES_POINTS)))
    columns = (angle, measured - measured.mean(), modelled - measured.mean())
    return LoopSeries(*(tuple(values[shown].tolist()) for values in columns))
