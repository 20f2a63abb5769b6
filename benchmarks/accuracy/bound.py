r"""The Bayesian Cramer-Rao bound of one participant of a row.

The angle's record over the window holds, at timing point p with n pulses,

.. math:: I = \sum_p n_p S_p^T C_p^{-1} S_p + P,

S_p the finite-difference sensitivities of the true joint behind the right sensor
(:mod:`benchmarks.accuracy.linear_joint`), C_p the covariance of what the best linear prediction
leaves at virtual onsets once torque that was measured is accounted for
(:mod:`benchmarks.accuracy.baseline_noise`), P the prior precision of what a lab knows: lag,
gains, friction model. K and B are known to 100 % beforehand: it matters only where the pulses
decide nothing. J is one, or scatters by a known share.

Notes
-----
Assumes K, B, J constant inside the window and noise that is Gaussian and independent between
pulses. Drift of K, a reflex's rectification and gravity of the frame are not in it; a method
with narrower priors on K and B may pass below it where pulses are few.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from benchmarks.accuracy.baseline_noise import Surprise, Walked, surprises
from benchmarks.accuracy.linear_joint import Joint, response_matrix
from benchmarks.accuracy.people import Simulated, cell_truth
from benchmarks.accuracy.rows import Row

from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import Walk, WalkPlan, walk_directly
from jointz.rig.sim.rig import SimulatedRig
from jointz.rig.sim.walking.layout import Param
from jointz.rig.sim.walking.plant_build import PlantBuild

WINDOW_S = 0.1
#: The share of pure delay in the lag is 0 to 1 for all a lab knows.
_SHARE_SD = 12.0**-0.5
_TISSUE_DAMPING_SD = 0.1
_FRAME_SD = 0.1
_REFLEX_SD = 0.3
_STEP = 1e-4
#: Of K and B, share: an estimate that may not be negative is seldom further off.
_WEAK_SD = 1.0
#: Fewer pulses a point leave too few strides: the noise is then that of a longer walk.
_ENOUGH_PULSES, _LONG_WALK_STRIDES = 30, 500


@dataclass(frozen=True, slots=True)
class PointInformation:
    """What the pulses of one timing point say.

    Parameters
    ----------
    joint : Joint
        The true one.
    sensitivity : mapping of str to (n,) float
        Parameter -> change of the shown angle.
    covariance : (n, n) float, rad^2
        Of the angle of one pulse.
    n_pulses : int
        How many.
    misfit : float
        Chi-squared per sample of the mean response about that of the true joint: near 1 where
        joint, sensor and noise of the bound are the rig's.
    """

    joint: Joint
    sensitivity: Mapping[str, np.ndarray]
    covariance: np.ndarray
    n_pulses: int
    misfit: float


def participant_information(simulated: Simulated, row: Row) -> dict[str, PointInformation]:
    """Return what the pulses of every timing point say.

    Parameters
    ----------
    simulated : Simulated
        A participant who walked.
    row : Row
        For what is known.
    """
    build = simulated.rig.build(worn=True)
    priors = prior_sds(build, row)
    asked = _walked(simulated.walk, simulated.truth, build)
    learnt = _long_walk(simulated.rig, build) if row.per_point < _ENOUGH_PULSES else asked
    step_s = build.grid.period_s
    pulses, points = simulated.walk.pulses, {}
    for name, true in cell_truth(simulated.truth).items():
        joint = _joint_of(build, true)
        onsets_s = pulses.loc[pulses["timing_point"] == name, "onset_s"].to_numpy()
        n_time = int((WINDOW_S + joint.lag_s) / step_s) + 1
        left = surprises(learnt, asked, onsets_s, n_time)
        points[name] = _information(joint, left, priors, onsets_s.size, step_s)
    return points


def participant_bound(
    points: Mapping[str, PointInformation], simulated: Simulated, row: Row
) -> dict[str, dict[str, float]]:
    """Return the least standard deviation of K, B and J at every timing point.

    Parameters
    ----------
    points : mapping of str to PointInformation
        Of :func:`participant_information`.
    simulated : Simulated
        The participant.
    row : Row
        For what is known.

    Returns
    -------
    dict
        Timing point -> ``stiffness``, ``damping``, ``inertia``; and ``all`` -> ``inertia``,
        of the mean J over the timing points. SI.
    """
    priors = prior_sds(simulated.rig.build(worn=True), row)
    return bound_of(points, priors, inertia_spread=row.inertia_spread, weak_sd=_WEAK_SD)


def _long_walk(rig: SimulatedRig, build: PlantBuild) -> Walked:
    """Let the person walk without pulses for long: few pulses leave few strides to learn from."""
    plan = WalkPlan(per_point=0, warm_up_strides=_LONG_WALK_STRIDES)
    walk = walk_directly(rig, "perturbed", plan=plan)
    stretch = Stretch(0, 0.0, walk.end_s)
    truth = rig.truth("perturbed", worn=True, stretches=[stretch], pulses=walk.pulses)
    return _walked(walk, truth, build)


def prior_sds(build: PlantBuild, row: Row) -> dict[str, float]:
    """Return what a lab knows of instruments, as standard deviations in each one's own unit.

    Parameters
    ----------
    build : PlantBuild
        Of the participant.
    row : Row
        For the lag.
    """
    preset = build.preset
    low, high = preset.goniometer.lag_range_s
    known = (high - low) * 12.0**-0.5 if row.lag_sd_s is None else row.lag_sd_s
    sds = {
        "lag_s": known,
        "delay_share": _SHARE_SD,
        "torque_gain": preset.actuator.gain_error_sd,
        "angle_gain": preset.goniometer.gain_error_sd,
        "friction": preset.actuator.friction_error_sd,
    }
    tissue = build.params[Param.TISSUE_RATE] / (2.0 * np.pi)
    if tissue:
        sds |= {"tissue_hz": 20.0 * 12.0**-0.5, "tissue_damping": _TISSUE_DAMPING_SD}
    if preset.body is not None:
        soft, stiff = preset.body.strap_range_nm_rad
        sds["strap"] = (stiff - soft) * 12.0**-0.5
        sds["carried"] = _FRAME_SD * float(build.params[Param.EXO_INERTIA])
    if preset.goniometer.torsion_rad_nm:
        sds["torsion"] = preset.goniometer.torsion_rad_nm
    if preset.joint.reflex is not None:
        sds["reflex"] = _REFLEX_SD
    return {name: sd for name, sd in sds.items() if sd > 0.0}


def bound_of(
    points: Mapping[str, PointInformation],
    priors: Mapping[str, float],
    *,
    inertia_spread: float,
    weak_sd: float = np.inf,
) -> dict[str, dict[str, float]]:
    """Put the information of all timing points together and invert it.

    Parameters
    ----------
    points : mapping of str to PointInformation
        Timing point -> what its pulses say.
    priors : mapping of str to float
        Nuisance parameter -> its sd.
    inertia_spread : float
        Known scatter of J over the timing points, share; 0: one J.
    weak_sd : float
        Of K and B before the pulses, share; none where the truth is zero.
    """
    shared = ["inertia", *priors]
    own = ["stiffness", "damping", *(["inertia"] if inertia_spread else [])]
    size = len(shared) + len(points) * len(own)
    total = np.zeros((size, size))
    for k, sd in enumerate(priors.values(), start=1):
        total[k, k] = sd**-2
    for p, point in enumerate(points.values()):
        first = len(shared) + p * len(own)
        places = [*range(len(shared)), *range(first, first + len(own))]
        slopes = np.column_stack([point.sensitivity[name] for name in [*shared, *own]])
        add = point.n_pulses * slopes.T @ np.linalg.solve(point.covariance, slopes)
        total[np.ix_(places, places)] += add
        for k, true in enumerate((point.joint.stiffness, point.joint.damping)):
            total[first + k, first + k] += (weak_sd * true) ** -2 if true else 0.0
        if inertia_spread:
            total[first + 2, first + 2] += (inertia_spread * point.joint.inertia) ** -2
    scale = np.sqrt(np.diag(total))
    covariance = np.linalg.inv(total / np.outer(scale, scale)) / np.outer(scale, scale)
    return _spread_out(covariance, list(points), n_shared=len(shared), n_own=len(own))


def _spread_out(
    covariance: np.ndarray, names: list[str], *, n_shared: int, n_own: int
) -> dict[str, dict[str, float]]:
    """Return standard deviations point by point; J there is the common one and its own part."""
    result = {}
    mean = np.zeros(len(covariance))
    mean[0] = 1.0
    for p, name in enumerate(names):
        first = n_shared + p * n_own
        here = np.zeros(len(covariance))
        here[0] = 1.0
        if n_own == len(("K", "B", "J")):
            here[first + 2] = 1.0
            mean[first + 2] = 1.0 / len(names)
        result[name] = {
            "stiffness": float(np.sqrt(covariance[first, first])),
            "damping": float(np.sqrt(covariance[first + 1, first + 1])),
            "inertia": float(np.sqrt(here @ covariance @ here)),
        }
    result["all"] = {"inertia": float(np.sqrt(mean @ covariance @ mean))}
    return result


def sensitivities(
    joint: Joint, torque: np.ndarray, friction: np.ndarray, names: list[str], step_s: float
) -> dict[str, np.ndarray]:
    """Return the change of the shown angle with each parameter, by central differences.

    Parameters
    ----------
    joint : Joint
        The true one.
    torque, friction : (n,) float, N*m
        Response of the motor's torque, and of the friction in it.
    names : list of str
        Fields of the joint, ``torque_gain`` and ``friction``.
    step_s : float, s
        Between samples.
    """
    n = torque.size
    slopes = {}
    for name in names:
        if name in ("torque_gain", "friction"):
            drive = torque if name == "torque_gain" else friction
            slopes[name] = response_matrix(joint, n, step_s) @ drive
            continue
        value = getattr(joint, name)
        h = _STEP * (abs(value) or 1.0)
        high = response_matrix(replace(joint, **{name: value + h}), n, step_s)
        low = response_matrix(replace(joint, **{name: value - h}), n, step_s)
        slopes[name] = (high - low) @ torque / (2.0 * h)
    return slopes


def _information(
    joint: Joint, left: Surprise, priors: Mapping[str, float], n_pulses: int, step_s: float
) -> PointInformation:
    names = ["stiffness", "damping", "inertia", *priors]
    angle, torque, friction = left.pulses
    slopes = sensitivities(joint, torque, friction, names, step_s)
    answer = response_matrix(joint, angle.size, step_s)
    noise = left.virtual[0] - left.virtual[1] @ answer.T
    n, p = noise.shape
    # The inverse of a covariance of few samples is too large (Hartlap et al. 2007).
    covariance = noise.T @ noise / (n - p - 2)
    error = angle - answer @ torque
    misfit = n_pulses * float(error @ np.linalg.solve(covariance, error)) / p
    return PointInformation(joint, slopes, covariance, n_pulses, misfit)


def _walked(walk: Walk, truth: Mapping[str, Any], build: PlantBuild) -> Walked:
    """Return the shown angle, the motor's true torque but for noise, and the friction in it."""
    channels, p = walk.channels, build.params
    current = channels["current"]
    size = p[Param.COULOMB_FRICTION] + p[Param.GEAR_FRICTION] * np.abs(current)
    friction = size * np.tanh(p[Param.SIGN_RATE] * channels["motor_velocity"])
    torque = p[Param.TORQUE_PER_AMPERE] * current - friction
    return Walked(
        signals=np.stack([channels["angle"], torque, friction]),
        step_s=build.grid.period_s,
        strikes_s=np.asarray(truth["heel_strike_s"]),
        pulses_s=walk.pulses["onset_s"].to_numpy(),
    )


def _joint_of(build: PlantBuild, true: Mapping[str, float]) -> Joint:
    p, body, reflex = build.params, build.preset.body, build.preset.joint.reflex
    lag_s = build.instruments.angle_lag_s
    joint = Joint(
        **true,
        carried=float(p[Param.EXO_INERTIA]),
        lag_s=lag_s,
        delay_share=build.preset.goniometer.delay_s / lag_s if lag_s else 0.0,
        tissue_hz=float(p[Param.TISSUE_RATE] / (2.0 * np.pi)),
        tissue_damping=float(p[Param.TISSUE_DAMPING]),
        angle_gain=float(p[Param.ANGLE_GAIN]),
        torsion=float(p[Param.TORSION]),
    )
    if body is not None:
        strap = float(p[Param.STRAP_STIFFNESS])
        joint = replace(joint, strap=strap, strap_time_s=body.strap_damping_time_s)
    if reflex is not None:
        joint = replace(
            joint,
            reflex=reflex.gain,
            latency_s=reflex.latency_s,
            twitch_s=reflex.twitch_s,
            reflex_velocity_s=reflex.velocity_time_s if reflex.kind == "velocity" else 0.0,
        )
    return joint
