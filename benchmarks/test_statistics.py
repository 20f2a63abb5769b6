"""Mixed model beside R and statsmodels, waveform tests beside spm1d.

Peers are looked for and left out where they are absent: R with lmerTest and pbkrtest,
statsmodels, spm1d (GPL-3, in an environment of its own, never a dependency). Both sides take
turns, so that they see the same noise of the machine. R's time holds its start, because that is
what a call of R from Python costs. With ``--benchmark-disable`` ours runs once beside the peers
that are quick, and no ratio is asserted.
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


def beside(name: str, peer: str, times: tuple[float, float]) -> float:
    """Print a line and return the peer's time over ours."""
    mine, theirs = times
    ratio = theirs / mine
    print(f"\n{name:<32}{mine * 1e3:>9.2f} ms{peer:>14}{theirs * 1e3:>10.2f} ms{ratio:>8.1f} x")
    return ratio


def quick(request: pytest.FixtureRequest) -> bool:
    """Return whether figures are not wanted."""
    return bool(request.config.getoption("benchmark_disable"))


def test_mixed_model_beside_r(request, table, tmp_path: Path):
    fit = ours(table)
    assert fit.f_test.df_den == pytest.approx(45.0)
    r = shutil.which("Rscript")
    if r is None or quick(request):
        pytest.skip("Rscript is absent, or figures are not wanted")
    found = subprocess.run(
        [r, "-e", "stopifnot(requireNamespace('lmerTest'), requireNamespace('pbkrtest'))"],
        capture_output=True,
        check=False,
    )
    if found.returncode:
        pytest.skip("R has no lmerTest or pbkrtest")
    script, rows = tmp_path / "fit.R", tmp_path / "rows.csv"
    script.write_text(R_SCRIPT, encoding="utf-8")
    table.to_csv(rows, index=False)

    def in_r() -> None:
        subprocess.run([r, str(script), str(rows)], capture_output=True, check=True)

    times = in_turns(lambda: ours(table), in_r, 5)
    assert beside("mixed model, all tests, 60 rows", "R", times) >= NEEDED_OVER_R


def test_mixed_model_beside_statsmodels(request, table):
    if find_spec("statsmodels") is None:
        pytest.skip("statsmodels is absent")
    from statsmodels.formula.api import mixedlm

    def theirs() -> Any:
        return mixedlm("y ~ level", table, groups="who").fit(reml=True)

    fit = ours(table)
    assert fit.variances.residual == pytest.approx(theirs().scale, rel=1e-3)
    if quick(request):
        return
    times = in_turns(lambda: ours(table), theirs, 20)
    assert beside("mixed model, all tests, 60 rows", "MixedLM", times) >= 1.0


def test_waveforms_beside_spm1d(request, curves):
    a, b = curves
    mine = spm_paired_t(a, b)
    if find_spec("spm1d") is None:
        pytest.skip("spm1d is absent")
    import spm1d

    def theirs() -> Any:
        return spm1d.stats.ttest_paired(a, b).inference(0.05, two_tailed=True)

    def flips_of_theirs() -> Any:
        test = spm1d.stats.nonparam.ttest_paired(a, b)
        return test.inference(0.05, two_tailed=True, iterations=-1, force_iterations=True)

    assert mine.threshold == pytest.approx(theirs().zstar, rel=1e-6)
    if quick(request):
        return
    spm = in_turns(lambda: spm_paired_t(a, b), theirs, 50)
    flips = in_turns(lambda: sign_flip_max_t(a, b), flips_of_theirs, 10)
    assert beside("SPM, 10 people, 101 nodes", "spm1d", spm) >= 1.0
    assert beside("1024 sign flips, 101 nodes", "spm1d", flips) >= 1.0
