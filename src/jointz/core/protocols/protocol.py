"""A protocol file (TOML) with all its checks.

A protocol says what an experiment does: conditions in their order, pulses or
references, rates, limits. Which device does it is not its business. Only shape,
vocabulary and consistency are checked; the file is read by :mod:`jointz.io.protocols`.
"""

from functools import partial

from jointz.core.checked_model import Check
from jointz.core.protocols import protocol_calibration_checks as calibrations
from jointz.core.protocols import protocol_checks as whole
from jointz.core.protocols import protocol_limit_checks as limits
from jointz.core.protocols.protocol_models import ProtocolFields, checked_name


class Protocol(ProtocolFields):
    """A protocol file, schema version 1."""

    def checks(self) -> tuple[Check, ...]:
        """Return the checks between the parts."""
        checks = (
            *whole.PROTOCOL_CHECKS,
            *limits.PROTOCOL_LIMIT_CHECKS,
            *calibrations.PROTOCOL_CALIBRATION_CHECKS,
        )
        of_whole = (partial(check, self) for check in checks)
        conditions = self.__dict__.get("conditions", ())  # none in a draft that lacks them
        of_conditions = (
            partial(check, self, i)
            for i in range(len(conditions))
            for check in (
                *whole.CONDITION_CHECKS,
                *limits.CONDITION_LIMIT_CHECKS,
                *calibrations.CONDITION_CALIBRATION_CHECKS,
            )
        )
        return partial(checked_name, self), *of_whole, *of_conditions

    @property
    def expected_duration_s(self) -> float:
        """Time that the conditions of one participant or load take, s.

        Strides are taken to last 1.1 s at 1.2 m/s and gaps their mean; pauses between
        conditions, and pulses that have to be done again, come on top.
        """
        return sum(whole.expected_duration_s(self, condition) for condition in self.conditions)
