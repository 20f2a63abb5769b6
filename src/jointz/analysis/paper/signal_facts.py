"""Facts about signals, their rates and their calibration."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.paper.leg_facts import ENCODER_LAG, GYROSCOPE_LAGS, lags_of_sensors
from jointz.core.channels import is_turned
from jointz.core.study import Calibrated
from jointz.report.subjects import calibrations, study_spec
from jointz.report.wording import format_exact, format_span, format_with_sd
from jointz.results.estimates import Response
from jointz.results.study_analysis import StudyAnalysis

_Facts = dict[str, Any]

_LAGS: Final = ("angle_lag_s", "torque_lag_s")
_INTRINSIC: Final = ("intrinsic_stiffness", "intrinsic_damping", "intrinsic_inertia")
#: Entry under ``[calibration]`` -> (factor to the unit shown, unit shown).
_CALIBRATED: Final[Mapping[str, tuple[float, str]]] = {
    "angle_lag_s": (1e3, "ms"),
    "torque_lag_s": (1e3, "ms"),
    "torque_gain": (1.0, ""),
    "angle_gain": (1.0, ""),
    "friction_gain": (1.0, ""),
    "intrinsic_stiffness": (1.0, "N·m/rad"),
    "intrinsic_damping": (1.0, "N·m·s/rad"),
    "intrinsic_inertia": (1.0, "kg·m²"),
    "angle_zero_rad": (float(np.degrees(1.0)), "degrees"),
    "angle_per_torque": (1.0, "rad/(N·m)"),
    "joint_encoder_lag_s": (1e3, "ms"),
    "joint_encoder_gain": (1.0, ""),
    "shank_velocity_lag_s": (1e3, "ms"),
    "shank_velocity_gain": (1.0, ""),
    "thigh_velocity_lag_s": (1e3, "ms"),
    "thigh_velocity_gain": (1.0, ""),
}


def signal_facts(analysis: StudyAnalysis) -> _Facts:
    """Return the facts about source and sign of the torque, and the sampling rates."""
    study = study_spec(analysis)
    torque, on_device = study.channels.get("torque"), study.torque_acts_on == "device"
    recorded, analysed = recorded_rates(analysis), response_rates(analysis)
    positive = torque.positive if torque else None
    return {
        "worn": _worn(analysis),
        "torque": torque is not None,
        "column": torque.column if torque else None,
        "on_device": on_device,
        "inverted": is_turned(positive, study.positive, on_device=on_device),
        "model": study.torque_model if "current" in study.channels else None,
        "recorded": format_span(recorded.values(), format_exact) if recorded else "",
        "analysed": format_span(analysed.values(), format_exact) if analysed else "",
    }


def recorded_rates(analysis: StudyAnalysis) -> dict[tuple[str, str], float]:
    """Return the sampling rate of each participant and recording, with a device if any is."""
    rows = analysis.statistics.get("sampling") or ()
    worn = _worn(analysis)
    return {
        (r["participant"], r["recording"]): round(r["rate_hz"], 2)
        for r in rows
        if r["condition"] != "no_device" or not worn
    }


def response_rates(analysis: StudyAnalysis) -> dict[str, float]:
    """Return the sampling rate of each participant's responses."""
    rates = ((c.participant, _rate_hz(c.response)) for c in analysis.cells)
    return {person: rate for person, rate in rates if rate is not None}


def calibration_facts(analysis: StudyAnalysis, *, posterior: bool) -> _Facts:
    """Return the calibrated entries by their place in the intervals, and what they correct."""
    known = calibrations(analysis)
    entries = {
        key: _entry(values, len(known), *unit)
        for key, unit in _CALIBRATED.items()
        if (values := [v for c in known if (v := getattr(c, key))])
        and _affects_estimates(key, analysis)
    }
    # The sd of the zero does not affect K, B and J.
    outside = {"angle_zero_rad"} if posterior else {"angle_zero_rad", "friction_gain"}
    return {
        "included": {key: entry for key, entry in entries.items() if key not in outside},
        "others": {key: entry for key, entry in entries.items() if key in outside},
        "gains": not {"torque_gain", "angle_gain"}.isdisjoint(entries),
        "lags": not set(_LAGS).isdisjoint(entries),
        "twist": "angle_per_torque" in entries,
        "device": not set(_INTRINSIC).isdisjoint(entries),
        "zero": "angle_zero_rad" in entries,
    }


def lag_is_calibrated(analysis: StudyAnalysis) -> bool:
    """Return whether a lag between angle and torque was calibrated for all recordings."""
    return all(any(getattr(c, key) for key in _LAGS) for c in calibrations(analysis))


def _worn(analysis: StudyAnalysis) -> bool:
    """Return whether any recording is with a device; unknown counts as yes."""
    conditions = {r.condition for r in study_spec(analysis).recordings} - {None}
    return (conditions | {s.condition for s in analysis.strides}) != {"no_device"}


def _rate_hz(response: Response | None) -> float | None:
    """Return the sampling rate of a response, rounded to 0.001 Hz."""
    if response is None or len(response.time_s) < 2:
        return None
    return round(1.0 / float(np.median(np.diff(response.time_s))), 3)


def _affects_estimates(key: str, analysis: StudyAnalysis) -> bool:
    if key == "friction_gain":
        return "torque" not in study_spec(analysis).channels
    if key.startswith("joint_encoder_"):
        return ENCODER_LAG in lags_of_sensors(analysis)
    if key.startswith(("shank_velocity_", "thigh_velocity_")):
        return not set(GYROSCOPE_LAGS).isdisjoint(lags_of_sensors(analysis))
    return True


def _entry(values: Sequence[Calibrated], recordings: int, factor: float, unit: str) -> _Facts:
    """Return the smallest and the largest of the values of one entry."""
    pairs = sorted({(c.value, c.sd) for c in values})
    texts = list(dict.fromkeys(format_with_sd(factor * x, factor * sd, unit) for x, sd in pairs))
    return {
        "first": texts[0],
        "last": texts[-1] if len(texts) > 1 else "",
        "n": len(texts),
        "partial": len(values) != recordings,
    }
