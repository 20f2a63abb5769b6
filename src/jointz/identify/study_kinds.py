"""Kinds of study, walking and bench, and what they differ in when impedance is estimated."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StudyKind:
    """A kind of study."""

    name: str  # value of ``kind`` in study.toml
    by_gait: bool  # whether timing points are phases of the gait cycle; otherwise cases or trials
    by_side: bool  # whether every session and side is estimated by itself
    drifts: bool  # whether posture drifts, so that neighbouring strides are resampled together
    # attributes that a recording should share with its unperturbed one
    reference_keys: tuple[str, ...]
    bounded: bool  # whether the dissertation asks for K, B, J >= 0
    per_mass: bool  # whether values per kg are expected even if the mass is missing
    single_pulses: bool  # whether every pulse is also estimated by itself


WALKING = StudyKind(
    name="walking",
    by_gait=True,
    by_side=True,
    drifts=True,
    reference_keys=("session", "side"),  # a new donning moves the sensor
    bounded=True,
    per_mass=True,
    single_pulses=False,
)
BENCH = StudyKind(
    name="bench",
    by_gait=False,
    by_side=False,
    drifts=False,
    reference_keys=("session", "side", "trial"),  # every trial has its own reference
    bounded=False,
    per_mass=False,
    single_pulses=True,
)
#: Kinds by name.
KINDS: Mapping[str, StudyKind] = {kind.name: kind for kind in (WALKING, BENCH)}
