"""Methods section of a paper, from the settings and the data."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from jointz.analysis.page.quasi_stiffness_section import quasi_stiffness_records
from jointz.analysis.paper.citations import cite, cited
from jointz.analysis.paper.latex import to_latex
from jointz.analysis.paper.methods_data import (
    exclusion_sentences,
    people_sentences,
    protocol_sentences,
    signal_sentences,
    torque_is_turned,
)
from jointz.analysis.paper.methods_fit import estimation_sentences, interval_sentences
from jointz.analysis.paper.methods_used import FULL_RECORD, used_methods, used_pulses
from jointz.identify.over_cycle.stride_curves import NODES
from jointz.report.subjects import nobody_perturbed, study_record, subjects
from jointz.report.wording import (
    format_count,
    format_integer,
    format_span,
    method_name,
    status_meaning,
)
from jointz.results.statistics.quasi_stiffness_fit import STEP_PCT, WINDOW_PCT, QuasiStiffnessDoubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.results.study_counts import study_counts

SIMULATED: Final = "All recordings are simulated: no person was measured."
_HASH_DIGITS: Final = 12


def methods_paragraphs(analysis: StudyAnalysis) -> list[str]:
    """Write a methods section, one text for each paragraph, ready to paste into a paper.

    It contains only what settings and data say.
    """
    paragraphs = [
        [SIMULATED] if analysis.simulated else [],
        people_sentences(analysis) + protocol_sentences(analysis),
        signal_sentences(analysis),
        *_estimation(analysis),
        quasi_stiffness_sentences(analysis),
        [*exclusion_sentences(analysis), *_pulses_used(analysis), *_statuses(analysis)],
        _software(analysis),
    ]
    return [" ".join(sentences) for sentences in paragraphs if sentences]


def methods_text(analysis: StudyAnalysis) -> str:
    """Return the methods section and its references as plain text."""
    paragraphs = methods_paragraphs(analysis)
    if references := cited(paragraphs):
        paragraphs.append("\n".join(("References", *references)))
    return "\n\n".join(paragraphs) + "\n"


def methods_latex(analysis: StudyAnalysis) -> str:
    r"""Return the methods section and its references as LaTeX to ``\input``."""
    paragraphs = methods_paragraphs(analysis)
    texts = list(map(to_latex, paragraphs))
    if references := cited(paragraphs):
        # Ragged, as LaTeX does not break long identifiers.
        listed = [rf"\noindent {to_latex(entry)}" for entry in references]
        texts += [r"\paragraph{References}", r"{\raggedright", *listed, "}"]
    return "\n\n".join(texts) + "\n"


def _estimation(analysis: StudyAnalysis) -> list[list[str]]:
    """Return the paragraphs on estimation; none if no pulse was used."""
    if not used_pulses(analysis):
        return []
    return [[_lead(analysis), *estimation_sentences(analysis)], interval_sentences(analysis)]


def _lead(analysis: StudyAnalysis) -> str:
    settings = analysis.settings
    what = (
        "loads on a bench" if subjects(analysis).loads else f"the {settings.get('joint', 'joint')}"
    )
    version = analysis.provenance.get("jointz")
    by = f" by the method “{method_name(settings['method'])}”" if settings.get("method") else ""
    return (
        f"Mechanical impedance of {what} was estimated with jointz"
        f"{f' {version}' if version else ''} {cite('jointz')}{by}."
    )


def _pulses_used(analysis: StudyAnalysis) -> list[str]:
    if nobody_perturbed(analysis):
        return ["Nobody was perturbed: no impedance was estimated."]
    if analysis.cells and not used_pulses(analysis):
        return ["No pulse could be used: no impedance was estimated."]
    counts = study_counts(analysis)
    found = counts.used + counts.excluded + counts.aborted
    trials = used_methods(analysis) == [FULL_RECORD]
    return [
        f"Of {format_count(found, 'pulse')}, {format_integer(counts.used)} "
        f"{'are in the trials used' if trials else 'were used'}."
    ]


def _statuses(analysis: StudyAnalysis) -> list[str]:
    """Say how many estimates have which status."""
    statuses = study_counts(analysis).statuses
    total = statuses.total()
    if not total or nobody_perturbed(analysis):
        return []
    others = [
        f"{format_integer(count)} {status} ({status_meaning(status)})"
        for status, count in statuses.most_common()
        if status != "ok"
    ]
    rest = f"; {'; '.join(others)}" if others else ""
    ok = format_integer(statuses["ok"])
    return [f"Of {format_count(total, 'estimate')} of K, B and J, {ok} ok{rest}."]


def _software(analysis: StudyAnalysis) -> list[str]:
    provenance, settings = analysis.provenance, analysis.settings
    packages = provenance.get("packages") or {}
    named = [f"{k} {packages[k]}" for k in ("numpy", "scipy") if packages.get(k)]
    python = [f"Python {provenance['python']}"] if provenance.get("python") else []
    own = [f"jointz {provenance['jointz']}"] if provenance.get("jointz") else []
    sentences = []
    if own:
        seed = f", seed {settings['seed']}" if settings.get("seed") is not None else ""
        sentences.append(f"Software: {', '.join([*own, *python, *named])}{seed}.")
    if digest := str(provenance.get("study_sha256", ""))[:_HASH_DIGITS]:
        sentences.append(
            f"The study file has the SHA-256 {digest}…; those of all recordings are in "
            "provenance.json."
        )
    return sentences


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
        _quasi_stiffness_lead(analysis, rows),
        _moment(analysis),
        _strides(rows),
        _CALCULATION,
        *_intervals(rows),
        _outcome(rows),
    ]


def _quasi_stiffness_lead(analysis: StudyAnalysis, rows: _Rows) -> str:
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
    why = "; ".join(
        f"{QuasiStiffnessDoubt(d).meaning}, {format_integer(n)}" for d, n in doubts.most_common()
    )
    return (
        f"Of {format_count(len(rows), 'slope and secant', 'slopes and secants')}, "
        f"{', '.join(parts)}{f' ({why})' if why else ''}."
    )
