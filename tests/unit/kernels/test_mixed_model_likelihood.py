"""One random intercept against lmerTest, closed form and a dense likelihood."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointz.kernels.statistics.kenward_roger import satterthwaite_test
from jointz.kernels.statistics.mixed_model_components import fit_random_intercept

HERE = Path(__file__).parent
ORACLE = json.loads((HERE / "mixed_model_oracle.json").read_text(encoding="utf-8"))


def oracle_data(name):
    rows = pd.read_csv(HERE / "mixed_model_oracle.csv").query("set == @name")
    kind, direction = rows["type"].to_numpy(float), rows["direction"].to_numpy(float)
    design = np.column_stack([np.ones(len(rows)), kind, direction, kind * direction])
    return design, rows["y"].to_numpy(), rows["trial"].to_numpy()


@pytest.mark.parametrize("name", ORACLE)
def test_estimates_variances_and_tests_are_those_of_lmertest(name):
    known = ORACLE[name]
    fit = fit_random_intercept(*oracle_data(name))

    np.testing.assert_allclose(fit.beta, known["beta"], rtol=1e-7)
    np.testing.assert_allclose(np.sqrt(np.diag(fit.covariance)), known["se"], rtol=1e-7)
    np.testing.assert_allclose(fit.variances, known["variances"], rtol=1e-6)
    singles = [satterthwaite_test(fit, np.eye(4)[k]) for k in (1, 2, 3)]
    # lmerTest differentiates numerically, 1e-8 at best.
    np.testing.assert_allclose([t.df_den for t in singles], known["df_den"], rtol=1e-7)
    np.testing.assert_allclose([t.statistic for t in singles], known["f"], rtol=1e-7)
    np.testing.assert_allclose([t.p for t in singles], known["p"], rtol=1e-6)
    joint = satterthwaite_test(fit, np.eye(4)[1:])
    np.testing.assert_allclose(
        [joint.df_num, joint.df_den, joint.statistic, joint.p], known["joint"], rtol=1e-6
    )


ONES = np.ones((4, 1))
PAIRS = np.array([0, 0, 1, 1])


@pytest.mark.parametrize(
    ("design", "response", "group", "message"),
    [
        (ONES, np.arange(3.0), PAIRS, "design"),
        (ONES, np.array([1.0, np.nan, 2.0, 3.0]), PAIRS, "finite"),
        (np.ones((4, 2)), np.arange(4.0), PAIRS, "independent"),
        (ONES, np.full(4, 7.0), PAIRS, "fixed effects"),
        (ONES, np.array([1.0, 1.0, 2.0, 2.0]), PAIRS, "inside the groups"),
        (np.column_stack([ONES, PAIRS]), np.array([0.0, 1.0, 3.0, 1.0]), PAIRS, "more groups"),
        (ONES, np.array([0.0, 1e-7, 1.0, 1.0]), PAIRS, "next to none"),
        (np.eye(4), np.arange(4.0), PAIRS, "fixed effects"),
    ],
)
def test_what_cannot_be_fitted_is_refused(design, response, group, message):
    with pytest.raises(ValueError, match=message):
        fit_random_intercept(design, response, group)


def test_contrasts_must_fit_the_effects():
    fit = fit_random_intercept(*oracle_data("balanced"))
    with pytest.raises(ValueError, match="contrasts of 4 effects, got 2"):
        satterthwaite_test(fit, np.eye(2))
    with pytest.raises(ValueError, match="not 0 everywhere"):
        satterthwaite_test(fit, np.zeros((1, 4)))
