"""The printed tables of chapter IV with rows of a cell counted as people (4.3.2.2).

Rows of a cell are pulses or bootstrap replicates of one person at one timing point. In balanced
data the mean and the scatter of every cell hold all that the analysis of rows uses, so that no row
is needed here.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import fdtrc, fdtri, stdtrit
from scipy.stats import binomtest

from jointz.core.channels import PARAMETER_UNITS
from jointz.reference import chapter4
from jointz.stats import mixed_model
from reproduction import printed_numbers
from reproduction.printed_numbers import PARAMETER_NAMES
from reproduction.reproduction_tables import Claim, ClaimTable, claim_table

#: Pulses a timing point (4.2.2); the number of bootstrap groups is not stated.
N_ROWS: Final = 50
#: Printed limit of p (4.3.2.2).
STRICT: Final = 0.001
_LEVELS: Final = (printed_numbers.SIGNIFICANCE_LEVEL, STRICT)
#: Scatter of rows inside their cell over the residual SD, which the dissertation does not print.
_SCATTERS: Final = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
_QUANTILES: Final = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True, slots=True)
class MeanSquares:
    """Mean squares of complete tables of participants by timing points, one value a cell."""

    point: np.ndarray  # mean square of the timing points, unit of the cells squared
    participant: np.ndarray  # mean square of the participants, unit of the cells squared
    error: np.ndarray  # residual mean square, unit of the cells squared
    n_participants: int  # participants of a table
    n_points: int  # timing points of a table

    @property
    def df(self) -> tuple[int, int, int]:
        """Degrees of freedom of timing points, participants, and the rest."""
        p, t = self.n_participants, self.n_points
        return t - 1, p - 1, (p - 1) * (t - 1)

    def p_of_cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Return p of timing point and of participant, one value a cell."""
        points, people, rest = self.df
        return (
            fdtrc(points, rest, self.point / self.error),
            fdtrc(people, rest, self.participant / self.error),
        )

    def p_of_rows(self, scatter: np.ndarray | float, n_rows: int) -> tuple[np.ndarray, np.ndarray]:
        """Return both p where every row counts as independent: ``y ~ tp + subject`` over rows.

        That of the timing point is also that of ``y ~ tp + (1 | subject)`` over rows, as long as
        the variance of participants is above 0.
        """
        points, people, _ = self.df
        error, rest = self.error_of_rows(scatter, n_rows), self.df_of_rows(n_rows)
        return (
            fdtrc(points, rest, n_rows * self.point / error),
            fdtrc(people, rest, n_rows * self.participant / error),
        )

    def error_of_rows(self, scatter: np.ndarray | float, n_rows: int) -> np.ndarray:
        """Return the mean square of error over rows."""
        inside = self.n_participants * self.n_points * (n_rows - 1) * scatter
        return np.asarray((n_rows * self.df[2] * self.error + inside) / self.df_of_rows(n_rows))

    def df_of_rows(self, n_rows: int) -> int:
        """Return the degrees of freedom of error over rows."""
        return self.n_participants * self.n_points * n_rows - sum(self.df[:2]) - 1


def mean_squares(cells: np.ndarray) -> MeanSquares:
    """Return the mean squares of participants by timing points."""
    people, points = cells.shape[-2:]
    centred = cells - cells.mean(axis=(-2, -1), keepdims=True)
    of_point, of_person = centred.mean(axis=-2), centred.mean(axis=-1)
    rest = centred - of_point[..., None, :] - of_person[..., :, None]
    return MeanSquares(
        point=people * (of_point**2).sum(axis=-1) / (points - 1),
        participant=points * (of_person**2).sum(axis=-1) / (people - 1),
        error=(rest**2).sum(axis=(-2, -1)) / ((people - 1) * (points - 1)),
        n_participants=people,
        n_points=points,
    )


def published_cells(parameter: str) -> np.ndarray:
    """Return a published table, one row a participant, one column a timing point."""
    table = chapter4.TABLES[parameter]
    return np.array([[row[s].value for row in table.values()] for s in chapter4.SUBJECTS])


# --- the published tables ------------------------------------------------------------------------


def fitting_scatter(parameter: str, n_rows: int = N_ROWS) -> tuple[float, float] | None:
    """Return the scatter of rows with which the printed claims come out of the printed tables.

    The means of rows are taken to be the cells of tables 4.1 to 4.3, as printed. That there is
    such a scatter is consistent with rows taken as people; it is no proof that they were.
    """
    cells = published_cells(parameter)
    squares = mean_squares(cells)
    alike, apart = _printed_differences(parameter, cells.mean(axis=0))
    # Of the error over rows: what leaves those alike unfound, and what still finds the others.
    per_square = 1.0 / _critical_difference(squares, 1.0, n_rows) ** 2
    highest = min(apart**2 * per_square, *_largest_errors(squares, n_rows))
    low, high = (_scatter_of(squares, e, n_rows) for e in (alike**2 * per_square, highest))
    if high < max(low, 0.0):
        return None
    return float(np.sqrt(max(low, 0.0))), float(np.sqrt(high))


def largest_scatter(parameter: str, n_rows: int = N_ROWS) -> tuple[float | None, float | None]:
    """Return up to which scatter of rows timing point and subject have p < 0.001."""
    squares = mean_squares(published_cells(parameter))
    found = [_scatter_of(squares, e, n_rows) for e in _largest_errors(squares, n_rows)]
    point, subject = (float(np.sqrt(of)) if of >= 0.0 else None for of in found)
    return point, subject


def critical_difference(parameter: str, scatter: float, n_rows: int = N_ROWS) -> float:
    """Return the difference of two timing points that rows as people find, Bonferroni at 0.05."""
    squares = mean_squares(published_cells(parameter))
    error = squares.error_of_rows(scatter**2 * squares.error, n_rows)
    return _critical_difference(squares, float(error), n_rows)


def _critical_difference(squares: MeanSquares, error: float, n_rows: int) -> float:
    n_pairs = squares.n_points * (squares.n_points - 1) // 2
    tail = printed_numbers.SIGNIFICANCE_LEVEL / 2.0 / n_pairs
    t = float(stdtrit(squares.df_of_rows(n_rows), 1.0 - tail))
    return float(t * np.sqrt(2.0 * error / (n_rows * squares.n_participants)))


def _largest_errors(squares: MeanSquares, n_rows: int) -> list[float]:
    """Return the largest errors over rows with p < 0.001 of timing point, of participant."""
    rest = squares.df_of_rows(n_rows)
    return [
        n_rows * float(of) / float(fdtri(df, rest, 1.0 - STRICT))
        for of, df in zip((squares.point, squares.participant), squares.df[:2], strict=True)
    ]


def _printed_differences(parameter: str, means: np.ndarray) -> tuple[float, float]:
    """Return the largest difference called similar and the smallest called different."""
    place = {point: k for k, point in enumerate(chapter4.TABLES[parameter])}
    sizes: dict[str, list[float]] = {"similar": [], "different": [], "not stated": []}
    for (a, b), claim in printed_numbers.PAIRS[parameter].items():
        sizes[claim].append(abs(float(means[place[a]] - means[place[b]])))
    return max(sizes["similar"]), min(sizes["different"])


def _scatter_of(squares: MeanSquares, error: float, n_rows: int) -> float:
    """Return the variance inside cells, over that of error, that makes an error over rows."""
    inside = squares.n_participants * squares.n_points * (n_rows - 1)
    own = float(squares.error)
    return (error * squares.df_of_rows(n_rows) - n_rows * squares.df[2] * own) / inside / own


def replicates_published() -> ClaimTable:
    """Return what the published tables give where rows of a cell count as people."""
    rows = []
    for parameter, name in PARAMETER_NAMES.items():
        claims = list(printed_numbers.PAIRS[parameter].values())
        apart, alike = claims.count("different"), claims.count("similar")
        fits = fitting_scatter(parameter)
        ours = "no scatter of rows gives all of these"
        if fits is not None:
            ours = (
                f"all of these with {N_ROWS} rows a cell that scatter inside it by {fits[0]:.2f} "
                f"to {fits[1]:.2f} residual SD"
            )
        rows.append(
            Claim(
                "4.3.2.2",
                f"all that is stated of {name}",
                f"timing point and subject p < 0.001; {apart} pairs different, {alike} similar",
                ours,
                # Verdicts of these statements stand where they are made, each once.
                "worth knowing",
                "consistent with replicates taken as people; not proof of it",
            )
        )
    return claim_table(4, "replicates_published", rows, n_rows=N_ROWS)


# --- studies without an effect -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Studies:
    """Simulated studies: p of timing point and of participant, by either analysis."""

    cells: tuple[np.ndarray, np.ndarray]  # p of timing point, p of participant; one value a cell
    rows: tuple[np.ndarray, np.ndarray]  # p of timing point, p of participant; replicates as rows


def replicates_as_people(
    seed: int, n_simulations: int = 4000, *, n_rows: int = N_ROWS, scatter: float = 1.0
) -> tuple[ClaimTable, dict[str, Any]]:
    """Return how often studies like the published one find what is not there.

    Variances of participants and of cells are those of the mixed model of tables 4.1 to 4.3;
    timing points do not differ. Cells and rows are normal, of equal variance everywhere; real
    cells are neither, which changes the shares of both analyses, not the difference between them.
    """
    rng = np.random.default_rng(seed)
    options: dict[str, Any] = {"n": n_simulations, "n_rows": n_rows}
    claims, curves = [], {}
    for parameter, name in PARAMETER_NAMES.items():
        person, residual = _variances(parameter)
        fits = fitting_scatter(parameter, n_rows)
        inside = scatter**2 * residual
        studies = _simulated(rng, (person, residual, inside), **options)
        nobody = _simulated(rng, (0.0, residual, inside), **options)
        by_scatter = [
            _simulated(rng, (person, residual, s**2 * residual), **options) for s in _SCATTERS
        ]
        rates = {
            "timing point, without an effect": _rates(studies, 0),
            "subject, nobody differs": _rates(nobody, 1),
            "subject, people differ as fitted": _rates(studies, 1),
        }
        claims += [_claim(f"{name}: {what}", shares) for what, shares in rates.items()]
        curves[parameter] = _curve(studies) | {
            "name": name,
            "unit": PARAMETER_UNITS[parameter],
            "participant_sd": person**0.5,
            "residual_sd": residual**0.5,
            "rates": rates,
            "fitting_scatter": None if fits is None else list(fits),
            "scatter": list(_SCATTERS),
            "rows_below_strict": [float((s.rows[0] < STRICT).mean()) for s in by_scatter],
        }
    values = {"n_simulations": n_simulations, "n_rows": n_rows, "scatter": scatter}
    table = claim_table(4, "replicates", claims, **values)
    return table, {"n_rows": n_rows, "scatter": scatter, "parameters": curves}


def _variances(parameter: str) -> tuple[float, float]:
    fit = mixed_model(
        chapter4.participant_table(),
        response=parameter,
        within="timing_point",
        participant="participant",
    )
    return fit.variances.participant, fit.variances.residual


def _simulated(
    rng: np.random.Generator, variances: tuple[float, float, float], *, n: int, n_rows: int
) -> _Studies:
    """Return studies without an effect; variances of participants, cells, rows in a cell."""
    person, cell, inside = variances
    shape = (n, len(chapter4.SUBJECTS), len(printed_numbers.POINT_NUMBERS))
    means = np.sqrt(cell + inside / n_rows) * rng.standard_normal(shape)
    means += np.sqrt(person) * rng.standard_normal((*shape[:2], 1))
    df = shape[1] * shape[2] * (n_rows - 1)
    squares = mean_squares(means)
    scatter = inside * rng.chisquare(df, n) / df
    return _Studies(squares.p_of_cells(), squares.p_of_rows(scatter, n_rows))


def _rates(studies: _Studies, factor: int) -> list[dict[str, float]]:
    """Return the shares of studies below each level, by either analysis."""
    rates = []
    for level in _LEVELS:
        cells = studies.cells[factor] < level
        interval = binomtest(int(cells.sum()), cells.size).proportion_ci(0.95)
        rates.append(
            {
                "level": level,
                "rows": float((studies.rows[factor] < level).mean()),
                "cells": float(cells.mean()),
                "cells_low": float(interval.low),
                "cells_high": float(interval.high),
            }
        )
    return rates


def _claim(what: str, rates: list[dict[str, float]]) -> Claim:
    rows = ", ".join(f"p < {r['level']:g} in {100.0 * r['rows']:.1f} %" for r in rates)
    cells = ", ".join(
        f"{100.0 * r['cells']:.3g} [{100.0 * r['cells_low']:.2g}, {100.0 * r['cells_high']:.2g}] %"
        for r in rates
    )
    return Claim(
        where="4.3.2.2",
        claim=what,
        printed=f"p < {STRICT:g}",
        ours=f"replicates as people: {rows}; one value a cell: {cells}",
        verdict="worth knowing",
    )


def _curve(studies: _Studies) -> dict[str, list[float]]:
    """Return quantiles of p of the timing point; as logarithms, since rows go far below 0."""
    return {
        f"log10_p_{name}": np.quantile(np.log10(np.maximum(p, 1e-300)), _QUANTILES).tolist()
        for name, p in (("cells", studies.cells[0]), ("rows", studies.rows[0]))
    }
