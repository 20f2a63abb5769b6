"""Check of an actuator against a profile, with intervals and a figure."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jointz.control.draws import drawn_curves
from jointz.control.impedance_profile import ImpedanceProfile
from jointz.control.rendering.actuators import Actuator
from jointz.control.rendering.region import (
    border_curve,
    default_load_inertia,
    passive_stiffness,
    passivity_shortage,
    rendering_error,
    stable_stiffness,
    stride_bandwidth_hz,
)
from jointz.control.rendering.varying import (
    LargestMultiplier,
    drawn_multipliers,
    is_surely_stable,
    largest_multiplier,
)
from jointz.core.errors import DataError
from jointz.results.base import Array, Axes, PlottedResult, summary_text
from jointz.results.figure_style import BLUE, GREEN, INK, MUTED, SKY

#: Deviation from the mean stride for which torque must be left, rad.
DEVIATION_RAD = 0.1
#: A rendered impedance that is further off at the stride's frequencies is called unfaithful, %.
FAITHFUL_PCT = 20.0
#: Conditions without which a profile cannot be rendered.
_DECISIVE = ("stable", "torque", "varying")
_INTERVAL = 2.5, 97.5


@dataclass(frozen=True, slots=True)
class Finding:
    """One condition: a figure, the interval of its draws, and its limit."""

    condition: str
    holds: bool
    value: float
    low: float | None
    high: float | None
    limit: float | None
    unit: str
    share_of_draws: float | None  # share of the draws that meet the condition
    note: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RenderingCheck(PlottedResult):
    """Conditions under which an actuator renders a profile, each with its value.

    Parameters
    ----------
    subject : str
        Whose profile it is.
    actuator : Actuator
        The actuator.
    load_inertia : float, kg*m^2
        Inertia that it moves, its own apart.
    share : float
        Share of the profile that it gives.
    findings : tuple of Finding
        ``stable``, ``passive``, ``torque``, ``faithful``, ``varying``.
    largest : LargestMultiplier
        The load with which free deviations grow most from stride to stride.
    surely_stable : bool
        Whether the condition of Kronander and Billard (2016) holds, too.
    gait_pct, stiffness, damping : (n,) ndarray
        What was checked: the profile's share.
    drawn_stiffness, drawn_damping : (200, n) ndarray
        Its draws; files do not hold them.
    """

    SCHEMA: ClassVar[str] = "jointz.RenderingCheck/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 4.0)
    JSON_PROPERTIES: ClassVar[tuple[str, ...]] = ("can_render",)

    subject: str
    actuator: Actuator
    load_inertia: float
    share: float
    findings: tuple[Finding, ...]
    largest: LargestMultiplier
    surely_stable: bool
    gait_pct: Array
    stiffness: Array
    damping: Array
    drawn_stiffness: Array = field(default_factory=lambda: np.empty((0, 0)))
    drawn_damping: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def can_render(self) -> bool:
        """True if it is stable, has the torque, and no passive load makes deviations grow."""
        return all(self[name].holds for name in _DECISIVE)

    def __getitem__(self, condition: str) -> Finding:
        """Return the finding of a condition."""
        return next(one for one in self.findings if one.condition == condition)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, without the draws."""
        data = PlottedResult.to_dict(self)
        return {key: value for key, value in data.items() if not key.startswith("drawn_")}

    def to_frame(self) -> pd.DataFrame:
        """Return one row a condition."""
        names = Finding.__dataclass_fields__
        return pd.DataFrame([{name: getattr(one, name) for name in names} for one in self.findings])

    def summary(self) -> str:
        """Return a short text: actuator, conditions, and what it comes to."""
        lines = [
            f"{self.actuator.name}: {self.actuator.source}",
            f"load {self.load_inertia:.3g} kg*m^2; {self.share:.0%} of the profile",
        ]
        lines += [f"{one.condition}: {one.note}" for one in self.findings]
        missing = [name for name in _DECISIVE if not self[name].holds]
        verdict = f"cannot be rendered ({', '.join(missing)})" if missing else "can be rendered"
        return summary_text(f"Profile of {self.subject}: {verdict}", lines, ())

    def _draw(self, axes: "Axes") -> None:
        """Draw borders, the profile's way over the cycle and its draws in the plane (K, B)."""
        ends = _end(self.stiffness, self.drawn_stiffness), _end(self.damping, self.drawn_damping)
        _draw_borders(axes, self, ends[1])
        axes.plot(
            self.drawn_stiffness.ravel(), self.drawn_damping.ravel(), ".", color=MUTED, alpha=0.4,
            markersize=1.5, markeredgewidth=0.0, label="draws of the profile", rasterized=True,
        )  # fmt: skip
        closed = (np.append(one, one[0]) for one in (self.stiffness, self.damping))
        axes.plot(*closed, color=INK, label="profile")
        for place in range(0, self.gait_pct.size, max(1, self.gait_pct.size // 5)):
            point = self.stiffness[place], self.damping[place]
            axes.plot(*point, "o", color=INK, markersize=3.0)
            axes.annotate(f"{self.gait_pct[place]:.0f} %", point, (3, 3),
                          textcoords="offset points", fontsize=7.0)  # fmt: skip
        axes.set(xlim=(0.0, ends[0]), ylim=(0.0, ends[1]), xlabel="stiffness (N*m/rad)")
        axes.set_ylabel("damping (N*m*s/rad)")
        axes.legend(loc="upper right", markerscale=4.0)


def _end(values: np.ndarray, drawn: np.ndarray) -> float:
    """Return the end of an axis: nearly all draws are inside."""
    return 1.1 * float(np.percentile(drawn, 99.5) if drawn.size else values.max())


def _draw_borders(axes: "Axes", check: RenderingCheck, largest_damping: float) -> None:
    stiffness, damping = border_curve(check.actuator, check.load_inertia)
    axes.fill_betweenx(damping, 0.0, stiffness, color=SKY, alpha=0.3, linewidth=0.0)
    axes.plot(stiffness, damping, color=BLUE, label="border of stability with the load")
    at = np.linspace(0.0, largest_damping, 400)
    low, high = passive_stiffness(check.actuator, at)
    if np.nanmax(high, initial=0.0) > 0.0:
        axes.fill_betweenx(at, low, high, color=GREEN, alpha=0.3, linewidth=0.0)
        axes.plot(high, at, color=GREEN, linestyle="--", label="border of passivity")


def check_rendering(
    profile: ImpedanceProfile,
    actuator: Actuator,
    *,
    load_inertia: float | None = None,
    share: float = 1.0,
) -> RenderingCheck:
    """Return what an actuator can render of a profile.

    Parameters
    ----------
    profile : ImpedanceProfile
        The profile.
    actuator : Actuator
        The actuator, such as ``read_actuator("qdd")``.
    load_inertia : float, optional, kg*m^2
        Inertia that the actuator moves; by default that of shank and foot for the profile's mass.
    share : float
        Share of the profile that the actuator gives.

    Returns
    -------
    RenderingCheck
        One finding a condition, with intervals over 200 draws of stiffness and damping. The
        torque along the mean stride is the profile's moment in all of them: errors of the
        equilibrium and of the stiffness cancel there.

    Raises
    ------
    DataError
        If inertia or share are not positive, or the joint has no default inertia.
    """
    inertia = default_load_inertia(profile) if load_inertia is None else load_inertia
    if not (0.0 < inertia < np.inf and 0.0 < share <= 1.0):
        raise DataError(
            f"expected a load inertia > 0 kg*m^2 and a share above 0 and up to 1, got {inertia:g} "
            f"and {share:g}."
        )
    drawn_stiffness, drawn_damping = (share * one for one in drawn_curves(profile))
    # The profile itself is the first row.
    stiffness = np.vstack([share * profile.stiffness, drawn_stiffness])
    damping = np.vstack([share * profile.damping, drawn_damping])
    largest = largest_multiplier(stiffness[0], damping[0], profile.stride_s, inertia)
    sure = is_surely_stable(stiffness[0], damping[0], profile.stride_s, inertia)
    multipliers = drawn_multipliers(stiffness[1:], damping[1:], profile.stride_s, inertia)
    findings = (
        _stable(profile, actuator, stiffness, damping, inertia),
        _passive(actuator, stiffness, damping),
        _torque(profile, actuator, stiffness, share),
        _faithful(profile, actuator, stiffness[0]),
        _varying(largest, multipliers, sure=sure),
    )
    return RenderingCheck(
        profile.subject, actuator, inertia, share, findings, largest, sure, profile.gait_pct,
        stiffness[0], damping[0], drawn_stiffness, drawn_damping,
    )  # fmt: skip


def _finding(
    condition: str, values: np.ndarray, limit: float, unit: str, note: str, *, above: bool = False
) -> Finding:
    """Return a finding of a profile (first value) and its draws, which hold up to a limit."""
    holds = values >= limit if above else values <= limit
    low, high = map(float, np.percentile(values[1:], _INTERVAL))
    share = float(holds[1:].mean())
    return Finding(condition, bool(holds[0]), float(values[0]), low, high, limit, unit, share, note)


def _stable(
    profile: ImpedanceProfile,
    actuator: Actuator,
    stiffness: np.ndarray,
    damping: np.ndarray,
    inertia: float,
) -> Finding:
    margins = stable_stiffness(actuator, damping, inertia) / stiffness
    values, worst = margins.min(axis=1), int(np.argmin(margins[0]))
    stable = float((margins[0] > 1.0).mean())
    note = (
        f"stable at {stable:.0%} of the phases; the largest stable stiffness is {values[0]:.3g} "
        f"times the profile's at {profile.gait_pct[worst]:.0f} % of the cycle"
    )
    return _finding("stable", values, 1.0, "", note, above=True)


def _passive(actuator: Actuator, stiffness: np.ndarray, damping: np.ndarray) -> Finding:
    shortage = passivity_shortage(actuator, stiffness.ravel(), damping.ravel())
    needed = shortage.reshape(stiffness.shape).max(axis=1) + actuator.viscous
    note = (
        f"every passive environment is safe with {needed[0]:.3g} N*m*s/rad of viscous friction; "
        f"the actuator has {actuator.viscous:.3g}"
    )
    return _finding("passive", needed, actuator.viscous, "N*m*s/rad", note)


def _torque(
    profile: ImpedanceProfile, actuator: Actuator, stiffness: np.ndarray, share: float
) -> Finding:
    along = share * profile.torque(profile.gait_pct, profile.angle, profile.velocity)
    needed = (np.abs(along) + DEVIATION_RAD * stiffness).max(axis=1)
    note = (
        f"{np.abs(along).max():.3g} N*m along the mean stride, {needed[0]:.3g} N*m with a "
        f"deviation of {DEVIATION_RAD:g} rad; the actuator has {actuator.torque_nm:.3g}"
    )
    return _finding("torque", needed, actuator.torque_nm, "N*m", note)


def _faithful(profile: ImpedanceProfile, actuator: Actuator, stiffness: np.ndarray) -> Finding:
    hz = stride_bandwidth_hz(profile)
    percent = 100.0 * rendering_error(actuator, hz)
    hidden = actuator.coulomb_nm / float(stiffness.max())
    note = (
        f"stiffness and damping are {percent:.3g} % off at {hz:.3g} Hz, below which the mean "
        "stride has 99 % of its power"
    )
    if hidden:
        note += f"; Coulomb friction hides deviations below {hidden:.2g} rad even at the largest K"
    return Finding("faithful", percent <= FAITHFUL_PCT, percent, None, None, FAITHFUL_PCT, "%",
                   None, note)  # fmt: skip


def _varying(largest: LargestMultiplier, drawn: np.ndarray, *, sure: bool) -> Finding:
    condition = "holds as well" if sure else "does not hold, which proves nothing"
    note = (
        f"deviations grow at most {largest.multiplier:.3g} times a stride (with "
        f"{largest.inertia:.3g} kg*m^2, {largest.spring:.3g} N*m/rad and {largest.stride_s:.3g} "
        f"s); the condition of Kronander and Billard {condition}"
    )
    return _finding("varying", np.append(largest.multiplier, drawn), 1.0, "", note)
