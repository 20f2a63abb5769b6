"""Turns errors that come out of a driver into errors of its device."""

import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from jointz.core.errors import DeviceError, JointzError


@contextmanager
def drivers_answer_for(drivers: Mapping[str, object]) -> Iterator[None]:
    """Make an error that came out of a driver one of its device.

    Drivers raise what their bus and their libraries raise. Looking for the driver in the
    traceback costs the loop nothing, which a check around every call would.
    """
    try:
        yield
    except JointzError:
        raise
    except Exception as exc:
        name = _raised_by(exc, drivers)
        if name is None:
            raise
        raise DeviceError(
            name, f"its driver raised {type(exc).__name__}: {exc}. Check device and cable."
        ) from exc


def _raised_by(exc: Exception, drivers: Mapping[str, object]) -> str | None:
    for frame, _ in traceback.walk_tb(exc.__traceback__):
        caller = frame.f_locals.get("self")
        for name, driver in drivers.items():
            if caller is driver:
                return name.replace("_", " ")
    return None
