"""What a methods section cites, and when."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Citation:
    """One entry of a list of references.

    Parameters
    ----------
    short : str
        How the text cites it.
    full : str
        How the list gives it.
    """

    short: str
    full: str


#: Key -> entry, in the order of the list.
CITATIONS: Final = {
    "dissertation": Citation(
        "dissertation, 4.2",
        # The copy that jointz was made from bears neither author nor year: nothing is made up.
        "Estimation of Knee Joint Impedance During Walking and its Implications for Robotic "
        "Control and Beyond. Dissertation. [author, university and year to be added]",
    ),
    "bootstrap": Citation(
        "Efron 1979",
        "Efron B. Bootstrap methods: another look at the jackknife. Annals of Statistics 7 (1979) "
        "1-26. doi:10.1214/aos/1176344552",
    ),
    "unified": Citation(
        "Feldman and Cousins 1998",
        "Feldman GJ, Cousins RD. Unified approach to the classical statistical analysis of small "
        "signals. Physical Review D 57 (1998) 3873-3889. doi:10.1103/PhysRevD.57.3873",
    ),
    "ridge": Citation(
        "Hoerl and Kennard 1970",
        "Hoerl AE, Kennard RW. Ridge regression: biased estimation for nonorthogonal problems. "
        "Technometrics 12 (1970) 55-67. doi:10.1080/00401706.1970.10488634",
    ),
    "evidence": Citation(
        "Kass and Raftery 1995",
        "Kass RE, Raftery AE. Bayes factors. Journal of the American Statistical Association 90 "
        "(1995) 773-795. doi:10.1080/01621459.1995.10476572",
    ),
    "sandwich": Citation(
        "Liang and Zeger 1986",
        "Liang KY, Zeger SL. Longitudinal data analysis using generalized linear models. "
        "Biometrika 73 (1986) 13-22. doi:10.1093/biomet/73.1.13",
    ),
    "corrected_scores": Citation(
        "Stefanski 1989",
        "Stefanski LA. Unbiased estimation of a nonlinear function of a normal mean with "
        "application to measurement error models. Communications in Statistics, Theory and "
        "Methods 18 (1989) 4335-4358",
    ),
}


def cite(key: str) -> str:
    """Return how a text cites an entry.

    Parameters
    ----------
    key : str
        Of :data:`CITATIONS`.

    Examples
    --------
    >>> cite("bootstrap")
    '(Efron 1979)'
    """
    return f"({CITATIONS[key].short})"


def cited(texts: Iterable[str]) -> list[str]:
    """Return the full entries that texts cite, in the order of the list.

    Parameters
    ----------
    texts : iterable of str
        What was written with :func:`cite`.

    Examples
    --------
    >>> cited(["resampled (Efron 1979)"])[0][:8]
    'Efron B.'
    """
    whole = " ".join(texts)
    return [entry.full for key, entry in CITATIONS.items() if cite(key) in whole]
