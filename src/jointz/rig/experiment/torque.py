"""Torque at run time: what is applied (equation 4.1), and the wearer feeling none."""

from math import exp, pi, tanh

from jointz.core.study import TorqueModelSpec

#: Friction turns its sign smoothly over this velocity: a step would make the motor chatter.
_SMOOTH_RAD_S = 0.2
#: Share of the friction that is compensated: more could drive the joint by itself.
_COMPENSATED = 0.8
#: The acceleration of equation 4.1 is differentiated velocity, low-passed here.
_ACCELERATION_HZ = 20.0


class AppliedTorque:
    """Torque on the joint out of current and velocity, sample by sample.

    Equation 4.1 with the acceleration from the differentiated and low-passed
    velocity. Good enough to act on; for estimates torque is computed again from
    the record, without delay.
    """

    __slots__ = ("_acceleration", "_constant", "_model", "_rate_hz", "_share", "_velocity")

    def __init__(self, model: TorqueModelSpec, *, sample_period_s: float) -> None:
        self._model = model
        self._constant = model.gear_ratio * model.torque_constant
        self._rate_hz = 1.0 / sample_period_s
        self._share = 1.0 - exp(-2.0 * pi * _ACCELERATION_HZ * sample_period_s)
        self._velocity: float | None = None
        self._acceleration = 0.0

    def update(self, current: float, velocity: float) -> float:
        """Process a sample and return the torque on the joint, N*m."""
        model = self._model
        if self._velocity is not None:
            raw = (velocity - self._velocity) * self._rate_hz
            self._acceleration += self._share * (raw - self._acceleration)
        self._velocity = velocity
        friction = model.coulomb_friction + model.gear_friction * abs(current)
        sign = 1.0 if velocity > 0.0 else -1.0 if velocity < 0.0 else 0.0
        return (
            model.bias
            + self._constant * current
            - friction * sign
            - model.viscous_friction * velocity
            - model.rotor_inertia * self._acceleration
        )


class ZeroTorque:
    """Zero-torque control: compensates the friction that the wearer would feel."""

    __slots__ = ("_coulomb", "_per_torque", "_viscous")

    def __init__(self, model: TorqueModelSpec) -> None:
        self._coulomb = _COMPENSATED * model.coulomb_friction
        self._viscous = _COMPENSATED * model.viscous_friction
        gain = model.gear_ratio * model.torque_constant
        self._per_torque = _COMPENSATED * model.gear_friction / abs(gain)

    def request(self, torque_nm: float, velocity: float) -> float:
        """Return what to ask of the motor so that the joint feels a torque."""
        friction = self._coulomb + self._per_torque * abs(torque_nm)
        return torque_nm + friction * tanh(velocity / _SMOOTH_RAD_S) + self._viscous * velocity
