"""Words for the pulses of a study: what moved, in which unit, and where responses begin."""

from typing import Final

from jointz.identify.preparation.sources import usual_source
from jointz.report.subjects import study_spec
from jointz.results.study_analysis import StudyAnalysis

#: Letters of the units of an angle; no unit of a torque has them.
_ANGLE_UNITS: Final = ("rad", "deg", "°", "turn", "rev")


def pulse_names(analysis: StudyAnalysis) -> tuple[str, str]:
    """Return the name of one pulse, and of several."""
    if not onset_is_commanded(analysis):
        return "step of the angle", "steps of the angle"
    if pulse_unit(analysis) == "rad":
        return "pulse of the reference angle", "pulses of the reference angle"
    return "pulse of torque", "pulses of torque"


def pulse_unit(analysis: StudyAnalysis) -> str:
    """Return the unit of the amplitudes, which is that of the source of the pulses."""
    source = _source(analysis)
    if source != "reference":
        return "rad" if source == "angle" else "N·m"
    unit = study_spec(analysis).channels["reference"].unit or "rad"
    return "rad" if any(letters in unit for letters in _ANGLE_UNITS) else "N·m"


def onset_is_commanded(analysis: StudyAnalysis) -> bool:
    """Return whether pulses begin with a command; steps of the angle are found in the angle."""
    return _source(analysis) != "angle"


def window_start(analysis: StudyAnalysis) -> str:
    """Return the beginning of the window of a response."""
    if onset_is_commanded(analysis):
        return "the commanded onset"
    return "where the speed of the filtered angle first exceeds a tenth of its peak"


def _source(analysis: StudyAnalysis) -> str:
    """Return the source of the pulses: that of the study, else the default for its channels."""
    study = study_spec(analysis)
    if study.perturbations.source:
        return study.perturbations.source
    table = any(r.perturbations for r in study.recordings)
    trigger = "trigger" in study.channels
    command = "command" in study.channels or not (trigger or "reference" in study.channels)
    return usual_source(table=table, command=command, trigger=trigger)
