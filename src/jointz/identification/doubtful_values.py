"""Values of a joint that a reflex in the record biases: printed as doubtful, with a warning."""

from dataclasses import replace
from typing import Any

from jointz.results.series.second_order_verdict import SecondOrderCheck

DOUBTFUL = "doubtful"


def with_doubtful_values(fit: Any) -> Any:
    """Return a fit with the values of K, B and J that are undecided because of a reflex."""
    check = getattr(fit, "check", None)
    reflex = isinstance(check, SecondOrderCheck) and check.finding == "reflex"
    if not reflex or fit.status != "undecided":
        return fit
    parameters = tuple(
        p if p.unbounded is None else replace(p, value=p.unbounded, status=DOUBTFUL)
        for p in fit.parameters
    )
    warnings = tuple(w.replace("undecided:", f"{DOUBTFUL}:", 1) for w in fit.warnings)
    return replace(fit, parameters=parameters, status=DOUBTFUL, warnings=warnings)
