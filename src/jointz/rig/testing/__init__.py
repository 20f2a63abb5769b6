"""For tests of drivers and of what uses them: contract tests and scripted devices."""

from jointz.rig.testing.contract_tests import ActuatorContract, SensorContract
from jointz.rig.testing.scripted import Deviation, ScriptedActuator, ScriptedSensor, Signal, replay

__all__ = [
    "ActuatorContract",
    "Deviation",
    "ScriptedActuator",
    "ScriptedSensor",
    "SensorContract",
    "Signal",
    "replay",
]
