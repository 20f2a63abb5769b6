"""Names of methods and baselines that other parts of jointz refer to."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

#: Asked for, it stands for the right method of the study; no estimate carries it.
RECOMMENDED: Final = "recommended"
#: Walking: a physical model of leg, device and sensors, fitted by Bayes' rule.
BAYESIAN: Final = "bayesian"
#: The same with this coupling of device and leg, whatever the study states; in results that were
#: written before, ``strapped`` is that method and ``rigid`` another one.
STRAPPED: Final = "strapped"
RIGID: Final = "rigid"
COUPLING_OF: Final = {STRAPPED: "strap", RIGID: "rigid"}
#: Methods of results with a posterior of each person.
WITH_POSTERIOR: Final = frozenset({BAYESIAN, STRAPPED})
DISSERTATION: Final = "dissertation"
MATCHED_STRIDES: Final = "matched_strides"
FULL_RECORD: Final = "full_record"
#: Method of single pulses on a bench.
PULSE_LIKELIHOOD: Final = "pulse_likelihood"

#: Names in results that were written before -> present ones.
FORMER_NAMES: Final = {"recommended": RIGID}

#: Method in results -> the one that it is today, by the name under which results are compared.
PRESENT_NAMES: Final = {**FORMER_NAMES, STRAPPED: BAYESIAN}

#: Baseline of the methods that predict the unperturbed motion.
PREDICTED: Final = "predicted"


def present_settings(settings: Mapping[str, Any], methods: Iterable[str]) -> Mapping[str, Any]:
    """Return the settings of results by these methods as they would be written today."""
    if STRAPPED not in methods:
        return settings
    return {**settings, "method": BAYESIAN, "coupling": COUPLING_OF[STRAPPED]}


def method_called(name: str) -> str:
    """Return the method that is called by a name; a coupling stands for the method of walking."""
    return BAYESIAN if name in COUPLING_OF else name
