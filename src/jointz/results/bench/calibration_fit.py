"""Result of a calibration step: entries of ``[calibration]`` with sd, and further values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import sqrt
from typing import Any, ClassVar

import pandas as pd

from jointz.core.study import Calibrated, CalibrationSpec
from jointz.results.base import Axes, PlottedResult, Result, summary_text
from jointz.results.bench.calibration_failure import CalibrationFailure

#: The steps, in the order in which a lab takes them.
STEPS = ("zero", "footswitch", "hinge", "frame", "leg", "torsion", "spring")

#: What a step may find -> SI unit. Gains and ``friction_gain`` have no unit.
ENTRY_UNITS: Mapping[str, str] = {
    "angle_zero_rad": "rad",
    "contact_threshold_v": "V",
    "contact_release_v": "V",
    "angle_lag_s": "s",
    "angle_gain": "1",
    "intrinsic_stiffness": "N*m/rad",
    "intrinsic_damping": "N*m*s/rad",
    "intrinsic_inertia": "kg*m^2",
    "torque_gain": "1",
    "friction_gain": "1",
    "tissue_hz": "Hz",
    "angle_per_torque": "rad/(N*m)",
    "contact_level_v": "V",
    "open_level_v": "V",
    "angle_delay_s": "s",
    "inertia": "kg*m^2",
    "inertia_weighted": "kg*m^2",
    "stiffness": "N*m/rad",
    "stiffness_weighted": "N*m/rad",
    "damping": "N*m*s/rad",
    "damping_weighted": "N*m*s/rad",
    "tissue_damping": "1",
    "strap_compliance": "rad/(N*m)",
    "strap_damping_time_s": "s",
    "motion_per_torque": "rad/(N*m)",
    "torque_constant": "N*m/A",
    "coulomb_friction": "N*m",
    "gear_friction": "N*m/A",
}


@dataclass(frozen=True, slots=True)
class CalibrationEntry(Result):
    """One calibrated value."""

    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("unit",)

    name: str  # a key of :data:`ENTRY_UNITS`
    value: float | None  # SI; None where there is none
    sd: float | None  # SI; None where there is none
    status: str = "ok"  # ``ok``, ``undecided`` or ``failed:CODE`` (:class:`CalibrationFailure`)
    reason: str = ""  # reason for another status than ``ok``
    # source of error -> sd in the unit of the value; the squares add up to that of ``sd``
    uncertainty: Mapping[str, float] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """SI unit of value and sd."""
        return ENTRY_UNITS[self.name]

    @property
    def available(self) -> bool:
        """Whether there is a value to use."""
        return self.status == "ok"


def decided(
    name: str,
    value: float,
    uncertainty: Mapping[str, float],
    *,
    largest_sd: float | None = None,
) -> CalibrationEntry:
    """Return an entry, undecided where its sd is larger than what is of use."""
    parts = {source: float(sd) for source, sd in uncertainty.items() if sd > 0.0}
    sd = sqrt(sum(part**2 for part in parts.values()))
    status, reason = "ok", ""
    if largest_sd is not None and sd > largest_sd:
        unit = ENTRY_UNITS[name]
        unit = "" if unit == "1" else f" {unit}"
        status = "undecided"
        reason = f"its sd is {sd:.3g}{unit}, more than {largest_sd:.3g}{unit}"
    return CalibrationEntry(name, float(value), sd, status, reason, parts)


def failed(
    names: Sequence[str], code: CalibrationFailure, detail: str
) -> tuple[CalibrationEntry, ...]:
    """Return entries without value."""
    reason = f"{detail}; {code.meaning}"
    return tuple(CalibrationEntry(name, None, None, code.status, reason) for name in names)


@dataclass(frozen=True, slots=True)
class CalibrationSeries:
    """Data of the figure of a step."""

    x: tuple[float, ...] = ()  # in the unit of ``x_label``
    measured: tuple[float, ...] = ()  # in the unit of ``y_label``
    modelled: tuple[float, ...] = ()  # in the unit of ``y_label``
    x_label: str = ""  # label of the x axis, with its unit
    y_label: str = ""  # label of the y axis, with its unit


@dataclass(frozen=True, slots=True, repr=False)
class CalibrationFit(PlottedResult):
    """The result of one calibration step of one participant."""

    SCHEMA: ClassVar[str] = "jointz.CalibrationFit/1"
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("status",)

    step: str  # one of :data:`STEPS`
    entries: tuple[CalibrationEntry, ...]  # values for ``[calibration]``, failed ones included
    reported: tuple[CalibrationEntry, ...] = ()  # further values, which no analysis uses
    method: str = ""  # way of making values and sds
    n_samples: int = 0  # number of samples used
    notes: tuple[str, ...] = ()  # remarks for the reader
    settings: Mapping[str, Any] = field(default_factory=dict)  # chosen settings and prior knowledge
    series: CalibrationSeries = field(default_factory=CalibrationSeries)  # data of the figure

    @property
    def status(self) -> str:
        """``ok`` where all entries stand, else the first status that is not."""
        return next((e.status for e in self.entries if not e.available), "ok")

    def entry(self, name: str) -> CalibrationEntry:
        """Return an entry, or a reported value, by name."""
        both = {entry.name: entry for entry in (*self.reported, *self.entries)}
        if name not in both:
            raise KeyError(f"step {self.step!r} has no {name!r}; it has {', '.join(both)}")
        return both[name]

    def specification(self) -> CalibrationSpec:
        """Return the entries that stand, as a study has them."""
        standing = {
            e.name: Calibrated(value=e.value, sd=e.sd)
            for e in self.entries
            if e.available and e.value is not None and e.sd is not None
        }
        return CalibrationSpec(**standing)

    def to_frame(self) -> pd.DataFrame:
        """Return one row an entry: those of ``[calibration]`` first, then what was reported."""
        columns = ("value", "sd", "unit", "status", "reason")
        rows = [
            {"step": self.step, "entry": e.name, "used": used}
            | {name: getattr(e, name) for name in columns}
            for used, group in ((True, self.entries), (False, self.reported))
            for e in group
        ]
        return pd.DataFrame(rows)

    def summary(self) -> str:
        """Return a short text: entries, what was found beside, method, notes."""
        lines = [*map(_line, self.entries)]
        if self.reported:
            lines += ["beside:", *(f"  {_line(e)}" for e in self.reported)]
        if self.method:
            lines.append(f"{self.n_samples} samples; {self.method}")
        return summary_text(f"Calibration, step {self.step}: {self.status}", lines, self.notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw what was measured and what the model makes of it."""
        shown = self.series
        axes.plot(shown.x, shown.measured, ".", markersize=2.0, label="measured")
        if shown.modelled:
            axes.plot(shown.x, shown.modelled, linewidth=1.2, label="model")
        axes.set(xlabel=shown.x_label or "time (s)", ylabel=shown.y_label or "nothing to show")
        axes.set_title("\n".join([f"Calibration: {self.step}", *map(_line, self.entries)]))
        axes.title.set_fontsize("medium")
        axes.legend()


def _line(entry: CalibrationEntry) -> str:
    if entry.value is None or entry.sd is None:
        return f"{entry.name} {entry.status}: {entry.reason}"
    unit = "" if entry.unit == "1" else f" {entry.unit}"
    text = f"{entry.name} {entry.value:.4g} +- {entry.sd:.2g}{unit} (sd)"
    return text if entry.available else f"{text}, {entry.status}: {entry.reason}"
