"""Studies pooled against R's metafor."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jointz.kernels.statistics.between_study_variance import random_effects

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
