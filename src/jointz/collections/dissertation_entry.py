"""The dissertation's tables 4.1 to 4.3 as the first entry of a collection: printed values."""

from pathlib import Path
from statistics import fmean, stdev
from typing import Any

import pandas as pd

from jointz.analysis.results_folder import new_folder
from jointz.collections.catalog_columns import PRINTED_COLUMNS
from jointz.collections.entry_model import ENTRY_FILE
from jointz.collections.entry_reader import written_entry
from jointz.core.channels import PARAMETER_UNITS
from jointz.core.gait_phases import TIMING_POINTS
from jointz.io.formats.columns import file_sha256
from jointz.reference import Printed, chapter4

#: Folder and id of the entry.
DISSERTATION = "dissertation"
_PRINTED = "printed.csv"
_PARAMETERS = ("stiffness_per_mass", "damping_per_mass", "inertia")
_SD_NOTE = "sd over the ten printed values; it is not printed itself"
_BOUND = "at_bound"
_LICENCE = "LicenseRef-printed-numbers"
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
        When ``out`` exists or cannot be written.
    """
    with new_folder(out, marker=ENTRY_FILE, overwrite=False) as folder:
        file = folder / _PRINTED
        printed_values().to_csv(file, index=False, float_format="%.10g")
        (folder / f"{_LICENCE}.txt").write_text(_LICENCE_TEXT, encoding="utf-8")
        content = _content() | {"hashes": {_PRINTED: file_sha256(file)}}
        (folder / ENTRY_FILE).write_text(written_entry(content), encoding="utf-8")
    return out / ENTRY_FILE


def printed_values() -> pd.DataFrame:
    """Return tables 4.1 to 4.3 in the columns of printed values."""
    rows = []
    for parameter in _PARAMETERS:
        for point in TIMING_POINTS:
            row = chapter4.TABLES[parameter][point]
            people = [_row(parameter, point, cell, who) for who, cell in row.items()]
            rows += [_mean(parameter, point), *people]
    return pd.DataFrame(rows, columns=list(PRINTED_COLUMNS))


def _row(parameter: str, point: str, cell: Printed, who: str) -> dict[str, Any]:
    at_bound = cell.value < chapter4.NUMERICALLY_ZERO
    return {
        "statistic": "individual" if who else "mean",
        "participant": who,
        "timing_point": point,
        "onset_gait_pct": TIMING_POINTS[point],
        "parameter": parameter,
        "value": cell.value,
        "unit": PARAMETER_UNITS[parameter],
        "n": 1,
        "status": _BOUND if at_bound else "ok",
        "source": cell.source,
        "note": cell.note,
    }


def _mean(parameter: str, point: str) -> dict[str, Any]:
    values = [cell.value for cell in chapter4.TABLES[parameter][point].values()]
    printed = chapter4.MEANS[parameter][point]
    note = "; ".join(filter(None, (printed.note, _SD_NOTE, _apart(printed.value, fmean(values)))))
    told = {"n": len(values), "sd": stdev(values), "note": note}
    return _row(parameter, point, printed, "") | told


def _apart(printed: float, mean: float) -> str:
    """Say where the printed mean is not that of its row, beyond half a digit of any of them."""
    apart = abs(printed - mean) > 0.02 * mean
    return f"the mean of the printed values is {mean:.3g}" if apart else ""


def _content() -> dict[str, Any]:
    return {
        "jointz_entry": 1,
        "study": DISSERTATION,
        "version": "1.0",
        "title": "Knee impedance of ten people in walking: tables 4.1 to 4.3",
        "values": "printed",
        "licence": _LICENCE,
        "cite": "Estimation of Knee Joint Impedance During Walking and its Implications for "
        "Robotic Control and Beyond. Dissertation, chapter IV.",
        "protocol": "walking",
        "exclusions": [],
        "contributors": [{"name": "the author of the dissertation"}],
        "ethics": {
            "approval": "University of Michigan Institutional Review Board, HUM00154646 (4.2.2)",
            "consent": "published",
        },
        "device": {
            "name": "knee exoskeleton (4.2.1)",
            "torque": "motor_current",
            "torque_detail": "equation 4.1: current, friction and rotor inertia",
        },
        "joint": {"name": "knee", "side": "not_stated", "positive": "flexion"},
        "calibration": {"note": "no calibration with its sd is printed"},
        "units": {name: PARAMETER_UNITS[name] for name in _PARAMETERS},
        "method": {
            "name": "dissertation",
            "settings": {"window_s": 0.1, "cutoff_hz": 20.0, "baseline": "unperturbed_mean"},
        },
        "software": {"name": "MATLAB", "version": "R2019b"},
        "sample": _sample(),
        "conditions": [_condition()],
        "raw_data": {"where": "the dissertation does not say"},
    }


def _sample() -> dict[str, Any]:
    return {
        "n": int(chapter4.N_PARTICIPANTS.value),
        "n_female": 4,
        "age_years_mean": chapter4.AGE.value,
        "age_years_sd": chapter4.AGE.sd,
        "mass_kg_mean": chapter4.MASS.value,
        "mass_kg_sd": chapter4.MASS.sd,
        "height_m_mean": chapter4.HEIGHT.value / 100.0,
        "height_m_sd": (chapter4.HEIGHT.sd or 0.0) / 100.0,
    }


def _condition() -> dict[str, Any]:
    """Return 4.2.2 as a condition; a slope is not stated."""
    return {
        "name": "exoskeleton, perturbed (EWP)",
        "activity": "walking",
        "walking_speed_m_s": 1.2,
        "surface": "treadmill",
        "estimates": _PRINTED,
    }
