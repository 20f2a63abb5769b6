"""Other studies of the knee and ankle, as the dissertation states them (4.4, appendix A).

Only what the text states stands here: where figures 4.4 and A.1 show other people's values, the
text gives no number but for one factor.
"""

from dataclasses import dataclass
from typing import Final, Literal

from jointz.reference import chapter4

Relation = Literal["similar", "higher", "lower", "different"]

#: Studies that the dissertation compares with -> their names in the text.
STUDIES: Final = {
    "rouse": "Rouse",
    "tucker": "Tucker",
    "lee": "Lee",
    "ficanha": "Ficanha",
    "kooij": "van der Kooij",
    "pfeifer": "Pfeifer",
    "sartori": "Sartori",
}


@dataclass(frozen=True, slots=True)
class StatedComparison:
    """What the text says of a study's values beside the dissertation's."""

    study: str  # key of :data:`STUDIES`
    # ``stiffness``, ``damping`` or ``inertia``
    quantity: Literal["stiffness", "damping", "inertia"]
    # compared timing points; empty for all where the study has values
    timing_points: tuple[str, ...]
    # of the study's values to the dissertation's: ``similar``, ``higher``, ``lower``, ``different``
    relation: Relation
    factor_low: float | None  # printed lower end of the study's value over the dissertation's
    factor_high: float | None  # printed upper end of the study's value over the dissertation's
    source: str  # section of the dissertation
    words: str  # statement in the words of the text


_STANCE_EARLY, _STANCE_MID, _STANCE_END = ("LRE",), ("MST",), ("TST",)
_SWING = ("ISW", "MSW")
#: 20 and 30 % of a swing from 62 to 100 % are 69.6 and 73.4 % of the cycle.
_TUCKER_SWING = ("ISW",)
_FACTOR = (2.0, 3.0)
_MATCH = "matched results from other knee perturbation studies closely"
_HIGHER = "all of our damping estimates were higher than the corresponding literature"
_EARLY = "among the largest differences: early stance and swing"


def _said(
    study: str,
    quantity: Literal["stiffness", "damping", "inertia"],
    relation: Relation,
    words: str,
    *,
    points: tuple[str, ...] = (),
    factor: tuple[float, float] | None = None,
) -> StatedComparison:
    low, high = factor or (None, None)
    return StatedComparison(study, quantity, points, relation, low, high, "4.4", words)


#: Every comparison of values in 4.4, by study, quantity and timing point.
COMPARISONS: Final = (
    _said("kooij", "stiffness", "similar", _MATCH, points=_SWING),
    _said("kooij", "inertia", "similar", _MATCH, points=_SWING),
    _said("kooij", "damping", "lower", _HIGHER, points=_SWING),
    _said("tucker", "stiffness", "similar", _MATCH, points=_TUCKER_SWING),
    _said("tucker", "inertia", "similar", _MATCH, points=_TUCKER_SWING),
    _said("tucker", "damping", "lower", _HIGHER, points=_TUCKER_SWING),
    _said("pfeifer", "stiffness", "different", _EARLY, points=_STANCE_EARLY),
    _said("pfeifer", "stiffness", "similar", "similar magnitudes", points=_STANCE_MID),
    _said("pfeifer", "stiffness", "higher", "higher than our estimates", points=_STANCE_END),
    _said(
        "pfeifer",
        "stiffness",
        "higher",
        "larger than ours by a factor of approximately two or three",
        points=_SWING,
        factor=_FACTOR,
    ),
    _said("sartori", "stiffness", "different", _EARLY, points=_STANCE_EARLY),
    _said("sartori", "stiffness", "similar", "similar magnitudes", points=_STANCE_MID),
    _said("sartori", "stiffness", "similar", "matched ours well", points=_STANCE_END),
    _said("sartori", "stiffness", "different", _EARLY, points=_SWING),
)


def stated_stiffness_range(study: str, timing_point: str) -> tuple[float, float] | None:
    """Return the range that a printed factor gives a study's stiffness at a timing point.

    Parameters
    ----------
    study : str
        Key of :data:`STUDIES`.
    timing_point : str
        One of the six timing points.

    Returns
    -------
    tuple of float or None
        Lowest and highest, N*m/rad/kg: the factor times the printed mean of table 4.1. None
        where the text has no number.

    Raises
    ------
    KeyError
        For a study or timing point that is not known.

    Notes
    -----
    'Approximately two or three' is read off a figure by the dissertation's author; this is a
    range in words, not a value of the study.

    Examples
    --------
    >>> stated_stiffness_range("pfeifer", "MSW")
    (0.76, 1.14)
    >>> stated_stiffness_range("sartori", "MSW") is None
    True
    """
    if study not in STUDIES:
        raise KeyError(f"study: expected one of {', '.join(STUDIES)}; got {study!r}.")
    mean = chapter4.STIFFNESS_MEANS[timing_point].value
    for said in COMPARISONS:
        stands = said.study == study and timing_point in said.timing_points
        if stands and said.factor_low is not None and said.factor_high is not None:
            return round(said.factor_low * mean, 6), round(said.factor_high * mean, 6)
    return None
