"""What every driver keeps of its life: its state, and what may be asked of it in which."""

from jointz.core.errors import DeviceError
from jointz.devices.interface import Lifecycle


class Lived:
    """State of a driver; a driver derives from it and says what happens at each step."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._state = Lifecycle.UNCONFIGURED

    @property
    def state(self) -> Lifecycle:
        """Where the device is in its life."""
        return self._state

    def _require(self, *states: Lifecycle) -> None:
        if self._state not in states:
            expected = " or ".join(state.value for state in states)
            raise DeviceError(self._name, f"expected it {expected}; it is {self._state.value}.")
