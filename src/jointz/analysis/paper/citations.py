"""Citations of a methods section."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Citation:
    """One entry of a list of references."""

    short: str  # citation in a text
    full: str  # entry in the list of references


#: Key -> entry, in the order of the list.
CITATIONS: Final = {
    "jointz": Citation(
        "The jointz developers",
        "The jointz developers. jointz: joint mechanical impedance with honest intervals. Computer "
        "program, version as in the text.",
    ),
    "dissertation": Citation(
        "dissertation, 4.2",
        "Estimation of Knee Joint Impedance During Walking and its Implications for Robotic "
        "Control and Beyond. Dissertation, read in a copy without author, university and year.",
    ),
    "bootstrap": Citation(
        "Efron 1979",
        "Efron B. Bootstrap methods: another look at the jackknife. Annals of Statistics 7 (1979) "
        "1-26. doi:10.1214/aos/1176344552",
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
        "Methods 18 (12, 1989) 4335-4358. doi:10.1080/03610928908830159",
    ),
    "jackknife": Citation(
        "Efron 1982",
        "Efron B. The jackknife, the bootstrap and other resampling plans. Society for Industrial "
        "and Applied Mathematics, Philadelphia (1982). doi:10.1137/1.9781611970319",
    ),
    "instruments": Citation(
        "Young 2011",
        "Young PC. Recursive estimation and time-series analysis. 2nd edition, Springer, Berlin "
        "(2011), chapter 8",
    ),
}


def cite(key: str) -> str:
    """Return how a text cites an entry."""
    return f"({CITATIONS[key].short})"


def cited(texts: Iterable[str]) -> list[str]:
    """Return the full entries that texts cite, in the order of the list."""
    whole = " ".join(texts)
    return [entry.full for key, entry in CITATIONS.items() if cite(key) in whole]
