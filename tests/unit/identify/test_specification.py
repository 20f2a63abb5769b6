"""Hypotheses about the inertia, taken apart and weighted anew."""

from dataclasses import dataclass

import numpy as np
import pytest

from jointz.identify.response_model import Hypothesis
from jointz.identify.response_posterior import JointPosterior
from jointz.identify.specification import Choices, of_inertia_model


@dataclass(frozen=True)
class Found:
    hypothesis: Hypothesis
    log_evidence: float


POSTERIOR = JointPosterior(
    (
        Found(Hypothesis(0.01, 0.1), np.log(6.0)),
        Found(Hypothesis(0.01, 0.02), np.log(2.0)),
        Found(Hypothesis(0.1, 0.1), np.log(1.0)),
        Found(Hypothesis(0.35, 0.1), np.log(1.0)),
    ),
    np.array([0.6, 0.2, 0.1, 0.1]),
)


def test_one_inertia_keeps_its_hypotheses_and_what_they_are_worth_to_each_other():
    one = of_inertia_model(POSTERIOR, "one")

    assert {p.hypothesis.inertia_sd for p in one.posteriors} == {0.01}
    assert one.weights == pytest.approx([0.75, 0.25])


def test_a_free_inertia_is_the_freest_there_is():
    free = of_inertia_model(POSTERIOR, "free")

    assert [p.hypothesis.inertia_sd for p in free.posteriors] == [0.35]
    assert free.weights == pytest.approx([1.0])


def test_pooled_inertias_are_all_hypotheses_together():
    assert of_inertia_model(POSTERIOR, "pooled") is POSTERIOR


def test_hypotheses_that_the_data_rule_out_can_still_be_looked_at():
    ruled_out = JointPosterior(
        (Found(Hypothesis(0.01, 0.1), 0.0), Found(Hypothesis(0.35, 0.1), -2000.0)),
        np.array([1.0, 0.0]),
    )

    assert of_inertia_model(ruled_out, "free").weights == pytest.approx([1.0])


def test_an_unknown_model_of_the_inertia_is_refused():
    with pytest.raises(ValueError, match="inertia_models: expected one or more names among one"):
        Choices(inertia_models=("two",))
