"""The rows of a comparison: whose values, means, differences, tests, repeatability."""

from dataclasses import dataclass

from jointz.core.mixed_model_fit import MixedModelFit

#: How two sets of values were compared.
PAIRED, GROUPS, POOLED = "paired", "groups", "pooled"


@dataclass(frozen=True, slots=True)
class Source:
    """One of the results that are compared.

    Parameters
    ----------
    name : str
        As tables and figures call it.
    participants : tuple of str
        Everybody in it, with a value or without.
    methods : tuple of str
        That made its estimates.
    published : bool
        Whether it is the dissertation's tables 4.1 to 4.3.
    """

    name: str
    participants: tuple[str, ...]
    methods: tuple[str, ...] = ()
    published: bool = False


@dataclass(frozen=True, slots=True)
class PersonValue:
    """One participant's value, as it was compared.

    Parameters
    ----------
    source, participant, parameter, timing_point : str
        Whose, and of what.
    value, ci_low, ci_high : float or None
        Estimate and its own interval, SI; None where there is none.
    status : str
        As in ``estimates.csv``; ``absent`` where there is no row; ``mean_over_points``.
    n_points, n_lacking, n_bounded : int
        Of a mean over timing points: how many it is of, how many have no value and are not in
        it, how many of those in it stand at their bound.
    """

    source: str
    participant: str
    parameter: str
    timing_point: str
    value: float | None
    ci_low: float | None = None
    ci_high: float | None = None
    status: str = "ok"
    n_points: int = 1
    n_lacking: int = 0
    n_bounded: int = 0

    @property
    def at_bound(self) -> bool:
        """Whether the value stands at its bound, or is a mean that holds such values."""
        return self.status == "at_bound" or self.n_bounded > 0


@dataclass(frozen=True, slots=True)
class SourceMean:
    """The mean of a source over people.

    Parameters
    ----------
    source, parameter, unit, timing_point : str
        Of what.
    n : int
        People with a value; those at a bound count with it.
    n_missing, n_at_bound : int
        People without a value, and people whose value stands at its bound.
    mean, sd, ci_low, ci_high : float or None
        Mean, standard deviation between people and Student's interval; None below two people.
    error_sd : float or None
        Root mean square of the people's own standard errors, where their estimates have
        two-sided intervals.
    """

    source: str
    parameter: str
    unit: str
    timing_point: str
    n: int
    n_missing: int
    n_at_bound: int
    mean: float | None
    sd: float | None
    ci_low: float | None
    ci_high: float | None
    error_sd: float | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """Two sets of values compared: first minus second.

    Parameters
    ----------
    parameter, unit, timing_point : str
        Of what; timing_point is empty where timing points themselves are compared.
    first, second : str
        Names of the sources, or of the timing points.
    design : str
        ``paired``: the same people, or timing points of one source; ``groups``: different
        people, Welch; ``pooled``: timing points of one source, by the error of its mixed model.
    n_first, n_second : int
        People with a value; both are the number of pairs where these are the same people.
    n_at_bound : int
        Values among them that stand at their bound.
    mean_first, mean_second, difference, ci_low, ci_high : float or None
        Means and their difference, with an interval that holds alone.
    t, df, p, p_adjusted : float or None
        Student's or Welch's test, and p adjusted over the differences of the parameter, as
        ``Comparison.adjust`` says.
    effect : str
        ``g_z``: mean over standard deviation of the differences; ``g``: mean difference over
        the pooled standard deviation; both without bias (Hedges). Empty where there is none.
    effect_size, effect_low, effect_high : float or None
        With the interval of the noncentral t distribution.
    margin : float or None
        Of equivalence, in ``unit``, where one was asked for.
    p_equivalence : float or None
        The larger one of the two one-sided tests.
    epsilon, p_epsilon : float or None
        Of the test over all timing points that the pair belongs to, where everybody has a
        value at each: Greenhouse and Geisser's epsilon, and p with it.
    status : str
        ``ok``; ``failed:too_few_participants``; ``no_spread`` where nothing varies.
    """

    parameter: str
    unit: str
    timing_point: str
    first: str
    second: str
    design: str
    n_first: int
    n_second: int
    n_at_bound: int
    mean_first: float | None = None
    mean_second: float | None = None
    difference: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    t: float | None = None
    df: float | None = None
    p: float | None = None
    p_adjusted: float | None = None
    effect: str = ""
    effect_size: float | None = None
    effect_low: float | None = None
    effect_high: float | None = None
    margin: float | None = None
    p_equivalence: float | None = None
    epsilon: float | None = None
    p_epsilon: float | None = None
    status: str = "ok"

    @property
    def stands(self) -> bool:
        """Whether the difference could be tested."""
        return self.status == "ok"


@dataclass(frozen=True, slots=True)
class FactorTest:
    """A mixed model of a parameter over timing points, or over several results.

    Parameters
    ----------
    parameter, unit : str
        Of what.
    factor : str
        ``timing_point`` or ``condition``.
    where : str
        The source whose timing points, or the timing point whose sources are compared.
    fit : MixedModelFit or None
        The model; None where there is none.
    reason : str
        Why there is none.
    """

    parameter: str
    unit: str
    factor: str
    where: str
    fit: MixedModelFit | None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Repeatability:
    """How well values of the same people repeat.

    Parameters
    ----------
    parameter, unit, timing_point : str
        Of what.
    n, k : int
        People with all values, and values of each.
    icc_agreement, icc_agreement_low, icc_agreement_high : float or None
        ICC(A,1): shifts between days count as error.
    icc_consistency, icc_consistency_low, icc_consistency_high : float or None
        ICC(C,1): they do not.
    sem, sem_low, sem_high : float or None
        Standard error of measurement, shifts between days left out, in ``unit``.
    mdc, mdc_low, mdc_high : float or None
        Minimal detectable change of one person, 95 %: t sqrt(2) sem, with Student's t for the
        degrees of freedom of the SEM. Its interval is the SEM's times the same t sqrt(2).
    status : str
        ``ok``; ``failed:too_few_participants``; ``no_spread``.
    """

    parameter: str
    unit: str
    timing_point: str
    n: int
    k: int
    icc_agreement: float | None = None
    icc_agreement_low: float | None = None
    icc_agreement_high: float | None = None
    icc_consistency: float | None = None
    icc_consistency_low: float | None = None
    icc_consistency_high: float | None = None
    sem: float | None = None
    sem_low: float | None = None
    sem_high: float | None = None
    mdc: float | None = None
    mdc_low: float | None = None
    mdc_high: float | None = None
    status: str = "ok"


@dataclass(frozen=True, slots=True)
class ReferenceRange:
    """What is published beside a mean; nothing is tested against it.

    Parameters
    ----------
    name, parameter, timing_point : str
        Whose, and of what.
    value : float or None
        Mean, where there is one.
    low, high : float
        Its interval over people, or the stated range.
    words : str
        What the numbers are.
    """

    name: str
    parameter: str
    timing_point: str
    value: float | None
    low: float
    high: float
    words: str


def difference_text(row: Difference) -> str:
    """Return a difference in one line.

    Parameters
    ----------
    row : Difference
        One that stands.
    """
    where = f"{row.timing_point}: " if row.timing_point else ""
    people = f"n {row.n_first}"
    if row.design == GROUPS:
        people = f"n {row.n_first} and {row.n_second}"
    return (
        f"{where}{row.first} - {row.second} = {row.difference:.4g} [{row.ci_low:.4g}, "
        f"{row.ci_high:.4g}] {row.unit}, p {row.p_adjusted:.2g}, {people}"
    )
