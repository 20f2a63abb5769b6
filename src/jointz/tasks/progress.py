"""Types of the functions that show progress."""

from collections.abc import Callable

#: Done, of how many, and what is done next.
Progress = Callable[[int, int, str], None]
#: Participant, condition, strides, pulses done, pulses planned.
RunProgress = Callable[[str, str, int, int, int], None]
