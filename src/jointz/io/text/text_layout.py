"""Proposal for the layout of a text file, from its first lines.

Nothing is read by this layout: it is proposed, as ``[files]`` of a study, to whoever
inspects a file, and :mod:`jointz.io.text.delimited` still refuses what does not fit it.
"""

import csv
import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from jointz.core.study import FilesSpec
from jointz.io.formats.columns import file_error
from jointz.io.text.column_names import is_unit
from jointz.io.text.delimited import (
    MISSING_TEXT,
    check_signs,
    decompressed_text,
    is_number,
)
from jointz.io.text.text_bytes import likely_encoding, stated_encoding

_LINES = 400
_IN_A_ROW = 3  # rows of one shape that are called the table
#: Signs between columns, in the order in which they are tried, and what they are called.
DELIMITERS: Mapping[str, str] = {
    ",": "a comma",
    ";": "a semicolon",
    "\t": "a tab",
    "|": "a bar",
    " ": "a blank",
}
_HERTZ = r"(?:k?hz|1/s|s\^?-1|samples\s?(?:/|per)\s?s\w*)(?![a-z])"
#: A number of Hz, in lower case without accents.
_FREQUENCY = re.compile(
    rf"""(?<![\d.,])(\d+(?:[.,]\d+)?) \s* ({_HERTZ})
    | (?<![a-z])(k?hz) [^a-z\d.+-]* (\d+(?:[.,]\d+)?)""",
    re.VERBOSE,
)
#: What says a sampling rate, likewise, at the beginning of a line or cell.
_RATE = re.compile(
    rf"""\W*(?:
        (?:sampl\w*|sampel|data|frame|capture|abtast|mess|meet|bemonsterings)[ _-]?
        (?:rate|freq\w*|hz|frequen[zt]\w*) | rate | sr | fs | f_s | sfreq | srate | abtastung
        | frequency | (?:frequence|taux|cadence)[ ]d.?[ ]?echantillonnage
        | (?:frecuencia|tasa|velocidad)[ ]de[ ]muestreo
        | (?:frequenza|tasso|velocita)[ ]di[ ]campionamento
    )(?![a-z]) [^a-z\d.+-]* (?:k?hz)? [^a-z\d.+-]* \d+(?:[.,]\d+)? \s* (?:{_HERTZ})? \W*$""",
    re.VERBOSE,
)
#: What says the time between two samples, likewise.
_INTERVAL = re.compile(
    r"""\W*(?:
        (?:sampl\w*|abtast|mess)[ _-]?(?:interval|intervall|period|periode|time|zeit) | dt
        | (?:intervall[eo]|intervalo|periodo|periode)[ ]d.{0,3}[ ]?\w*(?:echan|muest|camp)\w*
    )(?![a-z]) [^a-z\d.+-]* (?:[\[(]?(?P<before>ms|s|us)[\])]?)? [^a-z\d.+-]*
    (?P<named>\d*[.,]?\d+) (?:\s*(?P<after>ms|s|us|sec|msec))? \W*
    | (?P<number>\d*[.,]?\d+) \s* (?P<unit>ms|s|us|sec|msec) \s* (?:/|per) \s* sampl\w* \W*""",
    re.VERBOSE,
)
_SECONDS = {"s": 1.0, "sec": 1.0, "": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6}
_MASS = re.compile(
    r"\W*(?:(?:body|subject\w*|participant\w*|patient\w*|proband\w*)\W*)?"
    r"(?:mass|masse|gewicht|korpergewicht|korpermasse|poids|peso|massa|weight)"
    r"(?:\W*(?:corporel\w*|corporal|corporea|del? \w+|du \w+))?\W*(\d+(?:[.,]\d+)?)\s*kg\W*"
)
_LIGHTEST_KG, _HEAVIEST_KG = 20.0, 250.0
_PARTS = re.compile(r"[;\t|]|,\s")
_THOUSANDS = re.compile(r"\d{1,3}[.,]000")
_FASTEST_HZ = 1e5
_SLOWEST_HZ = 20.0  # of a joint's recording: 1.000 Hz is a thousand
_BRACKETED = re.compile(r"^[\[(].*[\])]$")
_UNIT_LIKE = re.compile(r"[\w%°µ·*/^.\-⁻²]{1,12}")


@dataclass(frozen=True, slots=True)
class TextLayout:
    """The layout of a text file as it was found."""

    files: FilesSpec  # keys of ``[files]`` of a study
    names: tuple[str, ...]  # names of the columns in the file; "" for a column without one
    units: tuple[str, ...] = ()  # row of units below the names; empty without
    notes: tuple[str, ...] = ()  # decisions about the layout
    # sampling rate stated in a line above the table; None if not stated
    rate_hz: float | None = None
    mass_kg: float | None = None  # of the person, likewise
    above: tuple[str, ...] = ()  # lines above the table

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns in a study: their own, or their numbers from 1."""
        if self.files.header:
            return self.names
        return tuple(str(k) for k in range(1, len(self.names) + 1))


def find_layout(path: Path, given: Mapping[str, Any] | None = None) -> TextLayout:
    """Find out how a text file is laid out."""
    known = dict(given or {})
    skipped = int(known.get("skip_rows") or 0)
    known["encoding"] = stated_encoding(path, known.get("encoding") or likely_encoding(path))
    lines = decompressed_text(path, skipped + _LINES, known["encoding"])
    best = max(
        (
            _Candidate.of(lines[skipped:], known["encoding"], *signs)
            for signs in _signs(path, known, is_quoted='"' in lines[-1])
        ),
        key=lambda candidate: candidate.score,  # the first of equals
    )
    if not any(map(any, best.rows)) or (best.start is None and "header" not in known):
        where = (
            f"in {_LINES} lines from line {skipped + 1} on"
            if skipped
            else f"in its first {len(lines)} lines"
        )
        raise file_error(
            path,
            f"no table of numbers {where}. Say where it begins (--skip-rows), give its layout "
            "(--delimiter, --decimal, --no-header), or another file.",
        )
    layout = _layout(best, known)
    above = lines[: skipped + (best.start or 0)]
    texts = [part for line in above for part in (line, *_PARTS.split(line))]
    matches = [match for text in set(texts) if (match := _MASS.fullmatch(_plain(text)))]
    masses_kg = {float(match[1].replace(",", ".")) for match in matches}
    is_clear = len(masses_kg) == 1 and _LIGHTEST_KG <= min(masses_kg) <= _HEAVIEST_KG
    layout = replace(layout, above=tuple(above), mass_kg=min(masses_kg) if is_clear else None)
    rates = {rate for part in texts if (rate := stated_rate(part))}
    other_rates = {hz for line in above for hz in _frequencies(_plain(line))}
    if rates and len(rates | other_rates) > 1:
        rate_list = ", ".join(f"{hz:g}" for hz in sorted(rates | other_rates))
        note = f"its first lines state {rate_list} Hz: which is the rate of the table?"
        return replace(layout, notes=(*layout.notes, note))
    return replace(layout, rate_hz=min(rates, default=None))


def stated_rate(line: str) -> float | None:
    """Return the sampling rate in Hz that a line above a table states, None where it states none.

    >>> stated_rate("Abtastrate: 500 Hz"), stated_rate("fs: 1 kHz"), stated_rate("cutoff: 20 Hz")
    (500.0, 1000.0, None)
    >>> stated_rate("2 msec/sample"), stated_rate("Abtastintervall [s]: 0,001")
    (500.0, 1000.0)
    """
    plain = _plain(line)
    if interval := _INTERVAL.fullmatch(plain):
        number = float((interval["named"] or interval["number"]).replace(",", "."))
        unit = interval["before"] or interval["after"] or interval["unit"] or ""
        hz = float(f"{1.0 / (number * _SECONDS[unit]):.9g}") if number else 0.0
        return hz if _SLOWEST_HZ <= hz <= _FASTEST_HZ else None  # else a duration
    return next(iter(_frequencies(plain)), None) if _RATE.fullmatch(plain) else None


def _frequencies(plain: str) -> list[float]:
    """Return every number above 0 that stands beside Hz or kHz, in Hz."""
    rates = []
    for after, unit, before_unit, before in _FREQUENCY.findall(plain):
        text, unit = after or before, unit or before_unit
        number = float(text.replace(",", "."))
        exact = number < _SLOWEST_HZ and _THOUSANDS.fullmatch(text)
        rates.append(number * (1000 if unit == "khz" or exact else 1))
    return [hz for hz in rates if hz]


def _plain(line: str) -> str:
    """Return a line in lower case without accents."""
    letters = unicodedata.normalize("NFKD", line.casefold())
    return "".join(c for c in letters if not unicodedata.combining(c))


def _signs(path: Path, known: Mapping[str, Any], *, is_quoted: bool) -> list[tuple[str, str]]:
    delimiters = [known["delimiter"]] if known.get("delimiter") else list(DELIMITERS)
    decimals = [known["decimal"]] if known.get("decimal") else [".", ","]
    if known.get("delimiter"):
        check_signs(path, known["delimiter"], known.get("decimal", ""), is_quoted=is_quoted)
    return [(d, sign) for d, sign in product(delimiters, decimals) if d != sign or is_quoted]


@dataclass(frozen=True, slots=True)
class _Candidate:
    """The table that two signs make of the lines."""

    encoding: str
    delimiter: str
    decimal: str
    rows: tuple[tuple[str, ...], ...]  # cells of each line
    start: int | None  # index of the first row of the table; None without a table

    @classmethod
    def of(cls, lines: Sequence[str], encoding: str, delimiter: str, decimal: str) -> "_Candidate":
        rows = tuple(split_cells(line, delimiter) for line in lines)
        return cls(encoding, delimiter, decimal, rows, _first_row(rows, decimal))

    def spec(self, skip_rows: int, *, header: bool = True) -> FilesSpec:
        """Return the layout with these signs."""
        signs = {"delimiter": self.delimiter, "decimal": self.decimal}
        signs |= {"encoding": self.encoding} if self.encoding != "utf-8" else {}
        return FilesSpec.model_validate({**signs, "skip_rows": skip_rows, "header": header})

    @property
    def score(self) -> tuple[bool, bool, float, int]:
        """A table at all; more than one column; share of numbers; columns."""
        if self.start is None:
            return (False, False, 0.0, 0)
        cells = [cell for row in self.rows[self.start :] for cell in row]
        numbers = sum(is_number(cell, self.decimal) for cell in cells)
        width = len(self.rows[self.start])
        return (True, width > 1, round(numbers / max(len(cells), 1), 3), width)


def split_cells(line: str, delimiter: str) -> tuple[str, ...]:
    """Return the cells of a line, which is one cell if csv cannot split it."""
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a quote that never ends, or a cell longer than csv allows
        return (line,)
    return tuple(cell.strip() for cell in cells)


def _first_row(rows: Sequence[tuple[str, ...]], decimal: str) -> int | None:
    """Return the first of some rows of one width in which a number stands.

    Lines above a table may look like one (``Mass;70``): the table is where most cells stand in
    rows of one shape, numbers and text in the same places.
    """
    shapes = [_shape(row, decimal) if _is_sample(row, decimal) else () for row in rows]
    counts = Counter(shapes)
    usual = max(counts, key=lambda shape: counts[shape] * len(shape), default=())
    n_rows = min(_IN_A_ROW, sum(bool(row and any(row)) for row in rows[-_IN_A_ROW:]), len(rows))
    alike = [len(shape) == len(usual) > 0 for shape in shapes]
    for k, shape in enumerate(shapes):
        if shape == usual and all(alike[k : k + max(n_rows, 1)]):
            while k and alike[k - 1]:  # rows with a stray text are samples, too
                k -= 1
            return k
    return None


def _shape(row: tuple[str, ...], decimal: str) -> tuple[bool, ...]:
    """Return where text stands in a row."""
    return tuple(not is_number(cell, decimal) and cell not in MISSING_TEXT for cell in row)


def _is_sample(row: tuple[str, ...], decimal: str) -> bool:
    """Whether at least half of what stands in a row are numbers."""
    written = [cell for cell in row if cell not in MISSING_TEXT]
    numbers = sum(is_number(cell, decimal) for cell in written)
    return bool(numbers) and 2 * numbers >= len(written)


def _layout(candidate: _Candidate, known: Mapping[str, Any]) -> TextLayout:
    if "skip_rows" in known or "header" in known:
        return _stated_layout(candidate, known)
    start = candidate.start or 0
    width = len(candidate.rows[start])
    above = candidate.rows[start - 1] if start else ()
    if start >= 2 and _is_units(above) and len(candidate.rows[start - 2]) == len(above) == width:
        files = candidate.spec(start, header=False)
        note = (
            f"row {start} holds units, row {start - 1} the names: both are skipped, and columns "
            "are given by number."
        )
        return TextLayout(files, _full_names(candidate.rows, start - 2), _bare(above), (note,))
    fewest = max(width - 1, 2) if width > 1 or " " in "".join(above) else 1  # a sentence is no name
    if not start or not any(above) or len(above) > width + 1 or len(above) < fewest:
        note = "the columns have no names: they are given by number, from 1."
        files = candidate.spec(start, header=False)
        return TextLayout(files, ("",) * width, (), (note,))
    if len(above) != width or len(set(above)) < width:
        return _numbered(candidate, above, width)
    files = candidate.spec(start - 1)
    note = f"{start - 1} row(s) stand above the names and are skipped."
    return TextLayout(files, above, (), (note,) if start > 1 else ())


def _beside_numbers(candidate: _Candidate, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of fewer columns than there are, beside "" for a first one that counts rows."""
    rows = candidate.rows[candidate.start or 0 :][:_IN_A_ROW]
    unnamed = ("",) * (len(rows[0]) - len(names))
    counts = [[str(k) for k in range(first, first + len(rows))] for first in (0, 1)]
    return unnamed + names if [row[0] for row in rows] in counts else names + unnamed


def _full_names(rows: Sequence[tuple[str, ...]], at: int) -> tuple[str, ...]:
    """Return names that stand twice behind what stands above them, over several columns at once."""
    names = rows[at]
    above = rows[at - 1] if at else ()
    written = [cell for cell in names if cell]
    if len(set(written)) == len(written) or not any(above) or abs(len(above) - len(names)) > 1:
        return names
    group, full = "", []
    for over, name in zip((*above, ""), names, strict=False):
        group = over or group
        full.append(f"{group} {name}".strip() if name else "")
    return tuple(full)


def _numbered(candidate: _Candidate, above: tuple[str, ...], width: int) -> TextLayout:
    """Return a layout of columns by number: the names above them do not tell them apart."""
    start = candidate.start or 0
    files = candidate.spec(start, header=False)
    names = _full_names(candidate.rows, start - 1)
    if len(names) == width + 1:  # a label or a sign of comment in front, or a delimiter at the end
        names = names[:-1] if not names[-1] else names[1:]
    if len(names) < width:
        names = _beside_numbers(candidate, names)
    why = f"row {start} names {len(above)} column(s), {width} stand under it"
    if len(above) == width:
        why = f"row {start} gives one name to several columns"
    return TextLayout(files, names, (), (f"{why}: columns are given by number, from 1.",))


def _stated_layout(candidate: _Candidate, known: Mapping[str, Any]) -> TextLayout:
    """Return the layout of a table that begins where it is said to, else where it was found."""
    header = bool(known.get("header", True))
    above = 0 if "skip_rows" in known else max((candidate.start or 0) - header, 0)
    files = candidate.spec(int(known.get("skip_rows") or above), header=header)
    row = candidate.rows[above]
    note = f"{above} row(s) stand above the table and are skipped."
    return TextLayout(files, row if header else ("",) * len(row), (), (note,) if above else ())


def _is_units(row: tuple[str, ...]) -> bool:
    """Whether a row holds units: each is short, and most are known or stand in brackets."""
    written = [cell for cell in row if cell]
    bare = _bare(tuple(written))
    if not all(_UNIT_LIKE.fullmatch(name) for name in bare if name):
        return False
    cells = zip(written, bare, strict=True)
    likely = sum(bool(_BRACKETED.match(cell)) or is_unit(name) for cell, name in cells)
    return 2 * likely > len(written)


def _bare(row: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(cell.strip("[]() ") for cell in row)
