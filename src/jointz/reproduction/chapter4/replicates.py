"""Chapter IV again: how often replicates as people find what is not there (4.3.2.2)."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import binomtest

from jointz.reference import chapter4
from jointz.reproduction.chapter4.rows import (
    N_ROWS,
    PARAMETERS,
    STRICT,
    fitting_scatter,
    mean_squares,
)
from jointz.reproduction.reproduction_tables import Claim, ClaimTable
from jointz.stats import mixed_model

_LEVELS: Final = (chapter4.SIGNIFICANCE_LEVEL, STRICT)
#: Scatter of rows inside their cell over the residual SD, which the dissertation does not print.
_SCATTERS: Final = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
_QUANTILES: Final = np.linspace(0.0, 1.0, 101)


def replicates_published() -> ClaimTable:
    """Return what the published tables give where rows of a cell count as people."""
    rows = []
    for parameter, (name, _) in PARAMETERS.items():
        claims = list(chapter4.PAIRS[parameter].values())
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
                where="4.3.2.2",
                claim=f"all that is stated of {name}",
                printed=f"timing point and subject p < 0.001; {apart} pairs different, "
                f"{alike} similar",
                ours=ours,
                # Verdicts of these statements stand where they are made, each once.
                verdict="worth knowing",
                remark="consistent with replicates taken as people; not proof of it",
            )
        )
    return ClaimTable(
        "replicates_published",
        "The published tables with replicates as people (4.3.2.2)",
        f"The cells of tables 4.1 to 4.3 as means of {N_ROWS} rows, every row taken as "
        "independent: y ~ tp + subject, pairs by pooled error with Bonferroni. How far rows "
        "scatter inside their cell is not printed; residual SD is that of one value a cell.",
        tuple(rows),
    )


# --- studies without an effect -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Studies:
    """Simulated studies: p of timing point and of participant, by either analysis."""

    cells: tuple[np.ndarray, np.ndarray]
    rows: tuple[np.ndarray, np.ndarray]


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
    for parameter, (name, unit) in PARAMETERS.items():
        person, residual = _variances(parameter)
        fits = fitting_scatter(parameter, n_rows)
        inside = scatter**2 * residual
        studies = _simulated(rng, (person, residual, inside), **options)
        nobody = _simulated(rng, (0.0, residual, inside), **options)
        by_scatter = [_simulated(rng, (person, residual, s**2 * residual), **options)
                      for s in _SCATTERS]  # fmt: skip
        rates = {
            "timing point, without an effect": _rates(studies, 0),
            "subject, nobody differs": _rates(nobody, 1),
            "subject, people differ as fitted": _rates(studies, 1),
        }
        claims += [_claim(f"{name}: {what}", found) for what, found in rates.items()]
        curves[parameter] = _curve(studies) | {
            "name": name,
            "unit": unit,
            "participant_sd": person**0.5,
            "residual_sd": residual**0.5,
            "rates": rates,
            "fitting_scatter": None if fits is None else list(fits),
            "scatter": list(_SCATTERS),
            "rows_below_strict": [float((s.rows[0] < STRICT).mean()) for s in by_scatter],
        }
    table = ClaimTable(
        "replicates",
        "Replicates as people, where there is no effect",
        f"{n_simulations} simulated studies a parameter, ten people by six timing points, with the "
        "variances of the mixed model of tables 4.1 to 4.3 and no difference between timing "
        f"points; {n_rows} rows a cell that scatter by {scatter:g} residual SD (not printed). "
        "Replicates as people: all rows as independent, y ~ tp + subject. Without an effect a "
        "sound test has p < 0.05 in 5 % and p < 0.001 in 0.1 % of studies. That the dissertation "
        "took rows as independent is not stated: its p-values are consistent with it, which is not "
        "proof.",
        tuple(claims),
    )
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
    shape = (n, len(chapter4.SUBJECTS), len(chapter4.POINT_NUMBERS))
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
