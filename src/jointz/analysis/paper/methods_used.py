"""Methods that an analysis used."""

from jointz.core.method_names import FULL_RECORD, WITH_POSTERIOR
from jointz.results.study_analysis import StudyAnalysis

__all__ = ["FULL_RECORD", "WITH_POSTERIOR", "used_methods", "used_pulses"]


def used_methods(analysis: StudyAnalysis) -> list[str]:
    """Return the methods of the estimates; a case may have needed another than the chosen one."""
    used = list(dict.fromkeys(c.method for c in analysis.cells if c.method))
    chosen = analysis.settings.get("method")
    return used or ([str(chosen)] if chosen else [])


def used_pulses(analysis: StudyAnalysis) -> bool:
    """Return whether any pulse was used; without pulses nothing was estimated."""
    return any(c.n_used for c in analysis.cells)
