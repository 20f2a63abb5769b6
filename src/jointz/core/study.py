"""Models of ``study.toml``.

Only shape and vocabulary are checked here; units, files and columns are
checked where they are read (:mod:`jointz.io.study_reader`).
"""

import codecs
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, Field, model_validator

from jointz.core.channels import (
    CONDITIONS,
    HEEL_STRIKES,
    LABEL_CHANNELS,
    OPPOSITE_DIRECTION,
)
from jointz.core.checked_model import STRICT
from jointz.core.codes import Exclusion
from jointz.core.gait_phases import ALL_POINTS
from jointz.core.priors import PriorsSpec

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
_FORMULA = re.compile(r"(?:^|;)\s*([=+\-@])")  # a semicolon parts cells where a comma is decimal
# Lengths beyond these were written in cm or mm.
_TALLEST_PERSON_M = 3.0
_LONGEST_LIMB_M = 2.0
_CLOSEST_WEIGHT_M = 0.02
GRAVITY = 9.81  # m/s^2
#: Largest parts of an addition to a knee, N*m/rad and kg*m^2: more was written in another unit.
MOST_ADDED = {"stiffness": 400.0, "inertia": 0.4}

Condition = Literal["unperturbed", "perturbed", "no_device"]
Baseline = Literal["pre_pulse", "unperturbed_mean", "matched_strides", "predicted"]


def _condition(value: Any) -> Any:
    if isinstance(value, str):
        return CONDITIONS.get(value.strip().lower(), value)
    return value


def _text(value: Any) -> Any:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def name_problem(name: str) -> str:
    """Return the reason why a name is not allowed in a table, "" if it is."""
    if _CONTROL.search(name):
        return "must not hold control characters"
    formula = _FORMULA.search(name)
    return (
        f"must not begin with '{formula[1]}' (spreadsheets run it as a formula)" if formula else ""
    )


def _safe(name: str) -> str:
    if problem := name_problem(name):
        raise ValueError(problem)
    return name


def _safe_file(name: str) -> str:
    if problem := name_problem(name):
        raise ValueError(f"{problem}; rename the file, or put ./ in front")
    return name


def _direction(value: Any) -> Any:
    if isinstance(value, str) and value not in OPPOSITE_DIRECTION:
        raise ValueError(f"expected one of {', '.join(sorted(OPPOSITE_DIRECTION))}; got {value!r}")
    return value


def _column(value: Any) -> Any:
    if type(value) not in (str, int):  # true would pass for 1
        raise ValueError("expected the name or the number of a column")
    return value


def _named_column(value: Any) -> Any:
    return {"column": value} if isinstance(value, str) else value


def _scale(value: float) -> float:
    if not (math.isfinite(value) and value):
        raise ValueError(f"expected a number other than 0, got {value}")
    return value


def _encoding(name: str) -> str:
    try:
        "".encode(name)  # knows encodings of text only
    except (LookupError, UnicodeError) as exc:
        raise ValueError(
            f"expected an encoding such as utf-8, cp1252 or utf-16; got {name!r}"
        ) from exc
    return codecs.lookup(name).name


def _version(value: Any) -> Any:
    if type(value) is not int:  # true and 1.0 would pass for 1
        raise ValueError("expected 1")
    return value


ConditionField = Annotated[Condition, BeforeValidator(_condition)]
Name = Annotated[str, BeforeValidator(_text), Field(min_length=1)]
#: Names that others wrote and that stand in tables; a protocol has stricter rules of its own.
TableName = Annotated[Name, AfterValidator(_safe)]
FileName = Annotated[str, Field(min_length=1), AfterValidator(_safe_file)]
Direction = Annotated[str, BeforeValidator(_direction)]
Column = Annotated[str | int, BeforeValidator(_column)]
#: Of a file that people write: the first, and so far only one.
SchemaVersion = Annotated[Literal[1], BeforeValidator(_version)]


class _Model(BaseModel):
    model_config = STRICT


class FilesSpec(_Model):
    """Layout of text files."""

    encoding: Annotated[str, AfterValidator(_encoding)] | None = None
    delimiter: str | None = Field(default=None, min_length=1)
    decimal: Literal[".", ","] = "."
    skip_rows: int = Field(default=0, ge=0)
    header: bool = True
    missing: tuple[str, ...] = Field(default=(), strict=False)


class ClockSpec(_Model):
    """Clock of a channel: time stamps in a column, or a rate and the time of the first sample."""

    column: Column | None = None
    unit: str | None = None
    rate_hz: float | None = Field(default=None, gt=0)
    start_s: float = 0.0

    @model_validator(mode="after")
    def _is_stamps_or_rate(self) -> "ClockSpec":
        if (self.column is None) == (self.rate_hz is None):
            raise ValueError("expected either column, with time stamps, or rate_hz")
        if self.rate_hz is not None and self.unit is not None:
            raise ValueError("unit: belongs to time stamps; start_s is in s")
        return self


class ChannelChange(_Model):
    """Keys of a channel that differ in one recording.

    ``unit`` is that of the file's numbers times ``scale``; ``threshold`` of a trigger is in it.
    ``time`` is the channel's clock, where it is not that of ``channels.time``.
    """

    column: Column | None = None
    unit: str | None = None
    time: ClockSpec | None = None
    scale: Annotated[float, AfterValidator(_scale)] | None = None
    invert: bool = False
    kind: Literal["contact", "voltage", "pulse"] | None = None
    positive: Direction | None = None
    threshold: float | None = Field(default=None, allow_inf_nan=False)


class ChannelSpec(ChannelChange):
    """Column of one channel in a file, with unit, kind and direction."""

    column: Column
    values: dict[str, Annotated[str, AfterValidator(_safe)]] | None = None

    @property
    def factor(self) -> float:
        """Factor of the file's numbers before their unit is converted: scale and sign."""
        return (-1.0 if self.invert else 1.0) * (1.0 if self.scale is None else self.scale)


class Calibrated(_Model):
    """A calibrated value and its standard deviation."""

    value: float
    sd: float = Field(ge=0.0)


class CalibrationSpec(_Model):
    """Calibration of the instruments; every entry has its sd.

    ``angle_zero_rad`` is what the record shows at the joint's true zero, ``angle_per_torque``
    (rad/(N*m)) what it shows per torque on a joint that stands still. A footswitch that gives
    volts is on from ``contact_threshold_v`` and off below ``contact_release_v``. ``tissue_hz`` is
    the resonance of the tissue between joint and sensor. Lags are total lags, positive where the
    record is late. Gains are measured over true, but ``friction_gain``: true over stated.
    """

    angle_lag_s: Calibrated | None = None
    torque_lag_s: Calibrated | None = None
    torque_gain: Calibrated | None = None
    angle_gain: Calibrated | None = None
    intrinsic_stiffness: Calibrated | None = None
    intrinsic_damping: Calibrated | None = None
    intrinsic_inertia: Calibrated | None = None
    friction_gain: Calibrated | None = None
    angle_zero_rad: Calibrated | None = None
    angle_per_torque: Calibrated | None = None
    tissue_hz: Calibrated | None = None
    contact_threshold_v: Calibrated | None = None
    contact_release_v: Calibrated | None = None
    joint_encoder_lag_s: Calibrated | None = None
    joint_encoder_gain: Calibrated | None = None
    shank_velocity_lag_s: Calibrated | None = None
    shank_velocity_gain: Calibrated | None = None
    thigh_velocity_lag_s: Calibrated | None = None
    thigh_velocity_gain: Calibrated | None = None

    @model_validator(mode="after")
    def _gains_are_positive(self) -> "CalibrationSpec":
        for name in (n for n in type(self).model_fields if n.endswith("_gain")):
            entry = getattr(self, name)
            if entry is not None and entry.value <= 0:
                of = "true over stated" if name == "friction_gain" else "measured over true"
                raise ValueError(f"{name}: {of} must be positive, got {entry.value}")
        return self

    @model_validator(mode="after")
    def _tissue_resonates(self) -> "CalibrationSpec":
        if self.tissue_hz is not None and self.tissue_hz.value <= 0:
            raise ValueError(f"tissue_hz: must be positive, got {self.tissue_hz.value}")
        return self

    @model_validator(mode="after")
    def _contact_levels_are_two(self) -> "CalibrationSpec":
        on, off = self.contact_threshold_v, self.contact_release_v
        if (on is None) != (off is None):
            missing = "contact_threshold_v" if on is None else "contact_release_v"
            raise ValueError(
                f"{missing}: missing; contact_threshold_v and contact_release_v go together"
            )
        if on is not None and off is not None and on.value <= off.value:
            raise ValueError(
                f"contact_threshold_v: {on.value} V must lie above contact_release_v, "
                f"{off.value} V; a switch that is low on the ground has invert = true"
            )
        return self

    @property
    def contact_levels_v(self) -> tuple[float, float] | None:
        """Levels of the footswitch, V: off below the first, on from the second; None if unknown."""
        if self.contact_threshold_v is None or self.contact_release_v is None:
            return None
        return self.contact_release_v.value, self.contact_threshold_v.value

    def overridden_by(self, other: "CalibrationSpec | None") -> "CalibrationSpec":
        """Return this calibration with the entries that ``other`` gives."""
        if other is None:
            return self
        values = {name: getattr(other, name) for name in other.model_fields_set}
        return self.model_copy(update=values)


class TorqueModelSpec(_Model):
    """Model of torque from current (equations 3.1 to 3.3 and 4.1).

    Velocity and acceleration are those of the output, after the gear.
    """

    gear_ratio: float = Field(gt=0)
    torque_constant: float
    bias: float = 0.0
    viscous_friction: float = 0.0
    coulomb_friction: float = 0.0
    gear_friction: float = 0.0
    rotor_inertia: float = 0.0

    @property
    def torque_per_ampere(self) -> float:
        """Magnitude of the output torque per ampere, N*m/A."""
        return abs(self.gear_ratio * self.torque_constant)


class DeviceSpec(_Model):
    """Mass on the moving segment, beyond the place where torque is measured.

    ``centre_m`` is the distance of its centre of mass from the joint.
    """

    mass_kg: float = Field(gt=0)
    centre_m: float = Field(ge=0, lt=_LONGEST_LIMB_M)


class ParticipantSpec(_Model):
    """A person, or a case on a bench.

    ``limb_mass_kg`` is the mass of all that moves with the joint's distal segment (of a knee:
    shank and foot), ``limb_centre_m`` the distance of its centre from the joint.
    """

    id: TableName
    mass_kg: float | None = Field(default=None, gt=0)
    height_m: float | None = Field(default=None, gt=0, lt=_TALLEST_PERSON_M)
    limb_mass_kg: float | None = Field(default=None, gt=0)
    limb_centre_m: float | None = Field(default=None, gt=0, lt=_LONGEST_LIMB_M)
    group: TableName | None = None
    calibration: CalibrationSpec | None = None

    @model_validator(mode="after")
    def _limb_is_whole(self) -> "ParticipantSpec":
        if (self.limb_mass_kg is None) != (self.limb_centre_m is None):
            missing = "limb_mass_kg" if self.limb_mass_kg is None else "limb_centre_m"
            raise ValueError(f"{missing}: missing; limb_mass_kg and limb_centre_m go together")
        whole, limb = self.mass_kg, self.limb_mass_kg
        if whole is not None and limb is not None and limb >= whole:
            raise ValueError(f"limb_mass_kg: {limb} kg is not less than mass_kg, {whole} kg")
        return self


class JoinedSpec(_Model):
    """A file that another device wrote by its own clock, brought to the time of a recording.

    ``events_s`` are pairs of times of one event, by the recording and by this file: one gives the
    offset, two or more also the rate of its clock. ``offset_s`` is time of the recording minus time
    of this file.
    """

    file: FileName
    channels: dict[TableName, ChannelSpec]
    files: FilesSpec = FilesSpec()
    offset_s: float | None = None
    events_s: tuple[Annotated[tuple[float, float], Field(strict=False)], ...] = Field(
        default=(), strict=False
    )

    @model_validator(mode="after")
    def _can_be_placed(self) -> "JoinedSpec":
        if (self.offset_s is None) == (not self.events_s):
            raise ValueError("expected either offset_s or events_s, which say when its time begins")
        if len({own for _, own in self.events_s}) < len(self.events_s):
            raise ValueError("events_s: expected different times of different events")
        if "time" not in self.channels or len(self.channels) < 2:
            raise ValueError("channels: expected time, and a channel or more to be joined")
        if unfit := {*LABEL_CHANNELS, HEEL_STRIKES} & set(self.channels):
            raise ValueError(f"channels.{min(unfit)}: cannot be joined; only samples can")
        if timed := [name for name, channel in self.channels.items() if channel.time]:
            raise ValueError(f"channels.{timed[0]}.time: expected one clock; join the file twice")
        return self


class RecordingSpec(_Model):
    """One file, or the part of a file that belongs to one participant."""

    participant: TableName
    file: FileName
    condition: ConditionField | None = None
    perturbations: FileName | None = None
    part: Annotated[str, BeforeValidator(_text)] | None = None
    channels: dict[str, ChannelChange] | None = None
    files: FilesSpec | None = None
    session: TableName | None = None
    side: Literal["left", "right"] | None = None
    calibration: CalibrationSpec | None = None
    joined: tuple[JoinedSpec, ...] = Field(default=(), strict=False)
    heel_strikes: FileName | None = None

    @property
    def joined_channels(self) -> dict[str, ChannelSpec]:
        """Channels of samples that joined files bring."""
        return {n: c for one in self.joined for n, c in one.channels.items() if n != "time"}

    @property
    def other_files(self) -> tuple[str, ...]:
        """Files beside that of the samples: joined ones, heel strikes, pulses."""
        tables = (self.heel_strikes, self.perturbations)
        return (*(one.file for one in self.joined), *filter(None, tables))

    @property
    def label(self) -> str:
        """Name of the recording in results: its file, and its part of it."""
        return self.file if self.part is None else f"{self.file}#{self.part}"


class GroupSpec(_Model):
    """Groups of pulses by the value of a channel at onset."""

    channel: str
    edges: tuple[float, ...] = Field(min_length=2, strict=False)
    unit: str | None = None

    @model_validator(mode="after")
    def _edges_increase(self) -> "GroupSpec":
        if any(b <= a for a, b in pairwise(self.edges)):
            raise ValueError(f"edges must increase, got {list(self.edges)}")
        return self


class PulseColumn(_Model):
    """Column of a pulse table; its unit is that of time or torque, or ``sample``."""

    column: Annotated[str, Field(min_length=1)]
    unit: str | None = None


PulseMeaning = Literal[
    "onset", "duration", "amplitude", "timing_point", "recording", "participant", "session", "side"
]


class PerturbationsSpec(_Model):
    """Settings for finding pulses, grouping them, and their baseline."""

    columns: dict[PulseMeaning, Annotated[PulseColumn, BeforeValidator(_named_column)]] | None = (
        None
    )
    first_sample: Literal[0, 1] | None = None
    timing_points: dict[TableName, float] | None = None
    source: Literal["command", "table", "trigger", "reference", "angle"] | None = None
    baseline: Baseline | None = None
    window_s: float = Field(default=0.1, ge=0.001, le=10)
    cutoff_hz: float = Field(default=20.0, gt=0)
    group: GroupSpec | None = None

    @model_validator(mode="after")
    def _timing_points_in_cycle(self) -> "PerturbationsSpec":
        for name, pct in (self.timing_points or {}).items():
            if name == ALL_POINTS:
                raise ValueError(f"timing_points.{name}: means all of them; expected another name")
            if not 0 <= pct < 100:
                raise ValueError(f"timing_points.{name}: expected 0 <= % of cycle < 100, got {pct}")
        return self


class AdditionSpec(_Model):
    """Known addition to the joint: a weight or a spring in a session, on a bench a load.

    ``gravity_nm`` is the largest torque of gravity on it (weight times distance from the joint).
    """

    session: TableName | None = None
    participant: TableName | None = None
    inertia: Calibrated | None = None
    stiffness: Calibrated | None = None
    damping: Calibrated | None = None
    gravity_nm: Calibrated | None = None

    @model_validator(mode="after")
    def _adds_something(self) -> "AdditionSpec":
        every = (self.inertia, self.stiffness, self.damping, self.gravity_nm)
        entries = [entry for entry in every if entry is not None]
        if not entries or any(entry.value <= 0.0 for entry in entries):
            raise ValueError(
                "expected inertia, stiffness, damping (bench) or gravity_nm (walking) above 0; "
                "leave out zeros"
            )
        distance_m = self.distance_m
        if distance_m is not None and not _CLOSEST_WEIGHT_M <= distance_m <= _LONGEST_LIMB_M:
            raise ValueError(
                "gravity_nm: m g d goes with the inertia m d^2 of the same weight; they give "
                f"d = {distance_m:.3g} m, expected {_CLOSEST_WEIGHT_M:g} to {_LONGEST_LIMB_M:g}"
            )
        return self

    @property
    def distance_m(self) -> float | None:
        """Distance of the weight from the joint, m; None without a weight."""
        if self.gravity_nm is None:
            return None
        inertia = 0.0 if self.inertia is None else self.inertia.value
        return GRAVITY * inertia / self.gravity_nm.value


#: Half-widths that a plan expected: parameter -> timing point -> % of the value.
PlannedHalfWidths = Mapping[
    Literal["stiffness", "damping", "inertia"], Mapping[str, Annotated[float, Field(gt=0)]]
]


class StudySpec(_Model):
    """A ``study.toml``, schema version 1.

    ``subjects`` tells people from loads where a bench measured: a load is no sample of anything.
    """

    jointz: SchemaVersion
    joint: Annotated[str, Field(min_length=1), AfterValidator(_safe)]
    kind: Literal["walking", "bench"]
    subjects: Literal["people", "loads"] | None = None
    positive: Direction = "flexion"
    torque_acts_on: Literal["joint", "device"] = "joint"
    coupling: Literal["strap", "rigid"] | None = None
    sample_rate_hz: float | None = Field(default=None, gt=0)
    channels: dict[Annotated[str, AfterValidator(_safe)], ChannelSpec]
    participants: tuple[ParticipantSpec, ...] = Field(min_length=1, strict=False)
    recordings: tuple[RecordingSpec, ...] = Field(min_length=1, strict=False)
    perturbations: PerturbationsSpec = PerturbationsSpec()
    files: FilesSpec = FilesSpec()
    calibration: CalibrationSpec = CalibrationSpec()
    priors: PriorsSpec | None = None
    torque_model: TorqueModelSpec | None = None
    device: DeviceSpec | None = None
    planned_half_width_pct: PlannedHalfWidths | None = None
    additions: tuple[AdditionSpec, ...] = Field(default=(), strict=False)

    @model_validator(mode="after")
    def _additions_were_recorded(self) -> "StudySpec":
        key, foreign = {
            "walking": ("session", ("participant", "damping")),
            "bench": ("participant", ("session", "gravity_nm")),
        }[self.kind]
        names = [getattr(addition, key) for addition in self.additions]
        for name, addition in zip(names, self.additions, strict=True):
            if extra := [one for one in foreign if getattr(addition, one) is not None]:
                which = " and ".join(extra)
                raise ValueError(f"additions: {which}: not for kind {self.kind!r}; remove it")
            if name is None:
                raise ValueError(f"additions: {key}: missing; it is required for {self.kind!r}")
            if all(getattr(one, key) != name for one in self.recordings):
                raise ValueError(f"additions: no recording has {key} {name!r}; correct the name")
            if names.count(name) > 1:
                raise ValueError(f"additions: {key} {name!r} is given twice; state their sum")
        return self

    @model_validator(mode="after")
    def _loads_do_not_walk(self) -> "StudySpec":
        if self.kind == "walking" and self.subjects == "loads":
            raise ValueError('subjects: "loads" do not walk; expected "people", or kind "bench"')
        return self

    @model_validator(mode="after")
    def _benches_have_no_coupling(self) -> "StudySpec":
        if self.kind == "bench" and self.coupling is not None:
            raise ValueError('coupling: belongs to kind "walking", and this is "bench"; remove it')
        return self

    @property
    def of_people(self) -> bool:
        """Whether people were measured (means over loads have no meaning)."""
        return self.kind == "walking" or self.subjects == "people"

    @property
    def moments_only(self) -> bool:
        """Whether people walked without a device: torque is then the joint's moment."""
        return self.kind == "walking" and all(r.condition == "no_device" for r in self.recordings)

    def participant(self, participant_id: str) -> ParticipantSpec:
        """Return the participant with this id."""
        return next(p for p in self.participants if p.id == participant_id)

    def calibration_of(self, recording: RecordingSpec) -> CalibrationSpec:
        """Return the calibration that applies to one recording."""
        person = self.participant(recording.participant)
        of_person = self.calibration.overridden_by(person.calibration)
        return of_person.overridden_by(recording.calibration)


@dataclass(frozen=True, slots=True)
class UserExclusion:
    """A line of the user's ``exclusions.csv``."""

    participant: str
    recording: str  # file of the recording, as the study names it
    onset_s: float  # onset of the pulse, or heel strike at the start of the stride
    action: str  # ``exclude`` or ``restore``
    reason: str  # in the user's own words

    @property
    def code(self) -> str:
        """Code of what the line excludes: ``aborted`` if ``jointz run`` wrote it."""
        aborted = self.reason == Exclusion.ABORTED.meaning
        return (Exclusion.ABORTED if aborted else Exclusion.USER).value


@dataclass(frozen=True, slots=True)
class Study:
    """A study that was opened and checked."""

    root: Path  # the folder of ``study.toml``
    spec: StudySpec  # content of ``study.toml``
    sha256: str  # hash of ``study.toml``
    # channel -> (SI unit, factor, offset): ``si = factor * value + offset``
    units: Mapping[str, tuple[str, float, float]]
    group_edges: tuple[float, ...] = ()  # edges of the groups, SI; empty without groups
    # lines of ``exclusions.csv``
    user_exclusions: tuple[UserExclusion, ...] = field(default_factory=tuple)
