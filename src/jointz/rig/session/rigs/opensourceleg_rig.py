"""The simulated exoskeleton for scripts that are written for opensourceleg."""

from typing import Any

from jointz.core.clock import RealClock
from jointz.rig.devices.opensourceleg_actuator import as_opensourceleg
from jointz.rig.session.rigs.rig_settings import RigSettings, open_rig


def simulated_opensourceleg_actuator(
    *,
    preset: str = "nominal",
    seed: int = 1,
    participant: int = 0,
    sample_rate_hz: float = 500.0,
    tag: str = "exoskeleton",
) -> Any:
    """Return the exoskeleton on a simulated walking person, in real time, as opensourceleg's.

    Parameters
    ----------
    preset : str
        ``clean``, ``nominal``, ``hard``, ``anthropometric`` or ``realistic``.
    seed : int
        Of the population.
    participant : int
        Which of them wears it, from 0.
    sample_rate_hz : float, Hz
        Of the actuator.
    tag : str
        Its name for opensourceleg.

    Returns
    -------
    opensourceleg.actuators.base.ActuatorBase
        Not started; see :func:`~jointz.rig.devices.opensourceleg_actuator.as_opensourceleg` for
        its units and for what it cannot do.

    Raises
    ------
    DataError
        When there is no such preset.
    DeviceError
        When opensourceleg is not installed.
    """
    clock = RealClock()
    rig = open_rig(RigSettings("sim", preset, seed, sample_rate_hz), participant)
    devices = rig.open("opensourceleg", worn=True, segment=0, clock=clock)
    if devices.actuator is None:
        raise TypeError("expected a rig with an actuator.")
    return as_opensourceleg(devices.actuator, tag=tag, clock=clock)
