"""Checks of the covariances of stiffness, damping and inertia."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from jointz.collections.checking.entry_checks import Violation
from jointz.collections.entry_reader import ConditionTables
from jointz.core.gait_phases import ALL_POINTS

PARAMETERS = ("stiffness", "damping", "inertia")
#: Columns of the file of covariances, in the order of the parameters.
COLUMNS = tuple(f"with_{name}" for name in PARAMETERS)
_KEYS = ["participant", "session", "side", "timing_point"]
_ROUNDING = 1e-6
#: A correlation matrix with a smaller eigenvalue is none that can be inverted.
_SMALLEST = 1e-9


def covariance_violations(tables: ConditionTables, method: str) -> Iterator[Violation]:
    """Yield what is wrong with the covariances of a condition."""
    covariance, file = tables.covariance, str(tables.condition.covariance)
    if covariance is None or covariance.empty:
        return
    values = tables.rows
    if "method" in values:  # a publication has one
        values = values[values["method"] == method]
    wrong = ~covariance["parameter"].isin(PARAMETERS) | ~_has_estimate(covariance, values)
    wrong |= covariance.duplicated([*_KEYS, "parameter"])
    if wrong.any():
        expected = "one row for an estimate of stiffness, damping or inertia, and no other"
        yield "covariance_row", file, expected, _who(covariance, wrong, "parameter")
        return
    cells, matrices, present = _matrices(covariance)
    if (asymmetric := _asymmetric(matrices, present)).any():
        yield "covariance_asymmetric", file, "a symmetric matrix", _who(cells, asymmetric)
    if (not_positive := _not_positive(matrices, present)).any():
        expected = "a positive definite matrix without gaps"
        yield "covariance_not_positive_definite", file, expected, _who(cells, not_positive)


def _has_estimate(covariance: pd.DataFrame, values: pd.DataFrame) -> pd.Series:
    """Tell which rows belong to an estimate; one inertia may serve all timing points."""
    places = pd.MultiIndex.from_frame(values[[*_KEYS, "parameter"]])
    own = pd.MultiIndex.from_frame(covariance[[*_KEYS, "parameter"]]).isin(places)
    shared = covariance[[*_KEYS, "parameter"]].assign(timing_point=ALL_POINTS)
    is_shared = pd.MultiIndex.from_frame(shared).isin(places)
    return pd.Series(own | is_shared, index=covariance.index)


def _matrices(covariance: pd.DataFrame) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """Return cells, their matrices (n, 3, 3), and which parameters they hold (n, 3)."""
    code, cells = pd.factorize(pd.MultiIndex.from_frame(covariance[_KEYS]))
    row = covariance["parameter"].map({name: k for k, name in enumerate(PARAMETERS)}).to_numpy()
    matrices = np.full((len(cells), 3, 3), np.nan)
    matrices[code, row] = covariance[list(COLUMNS)].to_numpy(float)
    present = np.zeros((len(cells), 3), dtype=bool)
    present[code, row] = True
    return pd.DataFrame(list(cells), columns=_KEYS), matrices, present


def _inside(present: np.ndarray) -> np.ndarray:
    pairs: np.ndarray = present[:, :, None] & present[:, None, :]
    return pairs


def _asymmetric(matrices: np.ndarray, present: np.ndarray) -> np.ndarray:
    size = np.sqrt(np.abs(np.einsum("nii->ni", matrices)))
    apart = np.abs(matrices - matrices.transpose(0, 2, 1))
    wrong = apart > _ROUNDING * size[:, :, None] * size[:, None, :]
    asymmetric: np.ndarray = (wrong & _inside(present)).any(axis=(1, 2))
    return asymmetric


def _not_positive(matrices: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Tell which matrices, of the parameters they hold, are not positive definite."""
    inside = _inside(present)
    whole = np.where(inside, matrices, np.eye(3))
    finite = np.isfinite(whole).all(axis=(1, 2))
    variances = np.einsum("nii->ni", whole)
    finite &= (np.where(np.isfinite(variances), variances, 0.0) > 0).all(axis=1)
    matrices = np.where(finite.reshape(-1, 1, 1), whole, np.eye(3))
    sd = np.sqrt(np.einsum("nii->ni", matrices))
    scaled = matrices / (sd[:, :, None] * sd[:, None, :])
    smallest = np.linalg.eigvalsh((scaled + scaled.transpose(0, 2, 1)) / 2)[:, 0]
    not_positive: np.ndarray = ~finite | (smallest < _SMALLEST)
    return not_positive


def _who(table: pd.DataFrame, wrong: pd.Series | np.ndarray, *columns: str) -> str:
    """Name the first row that is wrong, and count the others."""
    first, n = table[wrong].iloc[0], int(wrong.sum())
    name = " ".join(str(first[key]) for key in ("participant", "timing_point", *columns))
    return f"{name}, and {n - 1} more" if n > 1 else name
