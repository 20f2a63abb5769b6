"""Entry of the dissertation's printed values, tables 4.1 to 4.3.

``dissertation_entry.toml`` holds its metadata.
"""

import tomllib
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import pandas as pd

from jointz.collections.catalog_columns import PRINTED_COLUMNS
from jointz.collections.entry_model import ENTRY_FILE
from jointz.collections.entry_reader import written_entry
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.formats.columns import file_sha256
from jointz.io.new_folder import new_folder
from jointz.reference import Printed, chapter4

#: Folder and id of the entry.
DISSERTATION = "dissertation"
_METADATA = Path(__file__).with_name("dissertation_entry.toml")
_PRINTED = "printed.csv"
_SD_NOTE = "sd over the ten printed values; it is not printed itself"
_LICENCE_TEXT = """\
Numbers read off the tables of a publication: facts, no text and no figure of it. Who uses them
cites the publication, as `cite` in entry.toml has it. We know of no other condition; this is no
legal advice.
"""


def write_dissertation_entry(out: Path) -> Path:
    """Write the entry of the dissertation's printed values.

    Parameters
    ----------
    out : pathlib.Path
        Folder of the entry; must not exist yet.

    Returns
    -------
    pathlib.Path
        The ``entry.toml``.

    Raises
    ------
    OutputError
        If ``out`` exists or cannot be written.
    """
    content = tomllib.loads(_METADATA.read_text(encoding="utf-8"))
    sizes = {"age_years": (chapter4.AGE, 1.0), "mass_kg": (chapter4.MASS, 1.0),
             "height_m": (chapter4.HEIGHT, 100.0)}  # fmt: skip
    for name, (cell, unit) in sizes.items():
        sd = (cell.sd or 0.0) / unit
        content["sample"] |= {f"{name}_mean": cell.value / unit, f"{name}_sd": sd}
    with new_folder(out, marker=ENTRY_FILE, overwrite=False) as folder:
        file = folder / _PRINTED
        printed_values().to_csv(file, index=False, float_format="%.10g")
        (folder / f"{content['licence']}.txt").write_text(_LICENCE_TEXT, encoding="utf-8")
        content["hashes"] = {_PRINTED: file_sha256(file)}
        (folder / ENTRY_FILE).write_text(written_entry(content), encoding="utf-8")
    return out / ENTRY_FILE


def printed_values() -> pd.DataFrame:
    """Return tables 4.1 to 4.3 in the columns of printed values."""
    rows = []
    for parameter in ("stiffness_per_mass", "damping_per_mass", "inertia"):
        for point, cells in chapter4.TABLES[parameter].items():
            rows.append(_mean(parameter, point))
            rows += [_row(parameter, point, cell, who) for who, cell in cells.items()]
    return pd.DataFrame(rows, columns=list(PRINTED_COLUMNS))


def _row(parameter: str, point: str, cell: Printed, who: str) -> dict[str, Any]:
    return {
        "statistic": "individual" if who else "mean",
        "participant": who,
        "timing_point": point,
        "onset_gait_pct": TIMING_POINTS[point],
        "parameter": parameter,
        "value": cell.value,
        "unit": PARAMETER_UNITS[parameter],
        "n": 1,
        "status": "at_bound" if cell.value < chapter4.NUMERICALLY_ZERO else "ok",
        "source": cell.source,
        "note": cell.note,
    }


def _mean(parameter: str, point: str) -> dict[str, Any]:
    values = [cell.value for cell in chapter4.TABLES[parameter][point].values()]
    printed, mean = chapter4.MEANS[parameter][point], fmean(values)
    notes = [printed.note, _SD_NOTE]
    if abs(printed.value - mean) > 0.02 * mean:  # more than half a digit of each value
        notes.append(f"the mean of the printed values is {mean:.3g}")
    row = _row(parameter, point, printed, "")
    return row | {"n": len(values), "sd": stdev(values), "note": "; ".join(filter(None, notes))}
