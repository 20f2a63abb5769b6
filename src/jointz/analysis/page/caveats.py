"""Caveats that every reader of a report should know."""

from typing import Final

from jointz.core.method_names import STRAPPED
from jointz.report.subjects import subjects
from jointz.results.study_analysis import StudyAnalysis

_VAF: Final = (
    "VAF is not accuracy.",
    "The variance accounted for measures how closely the model follows the average response, not "
    "how close stiffness, damping and inertia are to the truth. A lag of a few milliseconds or a "
    "wrong baseline can bias all three while VAF stays near 99 %.",
)
_JOINT_AND_DEVICE: Final = (
    "Inertia is that of joint and device together.",
    "It includes everything that moves with the joint: limb, brace and what is attached to them, "
    "unless a calibrated device inertia was subtracted.",
)
_DISPLACEMENT: Final = (
    "The values belong to the displacement and the window of the measurement.",
    "Large displacements are no longer a small disturbance, reflexes may act within the window, "
    "and stiffness that changes inside it is averaged.",
)
_GAIN: Final = (
    "Intervals do not include the gain of the torque.",
    "An error of the torque's gain changes stiffness, damping and inertia in proportion. To "
    "include it in the intervals, give the gain under [calibration] with its standard deviation.",
)
_WALKING: Final = (
    _VAF,
    _JOINT_AND_DEVICE,
    (
        "Intervals from resampled pulses include only differences from pulse to pulse.",
        "They do not include errors common to all pulses: a lag between sensor and joint, a shift "
        "between the unperturbed and the perturbed condition, the gain of the torque. To include "
        "these, give them under [calibration] with their standard deviation.",
    ),
    _DISPLACEMENT,
)
_BENCH: Final = (
    _VAF,
    (
        "Inertia is that of the load and of everything that moves with it.",
        "It includes the bench's own inertia. Stiffness and damping include the bench's, too, "
        "unless a calibrated intrinsic impedance was subtracted.",
    ),
    _GAIN,
    (
        "The load is assumed to be linear.",
        "Friction other than a constant one against the motion, play, and stiffness that changes "
        "with the deflection are averaged into the three numbers.",
    ),
)
_AT_REST: Final = (
    _VAF,
    _JOINT_AND_DEVICE,
    (
        "The values belong to the posture, the muscle activity and the displacement of the "
        "measurement.",
        "A joint is stiffer when muscles are active and against small displacements. Reflexes act "
        "from about 40 ms after an onset.",
    ),
    _GAIN,
)
_RIGID: Final = (
    (
        "The model is fitted to the angle.",
        "VAF of the methods strapped and rigid refers to the angle, that of the others to the "
        "torque. The two are not comparable, and neither measures accuracy.",
    ),
    _JOINT_AND_DEVICE,
    (
        "Intervals cover the modelled sources of error only.",
        "These are differences between strides, the lag, the friction model, the calibration, and "
        "alternative models that explain the responses as well, such as a reflex. Unmodelled "
        "errors, such as an uncalibrated gain or stiffness that falls with the displacement, are "
        "not included.",
    ),
    (
        "Undecided is a result.",
        "No value is given if the interval reaches further than half the value, or if an upper "
        "limit is too large to be informative. The section on undecided values says why, and which "
        "measurement would decide it.",
    ),
    _DISPLACEMENT,
)
_STRAPPED: Final = (
    _RIGID[0],
    _JOINT_AND_DEVICE,
    (
        "Intervals cover the modelled sources of error only.",
        "These are differences between strides, strap and tissue, friction, the lag, a reflex, "
        "stiffness that falls with displacement, and the priors, which provenance.json lists. Not "
        "in the model are a device that is coupled rigidly, and a wrong gain of a goniometer that "
        "is the only sensor of the motion: a joint encoder or gyroscopes would show it.",
    ),
    (
        "Undecided is a result.",
        "No value is given if the interval is too wide, if the model does not explain the "
        "responses, or if the inertia is not that of such a leg. The section on undecided values "
        "says why, and what would decide it. One-sided 95 % limits of an "
        "undecided value are in estimates.csv.",
    ),
    _DISPLACEMENT,
)


def caveats(analysis: StudyAnalysis) -> tuple[tuple[str, str], ...]:
    """Return heading and text of each caveat that applies to an analysis."""
    words = subjects(analysis)
    if words.bench:
        return _BENCH if words.loads else _AT_REST
    if any(c.method == STRAPPED for c in analysis.cells):
        return _STRAPPED
    return _RIGID if any(c.budget for c in analysis.cells) else _WALKING
