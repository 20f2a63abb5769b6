"""Sentences of a methods section about quasi-stiffness."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_records
from jointz.analysis.paper.citations import cite
from jointz.analysis.paper.methods_data import torque_is_turned
from jointz.identify.over_cycle.stride_curves import NODES
from jointz.report.subjects import nobody_perturbed, study_record, subjects
from jointz.report.wording import format_count, format_integer, format_span
from jointz.results.statistics.quasi_stiffness_fit import Doubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.stats.quasi_stiffness import STEP_PCT, WINDOW_PCT

_CALCULATION: Final = (
    f"Each stride was resampled to {NODES} points from one heel strike to the next by linear "
    "interpolation, without a filter and without gains or lags of a calibration; the strides "
    "of a participant and side were averaged. Slope: least-squares line of moment on angle over "
    "the gait phase of the timing point, both sampled every "
    f"{STEP_PCT:g} % of the cycle; local slope: the same over {WINDOW_PCT:g} % of the cycle about "
    "the timing point; secant: moment over angle at the timing point."
)
_STATUSES: Final[Mapping[str, str]] = {
    "ok": "without doubt",
    "ill_conditioned": "with doubts",
    "undecided": "without a value",
}

_Rows = Sequence[Mapping[str, Any]]


def quasi_stiffness_sentences(analysis: StudyAnalysis) -> list[str]:
    """Describe how quasi-stiffness was calculated; nothing if there is none."""
    rows = quasi_stiffness_records(analysis)
    if not rows:
        return []
    return [
        _lead(analysis, rows),
        _moment(analysis),
        _strides(rows),
        _CALCULATION,
        *_intervals(rows),
        _outcome(rows),
    ]


def _lead(analysis: StudyAnalysis, rows: _Rows) -> str:
    version = analysis.provenance.get("jointz")
    people = list(dict.fromkeys(str(r["participant"]) for r in rows))
    # If nobody was perturbed, another sentence names the participants.
    names = "" if nobody_perturbed(analysis) else f" ({', '.join(people)})"
    return (
        f"Quasi-stiffness of {subjects(analysis).counted(len(people))}{names} without a device and "
        "without pulses was estimated from the mean stride with jointz"
        f"{f' {version}' if version else ''} {cite('jointz')}. It is the relation of moment and "
        "angle, and no impedance."
    )


def _moment(analysis: StudyAnalysis) -> str:
    study = study_record(analysis)
    column = ((study.get("channels") or {}).get("torque") or {}).get("column")
    named = f" “{column}”" if column else ""
    if "torque_acts_on" not in study:
        sign = ""
    elif torque_is_turned(study):
        sign = ", its sign inverted to that of the torque on the joint"
    else:
        sign = ", its sign unchanged"
    return f"The moment of the joint is the study's torque channel{named}{sign}."


def _strides(rows: _Rows) -> str:
    counts = {
        (r["participant"], r.get("session", ""), r["side"]): int(r["n_strides"]) for r in rows
    }
    sides = " and side" if any(side for *_, side in counts) else ""
    return (
        "Accepted strides without a missing sample were used, "
        f"{format_span(counts.values(), format_integer)} for each participant{sides}."
    )


def _intervals(rows: _Rows) -> list[str]:
    known = [r for r in rows if r["value"] is not None]
    with_interval = [r for r in known if r["ci_low"] is not None]
    sentences = []
    if with_interval:
        sentences.append(
            f"{100 * with_interval[0]['ci_level']:g} % intervals are t intervals of the delete-one "
            f"jackknife over strides {cite('jackknife')}, with one degree of freedom less than "
            "strides, and do not include errors of motion capture and inverse dynamics."
        )
    if len(with_interval) < len(known):
        without = format_count(len(known) - len(with_interval), "value has", "values have")
        sentences.append(f"{without} no interval because of too few strides.")
    return sentences


def _outcome(rows: _Rows) -> str:
    statuses = Counter(r["status"] for r in rows)
    doubts = Counter(d for r in rows for d in r["doubts"].split())
    parts = [
        f"{format_integer(statuses[status])} {words}"
        for status, words in _STATUSES.items()
        if statuses[status]
    ]
    why = "; ".join(f"{Doubt(d).meaning}, {format_integer(n)}" for d, n in doubts.most_common())
    return (
        f"Of {format_count(len(rows), 'slope and secant', 'slopes and secants')}, "
        f"{', '.join(parts)}{f' ({why})' if why else ''}."
    )
