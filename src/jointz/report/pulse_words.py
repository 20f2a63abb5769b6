"""What a report calls the pulses of a study: what moved, in which unit, and from when."""

from typing import Final

from jointz.identify.preparation.sources import usual_source
from jointz.results.study_analysis import StudyAnalysis

#: Letters of the units of an angle; no unit of a torque has them.
_OF_ANGLES: Final = ("rad", "deg", "°", "turn", "rev")


def pulse_names(analysis: StudyAnalysis) -> tuple[str, str]:
    """Return what one pulse is called, and what several are."""
    if not onset_is_commanded(analysis):
        return "step of the angle", "steps of the angle"
    if pulse_unit(analysis) == "rad":
        return "pulse of the reference angle", "pulses of the reference angle"
    return "pulse of torque", "pulses of torque"


def pulse_unit(analysis: StudyAnalysis) -> str:
    """Return the unit of the amplitudes: that of what the pulses were read off."""
    source = _source(analysis)
    if source == "reference":
        study = analysis.provenance.get("study") or {}
        unit = study["channels"]["reference"].get("unit") or "rad"
        return "rad" if any(letters in unit for letters in _OF_ANGLES) else "N·m"
    return "rad" if source == "angle" else "N·m"


def onset_is_commanded(analysis: StudyAnalysis) -> bool:
    """Tell whether pulses begin with a command; steps of the angle are found in the angle."""
    return _source(analysis) != "angle"


def window_start(analysis: StudyAnalysis) -> str:
    """Return from when on the response to a pulse is taken."""
    if onset_is_commanded(analysis):
        return "the commanded onset"
    return "where the speed of the filtered angle first exceeds a tenth of its peak"


def _source(analysis: StudyAnalysis) -> str:
    """Return where pulses were read off: as the study says, or what is usual for what it has."""
    study = analysis.provenance.get("study") or {}
    if told := (study.get("perturbations") or {}).get("source"):
        return str(told)
    table = any(r.get("perturbations") for r in study.get("recordings") or ())
    channels = study.get("channels") or {}
    return usual_source(table=table, command="command" in channels or "reference" not in channels)
