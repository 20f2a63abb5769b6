"""Which methods made the estimates of an analysis, and whether there are any."""

from typing import Final

from jointz.results.study_analysis import StudyAnalysis

#: Method that explains all timing points of a walker together.
RECOMMENDED: Final = "recommended"
#: Method that uses whole trials.
FULL_RECORD: Final = "full_record"


def used_methods(analysis: StudyAnalysis) -> list[str]:
    """Return the methods that the estimates were made by: a case may have needed another."""
    own = list(dict.fromkeys(c.method for c in analysis.cells if c.method))
    chosen = analysis.settings.get("method")
    return own or ([str(chosen)] if chosen else [])


def used_pulses(analysis: StudyAnalysis) -> bool:
    """Tell whether a pulse was used at all: without one nothing was estimated."""
    return any(c.n_used for c in analysis.cells)
