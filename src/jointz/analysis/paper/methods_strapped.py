"""Sentences of a methods section about the method ``strapped``."""

import re
from collections.abc import Iterator
from typing import Final

from jointz.analysis.paper.citations import cite
from jointz.core.priors import AnyPrior, LogPrior, NormalPrior, PriorsSpec, SharePrior, Spread
from jointz.identify.strapped.coupling import STRAP
from jointz.report.wording import AT_ONSET, format_exact, onset_note, pretty_unit
from jointz.results.study_analysis import StudyAnalysis

_MODEL: Final = (
    "The leg and the device strapped to it were modelled as two masses on a spring and a damper, "
    "with stiffness and damping that change over the pulse, stiffness that falls with "
    "displacement, a delayed reflex, Coulomb friction on the device, and a goniometer with a "
    "delay and a first-order lag on a mount that may resonate. The model was fitted to the angle "
    "responses of all timing points of a participant together, to the mode of the posterior and "
    "with a normal approximation about it; pulses of different torque over time, of different "
    "size or of different sign were averaged separately and explained by the same parameters. "
    "Data up to {fitted} ms after the commanded onset were used, until the joint had moved by 18 "
    "degrees."
)
_ERRORS: Final = (
    "The covariance of the errors is that of the prediction at virtual onsets and of an error of "
    "the model of 1.5 % of the response and 0.02 degrees. Hypotheses, that stiffness and damping "
    "follow one curve over the gait cycle (90 % of the variance) and that every timing point is "
    "independent{mount}, were weighed by Laplace's approximation of their evidence {evidence}. "
    "Impedance was estimated as its logarithm{scale}. Standard deviations of the posterior were "
    "multiplied by {wider}, because responses simulated by the model itself showed them too small "
    "by so much."
)
_ESTIMANDS: Final = (
    "Stiffness is the mean over {window} ms of torque over displacement along the measured motion, "
    "gravity included; damping is the mean over the same time; inertia is that of leg and device "
    "60 ms after the onset. {onset}"
)
_DECIDED: Final = (
    "No value is given if half of its interval, or the geometric mean of that and the median over "
    "the participant's timing points, exceeds 50 % of it; for stiffness also if that median does; "
    "if the model does not explain the responses (chi-square over samples above 2; stiffness and "
    "damping); if the inertia is not that of a leg of the participant's mass and height within two "
    "standard deviations of the prior; or if a sensor, strap or reflex is needed that is more than "
    "{farthest}. Values that are undecided because of their interval "
    "have two one-sided 95 % limits, which are twice as far out, in logarithms, if the median over "
    "the timing points exceeds 50 %."
)
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


def strapped_sentences(analysis: StudyAnalysis, window_s: float) -> list[str]:
    """Describe model, errors, estimated quantities and priors."""
    fitted = 1e3 * max(0.2, window_s)
    return [
        _MODEL.format(fitted=f"{fitted:g}"),
        *_sensor_sentences(analysis),
        _ERRORS.format(
            evidence=cite("evidence"),
            wider=f"{STRAP.error.wider:g}",
            scale=_scale(analysis),
            mount=_MOUNTED if _scale(analysis) and not lags_of_sensors(analysis) else "",
        ),
        _ESTIMANDS.format(window=f"{1e3 * window_s:g}", onset=onset_note(AT_ONSET)),
        _priors_sentence(analysis),
    ]


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


def strapped_decision(analysis: StudyAnalysis) -> str:
    """Describe when no value is given."""
    several = bool(lags_of_sensors(analysis))
    return _DECIDED.format(farthest=_FARTHEST_OF_SEVERAL if several else _FARTHEST)


def _priors_sentence(analysis: StudyAnalysis) -> str:
    """List the priors that were used, with their sources."""
    record = analysis.provenance.get("priors")
    lags = lags_of_sensors(analysis)
    unused = tuple(begin for begin, of in _PRIORS_OF_LAG.items() if of.isdisjoint(lags))
    each = "; ".join(_priors(PriorsSpec.model_validate(record or {}), unused))
    return (
        "Priors, SI and rad, are normal for the logarithm (median, SD of the logarithm), for the "
        "logit of shares (median, SD of the logit) or for the quantity itself (mean ± SD); in "
        f"brackets unit, meaning and source: {each}."
    )


def _priors(spec: PriorsSpec, unused: tuple[str, ...]) -> Iterator[str]:
    for name, entry in PriorsSpec.model_fields.items():
        if name.startswith(unused):
            continue
        prior = getattr(spec, name)
        source = entry.description if prior == entry.default else _BY_THE_STUDY
        words = _UNIT.sub("", name).replace("_", " ")
        yield f"{words} {_numbers(prior)} ({pretty_unit(str(source))})"


def _numbers(prior: AnyPrior | Spread) -> str:
    if isinstance(prior, LogPrior):
        return f"{format_exact(prior.median)}, {format_exact(prior.log_sd)}"
    if isinstance(prior, SharePrior):
        return f"{format_exact(prior.median)}, {format_exact(prior.logit_sd)} (logit)"
    mean = prior.mean if isinstance(prior, NormalPrior) else 0.0
    return f"{format_exact(mean)} ± {format_exact(prior.sd)}"
