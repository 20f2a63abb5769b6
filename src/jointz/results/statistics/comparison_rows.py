"""Rows of a comparison: values, means, differences, tests, repeatability."""

from dataclasses import dataclass

from jointz.results.statistics.mixed_model_fit import MixedModelFit

#: How two sets of values were compared.
PAIRED, GROUPS, POOLED = "paired", "groups", "pooled"
#: Status of a mean or difference that the data do not decide.
UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Source:
    """One of the compared results."""

    name: str  # name in tables and figures
    participants: tuple[str, ...]  # all participants, with a value or without
    methods: tuple[str, ...] = ()  # methods of its estimates
    published: bool = False  # whether the source is tables 4.1 to 4.3 of the dissertation


@dataclass(frozen=True, slots=True)
class PersonValue:
    """One participant's compared value."""

    source: str  # name of the source
    participant: str
    parameter: str
    timing_point: str
    value: float | None  # estimate, SI; None where there is none
    ci_low: float | None = None  # lower end of the participant's own interval, SI
    ci_high: float | None = None  # upper end of the participant's own interval, SI
    # as in ``estimates.csv``; ``absent`` without a row there; ``mean_over_points`` for a mean
    status: str = "ok"
    n_points: int = 1  # number of timing points of a mean over them
    n_lacking: int = 0  # number of timing points without a value, not in the mean
    n_bounded: int = 0  # number of values in the mean that are at their bound

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
    # people with a value, values at a bound included; of people together, whoever's data count
    n: int
    n_missing: int  # all others
    n_at_bound: int  # people whose value is at its bound
    mean: float | None  # over people, in ``unit``; None below three people, or undecided
    # standard deviation between people, in ``unit``, as in ``population.csv``; None below three
    sd: float | None
    ci_low: float | None  # lower end of the interval, in ``unit``
    ci_high: float | None  # upper end of the interval, in ``unit``
    # root mean square of the standard errors of the people's estimates, where their intervals are
    # two-sided, in ``unit``
    error_sd: float | None = None
    # ``ok`` or ``undecided`` of people together; ``failed:too_few_participants`` below three
    # people; empty of a plain mean over values
    status: str = ""
    sample_sd: float | None = None  # SD of the values with their errors, in ``unit``


@dataclass(frozen=True, slots=True)
class Difference:
    """Two sets of values compared: first minus second."""

    parameter: str  # compared parameter
    unit: str
    timing_point: str  # empty where timing points are compared with each other
    first: str  # name of the first source or timing point
    second: str  # name of the second source or timing point
    # ``paired``: the same people, or timing points of one source; ``groups``: different people, by
    # Welch's test; ``pooled``: timing points of one source, by the error of its mixed model
    design: str
    n_first: int  # people of ``first`` with a value; the number of pairs where people are the same
    # people of ``second`` with a value; the number of pairs where people are the same
    n_second: int
    n_at_bound: int  # values at their bound, of ``first`` and ``second`` together
    mean_first: float | None = None  # mean of ``first``, in ``unit``
    mean_second: float | None = None  # mean of ``second``, in ``unit``
    difference: float | None = None  # mean difference, in ``unit``
    # lower end of the interval of ``difference``, not adjusted for other comparisons
    ci_low: float | None = None
    # upper end of the interval of ``difference``, not adjusted for other comparisons
    ci_high: float | None = None
    # statistic of Student's or Welch's test; None of people together, whose ``p`` is twice the
    # smaller probability of either sign
    t: float | None = None
    df: float | None = None  # degrees of freedom of ``t``
    p: float | None = None  # not adjusted; also of an undecided difference
    # p adjusted over the differences of the parameter, by ``Comparison.adjust``
    p_adjusted: float | None = None
    # ``g_z``: mean over standard deviation of the differences; ``g``: mean difference over the
    # pooled standard deviation; both with Hedges' correction of bias. ``d_z`` and ``d``: the same
    # of true values, without errors of measurement. Empty where there is none
    effect: str = ""
    effect_size: float | None = None  # value of ``effect``
    effect_low: float | None = None  # lower end of its interval
    effect_high: float | None = None  # upper end of its interval
    margin: float | None = None  # margin of equivalence, in ``unit``, if requested
    # larger p of the two one-sided tests; of people together the probability of lying beyond
    p_equivalence: float | None = None
    # Greenhouse and Geisser's epsilon of the test over all timing points, where everybody has a
    # value at each
    epsilon: float | None = None
    p_epsilon: float | None = None  # p of that test with ``epsilon``
    # ``ok``; ``undecided``; ``failed:too_few_participants``; ``no_spread`` where nothing varies
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
    # source whose timing points are compared, or timing point at which sources are compared
    where: str
    fit: MixedModelFit | None  # mixed model; None where there is none
    reason: str = ""  # reason for a missing ``fit``


@dataclass(frozen=True, slots=True)
class Repeatability:
    """Repeatability of values of the same people."""

    parameter: str
    unit: str
    timing_point: str
    n: int  # people with all values
    k: int  # values of each person
    icc_agreement: float | None = None  # ICC(A,1): shifts between days count as error
    icc_agreement_low: float | None = None
    icc_agreement_high: float | None = None
    icc_consistency: float | None = None  # ICC(C,1): shifts between days do not count as error
    icc_consistency_low: float | None = None
    icc_consistency_high: float | None = None
    # standard error of measurement without shifts between days, in ``unit``
    sem: float | None = None
    sem_low: float | None = None  # lower end of its interval, in ``unit``
    sem_high: float | None = None  # upper end of its interval, in ``unit``
    # minimal detectable change of one person, 95 %, in ``unit``: t * sqrt(2) * ``sem``, with
    # Student's t for the degrees of freedom of ``sem``
    mdc: float | None = None
    mdc_low: float | None = None  # ``sem_low`` times the same t * sqrt(2), in ``unit``
    mdc_high: float | None = None  # ``sem_high`` times the same t * sqrt(2), in ``unit``
    status: str = "ok"  # ``ok``; ``failed:too_few_participants``; ``no_spread``


@dataclass(frozen=True, slots=True)
class ReferenceRange:
    """A published value shown beside a mean; nothing is tested against it."""

    name: str  # name of the publication
    parameter: str
    timing_point: str
    value: float | None  # published mean, where there is one, SI
    low: float  # lower end of the interval over people or of the stated range, SI
    high: float  # upper end of the interval over people or of the stated range, SI
    words: str  # description of the numbers


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
