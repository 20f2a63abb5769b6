"""Model of ``entry.toml``, a study's entry in a collection.

The model checks the shape and the relations between keys. Values such as joints and units are
checked in :mod:`jointz.collections.checking`, with a code each. Licence and consent are shown as
they are stated; nothing judges them.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.study import Calibrated, CalibrationSpec, SchemaVersion

#: The file that makes a folder an entry.
ENTRY_FILE = "entry.toml"
#: Pattern of the id of a study.
STUDY_ID = r"[a-z0-9][a-z0-9._-]*"
#: How the torque on the joint was measured or computed.
TorquePath = Literal[
    "joint_torque_sensor", "motor_current", "series_elastic", "force_plate", "inverse_dynamics",
    "load_cell", "not_stated",
]  # fmt: skip
Sex = Literal["female", "male", "other", "not_stated"]
Side = Literal["left", "right", "both", "not_stated"]
Activity = Literal["walking", "running", "standing", "seated", "lying"]
Text = Annotated[str, Field(min_length=1)]


class Contributor(CheckedModel):
    """A person to be credited."""

    name: Text
    affiliation: str = ""
    orcid: str = ""


class Ethics(CheckedModel):
    """Approval (committee and number), and what the people agreed to, in words."""

    approval: Text
    consent: Text


class Device(CheckedModel):
    """The perturbing device, and how the torque on the joint was measured or computed."""

    name: Text
    torque: TorquePath
    torque_detail: str = ""


class Joint(CheckedModel):
    """Joint, side and positive direction."""

    name: Text
    side: Side
    positive: Text


class EntryCalibration(CalibrationSpec):
    """Calibration of the instruments, each entry with its sd; ``note`` if there is none."""

    note: str = ""

    @property
    def entries(self) -> Mapping[str, Calibrated]:
        """The calibrated quantities by name."""
        names = (name for name in type(self).model_fields if name != "note")
        return {name: entry for name in names if (entry := getattr(self, name)) is not None}


class Method(CheckedModel):
    """Method of estimation, as in the column ``method``, with its settings."""

    name: Text
    settings: dict[str, Any] = Field(default_factory=dict)


class Software(CheckedModel):
    """Software that estimated the values."""

    name: Text
    version: Text


class Person(CheckedModel):
    """A participant, without identifying data.

    ``person`` is a code of the same human in all studies; labs that share people agree on it.
    """

    id: Text
    age_band: Text
    sex: Sex
    mass_kg: Annotated[float, Field(gt=0)] | None = None
    height_m: Annotated[float, Field(gt=0)] | None = None
    side: Literal["left", "right", "both"] | None = None
    group: str = ""
    person: str = ""


class Sample(CheckedModel):
    """People of a study with printed values, described together."""

    n: Annotated[int, Field(ge=1)]
    n_female: Annotated[int, Field(ge=0)] | None = None
    age_years_mean: float | None = None
    age_years_sd: float | None = None
    mass_kg_mean: float | None = None
    mass_kg_sd: float | None = None
    height_m_mean: float | None = None
    height_m_sd: float | None = None


class Condition(CheckedModel):
    """Task of the people, and the files with its values; uphill slopes are positive."""

    name: Text
    activity: Activity
    estimates: Text
    covariance: Text | None = None
    walking_speed_m_s: float | None = None
    slope_deg: float | None = None
    surface: str = ""

    @property
    def files(self) -> tuple[str, ...]:
        """The files with the values of the condition."""
        return (self.estimates,) if self.covariance is None else (self.estimates, self.covariance)


class LeftOut(CheckedModel):
    """Excluded participants, strides or pulses: number and reason."""

    kind: Literal["participant", "stride", "pulse"]
    n: Annotated[int, Field(ge=0)]
    reason: Text


class RawData(CheckedModel):
    """Place of the recordings: in words or as an address, and as a study folder nearby."""

    where: Text
    study: str = ""
    sha256: str = ""


class Entry(CheckedModel):
    """Content of an ``entry.toml``, schema version 1."""

    jointz_entry: SchemaVersion
    study: Annotated[str, Field(pattern=f"^{STUDY_ID}$")]
    version: Text
    title: Text
    values: Literal["estimates", "printed"]
    licence: Text
    cite: Text
    protocol: Text
    contributors: tuple[Contributor, ...] = Field(min_length=1, strict=False)
    ethics: Ethics
    device: Device
    joint: Joint
    calibration: EntryCalibration
    units: dict[str, str] = Field(min_length=1)
    method: Method
    software: Software
    participants: tuple[Person, ...] = Field(default=(), strict=False)
    sample: Sample | None = None
    conditions: tuple[Condition, ...] = Field(min_length=1, strict=False)
    exclusions: tuple[LeftOut, ...] = Field(strict=False)
    raw_data: RawData
    hashes: dict[str, str]
    # of earlier versions: findings that the entry accepted; read and not used
    accepted: tuple[dict[str, Any], ...] = Field(default=(), strict=False)

    def checks(self) -> tuple[Check, ...]:
        """Return the relations between keys."""
        return (
            self._people_are_described,
            self._calibration_is_stated,
            self._conditions_differ,
            self._gait_is_described,
        )

    def _people_are_described(self) -> Iterator[Problem]:
        if self.kind == "estimates" and not self.participants:
            yield Problem(
                ("participants",), "missing; estimates need the people that they belong to."
            )
        if self.kind == "printed" and not self.participants and self.sample is None:
            yield Problem(
                ("sample",), "missing; printed values need the people that they belong to."
            )

    def _calibration_is_stated(self) -> Iterator[Problem]:
        if not self.calibration.entries and not self.calibration.note:
            yield Problem(
                ("calibration",),
                "is empty: give entries with their sd, or say in note why there are none.",
            )

    def _conditions_differ(self) -> Iterator[Problem]:
        for key, noun in (("name", "name"), ("estimates", "file")):
            values = [str(getattr(condition, key)) for condition in self.conditions]
            for i, value in enumerate(values):
                if value in values[:i]:
                    message = f"{value!r} is the {noun} of an earlier condition; give each its own."
                    yield Problem(("conditions", i, key), message)

    def _gait_is_described(self) -> Iterator[Problem]:
        needed = {
            "walking_speed_m_s": "the speed is needed, m/s.",
            "slope_deg": "the slope is needed, 0 where it is level.",
            "surface": "the surface is needed, such as treadmill or overground.",
        }
        for i, condition in enumerate(self.conditions if self.kind == "estimates" else ()):
            in_gait = condition.activity in ("walking", "running")
            for key in needed if in_gait else ():
                if getattr(condition, key) in (None, ""):
                    yield Problem(("conditions", i, key), f"missing; {needed[key]}")

    @property
    def kind(self) -> Literal["estimates", "printed"]:
        """``values`` under a name that pandas does not use."""
        return self.values

    @property
    def files(self) -> tuple[str, ...]:
        """The files of values that the entry names, each once."""
        return tuple(dict.fromkeys(f for c in self.conditions for f in c.files))
