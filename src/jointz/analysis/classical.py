"""Classical values: what published studies report, beside those of the study's own method.

They are those of the dissertation's method on the same pulses: signals low-passed at 20 Hz, mean
unperturbed stride subtracted, K, B and J by least squares. Strap, lag and baseline are not
corrected for.
"""

from dataclasses import replace
from typing import Final, Literal

import numpy as np
import pandas as pd

from jointz.core.method_names import DISSERTATION, WITH_POSTERIOR
from jointz.reference.classical_errors import RMS_PCT, SIMULATORS
from jointz.report.wording import joined
from jointz.results.estimates import ESTIMATE_COLUMNS, CellEstimate
from jointz.results.fit import SYMBOLS
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.population import population_means

#: In the column ``method`` of ``comparison.csv``: a mean over people.
MEAN: Final = f"{DISSERTATION}_mean"
PulseKind = Literal["hold", "short", "doublet"]
_KINDS: Final = {
    "hold": "pulses that hold one torque",
    "short": "short pulses of one direction",
    "doublet": "doublets",
}
#: Torque against the pulse's direction, over the largest, from which a pulse reverses.
_REVERSES: Final = -0.25
#: Torque at the end of the window, over the largest, from which a pulse holds.
_HOLDS: Final = 0.5


def classical_analysis(analysis: StudyAnalysis) -> StudyAnalysis | None:
    """Return the classical values as an analysis; None where they are not beside others."""
    if analysis.settings.get("method") not in WITH_POSTERIOR:
        return None
    cells = tuple(c for c in analysis.comparison if c.method == DISSERTATION)
    if not any(p.available for c in cells for p in c.parameters):
        return None
    return replace(
        analysis,
        cells=cells,
        comparison=(),
        population=population_means(cells, however_wide=True),
        log_posteriors=(),
        settings={**analysis.settings, "method": DISSERTATION},
    )


def cells_of_both(analysis: StudyAnalysis, classical: StudyAnalysis | None) -> list[CellEstimate]:
    """Return the joint's own cells, and the classical ones with the same parameters."""
    names = {p.name for c in analysis.cells for p in c.parameters}
    return [
        *analysis.cells,
        *(
            replace(c, parameters=tuple(p for p in c.parameters if p.name in names))
            for c in (classical.cells if classical else ())
        ),
    ]


def comparison_table(analysis: StudyAnalysis) -> pd.DataFrame:
    """Return other methods' estimates, then means over people of the classical values."""
    table, classical = analysis.comparison_frame(), classical_analysis(analysis)
    means = [m for m in classical.population if m.value is not None] if classical else []
    if not means:
        return table
    rows = [
        {n: getattr(m, n, None) for n in ESTIMATE_COLUMNS} | {"participant": "", "method": MEAN}
        for m in means
    ]
    counts = dict.fromkeys(("n_used", "n_excluded"), "Int64")  # with blanks
    added = pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS)).astype({"vaf_pct": float, **counts})
    return pd.concat([table.astype(counts), added], ignore_index=True)


def classical_note(classical: StudyAnalysis) -> str:
    """Say what the classical values of a study are, and how far such values were off."""
    note = (
        "Grey values are classical: as published studies report them, by the dissertation's method "
        "on the same pulses, not corrected for strap, lag and baseline."
    )
    if (kind := pulse_kind(classical.cells)) is None:
        return note
    errors = joined(
        [f"{low:.0f} to {high:.0f} % in {SYMBOLS[n]}" for n, (low, high) in RMS_PCT[kind].items()]
    )
    return (
        f"{note} In simulated people with {_KINDS[kind]} such values were off by {errors} (RMS, "
        f"{SIMULATORS[kind]} simulators)."
    )


def pulse_kind(cells: tuple[CellEstimate, ...]) -> PulseKind | None:
    """Return the kind of a study's pulses, by the average torque; None without responses."""
    torques = [c.response.torque for c in cells if c.response is not None]
    shares = [t / t.max() for t in torques if t.size and t.max() > 0.0]
    if not shares:
        return None
    if np.median([share[-1] for share in shares]) > _HOLDS:
        return "hold"
    return "doublet" if np.median([share.min() for share in shares]) < _REVERSES else "short"
