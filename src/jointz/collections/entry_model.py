"""A study's entry in a collection: the model behind ``entry.toml``.

Shape and what holds between keys are checked here. What a value may be (which joints, licences,
speeds, units there are) is checked in :mod:`jointz.collections.checking`, with a code each.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from jointz.core.checked_model import Check, CheckedModel, Problem
from jointz.core.study import Calibrated, CalibrationSpec, SchemaVersion

#: The file that makes a folder an entry.
ENTRY_FILE = "entry.toml"
#: What the id of a study looks like.
STUDY_ID = r"[a-z0-9][a-z0-9._-]*"
#: How the torque on the joint was found.
TorquePath = Literal[
    "joint_torque_sensor", "motor_current", "series_elastic", "force_plate", "inverse_dynamics",
    "load_cell", "not_stated",
]  # fmt: skip
Sex = Literal["female", "male", "other", "not_stated"]
Side = Literal["left", "right", "both", "not_stated"]
Activity = Literal["walking", "running", "standing", "seated", "lying"]
#: ``study_only``: consent that does not reach beyond the study. ``published``: printed values.
ConsentScope = Literal["public", "research", "study_only", "published"]


Text = Annotated[str, Field(min_length=1)]


class Contributor(CheckedModel):
    """Somebody who is to be named."""

    name: Text
    affiliation: str = ""
    orcid: str = ""


class Ethics(CheckedModel):
    """What the people agreed to: committee with number, and how far their consent reaches."""

    approval: Text
    consent: ConsentScope


class Device(CheckedModel):
    """What perturbed the joint, and how the torque on the joint was measured or computed."""

    name: Text
    torque: TorquePath
    torque_detail: str = ""


class Joint(CheckedModel):
    """Which joint, on which side, and which direction is positive."""

    name: Text
    side: Side
    positive: Text


class EntryCalibration(CalibrationSpec):
    """What is known about the instruments, each with its sd; ``note`` where nothing is."""

    note: str = ""

    @property
    def entries(self) -> Mapping[str, Calibrated]:
        """What is calibrated, by name."""
        names = (name for name in type(self).model_fields if name != "note")
        return {name: entry for name in names if (entry := getattr(self, name)) is not None}


class Method(CheckedModel):
    """How the values were estimated: as in the column ``method``, with its settings."""

    name: Text
    settings: dict[str, Any] = Field(default_factory=dict)


class Software(CheckedModel):
    """What estimated the values."""

    name: Text
    version: Text


class Person(CheckedModel):
    """A participant, without what identifies people.

    ``person`` is a code that stays the same wherever the same human takes part, in any study;
    labs that share people agree on it.
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
    """People of a study whose values are printed, described together."""

    n: Annotated[int, Field(ge=1)]
    n_female: Annotated[int, Field(ge=0)] | None = None
    age_years_mean: float | None = None
    age_years_sd: float | None = None
    mass_kg_mean: float | None = None
    mass_kg_sd: float | None = None
    height_m_mean: float | None = None
    height_m_sd: float | None = None


class Condition(CheckedModel):
    """What the people did, and the files with the values found then; uphill slopes are positive."""

    name: Text
    activity: Activity
    estimates: Text
    covariance: Text | None = None
    walking_speed_m_s: float | None = None
    slope_deg: float | None = None
    surface: str = ""

    @property
    def files(self) -> tuple[str, ...]:
        """The files that it names."""
        return (self.estimates,) if self.covariance is None else (self.estimates, self.covariance)


class LeftOut(CheckedModel):
    """What was left out: participants, strides or pulses, how many, and why."""

    kind: Literal["participant", "stride", "pulse"]
    n: Annotated[int, Field(ge=0)]
    reason: Text


class RawData(CheckedModel):
    """Where the recordings are: in words or by address, and as a study folder where it is near."""

    where: Text
    study: str = ""
    sha256: str = ""


class Place(CheckedModel):
    """Where in an entry: a condition by its name, a parameter, or both; empty is anywhere."""

    condition: str = ""
    parameter: str = ""


class Accepted(CheckedModel):
    """A finding of ``collect check`` on plausibility that was looked into, and why it stands.

    It is accepted in the whole entry where ``where`` says nothing.
    """

    code: Text
    reason: Text
    where: Place = Place()


class Entry(CheckedModel):
    """The whole of an ``entry.toml``, schema version 1."""

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
    accepted: tuple[Accepted, ...] = Field(default=(), strict=False)

    def checks(self) -> tuple[Check, ...]:
        """Return what holds between the keys."""
        return (
            self._people_are_described,
            self._calibration_is_told,
            self._conditions_differ,
            self._gait_is_described,
            self._accepted_conditions_are_there,
        )

    def _people_are_described(self) -> Iterator[Problem]:
        if self.kind == "estimates" and not self.participants:
            yield Problem(("participants",), "missing; estimates need the people they are of.")
        if self.kind == "printed" and not self.participants and self.sample is None:
            yield Problem(("sample",), "missing; printed values need the people they are of.")

    def _calibration_is_told(self) -> Iterator[Problem]:
        if not self.calibration.entries and not self.calibration.note:
            yield Problem(
                ("calibration",),
                "holds nothing: give entries with their sd, or say in note why there are none.",
            )

    def _conditions_differ(self) -> Iterator[Problem]:
        for part, told in (("name", "name"), ("estimates", "file")):
            seen: set[str] = set()
            for i, condition in enumerate(self.conditions):
                value = str(getattr(condition, part))
                if value in seen:
                    yield Problem(
                        ("conditions", i, part),
                        f"{value!r} is the {told} of an earlier condition too; give each its own.",
                    )
                seen.add(value)

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

    def _accepted_conditions_are_there(self) -> Iterator[Problem]:
        names = [condition.name for condition in self.conditions]
        for i, accepted in enumerate(self.accepted):
            if accepted.where.condition not in ("", *names):
                told = f"expected one of {', '.join(names)}; got {accepted.where.condition!r}."
                yield Problem(("accepted", i, "where", "condition"), told)

    @property
    def kind(self) -> Literal["estimates", "printed"]:
        """What ``values`` says; under a name that is not pandas' own."""
        return self.values

    @property
    def files(self) -> tuple[str, ...]:
        """The files of values that the entry names, each once."""
        return tuple(dict.fromkeys(f for c in self.conditions for f in c.files))
