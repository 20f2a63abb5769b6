"""Responses of legs drawn from the priors of the method itself, for tests of its intervals."""

from dataclasses import replace

import numpy as np

from jointz.core.priors import PriorsSpec
from jointz.core.study import ParticipantSpec
from jointz.identify.walking.body import body_of
from jointz.identify.walking.coupling import STRAP
from jointz.identify.walking.estimands import ESTIMANDS, log_estimands, log_moments
from jointz.identify.walking.leg_model import LegModel
from jointz.identify.walking.map_fit import MapSearch
from jointz.identify.walking.posterior import explain
from jointz.identify.walking.prior import LegPriors
from jointz.identify.walking.responses import PointResponse, ShapeAverage, usable_samples

PERIOD_S, STRIDE_S, N_STRIDES, N_MISSES = 0.002, 1.1, 240, 480
TIME_S = np.arange(-2, 107) * PERIOD_S
PHASES = {"LRE": 0.07, "MST": 0.215, "TST": 0.405, "PSW": 0.56, "ISW": 0.685, "MSW": 0.81}
#: Peak torque and the moments at which it changes, s; the torque follows the command in 18 ms.
DOUBLET = ((17.0, 0.0), (-34.0, 0.075), (17.0, 0.15))
PULSES = tuple(((a, 0.0), (-a, 0.06)) for a in (-12.0, -6.0, 6.0, 12.0))
_MOTOR_S = 0.012


def torque_of(steps):
    since = np.clip(TIME_S[:, None] - np.array([s for _, s in steps]), 0.0, None)
    return (np.array([a for a, _ in steps]) * (1.0 - np.exp(-since / _MOTOR_S))).sum(axis=1)


def errors_of(rng):
    """Errors of a predicted stride: 0.3 degrees at the onset, about 2 degrees after 0.2 s."""
    quick = 0.3 * np.cumsum(rng.standard_normal((N_MISSES, TIME_S.size)), axis=1) / 20.0
    level = 0.28 * rng.standard_normal((N_MISSES, 1))
    slow = rng.standard_normal((N_MISSES, 2)) @ np.stack(
        [(TIME_S.clip(0) / 0.2) ** 1.5, np.sin(np.pi * TIME_S.clip(0) / 0.2)]
    )
    return np.deg2rad(level + quick + 1.2 * slow)


def noise(errors, rng):
    """White noise of a sensor: a thousandth of what walking itself does."""
    return 1e-3 * errors.std() * rng.standard_normal(errors.shape)


def of_samples(blocks, point):
    """Errors of all samples, those of the last too few for a block as in the last block."""
    n = TIME_S.size
    each = np.repeat(blocks.reshape(-1, n // point.averaged), point.averaged, axis=1)
    return np.pad(each, ((0, 0), (0, n - each.shape[1])), mode="edge").ravel()


def template(label, phase, shapes, n_pulses, rng, sensors=()):
    zero = np.zeros((1 + len(sensors), TIME_S.size))
    errors = errors_of(rng)
    velocities = np.gradient(errors, PERIOD_S, axis=1)
    by_channel = [
        errors,
        *(velocities if "velocity" in s else errors for s in sensors),
    ]
    return PointResponse(
        label=label,
        phase=phase,
        stride_s=STRIDE_S,
        time_s=TIME_S,
        shapes=tuple(
            ShapeAverage(zero, torque_of(steps), n_pulses, np.ones(TIME_S.size, dtype=bool))
            for steps in shapes
        ),
        velocity=2.0 * np.sin(2.0 * np.pi * (phase + TIME_S / STRIDE_S)),
        prediction_errors=np.stack(
            [m + noise(m, rng) if sensors else m for m in by_channel], axis=1
        ),
        torque_prediction_errors=np.zeros((N_MISSES, TIME_S.size)),
        n_strides=N_STRIDES,
        channels=("goniometer", *sensors),
    )


def simulated_person(
    seed,
    *,
    shapes,
    n_pulses,
    window_s,
    sensors=(),
    labels=tuple(PHASES),
    coupling=STRAP,
    stiff=None,
):
    """Draw a leg from the priors and its responses; return model, priors and true values.

    ``stiff``: K of timing points, N*m/rad, instead of what was drawn. Values are on their scales.
    """
    rng = np.random.default_rng(seed)
    person = ParticipantSpec(id="S01", mass_kg=rng.uniform(55, 95), height_m=rng.uniform(1.6, 1.9))
    spec = coupling.spec(PriorsSpec())
    body = body_of(person, "knee", spec, of_body=coupling.is_strap)
    priors = LegPriors(spec, body, {}, coupling=coupling)
    points = [template(label, PHASES[label], shapes, n_pulses, rng, sensors) for label in labels]
    model = LegModel(points, window_s=window_s, gravity_stiffness=body.gravity_stiffness)
    prior = priors.build(model, coupling.hypotheses[seed % len(coupling.hypotheses)])
    theta = rng.multivariate_normal(prior.mean, prior.covariance)
    for label, value in (stiff or {}).items():
        theta[model.layout.stiffness(labels.index(label))] = model.stiffness_scale.of(value)
    search = MapSearch(model, prior)
    noisy = []
    for k, point in enumerate(points):
        errors = search.error_covariance(theta, k)
        drawn = rng.multivariate_normal(np.zeros(len(errors)), errors)
        angles = model.responses(theta[None], k)[0] + of_samples(drawn, point)
        averages = tuple(
            replace(shape, sensor_signals=own, used=usable_samples(own[0], TIME_S))
            for shape, own in zip(
                point.shapes, angles.reshape(len(shapes), 1 + len(sensors), -1), strict=True
            )
        )
        noisy.append(replace(point, shapes=averages))
    measured = model.with_points(noisy)
    truth = np.stack([log_estimands(measured, theta[None], k)[0] for k in range(len(points))], 1)
    return measured, priors, truth


def standardised_errors(seed, **study):
    """Return (estimate - truth) / sd of every estimand and timing point."""
    model, priors, truth = simulated_person(seed, **study)
    moments = log_moments(explain(model, priors))
    n = len(ESTIMANDS)
    return (moments.mean.reshape(n, -1) - truth) / moments.sd.reshape(n, -1)
