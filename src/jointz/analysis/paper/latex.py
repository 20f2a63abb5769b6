"""Text and tables for LaTeX: every character escaped, rules of booktabs."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
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
    body = [" & ".join(map(to_latex, row)) + r" \\" for row in rows]
    # LaTeX takes a bracket at the beginning of a row as the argument of the \\ before it.
    body = [rf"{{}}{line}" if line.startswith(("[", "*")) else line for line in body]
    parts = _Parts(
        layout=rf"{{@{{}}{columns}@{{}}}}",
        title=rf"\caption{{{to_latex(caption)}}}\label{{{label}}}",
        head=(r"\toprule", *_head(head), r"\midrule"),
        body=tuple(body),
        notes=tuple(map(to_latex, notes)),
        width=len(head),
    )
    lines = _long(parts) if len(rows) > MOST_ROWS else _short(parts)
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class _Parts:
    """Parts of a table, escaped."""

    layout: str  # column specification of the tabular
    title: str  # caption and label
    head: tuple[str, ...]
    body: tuple[str, ...]
    notes: tuple[str, ...]
    width: int  # number of columns


def _short(parts: _Parts) -> list[str]:
    below = [rf"\par\smallskip\parbox{{0.9\linewidth}}{{{note}}}" for note in parts.notes]
    return [
        r"% Needs \usepackage{booktabs}; made by jointz. table* spans two columns, table one.",
        r"\begin{table*}[tbp]",
        parts.title,
        rf"\centering{_SMALL}",
        rf"\begin{{tabular}}{parts.layout}",
        *parts.head,
        *parts.body,
        r"\bottomrule",
        r"\end{tabular}",
        *below,
        r"\end{table*}",
    ]


def _long(parts: _Parts) -> list[str]:
    below = [
        rf"\multicolumn{{{parts.width}}}{{p{{0.9\linewidth}}}}{{{note}}} \\" for note in parts.notes
    ]
    return [
        r"% Needs \usepackage{booktabs,longtable}; made by jointz.",
        r"% A page of two columns takes it between \onecolumn and \twocolumn only.",
        rf"\begingroup{_SMALL}",
        rf"\begin{{longtable}}{parts.layout}",
        rf"{parts.title}\\",
        *(*parts.head, r"\endfirsthead"),
        *(*parts.head, r"\endhead"),
        r"\bottomrule",
        r"\endfoot",
        r"\bottomrule",
        *below,
        r"\endlastfoot",
        *parts.body,
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
