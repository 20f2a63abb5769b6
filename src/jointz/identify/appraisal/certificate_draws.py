"""Truths for a certificate: the joint that the study found, behind instruments that are drawn."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.interpolate import CubicSpline

from jointz.core.study import Calibrated
from jointz.identify.appraisal.certificate_joint import InjectedJoint
from jointz.identify.preparation.calibration import relative_sd
from jointz.identify.rigid.response_model import Posterior
from jointz.identify.rigid.walking_evidence import Evidence
from jointz.kernels.response_search import (
    B_DRIFT,
    CROSS_TALK,
    DELAY,
    FRICTION_GAIN,
    J_DEVIATION,
    K_DRIFT,
    LAG,
    LOG_J,
    LOG_RESONANCE,
    PER_POINT,
    RESONANCE_DAMPING,
    SHARED,
    B,
    K,
)

_LEAST_DAMPING = 1e-3
#: Sizes that a drift is measured by where K and B are small, N*m/rad and N*m*s/rad.
_DRIFT_FLOOR = (8.0, 0.3)
_FEWEST_FOR_CURVE = 4

#: One value for all timing points, one for each of some, or that of the study.
Chosen = float | Mapping[str, float] | None


@dataclass(frozen=True, slots=True)
class Injection:
    """Injected values; None takes those that the study found."""

    stiffness: Chosen = None  # N*m/rad; of all timing points, or of some by name
    damping: Chosen = None  # N*m*s/rad; likewise
    inertia: Chosen = None  # kg*m^2; likewise
    lag_s: float | None = None  # s: total lag of the sensor

    def described(self) -> dict[str, str]:
        """Return the injected values as text; ``found`` stands for those of the study."""
        return {name: _described(getattr(self, name)) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class Truth:
    """A virtual participant."""

    joints: tuple[InjectedJoint, ...]  # one for each timing point
    friction_gain: float  # true over stated friction
    torque_gain: float  # true over measured torque
    # parameter -> the device's own part at each timing point, SI, drawn by the sd of its
    # calibration
    intrinsic: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def drawn_truth(evidence: Evidence, injection: Injection, rng: np.random.Generator) -> Truth:
    """Return the joint found at every timing point behind one chain of instruments, drawn.

    K, B, J and what else is of the joint are the likeliest: drawn from their posterior they
    would have its errors once more, beside those of being estimated. Lag, delay and friction
    are drawn as far as calibration and responses leave them open, gains as far as the
    calibration does: the study has one chain of instruments, whose errors are common to all its
    pulses. Cross-talk and tissue are as found.
    """
    posterior = evidence.posterior.best
    points, shared = posterior.values[:-SHARED].reshape(-1, PER_POINT), _drawn(posterior, rng)
    inertias = np.exp(shared[LOG_J] + points[:, J_DEVIATION])
    instruments = _instruments(evidence, posterior, shared, injection.lag_s, rng)
    slopes = _slopes(evidence, posterior, points)
    joints = []
    for i, cell in enumerate(evidence.cells):
        stiffness, damping, inertia = (
            _chosen_value(chosen, cell.label)
            for chosen in (injection.stiffness, injection.damping, injection.inertia)
        )
        at = posterior.middle_s[i]
        joints.append(
            replace(
                instruments,
                stiffness=max(float(points[i, K]), 0.0) if stiffness is None else stiffness,
                damping=max(float(points[i, B]), _LEAST_DAMPING) if damping is None else damping,
                inertia=float(inertias[i]) if inertia is None else inertia,
                stiffness_slope=float(slopes[0, i]) if stiffness is None else 0.0,
                damping_slope=float(slopes[1, i]) if damping is None else 0.0,
                stiffness_at_s=float(at[0]),
                damping_at_s=float(at[1]),
            )
        )
    return Truth(
        joints=tuple(joints),
        friction_gain=max(float(shared[FRICTION_GAIN]), 0.0),
        torque_gain=1.0 + relative_sd(evidence.known.torque_gain) * rng.standard_normal(),
        intrinsic=_intrinsic(evidence, rng),
    )


def _instruments(
    evidence: Evidence,
    posterior: Posterior,
    shared: np.ndarray,
    lag_s: float | None,
    rng: np.random.Generator,
) -> InjectedJoint:
    """Return the sensor that all timing points share, before a joint of no stiffness."""
    total_s = max(float(shared[LAG] + shared[DELAY]) if lag_s is None else lag_s, 0.0)
    delay_s = float(np.clip(shared[DELAY], 0.0, total_s))
    resonates = posterior.hypothesis.resonance
    return InjectedJoint(
        stiffness=0.0,
        damping=0.0,
        inertia=1.0,
        lag_s=total_s - delay_s,
        delay_s=delay_s,
        resonance_hz=float(np.exp(shared[LOG_RESONANCE])) if resonates else 0.0,
        resonance_damping=float(np.clip(shared[RESONANCE_DAMPING], 0.03, 0.97)),
        cross_talk=float(shared[CROSS_TALK]),
        angle_gain=1.0 + relative_sd(evidence.known.angle_gain) * float(rng.standard_normal()),
    )


def _drawn(posterior: Posterior, rng: np.random.Generator) -> np.ndarray:
    """Return the shared parameters, those of the instruments drawn by their covariance."""
    places = np.array([LAG, DELAY, FRICTION_GAIN]) - SHARED
    # Singular where one of them is known.
    size, directions = np.linalg.eigh(posterior.covariance[np.ix_(places, places)])
    shared = posterior.shared.copy()
    shared[places] += directions @ (np.sqrt(size.clip(0.0)) * rng.standard_normal(size.size))
    return np.asarray(shared)


def _slopes(evidence: Evidence, posterior: Posterior, points: np.ndarray) -> np.ndarray:
    """Return the slopes of K and B at every timing point, (2, n) per s."""
    drifts = points[:, [K_DRIFT, B_DRIFT]].T
    values = points[:, [K, B]].T
    sizes = np.maximum(values, np.array(_DRIFT_FLOOR)[:, None])
    slopes = drifts * sizes / evidence.window_s
    phases = np.array([cell.phase for cell in evidence.cells])
    curved = posterior.hypothesis.follows_curve and np.isfinite(phases).all()
    if not curved or np.unique(phases).size < max(_FEWEST_FOR_CURVE, phases.size):
        return np.asarray(slopes)
    order = np.argsort(phases)
    around = np.append(phases[order], phases[order[0]] + 1.0)
    strides = np.array([cell.stride_s for cell in evidence.cells])
    for row, size in enumerate(sizes):
        logs = np.log(np.append(size[order], size[order[0]]))
        curve = CubicSpline(around, logs, bc_type="periodic")
        slopes[row] += size * curve(phases, 1) / strides
    return np.asarray(slopes)


def _intrinsic(evidence: Evidence, rng: np.random.Generator) -> dict[str, tuple[float, ...]]:
    """Return the impedance injected beside the joint's own, timing point by timing point."""
    parts = {}
    for name in ("stiffness", "damping", "inertia"):
        entry: Calibrated | None = getattr(evidence.known, f"intrinsic_{name}")
        if entry is None:
            entry = Calibrated(value=0.0, sd=0.0)
        error = entry.sd * float(rng.standard_normal())
        parts[name] = tuple(
            error + (entry.value if name in left_in else 0.0)
            for left_in in evidence.subtract_intrinsic
        )
    return parts


def _chosen_value(chosen: Chosen, label: str) -> float | None:
    if isinstance(chosen, Mapping):
        return chosen.get(label)
    return None if chosen is None else float(chosen)


def _described(chosen: Chosen) -> str:
    if chosen is None:
        return "found"
    if isinstance(chosen, Mapping):
        return ", ".join(f"{name} {value:g}" for name, value in chosen.items())
    return f"{chosen:g}"
