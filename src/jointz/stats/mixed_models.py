"""Mixed model of the levels of a factor, participants random."""

from dataclasses import asdict, dataclass, replace
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.special import chdtrc, stdtr, stdtrit

from jointz.core.codes import Failure
from jointz.core.errors import DataError, EstimationError
from jointz.core.provenance import own_version
from jointz.kernels.statistics.anova import FTest
from jointz.kernels.statistics.kenward_roger import (
    kenward_roger_test,
    satterthwaite_test,
    sequential_contrasts,
    single_contrasts,
)
from jointz.kernels.statistics.mixed_model_components import (
    CellBlocks,
    ComponentsFit,
    cell_blocks,
    fit_components,
    fit_random_intercept,
    likelihood_ratio,
)
from jointz.kernels.statistics.mixed_model_groups import (
    GroupVariance,
    NoErrorLeftError,
    group_variance,
)
from jointz.kernels.statistics.repeated_measures import repeated_measures_anova
from jointz.results.statistics.mixed_model_fit import (
    EffectTest,
    IntraclassCorrelation,
    LevelMean,
    LevelPair,
    MixedModelFit,
    RandomEffectTest,
    RepeatedMeasuresTest,
    Variances,
)
from jointz.stats.comparison import paired_difference
from jointz.stats.mixed_model_rows import Rows, table_rows

DF_METHODS = ("kenward-roger", "satterthwaite")


def mixed_model(
    table: pd.DataFrame,
    *,
    response: str,
    within: str,
    participant: str,
    nested: bool = False,
    df: str = "kenward-roger",
    ci_level: float = 0.95,
) -> MixedModelFit:
    """Test whether levels differ, with participants as a random factor.

    Parameters
    ----------
    table : pandas.DataFrame
        One row a participant and level. A row without a value (NaN), and a combination
        without a row, is a missing cell: the participant's others are used.
    response, within, participant : str
        Columns: what was measured, the levels (in the order of a categorical, else of first
        appearance), and who.
    nested : bool
        Whether rows are replicates: several of a participant and level, as pulses are. The
        cells then have a variance of their own.
    df : str
        Denominator degrees of freedom: ``kenward-roger`` or ``satterthwaite`` (lmerTest).
    ci_level : float
        Of all intervals.

    Returns
    -------
    MixedModelFit
        ``response ~ within + (1 | participant)``, and ``+ (1 | participant:within)`` where
        nested.

    Raises
    ------
    DataError
        When columns are missing, labels are, values are no numbers or constant; when a
        participant or level has no value, or there is one only; when rows are replicates
        without ``nested``, or are none with it; when nothing is left to tell participants
        from error.
    EstimationError
        When there are too few participants for Kenward and Roger's degrees of freedom.

    Notes
    -----
    REML. Balanced and with all variances above 0, the F test is that of repeated-measures
    analysis of variance. Both assume that the differences of all pairs of levels vary
    alike (sphericity): see ``repeated_measures.p_epsilon``, and pairs with ``error="paired"``.
    At a variance of 0 Satterthwaite has the df of ordinary least squares, as lmerTest;
    Kenward and Roger keep the variance in, as pbkrtest. Without sphericity, with random
    differences between levels, or with missing cells that depend on the missing value, the
    test misleads. Satterthwaite's joint df depend on the order of levels where cells are
    missing.

    Examples
    --------
    >>> table = pd.DataFrame({
    ...     "who": ["A", "A", "B", "B", "C", "C"], "point": ["LRE", "MST"] * 3,
    ...     "stiffness": [1.0, 2.0, 3.0, 5.0, 2.0, 2.0]})
    >>> fit = mixed_model(table, response="stiffness", within="point", participant="who")
    >>> round(fit.f_test.F, 4), round(fit.f_test.df_den, 4), round(fit.f_test.p, 4)
    (3.0, 2.0, 0.2254)
    """
    if df not in DF_METHODS:
        raise DataError(f"mixed_model: expected df {' or '.join(DF_METHODS)}, got {df!r}")
    if not 0 < ci_level < 1:
        raise DataError(f"mixed_model: expected 0 < ci_level < 1, got {ci_level}")
    rows = table_rows(
        table, response=response, within=within, participant=participant, nested=nested
    )
    # About the mean: sums of squares of large values lose the differences.
    offset = float(rows.y.mean())
    rows = replace(rows, y=rows.y - offset)
    # Before the fit: it refuses where variances cannot be told apart.
    groups = _groups(rows, response, ci_level, nested=nested)
    blocks, fit = _fit(rows, response, nested=nested)
    singles = _Singles(fit, kenward_roger=df == "kenward-roger", ci_level=ci_level)
    repeated = _repeated_measures(rows)
    return MixedModelFit(
        response=response,
        within=within,
        participant=participant,
        levels=rows.levels,
        nested=nested,
        df_method=df,
        f_test=_f_test(rows, fit, df),
        variances=_variances(fit),
        random_effects=_random_effects(rows, blocks, fit, groups),
        icc=_icc(rows, fit, groups),
        repeated_measures=repeated,
        means=_means(rows, singles, offset),
        comparisons=(*_pooled_pairs(rows, singles), *_paired_pairs(rows)),
        n_rows=rows.y.size,
        n_participants=len(rows.persons),
        missing=tuple((rows.persons[i], rows.levels[j]) for i, j in np.argwhere(rows.counts == 0)),
        ci_level=ci_level,
        settings={"df": df, "nested": nested, "ci_level": ci_level, "version": own_version()},
        notes=(*rows.notes, *_notes(fit, df, complete=repeated is not None)),
    )


# --- the model -----------------------------------------------------------------------------------


def _fit(rows: Rows, response: str, *, nested: bool) -> tuple[CellBlocks, ComponentsFit]:
    cell = rows.cell if nested else None
    try:
        blocks = cell_blocks(rows.design, rows.y, rows.person, cell=cell)
        if nested:
            return blocks, fit_components(blocks)
        return blocks, fit_random_intercept(rows.design, rows.y, rows.person)
    except ValueError as problem:
        raise DataError(f"mixed model of {response!r}: {problem}") from problem


def _f_test(rows: Rows, fit: ComponentsFit, df: str) -> EffectTest:
    contrast = sequential_contrasts(rows.design)
    if df == "satterthwaite":
        return _effect(satterthwaite_test(fit, contrast))
    try:
        return _effect(kenward_roger_test(fit, contrast))
    except ValueError as problem:
        raise EstimationError(Failure.TOO_FEW_PARTICIPANTS, f"mixed_model: {problem}") from problem


def _effect(test: FTest) -> EffectTest:
    return EffectTest(test.statistic, test.df_num, test.df_den, test.p)


def _variances(fit: ComponentsFit) -> Variances:
    v = [float(value) for value in fit.variances]
    return Variances(v[0], v[-1], v[1] if len(v) == 3 else None)


def _groups(
    rows: Rows, response: str, ci_level: float, *, nested: bool
) -> tuple[GroupVariance, GroupVariance | None]:
    """Return the exact analyses of participants, on means of cells, and of cells."""
    counts = rows.counts
    person, level = np.nonzero(counts)
    means = Rows(rows.means[person, level], person, level, rows.persons, rows.levels)
    try:
        people = group_variance(means.design, means.y, person, level=ci_level)
        if not nested:
            return people, None
        of_person = (rows.person[:, None] == np.arange(len(rows.persons))).astype(float)
        beside = np.hstack([rows.design, of_person])
        return people, group_variance(beside, rows.y, rows.cell, level=ci_level)
    except NoErrorLeftError as problem:
        cells = ", or their cells," if nested else ""
        raise DataError(
            f"mixed model of {response!r}: participants and levels{cells} explain every value "
            f"exactly, so that no error is left to test against. Are values computed or copied?"
        ) from problem
    except ValueError as problem:
        message = "; ".join([str(problem), *rows.notes])
        raise DataError(f"mixed model of {response!r}: {message}") from problem


def _random_effects(
    rows: Rows,
    blocks: CellBlocks,
    fit: ComponentsFit,
    groups: tuple[GroupVariance, GroupVariance | None],
) -> tuple[RandomEffectTest, ...]:
    people, cells = groups
    exact = people.test if rows.equal_counts else None
    tests = [_random_effect("participant", likelihood_ratio(blocks, fit, 0), exact)]
    if cells is not None:
        tests.append(_random_effect("cell", likelihood_ratio(blocks, fit, 1), cells.test))
    return tuple(tests)


def _random_effect(effect: str, ratio: float, exact: FTest | None) -> RandomEffectTest:
    p = float(chdtrc(1.0, ratio))
    exact_test = {} if exact is None else asdict(_effect(exact))
    return RandomEffectTest(effect, ratio, p, p / 2.0 if ratio > 0 else 1.0, **exact_test)


def _icc(
    rows: Rows, fit: ComponentsFit, groups: tuple[GroupVariance, GroupVariance | None]
) -> IntraclassCorrelation:
    v, counts = _variances(fit), rows.counts[rows.counts > 0]
    inside = v.residual * float((1.0 / counts).mean()) + (v.cell or 0.0)
    low, high = (
        1.0 if np.isinf(ratio) else ratio / (1.0 + ratio)
        for ratio in (groups[0].ratio_low, groups[0].ratio_high)
    )
    value = v.participant / (v.participant + inside)
    return IntraclassCorrelation(value, low, high, rows.equal_counts)


def _repeated_measures(rows: Rows) -> RepeatedMeasuresTest | None:
    if (rows.counts == 0).any() or not rows.equal_counts:
        return None
    anova = repeated_measures_anova(rows.means)
    return RepeatedMeasuresTest(
        **asdict(_effect(anova.test)), epsilon=anova.epsilon, p_epsilon=anova.p_epsilon
    )


# --- means and pairs -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Singles:
    """Contrasts of levels one at a time, by the chosen method."""

    fit: ComponentsFit
    kenward_roger: bool
    ci_level: float

    def of(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return value, standard error and df of (q, level) weights of level means."""
        # Means of levels from intercept and differences to the first level.
        to_means = np.eye(self.fit.beta.size)
        to_means[:, 0] = 1.0
        contrasts = single_contrasts(self.fit, weights @ to_means, kenward_roger=self.kenward_roger)
        return contrasts.estimate, contrasts.se, contrasts.df


def _means(rows: Rows, singles: _Singles, offset: float) -> tuple[LevelMean, ...]:
    value, se, df = singles.of(np.eye(len(rows.levels)))
    value = value + offset
    half = se * stdtrit(df, (1.0 + singles.ci_level) / 2.0)
    n = np.count_nonzero(rows.counts, axis=0)
    low, high = value - half, value + half
    columns = (column.tolist() for column in (value, se, df, low, high, n))
    return tuple(LevelMean(*mean) for mean in zip(rows.levels, *columns, strict=True))


def _pooled_pairs(rows: Rows, singles: _Singles) -> tuple[LevelPair, ...]:
    pairs = list(combinations(range(len(rows.levels)), 2))
    first, second = np.array(pairs).T
    one = np.eye(len(rows.levels))
    difference, se, df = singles.of(one[first] - one[second])
    t = difference / se
    p = 2.0 * stdtr(df, -np.abs(t))
    both = (rows.counts[:, first] > 0) & (rows.counts[:, second] > 0)
    columns = (column.tolist() for column in (difference, se, df, t, p, both.sum(axis=0)))
    return tuple(
        LevelPair(rows.levels[a], rows.levels[b], "pooled", *pair)
        for (a, b), pair in zip(pairs, zip(*columns, strict=True), strict=True)
    )


def _paired_pairs(rows: Rows) -> tuple[LevelPair, ...]:
    named_means = zip(rows.levels, rows.means.T, strict=True)
    return tuple(_paired_pair(*first, *second) for first, second in combinations(named_means, 2))


def _paired_pair(first: str, a: np.ndarray, second: str, b: np.ndarray) -> LevelPair:
    both = np.isfinite(a) & np.isfinite(b)
    names, n = (first, second, "paired"), int(both.sum())
    try:
        test = paired_difference(a[both], b[both])
    except ValueError:
        # Fewer than two pairs, or all differ alike: there is no error to compare with.
        mean = float((a[both] - b[both]).mean()) if n else None
        return LevelPair(*names, mean, None, None, None, None, n)
    return LevelPair(*names, test.difference, test.se, test.df, test.t, test.p, n)


def _notes(fit: ComponentsFit, df: str, *, complete: bool) -> tuple[str, ...]:
    names = ("participant", "cell") if fit.variances.size == 3 else ("participant",)
    at_zero = [name for name, v in zip(names, fit.variances[:-1], strict=True) if v == 0]
    if not at_zero:
        return ()
    kept = {
        "kenward-roger": "Kenward-Roger keeps it among the unknowns, as pbkrtest does",
        "satterthwaite": "the degrees of freedom are those without it, as in lmerTest",
    }[df]
    exact = "; the repeated-measures ANOVA is exact all the same" if complete else ""
    return (f"the variance of {' and '.join(at_zero)} is 0, at its bound: {kept}{exact}",)
