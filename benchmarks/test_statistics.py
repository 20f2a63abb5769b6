"""Mixed model beside R and statsmodels, waveform tests beside spm1d.

Peers are looked for and left out where they are absent: R with lmerTest and pbkrtest,
statsmodels, spm1d (GPL-3, in an environment of its own, never a dependency). Both sides take
turns, so that they see the same noise of the machine. R's time holds its start, because that is
what a call of R from Python costs. With ``--benchmark-disable`` both run once, R not at all, and
no ratio is asserted.
"""

import shutil
import subprocess
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
import pytest
from benchmarks.figures import Figures, Peer, at_least, of_package
from scipy.ndimage import gaussian_filter1d

from jointz.stats import mixed_model, sign_flip_max_t, spm_paired_t

N_PEOPLE, N_NODES = 10, 101
R_SCRIPT = """
suppressPackageStartupMessages(library(lmerTest))
rows <- read.csv(commandArgs(trailingOnly = TRUE)[1])
fit <- lmer(y ~ level + (1 | who), rows)
anova(fit, ddf = "Kenward-Roger")
ranova(fit)
"""
R_VERSIONS = """
shown <- function(name) paste(name, packageVersion(name))
r <- paste("R", getRversion())
cat(r, shown("lmerTest"), shown("pbkrtest"), sep = ", ")
"""
MIXED = "mixed model, all tests, 60 rows"
NEEDED_OVER_R = 50.0


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """60 rows: ten people at six levels."""
    rng = np.random.default_rng(0)
    people = np.repeat([f"S{k}" for k in range(N_PEOPLE)], 6)
    y = np.repeat(rng.normal(size=N_PEOPLE), 6) + rng.normal(size=6 * N_PEOPLE)
    return pd.DataFrame({"who": people, "level": list("abcdef") * N_PEOPLE, "y": y})


@pytest.fixture(scope="module")
def curves() -> tuple[np.ndarray, np.ndarray]:
    """Two smooth curves of ten people over 101 nodes."""
    noise = np.random.default_rng(0).standard_normal((2 * N_PEOPLE, N_NODES))
    smooth = gaussian_filter1d(noise, 6.0, axis=1)
    return smooth[:N_PEOPLE], smooth[N_PEOPLE:]


def ours(table: pd.DataFrame) -> Any:
    """Fit with all tests and pairs."""
    fit = mixed_model(table, response="y", within="level", participant="who")
    fit.pairs("bonferroni")
    return fit


def in_turns(first: Callable[[], Any], second: Callable[[], Any], n: int) -> tuple[float, float]:
    """Return the least time of either, s."""
    times: list[tuple[float, float]] = []
    for _ in range(n):
        start = perf_counter()
        first()
        middle = perf_counter()
        second()
        times.append((middle - start, perf_counter() - middle))
    a, b = np.min(times, axis=0)
    return float(a), float(b)


@pytest.fixture
def beside(figures: Figures) -> Callable[..., float]:
    """Hand over and print a line, and return the peer's time over ours."""

    def told(what: str, peer: Peer, times: tuple[float, float], needed: float = 1.0) -> float:
        mine, theirs = (1e3 * seconds for seconds in times)
        figures.beside(what, peer, (mine, theirs), "ms", asked=at_least(needed))
        ratio = theirs / mine
        print(f"\n{what:<32}{mine:>9.2f} ms {peer.name:>20}{theirs:>10.2f} ms{ratio:>8.1f} x")
        return ratio

    return told


@pytest.fixture
def without(figures: Figures) -> Callable[[str, str], None]:
    """Take note that a peer is absent, and skip."""

    def skipped(what: str, why: str) -> None:
        figures.left_out(what, why)
        pytest.skip(why)

    return skipped


def test_mixed_model_beside_r(quick, table, tmp_path: Path, beside, without):
    fit = ours(table)
    assert fit.f_test.df_den == pytest.approx(45.0)
    if quick:
        without(f"{MIXED}, beside R", "R takes seconds to start, and little work was asked for")
    r = shutil.which("Rscript")
    if r is None:
        without(f"{MIXED}, beside R", "R is not installed")
    found = subprocess.run([r, "-e", R_VERSIONS], capture_output=True, check=False, text=True)
    if found.returncode:
        without(f"{MIXED}, beside R", "R has no lmerTest or pbkrtest")
    script, rows = tmp_path / "fit.R", tmp_path / "rows.csv"
    script.write_text(R_SCRIPT, encoding="utf-8")
    table.to_csv(rows, index=False)

    def in_r() -> None:
        subprocess.run([r, str(script), str(rows)], capture_output=True, check=True)

    times = in_turns(lambda: ours(table), in_r, 5)
    peer = Peer("lmer, anova, ranova", found.stdout.strip())
    ratio = beside(MIXED, peer, times, NEEDED_OVER_R)
    assert ratio >= NEEDED_OVER_R


def test_mixed_model_beside_statsmodels(quick, table, beside, without):
    if find_spec("statsmodels") is None:
        without(f"{MIXED}, beside MixedLM", "statsmodels is not installed")
    from statsmodels.formula.api import mixedlm

    def theirs() -> Any:
        return mixedlm("y ~ level", table, groups="who").fit(reml=True)

    fit = ours(table)
    assert fit.variances.residual == pytest.approx(theirs().scale, rel=1e-3)
    times = in_turns(lambda: ours(table), theirs, 1 if quick else 20)
    ratio = beside(MIXED, of_package("MixedLM, fit alone", "statsmodels"), times)
    assert quick or ratio >= 1.0


def test_waveforms_beside_spm1d(quick, curves, beside, without):
    a, b = curves
    mine = spm_paired_t(a, b)
    if find_spec("spm1d") is None:
        without("waveform tests beside spm1d", "spm1d is not installed")
    import spm1d

    def theirs() -> Any:
        return spm1d.stats.ttest_paired(a, b).inference(0.05, two_tailed=True)

    def flips_of_theirs() -> Any:
        test = spm1d.stats.nonparam.ttest_paired(a, b)
        return test.inference(0.05, two_tailed=True, iterations=-1, force_iterations=True)

    assert mine.threshold == pytest.approx(theirs().zstar, rel=1e-6)
    spm = in_turns(lambda: spm_paired_t(a, b), theirs, 1 if quick else 50)
    flips = in_turns(lambda: sign_flip_max_t(a, b), flips_of_theirs, 1 if quick else 10)
    ratios = [
        beside("SPM, 10 people, 101 nodes", of_package("ttest_paired", "spm1d"), spm),
        beside("1024 sign flips, 101 nodes", of_package("nonparam.ttest_paired", "spm1d"), flips),
    ]
    assert quick or min(ratios) >= 1.0
