"""Dither stiffness of a bench (3.2.3): torque over angle at the frequency of a dither."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.identify.bench.bench_estimates import NEGATIVE_STIFFNESS, bench_estimates, check_excited
from jointz.identify.record.block_regression import BlockPlan, fitted_sandwich, t_factor
from jointz.identify.record.joint_record import JointRecord, Samples, check_level, gather_record
from jointz.kernels.block_sandwich import block_sandwich
from jointz.results.bench.stiffness_fit import LoopSeries, StiffnessFit

_WHERE = "identify_dither_stiffness"
_FEWEST_CYCLES = 3
#: The dither's amplitude must be this many of its standard deviations.
_LEAST_SDS = 5.0
_SERIES_POINTS = 200


@dataclass(frozen=True, slots=True)
class _Harmonic:
    """A signal's part at the dither's frequency."""

    # complex amplitude, unit of the signal: the part is the real part of phasor * exp(j omega t)
    phasor: complex
    residual: np.ndarray  # rest of the signal, offset removed


def identify_dither_stiffness(
    recording: Samples | None = None,
    *,
    angle: npt.ArrayLike | None = None,
    torque: npt.ArrayLike | None = None,
    time: npt.ArrayLike | None = None,
    rate_hz: float | None = None,
    frequency_hz: float,
    inertia: float = 0.0,
    ci_level: float = 0.95,
) -> StiffnessFit:
    """Fit stiffness and damping to torque and angle at the frequency of a dither.

    Parameters
    ----------
    recording : xarray.Dataset, mapping or pandas.DataFrame, optional
        Channels ``angle``, ``torque`` and, where there is, ``time``, in SI. Either this or
        the arrays.
    angle : (n,) float, rad, optional
        Deflection of what is measured.
    torque : (n,) float, N*m, optional
        Torque on it.
    time : (n,) float, s, optional
        Time stamps. Jitter is resampled linearly; a gap is an error.
    rate_hz : float, optional
        Sampling rate, where there are no time stamps.
    frequency_hz : float
        Of the dither.
    inertia : float, kg*m^2
        What the torque accelerates with the angle. Its torque is put back:
        stiffness = Re(torque / angle) + inertia * omega^2.
    ci_level : float
        Level of the intervals.

    Returns
    -------
    StiffnessFit
        ``stiffness`` and ``damping`` = Im(torque / angle) / omega.

    Raises
    ------
    DataError
        When the samples cannot be trusted (missing channel, NaN, gap), the record holds
        fewer than three cycles, or a setting is out of range.
    EstimationError
        ``constant_angle``, ``constant_torque``; ``not_coherent`` where the angle moves at
        this frequency by less than five standard deviations of its noise.

    Notes
    -----
    Angle and torque are each fitted by least squares with cosine, sine and offset over
    whole cycles; the ratio of the two complex amplitudes is that of (1.2) at one
    frequency. Noise of the angle away from the dither does not lower it. Intervals: the
    ratio's linearised influence of every sample, summed over blocks longer than it stays
    correlated (:func:`jointz.kernels.block_sandwich.block_sandwich`), Student's t. They do
    not know a sensor's gain; a torque record late by tau turns omega*tau*stiffness into
    negative damping. What else moves is left over, so its frequencies must differ from
    the dither's by more than one over the length of the record.

    Examples
    --------
    >>> t = np.arange(30_000) / 1000.0
    >>> omega = 2 * np.pi * 5.0
    >>> angle = 0.01 * np.sin(omega * t)
    >>> torque = 146.0 * angle + 0.1 * 0.01 * omega * np.cos(omega * t)
    >>> fit = identify_dither_stiffness(angle=angle, torque=torque, rate_hz=1e3, frequency_hz=5.0)
    >>> [round(p.value, 3) for p in fit.parameters]
    [146.0, 0.1]
    """
    arrays = {"angle": angle, "torque": torque, "time": time}
    record = gather_record(recording, arrays, rate_hz=rate_hz, where=_WHERE)
    check_level(_WHERE, ci_level)
    check_excited(_WHERE, record.channels)
    record = _whole_cycles(record, frequency_hz, inertia)
    omega = 2.0 * np.pi * frequency_hz
    seconds = record.time - record.time[0]
    columns = np.column_stack(
        [np.cos(omega * seconds), np.sin(omega * seconds), np.ones(seconds.size)]
    )
    inverse = np.linalg.pinv(columns)
    weights = inverse[0] - 1j * inverse[1]
    moved, load = (_harmonic(record.channels[n], columns, inverse) for n in ("angle", "torque"))
    _check_amplitude(moved, weights, record, frequency_hz)
    ratio = load.phasor / moved.phasor
    influence = weights * (load.residual - ratio * moved.residual) / moved.phasor
    scores = np.column_stack([influence.real, influence.imag / omega])
    plan = BlockPlan.of(record.channels["torque"], load.residual, scores, record.rate_hz)
    values = {"stiffness": ratio.real + inertia * omega**2, "damping": ratio.imag / omega}
    return StiffnessFit(
        method="dither",
        parameters=bench_estimates(
            values,
            _half_widths(scores, plan, ci_level),
            ci_level=ci_level,
            ci_method=plan.ci_method,
        ),
        vaf_pct=100.0 * (1.0 - float(np.var(load.residual) / np.var(record.channels["torque"]))),
        frequency_hz=float(frequency_hz),
        excursion_rad=float(abs(moved.phasor)),
        n_samples=seconds.size,
        rate_hz=record.rate_hz,
        ci_method=plan.ci_method,
        settings={"inertia": inertia, "ci_level": ci_level, **record.origin()},
        warnings=_warnings(values, plan),
        series=_series(moved, load, omega * seconds),
    )


def _whole_cycles(record: JointRecord, frequency_hz: float, inertia: float) -> JointRecord:
    """Return the record cut to whole cycles of the dither."""
    problems = []
    if not 0.0 < frequency_hz < record.rate_hz / 2.0:
        problems.append(
            f"frequency_hz: expected between 0 and half the sampling rate, "
            f"{record.rate_hz / 2.0:g} Hz, got {frequency_hz:g}."
        )
    if not 0.0 <= inertia < np.inf:
        problems.append(f"inertia: expected >= 0 kg*m^2, got {inertia:g}.")
    if problems:
        raise DataError(f"{_WHERE}: " + " ".join(problems))
    cycles = int(record.seconds * frequency_hz * (1.0 + 1e-9))
    if cycles < _FEWEST_CYCLES:
        raise DataError(
            f"{_WHERE}: expected at least {_FEWEST_CYCLES} cycles of {frequency_hz:g} Hz, got "
            f"{record.seconds:.4g} s. Record longer."
        )
    kept = slice(0, round(cycles / frequency_hz * record.rate_hz))
    channels = {name: values[kept] for name, values in record.channels.items()}
    return replace(record, channels=channels, time=record.time[kept])


def _harmonic(values: np.ndarray, columns: np.ndarray, inverse: np.ndarray) -> _Harmonic:
    fitted = inverse @ values
    return _Harmonic(complex(fitted[0], -fitted[1]), values - columns @ fitted)


def _check_amplitude(
    moved: _Harmonic, weights: np.ndarray, record: JointRecord, frequency_hz: float
) -> None:
    """Refuse a dither that noise could have made."""
    influence = weights * moved.residual
    scores = np.column_stack([influence.real, influence.imag])
    plan = BlockPlan.of(record.channels["angle"], moved.residual, scores, record.rate_hz)
    if plan.n_blocks:
        variance = float(np.trace(block_sandwich(scores, np.eye(2), plan.n_blocks))) / 2.0
    else:
        variance = float(np.var(moved.residual)) * 2.0 / moved.residual.size
    sd = float(np.sqrt(variance))
    if abs(moved.phasor) < _LEAST_SDS * sd:
        raise EstimationError(
            Failure.NOT_COHERENT,
            f"{_WHERE}: expected a dither of {frequency_hz:g} Hz that moves the angle by more "
            f"than {_LEAST_SDS:g} sd of its noise, got an amplitude of "
            f"{1000.0 * abs(moved.phasor):.3g} mrad with sd {1000.0 * sd:.3g} mrad. Check the "
            "frequency, raise the dither, or record longer.",
        )


def _half_widths(scores: np.ndarray, plan: BlockPlan, ci_level: float) -> np.ndarray:
    count = scores.shape[1]
    if not plan.n_blocks:
        return np.full(count, np.nan)
    covariance = fitted_sandwich(scores, np.eye(count), plan.n_blocks)
    factor = t_factor(ci_level, plan.n_blocks - count)
    return np.asarray(factor * np.sqrt(np.diag(covariance)))


def _warnings(values: dict[str, float], plan: BlockPlan) -> tuple[str, ...]:
    warnings = [f"undecided: {plan.doubt}"] if plan.doubt else []
    warnings += [plan.caution] if plan.caution else []
    if values["stiffness"] < 0.0:
        warnings.append(
            f"{NEGATIVE_STIFFNESS}, or give the inertia if the dither is faster than the resonance"
        )
    return tuple(warnings)


def _series(moved: _Harmonic, load: _Harmonic, phase: np.ndarray) -> LoopSeries:
    """Average angle and torque over the cycles, for a figure."""
    turn = np.mod(phase, 2.0 * np.pi) / (2.0 * np.pi)
    bins = min(_SERIES_POINTS, max(8, phase.size // 8))
    index = np.minimum((turn * bins).astype(int), bins - 1)
    count = np.bincount(index, minlength=bins)
    filled = count > 0
    wave = np.exp(1j * phase)

    def averaged(values: np.ndarray) -> tuple[float, ...]:
        mean = np.bincount(index, values, bins)[filled] / count[filled]
        return tuple(mean.tolist())

    torque = np.real(load.phasor * wave)
    return LoopSeries(
        angle=averaged(np.real(moved.phasor * wave) + moved.residual),
        measured=averaged(torque + load.residual),
        modelled=averaged(torque),
    )
