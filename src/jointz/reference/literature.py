"""Other studies of the knee and ankle, as the dissertation states them (4.4, appendix A).

Only what the text states stands here: where figures 4.4 and A.1 show other people's values, the
text gives no number but for one factor.
"""

from dataclasses import dataclass
from typing import Final, Literal

from jointz.reference import chapter4

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
    quantity: Literal["stiffness", "damping", "inertia"]
    relation: Literal["similar", "higher", "lower", "different"]  # of the study's values
    words: str  # statement in the words of the text
    timing_points: tuple[str, ...]  # compared timing points
    factor_low: float | None = (
        None  # printed lower end of the study's value over the dissertation's
    )
    factor_high: float | None = None  # its upper end
    source: str = "4.4"  # section of the dissertation


_STANCE_EARLY, _STANCE_MID, _STANCE_END = ("LRE",), ("MST",), ("TST",)
_SWING = ("ISW", "MSW")
#: 20 and 30 % of a swing from 62 to 100 % are 69.6 and 73.4 % of the cycle.
_TUCKER_SWING = ("ISW",)
_MATCH = "matched results from other knee perturbation studies closely"
_HIGHER = "all of our damping estimates were higher than the corresponding literature"
_EARLY = "among the largest differences: early stance and swing"
_LARGER = "larger than ours by a factor of approximately two or three"


#: Every comparison of values in 4.4, by study, quantity and timing point.
COMPARISONS: Final = (
    StatedComparison("kooij", "stiffness", "similar", _MATCH, _SWING),
    StatedComparison("kooij", "inertia", "similar", _MATCH, _SWING),
    StatedComparison("kooij", "damping", "lower", _HIGHER, _SWING),
    StatedComparison("tucker", "stiffness", "similar", _MATCH, _TUCKER_SWING),
    StatedComparison("tucker", "inertia", "similar", _MATCH, _TUCKER_SWING),
    StatedComparison("tucker", "damping", "lower", _HIGHER, _TUCKER_SWING),
    StatedComparison("pfeifer", "stiffness", "different", _EARLY, _STANCE_EARLY),
    StatedComparison("pfeifer", "stiffness", "similar", "similar magnitudes", _STANCE_MID),
    StatedComparison("pfeifer", "stiffness", "higher", "higher than our estimates", _STANCE_END),
    StatedComparison("pfeifer", "stiffness", "higher", _LARGER, _SWING, 2.0, 3.0),
    StatedComparison("sartori", "stiffness", "different", _EARLY, _STANCE_EARLY),
    StatedComparison("sartori", "stiffness", "similar", "similar magnitudes", _STANCE_MID),
    StatedComparison("sartori", "stiffness", "similar", "matched ours well", _STANCE_END),
    StatedComparison("sartori", "stiffness", "different", _EARLY, _SWING),
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
    for row in COMPARISONS:
        is_same = row.study == study and timing_point in row.timing_points
        if is_same and row.factor_low is not None and row.factor_high is not None:
            return round(row.factor_low * mean, 6), round(row.factor_high * mean, 6)
    return None
