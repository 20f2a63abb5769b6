"""What jointz writes beside a table holds for that table only: another program may change it."""

import numpy as np
import pytest

from jointz.core.acquisition import Acquisition, Event, Signal, SignalGroup
from jointz.io.text.side_information import filled, first_other_time, read_beside, written_beside

A, B = np.arange(3.0), np.arange(3.0) * 9
GROUP = SignalGroup("g", (Signal("a", A, "deg"), Signal("b", B, "N", "of the plate")), rate_hz=50.0)
OWN = Acquisition((GROUP,), (Event(1.0, "go"),), {"subject": "S01"})
TIMES = np.array([0.0, 0.02, 0.04])
TOLD = read_beside(written_beside(OWN, GROUP))


def test_samples_come_back_with_all_that_was_written_beside_them():
    assert filled(TOLD, {"a": A, "b": B}, TIMES, labels=["a", "b"]).equals(OWN)


@pytest.mark.parametrize(
    ("columns", "stamps", "words"),
    [
        ({"b": B, "a": A}, TIMES, "number 1 is 'a' there, and 'b' in the table"),
        ({"a": A}, TIMES, "number 2 is 'b' there, and 'none' in the table"),
        ({"a": A, "b": B, "c": B}, TIMES, "number 3 is 'none' there, and 'c' in the table"),
        ({"a": A, "b": B}, None, "the table has no column of time"),
        ({"a": A, "b": B}, TIMES + 0.02, "50 Hz, and sample 1 is at 0.02 s, not at 0 s"),
        ({"a": A, "b": B.astype(object)}, TIMES, "tells of 0 columns of text, the table has 1"),
    ],
)
def test_a_table_that_was_changed_is_refused(columns, stamps, words):
    with pytest.raises(ValueError, match="the jointz line") as caught:
        filled(TOLD, columns, stamps, labels=["a", "b"])

    assert words in str(caught.value)


def test_times_may_be_rounded_and_not_moved():
    assert first_other_time(np.array([0.0, 0.02001, 0.04]), 50.0, 0.0) is None
    assert first_other_time(np.array([0.0, 0.021, 0.04]), 50.0, 0.0) == 1
