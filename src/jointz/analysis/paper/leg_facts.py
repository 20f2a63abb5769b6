"""Facts about the method ``bayesian``: model, errors, hypotheses and priors."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from jointz.analysis.summary import used_coupling
from jointz.core.channels import pretty_unit
from jointz.core.priors import AnyPrior, LogPrior, NormalPrior, PriorsSpec, SharePrior, Spread
from jointz.identify.walking.coupling import Coupling
from jointz.identify.walking.leg_model import REFERENCE_S
from jointz.identify.walking.responses import LARGEST_RAD, data_length_s
from jointz.report.wording import AT_ONSET, onset_note
from jointz.results.study_analysis import StudyAnalysis

_Facts = dict[str, Any]

#: Lags that are estimated with sensors beside the goniometer.
ENCODER_LAG: Final = "joint_encoder_lag"
GYROSCOPE_LAGS: Final = ("joint_velocity_lag", "shank_velocity_lag")
_LAGS_OF_SENSORS: Final = (ENCODER_LAG, *GYROSCOPE_LAGS)
#: Begin of the names of priors -> lags of the sensors that they are for.
_PRIORS_OF_LAG: Final[Mapping[str, Sequence[str]]] = {
    "goniometer_gain": _LAGS_OF_SENSORS,
    "encoder_": (ENCODER_LAG,),
    "gyroscope_": GYROSCOPE_LAGS,
    "shank_": GYROSCOPE_LAGS,
    "thigh_": ("joint_velocity_lag",),
}
#: Unit at the end of the name of an entry.
_UNIT: Final = re.compile(r"_(hz|s|rad|nm)$")
#: Priors that a rigid coupling has no use for.
_OF_STRAP: Final = (
    *("device_share", "strap_", "skin_share", "half_angle", "softening_power"),
    *("inertia_over_body", "inertia_of_point"),
)


def leg_facts(analysis: StudyAnalysis) -> _Facts:
    """Return the facts about model, errors, estimated quantities and priors."""
    coupling, lags = used_coupling(analysis), lags_of_sensors(analysis)
    window_s = float(analysis.settings.get("window_s") or 0.1)
    error = coupling.error
    scales = [p.scale("stiffness").unit for p in analysis.log_posteriors]
    return {
        "strap": coupling.is_strap,
        "fitted_ms": f"{1e3 * data_length_s(window_s, coupling):g}",
        "moved_deg": f"{np.degrees(LARGEST_RAD):g}",
        "sensors": lags,
        "gyroscopes": not set(lags).isdisjoint(GYROSCOPE_LAGS),
        "error_pct": f"{100 * error.share:g}",
        "error_deg": f"{np.degrees(error.floor_rad):.2g}",
        "twist_sd": coupling.twist_sd,
        **_hypothesis_facts(coupling),
        "scale": f"{scales[0]:g}" if scales and scales[0] else "",
        "inflation": f"{error.sd_inflation:g}" if error.sd_inflation != 1.0 else "",
        "window_ms": f"{1e3 * window_s:g}",
        "reference_ms": f"{1e3 * REFERENCE_S:g}",
        "onset_note": onset_note(AT_ONSET),
        "priors": list(_priors(analysis, coupling, lags)),
    }


def lags_of_sensors(analysis: StudyAnalysis) -> list[str]:
    """Return the lags that were estimated with sensors beside the goniometer."""
    known = {p.name for cell in analysis.cells for p in cell.nuisance}
    return [lag for lag in _LAGS_OF_SENSORS if lag in known]


def _hypothesis_facts(coupling: Coupling) -> _Facts:
    """Return how much follows the curve, how probable it is unless all are alike, and inertias."""
    chances = [h.prior_probability for h in coupling.hypotheses]
    curves = [h for h in coupling.hypotheses if h.follows_cycle]
    share = sum(h.prior_probability for h in curves) / sum(chances)
    return {
        "curve_pct": f"{100 * curves[0].follows_cycle:.0f}",
        "curve_prior_pct": f"{100 * share:.0f}" if len(set(chances)) > 1 else "",
        "inertia_sds": sorted(
            {h.inertia_sd for h in coupling.hypotheses if h.inertia_sd is not None}
        ),
    }


def _priors(analysis: StudyAnalysis, coupling: Coupling, lags: Sequence[str]) -> Iterator[_Facts]:
    """Yield the priors that were used; without a source if the coupling set them."""
    record = analysis.provenance.get("priors")
    spec = PriorsSpec.model_validate(record) if record else coupling.spec(PriorsSpec())
    unused = tuple(begin for begin, of in _PRIORS_OF_LAG.items() if set(of).isdisjoint(lags))
    for name, entry in PriorsSpec.model_fields.items():
        prior = getattr(spec, name)
        stated = prior != getattr(coupling.priors, name)
        left_out = () if stated or coupling.is_strap else _OF_STRAP
        if name.startswith((*unused, *left_out)):
            continue
        yield {
            "name": _UNIT.sub("", name).replace("_", " "),
            "stated": stated,
            "source": pretty_unit(str(entry.description)) if prior == entry.default else "",
            **_numbers(prior),
        }


def _numbers(prior: AnyPrior | Spread) -> _Facts:
    if isinstance(prior, LogPrior):
        return {"median": prior.median, "sd": prior.log_sd, "logit": False}
    if isinstance(prior, SharePrior):
        return {"median": prior.median, "sd": prior.logit_sd, "logit": True}
    return {"mean": prior.mean if isinstance(prior, NormalPrior) else 0.0, "sd": prior.sd}
