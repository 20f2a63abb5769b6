"""Impedance of a joint over the gait cycle as a controller needs it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from jointz.core.errors import DataError
from jointz.results.base import Array, PlottedResult, summary_text
from jointz.results.figure_style import BLUE, FAINT, INK, MUTED, Axes, Figure

#: Phases of a profile, % of the gait cycle: 0 follows the last one.
GRID_PCT = np.arange(100.0)
LAW = "torque = stiffness * (equilibrium - angle) - damping * velocity"
#: Field of a profile -> unit.
PROFILE_UNITS: Mapping[str, str] = {
    "gait_pct": "%",
    "angle": "rad",
    "moment": "N*m",
    "stiffness": "N*m/rad",
    "damping": "N*m*s/rad",
    "equilibrium": "rad",
}
#: Arrays that are proportional to body mass; knots have those of stiffness and damping, too.
_OF_MASS = (
    "moment",
    "moment_sd",
    *(f"{name}{end}" for name in ("stiffness", "damping") for end in ("", "_low", "_high")),
)
#: Characters of a subject that the title of a figure has room for.
_LONGEST_TITLE = 30
INTERVALS = ("stiffness", "damping", "equilibrium")
#: Arrays of a profile, in the order of its table.
ARRAYS = (
    *("gait_pct", "angle", "angle_sd", "moment", "moment_sd"),
    *(f"{name}{end}" for name in INTERVALS for end in ("", "_low", "_high")),
)


@dataclass(frozen=True, slots=True)
class ProfileKnot:
    """Stiffness and damping at a timing point of which the profile is made."""

    timing_point: str
    stiffness_pct: float  # phase of the stiffness, % of the gait cycle
    damping_pct: float  # phase of the damping, % of the gait cycle
    stiffness: float  # N*m/rad
    stiffness_low: float
    stiffness_high: float
    damping: float  # N*m*s/rad
    damping_low: float
    damping_high: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImpedanceProfile(PlottedResult):
    """Stiffness, damping and equilibrium angle over the gait cycle, with intervals.

    Parameters
    ----------
    subject : str
        The participant with session and side, ``mean over people`` or ``published``.
    scales_with_mass : bool
        Whether it may be used for another body mass: stiffness, damping and moment go with it.
    joint, positive, side : str
        The joint, its positive direction, its side ("" if not stated).
    mass_kg : float, kg
        Body mass of the values.
    stride_s : float, s
        Duration of the mean stride.
    gait_pct : (n,) ndarray, %
        Phases, evenly over the cycle; values in between are interpolated linearly, and the first
        phase follows the last one.
    angle, angle_sd : (n,) ndarray, rad
        Mean stride and SD between strides.
    moment, moment_sd : (n,) ndarray, N*m
        Internal moment of the joint along that stride, and SD between strides (between people
        where it is published).
    stiffness, stiffness_low, stiffness_high : (n,) ndarray, N*m/rad
        Stiffness and its pointwise interval.
    damping, damping_low, damping_high : (n,) ndarray, N*m*s/rad
        Damping and its pointwise interval.
    equilibrium, equilibrium_low, equilibrium_high : (n,) ndarray, rad
        angle + (moment + damping * velocity) / stiffness, and its pointwise interval.
    knots : tuple of ProfileKnot
        Timing points through which stiffness and damping are interpolated.
    covariance : (2k, 2k) ndarray
        Of the errors of the logarithms at the knots: stiffness of all, then damping of all.
    displacement : {"onset", "window"}
        Whether the values hold for small displacements at the onset of a pulse, or are secants
        over the window of the pulses.
    sources : mapping
        Where impedance, angle and moment come from.
    energy_j, energy_low_j, energy_high_j : float, J
        Work of the moment over the mean stride; negative where the joint absorbs.
    damping_loss_j : float, J
        Work that the damping takes over the mean stride.
    ci_level, ci_method : float, str
        Level of the intervals, and how they were made.
    warnings : tuple of str
        Warnings for the user.
    provenance : mapping
        Versions, time, and hash of the study.
    """

    SCHEMA: ClassVar[str] = "jointz.ImpedanceProfile/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 3.2)

    subject: str
    scales_with_mass: bool
    joint: str
    positive: str
    mass_kg: float
    stride_s: float
    gait_pct: Array
    angle: Array
    angle_sd: Array
    moment: Array
    moment_sd: Array
    stiffness: Array
    stiffness_low: Array
    stiffness_high: Array
    damping: Array
    damping_low: Array
    damping_high: Array
    equilibrium: Array
    equilibrium_low: Array
    equilibrium_high: Array
    knots: tuple[ProfileKnot, ...]
    covariance: Array
    displacement: Literal["onset", "window"]
    sources: Mapping[str, str]
    energy_j: float
    energy_low_j: float
    energy_high_j: float
    damping_loss_j: float
    side: str = ""
    ci_level: float = 0.95
    ci_method: str = ""
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        problems = [
            f"{name}: expected > 0, got {value:g}"
            for name, value in (("mass_kg", self.mass_kg), ("stride_s", self.stride_s))
            if not 0.0 < value < np.inf
        ]
        shape = np.shape(self.covariance)
        if len(shape) != 2 or shape[0] != shape[1] or not np.isfinite(self.covariance).all():
            problems.append(f"covariance: expected a square of finite numbers, got shape {shape}")
        if problems:
            raise DataError(f"profile of {self.subject}: {'; '.join(problems)}.")

    @property
    def velocity(self) -> np.ndarray:
        """Velocity of the mean stride, (n,), rad/s."""
        return mean_velocity(self.angle, self.stride_s)

    def at(self, name: str, gait_pct: ArrayLike) -> np.ndarray:
        """Return an array, such as ``stiffness``, at phases (%), interpolated linearly."""
        values: np.ndarray = getattr(self, name)
        at = np.asarray(gait_pct, dtype=float)
        return np.asarray(np.interp(at, self.gait_pct, values, period=100.0))

    def torque(self, gait_pct: ArrayLike, angle: ArrayLike, velocity: ArrayLike) -> np.ndarray:
        """Return the torque on the joint, N*m, at phases (%), angles (rad) and velocities."""
        lever = self.at("equilibrium", gait_pct) - np.asarray(angle)
        torque = self.at("stiffness", gait_pct) * lever
        return np.asarray(torque - self.at("damping", gait_pct) * np.asarray(velocity))

    def for_mass(self, mass_kg: float) -> "ImpedanceProfile":
        """Return the profile for another body mass: torques at the same angles go with it.

        Raises DataError if the profile belongs to one person, or the mass is not positive.
        """
        if not self.scales_with_mass or not 0.0 < mass_kg < np.inf:
            raise DataError(f"profile of {self.subject}: no mass of {mass_kg:g} kg.")
        ratio, data = mass_kg / self.mass_kg, self.to_dict()
        for name in _OF_MASS:
            data[name] = [ratio * value for value in data[name]]
        for knot in data["knots"]:
            knot |= {name: ratio * knot[name] for name in _OF_MASS if name in knot}
        for key in ("energy_j", "energy_low_j", "energy_high_j", "damping_loss_j"):
            data[key] *= ratio
        return ImpedanceProfile.from_dict(data | {"mass_kg": mass_kg})

    def to_frame(self) -> pd.DataFrame:
        """Return one row a phase."""
        return pd.DataFrame({name: getattr(self, name) for name in ARRAYS})

    def summary(self) -> str:
        """Return a short text: whose, ranges and intervals, energy, sources."""
        kind = "small displacements" if self.displacement == "onset" else "the pulses' window"
        lines = []
        for name in INTERVALS:
            low, value, high = (getattr(self, f"{name}{end}") for end in ("_low", "", "_high"))
            width = float(np.median(0.5 * (high - low)))
            lines.append(
                f"{name:<12} {value.min():8.4g} to {value.max():8.4g} {PROFILE_UNITS[name]}, "
                f"{self.ci_level:.0%} interval +-{width:.3g} (median over the cycle)"
            )
        lines.append(
            f"work of the moment over a stride {self.energy_j:.3g} J "
            f"({self.energy_low_j:.3g} to {self.energy_high_j:.3g}); damping takes "
            f"{self.damping_loss_j:.3g} J"
        )
        lines += [f"{name}: {text}" for name, text in self.sources.items()]
        title = (
            f"Impedance profile of {self.subject}: {self.joint}, positive {self.positive}, "
            f"{self.mass_kg:.4g} kg, for {kind}"
        )
        return summary_text(title, lines, self.warnings)

    def _draw(self, axes: "Axes") -> None:
        """Draw the stiffness with its interval; :func:`draw_profile` draws all."""
        draw_band(axes, self, "stiffness")
        axes.set_xlabel("gait cycle (%)")


def draw_profile(canvas: "Figure", profile: ImpedanceProfile) -> None:
    """Draw stiffness, damping, angles and moment over the cycle, one panel each."""
    panels = canvas.subplots(4, 1, sharex=True)
    draw_band(panels[0], profile, "stiffness")
    draw_band(panels[1], profile, "damping")
    draw_band(panels[2], profile, "equilibrium", label="equilibrium")
    _draw_stride(panels[2], profile, "angle")
    _draw_stride(panels[3], profile, "moment")
    panels[2].legend()
    panels[2].set_ylabel("angle (rad)")
    panels[3].set_xlabel("gait cycle (%)")
    canvas.suptitle(
        f"{profile.subject[:_LONGEST_TITLE]}: {profile.joint}, positive {profile.positive}, "
        f"{profile.mass_kg:.1f} kg. Blue: {profile.ci_level:.0%} intervals; grey: mean stride, SD"
    )


def draw_band(axes: "Axes", profile: ImpedanceProfile, name: str, label: str = "") -> None:
    """Draw a quantity over the cycle with its interval, and its knots."""
    at = np.append(profile.gait_pct, 100.0)
    three = (getattr(profile, f"{name}{end}") for end in ("", "_low", "_high"))
    value, low, high = (np.append(one, one[0]) for one in three)
    axes.fill_between(at, low, high, color=BLUE, alpha=0.2, linewidth=0.0)
    axes.plot(at, value, color=BLUE, label=label)
    if name != "equilibrium":
        for knot in profile.knots:
            ends = [getattr(knot, f"{name}{end}") for end in ("", "_low", "_high")]
            place = getattr(knot, f"{name}_pct")
            axes.vlines(place, ends[1], ends[2], color=INK, linewidth=0.8)
            axes.plot(place, ends[0], "o", color=INK, markersize=3.0)
        axes.set_ylim(bottom=0.0)
    axes.set(xlim=(0.0, 100.0), ylabel=f"{name} ({PROFILE_UNITS[name]})")


def _draw_stride(axes: "Axes", profile: ImpedanceProfile, name: str) -> None:
    at = np.append(profile.gait_pct, 100.0)
    pair = (getattr(profile, key) for key in (name, f"{name}_sd"))
    value, sd = (np.append(one, one[0]) for one in pair)
    axes.fill_between(at, value - sd, value + sd, color=FAINT, alpha=0.5, linewidth=0.0)
    axes.plot(at, value, color=MUTED, linestyle="--", label=f"mean {name}")
    axes.set_ylabel(f"{name} ({PROFILE_UNITS[name]})")


def mean_velocity(angle: np.ndarray, stride_s: float) -> np.ndarray:
    """Return the velocity of a periodic curve by central differences, (n,), rad/s."""
    step_s = stride_s / angle.size
    return np.asarray((np.roll(angle, -1) - np.roll(angle, 1)) / (2.0 * step_s))
