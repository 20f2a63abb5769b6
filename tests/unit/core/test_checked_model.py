"""The base of edited files: every problem at its own key, nested or not."""

import pytest
from pydantic import ValidationError

from jointz.core.checked_model import CheckedModel, Problem


class Pair(CheckedModel):
    low: int
    high: int

    def checks(self):
        return self._order, self._even

    def _order(self):
        if self.low > self.high:
            yield Problem(("low",), f"{{above}} {self.high}")

    def _even(self):
        if self.high % 2:
            yield Problem(("high",), "odd")


class Holder(CheckedModel):
    pairs: tuple[Pair, ...]


def test_every_problem_stands_at_its_key():
    with pytest.raises(ValidationError) as caught:
        Holder.model_validate({"pairs": ({"low": 4, "high": 3}, {"low": 1, "high": 1})})

    assert [(e["loc"], e["msg"]) for e in caught.value.errors()] == [
        (("pairs", 0, "low"), "{above} 3"),
        (("pairs", 0, "high"), "odd"),
        (("pairs", 1, "high"), "odd"),
    ]


def test_what_is_consistent_is_accepted():
    assert Pair(low=1, high=2).high == 2


def test_it_is_strict_and_frozen():
    with pytest.raises(ValidationError):
        Pair.model_validate({"low": "1", "high": 2})
    with pytest.raises(ValidationError):
        Pair.model_validate({"low": 1, "high": 2, "more": 3})
    with pytest.raises(ValidationError, match="frozen"):
        Pair(low=1, high=2).low = 0
