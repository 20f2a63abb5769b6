"""Sentences of a methods section about calibration."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from jointz.analysis.paper.methods_bayesian import lags_of_sensors
from jointz.analysis.paper.methods_used import FULL_RECORD, WITH_POSTERIOR, used_methods
from jointz.core.study import Calibrated, CalibrationSpec
from jointz.report.subjects import calibrations, study_spec
from jointz.report.wording import format_with_sd
from jointz.results.study_analysis import StudyAnalysis

_LAGS: Final = ("angle_lag_s", "torque_lag_s")
_GAINS: Final = ("torque_gain", "angle_gain")
_INTRINSIC: Final = ("intrinsic_stiffness", "intrinsic_damping", "intrinsic_inertia")
#: Entry under ``[calibration]`` -> (in words, factor to the unit shown, unit shown).
_CALIBRATED: Final[Mapping[str, tuple[str, float, str]]] = {
    "angle_lag_s": ("lag of the angle", 1e3, "ms"),
    "torque_lag_s": ("lag of the torque", 1e3, "ms"),
    "torque_gain": ("gain of the torque", 1.0, ""),
    "angle_gain": ("gain of the angle", 1.0, ""),
    "friction_gain": ("actual over stated friction of the actuator", 1.0, ""),
    "intrinsic_stiffness": ("stiffness of the device", 1.0, "N·m/rad"),
    "intrinsic_damping": ("damping of the device", 1.0, "N·m·s/rad"),
    "intrinsic_inertia": ("inertia of the device", 1.0, "kg·m²"),
    "angle_zero_rad": ("zero of the angle", float(np.degrees(1.0)), "degrees"),
    "angle_per_torque": ("change of the angle reading per torque", 1.0, "rad/(N·m)"),
    "joint_encoder_lag_s": ("lag of the device's encoder", 1e3, "ms"),
    "joint_encoder_gain": ("gain of the device's encoder", 1.0, ""),
    "shank_velocity_lag_s": ("lag of the gyroscope on the shank", 1e3, "ms"),
    "shank_velocity_gain": ("gain of the gyroscope on the shank", 1.0, ""),
    "thigh_velocity_lag_s": ("lag of the gyroscope on the thigh", 1e3, "ms"),
    "thigh_velocity_gain": ("gain of the gyroscope on the thigh", 1.0, ""),
}
#: Begin of the names of entries of sensors -> lags that are estimated where they are used.
_OF_SENSORS: Final[Mapping[str, tuple[str, ...]]] = {
    "joint_encoder_": ("joint_encoder_lag",),
    "shank_velocity_": ("joint_velocity_lag", "shank_velocity_lag"),
    "thigh_velocity_": ("joint_velocity_lag", "shank_velocity_lag"),
}
#: Entries whose sd does not affect K, B and J.
_OF_POSTURE: Final = ("angle_zero_rad",)


def calibration_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe the calibration of the instruments and its use."""
    known = calibrations(analysis)
    used = used_methods(analysis)
    keys = [
        key
        for key in _CALIBRATED
        if any(getattr(c, key) for c in known) and _affects_estimates(key, analysis)
    ]
    included = [key for key in keys if _in_intervals(key, used)]
    sentences = [
        f"Calibration, value ± SD, {place}: {'; '.join(_entry(k, known) for k in some)}."
        for place, some in (
            ("the SD included in the intervals", included),
            ("the SD not included in the intervals", [k for k in keys if k not in included]),
        )
        if some
    ]
    sentences += _corrections(keys, used)
    if not any(getattr(c, key) for c in known for key in _LAGS):
        sentences.append("No lag between angle and torque was calibrated.")
    return sentences


def lag_is_calibrated(analysis: StudyAnalysis) -> bool:
    """Return whether a lag between angle and torque was calibrated for all recordings."""
    return all(any(getattr(c, key) for key in _LAGS) for c in calibrations(analysis))


def _affects_estimates(key: str, analysis: StudyAnalysis) -> bool:
    if key == "friction_gain":
        return "torque" not in study_spec(analysis).channels
    for begin, lags in _OF_SENSORS.items():
        if key.startswith(begin):
            return not set(lags_of_sensors(analysis)).isdisjoint(lags)
    return True


def _in_intervals(key: str, used: Sequence[str]) -> bool:
    if key == "friction_gain":
        return not WITH_POSTERIOR.isdisjoint(used)
    return key not in _OF_POSTURE


def _entry(key: str, known: Sequence[CalibrationSpec]) -> str:
    name, factor, unit = _CALIBRATED[key]
    found: list[Calibrated] = [c for one in known if (c := getattr(one, key)) is not None]
    entries = sorted({(c.value, c.sd) for c in found})
    values = dict.fromkeys(format_with_sd(factor * x, factor * sd, unit) for x, sd in entries)
    first, *others = values
    last = f" to {others[-1]} ({len(values)} calibrations)" if others else ""
    some = "" if len(found) == len(known) else " (not of all recordings)"
    return f"{name} {first}{last}{some}"


def _corrections(keys: Sequence[str], used: Sequence[str]) -> list[str]:
    """Describe how the entries were used in the estimation."""
    subtracted = (
        "subtracted from the estimates"
        if WITH_POSTERIOR.isdisjoint(used)
        else "removed from the torque as far as the motion of its motor was recorded; the rest was "
        "subtracted from the estimates"
    )
    sentences = (
        (_GAINS, "The signals were divided by their gains."),
        (_LAGS, _lag_correction(used)),
        (
            ("angle_per_torque",),
            "The change of the angle reading caused by torque was subtracted.",
        ),
        (_INTRINSIC, f"The impedance of the device was {subtracted}."),
        (("angle_zero_rad",), "Angles are relative to the calibrated zero."),
    )
    return [sentence for entries, sentence in sentences if set(keys) & set(entries)]


def _lag_correction(used: Sequence[str]) -> str:
    if not WITH_POSTERIOR.isdisjoint(used):
        return "The calibrated lag was a prior of the fit."
    if FULL_RECORD not in used:
        return "The calibrated lag was corrected by a shift."
    others = "" if list(used) == [FULL_RECORD] else "; elsewhere it was corrected by a shift"
    return f"The calibrated lag was a prior of the fit to whole trials{others}."
