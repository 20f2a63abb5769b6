"""True values of the quantities that the method ``bayesian`` estimates, by coupling.

Of a strap, the stiffness is the mean over window and shapes of s(x) K(t) + gravity + that of
the moving chain along the bone's own motion x; its damping is the muscles' alone, without
``inertia_rate``, as the model of the fit has d(J v)/dt. The ground truth's secant weighs the same
torque by x^2 and its motion is that of a joint without strap and reflex, so the estimate's own
truth is made here: x is the difference of two walks of the same strides, with the pulses and with
pulses of no size, by a goniometer without errors; K(t), gravity and J are the ground truth's
curves. Coupled rigidly, it is what the ground truth states: :func:`cell_truth`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from jointz.core.protocols.pulse_models import NamedPulse, PulseSpec
from jointz.rig.devices.interface import Stretch
from jointz.rig.sim.direct_walk import QUICK_GRID, Walk, WalkPlan, walk_directly
from jointz.rig.sim.people import Person
from jointz.rig.sim.presets import GoniometerSettings, Preset
from jointz.rig.sim.rig import SimulatedRig

CONDITION = "perturbed"
_PERFECT = GoniometerSettings(
    delay_s=0.0,
    lag_range_s=(0.0, 0.0),
    gain_error=0.0,
    white_sd_rad=0.0,
    coloured_sd_rad=0.0,
)
#: The inertia of the method is that at this time after the onset.
_INERTIA_AT_S = 0.06
_NO_SIZE_NM = 1e-9


def own_truth(
    person: Person,
    preset: Preset,
    plan: WalkPlan,
    window_s: float,
    *,
    recorded: Mapping[str, Any] | None = None,
) -> dict[str, dict[str, float]]:
    """Return timing point -> true ``stiffness, damping, inertia`` and ``displacement_deg``.

    ``recorded`` is the ground truth of a walk with such pulses, over the same window: the truth is
    that of its pulses, at the phases at which they began; by default that of the plan's at exact
    phases.
    """
    rig = SimulatedRig(person, preset, grid=QUICK_GRID)
    # Of the rig's preset, which has the person's own strap, reflex and softening.
    bare = SimulatedRig(person, _without_errors(rig.preset), grid=QUICK_GRID)
    walk = walk_directly(bare, CONDITION, plan=plan)
    level = walk_directly(bare, CONDITION, plan=_of_no_size(plan))
    moved = _deviations(walk, level, window_s)
    if recorded is None:
        truth = rig.truth(
            CONDITION,
            worn=True,
            stretches=[Stretch(0, 0.0, walk.end_s)],
            pulses=walk.pulses,
            shapes=plan.shapes,
            window_s=window_s,
        )
    else:
        truth = dict(recorded)
        moved = _usual_deviations(walk, moved, truth["pulses"])
    half_rad = rig.preset.joint.softening_rad
    since = np.arange(moved.shape[1]) * rig.grid.period_s
    strides = np.diff(truth["heel_strike_s"]).mean()
    rows = [
        _pulse(pulse, truth["curves"], since / strides, x, half_rad)
        | {"inertia": _inertia(pulse, truth["curves"], _INERTIA_AT_S / strides)}
        for pulse, x in zip(truth["pulses"], moved, strict=True)
    ]
    return _point_means(pd.DataFrame(rows))


def _without_errors(preset: Preset) -> Preset:
    return replace(preset, goniometer=_PERFECT, encoder=None, gyroscopes=None)


def _of_no_size(plan: WalkPlan) -> WalkPlan:
    """Return the plan of the same strides whose pulses move nothing."""

    def small(pulse: NamedPulse) -> NamedPulse:
        sizes = tuple(_NO_SIZE_NM * (k + 1) for k, _ in enumerate(pulse.amplitudes_nm))
        return pulse.model_copy(update={"amplitudes_nm": sizes})

    only: PulseSpec = plan.pulse.model_copy(update={"amplitude_nm": _NO_SIZE_NM})
    return replace(plan, pulse=only, pulses=tuple(small(pulse) for pulse in plan.pulses))


def _deviations(walk: Walk, level: Walk, window_s: float) -> np.ndarray:
    """Return how far every pulse moved the joint, (pulse, n), rad."""
    period_s = float(walk.time_s[1] - walk.time_s[0])
    n = round(window_s / period_s) + 1
    first = np.round(walk.pulses["onset_s"].to_numpy(dtype=float) / period_s).astype(int)
    moved = walk.channels["angle"] - level.channels["angle"]
    return np.asarray(moved[first[:, None] + np.arange(n)])


def _usual_deviations(
    walk: Walk, moved: np.ndarray, pulses: Sequence[Mapping[str, Any]]
) -> np.ndarray:
    """Return the root mean square deviation of the walk at the timing point of every pulse, rad."""
    points = walk.pulses["timing_point"].to_numpy()
    usual = {p: np.sqrt((moved[points == p] ** 2).mean(axis=0)) for p in np.unique(points)}
    return np.array([usual[pulse["timing_point"]] for pulse in pulses])


def _pulse(
    pulse: dict[str, Any],
    curves: dict[str, Any],
    cycles: np.ndarray,
    x: np.ndarray,
    half_rad: float | None,
) -> dict[str, Any]:
    """Return the truths of one pulse, but for the inertia."""
    phase = pulse["onset_gait_pct"] + 100.0 * cycles
    small = _along(curves, "stiffness", phase)
    # Of gravity and of the moving chain, which do not soften.
    firm = _along(curves, "gravity_stiffness", phase) + _along(curves, "inertial_stiffness", phase)
    softened = small if half_rad is None else small / (1.0 + (x / half_rad) ** 2)
    # The mean for small motion is the ground truth's, by exact phases: strides differ in time.
    kept = float(softened.mean() / small.mean())
    return {
        "timing_point": pulse["timing_point"],
        "stiffness": kept * pulse["stiffness_window_mean"] + float(firm.mean()),
        "damping": pulse["damping_window_mean"],
        "displacement_deg": float(np.degrees(np.abs(x).max())),
    }


def _inertia(pulse: dict[str, Any], curves: dict[str, Any], cycles: float) -> float:
    phase = np.array([pulse["onset_gait_pct"] + 100.0 * cycles])
    return float(_along(curves, "inertia", phase)[0])


def _along(curves: dict[str, Any], name: str, phase_pct: np.ndarray) -> np.ndarray:
    return np.asarray(np.interp(np.mod(phase_pct, 100.0), curves["gait_pct"], curves[name]))


def cell_truth(truth: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Return timing point -> truth of a rigid coupling, mean over its pulses.

    These are the apparent ``stiffness`` (gravity and chain included), ``damping`` and ``inertia``.
    """
    pulses = pd.DataFrame(truth["pulses"])
    pulses["stiffness"] += pulses["gravity_stiffness"] + pulses.get("inertial_stiffness", 0.0)
    return _point_means(pulses[["timing_point", "stiffness", "damping", "inertia"]])


def _point_means(pulses: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return timing point -> mean of every column over its pulses."""
    means = pulses.groupby("timing_point").mean()
    return {
        str(point): {str(name): float(value) for name, value in row.items()}
        for point, row in means.iterrows()
    }
