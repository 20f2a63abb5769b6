"""Printed numbers of chapter II: the series-elastic knee exoskeleton on the bench."""

from typing import Final

from jointz.reference import Printed

# --- 2.3.1: bandwidth and intrinsic impedance ----------------------------------------------------

_RESOLUTION = (
    "may be limited by spectral resolution: a 30-lag Blackman-Tukey window at 1 kHz reads 10 Hz as "
    "26.9 Hz and 17.2 Hz as 29.5 Hz"
)
BANDWIDTH_20_NM: Final = Printed(26.8, None, "Hz", "2.3.1", _RESOLUTION)
BANDWIDTH_40_NM: Final = Printed(
    17.2, None, "Hz", "2.3.1", f"the discussion says 17.6 Hz; {_RESOLUTION}"
)
INTRINSIC_STIFFNESS: Final = Printed(0.388, 0.194, "N*m/rad", "2.3.1")
INTRINSIC_DAMPING: Final = Printed(0.163, 0.0130, "N*m*s/rad", "2.3.1")
INTRINSIC_INERTIA: Final = Printed(0.00100, 2.65e-5, "kg*m^2", "2.3.1")
