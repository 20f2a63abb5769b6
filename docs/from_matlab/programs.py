"""Run the other side of the rows and keep what it says, with ``make_from_matlab.py --reference``.

Octave and R run as programs. spm1d is GPL-3 and no dependency of jointz: it needs a Python of
its own (``--spm1d PYTHON``).
"""

import json
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from from_matlab import scripts
from from_matlab.given import as_text, given
from from_matlab.rows import FOLDER, Row, all_rows

REFERENCE = FOLDER / "reference.json"
_TIMEOUT_S = 300
_SCRIPTS: Mapping[str, Any] = {
    "Octave": (".m", scripts.octave),
    "R": (".R", scripts.r),
    "spm1d": (".py", scripts.spm1d),
}


def stored() -> dict[str, Any]:
    """Return the stored values and where they come from."""
    found: dict[str, Any] = json.loads(REFERENCE.read_text(encoding="utf-8"))
    return found


def run_rows(program: str, rows: Iterable[Row], *, spm1d: str = "") -> dict[str, Any]:
    """Run the other side of some rows.

    Parameters
    ----------
    program : str
        ``Octave``, ``R`` or ``spm1d``.
    rows : iterable of Row
        Rows of that program.
    spm1d : str
        The Python that has spm1d.

    Returns
    -------
    dict
        ``version``, and ``values``: id -> list of numbers; see :mod:`from_matlab.scripts`.

    Raises
    ------
    RuntimeError
        When the program, or a row in it, ends with an error; the message holds its words.
    """
    suffix, script = _SCRIPTS[program]
    commands = {"Octave": ["octave-cli", "-qf"], "R": ["Rscript"], "spm1d": [spm1d]}
    with tempfile.TemporaryDirectory() as folder:
        arrays = given()
        for name, values in arrays.items():
            Path(folder, f"{name}.csv").write_text(as_text(values), encoding="utf-8")
        # A name that no function of Octave has: it would take the script's place.
        path = Path(folder, f"snippets_to_compare{suffix}")
        path.write_text(script(tuple(rows), arrays), encoding="utf-8")
        ran = subprocess.run(
            [*commands[program], path.name],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
        out = Path(folder, "values.json")
        # Octave may end badly on its way out with everything written.
        if not out.exists():
            raise RuntimeError(f"{program} ended with {ran.returncode}:\n{ran.stderr[-3000:]}")
        found: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
    if found.pop("errors"):
        raise RuntimeError(f"{program}, rows that failed: {json.dumps(found, indent=1)[-3000:]}")
    return found


def installed(program: str) -> bool:
    """Return whether Octave with its packages, or R with its own, is there.

    Parameters
    ----------
    program : str
        ``Octave`` or ``R``.
    """
    loads = "; ".join(f"pkg load {name}" for name in scripts.OCTAVE_PACKAGES)
    libraries = "; ".join(f"library({name})" for name in scripts.R_PACKAGES)
    probes = {"Octave": ["octave-cli", "-qf", "--eval", loads], "R": ["Rscript", "-e", libraries]}
    if shutil.which(probes[program][0]) is None:
        return False
    ran = subprocess.run(probes[program], capture_output=True, timeout=_TIMEOUT_S, check=False)
    return ran.returncode == 0


def make_reference(*, spm1d: str = "") -> None:
    """Run all rows and write the stored values; rows of spm1d are kept where it is not given.

    Parameters
    ----------
    spm1d : str
        The Python that has spm1d; ``""`` where there is none.
    """
    made: dict[str, Any] = {"programs": {}, "given": fingerprint(), "rows": {}}
    for program in _SCRIPTS:
        own = [row for row in all_rows() if row.program == program]
        if program == "spm1d" and not spm1d:
            before = stored()
            made["programs"][program] = before["programs"][program]
            made["rows"] |= {row.id: before["rows"][row.id] for row in own}
            continue
        ran = run_rows(program, own, spm1d=spm1d)
        made["programs"][program] = ran["version"]
        for row in own:
            kept = {"program": program, "code": row.code, "compared": row.theirs}
            made["rows"][row.id] = kept | {"value": ran["values"][row.id]}
    REFERENCE.write_text(_lines(made), encoding="utf-8")


def fingerprint() -> dict[str, float]:
    """Return a sum over every given array, weighted by place.

    It tells whether the programs saw the data that are made here.
    """
    sums = {}
    for name, values in given().items():
        flat = values.ravel().tolist()
        sums[name] = float(sum((1.0 + k % 7) * x for k, x in enumerate(flat) if x == x))
    return sums


def _lines(made: Mapping[str, Any]) -> str:
    """Return the stored values as json with one line a row."""
    parts = []
    for part, entries in made.items():
        inside = ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in entries.items())
        parts.append(f" {json.dumps(part)}: {{\n{inside}\n }}")
    return "{\n" + ",\n".join(parts) + "\n}\n"
