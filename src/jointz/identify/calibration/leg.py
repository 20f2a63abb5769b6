"""Lag on the body, gain of the torque and tissue, from a relaxed leg that hangs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from jointz.core.errors import DataError
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.identify.calibration.calibration_step import RefusedError, calibration_step, step_series
from jointz.identify.calibration.hanging_model import (
    CROSS_TALK,
    DELAY,
    FRICTION_GAIN,
    GAIN_RATIO,
    INERTIA_MORE,
    KNOWN_LAG,
    LAG,
    LOG_RESONANCE,
    NAMES,
    RESONANCE_DAMPING,
    STIFFNESS_MORE,
    HangingCell,
    HangingModel,
    HangingPosterior,
    KnownWeight,
)
from jointz.identify.calibration.pulse_averages import (
    PulseAverage,
    PulsedRecord,
    average_pulses,
    left_out_notes,
)
from jointz.kernels.derivatives import derivative
from jointz.results.bench.calibration_failure import CalibrationFailure
from jointz.results.bench.calibration_fit import CalibrationEntry, CalibrationFit, decided

#: Samples back that a sample is predicted from.
_ORDER = 12
#: Innovations are as large as those of so many neighbours on each side.
_NEIGHBOURS = 4
_RIDGE = 1e-8
_STRENGTHS = np.geomspace(1.0, 1e4, 25)


def _steady_root(sample: np.ndarray) -> np.ndarray:
    """Return the lower triangle R of the covariance R R' of a slowly changing autoregression.

    ``sample`` (n, n): of any rank. R R' is L D L' with the inverse of L banded and its neighbouring
    rows alike: modified Cholesky decomposition (Pourahmadi 1999, Biometrika 86, 677), coefficients
    and variances averaged over neighbouring times; a sample is predicted from up to 12 before it.
    The covariance of a record without noise is nearly singular: it cannot be factored again.
    """
    n = len(sample)
    order = min(_ORDER, n - 1)
    products = _products(sample, order)
    innovation = np.eye(n)  # rows: a sample minus its prediction
    for t in range(1, order):
        innovation[t, :t] = -_coefficients(products[t, : t + 1, : t + 1])[::-1]
    later = _coefficients(products[order:])
    for t in range(order, n):
        innovation[t, t - order : t] = -later[t - order, ::-1]
    left = ((innovation @ sample) * innovation).sum(axis=1)
    level = np.trace(sample) / n
    variances = np.maximum(_smoothed(left, start=order), _RIDGE * level + 1e-300)
    return np.asarray(np.linalg.solve(innovation, np.diag(np.sqrt(variances))))


def shrunk_covariance(sample: np.ndarray, count: int) -> np.ndarray:
    """Return a covariance between the sample's and a steady one, by their evidence.

    ``sample`` (n, n) from ``count`` independent realisations. Returns the mean of the posterior
    under an inverse Wishart prior about that of :func:`_steady_root`. Chen 1979, Journal of the
    Royal Statistical Society B 41, 235.
    """
    if count < 2:
        raise ValueError(f"shrunk_covariance: expected two realisations or more, got {count}.")
    n, m = len(sample), count - 1
    # In units of the prior's mean, all determinants are those of its eigenvalues.
    root = _steady_root(sample)
    scaled = np.linalg.solve(root, np.linalg.solve(root, sample).T)
    values = np.linalg.eigvalsh(0.5 * (scaled + scaled.T)).clip(0.0)
    strengths = _STRENGTHS * n
    best = float(strengths[int(np.argmax(_log_evidence(values, m, strengths)))])
    return np.asarray((best * root @ root.T + m * sample) / (best + m))


def _log_evidence(values: np.ndarray, m: int, strengths: np.ndarray) -> np.ndarray:
    """Return those of priors worth so many realisations, (k,), up to a constant."""
    n = values.size
    each = strengths[:, None]
    prior, after = each + n + 1.0, each + n + 1.0 + m
    places = np.arange(n)
    turns = (gammaln((after - places) / 2.0) - gammaln((prior - places) / 2.0)).sum(axis=1)
    own = 0.5 * prior[:, 0] * n * np.log(strengths)
    spread = np.log(each + m * values).sum(axis=1)
    return np.asarray(turns + own - 0.5 * after[:, 0] * spread)


def _products(sample: np.ndarray, order: int) -> np.ndarray:
    """Return mean products of samples i and j before one, over times near it, (n, k, k).

    Near is a quarter of the record on each side, as far as there are so many samples before.
    """
    n = len(sample)
    sums = np.zeros((order + 1, n + 1))
    for lag in range(order + 1):
        sums[lag, lag + 1 :] = np.cumsum(np.diagonal(sample, -lag))
    t = np.arange(n)
    first = np.maximum(t - n // 4, np.minimum(t, order))[:, None, None]
    last = np.minimum(t + n // 4, n - 1)[:, None, None] + 1
    back = np.arange(order + 1)
    nearer, lag = np.minimum(back[:, None], back), np.abs(back[:, None] - back)
    # Products before the beginning of the record are not used.
    return np.asarray(
        (sums[lag, (last - nearer).clip(0)] - sums[lag, (first - nearer).clip(0)]) / (last - first)
    )


def _coefficients(products: np.ndarray) -> np.ndarray:
    """Return how a sample is predicted from those before it, the last first, (..., k)."""
    k = products.shape[-1] - 1
    among = products[..., 1:, 1:] + _RIDGE * products[..., :1, :1] * np.eye(k)
    return np.asarray(np.linalg.solve(among, products[..., 1:, :1])[..., 0])


def _smoothed(left: np.ndarray, *, start: int) -> np.ndarray:
    """Average innovations over neighbours, where all are predicted from as many samples."""
    near = np.ones(2 * _NEIGHBOURS + 1)
    later = left[start:]
    sums, counts = (
        np.convolve(values, near)[_NEIGHBOURS:-_NEIGHBOURS]
        for values in (later, np.ones(later.size))
    )
    return np.concatenate([left[:start], sums / counts])


_LEAD_S, _LENGTH_S = 0.05, 0.4
_CONDITIONS = ("bare", "weighted")
_UNIT_GAIN = Calibrated(value=1.0, sd=0.0)
_ZERO = Calibrated(value=0.0, sd=0.0)
#: Entry of the calibration -> parameter of the model that it is known for.
_KNOWN = {"friction_gain": "friction_gain", "angle_per_torque": "cross_talk"}
#: Sd of what a body may add to the lag of an instrument beside the resonance of its tissue, s.
_BODY_LAG_SD_S = 1e-3
#: A sensor's model this likely is taken as decided.
_DECIDED = 0.9
#: Sds beyond which an entry decides nothing.
_LARGEST_LAG_SD_S, _LARGEST_GAIN_SD = 5e-3, 0.1
#: Error of the model, share of the largest response, and over which time it is alike.
_MODEL_SHARE, _MODEL_TIME_S = 0.002, 0.03
_TINY = 1e-14  # rad^2: responses without noise have a covariance of rounding errors
#: What the model may leave of the response, RMS over RMS.
_MOST_LEFT = 0.1
_LOSSES = {
    "friction": (FRICTION_GAIN,),
    "cross_talk": (CROSS_TALK,),
    "known_load": (INERTIA_MORE, STIFFNESS_MORE),
    "known_lag": (KNOWN_LAG,),
}
_METHOD = (
    "posterior mode of joint and sensor on average responses, both sensor models weighed by "
    "evidence"
)
#: A function of a posterior's parameters.
Derived = Callable[[np.ndarray], float]


@dataclass(frozen=True, slots=True, eq=False)
class _Sensors:
    """The two models of the sensor, without and with tissue, and their weights."""

    model: HangingModel
    posteriors: tuple[HangingPosterior, ...]
    weights: np.ndarray  # probabilities of ``posteriors``

    @classmethod
    def of(
        cls, cells: list[HangingCell], weight: KnownWeight | None, known: CalibrationSpec
    ) -> "_Sensors":
        priors = {
            name: (entry.value, max(entry.sd, 1e-6))
            for source, name in _KNOWN.items()
            if (entry := getattr(known, source)) is not None
        }
        lag, total_lag = known.angle_lag_s, (0.0, np.inf)
        if lag is not None:
            total_lag = lag.value, float(np.hypot(lag.sd, _BODY_LAG_SD_S))
        models = [
            HangingModel(cells, weight, priors, resonance=tissue, total_lag=total_lag)
            for tissue in (False, True)
        ]
        posteriors = tuple(model.fit() for model in models)
        logs = np.array([posterior.log_evidence for posterior in posteriors])
        chances = np.exp(logs - logs.max())
        return cls(models[0], posteriors, chances / chances.sum())

    @property
    def best(self) -> HangingPosterior:
        return self.posteriors[int(np.argmax(self.weights))]

    def entry(
        self,
        name: str,
        derived: Derived,
        *,
        more: Mapping[str, float] | None = None,
        largest_sd: float | None = None,
    ) -> CalibrationEntry:
        """Return a function of the parameters with its budget; ``more`` has relative sds."""
        values = np.array([derived(p.values) for p in self.posteriors])
        mean = float(self.weights @ values)
        variances = dict.fromkeys(("noise", *_LOSSES, "prior"), 0.0)
        for weight, posterior in zip(self.weights, self.posteriors, strict=True):
            for source, variance in _budget(posterior, derived).items():
                variances[source] += float(weight) * variance
        variances["sensor_model"] = float(self.weights @ (values - mean) ** 2)
        parts = {source: float(np.sqrt(variance)) for source, variance in variances.items()}
        parts |= {source: abs(mean) * share for source, share in (more or {}).items()}
        return decided(name, mean, parts, largest_sd=largest_sd)


@calibration_step("leg", "angle_lag_s", "torque_gain")
def fit_leg(
    bare: PulsedRecord,
    weighted: PulsedRecord | None = None,
    *,
    weight: KnownWeight | None = None,
    known: CalibrationSpec | None = None,
) -> CalibrationFit:
    r"""Estimate lag, gain of the torque and tissue from pulses on a relaxed hanging leg.

    The response of the goniometer's angle to the measured torque gives J times the gain of the
    torque over that of the angle; the known weight gives their ratio, and ``angle_gain`` the
    gain of the torque. The errors of both gains are then alike, and their ratio, which K and J
    in walking depend on, is known better than either.

    It misleads where muscles answer, where the thigh moves, and where the leg swings so far
    that gravity is no spring (20 deg: 2 % of its part).
    """
    known = known or CalibrationSpec()
    if (weighted is None) != (weight is None):
        raise DataError("fit_leg: expected a weighted record and its weight, or neither.")
    records = [bare] if weighted is None else [bare, weighted]
    averages = [
        average_pulses(record, lead_s=_LEAD_S, length_s=_LENGTH_S, name=name)
        for record, name in zip(records, _CONDITIONS, strict=False)
    ]
    cells = [_cell(average, known) for average in averages]
    sensors = _Sensors.of(cells, weight, known)
    _check_fit(cells, sensors.best)
    entries = [_lag(sensors), _torque_gain(sensors, weight, known)]
    reported = [*_joint(sensors, weight, known), _strap(averages, cells, sensors.best, known)]
    resonance, damping = _tissue(sensors)
    (entries if resonance.available else reported).append(resonance)
    return CalibrationFit(
        step="leg",
        entries=tuple(entries),
        reported=(*reported, damping),
        method=_METHOD,
        n_samples=sum(cell.angle.size for cell in cells),
        notes=_notes(averages, sensors),
        settings={
            "n_pulses": [average.count for average in averages],
            "tissue_probability": float(sensors.weights[1]),
        },
        series=step_series(
            np.concatenate([average.time_s for average in averages]),
            np.degrees(np.concatenate([cell.angle for cell in cells])),
            np.degrees(np.concatenate(sensors.best.fitted)),
            x_label="time after the onset (s)",
            y_label="angle shown (deg)",
        ),
    )


def _cell(average: PulseAverage, known: CalibrationSpec) -> HangingCell:
    angle = average.angle.mean(axis=0)
    scatter = np.cov(average.angle.T)
    noise = shrunk_covariance(scatter + _TINY * np.eye(angle.size), average.count) / average.count
    noise += _model_error(average.time_s, float(np.abs(angle).max()))
    torque = np.stack([average.driving.mean(axis=0), average.friction.mean(axis=0)])
    torque[0] -= _intrinsic_torque(average, known)
    return HangingCell(angle, torque, noise, average.period_s)


def _model_error(time_s: np.ndarray, largest: float) -> np.ndarray:
    """Return the covariance of the linear model's error: friction at turns, gravity's sine."""
    alike = np.exp(-np.abs(time_s[:, None] - time_s) / _MODEL_TIME_S)
    half = 0.5 * (alike + np.eye(time_s.size))
    return np.asarray((_MODEL_SHARE * largest) ** 2 * half)


def _intrinsic_torque(average: PulseAverage, known: CalibrationSpec) -> np.ndarray:
    """Return the torque that moves the frame itself, N*m."""
    rate = 1.0 / average.period_s
    motion = average.motor_angle.mean(axis=0)
    velocity = derivative(motion, rate_hz=rate)
    torque = np.zeros(motion.size)
    for entry, part in (
        (known.intrinsic_stiffness, motion),
        (known.intrinsic_damping, velocity),
        (known.intrinsic_inertia, derivative(velocity, rate_hz=rate)),
    ):
        torque += (entry or _ZERO).value * part
    return torque


def _budget(posterior: HangingPosterior, derived: Derived) -> dict[str, float]:
    """Split the variance of a function of the parameters by where it comes from."""
    values, slopes = posterior.values, np.zeros(len(NAMES))
    sizes = np.sqrt(np.diag(posterior.bread))
    for j in np.flatnonzero(sizes):
        step = np.zeros(values.size)
        step[j] = 0.01 * sizes[j]
        slopes[j] = (derived(values + step) - derived(values - step)) / (2.0 * step[j])
    noise, priors = posterior.variances(slopes)
    split = {source: float(priors[list(places)].sum()) for source, places in _LOSSES.items()}
    return {"noise": noise, **split, "prior": float(priors.sum()) - sum(split.values())}


def _lag(sensors: _Sensors) -> CalibrationEntry:
    return sensors.entry(
        "angle_lag_s",
        lambda values: float(values[LAG] + values[DELAY]),
        largest_sd=_LARGEST_LAG_SD_S,
    )


def _torque_gain(
    sensors: _Sensors, weight: KnownWeight | None, known: CalibrationSpec
) -> CalibrationEntry:
    if weight is None:
        reason = "no record with a known weight"
        return CalibrationEntry("torque_gain", None, None, "undecided", reason)
    gain = known.angle_gain or _UNIT_GAIN
    return sensors.entry(
        "torque_gain",
        lambda values: float(values[GAIN_RATIO]) * gain.value,
        more={"angle_gain": gain.sd / gain.value},
        largest_sd=_LARGEST_GAIN_SD,
    )


def _tissue(sensors: _Sensors) -> tuple[CalibrationEntry, ...]:
    """Return resonance and damping of the tissue, undecided without evidence of tissue."""
    names = ("tissue_hz", "tissue_damping")
    chance = float(sensors.weights[1])
    if chance < _DECIDED:
        reason = f"tissue before the sensor has {chance:.0%} of the evidence"
        return tuple(CalibrationEntry(name, None, None, "undecided", reason) for name in names)
    alone = _Sensors(sensors.model, sensors.posteriors[1:], np.ones(1))
    return (
        alone.entry(names[0], lambda values: float(np.exp(values[LOG_RESONANCE]))),
        alone.entry(names[1], lambda values: float(values[RESONANCE_DAMPING])),
    )


def _joint(
    sensors: _Sensors, weight: KnownWeight | None, known: CalibrationSpec
) -> tuple[CalibrationEntry, ...]:
    """Return K, B and J of every condition in true units, and the friction's gain."""
    stated = known.torque_gain or _UNIT_GAIN
    gain = known.angle_gain or _UNIT_GAIN
    more = {} if weight else {"gains": float(np.hypot(stated.sd, gain.sd))}

    def of(place: int, condition: int) -> Derived:
        def derived(values: np.ndarray) -> float:
            ratio = values[GAIN_RATIO] if weight else stated.value / gain.value
            return sensors.model.joint(values, condition)[place] / float(ratio)

        return derived

    places = {"stiffness": 0, "damping": 1, "inertia": 2}
    entries = [sensors.entry(name, of(i, 0), more=more) for name, i in places.items()]
    if weight:
        entries += [sensors.entry(f"{name}_weighted", of(i, 1)) for name, i in places.items()]
    entries.append(sensors.entry("friction_gain", lambda values: float(values[FRICTION_GAIN])))
    return tuple(entries)


def _strap(
    averages: list[PulseAverage],
    cells: list[HangingCell],
    best: HangingPosterior,
    known: CalibrationSpec,
) -> CalibrationEntry:
    """Return the compliance between encoder and joint.

    The motion of the joint is the model's, so that lag and tissue of the goniometer are out of
    it. The sd is that of an error of the angle's gain, of the scatter over pulses and of what
    the line leaves: inside a condition the error hardly changes, so that each counts once.
    """
    angle_gain, torque_gain = known.angle_gain or _UNIT_GAIN, known.torque_gain or _UNIT_GAIN
    apart, through = [], []
    for average, cell, motion in zip(averages, cells, best.motions, strict=True):
        apart.append(average.motor_angle.mean(axis=0) - motion / angle_gain.value)
        total = cell.torque[0] + best.values[FRICTION_GAIN] * cell.torque[1]
        through.append(total / torque_gain.value)
    torque, motion = np.concatenate(through), np.concatenate(best.motions)
    # Along with the torque the joint moves: an error of its gain is not the strap's.
    columns = np.column_stack([torque, motion])
    inverse = np.linalg.pinv(columns)
    difference = np.concatenate(apart)
    value = float(inverse[0] @ difference)
    left = difference - columns @ (inverse @ difference)
    spread = float(np.std(left)) / float(np.std(torque))
    parts = {"model": spread, "angle_gain": abs(value) * angle_gain.sd}
    return decided("strap_compliance", value, parts)


def _check_fit(cells: list[HangingCell], best: HangingPosterior) -> None:
    for cell, fitted, name in zip(cells, best.fitted, _CONDITIONS, strict=False):
        left = float(np.std(cell.angle - fitted)) / float(np.std(cell.angle))
        if not left < _MOST_LEFT:
            detail = f"{name}: the model leaves {left:.0%} of the response"
            raise RefusedError(CalibrationFailure.MODEL_MISFIT, detail)


def _notes(averages: list[PulseAverage], sensors: _Sensors) -> tuple[str, ...]:
    chance = float(sensors.weights[1])
    notes = [
        f"A sensor behind resonating tissue has {chance:.0%} of the evidence, one on a rigid "
        f"limb {1.0 - chance:.0%}.",
        *left_out_notes(*averages),
    ]
    if sensors.best.misfit > 1.5:
        notes.append(
            f"The model misses the responses by {sensors.best.misfit:.1f} times their noise, in "
            "squares; the sd is that much larger."
        )
    return tuple(notes)
