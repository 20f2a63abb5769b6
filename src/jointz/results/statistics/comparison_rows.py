"""Rows of a comparison: values, means, differences, tests, repeatability."""

from dataclasses import dataclass

from jointz.results.statistics.mixed_model_fit import MixedModelFit

#: How two sets of values were compared.
PAIRED, GROUPS, POOLED = "paired", "groups", "pooled"


@dataclass(frozen=True, slots=True)
class Source:
    """One of the compared results."""

    name: str  # as tables and figures call it
    participants: tuple[str, ...]  # everybody in it, with a value or without
    methods: tuple[str, ...] = ()  # that made its estimates
    published: bool = False  # whether it is the dissertation's tables 4.1 to 4.3


@dataclass(frozen=True, slots=True)
class PersonValue:
    """One participant's compared value."""

    source: str  # whose, and of what
    participant: str
    parameter: str
    timing_point: str
    value: float | None  # estimate and its own interval, SI; None where there is none
    ci_low: float | None = None
    ci_high: float | None = None
    # as in ``estimates.csv``; ``absent`` where there is no row; ``mean_over_points``
    status: str = "ok"
    # of a mean over timing points: how many it is of, how many have no value and are not in it, how
    # many of those in it stand at their bound
    n_points: int = 1
    n_lacking: int = 0
    n_bounded: int = 0

    @property
    def at_bound(self) -> bool:
        """Whether the value stands at its bound, or is a mean that holds such values."""
        return self.status == "at_bound" or self.n_bounded > 0


@dataclass(frozen=True, slots=True)
class SourceMean:
    """The mean of a source over people."""

    source: str
    parameter: str
    unit: str
    timing_point: str
    n: int  # people with a value; those at a bound count with it
    n_missing: int  # people without a value, and people whose value stands at its bound
    n_at_bound: int
    # mean, standard deviation between people and Student's interval; None below two people
    mean: float | None
    sd: float | None
    ci_low: float | None
    ci_high: float | None
    # root mean square of the people's own standard errors, where their estimates have two-sided
    # intervals
    error_sd: float | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """Two sets of values compared: first minus second."""

    parameter: str  # of what; timing_point is empty where timing points themselves are compared
    unit: str
    timing_point: str
    first: str  # names of the sources, or of the timing points
    second: str
    # ``paired``: the same people, or timing points of one source; ``groups``: different people,
    # Welch; ``pooled``: timing points of one source, by the error of its mixed model
    design: str
    # people with a value; both are the number of pairs where these are the same people
    n_first: int
    n_second: int
    n_at_bound: int  # values among them that stand at their bound
    mean_first: float | None = None  # means and their difference, with an interval that holds alone
    mean_second: float | None = None
    difference: float | None = None
    ci_low: float | None = None
    ci_high: float | None = None
    # Student's or Welch's test, and p adjusted over the differences of the parameter, as
    # ``Comparison.adjust`` says
    t: float | None = None
    df: float | None = None
    p: float | None = None
    p_adjusted: float | None = None
    # ``g_z``: mean over standard deviation of the differences; ``g``: mean difference over the
    # pooled standard deviation; both without bias (Hedges). Empty where there is none
    effect: str = ""
    effect_size: float | None = None  # with the interval of the noncentral t distribution
    effect_low: float | None = None
    effect_high: float | None = None
    margin: float | None = None  # of equivalence, in ``unit``, where one was asked for
    p_equivalence: float | None = None  # the larger one of the two one-sided tests
    # of the test over all timing points that the pair belongs to, where everybody has a value at
    # each: Greenhouse and Geisser's epsilon, and p with it
    epsilon: float | None = None
    p_epsilon: float | None = None
    # ``ok``; ``failed:too_few_participants``; ``no_spread`` where nothing varies
    status: str = "ok"

    @property
    def available(self) -> bool:
        """Whether the difference could be tested."""
        return self.status == "ok"


@dataclass(frozen=True, slots=True)
class FactorTest:
    """A mixed model of a parameter over timing points, or over several results."""

    parameter: str
    unit: str
    factor: str  # ``timing_point`` or ``condition``
    where: str  # the source whose timing points, or the timing point whose sources are compared
    fit: MixedModelFit | None  # the model; None where there is none
    reason: str = ""  # why there is none


@dataclass(frozen=True, slots=True)
class Repeatability:
    """Repeatability of values of the same people."""

    parameter: str
    unit: str
    timing_point: str
    n: int  # people with all values, and values of each
    k: int
    icc_agreement: float | None = None  # ICC(A,1): shifts between days count as error
    icc_agreement_low: float | None = None
    icc_agreement_high: float | None = None
    icc_consistency: float | None = None  # ICC(C,1): they do not
    icc_consistency_low: float | None = None
    icc_consistency_high: float | None = None
    # standard error of measurement, shifts between days left out, in ``unit``
    sem: float | None = None
    sem_low: float | None = None
    sem_high: float | None = None
    # minimal detectable change of one person, 95 %: t sqrt(2) sem, with Student's t for the degrees
    # of freedom of the SEM. Its interval is the SEM's times the same t sqrt(2)
    mdc: float | None = None
    mdc_low: float | None = None
    mdc_high: float | None = None
    status: str = "ok"  # ``ok``; ``failed:too_few_participants``; ``no_spread``


@dataclass(frozen=True, slots=True)
class ReferenceRange:
    """A published value shown beside a mean; nothing is tested against it."""

    name: str  # whose, and of what
    parameter: str
    timing_point: str
    value: float | None  # mean, where there is one
    low: float  # its interval over people, or the stated range
    high: float
    words: str  # what the numbers are


def difference_text(row: Difference) -> str:
    """Return a difference in one line."""
    where = f"{row.timing_point}: " if row.timing_point else ""
    people = f"n {row.n_first}"
    if row.design == GROUPS:
        people = f"n {row.n_first} and {row.n_second}"
    return (
        f"{where}{row.first} - {row.second} = {row.difference:.4g} [{row.ci_low:.4g}, "
        f"{row.ci_high:.4g}] {row.unit}, p {row.p_adjusted:.2g}, {people}"
    )
