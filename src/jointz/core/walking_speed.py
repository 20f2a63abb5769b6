"""Effects of walking speed."""

from math import sqrt

#: The dissertation's; stride times that are assumed or drawn belong to it, m/s.
REFERENCE_SPEED_M_S = 1.2
#: Where people walk: below it they stop between steps, above it they run.
SLOWEST_M_S, FASTEST_M_S = 0.3, 2.2


def stride_time_ratio(speed_m_s: float) -> float:
    """Return the stride time at a speed over that at 1.2 m/s.

    Adults keep the walk ratio, step length over step rate, nearly constant (Bogen et al. 2018,
    Gait & Posture 61, 479, doi 10.1016/j.gaitpost.2018.02.019). Speed is the product of the two,
    so the stride time goes with speed to the power -1/2. Misleads in very slow walking, where the
    walk ratio grows and strides are longer in time than this.
    """
    return sqrt(REFERENCE_SPEED_M_S / speed_m_s)
