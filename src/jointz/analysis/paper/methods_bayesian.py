"""Sentences of a methods section about the method ``bayesian``."""

import re
from collections.abc import Iterator
from typing import Final

import numpy as np

from jointz.analysis.paper.citations import cite
from jointz.analysis.summary import used_coupling
from jointz.core.channels import pretty_unit
from jointz.core.priors import AnyPrior, LogPrior, NormalPrior, PriorsSpec, SharePrior, Spread
from jointz.identify.walking.coupling import Coupling
from jointz.identify.walking.leg_model import REFERENCE_S
from jointz.identify.walking.responses import LARGEST_RAD, data_length_s
from jointz.report.wording import AT_ONSET, format_exact, onset_note
from jointz.results.study_analysis import StudyAnalysis

_STRAPPED_LEG: Final = (
    "The leg and the device strapped to it were modelled as two masses on a spring and a damper, "
    "with stiffness and damping that change over the pulse, stiffness that falls with displacement,"
)
_RIGID_LEG: Final = (
    "The leg and the device, which was assumed to move with the bone, were modelled as one inertia "
    "on a spring and a damper, with stiffness and damping that change over the pulse,"
)
_MODEL: Final = (
    "{leg} a delayed reflex, Coulomb friction on the device, and a goniometer with a "
    "delay and a first-order lag on a mount that may resonate. The model was fitted to the angle "
    "responses of all timing points of a participant together, to the mode of the posterior and "
    "with a normal approximation about it; pulses of different torque over time, of different "
    "size or of different sign were averaged separately and explained by the same parameters. "
    "Data up to {fitted} ms after the commanded onset were used, until the joint had moved by "
    "{moved} degrees or the next heel strike was near."
)
_ERRORS: Final = (
    "The covariance of the errors is that of the prediction at virtual onsets and of an error of "
    "the model of {share} % of the response and {floor} degrees{twist}. Hypotheses, that "
    "stiffness, damping and inertia follow one curve over the gait cycle ({curve}) and that every "
    "timing point is independent{mount}{inertia}, were weighed by Laplace's approximation of "
    "their evidence {evidence}. Impedance was estimated as its logarithm{scale}.{wider}"
)
_TWIST: Final = (
    ", and of a change of the angle reading per torque (SD {sd} rad/(N·m), unless calibrated)"
)
_WIDER: Final = (
    " Standard deviations of the posterior were multiplied by {wider}, because responses simulated "
    "by the model itself showed them too small by so much."
)
_ESTIMANDS: Final = (
    "Stiffness is the mean over {window} ms of torque over displacement along the measured motion, "
    "gravity included; damping is the mean over the same time; inertia is that of leg and device "
    "{reference} ms after the onset. {onset}"
)
_WITHHELD: Final = (
    "No value is given if half of its interval{person} exceeds 50 % of it{median}; if the model "
    "does not explain the responses (chi-square over samples above 2; stiffness and damping); "
    "{inertia}or if a {parts} is needed that is more than {farthest}. Values that are undecided "
    "because of their interval have two one-sided 95 % limits, which are twice as far out, in "
    "logarithms, if the median over the timing points exceeds 50 %."
)
_BY_PERSON: Final = {
    "person": ", or the geometric mean of that and the median over the participant's timing "
    "points,",
    "median": "; for stiffness also if that median does",
    "inertia": "if the inertia is not that of a leg of the participant's mass and height within "
    "two standard deviations of the prior; ",
    "parts": "sensor, strap or reflex",
}
_BY_ITSELF: Final = {
    **dict.fromkeys(("person", "median", "inertia"), ""),
    "parts": "mount of the goniometer, friction or reflex",
}
_MOUNTED: Final = ", each with and without such a mount"
_FARTHEST: Final = "2.5 standard deviations from its prior"
_FARTHEST_OF_SEVERAL: Final = (
    "3.5 standard deviations from its prior, or all of them together beyond 99.9 % of a chi-square "
    "distribution"
)
_SENSORS: Final = (
    "The same fit explains the signals of {names}, each with a lag and a gain of its own{mount}; a "
    "calibrated lag or gain replaced its prior."
)
#: Lag that is estimated with a sensor -> the sensor in words.
_SENSOR_OF_LAG: Final = {
    "joint_encoder_lag": "the encoder of the device",
    "joint_velocity_lag": "gyroscopes on shank and thigh",
    "shank_velocity_lag": "a gyroscope on the shank",
}
#: Begin of the names of priors -> lags of the sensors that they are for.
_PRIORS_OF_LAG: Final = {
    "goniometer_gain": frozenset(_SENSOR_OF_LAG),
    "encoder_": frozenset({"joint_encoder_lag"}),
    "gyroscope_": frozenset({"joint_velocity_lag", "shank_velocity_lag"}),
    "shank_": frozenset({"joint_velocity_lag", "shank_velocity_lag"}),
    "thigh_": frozenset({"joint_velocity_lag"}),
}
_MOUNT: Final = ", and with a mount that resonates for each gyroscope"
#: Unit at the end of the name of an entry.
_UNIT: Final = re.compile(r"_(hz|s|rad|nm)$")
_BY_THE_STUDY: Final = "stated by the study"
_BY_THE_COUPLING: Final = "for a device that moves with the bone"
#: Priors that a rigid coupling has no use for.
_OF_STRAP: Final = (
    *("device_share", "strap_", "skin_share", "half_angle", "softening_power"),
    *("inertia_over_body", "inertia_of_point"),
)


def bayesian_sentences(analysis: StudyAnalysis, window_s: float) -> list[str]:
    """Describe model, errors, estimated quantities and priors."""
    coupling = used_coupling(analysis)
    model = _MODEL.format(
        leg=_STRAPPED_LEG if coupling.is_strap else _RIGID_LEG,
        fitted=f"{1e3 * data_length_s(window_s, coupling):g}",
        moved=f"{np.degrees(LARGEST_RAD):g}",
    )
    estimands = _ESTIMANDS.format(
        window=f"{1e3 * window_s:g}",
        reference=f"{1e3 * REFERENCE_S:g}",
        onset=onset_note(AT_ONSET),
    )
    return [
        model,
        *_sensor_sentences(analysis),
        _error_text(analysis, coupling),
        estimands,
        _priors_sentence(analysis, coupling),
    ]


def _error_text(analysis: StudyAnalysis, coupling: Coupling) -> str:
    """Describe the errors that the fit knows, and the hypotheses."""
    error, twist, scale = coupling.error, coupling.twist_sd, _scale(analysis)
    own_mount = scale and not lags_of_sensors(analysis)
    return _ERRORS.format(
        share=f"{100 * error.share:g}",
        floor=f"{np.degrees(error.floor_rad):.2g}",
        twist=_TWIST.format(sd=format_exact(twist)) if twist else "",
        curve=_curve(coupling),
        mount=_MOUNTED if own_mount else "",
        inertia=_inertia(coupling),
        evidence=cite("evidence"),
        scale=scale,
        wider=_WIDER.format(wider=f"{error.sd_inflation:g}") if error.sd_inflation != 1.0 else "",
    )


def _curve(coupling: Coupling) -> str:
    """Return how much follows the curve, and how probable it is unless all are alike."""
    curves = [h for h in coupling.hypotheses if h.follows_cycle]
    text = f"{100 * curves[0].follows_cycle:.0f} % of the variance"
    if len({h.prior_probability for h in coupling.hypotheses}) == 1:
        return text
    share = sum(h.prior_probability for h in curves) / sum(
        h.prior_probability for h in coupling.hypotheses
    )
    return f"{text}, prior probability {100 * share:.0f} %"


def _inertia(coupling: Coupling) -> str:
    """Return how much the inertia may differ between timing points, by hypothesis."""
    sds = sorted({h.inertia_sd for h in coupling.hypotheses if h.inertia_sd is not None})
    if not sds:
        return ""
    each = " or ".join(map(format_exact, sds))
    return (
        f", each with an inertia that differs between timing points by {each} (SD of its logarithm)"
    )


def _sensor_sentences(analysis: StudyAnalysis) -> Iterator[str]:
    lags = lags_of_sensors(analysis)
    if lags:
        names = " and ".join(_SENSOR_OF_LAG[lag] for lag in lags)
        mount = _MOUNT if set(lags) - {"joint_encoder_lag"} else ""
        yield _SENSORS.format(names=names, mount=mount)


def _scale(analysis: StudyAnalysis) -> str:
    """Say on which scale stiffness was estimated, if not as its logarithm."""
    units = [p.scale("stiffness").unit for p in analysis.log_posteriors]
    known = units and units[0]
    return f", stiffness K as asinh(K / {units[0]:g} N·m/rad)" if known else ""


def lags_of_sensors(analysis: StudyAnalysis) -> list[str]:
    """Return the lags that were estimated with sensors beside the goniometer."""
    found = {p.name for cell in analysis.cells for p in cell.nuisance}
    return [lag for lag in _SENSOR_OF_LAG if lag in found]


def decision_sentence(analysis: StudyAnalysis) -> str:
    """Describe when no value is given."""
    words = _BY_PERSON if used_coupling(analysis).is_strap else _BY_ITSELF
    several = bool(lags_of_sensors(analysis))
    return _WITHHELD.format(farthest=_FARTHEST_OF_SEVERAL if several else _FARTHEST, **words)


def _priors_sentence(analysis: StudyAnalysis, coupling: Coupling) -> str:
    """List the priors that were used, with their sources."""
    record = analysis.provenance.get("priors")
    lags = lags_of_sensors(analysis)
    unused = tuple(begin for begin, of in _PRIORS_OF_LAG.items() if of.isdisjoint(lags))
    spec = PriorsSpec.model_validate(record) if record else coupling.spec(PriorsSpec())
    each = "; ".join(_priors(spec, unused, coupling))
    return (
        "Priors, SI and rad, are normal for the logarithm (median, SD of the logarithm), for the "
        "logit of shares (median, SD of the logit) or for the quantity itself (mean ± SD); in "
        f"brackets unit, meaning and source: {each}."
    )


def _priors(spec: PriorsSpec, unused: tuple[str, ...], coupling: Coupling) -> Iterator[str]:
    for name, entry in PriorsSpec.model_fields.items():
        prior = getattr(spec, name)
        stated = prior != getattr(coupling.priors, name)
        left_out = () if stated or coupling.is_strap else _OF_STRAP
        if name.startswith((*unused, *left_out)):
            continue
        usual = entry.description if prior == entry.default else _BY_THE_COUPLING
        source = _BY_THE_STUDY if stated else usual
        words = _UNIT.sub("", name).replace("_", " ")
        yield f"{words} {_numbers(prior)} ({pretty_unit(str(source))})"


def _numbers(prior: AnyPrior | Spread) -> str:
    if isinstance(prior, LogPrior):
        return f"{format_exact(prior.median)}, {format_exact(prior.log_sd)}"
    if isinstance(prior, SharePrior):
        return f"{format_exact(prior.median)}, {format_exact(prior.logit_sd)} (logit)"
    mean = prior.mean if isinstance(prior, NormalPrior) else 0.0
    return f"{format_exact(mean)} ± {format_exact(prior.sd)}"
