"""Results folders of people who keep their size."""

import json

import numpy as np
import pandas as pd

from jointz.results.estimates import ESTIMATE_COLUMNS

POINTS = {"LRE": 7.0, "MST": 21.5, "TST": 40.5}
UNITS = {
    "stiffness": "N*m/rad",
    "damping": "N*m*s/rad",
    "inertia": "kg*m^2",
    "stiffness_per_mass": "N*m/rad/kg",
    "damping_per_mass": "N*m*s/rad/kg",
}
SIZES = {"stiffness": 75.0, "damping": 3.0, "inertia": 0.05}
MASS_KG = 70.0
STUDY = {"kind": "walking", "joint": "knee"}
UNDECIDED = {"value": np.nan, "ci_low": np.nan, "ci_high": np.nan, "status": "undecided"}


def estimates(people="ABCDE", *, seed=0, scale=1.0, points=POINTS):
    """Return estimates.csv of people who keep their size, whatever the seed of the noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for k, person in enumerate(people):
        for j, (point, onset) in enumerate(points.items()):
            for name, unit in UNITS.items():
                size = SIZES[name.removesuffix("_per_mass")] / (MASS_KG if "mass" in name else 1.0)
                value = scale * size * (1.0 + 0.1 * k - 0.2 * j + 0.03 * rng.standard_normal())
                row = (person, point, onset, name, value, unit, 0.97 * value, 1.03 * value)
                rows.append((*row, 0.95, 99.0, 50, 0, "rigid", "ok", "", ""))
    return pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS))


def changed(table, where, **values):
    """Return the table with other values in the rows of a query."""
    table = table.copy()
    at = table.eval(where)
    for column, value in values.items():
        table.loc[at, column] = value
    return table


def write_folder(folder, table, *, provenance=None, **study):
    folder.mkdir(parents=True)
    table.to_csv(folder / "estimates.csv", index=False)
    content = {"study": STUDY | study, "study_sha256": folder.name, "jointz": "1.0",
               "settings": {"window_s": 0.1}, "files": ["estimates.csv"]}  # fmt: skip
    text = json.dumps(content if provenance is None else provenance)
    (folder / "provenance.json").write_text(text)
    return folder


def said(made, words):
    return [note for note in made.notes if words in note]
