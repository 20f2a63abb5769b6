"""Check of an actuator against a profile, with intervals and a figure."""

from dataclasses import dataclass, field
from math import pi
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from jointz.control.impedance_profile import ImpedanceProfile
from jointz.control.rendering.actuators import Actuator
from jointz.control.rendering.varying import (
    LargestMultiplier,
    drawn_multipliers,
    is_surely_stable,
    largest_multiplier,
)
from jointz.core.errors import DataError
from jointz.reference.body_segments import leg_beyond
from jointz.results.base import Array, Axes, PlottedResult, record_frame, summary_text
from jointz.results.estimates import REACH_95
from jointz.results.figure_style import BLUE, GREEN, INK, MUTED, SKY

#: Draws that intervals of derived figures rest on, and their seed.
_DRAWS, _SEED = 200, 46
#: Halvings of an interval of frequencies: to 1e-12 of it.
_HALVINGS = 40
#: Frequencies at which passivity is tested, logarithmic and even.
_FREQUENCIES = 1000
#: Laws whose passivity is tested at once.
_AT_ONCE = 100
#: Share of the power of the mean stride's angle that a rendered impedance must follow.
_POWER = 0.99
#: Body height of a profile, which has none, m.
_HEIGHT_M = 1.74


def _drawn_curves(profile: ImpedanceProfile) -> tuple[np.ndarray, np.ndarray]:
    """Return draws of stiffness and damping, (200, n) each.

    Errors are alike at all phases: a curve lies high or low as a whole. Both are log-normal and
    independent of each other.
    """
    z = np.random.default_rng(_SEED).standard_normal((2, _DRAWS, 1))
    spread_k = np.log(profile.stiffness_high / profile.stiffness_low) / (2.0 * REACH_95)
    spread_b = np.log(profile.damping_high / profile.damping_low) / (2.0 * REACH_95)
    return profile.stiffness * np.exp(z[0] * spread_k), profile.damping * np.exp(z[1] * spread_b)


def default_load_inertia(profile: ImpedanceProfile) -> float:
    """Return the inertia of shank and foot about the knee for a profile's mass, kg*m^2."""
    if profile.joint != "knee":
        raise DataError(
            f"load inertia: no default for the {profile.joint}, only for the knee. Give the "
            "inertia that the actuator moves (--load-inertia, kg*m^2)."
        )
    return leg_beyond("knee", profile.mass_kg, _HEIGHT_M).inertia


def stable_stiffness(actuator: Actuator, damping: ArrayLike, load_inertia: float) -> np.ndarray:
    """Return the stiffness below which the loop with an inertia is stable, 0 where none is.

    Every stiffness from 0 to this limit is stable. On the limit the loop oscillates: the equation
    (J + inertia) s^2 + viscous s + (K + B s) exp(-s D) / (1 + s T) = 0 has a root s = jw.
    Along that curve B grows with w wherever B >= 0, so that bisection finds w. J is the actuator's
    own inertia; ``damping`` B >= 0.
    """
    dampings = np.asarray(damping, dtype=float)
    low = np.zeros_like(dampings)
    high = np.full_like(dampings, _last_frequency(actuator, load_inertia))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = stability_border(actuator, middle, load_inertia)[1] < dampings
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    # Above the largest damping of the border the bisection ends at its end, where K is 0.
    limit = stability_border(actuator, 0.5 * (low + high), load_inertia)[0]
    return np.where(limit > 0.0, limit, 0.0)


def stability_border(
    actuator: Actuator, rad_s: ArrayLike, load_inertia: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping at which the loop oscillates at angular frequencies > 0."""
    w = np.asarray(rad_s, dtype=float)
    inertia = load_inertia + actuator.inertia
    with np.errstate(divide="ignore", invalid="ignore"):
        point = (inertia * w**2 - 1j * w * actuator.viscous) / actuator.response(w)
        return point.real, np.where(w > 0.0, point.imag / w, -actuator.viscous)


def border_curve(actuator: Actuator, load_inertia: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping, (400,) each, along the border with B >= 0 for a figure."""
    w = np.linspace(0.0, _last_frequency(actuator, load_inertia), 401)[1:]
    return stability_border(actuator, w, load_inertia)


def _last_frequency(actuator: Actuator, load_inertia: float) -> float:
    """Return the frequency at which the border comes back to zero stiffness, rad/s."""
    inertia = load_inertia + actuator.inertia
    lag, delay = actuator.time_constant_s, actuator.loop_delay_s
    low, high = 0.0, pi / delay
    for _ in range(_HALVINGS):
        w = 0.5 * (low + high)
        turn = np.arctan(w * lag) + w * delay - np.arctan2(actuator.viscous, inertia * w)
        low, high = (w, high) if turn < 0.5 * pi else (low, w)
    return 0.5 * (low + high)


def passivity_shortage(actuator: Actuator, stiffness: ArrayLike, damping: ArrayLike) -> np.ndarray:
    """Return the viscous friction that the actuator lacks to be passive, N*m*s/rad; <= 0 if it is.

    The port is passive with any passive environment if viscous + Re[(B + K / jw) H(jw)] >= 0 at
    all frequencies up to half the control rate.
    """
    laws = np.column_stack([np.atleast_1d(damping), np.atleast_1d(stiffness)])
    planes = np.stack(_passivity_planes(actuator))
    # In parts: all laws by all frequencies would be gigabytes.
    parts = [laws[k : k + _AT_ONCE] for k in range(0, len(laws), _AT_ONCE)]
    least = np.concatenate([(part @ planes).min(axis=1) for part in parts])
    return np.asarray(-actuator.viscous - least)


def passive_stiffness(actuator: Actuator, damping: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and largest stiffness that are passive at dampings; NaN where none is."""
    real, slope = _passivity_planes(actuator)
    with np.errstate(divide="ignore"):
        limits = -(actuator.viscous + np.atleast_1d(damping)[:, None] * real) / slope
    high = np.where(slope < 0.0, limits, np.inf).min(axis=1)
    low = np.where(slope > 0.0, limits, 0.0).max(axis=1)
    none = high < low
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def _passivity_planes(actuator: Actuator) -> tuple[np.ndarray, np.ndarray]:
    """Return, at all frequencies, the factors of B and K in the real part of the impedance."""
    last = pi * actuator.control_hz
    w = np.union1d(
        np.geomspace(1e-5 * last, last, _FREQUENCIES), np.linspace(0.0, last, _FREQUENCIES)[1:]
    )
    response = actuator.response(w)
    return response.real, response.imag / w


def stride_bandwidth_hz(profile: ImpedanceProfile) -> float:
    """Return the frequency below which the mean stride's angle has 99 % of its power, Hz."""
    power = np.abs(np.fft.rfft(profile.angle))[1:] ** 2
    share = np.cumsum(power) / power.sum()
    return float((np.argmax(share >= _POWER) + 1) / profile.stride_s)


def rendering_error(actuator: Actuator, hz: float) -> float:
    """Return the relative error of a rendered impedance at a frequency."""
    return float(np.abs(actuator.response(2.0 * pi * hz) - 1.0))


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
        return record_frame(self.findings, Finding.__dataclass_fields__)

    def summary(self) -> str:
        """Return a short text: actuator, conditions and verdict."""
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
    r"""Return what an actuator can render of a profile.

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

    Notes
    -----
    The law is torque = :math:`-Kx - B\dot x`. The load has inertia :math:`J_l`; the actuator has
    inertia :math:`J_a`, viscous friction :math:`b`, lag :math:`T` and delay :math:`D`, which
    includes half a control period.

    *Stable.* On the border the loop oscillates with :math:`s = j\omega`:

    .. math:: (J_l + J_a) s^2 + b s + (K + B s) H(s) = 0, \quad H(s) = \frac{e^{-sD}}{1 + sT}.

    With a damping B, every stiffness below this border is stable.

    *Passive.* A port with :math:`\operatorname{Re} Z(j\omega) \ge 0` is stable with every passive
    environment (Colgate and Schenkel 1997). Up to half the control rate

    .. math:: b + \operatorname{Re}\Bigl[\Bigl(B + \frac{K}{j\omega}\Bigr)H(j\omega)\Bigr] \ge 0.

    *Varying.* No profile with changing stiffness is passive with every environment: someone who
    holds the joint away from its equilibrium while K rises and waits at the equilibrium while K
    falls gains energy in every cycle, at any damping. Hence the check names the loads. A profile is
    unsafe if free deviations, :math:`J\ddot x + B(t)\dot x + (K(t) + K_e)x = 0`, grow from stride
    to stride (largest Floquet multiplier above 1) with an inertia between 0.5 and 2 times the
    load's, a spring :math:`K_e \ge 0` to ground (up to 10 times the mean K) and a stride time
    within 20 % of the mean. ``stable`` treats each phase as constant, ``varying`` treats the torque
    as immediate.
    """
    inertia = default_load_inertia(profile) if load_inertia is None else load_inertia
    if not (0.0 < inertia < np.inf and 0.0 < share <= 1.0):
        raise DataError(
            f"expected a load inertia > 0 kg*m^2 and a share above 0 and up to 1, got {inertia:g} "
            f"and {share:g}."
        )
    drawn_stiffness, drawn_damping = (share * one for one in _drawn_curves(profile))
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
