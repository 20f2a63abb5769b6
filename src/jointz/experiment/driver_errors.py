"""Whose error it is: a device's, where it came out of its driver."""

import traceback
from collections.abc import Mapping

from jointz.core.errors import DeviceError


def driver_error(exc: Exception, drivers: Mapping[str, object]) -> DeviceError | None:
    """Return an error as one of the device whose driver raised it; None where none did.

    Drivers raise what their bus and their libraries raise. Looking for the driver in the
    traceback costs the loop nothing, which a check around every call would.

    Parameters
    ----------
    exc : Exception
        As caught.
    drivers : mapping of str to object
        Every driver by its name for messages.
    """
    for frame, _ in traceback.walk_tb(exc.__traceback__):
        caller = frame.f_locals.get("self")
        for name, driver in drivers.items():
            if caller is driver:
                what = f"its driver raised {type(exc).__name__}: {exc}"
                return DeviceError(name.replace("_", " "), f"{what}. Check device and cable.")
    return None
