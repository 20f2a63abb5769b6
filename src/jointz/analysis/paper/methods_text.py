"""Methods section of a paper, from the settings and the data."""

from jointz.analysis.paper.citations import cite, cited
from jointz.analysis.paper.latex import to_latex
from jointz.analysis.paper.methods_facts import methods_facts
from jointz.report.html_page import render_paragraphs
from jointz.results.study_analysis import StudyAnalysis


def methods_paragraphs(analysis: StudyAnalysis) -> list[str]:
    """Write a methods section, one text for each paragraph, ready to paste into a paper.

    It contains only what settings and data say.
    """
    return render_paragraphs("methods.txt.j2", cite=cite, **methods_facts(analysis))


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
