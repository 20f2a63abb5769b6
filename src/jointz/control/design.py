"""Requirements of a profile on a prosthetic or orthotic joint, and joints that meet them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

import numpy as np
import pandas as pd

from jointz.control.impedance_profile import ImpedanceProfile
from jointz.control.motor import LIMITS, RATIOS, GearTable, Motor, built_in_motor, gear_table
from jointz.control.passive_joint import ClutchFit, PassiveFit, fit_clutch, fit_passive
from jointz.core.errors import DataError
from jointz.report.html_page import render_paragraphs
from jointz.results.base import Array, PlottedResult, record_frame, summary_text
from jointz.results.estimates import ONE_SIDED_95, REACH_95
from jointz.results.figure_style import BLUE, INK, MUTED, ORANGE, VERMILION, Axes, Figure

DRAWS: Final = 200
_SEED = 0
#: Quantity -> unit, in the order of the tables.
UNITS: Final[Mapping[str, str]] = {
    "torque_max": "N*m",
    "torque_min": "N*m",
    "torque_rms": "N*m",
    "power_max": "W",
    "power_min": "W",
    "positive_work": "J",
    "negative_work": "J",
    "net_work": "J",
    "regenerated": "J",
    "passive_stiffness": "N*m/rad",
    "passive_damping": "N*m*s/rad",
    "passive_rest_angle": "rad",
    "passive_error_rms": "N*m",
    "passive_error_share": "",
    "passive_missing_work": "J",
    "clutch_engaged": "%",
    "clutch_released": "%",
    "clutch_stiffness": "N*m/rad",
    "clutch_rest_angle": "rad",
    "clutch_damping_engaged": "N*m*s/rad",
    "clutch_damping_free": "N*m*s/rad",
    "clutch_error_rms": "N*m",
    "clutch_error_share": "",
    "clutch_stored": "J",
    "clutch_returned": "J",
    "clutch_loss": "J",
    "clutch_missing_work": "J",
    "gear_ratio_low": "",
    "gear_ratio_high": "",
    "gear_ratio": "",
    "motor_energy": "J",
    "motor_current_max": "A",
    "motor_current_rms": "A",
    "motor_voltage_max": "V",
}
#: Quantities whose demanding strides are those of the smallest value.
_SMALLEST = ("torque_min", "power_min", "negative_work")
_PER_STRIDE = (*list(UNITS)[:7], "regenerated", *list(UNITS)[-4:])
#: Phases are where the search ends, not estimates with an interval of their own.
_EXACT = ("clutch_engaged", "clutch_released", "gear_ratio_low", "gear_ratio_high", "gear_ratio")


@dataclass(frozen=True, slots=True)
class DesignQuantity:
    """One number of a design."""

    profile: str  # name of the profile
    quantity: str  # such as ``torque_max``
    value: float  # of the mean stride
    unit: str
    low: float | None = None  # interval of the mean stride's
    high: float | None = None
    stride_95: float | None = None  # what 95 % of the strides do not exceed


@dataclass(frozen=True, slots=True)
class ProfileDesign:
    """Requirements of one profile and what meets them."""

    name: str
    subject: str
    mass_kg: float
    stride_s: float
    gait_pct: Array  # (n,) %
    angle: Array  # (n,) rad
    velocity: Array  # (n,) rad/s
    moment: Array  # (n,) N*m
    passive_torque: Array  # (n,) N*m
    clutch_torque: Array  # (n,) N*m
    energy_by_ratio: Array  # (200,) J a stride
    load_by_ratio: Array  # (3, 200) parts of the motor's limits
    quantities: tuple[DesignQuantity, ...]
    warnings: tuple[str, ...] = ()

    def value(self, quantity: str) -> float | None:
        """Return the value of a quantity; None without a feasible gear ratio."""
        return next((q.value for q in self.quantities if q.quantity == quantity), None)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class JointDesign(PlottedResult):
    """Requirements of profiles on a joint, and passive, clutched and motorised joints for them.

    Parameters
    ----------
    profiles : tuple of ProfileDesign
        One per profile: curves, quantities with intervals, load of the motor by gear ratio.
    efficiency : float
        Part of negative power that is stored.
    ratio : float or None
        Gear ratio feasible for all profiles with the least energy, summed over their strides.
    motor : mapping
        The motor.
    level : float
        Level of the intervals.
    """

    SCHEMA: ClassVar[str] = "jointz.JointDesign/1"
    FIGURE_SIZE: ClassVar[tuple[float, float]] = (7.0, 3.2)

    profiles: tuple[ProfileDesign, ...]
    efficiency: float
    ratio: float | None
    motor: Mapping[str, Any] = field(default_factory=dict)
    level: float = 0.95

    def to_frame(self) -> pd.DataFrame:
        """Return one row a profile and quantity, with unit, interval and the 95th percentile."""
        rows = (q for p in self.profiles for q in p.quantities)
        frame = record_frame(rows, DesignQuantity.__dataclass_fields__)
        return frame.astype(dict.fromkeys(("value", "low", "high", "stride_95"), float))

    def summary(self) -> str:
        """Return a short text: requirements a row each, and what meets them."""
        lines = [_ROW.format("", *_HEADS), *(_requirements(p) for p in self.profiles)]
        for profile in self.profiles:
            lines += [f"{profile.name}:", *(f"  {text}" for text in _solutions(profile))]
        if len(self.profiles) > 1:
            ratio = "none" if self.ratio is None else f"{self.ratio:g}"
            lines.append(f"gear ratio for all profiles: {ratio}")
        lines.append(f"motor: {self.motor.get('source') or 'by its file'}")
        notes = dict.fromkeys(f"{p.name}: {text}" for p in self.profiles for text in p.warnings)
        return summary_text("Design of a joint (mean stride)", lines, notes)

    def _draw(self, axes: "Axes") -> None:
        """Draw the power of the first profile; :func:`draw_design` draws all."""
        _draw_power(axes, self.profiles[0])


@dataclass(frozen=True, slots=True)
class _Stride:
    """Motion of the mean stride, and the requirements of a torque along it."""

    angle: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    step_s: float
    efficiency: float
    motor: Motor

    def requirements(self, moment: np.ndarray) -> dict[str, float]:
        power = moment * self.velocity
        positive, negative = (self.step_s * part.sum() for part in _parts(power))
        values = (
            *(moment.max(), moment.min(), _rms(moment), power.max(), power.min()),
            *(positive, negative, positive + negative, -self.efficiency * negative),
        )
        return dict(zip(UNITS, map(float, values), strict=False))

    def passive(self, moment: np.ndarray) -> tuple[PassiveFit, dict[str, float]]:
        fit = fit_passive(self.angle, self.velocity, moment)
        return fit, {
            "passive_stiffness": fit.stiffness,
            "passive_damping": fit.damping,
            "passive_rest_angle": fit.rest_angle,
            **self._errors("passive", moment, fit.torque, fit.spring),
        }

    def clutch(self, moment: np.ndarray) -> tuple[ClutchFit, dict[str, float]]:
        fit = fit_clutch(self.angle, self.velocity, moment)
        phase = 100.0 / self.angle.size
        return fit, {
            "clutch_engaged": phase * fit.engaged,
            "clutch_released": phase * fit.released,
            "clutch_stiffness": fit.stiffness,
            "clutch_rest_angle": fit.rest_angle,
            "clutch_damping_engaged": fit.damping_engaged,
            "clutch_damping_free": fit.damping_free,
            **self._errors("clutch", moment, fit.torque, fit.spring),
            "clutch_stored": fit.stored_j,
            "clutch_returned": fit.returned_j,
            "clutch_loss": fit.loss_j,
        }

    def gears(self, moment: np.ndarray, ratios: np.ndarray = RATIOS) -> GearTable:
        motion = moment, self.velocity, self.acceleration
        return gear_table(
            self.motor, ratios, motion, step_s=self.step_s, efficiency=self.efficiency
        )

    def motorised(self, moment: np.ndarray, ratio: float) -> dict[str, float]:
        table = self.gears(moment, np.array([ratio]))
        return {
            "motor_energy": float(table.energy[0]),
            "motor_current_max": float(table.peak_current[0]),
            "motor_current_rms": float(table.rms_current[0]),
            "motor_voltage_max": float(table.peak_voltage[0]),
        }

    def _errors(
        self, kind: str, moment: np.ndarray, torque: np.ndarray, spring: np.ndarray
    ) -> dict[str, float]:
        error = _rms(moment - torque)
        needed, _ = _parts(moment * self.velocity)
        available, _ = _parts(spring * self.velocity)
        missing = self.step_s * np.maximum(needed - available, 0.0).sum()
        return {
            f"{kind}_error_rms": error,
            f"{kind}_error_share": error / _rms(moment),
            f"{kind}_missing_work": float(missing),
        }


def design_joint(
    profiles: Mapping[str, ImpedanceProfile],
    *,
    motor: Motor | None = None,
    efficiency: float = 0.6,
) -> JointDesign:
    r"""Return the requirements of profiles on a joint, and joints that come near them.

    The torque is the profile's moment along its mean stride. Stiffness, damping and equilibrium do
    not change it, so their intervals do not enter. Intervals (95 %) are percentiles of 200 draws of
    the moment with a smooth error over the cycle; that of the net work is the profile's own.

    Parameters
    ----------
    profiles : mapping of str to ImpedanceProfile
        Name of an activity -> its profile; all of one joint.
    motor : Motor, optional
        By default the quasi-direct drive of the dissertation's chapter III.
    efficiency : float
        Part of negative power that can be stored, 0 to 1.

    Returns
    -------
    JointDesign
        Requirements, best passive joint, best clutched spring, and gear ratios for the motor.

    Raises
    ------
    DataError
        Without profiles, with profiles of several joints, a moment that is zero everywhere, fewer
        than four phases, or another efficiency.

    Notes
    -----
    A profile has n phases :math:`\varphi_i`, angles :math:`\theta_i` and moments :math:`M_i`;
    indices are periodic, :math:`h` = ``stride_s`` / n, and

    .. math:: v_i = \frac{\theta_{i+1} - \theta_{i-1}}{2h}, \quad
        a_i = \frac{\theta_{i+1} - 2\theta_i + \theta_{i-1}}{h^2}, \quad P_i = M_i v_i.

    With :math:`x^+ = \max(x, 0)` and :math:`x^- = \min(x, 0)`, ``positive_work`` is
    :math:`h\sum P_i^+`, ``negative_work`` :math:`h\sum P_i^-` and ``regenerated`` :math:`-\eta`
    times the latter; :math:`\eta` is the efficiency.

    *Spring and damper.* :math:`T_i = k(\theta_0 - \theta_i) - b v_i` with :math:`k, b \ge 0`,
    :math:`|\theta_0| \le \pi` and the least :math:`\sum(M_i - T_i)^2`. ``error_rms`` is the RMS of
    :math:`M_i - T_i`. With the power of the spring, :math:`S_i = k(\theta_0 - \theta_i)v_i`,
    ``missing_work`` is :math:`h\sum(P_i^+ - S_i^+)^+`.

    *Clutched spring.* For a part of the cycle with nodes a to e (two to n - 1 nodes, round 100 % if
    necessary), :math:`T_i = k(\theta_a - \theta_i) - b_1 v_i` in the part and :math:`-b_2 v_i`
    elsewhere. All parts are tried; the one with the least squared error is taken. :math:`S_i = 0`
    outside the part. With :math:`E_i = \frac12 k(\theta_i - \theta_a)^2` along the part, ``stored``
    is the sum of its increases, ``returned`` that of its decreases, and ``loss`` is :math:`E_e`.

    *Motor and gear.* For N = 1 to 200, with the constants of the torque model at its gear ratio G,
    :math:`\omega = Nv` and :math:`s = \mathrm{sign}(v)`, equation 4.1 is solved for the current i:

    .. math:: D = \frac{M}{N} + \frac{J}{G^2} N a + \frac{B}{G^2}\omega + \frac{C}{G}s, \quad
        i = \frac{D}{k_t - \frac{g}{G}\, s\, \mathrm{sign}(D)}, \quad
        u = Ri + k_t\omega, \quad p = ui.

    C is Coulomb, g gear and B viscous friction, J inertia, all assumed to be at the motor. A ratio
    is feasible if the largest and RMS current and the largest voltage keep to the motor's limits.
    ``motor_energy`` is :math:`h\sum(p_i^+ + \eta p_i^-)`.

    *Intervals.* A draw (``numpy.random.default_rng(0)``) adds :math:`c\,\sigma_i\,g_i` to
    :math:`M_i`. :math:`\sigma` is ``moment_sd``; c follows from the interval of the profile's work,

    .. math:: c = \frac{\mathrm{high} - \mathrm{low}}
        {2 \cdot 1.96 \sum\sigma_i|\theta_{i+1} - \theta_{i-1}|/2},

    which is :math:`1/\sqrt{\mathrm{strides}}` for one person; and
    :math:`g = (z_0 + z_1\cos\varphi + z_2\sin\varphi + z_3\cos2\varphi + z_4\sin2\varphi)/\sqrt3`
    has SD 1 everywhere. Percentiles 2.5 and 97.5 are stretched to hold the value. ``stride_95`` is
    the more demanding of the values for :math:`M \pm 1.64485\,\sigma`.
    """
    _check(profiles, efficiency)
    motor = motor or built_in_motor()
    designs = [_design(*item, motor=motor, efficiency=efficiency) for item in profiles.items()]
    feasible = np.all([_feasible(design.load_by_ratio) for design in designs], axis=0)
    total = np.sum([design.energy_by_ratio for design in designs], axis=0)
    return JointDesign(tuple(designs), efficiency, _best(feasible, total), motor.model_dump())


def _check(profiles: Mapping[str, ImpedanceProfile], efficiency: float) -> None:
    if not 0.0 <= efficiency <= 1.0:
        raise DataError(f"efficiency {efficiency:g}: expected 0 to 1.")
    if not profiles:
        raise DataError("design: expected at least one profile.")
    joints = sorted({f"{p.joint}, positive {p.positive}" for p in profiles.values()})
    if len(joints) > 1:
        raise DataError(
            f"design: expected profiles of one joint, got {'; '.join(joints)}. Run it for each."
        )
    for name, profile in profiles.items():
        if profile.gait_pct.size < 4 or not profile.moment.any():
            raise DataError(
                f"{name}: expected at least four phases and a moment that is not zero everywhere."
            )


def _design(
    name: str, profile: ImpedanceProfile, *, motor: Motor, efficiency: float
) -> ProfileDesign:
    angle, moment = profile.angle, profile.moment
    step_s = profile.stride_s / angle.size
    bend = (np.roll(angle, -1) - 2.0 * angle + np.roll(angle, 1)) / step_s**2
    stride = _Stride(angle, profile.velocity, bend, step_s, efficiency, motor)
    gears = stride.gears(moment)
    feasible = _feasible(gears.load)
    ratio = _best(feasible, gears.energy)
    span = {}
    if ratio is not None:
        ends = RATIOS[feasible]
        span = {"gear_ratio_low": ends[0], "gear_ratio_high": ends[-1], "gear_ratio": ratio}

    def values(torque: np.ndarray) -> dict[str, float]:
        driven = {} if ratio is None else stride.motorised(torque, ratio)
        fits = stride.passive(torque)[1] | stride.clutch(torque)[1]
        return stride.requirements(torque) | fits | span | driven

    return ProfileDesign(
        name,
        profile.subject,
        profile.mass_kg,
        profile.stride_s,
        profile.gait_pct,
        angle,
        profile.velocity,
        moment,
        stride.passive(moment)[0].torque,
        stride.clutch(moment)[0].torque,
        gears.energy,
        gears.load,
        _with_intervals(name, profile, values),
        profile.warnings,
    )


def _with_intervals(
    name: str, profile: ImpedanceProfile, values: Callable[[np.ndarray], dict[str, float]]
) -> tuple[DesignQuantity, ...]:
    """Return the quantities with their intervals and the 95th percentiles of strides."""
    moment, spread = profile.moment, profile.moment_sd
    error = _error_share(profile) * spread
    mean = values(moment)
    drawn = pd.DataFrame([values(moment + error * draw) for draw in _error_draws(moment.size)])
    ends = pd.DataFrame([values(moment + z * spread) for z in (-ONE_SIDED_95, ONE_SIDED_95)])
    lows, highs = (drawn.quantile(q) for q in (0.025, 0.975))
    quantities = []
    for quantity, unit in UNITS.items():
        if quantity not in mean:
            continue
        value = float(mean[quantity])
        # Any error raises some quantities, such as an RMS: then all draws lie on one side.
        ends_95 = min(float(lows[quantity]), value), max(float(highs[quantity]), value)
        low, high = (None, None) if quantity in _EXACT else ends_95
        if quantity == "net_work":
            low, high = profile.energy_low_j, profile.energy_high_j
        extreme = ends[quantity].min() if quantity in _SMALLEST else ends[quantity].max()
        stride_95 = float(extreme) if quantity in _PER_STRIDE else None
        quantities.append(DesignQuantity(name, quantity, value, unit, low, high, stride_95))
    return tuple(quantities)


def _error_draws(n: int) -> np.ndarray:
    """Return smooth periodic errors of SD 1 at every phase, (200, n).

    An error alike at all phases would leave net work, stiffness and damping without an interval.
    """
    turn = 2.0 * np.pi * np.arange(n) / n
    shapes = [np.ones(n), np.cos(turn), np.sin(turn), np.cos(2.0 * turn), np.sin(2.0 * turn)]
    normals = np.random.default_rng(_SEED).standard_normal((DRAWS, len(shapes)))
    return np.asarray(normals @ np.array(shapes) / np.sqrt(3.0))


def _error_share(profile: ImpedanceProfile) -> float:
    """Return the error of the mean moment as a share of its SD between strides.

    A profile states the error by the interval of its work, errors at all phases added up.
    """
    turned = 0.5 * (np.roll(profile.angle, -1) - np.roll(profile.angle, 1))
    spread = float(profile.moment_sd @ np.abs(turned))
    half = 0.5 * (profile.energy_high_j - profile.energy_low_j)
    return half / REACH_95 / spread if spread > 0.0 else 0.0


def _parts(power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.maximum(power, 0.0), np.minimum(power, 0.0)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _feasible(load: np.ndarray) -> np.ndarray:
    return np.asarray((load <= 1.0).all(axis=0))


def _best(feasible: np.ndarray, energy: np.ndarray) -> float | None:
    if not feasible.any():
        return None
    return float(RATIOS[np.argmin(np.where(feasible, energy, np.inf))])


_SPREAD = (
    ("largest torque", "torque_max"),
    ("smallest", "torque_min"),
    ("largest power", "power_max"),
    ("smallest", "power_min"),
)
_HEADS = ("torque, N*m", "RMS", "power, W", "work +, J", "work -, J", "net, J", "stored, J")
_ROW = "{:<14}{:>16}{:>8}{:>16}{:>11}{:>11}{:>9}{:>11}"


def _requirements(design: ProfileDesign) -> str:
    of = {q.quantity: q.value for q in design.quantities}
    torque = f"{of['torque_min']:.1f} to {of['torque_max']:.1f}"
    power = f"{of['power_min']:.1f} to {of['power_max']:.1f}"
    works = (of[name] for name in ("positive_work", "negative_work", "net_work", "regenerated"))
    return _ROW.format(
        design.name, torque, f"{of['torque_rms']:.1f}", power, *(f"{work:.2f}" for work in works)
    )


def _solutions(design: ProfileDesign) -> list[str]:
    """Return a line each: intervals, spring and damper, clutched spring, motor."""
    quantities = {q.quantity: q for q in design.quantities}
    nearest = int(np.argmin(design.load_by_ratio.max(axis=0)))
    return render_paragraphs(
        "joint_design.txt.j2",
        q=quantities,
        spread=[(name, quantities[key]) for name, key in _SPREAD],
        nearest=RATIOS[nearest],
        loads=dict(zip(LIMITS, design.load_by_ratio[:, nearest], strict=True)),
    )


def draw_design(canvas: "Figure", design: JointDesign) -> None:
    """Draw power over the cycle and torque against angle, a row each profile."""
    rows = canvas.subplots(len(design.profiles), 2, squeeze=False)
    for (left, right), profile in zip(rows, design.profiles, strict=True):
        _draw_power(left, profile)
        _draw_torque(right, profile)
        left.set_title(f"{profile.name}: {profile.subject}, {profile.mass_kg:.1f} kg", loc="left")
    rows[0, 1].legend()


def _draw_power(axes: "Axes", design: ProfileDesign) -> None:
    at = np.append(design.gait_pct, 100.0)
    power = design.moment * design.velocity
    power = np.append(power, power[0])
    gained, lost = _parts(power)
    for part, color, work in (
        (gained, VERMILION, "positive_work"),
        (lost, BLUE, "negative_work"),
    ):
        label = f"{design.value(work):.1f} J"
        axes.fill_between(at, part, color=color, alpha=0.4, linewidth=0.0, label=label)
    axes.plot(at, power, color=INK)
    axes.axhline(0.0, color=MUTED, linewidth=0.6)
    axes.set(xlim=(0.0, 100.0), xlabel="gait cycle (%)", ylabel="power (W)")
    axes.legend()


def _draw_torque(axes: "Axes", design: ProfileDesign) -> None:
    angle = np.append(design.angle, design.angle[0])
    for torque, color, label, style in (
        (design.moment, INK, "moment", "-"),
        (design.passive_torque, ORANGE, "spring and damper", "--"),
        (design.clutch_torque, BLUE, "clutched spring", "-"),
    ):
        axes.plot(angle, np.append(torque, torque[0]), color=color, label=label, linestyle=style)
    axes.axhline(0.0, color=MUTED, linewidth=0.6)
    axes.set(xlabel="angle (rad)", ylabel="torque (N*m)")
