"""How precisely planned pulses show a known addition to the joint."""

from collections.abc import Mapping, Sequence

import numpy as np

from jointz.core.protocols.protocol_models import LoadSpec
from jointz.identify.walking.addition import PARTS
from jointz.identify.walking.leg_model import ADDED, AddedPart, LegModel
from jointz.identify.walking.map_fit import MapSearch
from jointz.planning.laboratory import Laboratory
from jointz.planning.predicted_estimates import usual_hypotheses
from jointz.planning.predicted_responses import Design, planned_points, with_usable_samples
from jointz.results.estimates import REACH_95


def addition_notes(
    lab: Laboratory, design: Design, counts: Mapping[str, float], loads: Sequence[LoadSpec]
) -> list[str]:
    """Say how precisely ``jointz verify`` will estimate a load, for a typical leg.

    ``counts`` are pulses of a timing point with the load, and as many without it.
    """
    if len(loads) > 1:
        return ["jointz verify compares one load with none; this protocol has several."]
    (load,) = loads
    if load.mass_kg is not None:
        return [
            f"{load.name}: what the knee feels of a weight depends on the posture, so that its "
            "precision is not planned; that of a band is."
        ]
    reach = _half_widths(lab, design, counts)
    parts = [
        f"{entry.value:g} {unit} within ±{100.0 * reach[name] / entry.value:.0f} %"
        for name, unit in PARTS.items()
        if (entry := load.properties.get(name)) is not None
    ]
    return [f"jointz verify estimates {load.name}, {' and '.join(parts)} (typical leg)."]


def _half_widths(lab: Laboratory, design: Design, counts: Mapping[str, float]) -> dict[str, float]:
    """Return half of the 95 % intervals of the parts of an addition, SI."""
    points = planned_points(design, lab, 0)
    per_variant = {name: n / len(design.variants) for name, n in counts.items()}
    points = [point.with_pulses(per_variant[point.label]) for point in points]
    model = LegModel(
        [*points, *points],
        window_s=design.window_s,
        gravity_stiffness=lab.body(0).gravity_stiffness,
        error=lab.coupling.error,
        added=[None] * len(points)
        + [AddedPart(k, 0.0, (0.0, 0.0, 1.0)) for k in range(len(points))],
    )
    priors = lab.leg_priors(0)
    prior = priors.build(model, usual_hypotheses(model, priors)[0])
    model = with_usable_samples(model, prior.mean)
    covariance = MapSearch(model, prior).covariance_at(prior.mean)
    sds = model.error.sd_inflation * np.sqrt(np.diag(covariance))
    return {
        name: REACH_95 * unit * float(sds[model.layout.shared(place)])
        for name, (place, unit) in zip(PARTS, ADDED.items(), strict=True)
    }
