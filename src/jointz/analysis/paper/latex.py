"""Text and tables for LaTeX: every character escaped, rules of booktabs."""

import re
from collections.abc import Sequence
from typing import Final

#: A table of more rows breaks over pages.
MOST_ROWS: Final = 40
_SMALL: Final = r"\scriptsize\setlength{\tabcolsep}{3pt}"

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
#: Marks that refer to the notes below a table.
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
    r"""Return a table as LaTeX, with the rules of booktabs."""
    columns = "".join(r"p{0.42\linewidth}" if name in wide else "l" for name in head)
    layout = rf"{{@{{}}{columns}@{{}}}}"
    title = rf"\caption{{{to_latex(caption)}}}\label{{{label}}}"
    top = [r"\toprule", *_head(head), r"\midrule"]
    body = [" & ".join(map(to_latex, row)) + r" \\" for row in rows]
    # LaTeX takes a bracket at the beginning of a row as the argument of the \\ before it.
    body = [rf"{{}}{line}" if line.startswith(("[", "*")) else line for line in body]
    below = list(map(to_latex, notes))
    if len(rows) > MOST_ROWS:
        across = rf"\multicolumn{{{len(head)}}}{{p{{0.9\linewidth}}}}"
        last = [rf"{across}{{{note}}} \\" for note in below]
        lines = _long(layout, title, top, body, last)
    else:
        last = [rf"\par\smallskip\parbox{{0.9\linewidth}}{{{note}}}" for note in below]
        lines = _short(layout, title, top, body, last)
    return "\n".join(lines) + "\n"


_Lines = Sequence[str]


def _short(layout: str, title: str, top: _Lines, body: _Lines, notes: _Lines) -> list[str]:
    return [
        r"% Needs \usepackage{booktabs}; made by jointz. table* spans two columns, table one.",
        r"\begin{table*}[tbp]",
        title,
        rf"\centering{_SMALL}",
        rf"\begin{{tabular}}{layout}",
        *(*top, *body, r"\bottomrule"),
        r"\end{tabular}",
        *notes,
        r"\end{table*}",
    ]


def _long(layout: str, title: str, top: _Lines, body: _Lines, notes: _Lines) -> list[str]:
    return [
        r"% Needs \usepackage{booktabs,longtable}; made by jointz.",
        r"% A page of two columns takes it between \onecolumn and \twocolumn only.",
        rf"\begingroup{_SMALL}",
        rf"\begin{{longtable}}{layout}",
        rf"{title}\\",
        *(*top, r"\endfirsthead"),
        *(*top, r"\endhead"),
        *(r"\bottomrule", r"\endfoot"),
        *(r"\bottomrule", *notes, r"\endlastfoot"),
        *body,
        r"\end{longtable}",
        r"\endgroup",
    ]


def _head(head: Sequence[str]) -> list[str]:
    """Return the rows of the head: names, and units below them if there are any."""
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
