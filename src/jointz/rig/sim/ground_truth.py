"""The truth about a simulated condition, written beside a study and never read by an analysis."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.gait_phases import TIMING_POINTS
from jointz.core.protocols.pulse_models import Pulse, TorquePart
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.sensors.motion_sensors import draw_motion_instruments
from jointz.rig.sim.walking.gait_motion import GaitMotion, Stride
from jointz.rig.sim.walking.impedance_curves import (
    added_terms,
    chain_terms,
    impedance_over_cycle,
    leg_of,
)
from jointz.rig.sim.walking.internal_moment import internal_moment
from jointz.rig.sim.walking.knee_joint import knee_angle, respond
from jointz.rig.sim.walking.layout import Param, describe
from jointz.rig.sim.walking.plant_build import PlantBuild

_RATE_HZ = 2000.0  # of the model response that weighs K, B and J
_CURVE_POINTS = 101
_BEYOND_S = 2.0  # strides are laid out so far past the end: a window may reach there
# The response of a softening joint is iterated until the angle stays the same.
_LARGEST_ITERATIONS = 100
_SAME_ANGLE_RAD = 1e-9
# Values of a pulse whose means over its timing point are reported, too.
_MEANS = (
    "stiffness",
    "damping",
    "inertia",
    "gravity_stiffness",
    "inertial_stiffness",
    "inertia_rate",
    "onset_gait_pct",
    "stiffness_centre_pct",
    "damping_centre_pct",
    "inertia_centre_pct",
    "stiffness_onset",
    "stiffness_window_mean",
    "stiffness_secant",
    "damping_onset",
    "damping_window_mean",
    "damping_secant",
)
# What the knee felt of a known addition, where there is one.
_ADDED = ("added_inertia", "added_stiffness")


def condition_truth(
    build: PlantBuild,
    *,
    motions: Sequence[GaitMotion],
    stretches: Sequence[Stretch],
    pulses: pd.DataFrame,
    shapes: Mapping[str, Pulse],
    window_s: float,
) -> dict[str, Any]:
    """Return heel strikes, the truth of every pulse, curves and instruments."""
    strikes: list[float] = []
    rows: list[dict[str, Any]] = []
    for motion, (_, offset, end_s) in zip(motions, stretches, strict=True):
        in_stretch = pulses[(pulses["onset_s"] >= offset) & (pulses["onset_s"] <= offset + end_s)]
        strides = _strides(motion, end_s)
        strikes += [s.start_s + offset for s in strides if 0.0 <= s.start_s <= end_s]
        rows += [
            _pulse_truth(
                build, strides, pulse, _course(pulse, shapes), offset_s=offset, window_s=window_s
            )
            for pulse in in_stretch[in_stretch["completed"].astype(bool)].to_dict("records")
        ]
    return {
        "heel_strike_s": strikes,
        "window_s": window_s,
        "pulses": rows,
        "timing_points": _by_point(rows),
        "curves": _curves(build),
        "person": {**asdict(build.person), "sex": build.person.sex},
        "instruments": _instruments(build),
        "settings": asdict(build.preset),
        "plant": describe(build.params),
        **({} if build.load is None else {"load": asdict(build.load)}),
    }


def _strides(motion: GaitMotion, end_s: float) -> list[Stride]:
    strides = [motion.next()]
    while strides[-1].end_s <= end_s + _BEYOND_S:
        strides.append(motion.next())
    return strides


def _phase(strides: list[Stride], time_s: np.ndarray) -> np.ndarray:
    """Return phase in cycles, 0 to 1."""
    starts = np.array([s.start_s for s in strides])
    which = np.searchsorted(starts, time_s, side="right") - 1
    phase = np.empty(time_s.size)
    for i in np.unique(which):
        phase[which == i] = strides[i].cycles(time_s[which == i])
    return np.mod(phase, 1.0)


def _pulse_truth(
    build: PlantBuild,
    strides: list[Stride],
    pulse: dict[Any, Any],
    course: tuple[TorquePart, ...],
    *,
    offset_s: float,
    window_s: float,
) -> dict[str, Any]:
    """Average K, B and J over the window with the information that the angle holds on them.

    The response is that of the true joint with gravity, without reflex, strap and instruments.
    """
    onset_s = float(pulse["onset_s"]) - offset_s
    since = np.arange(round(window_s * _RATE_HZ) + 1) / _RATE_HZ
    phase = _phase(strides, onset_s + since)
    K, B, J, _ = impedance_over_cycle(build.person, build.preset, phase)
    torque = _torque(build, since, pulse, course)
    more_J, more_B, more_K = added_terms(build.person, build.preset, build.load, phase)
    moved = J + build.params[Param.EXO_INERTIA] + more_J
    chain = chain_terms(build.person, build.preset, phase)
    gravity = _gravity_stiffness(build, phase)
    beside, damping = gravity + chain.stiffness + more_K, B + chain.inertia_rate + more_B
    small = K  # before softening
    K, x, v = _softened_response(build, torque, small, beside, damping=damping, inertia=moved)
    a = (torque - damping * v - (K + beside) * x) / moved
    joint = K + beside, damping, moved
    weights = {
        name: window_weights(motion, *joint, rate_hz=_RATE_HZ)
        for name, motion in (("stiffness", x), ("damping", v), ("inertia", a))
    }
    felt = float(weights["inertia"] @ more_J), float(weights["stiffness"] @ more_K)
    after_pct = 100.0 * np.mod(phase - phase[0], 1.0)
    centres = {f"{name}_centre_pct": float(w @ after_pct) for name, w in weights.items()}
    return {
        "pulse": int(pulse["pulse"]),
        "onset_s": float(pulse["onset_s"]),
        "timing_point": str(pulse["timing_point"]),
        "onset_gait_pct": 100.0 * float(phase[0]),
        "stiffness": float(weights["stiffness"] @ K),
        "damping": float(weights["damping"] @ B),
        "inertia": float(weights["inertia"] @ J),
        "gravity_stiffness": float(weights["stiffness"] @ gravity),
        "inertial_stiffness": float(weights["stiffness"] @ chain.stiffness),
        "inertia_rate": float(weights["damping"] @ chain.inertia_rate),
        **centres,
        "displacement_rad": float(x[-1]),
        **_window_values("stiffness", small, K, x),
        **_window_values("damping", B, B, v),
        **(dict(zip(_ADDED, felt, strict=True)) if build.load else {}),
    }


def _window_values(
    name: str, small: np.ndarray, actual: np.ndarray, motion: np.ndarray
) -> dict[str, float]:
    """Return a parameter at the onset, its mean over the window, and its secant.

    The first two are for small motion. The secant is the slope of the parameter's torque over its
    motion by least squares, with the softening at the size of this pulse.
    """
    return {
        f"{name}_onset": float(small[0]),
        f"{name}_window_mean": float(small.mean()),
        f"{name}_secant": float(actual @ motion**2 / (motion @ motion)),
    }


def _softened_response(
    build: PlantBuild,
    torque: np.ndarray,
    K: np.ndarray,
    gravity: np.ndarray,
    *,
    damping: np.ndarray,
    inertia: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the stiffness that softening leaves at the angle reached, the angle and its rate."""
    x, v = respond(torque, K + gravity, damping, inertia, rate_hz=_RATE_HZ)
    softening = build.params[Param.SOFTENING]
    if softening <= 0.0:
        return K, x, v
    for _ in range(_LARGEST_ITERATIONS):
        before, softened = x, K / (1.0 + softening * x**2)
        x, v = respond(torque, softened + gravity, damping, inertia, rate_hz=_RATE_HZ)
        if abs(x - before).max() <= _SAME_ANGLE_RAD:
            break
    return K / (1.0 + softening * x**2), x, v


def window_weights(
    motion: np.ndarray, K: np.ndarray, B: np.ndarray, J: np.ndarray, *, rate_hz: float
) -> np.ndarray:
    r"""Return how much K, B or J at every moment of the window counts in one value for it.

    A small change :math:`\delta(t)` of the parameter moves the angle by :math:`-\int h(s, t)\,
    m(t)\,\delta(t)\,dt`, h being the joint's impulse response. Least squares on the angle with
    one value for the window, whose sensitivity is :math:`S(s) = -\int h(s, t)\,m(t)\,dt`, then
    finds the mean of :math:`\delta` with the weights :math:`-m(t)\,p(t)`, :math:`p(t) = \int
    h(s, t)\,S(s)\,ds`. What changes at the end of a window has no time left to show.

    p obeys the adjoint equation :math:`(Jp)'' - (Bp)' + Kp = S`, at rest at the end. With
    :math:`q = Jp` and time reversed it is that of a joint of inertia 1, damping B/J and
    stiffness K/J + (B/J)'.

    Misleads for large changes within a window, for which the angle is not linear in them, and
    for a fit that weighs the samples of the angle differently.
    """
    sensitivity, _ = respond(-motion, K, B, J, rate_hz=rate_hz)
    damping = (B / J)[::-1]
    stiffness = (K / J)[::-1] + np.gradient(damping, 1.0 / rate_hz)
    adjoint, _ = respond(sensitivity[::-1], stiffness, damping, 1.0, rate_hz=rate_hz)
    weights = -motion * adjoint[::-1] / J
    return np.asarray(weights / weights.sum())


def _torque(
    build: PlantBuild, since: np.ndarray, pulse: dict[Any, Any], course: tuple[TorquePart, ...]
) -> np.ndarray:
    """Return the torque of a pulse behind delay and current loop, N*m."""
    settings = build.preset.actuator
    late = np.maximum(since - settings.delay_s, 0.0)

    def after(change: float, time: np.ndarray, ramp_s: float) -> np.ndarray:
        """Return what a ramp (or a step) of the command becomes behind the current loop."""
        return change * _lagged_ramp(np.maximum(time, 0.0), ramp_s, settings.time_constant_s)

    share, begin_s, level = np.zeros(late.size), 0.0, 0.0
    for part in (*course, TorquePart(0.0, 0.0, 0.0)):  # a step to zero, if it does not end there
        step, ramp = part.begin - level, part.end - part.begin
        for change, ramp_s in ((step, 0.0), (ramp, part.duration_s)):
            if change:
                share += after(change, late - begin_s, ramp_s)
        begin_s, level = begin_s + part.duration_s, part.end
    return np.asarray(float(pulse["amplitude_nm"]) * share)


def _course(pulse: Mapping[Any, Any], shapes: Mapping[str, Pulse]) -> tuple[TorquePart, ...]:
    """Return the course of a pulse; a hold as long as it lasted where its shape is not known."""
    shape = shapes.get(str(pulse.get("shape", "")))
    return shape.course if shape else (TorquePart(float(pulse["duration_s"]), 1.0, 1.0),)


def _lagged_ramp(time: np.ndarray, ramp_s: float, lag_s: float) -> np.ndarray:
    """Return the first-order response to a ramp from 0 to 1 that begins at time 0."""
    if ramp_s == 0.0:
        return np.asarray(-np.expm1(-time / lag_s))

    def rising(since: np.ndarray) -> np.ndarray:
        return np.asarray(since + lag_s * np.expm1(-since / lag_s))

    return np.asarray((rising(time) - rising(np.maximum(time - ramp_s, 0.0))) / ramp_s)


def _gravity_stiffness(build: PlantBuild, phase: np.ndarray) -> np.ndarray:
    """Return what gravity of the limb adds to the apparent stiffness for small motion, N*m/rad."""
    if build.preset.body is None:
        return np.zeros(phase.size)
    thigh = impedance_over_cycle(build.person, build.preset, phase)[3]
    limb = leg_of(build.person, build.preset.body).gravity_nm
    gravity = limb + build.params[Param.EXO_GRAVITY]
    return np.asarray(gravity * np.cos(knee_angle(phase) - thigh))


def _by_point(rows: list[dict[str, Any]]) -> dict[str, dict[str, float]]:
    points = sorted({row["timing_point"] for row in rows})
    return {
        point: {
            name: float(np.mean([row[name] for row in rows if row["timing_point"] == point]))
            for name in (*_MEANS, *_ADDED)
            if name in rows[0]
        }
        for point in points
    }


def _curves(build: PlantBuild) -> dict[str, Any]:
    cycles = np.linspace(0.0, 1.0, _CURVE_POINTS)
    K, B, J, _ = impedance_over_cycle(build.person, build.preset, np.mod(cycles, 1.0))
    chain = chain_terms(build.person, build.preset, np.mod(cycles, 1.0))
    more_J, _, more_K = added_terms(build.person, build.preset, build.load, np.mod(cycles, 1.0))
    felt = more_J.tolist(), more_K.tolist()
    return {
        "gait_pct": (100.0 * cycles).tolist(),
        "stiffness": K.tolist(),
        "damping": B.tolist(),
        "inertia": J.tolist(),
        "gravity_stiffness": _gravity_stiffness(build, np.mod(cycles, 1.0)).tolist(),
        "inertial_stiffness": chain.stiffness.tolist(),
        "inertia_rate": chain.inertia_rate.tolist(),
        "moment": internal_moment(build.person, cycles).tolist(),
        "timing_points": dict(TIMING_POINTS),
        **(dict(zip(_ADDED, felt, strict=True)) if build.load else {}),
    }


def _instruments(build: PlantBuild) -> dict[str, Any]:
    settings, goniometer = build.preset.actuator, build.preset.goniometer
    leg = leg_of(build.person, build.preset.body)
    return {
        **asdict(build.instruments),
        **{
            name: asdict(sensor)
            for name, sensor in draw_motion_instruments(build.person, build.preset).items()
        },
        "angle_delay_s": goniometer.delay_s,
        "tissue_damping": goniometer.tissue_damping if goniometer.tissue_range_hz else None,
        "torsion_rad_nm": goniometer.torsion_rad_nm,
        "actuator_delay_s": settings.delay_s,
        "actuator_time_constant_s": settings.time_constant_s,
        "rotor_inertia": settings.rotor_inertia,
        "leg_inertia": leg.inertia if build.preset.body else None,
    }
