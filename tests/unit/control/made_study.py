"""A small analysis with known impedance, stride and moment."""

import numpy as np

from jointz.core.gait_phases import TIMING_POINTS
from jointz.results.estimates import CellEstimate, ParameterEstimate
from jointz.results.mean_stride import MeanStride
from jointz.results.study_analysis import PopulationEstimate, StudyAnalysis

STIFFNESS = dict(zip(TIMING_POINTS, (150.0, 60.0, 90.0, 80.0, 30.0, 25.0), strict=True))
DAMPING = dict(zip(TIMING_POINTS, (2.5, 3.0, 3.5, 2.0, 2.5, 2.0), strict=True))
MASS_KG = {"S01": 75.0, "S02": 60.0}


def estimate(name, value, *, sd=0.05, status="ok"):
    low, high = value * np.exp(-1.96 * sd), value * np.exp(1.96 * sd)
    return ParameterEstimate(name, value if status == "ok" else None, low, high, status)


def cell(person, point, **more):
    parameters = (
        estimate("stiffness", STIFFNESS[point], **more),
        estimate("damping", DAMPING[point], **more),
    )
    return CellEstimate(
        person, point, TIMING_POINTS[point], parameters, 99.0, 50, 0, "dissertation",
        centre_gait_pct=TIMING_POINTS[point] + 5.0,
    )  # fmt: skip


def stride(person, *, moment=True, condition="unperturbed"):
    turn = np.linspace(0.0, 2.0 * np.pi, 101)
    angle = 0.4 + 0.3 * np.cos(turn - 4.6) + 0.05 * np.sin(2 * turn - 1.1)
    torque = -20.0 * np.sin(2.0 * turn) if moment else None
    return MeanStride(
        person, condition, 60, np.linspace(0.0, 100.0, 101), angle, np.full(101, 0.03),
        moment=torque, moment_sd=None if torque is None else np.full(101, 1.5), stride_s=1.1,
    )  # fmt: skip


def made_analysis(cells=None, strides=None, *, population=(), joint="knee", masses=MASS_KG):
    return StudyAnalysis(
        cells=tuple(cells or (cell(p, point) for p in MASS_KG for point in TIMING_POINTS)),
        mean_strides=tuple(strides or (stride(person) for person in MASS_KG)),
        population=population,
        settings={"kind": "walking", "joint": joint, "positive": "flexion", "method": "any"},
        provenance={"study": {"participants": [
            {"id": person, "mass_kg": mass} for person, mass in masses.items()
        ]}},
    )  # fmt: skip


def means():
    return tuple(
        PopulationEstimate(
            point, TIMING_POINTS[point], name, values[point], "", None, 0.9 * values[point],
            1.1 * values[point], 2, "any", "ok",
        )
        for name, values in (("stiffness", STIFFNESS), ("damping", DAMPING))
        for point in TIMING_POINTS
    )  # fmt: skip
