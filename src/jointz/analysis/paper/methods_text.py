"""The methods section of a paper, as the settings and the data say it."""

from collections import Counter
from typing import Final

from jointz.analysis.paper.citations import cite, cited
from jointz.analysis.paper.methods_data import (
    exclusion_sentences,
    people_sentences,
    protocol_sentences,
    signal_sentences,
)
from jointz.analysis.paper.methods_fit import estimation_sentences, interval_sentences
from jointz.analysis.paper.methods_quasi_stiffness import quasi_stiffness_sentences
from jointz.analysis.paper.methods_used import FULL_RECORD, used_methods, used_pulses
from jointz.report.latex import to_latex
from jointz.report.prose import pulse_counts
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
    """Write a methods section, one text a paragraph, ready to paste into a paper.

    Only what settings and data say is written; what they do not hold is left out.
    """
    paragraphs = [
        [_SIMULATED] if simulated else [],
        people_sentences(analysis) + protocol_sentences(analysis),
        signal_sentences(analysis),
        *_estimation(analysis),
        quasi_stiffness_sentences(analysis),
        [*exclusion_sentences(analysis), *_used(analysis), *_open(analysis)],
        _software(analysis),
    ]
    return [" ".join(sentences) for sentences in paragraphs if sentences]


def methods_text(analysis: StudyAnalysis, *, simulated: bool = False) -> str:
    """Return the methods section and what it cites as plain text."""
    paragraphs = methods_paragraphs(analysis, simulated=simulated)
    if references := cited(paragraphs):
        paragraphs.append("\n".join(("References", *references)))
    return "\n\n".join(paragraphs) + "\n"


def methods_latex(analysis: StudyAnalysis, *, simulated: bool = False) -> str:
    r"""Return the methods section and what it cites as LaTeX to ``\input``."""
    paragraphs = methods_paragraphs(analysis, simulated=simulated)
    texts = list(map(to_latex, paragraphs))
    if references := cited(paragraphs):
        # Ragged: identifiers are long, and LaTeX breaks none.
        listed = [rf"\noindent {to_latex(entry)}" for entry in references]
        texts += [r"\paragraph{References}", r"{\raggedright", *listed, "}"]
    return "\n\n".join(texts) + "\n"


def _estimation(analysis: StudyAnalysis) -> list[list[str]]:
    """Return what was done to estimate; without a pulse that was used nothing was."""
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


def _used(analysis: StudyAnalysis) -> list[str]:
    if nobody_perturbed(analysis):
        return ["Nobody was perturbed: no impedance was estimated."]
    if analysis.cells and not used_pulses(analysis):
        return ["No pulse could be used: no impedance was estimated."]
    used, left_out = pulse_counts(analysis)
    trials = used_methods(analysis) == [FULL_RECORD]
    return [
        f"Of {format_count(used + left_out, 'pulse')}, {format_integer(used)} "
        f"{'lie in the trials used' if trials else 'were used'}."
    ]


def _open(analysis: StudyAnalysis) -> list[str]:
    """Say what has no value, and where only a limit stands."""
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
