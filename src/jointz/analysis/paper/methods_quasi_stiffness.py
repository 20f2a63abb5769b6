"""What a methods section says of the quasi-stiffness of people whom nobody perturbed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_data import torque_is_turned
from jointz.identify.over_cycle.stride_curves import NODES
from jointz.report.subjects import nobody_perturbed, subjects
from jointz.report.wording import format_count, format_integer
from jointz.results.statistics.quasi_stiffness_fit import Doubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.quasi_stiffness import STEP_PCT, WINDOW_PCT

_MADE: Final = (
    f"Each was brought to {NODES} points from one heel strike to the next by straight lines "
    "between samples, without a filter, and without gains or lags of a calibration; the strides "
    "of a participant and side were averaged. Slope: least-squares line of moment on angle over "
    "the gait phase that holds the timing point, both taken every "
    f"{STEP_PCT:g} % of the cycle; local slope: the same over {WINDOW_PCT:g} % of the cycle about "
    "the timing point; secant: moment over angle at it."
)
_TURNED: Final[Mapping[bool, str]] = {
    True: ", its sign turned to that of the torque on the joint",
    False: ", as it stands",
}
_STATUSES: Final[Mapping[str, str]] = {
    "ok": "without doubt",
    "ill_conditioned": "with doubts",
    "undecided": "without a value",
}


def quasi_stiffness_sentences(analysis: StudyAnalysis) -> list[str]:
    """Say how quasi-stiffness was made; nothing where there is none."""
    rows = list(analysis.statistics.get("quasi_stiffness") or ())
    if not rows:
        return []
    return [
        _of_whom(analysis, rows),
        _moment(analysis),
        _strides(rows),
        _MADE,
        *_intervals(rows),
        _outcome(rows),
    ]


def _of_whom(analysis: StudyAnalysis, rows: Sequence[Mapping[str, Any]]) -> str:
    version = analysis.provenance.get("jointz")
    people = list(dict.fromkeys(str(r["participant"]) for r in rows))
    # All of a study were told already.
    names = "" if nobody_perturbed(analysis) else f" ({', '.join(people)})"
    return (
        f"Of {subjects(analysis).counted(len(people))}{names} without a device and without "
        "pulses, the quasi-stiffness of the mean stride, which is how moment goes with angle and "
        f"no impedance, was estimated with jointz{f' {version}' if version else ''} "
        f"{cite('jointz')}."
    )


def _moment(analysis: StudyAnalysis) -> str:
    study = analysis.provenance.get("study") or {}
    column = ((study.get("channels") or {}).get("torque") or {}).get("column")
    named = f" “{column}”" if column else ""
    turned = _TURNED[torque_is_turned(study)] if "torque_acts_on" in study else ""
    return f"The moment of the joint is the study's torque channel{named}{turned}."


def _strides(rows: Sequence[Mapping[str, Any]]) -> str:
    counts = {
        (r["participant"], r.get("session", ""), r["side"]): int(r["n_strides"]) for r in rows
    }
    low, high = min(counts.values()), max(counts.values())
    several = f" to {format_integer(high)}" if high > low else ""
    sides = " and side" if any(side for *_, side in counts) else ""
    return (
        f"Accepted strides without a missing sample were used, {format_integer(low)}{several} a "
        f"participant{sides}."
    )


def _intervals(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    known = [r for r in rows if r["value"] is not None]
    held = [r for r in known if r["ci_low"] is not None]
    sentences = []
    if held:
        sentences.append(
            f"{100 * held[0]['ci_level']:g} % intervals are Student's, with one degree of freedom "
            "less than strides, from the jackknife that leaves out one stride at a time "
            f"{cite('jackknife')}; they hold no error of motion capture or inverse dynamics."
        )
    if len(held) < len(known):
        without = format_count(len(known) - len(held), "value has", "values have")
        sentences.append(f"{without} no interval: strides are too few.")
    return sentences


def _outcome(rows: Sequence[Mapping[str, Any]]) -> str:
    statuses = Counter(r["status"] for r in rows)
    doubts = Counter(d for r in rows for d in r["doubts"].split())
    parts = [
        f"{format_integer(statuses[status])} {told}"
        for status, told in _STATUSES.items()
        if statuses[status]
    ]
    why = "; ".join(f"{Doubt(d).meaning}, {format_integer(n)}" for d, n in doubts.most_common())
    return (
        f"Of {format_count(len(rows), 'slope and secant', 'slopes and secants')}, "
        f"{', '.join(parts)}{f' ({why})' if why else ''}."
    )
