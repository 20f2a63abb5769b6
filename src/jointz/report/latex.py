"""Text and tables for LaTeX: every character escaped, rules of booktabs."""

import re
from collections.abc import Sequence
from typing import Final

_SPECIAL: Final = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    # Active in some languages of babel.
    '"': r"{\char34}",
    "\N{MINUS SIGN}": r"$-$",
    "\N{PLUS-MINUS SIGN}": r"$\pm$",
    "\N{MULTIPLICATION SIGN}": r"$\times$",
    "\N{MIDDLE DOT}": r"$\cdot$",
    "\N{DEGREE SIGN}": r"$^\circ$",
    "\N{EN DASH}": "--",
    "\N{EM DASH}": "---",
    "\N{HORIZONTAL ELLIPSIS}": r"\ldots{}",
    "\N{LEFT DOUBLE QUOTATION MARK}": "``",
    "\N{RIGHT DOUBLE QUOTATION MARK}": "''",
    "\N{NARROW NO-BREAK SPACE}": r"\,",
    "\N{NO-BREAK SPACE}": "~",
    # An empty line would end a paragraph, or a table.
    "\n": " ",
    "\r": " ",
}
_SUPERSCRIPTS: Final = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
#: Marks of notes below a table.
MARKS: Final = "ᵃᵇᶜᵈᵉᶠᵍʰⁱʲ"
_LETTERS: Final = str.maketrans(MARKS, "abcdefghij")
_TOKEN: Final = re.compile(
    "|".join(["[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", f"[{MARKS}]", *map(re.escape, _SPECIAL)])
    # A ligature would make one dash of two hyphens.
    + "|-(?=-)"
)


def to_latex(text: str) -> str:
    r"""Escape a text for LaTeX.

    Letters of other scripts stay as they are: they need LuaLaTeX or XeLaTeX and a font.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        What LaTeX prints as that text; never a command of the text's own.

    Examples
    --------
    >>> to_latex("5 % of S_01, kg·m²")
    '5 \\% of S\\_01, kg$\\cdot$m$^{2}$'
    """
    return _TOKEN.sub(_token, text)


def latex_table(
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    caption: str,
    label: str,
    notes: Sequence[str] = (),
    wide: Sequence[str] = (),
) -> str:
    r"""Return a table as LaTeX: one that may run over pages, with the rules of booktabs.

    Parameters
    ----------
    head : sequence of str
        Names of the columns, not yet escaped; what is in round brackets, a unit, stands below.
    rows : sequence of sequence of str
        Cells, as many in a row as the head has.
    caption : str
        Above the table.
    label : str
        For ``\ref``.
    notes : sequence of str
        Below the table.
    wide : sequence of str
        Columns whose text is broken over lines.

    Returns
    -------
    str
        Needs ``\usepackage{booktabs,longtable}``, which a comment on top says.
    """
    columns = "".join(r"p{0.42\linewidth}" if name in wide else "l" for name in head)
    names = _head(head)
    body = [" & ".join(map(to_latex, row)) + r" \\" for row in rows]
    # A row that begins with a bracket would be taken for the argument of the \\ before it.
    body = [rf"{{}}{line}" if line.startswith(("[", "*")) else line for line in body]
    below = [
        rf"\multicolumn{{{len(head)}}}{{p{{0.9\linewidth}}}}{{{to_latex(note)}}} \\"
        for note in notes
    ]
    lines = [
        r"% Needs \usepackage{booktabs,longtable}; made by jointz.",
        r"\begingroup\scriptsize\setlength{\tabcolsep}{3pt}",
        rf"\begin{{longtable}}{{@{{}}{columns}@{{}}}}",
        rf"\caption{{{to_latex(caption)}}}\label{{{label}}}\\",
        *(r"\toprule", *names, r"\midrule", r"\endfirsthead"),
        *(r"\toprule", *names, r"\midrule", r"\endhead"),
        r"\bottomrule",
        r"\endfoot",
        r"\bottomrule",
        *below,
        r"\endlastfoot",
        *body,
        r"\end{longtable}",
        r"\endgroup",
    ]
    return "\n".join(lines) + "\n"


def _head(head: Sequence[str]) -> list[str]:
    """Return the rows of the head: names, and below them units where there are any."""
    parts = [name.partition(" (") for name in head]
    rows = [[rf"\textbf{{{to_latex(name)}}}" for name, _, _ in parts]]
    if any(unit for _, _, unit in parts):
        rows.append([to_latex(f"({unit}") if unit else "" for _, _, unit in parts])
    return [" & ".join(row) + r" \\" for row in rows]


def _token(match: re.Match[str]) -> str:
    text = match.group()
    if text in _SPECIAL:
        return _SPECIAL[text]
    if text == "-":
        return "-{}"
    return f"$^{{{text.translate(_SUPERSCRIPTS | _LETTERS)}}}$"
