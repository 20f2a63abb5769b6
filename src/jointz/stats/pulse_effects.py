"""Tests of the sign and direction of pulses on the estimates (2.2.4).

The rows are pulses. As printed, every pulse is taken as independent; beside it, the trial of a
pulse is a random factor.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from jointz.core.errors import DataError
from jointz.kernels.statistics.anova import FTest, holm, one_way_anova
from jointz.kernels.statistics.kenward_roger import satterthwaite_test
from jointz.kernels.statistics.mixed_model_components import ComponentsFit, fit_random_intercept
from jointz.results.statistics.pulse_effect_tests import (
    PulseEffects,
    PulseMeans,
    PulseTest,
    Undecided,
    finite_or_none,
)

#: Correlation of type and direction from which on they are not told apart: a variance
#: inflation of 10.
CONFOUNDED_FROM = 0.9**0.5
RESPONSES = ("stiffness", "inertia")
COLUMNS = ("case", "trajectory", "trial", "sign", "direction", *RESPONSES)

#: Fewer leave no error to compare two levels with.
_FEWEST_PULSES = 3
_EFFECTS = ("type", "direction", "type:direction")


@dataclass(frozen=True, slots=True)
class _Pulses:
    """The complete pulses of one case and trajectory."""

    case: str
    trajectory: str
    response: str
    estimates: np.ndarray  # N*m/rad or kg*m^2, by ``response``
    sign: np.ndarray
    along: np.ndarray
    trial: np.ndarray
    n_excluded: int


@dataclass(frozen=True, slots=True)
class _Model:
    """The testable effects of a cell, and the reasons for the others."""

    names: tuple[str, ...]
    columns: tuple[np.ndarray, ...]
    undecided: dict[str, Undecided]
    joint_only: bool = False


def pulse_effects(table: pd.DataFrame, *, alpha: float = 0.05) -> PulseEffects:
    """Test type and direction of pulses on stiffness and inertia, per case and trajectory.

    Parameters
    ----------
    table : pandas.DataFrame
        One row a pulse, with columns ``case``, ``trajectory``, ``trial`` (a trial belongs to
        its case and trajectory), ``sign`` (+1 or -1, the type of the perturbation),
        ``direction`` (``with`` or ``against`` the trajectory: sign of the reference's slope
        at the onset times the pulse's sign), ``stiffness`` (N*m/rad), ``inertia`` (kg*m^2).
        A pulse without an estimate, sign or direction (NaN) is left out and counted.
    alpha : float
        Level for the counts and intervals.

    Returns
    -------
    PulseEffects
        ``one_way``: the four one-way ANOVAs of every case and trajectory, as printed.
        ``mixed``: response ~ type * direction with trial as a random intercept (REML,
        Satterthwaite), Holm-adjusted over all its decided tests in the table.

    Raises
    ------
    DataError
        When columns are missing, a case, trajectory or trial has no name, or sign,
        direction or an estimate holds something else than it may.

    Notes
    -----
    Where type and direction go together (:data:`CONFOUNDED_FROM`; reference E rises at all
    four onsets) the mixed model gives one ``joint`` test and leaves the single effects
    undecided; the one-way tests are then one test printed twice. Pulses of a trial share
    its error: one-way tests are too bold where the type varies between trials and too
    timid where it is balanced inside them. The mixed model takes effects as equal in all
    trials and residuals as independent and of one variance.

    Examples
    --------
    >>> import pandas as pd
    >>> sign, direction = [1, 1, -1, -1] * 4, ["with", "against"] * 8
    >>> stiffness = [168 + 2 * s + 0.1 * (k * 7 % 5) for k, s in enumerate(sign)]
    >>> table = pd.DataFrame({"case": 1, "trajectory": "A", "sign": sign,
    ...     "trial": [k // 8 for k in range(16)], "direction": direction,
    ...     "stiffness": stiffness, "inertia": [0.03 + 1e-4 * (k * 3 % 7) for k in range(16)]})
    >>> effects = pulse_effects(table)
    >>> effects.count("significant", "mixed", "stiffness", "type").share_pct
    100.0
    """
    rows = _check(table, alpha)
    tests: list[PulseTest] = []
    means: list[PulseMeans] = []
    notes: list[str] = []
    for (case, trajectory), cell in rows.groupby(["case", "trajectory"], sort=False):
        for response in RESPONSES:
            pulses = _complete(cell, str(case), str(trajectory), response)
            model = _model(pulses)
            fit, failure = _fit(pulses, model)
            tests += [*_one_way_tests(pulses), *_mixed_tests(pulses, model, fit, failure, alpha)]
            means.append(_means(pulses, fit))
            notes += _notes(pulses, model)
    return PulseEffects(_adjusted(tests), tuple(means), alpha, tuple(dict.fromkeys(notes)))


def _check(table: pd.DataFrame, alpha: float) -> pd.DataFrame:
    if not 0 < alpha < 1:
        raise DataError(f"pulse_effects: expected 0 < alpha < 1, got {alpha}")
    missing = [name for name in COLUMNS if name not in table.columns]
    if missing:
        raise DataError(
            f"table of pulses: expected columns {', '.join(COLUMNS)}; "
            f"missing {', '.join(missing)}. Rename or add them"
        )
    problems = [*_label_problems(table), *_value_problems(table)]
    if problems:
        raise DataError("table of pulses: " + "; ".join(problems))
    return table[list(COLUMNS)]


def _label_problems(table: pd.DataFrame) -> Iterator[str]:
    for name in ("case", "trajectory", "trial"):
        unnamed = table.index[table[name].isna()].tolist()
        if unnamed:
            yield f"column {name!r} must name every pulse, row {unnamed[0]!r} has none"
    allowed: dict[str, tuple[Any, ...]] = {"sign": (1, -1), "direction": ("with", "against")}
    for name, levels in allowed.items():
        other = table[name][~table[name].isin(levels) & table[name].notna()]
        if len(other):
            choice = " or ".join(repr(level) for level in levels)
            (row, value), *_ = zip(other.index.tolist(), other.tolist(), strict=True)
            yield f"column {name!r} must be {choice}, row {row!r} has {value!r}"


def _value_problems(table: pd.DataFrame) -> Iterator[str]:
    for name in RESPONSES:
        if not pd.api.types.is_numeric_dtype(table[name]) and table[name].notna().any():
            yield f"column {name!r} must hold numbers, it holds {table[name].dtype}"


def _complete(cell: pd.DataFrame, case: str, trajectory: str, response: str) -> _Pulses:
    values = cell[response].to_numpy(dtype=float, na_value=np.nan)
    known = np.isfinite(values) & (cell["sign"].notna() & cell["direction"].notna()).to_numpy()
    kept = cell[known]
    return _Pulses(
        case=case,
        trajectory=trajectory,
        response=response,
        estimates=values[known],
        sign=kept["sign"].to_numpy(dtype=float),
        along=np.where(kept["direction"] == "with", 1.0, -1.0),
        trial=pd.factorize(kept["trial"])[0],
        n_excluded=int((~known).sum()),
    )


def _correlation(pulses: _Pulses) -> float | None:
    """Return that of type and direction; None where one of them does not vary."""
    if np.unique(pulses.sign).size < 2 or np.unique(pulses.along).size < 2:
        return None
    return float(np.corrcoef(pulses.sign, pulses.along)[0, 1])


def _model(pulses: _Pulses) -> _Model:
    sign, along = pulses.sign, pulses.along
    levels = {"type": sign, "direction": along}
    undecided = {
        name: Undecided.ONE_LEVEL for name, level in levels.items() if np.unique(level).size < 2
    }
    if undecided:
        undecided["type:direction"] = Undecided.ONE_LEVEL
        rest = {name: level for name, level in levels.items() if name not in undecided}
        return _Model(tuple(rest), tuple(rest.values()), undecided)
    correlation = abs(_correlation(pulses) or 0.0)
    if correlation >= CONFOUNDED_FROM:
        all_confounded = dict.fromkeys(_EFFECTS, Undecided.CONFOUNDED)
        kept = _independent([sign, along, sign * along])
        return _Model(("joint",) * len(kept), kept, all_confounded, joint_only=True)
    if len(set(zip(sign, along, strict=True))) < 4:
        missing = {"type:direction": Undecided.MISSING_COMBINATION}
        return _Model(_EFFECTS[:2], (sign, along), missing)
    return _Model(_EFFECTS, (sign, along, sign * along), {})


def _independent(columns: list[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return the columns that add something to a constant and to those before."""
    kept = [np.ones_like(columns[0])]
    for column in columns:
        if np.linalg.matrix_rank(np.column_stack([*kept, column])) > len(kept):
            kept.append(column)
    return tuple(kept[1:])


def _fit(pulses: _Pulses, model: _Model) -> tuple[ComponentsFit | None, Undecided | None]:
    if pulses.estimates.size <= len(model.columns) + 1:
        return None, Undecided.TOO_FEW_PULSES
    design = np.column_stack([np.ones_like(pulses.estimates), *model.columns])
    if _takes_up_trials(design, pulses.trial):
        return None, Undecided.TOO_FEW_TRIALS
    try:
        return fit_random_intercept(design, pulses.estimates, pulses.trial), None
    except ValueError:
        # The design has full rank and all is finite: only variation can be missing.
        return None, Undecided.NO_VARIATION


def _takes_up_trials(design: np.ndarray, trial: np.ndarray) -> bool:
    """Return whether the effects explain any difference between several trials."""
    of_trial = (trial[:, None] == np.unique(trial)).astype(float)
    several = 1 < of_trial.shape[1] < trial.size
    rank = int(np.linalg.matrix_rank(np.hstack([design, of_trial])))
    return bool(several and rank == design.shape[1])


def _one_way_tests(pulses: _Pulses) -> Iterator[PulseTest]:
    for effect, level in (("type", pulses.sign), ("direction", pulses.along)):
        blank = _undecided(pulses, effect, "one_way")
        if pulses.estimates.size < _FEWEST_PULSES:
            yield replace(blank, code=Undecided.TOO_FEW_PULSES)
        elif np.unique(level).size < 2:
            yield replace(blank, code=Undecided.ONE_LEVEL)
        else:
            try:
                test = one_way_anova(pulses.estimates, level)
            except ValueError:
                yield replace(blank, code=Undecided.NO_VARIATION)
            else:
                up, down = pulses.estimates[level > 0].mean(), pulses.estimates[level < 0].mean()
                yield replace(_decided(blank, test), difference=float(up - down))


def _mixed_tests(
    pulses: _Pulses,
    model: _Model,
    fit: ComponentsFit | None,
    failure: Undecided | None,
    alpha: float,
) -> Iterator[PulseTest]:
    for effect in _EFFECTS:
        blank = _undecided(pulses, effect, "mixed")
        if pulses.estimates.size < _FEWEST_PULSES:
            yield replace(blank, code=Undecided.TOO_FEW_PULSES)
        elif effect in model.undecided:
            yield replace(blank, code=model.undecided[effect])
        elif fit is None:
            yield replace(blank, code=failure or "")
        else:
            k = model.names.index(effect) + 1
            yield _single(blank, fit, k, alpha)
    if model.joint_only:
        blank = _undecided(pulses, "joint", "mixed")
        if fit is None:
            yield replace(blank, code=failure or "")
        else:
            yield _decided(blank, satterthwaite_test(fit, np.eye(fit.beta.size)[1:]))


def _single(blank: PulseTest, fit: ComponentsFit, k: int, alpha: float) -> PulseTest:
    test = satterthwaite_test(fit, np.eye(fit.beta.size)[k])
    decided = _decided(blank, test)
    if blank.effect == "type:direction":
        return decided
    # Levels are coded -1 and 1: a difference is twice the effect.
    value = 2.0 * float(fit.beta[k])
    half = 2.0 * float(np.sqrt(fit.covariance[k, k]) * stdtrit(test.df_den, 1.0 - alpha / 2.0))
    return replace(decided, difference=value, ci_low=value - half, ci_high=value + half)


def _undecided(pulses: _Pulses, effect: str, analysis: str) -> PulseTest:
    names = ("statistic", "df_num", "df_den", "p", "p_holm", "difference", "ci_low", "ci_high")
    no_numbers: dict[str, Any] = dict.fromkeys(names)
    return PulseTest(
        case=pulses.case,
        trajectory=pulses.trajectory,
        response=pulses.response,
        effect=effect,
        analysis=analysis,
        **no_numbers,
        n_pulses=pulses.estimates.size,
        n_trials=np.unique(pulses.trial).size,
        status="undecided",
    )


def _decided(blank: PulseTest, test: FTest) -> PulseTest:
    numbers = asdict(test) | {"statistic": finite_or_none(test.statistic)}
    return replace(blank, **numbers, status="ok", code="")


def _means(pulses: _Pulses, fit: ComponentsFit | None) -> PulseMeans:
    def mean(which: np.ndarray) -> float | None:
        return float(pulses.estimates[which].mean()) if which.any() else None

    return PulseMeans(
        case=pulses.case,
        trajectory=pulses.trajectory,
        response=pulses.response,
        positive=mean(pulses.sign > 0),
        negative=mean(pulses.sign < 0),
        along=mean(pulses.along > 0),
        against=mean(pulses.along < 0),
        n_used=pulses.estimates.size,
        n_excluded=pulses.n_excluded,
        trial_sd=None if fit is None else float(np.sqrt(fit.variances[0])),
        residual_sd=None if fit is None else float(np.sqrt(fit.variances[1])),
        confounding=_correlation(pulses),
    )


def _notes(pulses: _Pulses, model: _Model) -> Iterator[str]:
    named = pulses.case[:1].isalpha()  # such as the load "case-1"
    cell = f"{pulses.case if named else f'case {pulses.case}'}, trajectory {pulses.trajectory}"
    if model.joint_only:
        yield (
            f"{cell}: type and direction are confounded (correlation "
            f"{_correlation(pulses):.2f}); only their joint effect is tested"
        )
    if pulses.n_excluded:
        yield f"{cell}: {pulses.n_excluded} pulses without {pulses.response}, sign or direction"
    if pulses.estimates.size and np.unique(pulses.trial).size == 1:
        yield f"{cell}: one trial only; effects hold for that trial"


def _adjusted(tests: list[PulseTest]) -> tuple[PulseTest, ...]:
    for analysis in ("one_way", "mixed"):
        family = [k for k, t in enumerate(tests) if t.analysis == analysis and t.p is not None]
        p = holm(np.array([tests[k].p for k in family], dtype=float))
        for k, value in zip(family, p, strict=True):
            tests[k] = replace(tests[k], p_holm=float(value))
    return tuple(tests)
