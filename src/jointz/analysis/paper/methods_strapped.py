"""Sentences of a methods section about the method ``strapped``."""

from typing import Final

from jointz.analysis.paper.citations import cite

_MODEL: Final = (
    "The leg and the device strapped to it were modelled as two masses on a spring and a damper, "
    "with stiffness and damping that change over the pulse, stiffness that falls with "
    "displacement, a delayed reflex, Coulomb friction on the device, and a goniometer with a delay "
    "and a first-order lag. The model was fitted to the angle responses of all timing points of a "
    "participant together, to the mode of the posterior and with a normal approximation about it; "
    "pulses of different torque were averaged separately. Data up to {fitted} ms after the "
    "commanded onset were used, until the joint had moved by 18 degrees."
)
_ERRORS: Final = (
    "The covariance of the errors is that of the prediction at virtual onsets and of an error of "
    "the model of 1.5 % of the response and 0.02 degrees. Two hypotheses, that stiffness and "
    "damping follow one curve over the gait cycle and that every timing point is independent, were "
    "weighed by Laplace's approximation of their evidence {evidence}. The priors are in "
    "provenance.json."
)
_ESTIMANDS: Final = (
    "Stiffness is the mean over {window} ms of torque over displacement along the measured motion, "
    "gravity included; damping is the mean over the same time; inertia is that of leg and device."
)
_DECIDED: Final = (
    "No value is given if half of its interval, or the geometric mean of that and the median over "
    "the participant's timing points, exceeds 50 % of it; for stiffness also if that median does; "
    "if the model does not explain the responses (chi-square over samples above 2; stiffness and "
    "damping); if the inertia is not that of a leg of the participant's mass and height within two "
    "standard deviations of the prior; or if a sensor, strap or reflex is needed that is more than "
    "2.5 standard deviations from its prior."
)


def strapped_sentences(window_s: float) -> list[str]:
    """Describe model, errors and estimated quantities."""
    fitted = 1e3 * max(0.2, window_s)
    return [
        _MODEL.format(fitted=f"{fitted:g}"),
        _ERRORS.format(evidence=cite("evidence")),
        _ESTIMANDS.format(window=f"{1e3 * window_s:g}"),
    ]


def strapped_decision() -> str:
    """Describe when no value is given."""
    return _DECIDED
