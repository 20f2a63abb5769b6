"""What every reader of a report should know, in plain words."""

from typing import Final

from jointz.report.subjects import subjects
from jointz.results.study_analysis import StudyAnalysis

_VAF_CAVEAT: Final = (
    "VAF is not accuracy.",
    "The variance accounted for says how well the model follows the average response, not how "
    "close stiffness, damping and inertia are to the truth. A lag of a few milliseconds or a "
    "wrong baseline can spoil all three while VAF stays near 99 %.",
)
_WALKING: Final = (
    _VAF_CAVEAT,
    (
        "Inertia is that of joint and device together.",
        "Everything that moves with the joint is in it: limb, brace and what hangs on them, unless "
        "a calibrated device inertia was subtracted.",
    ),
    (
        "Intervals from resampled pulses see only what differs from pulse to pulse.",
        "Errors common to all pulses never show in them: a lag between sensor and joint, a shift "
        "between the unperturbed and the perturbed condition, the gain of the torque. Give them "
        "under [calibration] with their standard deviation to have them in the intervals.",
    ),
    (
        "The values belong to the displacement and the window they were measured with.",
        "Large displacements are no longer a small disturbance, reflexes may act within the "
        "window, and stiffness that changes inside it is averaged.",
    ),
)
_BENCH: Final = (
    _VAF_CAVEAT,
    (
        "Inertia is that of the load and of all that moves with it.",
        "The bench's own is in it, and so are its stiffness and damping, unless a calibrated "
        "intrinsic impedance was subtracted.",
    ),
    (
        "Intervals do not know the gain of the torque.",
        "Stiffness, damping and inertia follow an error of the torque's gain one to one. Give the "
        "gain under [calibration] with its standard deviation to have it in the intervals.",
    ),
    (
        "A load is taken to be linear.",
        "Friction other than a constant one against the motion, play and stiffness that changes "
        "with the deflection are averaged into the three numbers.",
    ),
)
_AT_REST: Final = (
    _VAF_CAVEAT,
    _WALKING[1],
    (
        "The values belong to the posture, the muscles and the displacement they were measured "
        "with.",
        "A joint is stiffer where muscles are active and against small displacements, and reflexes "
        "act from some 40 ms after an onset.",
    ),
    _BENCH[2],
)
_RECOMMENDED: Final = (
    (
        "The fit is that of the angle.",
        "VAF of the recommended method is that of the angle, of the others that of the torque: the "
        "two are not to be compared, and neither is accuracy.",
    ),
    _WALKING[1],
    (
        "Intervals hold what the method can know of.",
        "That is strides that differ, the lag, the friction model, the calibration and models "
        "that explain the responses as well, a reflex among them. What no model in it has, such as "
        "a gain that nobody calibrated or stiffness that falls with the displacement, is not.",
    ),
    (
        "Undecided is an answer.",
        "Where the interval reaches further than half the value, or an upper limit is no small "
        "one, no value is given. The section on what stands behind the estimates says why, and "
        "what would decide it.",
    ),
    _WALKING[3],
)


def caveats(analysis: StudyAnalysis) -> tuple[tuple[str, str], ...]:
    """Return what every reader of a report should know, in plain words."""
    words = subjects(analysis)
    if words.bench:
        return _BENCH if words.loads else _AT_REST
    return _RECOMMENDED if any(c.budget for c in analysis.cells) else _WALKING
