"""Methods section of a paper, from the settings and the data."""

from collections import Counter
from typing import Final

from jointz.analysis.paper.citations import cite, cited
from jointz.analysis.paper.latex import to_latex
from jointz.analysis.paper.methods_data import (
    exclusion_sentences,
    people_sentences,
    protocol_sentences,
    signal_sentences,
)
from jointz.analysis.paper.methods_fit import estimation_sentences, interval_sentences
from jointz.analysis.paper.methods_quasi_stiffness import quasi_stiffness_sentences
from jointz.analysis.paper.methods_used import FULL_RECORD, used_methods, used_pulses
from jointz.analysis.summary import pulse_counts
from jointz.report.subjects import nobody_perturbed, subjects
from jointz.report.wording import (
    format_count,
    format_integer,
    method_name,
    status_meaning,
)
from jointz.results.study_analysis import StudyAnalysis

_SIMULATED: Final = "All recordings are simulated: no person was measured."
_HASH_DIGITS: Final = 12


def methods_paragraphs(analysis: StudyAnalysis, *, simulated: bool = False) -> list[str]:
    """Write a methods section, one text for each paragraph, ready to paste into a paper.

    It contains only what settings and data say.
    """
    paragraphs = [
        [_SIMULATED] if simulated else [],
        people_sentences(analysis) + protocol_sentences(analysis),
        signal_sentences(analysis),
        *_estimation(analysis),
        quasi_stiffness_sentences(analysis),
        [*exclusion_sentences(analysis), *_pulses_used(analysis), *_statuses(analysis)],
        _software(analysis),
    ]
    return [" ".join(sentences) for sentences in paragraphs if sentences]


def methods_text(analysis: StudyAnalysis, *, simulated: bool = False) -> str:
    """Return the methods section and its references as plain text."""
    paragraphs = methods_paragraphs(analysis, simulated=simulated)
    if references := cited(paragraphs):
        paragraphs.append("\n".join(("References", *references)))
    return "\n\n".join(paragraphs) + "\n"


def methods_latex(analysis: StudyAnalysis, *, simulated: bool = False) -> str:
    r"""Return the methods section and its references as LaTeX to ``\input``."""
    paragraphs = methods_paragraphs(analysis, simulated=simulated)
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
    used, excluded = pulse_counts(analysis)
    trials = used_methods(analysis) == [FULL_RECORD]
    return [
        f"Of {format_count(used + excluded, 'pulse')}, {format_integer(used)} "
        f"{'are in the trials used' if trials else 'were used'}."
    ]


def _statuses(analysis: StudyAnalysis) -> list[str]:
    """Say how many estimates have which status."""
    statuses = Counter(p.status for c in analysis.cells for p in c.parameters)
    total = statuses.total()
    if not total or nobody_perturbed(analysis):
        return []
    others = [
        f"{format_integer(count)} {status} ({status_meaning(status)})"
        for status, count in statuses.most_common()
        if status != "ok"
    ]
    rest = f"; {'; '.join(others)}" if others else ""
    return [f"Of {format_count(total, 'estimate')}, {format_integer(statuses['ok'])} ok{rest}."]


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
