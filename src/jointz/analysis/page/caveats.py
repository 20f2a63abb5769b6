"""Caveats that every reader of a report should know."""

from collections.abc import Mapping
from typing import Final

from jointz.analysis.summary import used_coupling
from jointz.core.method_names import WITH_POSTERIOR
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
_ANGLE: Final = (
    "The model is fitted to the angle.",
    "VAF of the method bayesian refers to the angle, that of the others to the torque. The two are "
    "not comparable, and neither measures accuracy.",
)
_UNDECIDED: Final = (
    "Undecided is a result.",
    "No value is given if the interval is too wide, {inertia}or if the model does not explain the "
    "responses. The section on undecided values says why, and what would help. One-sided 95 % "
    "limits of an undecided value are in estimates.csv.",
)
_COVERED: Final = (
    "Intervals cover the modelled sources of error only.",
    "These are differences between strides, {sources}, friction, the lag, a reflex, and the "
    "priors, which provenance.json lists. Not in the model are {missing}, and a wrong gain of a "
    "goniometer that is the only sensor of the motion: a joint encoder or gyroscopes would show "
    "it.",
)
_OF_STRAP: Final[Mapping[str, str]] = {
    "sources": "strap and tissue, stiffness that falls with displacement",
    "missing": "a device that is coupled rigidly",
    "inertia": "if the inertia is not that of such a leg, ",
}
_OF_RIGID_COUPLING: Final[Mapping[str, str]] = {
    "sources": "the mount of the goniometer",
    "missing": "a strap or tissue between device and bone, stiffness that falls with displacement",
    "inertia": "",
}


def _of_posterior(analysis: StudyAnalysis) -> tuple[tuple[str, str], ...]:
    words = _OF_STRAP if used_coupling(analysis).is_strap else _OF_RIGID_COUPLING
    own = ((head, text.format_map(words)) for head, text in (_COVERED, _UNDECIDED))
    return _ANGLE, _JOINT_AND_DEVICE, *own, _DISPLACEMENT


def caveats(analysis: StudyAnalysis) -> tuple[tuple[str, str], ...]:
    """Return heading and text of each caveat that applies to an analysis."""
    words = subjects(analysis)
    if words.bench:
        return _BENCH if words.loads else _AT_REST
    if any(c.method in WITH_POSTERIOR for c in analysis.cells):
        return _of_posterior(analysis)
    return _WALKING
