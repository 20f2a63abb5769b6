"""Checks of the timing points that a pulse table names against the phases of the gait cycle."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from jointz.core.codes import LISTED, Exclusion
from jointz.core.errors import DataError
from jointz.core.events import PulseRecord
from jointz.core.gait_phases import circular_mean_pct, phase_difference
from jointz.identify.preparation.pulses import Pulse

#: Largest distance of a pulse from the timing point that its table names, % of the gait cycle. The
#: eight phases of the cycle reach at most 9.5 % from their middles.
_FARTHEST_PCT = 10.0
#: Share and number of contradicted pulses from which the table or the heel strikes are wrong.
_MOST_SHARE, _FEWEST = 0.2, 3
#: Share of the pulses that a cause has to explain.
_EXPLAINED = 0.8
#: Distances of the other leg's heel strikes, % of the gait cycle.
_OTHER_LEG_PCT = (40.0, 60.0)
_CODE = Exclusion.LABEL_CONTRADICTS_PHASE.value

_Labelled = tuple[Pulse, PulseRecord, float | None]  # the last is the predicted phase, %


def contradicts(pulse: Pulse, phase_pct: float | None, target_pct: float | None) -> str:
    """Say how far a pulse is from the timing point of its table; "" if it may be there."""
    if not pulse.timing_point or phase_pct is None or target_pct is None:
        return ""
    if abs(phase_difference(phase_pct, target_pct)) <= _FARTHEST_PCT:
        return ""
    return f"at {phase_pct:.1f} % of the gait cycle, {pulse.timing_point} is at {target_pct:g} %"


def check_labels(pulses: Sequence[_Labelled]) -> None:
    """Refuse pulses of which many contradict their table, in one recording or in all together."""
    known = [
        row
        for row in pulses
        if row[0].timing_point and row[1].code not in LISTED and _phase(row) is not None
    ]
    files = [list(rows) for _, rows in groupby(known, key=lambda row: row[1].recording)]
    for rows in (*files, known):
        wrong = [r for _, r, _ in rows if r.code == _CODE]
        if len(wrong) < _FEWEST or len(wrong) <= _MOST_SHARE * len(rows):
            continue
        names = ", ".join(dict.fromkeys(r.recording for r in wrong))
        raise DataError(
            f"{names}: {len(wrong)} of {len(rows)} pulses lie more than {_FARTHEST_PCT:g} % of the "
            f"gait cycle from the timing point that the pulse table names, such as the one at "
            f"{wrong[0].onset_s:.6g} s: {wrong[0].detail}. {_likely_cause(rows)} Correct the "
            "table's timing_point, or the heel strikes if the table is right. Without the column "
            "timing_point every pulse takes the timing point nearest to its phase.",
            path=wrong[0].recording,
        )


def _phase(row: _Labelled) -> float | None:
    _, record, predicted_pct = row
    return predicted_pct if record.measured_pct is None else record.measured_pct


def _likely_cause(known: Sequence[_Labelled]) -> str:
    """Name what would explain the contradictions."""
    rows = [(_phase(row), row[1].target_pct) for row in known]
    pairs = np.array(rows, dtype=float)
    phases, targets = pairs[:, 0], pairs[:, 1]
    for step, neighbour in ((-1, "before"), (1, "after")):
        # Pulse k has the phase that the table names at the row after or before it.
        if _share_near(phases, np.roll(targets, step)) >= _EXPLAINED:
            return (
                f"Each name fits the pulse {neighbour} it: are the names of the table moved by "
                "one pulse?"
            )
    differences = np.asarray(phase_difference(phases - targets, 0.0))
    shift = float(phase_difference(circular_mean_pct(differences), 0.0))
    if _share_near(differences, np.full(differences.size, shift)) >= _EXPLAINED:
        low, high = _OTHER_LEG_PCT
        leg = "of the other leg, or " if low <= abs(shift) <= high else ""
        way = "later" if shift > 0 else "earlier"
        return (
            f"Most are about {abs(shift):.0f} % {way} than their names say: are the heel strikes "
            f"{leg}of an inverted or delayed footswitch, or the onsets of another clock?"
        )
    return "Is it the table of another trial, or are the footswitch or timing_points wrong?"


def _share_near(phases: np.ndarray, targets: np.ndarray) -> float:
    near = np.abs(phase_difference(phases - targets, 0.0)) <= _FARTHEST_PCT
    return float(np.mean(near)) if near.size else 0.0
