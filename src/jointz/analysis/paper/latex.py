"""Text and tables for LaTeX: every character escaped, rules of booktabs."""

import re
from collections.abc import Sequence
from typing import Final

from jointz.report.html_page import render_template

#: A table of more rows breaks over pages.
MOST_ROWS: Final = 40

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
    parts = [name.partition(" (") for name in head]
    return render_template(
        "table_latex.txt.j2",
        layout=f"@{{}}{columns}@{{}}",
        caption=to_latex(caption),
        label=label,
        names=[rf"\textbf{{{to_latex(name)}}}" for name, _, _ in parts],
        units=[to_latex(f"({unit}") if unit else "" for _, _, unit in parts],
        rows=[list(map(to_latex, row)) for row in rows],
        notes=list(map(to_latex, notes)),
        long=len(rows) > MOST_ROWS,
    )


def _token(match: re.Match[str]) -> str:
    text = match.group()
    if text in _SPECIAL:
        return _SPECIAL[text]
    if text == "-":
        return "-{}"
    return f"$^{{{text.translate(_SUPERSCRIPTS | _LETTERS)}}}$"
