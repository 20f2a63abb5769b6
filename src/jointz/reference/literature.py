"""What the dissertation states of other studies of the knee and ankle (4.4, appendix A).

Only what the text states stands here: where figures 4.4 and A.1 show other people's values, the
text gives no number but for one factor.
"""

from typing import Final

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
#: Of Pfeifer in swing: stiffness larger "by a factor of approximately two or three".
STIFFNESS_FACTOR: Final = (2.0, 3.0)
_LARGER = {("pfeifer", "ISW"), ("pfeifer", "MSW")}


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
    if (study, timing_point) not in _LARGER:
        return None
    low, high = STIFFNESS_FACTOR
    return round(low * mean, 6), round(high * mean, 6)
