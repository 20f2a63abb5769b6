"""What a methods section says of calibration: which entries, what was done, what is carried."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.paper.methods_used import FULL_RECORD, RECOMMENDED, used_methods
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
    "friction_gain": ("true over stated friction of the actuator", 1.0, ""),
    "intrinsic_stiffness": ("stiffness of the device", 1.0, "N·m/rad"),
    "intrinsic_damping": ("damping of the device", 1.0, "N·m·s/rad"),
    "intrinsic_inertia": ("inertia of the device", 1.0, "kg·m²"),
    "angle_zero_rad": ("zero of the angle", float(np.degrees(1.0)), "degrees"),
    "angle_per_torque": ("angle shown per torque", 1.0, "rad/(N·m)"),
    "tissue_hz": ("resonance of tissue below the sensor", 1.0, "Hz"),
}
#: Entries whose sd only the recommended method has a place for.
_OF_RECOMMENDED: Final = ("friction_gain", "tissue_hz")
#: Entries whose sd says nothing of K, B and J.
_OF_POSTURE: Final = ("angle_zero_rad",)


def calibration_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say what was known of the instruments, and what was made of it."""
    given = list(_calibrations(analysis))
    used = used_methods(analysis)
    keys = [k for k in _CALIBRATED if any(c.get(k) for c in given) and _has_part(k, analysis)]
    carried = [k for k in keys if _is_carried(k, used)]
    sentences = [
        f"Calibration, value ± SD, {told}: {'; '.join(_entry(k, given) for k in own)}."
        for told, own in (
            ("the SD carried into the intervals", carried),
            ("the SD not in the intervals", [k for k in keys if k not in carried]),
        )
        if own
    ]
    return [*sentences, *_what_was_done(keys, used), *_without_lag(given)]


def lag_is_calibrated(analysis: StudyAnalysis) -> bool:
    """Tell whether a lag between angle and torque was calibrated for everything analysed."""
    return all(any(c.get(k) for k in _LAGS) for c in _calibrations(analysis))


def _calibrations(analysis: StudyAnalysis) -> Iterable[Mapping[str, Any]]:
    """Yield what holds for each recording: its own entries over its participant's and study's."""
    study = analysis.provenance.get("study") or {}
    common = study.get("calibration") or analysis.settings.get("calibration") or {}
    people = {str(p.get("id")): p.get("calibration") or {} for p in study.get("participants") or ()}
    worn = [r for r in study.get("recordings") or () if r.get("condition") != "no_device"]
    for entry in worn:
        person = people.get(str(entry.get("participant")), {})
        yield {**common, **person, **(entry.get("calibration") or {})}
    if not worn:
        yield from ({**common, **own} for own in people.values() or ({},))


def _has_part(key: str, analysis: StudyAnalysis) -> bool:
    """Tell whether an entry has a part in the estimates at all."""
    if key == "friction_gain":
        return "torque" not in ((analysis.provenance.get("study") or {}).get("channels") or {})
    return key != "tissue_hz" or RECOMMENDED in used_methods(analysis)


def _is_carried(key: str, used: Sequence[str]) -> bool:
    return key not in _OF_POSTURE and (key not in _OF_RECOMMENDED or RECOMMENDED in used)


def _entry(key: str, given: Sequence[Mapping[str, Any]]) -> str:
    name, factor, unit = _CALIBRATED[key]
    entries = (c[key] for c in given if c.get(key))
    shown = dict.fromkeys(
        format_with_sd(factor * e["value"], factor * e["sd"], unit) for e in entries
    )
    some = "" if all(c.get(key) for c in given) else " (not of all recordings)"
    return f"{name} {' or '.join(shown)}{some}"


def _what_was_done(keys: Sequence[str], used: Sequence[str]) -> list[str]:
    """Say how the entries came into the estimates."""
    there = set(keys)
    sentences = ["Gains were divided out."] if there & set(_GAINS) else []
    sentences += _lag_done(used) if there & set(_LAGS) else []
    if "angle_per_torque" in there:
        sentences.append(
            "The angle shown per torque was a prior of the fit."
            if RECOMMENDED in used
            else "What torque made the sensor show was taken off the angle."
        )
    if there & set(_INTRINSIC):
        where = (
            "taken out of the torque as far as the motion of its motor was recorded, and the rest "
            "subtracted from the estimates"
            if RECOMMENDED in used
            else "subtracted from the estimates"
        )
        sentences.append(f"The impedance of the device was {where}.")
    if "angle_zero_rad" in there:
        sentences.append("Angles are counted from the calibrated zero.")
    return sentences


def _lag_done(used: Sequence[str]) -> list[str]:
    if RECOMMENDED in used:
        return ["The calibrated lag was a prior of the fit."]
    if FULL_RECORD not in used:
        return ["The calibrated lag was shifted out."]
    rest = "" if list(used) == [FULL_RECORD] else ", and shifted out elsewhere"
    return [f"The calibrated lag was a prior of the fit to whole trials{rest}."]


def _without_lag(given: Sequence[Mapping[str, Any]]) -> list[str]:
    if any(c.get(k) for c in given for k in _LAGS):
        return []
    return ["No lag between angle and torque was calibrated."]
