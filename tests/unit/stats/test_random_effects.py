"""Studies pooled: R's metafor, people to studies."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jointz.kernels.statistics.between_study_variance import random_effects
from jointz.stats.random_effects import mean_over_people

#: Written by make_metafor_reference.R.
METAFOR: dict[str, dict[str, dict[str, Any]]] = json.loads(
    Path(__file__).with_name("metafor_reference.json").read_text()
)
#: What the issue asks of the pooled estimate; metafor's own search of T ends near there.
WITHIN = 1e-6


@pytest.mark.parametrize("name", METAFOR["univariate"])
def test_one_parameter_is_as_metafor_has_it(name: str) -> None:
    held = {k: np.array(v, dtype=float) for k, v in METAFOR["univariate"][name].items()}
    fit = random_effects(held["values"], held["variances"])
    for field in ("mean", "se", "i2_pct", "q", "weights"):
        assert getattr(fit, field) == pytest.approx(held[field].squeeze(), rel=WITHIN), field
    assert fit.tau2 == pytest.approx(held["tau2"][0], rel=WITHIN, abs=0.0)
    assert fit.q_p == pytest.approx(held["q_p"][0], rel=WITHIN)
    assert [fit.low, fit.high] == pytest.approx(held["interval"], rel=WITHIN)
    ends = [fit.prediction_low, fit.prediction_high]
    assert ends == pytest.approx(held["prediction"], rel=WITHIN)
    assert [fit.tau2_low, fit.tau2_high] == pytest.approx(held["tau2_interval"], rel=WITHIN)
    modified = random_effects(held["values"], held["variances"], modified=True)
    assert [modified.low, modified.high] == pytest.approx(held["modified"], rel=WITHIN)


def test_people_that_differ_count_by_their_spread_alone() -> None:
    rng = np.random.default_rng(2)
    values = rng.multivariate_normal([60.0, 1.5], [[64.0, 0.8], [0.8, 0.04]], size=30)
    mean, covariance = mean_over_people(values, np.tile(np.diag([1.0, 1e-3]), (30, 1, 1)))
    assert mean == pytest.approx(values.mean(axis=0))
    assert covariance == pytest.approx(np.cov(values, rowvar=False) / 30)


def test_people_alike_by_chance_gain_no_more_weight_than_their_own_errors_allow() -> None:
    values = np.array([[60.0, 1.50], [60.1, 1.60], [59.9, 1.45]])
    own = np.array([[9.0, 0.1], [0.1, 0.01]])
    covariance = mean_over_people(values, np.tile(own, (3, 1, 1)))[1]
    assert np.linalg.eigvalsh(covariance - own / 3).min() >= -1e-12
    between = np.cov(values, rowvar=False)
    # Never below the people's own errors in any direction, never below their spread either.
    assert np.linalg.eigvalsh(covariance - between / 3).min() >= -1e-9


def test_an_error_that_all_people_share_does_not_average_out() -> None:
    values = np.random.default_rng(3).normal([60.0, 1.5], [6.0, 0.2], size=(400, 2))
    shared, alone = (
        mean_over_people(values, np.zeros((400, 2, 2)), shared_sd=sd) for sd in (0.05, 0.0)
    )
    mean = values.mean(axis=0)
    assert shared[1] - alone[1] == pytest.approx(0.0025 * np.outer(mean, mean))


@pytest.mark.parametrize("values", [[[1.0]], [[1.0], [np.nan]]])
def test_one_person_and_gaps_are_refused(values: list[list[float]]) -> None:
    with pytest.raises(ValueError, match=r"people|gaps"):
        mean_over_people(np.array(values), np.zeros((len(values), 1, 1)))
