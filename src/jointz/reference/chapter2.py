"""Printed numbers of chapter II: the series-elastic knee exoskeleton on the bench."""

from typing import Final

from jointz.reference import OtherDevice, Printed

# --- 2.3.1: bandwidth and intrinsic impedance ----------------------------------------------------

_RESOLUTION = (
    "may be limited by spectral resolution: a 30-lag Blackman-Tukey window at 1 kHz reads 10 Hz as "
    "26.9 Hz and 17.2 Hz as 29.5 Hz"
)
BANDWIDTH_20_NM: Final = Printed(26.8, None, "Hz", "2.3.1", _RESOLUTION)
BANDWIDTH_40_NM: Final = Printed(
    17.2, None, "Hz", "2.3.1", f"the discussion says 17.6 Hz; {_RESOLUTION}"
)
BANDWIDTH_MINIMUM: Final = Printed(
    17.6, None, "Hz", "2.4", "the results (2.3.1) say 17.2 Hz for the 40 N*m signal"
)
INTRINSIC_STIFFNESS: Final = Printed(0.388, 0.194, "N*m/rad", "2.3.1")
INTRINSIC_DAMPING: Final = Printed(0.163, 0.0130, "N*m*s/rad", "2.3.1")
INTRINSIC_INERTIA: Final = Printed(0.00100, 2.65e-5, "kg*m^2", "2.3.1")

# --- 2.4.1: other devices ------------------------------------------------------------------------

OTHER_DEVICES: Final = (
    OtherDevice("stiffness error", 5.0, 5.0, "%", (2,), "2.4.1", "reported average"),
    OtherDevice("stiffness error", 15.0, 15.0, "%", (54,), "2.4.1", "for 13 of 18 trials"),
    OtherDevice("inertia error", 15.0, 15.0, "%", (54,), "2.4.1", "for 16 of 18 trials; Tucker"),
)
