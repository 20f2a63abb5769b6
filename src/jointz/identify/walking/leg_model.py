"""Forward model of all timing points: from one vector of parameters to every response.

The vector holds, for each timing point, K on its scale and log B at knots from the onset on, the
deviation of log J, the slope of J and the deviation of the reflex; then what all points share.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import expit

from jointz.identify.preparation.raw_signals import ENCODER, JOINT_VELOCITY, SHANK_VELOCITY
from jointz.identify.walking.coupling import STRAP, ModelError
from jointz.identify.walking.responses import GONIOMETER, PointResponse
from jointz.kernels import strapped_leg as leg
from jointz.kernels.steps import at_steps
from jointz.results.value_scale import ValueScale

#: Scale on which K is estimated.
STIFFNESS_SCALE: Final = ValueScale(8.0)
#: What all points share, behind the parameters of the points.
_SHARED = (
    "inertia",
    "device_share",
    "strap_hz",
    "strap_damping",
    "skin_share",
    "sensor_delay_s",
    "sensor_lag_s",
    "half_angle_rad",
    "softening_power",
    "reflex_gain",
    "reflex_latency_s",
    "reflex_time_s",
    "reflex_position",
    "reflex_shortening",
    "friction_nm",
    "torque_error",
    "goniometer_gain",
    "goniometer_hz",
    "goniometer_damping",
)
_SHANK = ("gyroscope_delay_s", "gyroscope_gain", "shank_hz", "shank_damping")
#: What a sensor beside the goniometer adds.
_OF_SENSOR: Final[Mapping[str, tuple[str, ...]]] = {
    ENCODER: ("encoder_delay_s", "encoder_gain"),
    JOINT_VELOCITY: (*_SHANK, "thigh_hz", "thigh_damping"),
    SHANK_VELOCITY: _SHANK,
}
_COLUMNS: Final[Mapping[str, int]] = {
    GONIOMETER: leg.GONIOMETER,
    ENCODER: leg.ENCODER,
    JOINT_VELOCITY: leg.GYROSCOPE,
    SHANK_VELOCITY: leg.GYROSCOPE,
}
#: Size of a known addition to the joint that one unit of its parameter stands for: N*m/rad, kg*m^2.
ADDED: Final[Mapping[str, float]] = {"added_stiffness": 100.0, "added_inertia": 0.1}
#: Share of the stiffness of an addition that softens with displacement, as the joint's does.
ADDED_SOFTENING: Final = "added_softening"
_OF_ADDITION: Final = (*ADDED, ADDED_SOFTENING)
#: Of a point behind its knots: deviation of the log reflex and, with gyroscopes, the logit of the
#: share of the joint's motion that the shank makes.
REFLEX, SHANK = range(2)
#: Of the joint's motion, where no gyroscope shows it.
SHANK_SHARE = STRAP.priors.shank_share.median
#: Time from the onset at which the inertia has its value.
REFERENCE_S = 0.06
#: Knots of K and B at most so far apart, s.
_KNOT_S = 0.06
#: Speed at which Coulomb friction has two thirds of its size, rad/s.
_FRICTION_VELOCITY = 0.08
_STEP_S = 0.001
_FARTHEST_RAD = 100.0
#: Bounds of the search: logarithms of K, B and the change of J, and physical limits. Where K may
#: be negative, it is bounded by its size.
_LARGEST_K, _LOG_K, _LOG_B, _LOG_J = 3000.0, (-1.0, 8.0), (-5.0, 4.0), (-3.0, 3.0)
_SHARES, _POWERS = (0.01, 0.6), (0.7, 3.5)
_STRAPS_HZ = (1.0, 150.0)
_GAINS = (-0.5, 0.5)
_TORQUE_ERRORS = (-0.5, 0.5)
_LATENCIES_S, _TIMES_S = (0.015, 0.15), (0.008, 0.2)
#: Knots between which log K is a smooth process of this length, cycles.
LENGTH_CYCLES = 0.13
_KNOT_NUGGET = 1e-6


@dataclass(frozen=True, slots=True)
class AddedPart:
    """Part that a known addition, the same at all timing points, has in one of them."""

    partner: int  # the point without the addition
    gravity: float  # N*m/rad: of the weight, in the posture of the point
    # inertia that the joint feels over that of the addition, as a polynomial (constant first) in
    # the share of the joint's motion that the shank makes
    felt: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Layout:
    """Places of the parameters in the vector."""

    n_points: int
    n_knots: int
    sensors: tuple[str, ...] = ()  # beside the goniometer
    has_addition: bool = False

    @property
    def own_of_point(self) -> range:
        """Parameters of a timing point beside its knots, in order."""
        turns = not {JOINT_VELOCITY, SHANK_VELOCITY}.isdisjoint(self.sensors)
        return range(SHANK + 1 if turns else SHANK)

    @property
    def shared_names(self) -> tuple[str, ...]:
        """Names of the parameters that all timing points share, in order."""
        of_sensors = (name for sensor in self.sensors for name in _OF_SENSOR[sensor])
        return (*_SHARED, *of_sensors, *(_OF_ADDITION if self.has_addition else ()))

    @property
    def per_point(self) -> int:
        """Number of parameters of a point."""
        return 3 * self.n_knots + len(self.own_of_point)

    @property
    def size(self) -> int:
        """Number of all parameters."""
        return self.n_points * self.per_point + len(self.shared_names)

    def stiffness(self, point: int) -> slice:
        """Return the places of K, on its scale, at the knots of a point."""
        first = point * self.per_point
        return slice(first, first + self.n_knots)

    def damping(self, point: int) -> slice:
        """Return the places of log B at the knots of a point."""
        first = point * self.per_point + self.n_knots
        return slice(first, first + self.n_knots)

    def inertia(self, point: int) -> slice:
        """Return the places of the deviation of log J at the knots of a point."""
        first = point * self.per_point + 2 * self.n_knots
        return slice(first, first + self.n_knots)

    def own(self, point: int, which: int) -> int:
        """Return the place of REFLEX or SHANK of a point."""
        return point * self.per_point + 3 * self.n_knots + which

    def shared(self, name: str) -> int:
        """Return the place of a shared parameter."""
        return self.n_points * self.per_point + self.shared_names.index(name)

    def columns(self, point: int) -> np.ndarray:
        """Return the places of all parameters that the responses of a point depend on."""
        first = point * self.per_point
        shared = self.n_points * self.per_point
        return np.asarray(np.r_[first : first + self.per_point, shared : self.size])


class LegModel:
    """Responses of all timing points of a participant."""

    def __init__(
        self,
        points: Sequence[PointResponse],
        *,
        window_s: float,
        gravity_stiffness: float,
        stiffness_scale: ValueScale = STIFFNESS_SCALE,
        error: ModelError = STRAP.error,
        added: Sequence[AddedPart | None] = (),
    ) -> None:
        self.points = tuple(points)
        self.added = tuple(added) or (None,) * len(self.points)
        self.error = error
        self.window_s = window_s
        self._gravity = gravity_stiffness
        self.stiffness_scale = stiffness_scale
        farthest = stiffness_scale.of(_LARGEST_K)
        self._stiffness_range = (-farthest, farthest) if stiffness_scale.unit else _LOG_K
        end_s = max(window_s, max(float(p.time_s[-1]) for p in points))
        self.knots_s = np.linspace(0.0, end_s, int(np.ceil(end_s / _KNOT_S - 1e-9)) + 1)
        self.channels = points[0].channels
        has_addition = any(part is not None for part in self.added)
        self.layout = Layout(len(points), self.knots_s.size, self.channels[1:], has_addition)
        self._shown = [_COLUMNS[channel] for channel in self.channels]
        self._length_s = LENGTH_CYCLES * float(np.mean([p.stride_s for p in points]))
        among = self._correlation(self.knots_s) + _KNOT_NUGGET * np.eye(self.knots_s.size)
        self._knot_inverse = np.linalg.inv(among)
        self._torques = [
            np.stack([at_steps(s.torque, _substeps(p.period_s)) for s in p.shapes]) for p in points
        ]

    def with_points(self, points: Sequence[PointResponse]) -> "LegModel":
        """Return the same model of other responses."""
        return LegModel(
            points,
            window_s=self.window_s,
            gravity_stiffness=self._gravity,
            stiffness_scale=self.stiffness_scale,
            error=self.error,
            added=self.added,
        )

    def natural(self, theta: np.ndarray, point: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return K and B over time (m, n) and the parameters of the leg (m, N) of a point."""
        layout, time_s = self.layout, self.points[point].time_s
        weights = self.knot_weights(np.clip(time_s, 0.0, None))
        scaled = theta[:, layout.stiffness(point)] @ weights.T
        stiffness = self.stiffness_scale.value(np.clip(scaled, *self._stiffness_range))
        damping = np.exp(np.clip(theta[:, layout.damping(point)] @ weights.T, *_LOG_B))
        parameters = self._leg(theta, point, stiffness)
        if (part := self.added[point]) is not None:
            more = self._addition(theta, "added_stiffness") + part.gravity
            own, stiffness = stiffness, stiffness + more[:, None]
            softens = expit(theta[:, self.layout.shared(ADDED_SOFTENING)])
            parameters[:, leg.GRAVITY_STIFFNESS] += (1.0 - softens) * more
            parameters[:, leg.REFLEX_GAIN] *= own.mean(axis=1) / stiffness.mean(axis=1)
        return stiffness, damping, parameters

    def _addition(self, theta: np.ndarray, name: str) -> np.ndarray:
        """Return stiffness or inertia of the addition, SI, (m,)."""
        return np.asarray(ADDED[name] * theta[:, self.layout.shared(name)])

    def limb_inertia(self, theta: np.ndarray, point: int, time_s: np.ndarray) -> np.ndarray:
        """Return the inertia of the bone side at times from the onset, (m, t)."""
        layout = self.layout
        weights = self.knot_weights(np.clip(time_s, 0.0, None))
        change = np.clip(theta[:, layout.inertia(point)] @ weights.T, *_LOG_J)
        share = np.clip(np.exp(theta[:, layout.shared("device_share")]), *_SHARES)
        leg_and_device = np.exp(theta[:, layout.shared("inertia")])
        own = (leg_and_device * (1.0 - share))[:, None] * np.exp(change)
        if (part := self.added[point]) is None:
            return np.asarray(own)
        shank = np.full(len(theta), SHANK_SHARE)
        if SHANK in layout.own_of_point:
            shank = expit(theta[:, layout.own(point, SHANK)])
        felt = self._addition(theta, "added_inertia") * np.polyval(part.felt[::-1], shank)
        return np.asarray(own + felt[:, None])

    def responses(self, theta: np.ndarray, point: int) -> np.ndarray:
        """Return what the sensors show of all shapes of a point, stacked as in the response."""
        return self._simulated(theta, point, self._shown).reshape(len(theta), -1)

    def bone(self, theta: np.ndarray, point: int) -> np.ndarray:
        """Return the angle of the bone, (m, shapes, n)."""
        return self._simulated(theta, point, [leg.BONE])[:, :, 0]

    def impulse_responses(self, theta: np.ndarray, point: int) -> np.ndarray:
        """Return what the sensors show of 1 N*m at one sample, without friction, (channel, n)."""
        stiffness, damping, parameters = self.natural(theta[None], point)
        inertia = self.limb_inertia(theta[None], point, self.points[point].time_s)
        parameters[:, leg.FRICTION] = 0.0
        small = 1e-3
        torque = np.zeros(stiffness.shape[1])
        torque[1] = small
        out = self._run(
            point,
            at_steps(torque, _substeps(self.points[point].period_s))[None],
            (stiffness, damping, inertia),
            parameters,
        )
        response = out[0][:, self._shown].T / small
        return np.concatenate([response[:, 1:], response[:, -1:]], axis=1)

    def knot_weights(self, time_s: np.ndarray) -> np.ndarray:
        """Return the weights of the knots at times, (t, knots): the process's conditional mean."""
        return np.asarray(self._correlation(time_s) @ self._knot_inverse)

    def _correlation(self, time_s: np.ndarray) -> np.ndarray:
        """Return the covariance of a smooth process between times and knots, (t, knots)."""
        apart = (time_s[:, None] - self.knots_s) / self._length_s
        return np.asarray(1.0 + np.exp(-0.5 * apart**2))

    def _leg(self, theta: np.ndarray, point: int, stiffness: np.ndarray) -> np.ndarray:
        layout = self.layout

        def raw(name: str) -> np.ndarray:
            return np.asarray(theta[:, layout.shared(name)])

        inertia, share = np.exp(raw("inertia")), np.clip(np.exp(raw("device_share")), *_SHARES)
        # Of the strap, not of the point: the device stays the same when the leg's inertia changes.
        reduced = inertia * share * (1.0 - share)
        turn = 2.0 * np.pi * np.clip(np.exp(raw("strap_hz")), *_STRAPS_HZ)
        p = np.zeros((len(theta), leg.N_PARAMETERS))
        p[:, leg.DEVICE_INERTIA] = inertia * share
        p[:, leg.STRAP_STIFFNESS] = reduced * turn**2
        p[:, leg.STRAP_DAMPING] = 2.0 * np.exp(raw("strap_damping")) * reduced * turn
        p[:, leg.HALF_ANGLE] = np.exp(raw("half_angle_rad"))
        p[:, leg.SOFTENING_POWER] = np.clip(raw("softening_power"), *_POWERS)
        softest = np.maximum(stiffness.min(axis=1), 0.0)
        p[:, leg.GRAVITY_STIFFNESS] = np.minimum(self._gravity, 0.5 * softest)
        p[:, leg.REFLEX_GAIN] = np.exp(raw("reflex_gain") + theta[:, layout.own(point, REFLEX)])
        p[:, leg.REFLEX_LATENCY] = np.clip(np.exp(raw("reflex_latency_s")), *_LATENCIES_S)
        p[:, leg.REFLEX_TIME] = np.clip(np.exp(raw("reflex_time_s")), *_TIMES_S)
        p[:, leg.REFLEX_POSITION] = expit(raw("reflex_position"))
        p[:, leg.REFLEX_SHORTENING] = expit(raw("reflex_shortening"))
        p[:, leg.FRICTION] = np.exp(raw("friction_nm"))
        p[:, leg.FRICTION_VELOCITY] = _FRICTION_VELOCITY
        p[:, leg.TORQUE_ERROR] = np.clip(raw("torque_error"), *_TORQUE_ERRORS)
        p[:, leg.SKIN_SHARE] = expit(raw("skin_share"))
        p[:, leg.SENSOR_TIME] = np.exp(raw("sensor_lag_s"))
        p[:, leg.SENSOR_DELAY] = np.exp(raw("sensor_delay_s"))
        p[:, [leg.SENSOR_GAIN, leg.ENCODER_GAIN, leg.GYROSCOPE_GAIN]] = 1.0
        self._instruments(theta, point, p)
        return p

    def _instruments(self, theta: np.ndarray, point: int, p: np.ndarray) -> None:
        """Fill the parameters of the goniometer's mount and of further sensors."""
        layout = self.layout

        def raw(name: str) -> np.ndarray:
            return np.asarray(theta[:, layout.shared(name)])

        p[:, leg.SENSOR_GAIN] += np.clip(raw("goniometer_gain"), *_GAINS)
        p[:, leg.SENSOR_HZ] = np.clip(np.exp(raw("goniometer_hz")), *_STRAPS_HZ)
        p[:, leg.SENSOR_DAMPING] = np.exp(raw("goniometer_damping"))
        if ENCODER in layout.sensors:
            p[:, leg.ENCODER_DELAY] = raw("encoder_delay_s")
            p[:, leg.ENCODER_GAIN] += np.clip(raw("encoder_gain"), *_GAINS)
        if SHANK in layout.own_of_point:
            p[:, leg.GYROSCOPE_DELAY] = raw("gyroscope_delay_s")
            p[:, leg.GYROSCOPE_GAIN] += np.clip(raw("gyroscope_gain"), *_GAINS)
            p[:, leg.SHANK_SHARE] = expit(theta[:, layout.own(point, SHANK)])
            p[:, leg.SHANK_HZ] = np.clip(np.exp(raw("shank_hz")), *_STRAPS_HZ)
            p[:, leg.SHANK_DAMPING] = np.exp(raw("shank_damping"))
        if JOINT_VELOCITY in layout.sensors:
            p[:, leg.THIGH_HZ] = np.clip(np.exp(raw("thigh_hz")), *_STRAPS_HZ)
            p[:, leg.THIGH_DAMPING] = np.exp(raw("thigh_damping"))

    def _simulated(self, theta: np.ndarray, point: int, columns: Sequence[int]) -> np.ndarray:
        """Return columns of the responses, (m, shapes, columns, n)."""
        stiffness, damping, parameters = self.natural(theta, point)
        inertia = self.limb_inertia(theta, point, self.points[point].time_s)
        torques = self._torques[point]
        m, shapes = len(theta), len(torques)
        curves = [np.repeat(c, shapes, axis=0) for c in (stiffness, damping, inertia)]
        leg_of_each = np.repeat(parameters, shapes, axis=0)
        out = self._run(point, np.tile(torques, (m, 1)), curves, leg_of_each)
        shown = out[:, :, columns].transpose(0, 2, 1)
        return np.asarray(shown.reshape(m, shapes, len(columns), -1))

    def _run(
        self,
        point: int,
        torque: np.ndarray,
        curves: Sequence[np.ndarray],
        parameters: np.ndarray,
    ) -> np.ndarray:
        """Return the responses for K, B and J over time."""
        response = self.points[point]
        stiffness, damping, inertia = curves
        velocity = np.broadcast_to(response.velocity, stiffness.shape)
        stacked = np.ascontiguousarray(np.stack([stiffness, damping, velocity, inertia], axis=1))
        substeps = _substeps(response.period_s)
        out = leg.leg_responses(torque, stacked, parameters, response.period_s, substeps)
        # Far from any leg the integration diverges; the search only needs to see that.
        near = np.clip(np.nan_to_num(out, nan=_FARTHEST_RAD), -_FARTHEST_RAD, _FARTHEST_RAD)
        return np.asarray(near)


def _substeps(period_s: float) -> int:
    """Return the number of steps of the integration in one sample."""
    return max(1, int(np.ceil(period_s / _STEP_S - 1e-6)))
