"""Information by central differences against automatic differentiation of the model's source.

The kernel's own source runs uncompiled on dual numbers, and the parameters are transformed by code
of this test.
"""

import inspect
import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jointz.core.protocols.pulse_models import DoubletPulse, TrapezoidPulse
from jointz.core.study import ParticipantSpec
from jointz.kernels import strapped_leg
from jointz.planning.laboratory import SENSORS, Actuator, Laboratory
from jointz.planning.predicted_estimates import PlannedLeg, drawn_parameters
from jointz.planning.predicted_responses import Design
from jointz.planning.unperturbed_walking import stored_walking

PULSES = (
    DoubletPulse(name="d", kind="doublet", amplitudes_nm=(12.0,), durations_s=(0.04, 0.022)),
    TrapezoidPulse(
        name="t", kind="trapezoid", amplitudes_nm=(6.0,), hold_s=0.06, direction="negative"
    ),
)
ALL = ("goniometer", "encoder", "gyroscopes")


class Dual:
    """A number and its derivatives."""

    __array_ufunc__ = None  # numpy's numbers leave arithmetic to this class
    __slots__ = ("of", "value")

    def __init__(self, value: float, of: np.ndarray) -> None:
        self.value, self.of = float(value), of

    def __add__(self, other: Any) -> "Dual":
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.of + other.of)
        return Dual(self.value + other, self.of)

    def __mul__(self, other: Any) -> "Dual":
        if isinstance(other, Dual):
            return Dual(self.value * other.value, self.value * other.of + other.value * self.of)
        return Dual(self.value * other, self.of * other)

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.of)

    def __sub__(self, other: Any) -> "Dual":
        return self + -other

    def __rsub__(self, other: Any) -> "Dual":
        return -self + other

    def __truediv__(self, other: Any) -> "Dual":
        return self * (other**-1.0)

    def __rtruediv__(self, other: Any) -> "Dual":
        return self**-1.0 * other

    def __pow__(self, power: Any) -> "Dual":
        if self.value == 0.0:
            return Dual(0.0, 0.0 * self.of)
        if isinstance(power, Dual):
            return exp(power * log(self))
        raised = self.value**power
        return Dual(raised, power * raised / self.value * self.of)

    def __abs__(self) -> "Dual":
        return self if self.value >= 0.0 else -self

    def __int__(self) -> int:
        return int(self.value)

    def __lt__(self, other: Any) -> bool:
        return self.value < value_of(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= value_of(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > value_of(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= value_of(other)

    __radd__, __rmul__ = __add__, __mul__


def value_of(x: Any) -> float:
    return x.value if isinstance(x, Dual) else float(x)


def derived(function, slope):
    """Return a function of numbers that takes dual numbers, too."""

    def of(x: Any) -> Any:
        y = function(value_of(x))
        return Dual(y, slope(value_of(x), y) * x.of) if isinstance(x, Dual) else y

    return of


exp = derived(math.exp, lambda _, y: y)
log = derived(math.log, lambda x, _: 1.0 / x)
sinh = derived(math.sinh, lambda x, _: math.cosh(x))
tanh = derived(math.tanh, lambda _, y: 1.0 - y**2)
expit = derived(lambda x: 1.0 / (1.0 + math.exp(-x)), lambda _, y: y * (1.0 - y))


def clip(x: Any, low: float, high: float) -> Any:
    return low if x < low else high if x > high else x


def uncompiled() -> dict[str, Any]:
    """Return the functions of the kernel's source, on objects."""
    source = inspect.getsource(strapped_leg)
    for line in ("import numpy as np\n", "from numba import njit\n"):
        assert line in source
        source = source.replace(line, "")
    numbers = SimpleNamespace(
        zeros=lambda shape: np.full(shape, 0.0, dtype=object),
        exp=exp,
        tanh=tanh,
        pi=np.pi,
        ndarray=np.ndarray,
    )
    found: dict[str, Any] = {
        "np": numbers,
        "float": lambda x: x,
        "njit": lambda **_: lambda function: function,
    }
    exec(compile(source, "strapped_leg", "exec"), found)
    return found


def natural(model, theta: Sequence[Dual], gravity: float):
    """Return K, B and J over time, and the parameters of the leg."""
    layout, leg, point = model.layout, strapped_leg, 0
    weights = model.knot_weights(np.clip(model.points[0].time_s, 0.0, None))

    def over_time(part, low, high, value=exp):
        knots = theta[part]
        sums = [sum(w * x for w, x in zip(row, knots, strict=True)) for row in weights.tolist()]
        return [value(clip(x, low, high)) for x in sums]

    def raw(name):
        return theta[layout.shared(name)]

    unit = model.stiffness_scale.unit
    stiffness = over_time(layout.stiffness(point), 0.0, 8.0, lambda x: unit * sinh(x))
    damping = over_time(layout.damping(point), -5.0, 4.0)
    share = clip(exp(raw("device_share")), 0.01, 0.6)
    whole = exp(raw("inertia"))
    bone = whole * (1.0 - share)
    inertia = [bone * x for x in over_time(layout.inertia(point), -3.0, 3.0)]
    turn = 2.0 * math.pi * clip(exp(raw("strap_hz")), 1.0, 150.0)
    reduced = whole * share * (1.0 - share)
    softest = min(stiffness, key=value_of) * 0.5
    p: list[Any] = [0.0] * leg.N_PARAMETERS
    p[leg.DEVICE_INERTIA] = whole * share
    p[leg.STRAP_STIFFNESS] = reduced * turn * turn
    p[leg.STRAP_DAMPING] = 2.0 * exp(raw("strap_damping")) * reduced * turn
    p[leg.HALF_ANGLE] = exp(raw("half_angle_rad"))
    p[leg.SOFTENING_POWER] = clip(raw("softening_power"), 0.7, 3.5)
    p[leg.GRAVITY_STIFFNESS] = softest if softest < gravity else gravity
    p[leg.REFLEX_GAIN] = exp(raw("reflex_gain") + theta[layout.own(point, 0)])
    p[leg.REFLEX_LATENCY] = clip(exp(raw("reflex_latency_s")), 0.015, 0.15)
    p[leg.REFLEX_TIME] = clip(exp(raw("reflex_time_s")), 0.008, 0.2)
    p[leg.REFLEX_POSITION] = expit(raw("reflex_position"))
    p[leg.REFLEX_SHORTENING] = expit(raw("reflex_shortening"))
    p[leg.FRICTION] = exp(raw("friction_nm"))
    p[leg.FRICTION_VELOCITY] = 0.08
    p[leg.TORQUE_ERROR] = clip(raw("torque_error"), -0.5, 0.5)
    p[leg.SKIN_SHARE] = expit(raw("skin_share"))
    p[leg.SENSOR_TIME] = exp(raw("sensor_lag_s"))
    p[leg.SENSOR_DELAY] = exp(raw("sensor_delay_s"))
    p[leg.SENSOR_GAIN] = p[leg.ENCODER_GAIN] = p[leg.GYROSCOPE_GAIN] = 1.0
    p[leg.SENSOR_GAIN] = 1.0 + clip(raw("goniometer_gain"), -0.5, 0.5)
    p[leg.SENSOR_HZ] = clip(exp(raw("goniometer_hz")), 1.0, 150.0)
    p[leg.SENSOR_DAMPING] = exp(raw("goniometer_damping"))
    if layout.sensors:
        p[leg.ENCODER_DELAY] = raw("encoder_delay_s")
        p[leg.ENCODER_GAIN] = 1.0 + clip(raw("encoder_gain"), -0.5, 0.5)
        p[leg.GYROSCOPE_DELAY] = raw("gyroscope_delay_s")
        p[leg.GYROSCOPE_GAIN] = 1.0 + clip(raw("gyroscope_gain"), -0.5, 0.5)
        p[leg.SHANK_SHARE] = expit(theta[layout.own(point, 1)])
        p[leg.SHANK_HZ] = clip(exp(raw("shank_hz")), 1.0, 150.0)
        p[leg.SHANK_DAMPING] = exp(raw("shank_damping"))
        p[leg.THIGH_HZ] = clip(exp(raw("thigh_hz")), 1.0, 150.0)
        p[leg.THIGH_DAMPING] = exp(raw("thigh_damping"))
    return stiffness, damping, inertia, p


def dual_responses(leg: PlannedLeg, gravity: float, columns: Sequence[int]):
    """Return the stacked responses of the only timing point, and their derivatives."""
    model, point = leg.model, leg.model.points[0]
    of = np.eye(leg.theta.size)
    theta = [Dual(x, row) for x, row in zip(leg.theta, of, strict=True)]
    stiffness, damping, inertia, p = natural(model, theta, gravity)
    curves = np.empty((1, 4, point.time_s.size), dtype=object)
    for row, series in enumerate((stiffness, damping, point.velocity.tolist(), inertia)):
        curves[0, row] = series
    parameters = np.empty((1, len(p)), dtype=object)
    parameters[0] = p
    run = uncompiled()["leg_responses"]
    substeps = math.ceil(point.period_s / 0.001 - 1e-6)
    shown = []
    for shape in point.shapes:
        at = np.arange((point.time_s.size - 1) * substeps + 1) / substeps
        torque = np.interp(at, np.arange(point.time_s.size), shape.torque).astype(object)
        out = run(torque[None], curves, parameters, point.period_s, substeps)
        shown += [x for column in columns for x in out[0, :, column]]
    values = np.array([value_of(x) for x in shown])
    slopes = np.array([x.of if isinstance(x, Dual) else np.zeros(len(theta)) for x in shown])
    return values, slopes


def drawn_leg(sensors: Sequence[str]) -> tuple[PlannedLeg, float]:
    """Return a leg that is drawn from the priors, whose delays are no whole steps.

    Between steps the kernel is linear: at a whole step, a delay has two slopes.
    """
    noise = {name: SENSORS[name][1] for name in sensors}
    walking = stored_walking(
        {"MST": 21.5},
        {SENSORS[name][0]: sd for name, sd in noise.items()},
        window_s=0.15,
        rate_hz=250.0,
        stride_s=1.1,
        n_strides=60,
    )
    person = ParticipantSpec(id="typical", mass_kg=75.0, height_m=1.75)
    lab = Laboratory((person,), (walking,), noise, Actuator(17.0))
    design = Design("two shapes", PULSES, 0.15)
    theta = drawn_parameters(lab, design, n=1, seed=4)[0]
    layout = PlannedLeg(lab, design, 0).model.layout
    for name in set(layout.shared_names) & {"encoder_delay_s", "gyroscope_delay_s"}:
        theta[layout.shared(name)] = 0.0004
    return PlannedLeg(lab, design, 0, theta), lab.body(0).gravity_stiffness


@pytest.mark.parametrize("sensors", [ALL[:1], ALL], ids=["goniometer", "three sensors"])
def test_information_is_that_of_automatic_differentiation(sensors):
    leg, gravity = drawn_leg(sensors)
    point, search = leg.model.points[0], leg.search({"MST": 40.0})
    columns = [{"goniometer": 0, "encoder": 1, "gyroscopes": 2}[name] for name in sensors]

    values, slopes = dual_responses(leg, gravity, columns)

    np.testing.assert_allclose(values, leg.model.responses(leg.theta[None], 0)[0], atol=1e-12)
    used = np.ix_(point.used, point.used)
    fitted = point.fitted(slopes.T)
    covariance = search.error_covariance(leg.theta, 0)[used]
    expected = fitted @ np.linalg.solve(covariance, fitted.T)
    found = leg.sensitivity.information(search)
    size = np.sqrt(np.diag(expected))
    assert (size > 0.0).all()
    assert (np.abs(found - expected) / np.outer(size, size)).max() < 5e-6
